# SPDX-License-Identifier: Apache-2.0
"""Parts of the estimator of one foot, each with its own state."""

from __future__ import annotations

import math
from collections import deque

from ros_pad.estimation.friction import Posterior

TARE_TIME = 0.5
"""Time over which the force of a foot in the air is averaged, s."""

OFFSET_SHARE = 0.05
"""Prior standard deviation of the offset of a force sensor, share of the expected load."""

NEW_PLACE = 5e-4
"""Distance over which a sliding foot meets new ground, m."""

LONGEST_STEP = 5.0
"""Longest time between touch-downs of a walking foot, s: after a longer time its speed is unknown.
"""

FADING_STEP = 0.02
"""Least distance by which the posterior fades without measurements, m: more than the jitter of a
marker.
"""


class Offset:
    """Offset of a force sensor: the mean of its readings in the air.

    Parameters
    ----------
    expected_load : float
        Normal force in stance, N.

    Attributes
    ----------
    x, y, z, moment : float
        Mean force, N, and mean torque about z, N m.
    sd : float
        Standard deviation of the offset of the force, N.
    """

    __slots__ = ('_air_time', 'moment', 'sd', 'x', 'y', 'z')

    def __init__(self, expected_load: float) -> None:
        self.x = self.y = self.z = self.moment = 0.0
        self.sd = OFFSET_SHARE * expected_load
        self._air_time = 0.0

    @property
    def known(self) -> bool:
        """Whether the foot was in the air."""
        return self._air_time > 0.0

    def update(self, dt: float, fx: float, fy: float, fz: float, moment: float) -> None:
        """Process forces, N, and a torque, N m, read in the air dt seconds after the last ones."""
        # This is a plain mean at first, and an exponential one after TARE_TIME.
        dt = min(dt, TARE_TIME)
        self._air_time += dt
        share = dt / min(TARE_TIME + dt, self._air_time)
        self.x += share * (fx - self.x)
        self.y += share * (fy - self.y)
        self.z += share * (fz - self.z)
        self.moment += share * (moment - self.moment)
        self.sd *= 1.0 - share


class Motion:
    """Velocity of the contact over the floor, from its smoothed position.

    Parameters
    ----------
    smoothing : float
        Time constant of the smoothing, s, above 0.

    Attributes
    ----------
    x, y : float
        Smoothed position of the contact, m.
    """

    __slots__ = ('_smoothing', 'x', 'y')

    def __init__(self, smoothing: float) -> None:
        self._smoothing = smoothing
        self.x = self.y = 0.0

    def begin(self, x: float, y: float) -> None:
        """Begin a stance at a position, m."""
        self.x, self.y = x, y

    def update(self, x: float, y: float, dt: float) -> tuple[float, float]:
        """Process a position, m, dt seconds after the last one; return the velocity, m/s."""
        smoothing = self._smoothing
        share = dt / (smoothing + dt)
        self.x += share * (x - self.x)
        self.y += share * (y - self.y)
        return (x - self.x) / smoothing, (y - self.y) / smoothing


class Window:
    """Sums of the samples since the last update of the filter."""

    __slots__ = ('count', 'first', 'load', 'noise', 'pull', 'speed', 'start', 'turning')

    def __init__(self) -> None:
        self.start = 0.0
        self.first = True  # whether this is the first window of its stance
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self.count = 0
        self.load = self.pull = self.speed = self.turning = self.noise = 0.0

    def begin(self, time: float, first: bool) -> None:
        """Begin a window at a time, s; ``first`` says whether it is the first of its stance."""
        self.start, self.first = time, first
        self.clear()

    def add(
        self, load: float, pull: float, turning: float, speed: float, noise: float = 0.0
    ) -> None:
        """Add normal force, tangential force, friction used by turning, N, and slip speed, m/s.

        ``noise`` is the standard deviation of a measured slip speed, m/s.
        """
        self.count += 1
        self.load += load
        self.pull += pull
        self.turning += turning
        self.speed += speed
        self.noise += noise


class Stance:
    """State of one stance.

    Attributes
    ----------
    height : float
        Height of the marker at touch-down, m; infinite before the first touch-down.
    dome_share : float
        Share of the expected load that domes carry, 0 to 1.
    peak_load, peak_ratio, peak_turning : float
        Largest normal force, N; largest T/N of the pull, and of the friction used by turning, each
        as the mean of a window.
    """

    __slots__ = ('_counted', 'dome_share', 'height', 'peak_load', 'peak_ratio', 'peak_turning')

    def __init__(self, height: float = math.inf, dome_share: float = 0.0) -> None:
        self.height = height
        self.dome_share = dome_share
        self.peak_load = self.peak_ratio = self.peak_turning = 0.0
        self._counted: tuple[float, float, float] | None = None

    def forget_counted(self) -> None:
        """Give the next window full weight."""
        self._counted = None

    def weight(self, ratio: float, noise: float, x: float, y: float) -> float:
        """Return the share of a window that is new evidence, 0 to 1.

        A foot at the same place under the same pull repeats its measurement. So the weight grows
        with the change of T/N (relative to its noise) and of the place, m, since earlier windows.
        """
        if self._counted is None:
            self._counted = ratio, x, y
            return 1.0
        old_ratio, old_x, old_y = self._counted
        pull, dx, dy = ratio - old_ratio, x - old_x, y - old_y
        change = (pull / noise) ** 2 + (dx * dx + dy * dy) / NEW_PLACE**2
        weight = -math.expm1(-0.5 * change)
        self._counted = old_ratio + weight * pull, old_x + weight * dx, old_y + weight * dy
        return weight


class Path:
    """Distances that a foot moves between its stances, with which the posterior fades."""

    __slots__ = ('_footprint', '_speed', '_touch_down', '_unseen')

    def __init__(self) -> None:
        self._footprint: tuple[float, float] | None = None
        self._touch_down = -math.inf  # time of the last touch-down, s
        self._speed = 0.0  # mean speed of the foot's steps, m/s
        self._unseen = 0.0  # distance moved without a marker, not yet returned for fading, m

    def restart(self) -> None:
        """Discard the time of the last touch-down, because the clock has been set back."""
        self._touch_down = -math.inf

    def touch_down(self, time: float, x: float, y: float) -> float:
        """Process a touch-down at a time, s, and place, m; return the distance to fade by, m.

        This is the distance from the last known place, 0 if there is none.
        """
        distance = math.dist(self._footprint or (x, y), (x, y))
        if self._footprint and time - self._touch_down < LONGEST_STEP:
            self._speed += 0.3 * (distance / (time - self._touch_down) - self._speed)
        self._footprint, self._touch_down = (x, y), time
        return distance

    def seen(self, x: float, y: float) -> float:
        """Process a position, m, without usable force; return the distance to fade by, m."""
        distance = math.dist(self._footprint, (x, y)) if self._footprint else 0.0
        if distance > FADING_STEP or self._footprint is None:
            self._footprint = (x, y)
        return distance if distance > FADING_STEP else 0.0

    def unseen(self, dt: float) -> float:
        """Process dt seconds without a usable position; return the distance to fade by, m.

        The foot is assumed to continue at its mean speed.
        """
        self._unseen += 0.0 if math.isinf(dt) else self._speed * dt
        distance, self._footprint = self._unseen, None
        if distance <= FADING_STEP:
            return 0.0
        self._unseen = 0.0
        return distance


class History:
    """Recent posteriors, kept because a sensor fault is detected only after some time.

    Parameters
    ----------
    duration : float
        Time for which posteriors are kept, s.
    """

    __slots__ = ('_duration', '_entries')

    def __init__(self, duration: float) -> None:
        self._duration = duration
        self._entries: deque[tuple[float, Posterior]] = deque()

    def add(self, time: float, posterior: Posterior) -> None:
        """Add the posterior of a time, s."""
        entries = self._entries
        entries.append((time, posterior))
        while len(entries) > 1 and entries[1][0] <= time - self._duration:
            entries.popleft()

    def clear(self) -> None:
        """Discard all posteriors."""
        self._entries.clear()

    def undo(self, since: float) -> Posterior | None:
        """Return the last posterior up to a time, s, or the first one if all are later.

        Return None if no posterior is later. Discard all posteriors.
        """
        before = [posterior for at, posterior in self._entries if at <= since]
        found = None
        if len(before) < len(self._entries):
            found = (before or [self._entries[0][1]])[-1]
        self._entries.clear()
        return found
