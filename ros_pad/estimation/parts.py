# SPDX-License-Identifier: Apache-2.0
"""Parts of the estimator, each with its own state; arrays are of samples, numbers and feet."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from ros_pad.estimation.friction import Posterior
from ros_pad.records import Array

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


def followed(start: Array, targets: Array, shares: Array) -> Array:
    """Return x after each of x ← x + share (target - x), from its start.

    The start is of numbers and feet, targets have samples before, shares are of samples and feet.
    """
    if len(targets) == 1:
        first: Array = start + shares * (targets - start)
        return first
    # What is kept of the start; more than nothing, for the division.
    kept = np.multiply.accumulate(np.maximum(1.0 - shares, 1e-100))[:, None]
    found: Array = kept * (start + np.add.accumulate(shares[:, None] / kept * targets))
    return found


class Offset:
    """Offset of each force sensor: the mean of its readings in the air.

    Parameters
    ----------
    expected_load : float
        Normal force in stance, N.
    feet : int
        Number of feet.

    Attributes
    ----------
    state : array (6, feet)
        Mean force, N, mean torque about z, N m, standard deviation of the offset of the force, N,
        and time in the air, s, above 0 when the offset is known.
    """

    __slots__ = ('_shares', '_times', '_values', 'state')

    def __init__(self, expected_load: float, feet: int) -> None:
        self.state = np.zeros((6, feet))
        self.state[4] = OFFSET_SHARE * expected_load

    def ahead(self, dt: Array, forces: Array, air: Array) -> Array:
        """Return forces and torque after each of several samples, of which some are in the air."""
        # This is a plain mean at first, and an exponential one after TARE_TIME.
        dt = np.where(air, np.minimum(dt, TARE_TIME), 0.0)
        self._times = self.state[5] + np.add.accumulate(dt)
        self._shares = dt / np.maximum(np.minimum(TARE_TIME + dt, self._times), 1e-12)
        self._values = followed(self.state[:4], forces, self._shares)
        return self._values

    @property
    def first(self) -> Array:
        """Forces and torque after the first of these samples."""
        found: Array = self._values[0]
        return found

    def use(self, count: int) -> None:
        """Use the first of these samples."""
        self.state[:4], self.state[5] = self._values[count - 1], self._times[count - 1]
        self.state[4] *= np.multiply.reduce(1.0 - self._shares[:count])


class SlipSpeed:
    """Velocity of the contacts over the floor, from their smoothed positions.

    Parameters
    ----------
    smoothing : float
        Time constant of the smoothing, s, above 0.
    feet : int
        Number of feet.

    Attributes
    ----------
    state : array (2, feet)
        Smoothed position of the contact, m.
    """

    __slots__ = ('_smoothing', 'state')

    def __init__(self, smoothing: float, feet: int) -> None:
        self._smoothing = smoothing
        self.state = np.zeros((2, feet))

    def update(self, places: Array, dt: Array) -> tuple[Array, Array]:
        """Process positions, m; return the smoothed ones, and velocities, m/s."""
        smooth = followed(self.state, places, dt / (self._smoothing + dt))
        self.state[:] = smooth[-1]
        return smooth, (places - smooth) / self._smoothing


class Ahead:
    """Whether feet go on as they are in the samples to come, see :meth:`Stances.ahead`.

    Attributes
    ----------
    rise : array of bool (feet,)
        Which ones rise at the first sample.
    change : array of bool (feet,)
        Which ones land or lift off at the first sample.
    count : int
        For how many samples none of them does.
    """

    __slots__ = ('air', 'change', 'count', 'light', 'moved', 'rise')

    def __init__(self, rise: Array, light: Array, air: Array, same: Array, sure: int) -> None:
        self.rise, self.light, self.air, self.change = rise, light, air, ~same[0]
        self.moved = bool(air.any())
        steady = same.all(axis=1)
        self.count = sure if steady.all() else min(sure, int(steady.argmin()))


class Stances:
    """Which feet stand, and at which heights.

    Parameters
    ----------
    lift_off : float
        Load below which a foot does not stand, N.
    least : float
        Load below which a foot may be in the air, if it is higher than in its last stance, N.
    feet : int
        Number of feet.

    Attributes
    ----------
    stands : array of bool (feet,)
        Which feet stand.
    height : array (feet,)
        Height of the marker in the last stance, m; infinite if unknown.
    state : array (3, feet)
        These heights, heights at touch-down, and those that a standing foot cannot reach, m.
    """

    __slots__ = ('_base', '_least', '_lift_off', '_top', 'height', 'stands', 'state')

    def __init__(self, lift_off: float, least: float, feet: int) -> None:
        self._lift_off, self._least = lift_off, least
        self.state = np.full((3, feet), math.inf)
        self.height, self._base, self._top = self.state
        self.stands = np.zeros(feet, bool)

    def ahead(
        self, dt: Array, forces: Array, heights: Array, offset: Offset, lifted: Array | None
    ) -> Ahead:
        """Find out how feet go on; offset.use is then ready for as many samples.

        Those that have just been lifted are in the air at the first sample.
        """
        load = forces[:, 2] - offset.state[2]
        light = load < self._least
        rise = heights > self._top
        air = heights > self._heights(heights, light) + AIRBORNE
        air &= light
        air |= rise
        sure = len(heights)
        if lifted is not None:
            air[0] |= lifted
        if air.any():
            after = offset.ahead(dt, forces, air)
            load[1:] = forces[1:, 2] - after[:-1, 2]
            if ((load < self._least) != light).any():  # from there on the offset may not change
                sure = max(1, int(((load < self._least) != light).any(axis=1).argmax()))
            load[air] = 0.0
        same = (load >= self._lift_off) == self.stands
        return Ahead(rise[0], light, air, same, sure)

    def _heights(self, heights: Array, light: Array) -> Array:
        """Return the heights of the last stance at each sample."""
        if len(heights) == 1 or not (light & self.stands).any():
            return self.height
        found = [self.height]
        for height, unloaded in zip(heights[:-1], light[:-1], strict=True):
            found.append(np.where(self.stands & ~unloaded, height, found[-1]))
        return np.array(found)

    def use(self, heights: Array, light: Array) -> None:
        """Use samples in which no foot lands or lifts off."""
        if not (light & self.stands).any():
            heights, light = heights[-1:], light[-1:]
        for height, unloaded in zip(heights, light, strict=True):
            np.copyto(self.height, height, where=self.stands & ~unloaded)

    def land(self, foot: int, height: float) -> None:
        """Begin a stance of a foot at a height, m."""
        self.stands[foot] = True
        self._base[foot], self._top[foot] = height, height + AIRBORNE

    def lift(self, foot: int, rises: bool = False) -> None:
        """End the stance of a foot, which may have risen: the ground cannot rise with it."""
        self.stands[foot] = False
        self._top[foot] = math.inf
        if rises:
            self.height[foot] = self._base[foot]


class Stance:
    """Evidence of one stance.

    Attributes
    ----------
    dome_share : float
        Share of the expected load that domes carry, 0 to 1.
    peak_load, peak_ratio, peak_turning : float
        Largest normal force, N; largest T/N of the pull, and of the friction used by turning, each
        as the mean of a window.
    counted : tuple of float or None
        T/N and place, m, of what earlier windows have shown; None to give the next full weight.
    """

    __slots__ = ('counted', 'dome_share', 'peak_load', 'peak_ratio', 'peak_turning')

    def __init__(self, dome_share: float = 0.0) -> None:
        self.dome_share = dome_share
        self.peak_load = self.peak_ratio = self.peak_turning = 0.0
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
