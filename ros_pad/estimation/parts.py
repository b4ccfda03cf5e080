# SPDX-License-Identifier: Apache-2.0
"""Parts of the estimator of a foot, each with its own state."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from ros_pad.estimation.alarm import SlipAlarm
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

AIRBORNE = 0.01
"""Rise above the height of its last stance, m, from which on a foot certainly touches nothing."""


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


class Gate:
    """Whether a foot stands, by its load and height.

    Parameters
    ----------
    lift_off : float
        Load below which a foot does not stand, N.
    least : float
        Load below which a foot that is higher than in its last stance is in the air, N.

    Attributes
    ----------
    stands : bool
        Whether it stands.
    height : float
        Height of the marker in the last stance, m; infinite if unknown.
    top : float
        Height that it cannot reach while it stands, m.
    least : float
        As given.
    firm : float
        Load with which it is sure to stand below the top, N.
    """

    __slots__ = ('_base', '_lift_off', 'firm', 'height', 'least', 'stands', 'top')

    def __init__(self, lift_off: float, least: float) -> None:
        self._lift_off, self.least, self.firm = lift_off, least, max(lift_off, least)
        self.height = self._base = self.top = math.inf
        self.stands = False

    @property
    def air(self) -> float:
        """Height above which a foot with little load touches nothing, m."""
        return self.height + AIRBORNE

    def aloft(self, load: float, height: float) -> bool:
        """Return whether a foot with a load, N, at a height, m, is in the air."""
        if self.stands and height > self.top:
            self.height = self._base  # the ground cannot rise with the foot
            return True
        return load < self.least and height > self.air

    def update(self, load: float) -> bool:
        """Return whether a foot stands with a load, N."""
        self.stands = load >= self._lift_off
        return self.stands

    def touch_down(self, height: float) -> None:
        """Begin a stance at a height, m."""
        self._base, self.top = height, height + AIRBORNE


class Slip:
    """Slip of a foot.

    Parameters
    ----------
    alarm : SlipAlarm
        Slip alarm.

    Attributes
    ----------
    alarm : SlipAlarm
        As given.
    x, y : float
        Smoothed position of the contact, m; with joints the smoothed shear of the pads.
    noise : float
        Standard deviation of the slip speed without that of the body, m/s.
    contact_noise : float
        That of a coordinate of the contact, m.
    sd : float
        Standard deviation of the last slip speed, m/s; infinite while it is not known.
    """

    __slots__ = ('alarm', 'contact_noise', 'noise', 'sd', 'x', 'y')

    def __init__(self, alarm: SlipAlarm) -> None:
        self.alarm = alarm
        self.x = self.y = self.noise = self.contact_noise = self.sd = 0.0


class Window:
    """Sums of the samples of a stance since the last update of the filter.

    Attributes
    ----------
    start : float
        Its beginning, s.
    first : bool
        Whether it is the first one of its stance.
    count : int
        Number of samples.
    sums : sequence of float
        Sums of normal force, tangential force, friction used by turning, N,
        slip speed, and standard deviation of that, m/s.
    peak : float
        Largest normal force of the stance, N.
    """

    __slots__ = ('count', 'first', 'peak', 'start', 'sums')

    def __init__(self, start: float, first: bool = True, peak: float = 0.0) -> None:
        self.start, self.first, self.peak = start, first, peak
        self.count = 0
        self.sums: Sequence[float] = (0.0,) * 5

    def add(self, samples: Sequence[tuple[float, ...]]) -> None:
        """Add samples, each with the numbers of the sums."""
        self.sums = [*map(sum, zip(self.sums, *samples, strict=True))]
        self.count += len(samples)
        self.peak = max(self.peak, max(samples)[0])


class Stance:
    """Evidence of one stance.

    Attributes
    ----------
    dome_share : float
        Share of the expected load that domes carry, 0 to 1.
    peak_ratio, peak_turning : float
        Largest T/N of the pull, and of the friction used by turning, each
        as the mean of a window.
    counted : tuple of float or None
        T/N and place, m, of what earlier windows have shown; None to give the next full weight.
    """

    __slots__ = ('counted', 'dome_share', 'peak_ratio', 'peak_turning')

    def __init__(self, dome_share: float = 0.0) -> None:
        self.dome_share = dome_share
        self.peak_ratio = self.peak_turning = 0.0
        self.counted: tuple[float, float, float] | None = None

    def weight(self, ratio: float, noise: float, x: float, y: float) -> float:
        """Return the share of a window that is new evidence, 0 to 1.

        A foot at the same place under the same pull repeats its measurement. So the weight grows
        with the change of T/N (relative to its noise) and of the place, m, since earlier windows.
        """
        if self.counted is None:
            self.counted = ratio, x, y
            return 1.0
        old_ratio, old_x, old_y = self.counted
        pull, dx, dy = ratio - old_ratio, x - old_x, y - old_y
        change = (pull / noise) ** 2 + (dx * dx + dy * dy) / NEW_PLACE**2
        weight = -math.expm1(-0.5 * change)
        self.counted = old_ratio + weight * pull, old_x + weight * dx, old_y + weight * dy
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
