# SPDX-License-Identifier: Apache-2.0
"""Find faults of the force sensors and markers of feet from their readings alone.

Readings of analogue sensors have noise: a sensor that repeats a number to the last bit has
stopped, or is at the end of its range. Readings are also faulty if they are too large, too old or
change faster than a foot can move. An offset cannot be found from one sensor, and is not a fault
here.
"""

from __future__ import annotations

import math

import numpy as np

from ros_pad.estimation import doubt
from ros_pad.estimation.doubt import Doubt
from ros_pad.records import Array

PATIENCE = 0.1
"""Time for which a value may stay the same to the last bit, s: markers are sampled more slowly
than forces, and converters have steps."""

FEWEST = 12
"""Number of equal samples that a fault also requires: at low rates two may be equal by chance."""

OLDEST_POSITION = 0.05
"""Age above which a position is too old to measure slip, s: in that time a foot at 40 mm/s slides
2 mm."""

DEAD = 2.0
"""Time for which a force sensor may read exactly zero, s, as simulated feet do in the air. A
sensor whose resolution is coarser than twice its noise may repeat any reading for this time."""

DEAD_ON_GROUND = 0.4
"""Time for which a force sensor may read exactly zero at the height of the last stance, s."""

LEAST = 1e-12
"""Least measured noise of a sensor, N and m: at 0 repeated readings would be no fault."""

LEAP = 5.0
"""Speed above which a loaded foot cannot move, m/s."""

LEAP_DISTANCE = 0.02
"""Distance above which a jump at such a speed cannot come from clock jitter, m."""

READINGS = [0, 1, 2, 4, 5, 6]
"""Places of force and position in the numbers of a sample."""


class Faults:
    """Find faults of the force sensor and the marker of each foot.

    Parameters
    ----------
    force_noise, position_noise : float
        Standard deviations of the sensors, N and m; if one is 0, its sensor may repeat readings.
    force_range : float
        Largest component of force that a sensor can show, N; infinite if not known.
    feet : int
        Number of feet.

    Attributes
    ----------
    state : array (28, feet)
        Last readings; time since which each has not changed; number of equal readings; smallest
        change so far; time of the last position, time since which the foot is not aloft, whether
        the force sensor was found dead, whether the last position can be used.
    since : list of float
        Time at which the last fault of each foot began, s; infinite if there was none.
    """

    def __init__(
        self, force_noise: float, position_noise: float, force_range: float, feet: int
    ) -> None:
        noises = np.array([force_noise] * 3 + [position_noise] * 3)
        self._noises = np.repeat(noises[:, None], feet, axis=1)
        self._range = force_range
        self.state = np.empty((28, feet))
        self.last, self._since, self._counts, self._steps = self.state[:24].reshape(4, 6, feet)
        self._seen, self._grounded, self._dead, self.marker_valid = self.state[24:]
        self.since = [math.inf] * feet
        self._behind = False  # whether samples were skipped
        self._fine = np.zeros(feet, bool)  # whether each value changed by twice its noise or less
        for foot in range(feet):
            self.restart(foot)

    def restart(self, foot: int) -> None:
        """Discard all readings of a foot, because the clock has been set back."""
        fresh = (math.nan, 0.0, 0.0, math.inf)
        for rows, value in zip((self.last, self._since, self._counts, self._steps), fresh,
                               strict=True):  # fmt: skip
            rows[:, foot] = value
        self.state[24:, foot] = -math.inf, math.inf, 0.0, 1.0
        self.since[foot] = math.inf
        self._fine[foot] = False

    def set_noise(self, foot: int, force_noise: float, position_noise: float) -> None:
        """Change the standard deviations of a foot, N and m; a sensor without noise stays so.

        One that has noise, but repeats itself, is at the least taken to have hardly any.
        """
        new = np.repeat(np.maximum((force_noise, position_noise), LEAST), 3)
        self._noises[:, foot] = np.where(self._noises[:, foot] > 0.0, new, 0.0)

    def plain(self, values: Array, ages: Array | None, period: float) -> Array | None:
        """Return which samples can be no fault; None if all of them.

        The values are those of samples, numbers and feet, the ages of positions and the shortest
        time between samples are in s.
        """
        if not self._fine.all():
            return np.zeros(len(values), bool)
        readings = values[:, READINGS]
        moved = np.concatenate((self.last[None], readings[:-1]))
        moved -= readings
        np.abs(moved, out=moved)
        far = 0.5 * max(LEAP_DISTANCE, LEAP * period)  # in each coordinate
        odd = ages is not None or self._range < math.inf
        if not odd and moved.all() and not moved[:, 3:].max() > far:
            return None
        plain = moved.all(axis=(1, 2)) & ~(moved[:, 3:] > far).any(axis=(1, 2))
        if ages is not None:
            plain &= ~(ages > 0.0).any(axis=1)
        if self._range < math.inf:
            plain &= ~(np.abs(readings[:, :3]) >= self._range).any(axis=(1, 2))
        return plain

    def skip(self, time: float, values: Array) -> None:
        """Take note of plain samples, of which the last one is given, (numbers, feet)."""
        self.last[:] = values[READINGS]
        self._since[:], self._counts[:] = time, 1.0
        self._seen[:], self._dead[:], self.marker_valid[:] = time, 0.0, 1.0
        self._behind = True

    def update(
        self, time: float, values: Array, ages: Array, standing: Array, air: Array
    ) -> dict[int, Doubt]:
        """Process a sample of all feet; return the faults by foot.

        Parameters
        ----------
        time : float
            Time of the sample, s.
        values : array (numbers, feet)
            The sample.
        ages : array (feet,)
            Ages of the positions, s.
        standing : array of bool (feet,)
            Whether each foot stood at the sample before: then its position cannot jump.
        air : array (feet,)
            Height above which each foot touches nothing, m; infinite if it has not stood yet.
        """
        if self._behind:
            aloft = ~((self.last[5] <= air) & (air < math.inf))
            self._grounded[:] = np.where(aloft, math.inf, -math.inf)
            self._behind = False
        readings = values[READINGS]
        aloft = ~((readings[5] <= air) & (air < math.inf))
        landed = np.where(self._grounded == math.inf, time, self._grounded)
        self._grounded[:] = np.where(aloft, math.inf, landed)
        stopped = self._stopped(time, readings)
        between = time - ages - self._seen
        leaps = np.sqrt(((readings[3:] - self.last[3:]) ** 2).sum(axis=0))
        leaps[~(standing & (between > 0.0) & (between < PATIENCE))] = 0.0
        self.last[:], self._seen[:] = readings, time - ages
        self.marker_valid[:] = 1.0
        found = {}
        odd = stopped.any(axis=0) | (leaps > LEAP_DISTANCE) | (ages > OLDEST_POSITION)
        if self._range < math.inf:
            odd |= (np.abs(readings[:3]) >= self._range).any(axis=0)
        self._dead[~odd] = 0.0
        for foot in np.flatnonzero(odd).tolist():
            still = np.flatnonzero(stopped[:, foot]).tolist()
            marker = self._marker_fault(
                foot, time, float(ages[foot]), still[-3:], float(leaps[foot]),
                float(between[foot]),
            )  # fmt: skip
            self.marker_valid[foot] = not marker
            forces = [each for each in still if each < 3]
            fault = self._force_fault(foot, time, readings[:3, foot].tolist(), forces) or marker
            if fault:
                found[foot] = fault
        return found

    def _stopped(self, time: float, readings: Array) -> Array:
        """Return which readings have stopped."""
        same = readings == self.last
        compared = same.any(axis=0) | ~self._fine
        steps = np.where(same | ~compared, math.inf, np.abs(readings - self.last))
        np.fmin(self._steps, steps, out=self._steps)
        self._since[:] = np.where(same, self._since, time)
        self._counts[:] = np.where(same, self._counts + 1.0, 1.0)
        noises = 2.0 * self._noises
        coarse = (noises < self._steps) & (self._steps < math.inf)
        fine = ((self._steps <= noises) | (noises == 0.0)).all(axis=0)
        self._fine = np.where(compared, fine, self._fine)
        since = time - self._since
        stopped: Array = same & (noises > 0.0) & (self._counts >= FEWEST) & (since > PATIENCE)
        stopped &= ~coarse | (since > DEAD)
        return stopped

    def _force_fault(
        self, foot: int, time: float, force: list[float], stopped: list[int]
    ) -> Doubt | None:
        since = self._since[:, foot].tolist()
        if len(stopped) == 3:
            begun = self.since[foot] = max(since[:3])
            if any(force):
                return Doubt(doubt.STILL, force[2])
            grounded = time - max(self._grounded[foot], begun)
            # A sensor once found dead also counts as dead in the air, until it reads a force.
            if time - begun > DEAD or grounded > DEAD_ON_GROUND:
                self._dead[foot] = 1.0
            return Doubt(doubt.DEAD) if self._dead[foot] else None
        self._dead[foot] = 0.0
        for place in range(3):
            if abs(force[place]) >= self._range:
                self.since[foot] = time
                return Doubt(doubt.RANGE, place, force[place])
            # An axis that a sensor does not have always reads zero.
            if place in stopped and force[place]:
                self.since[foot] = since[place]
                return Doubt(doubt.STUCK, place, force[place])
        return None

    def _marker_fault(
        self, foot: int, time: float, age: float, still: list[int], leap: float, duration: float
    ) -> Doubt | None:
        if age > OLDEST_POSITION:
            self.since[foot] = time - age
            return Doubt(doubt.LOST, age)
        if still == [3, 4, 5]:
            self.since[foot] = float(self._since[3:, foot].max())
            return Doubt(doubt.MARKER_STILL)
        if leap > LEAP_DISTANCE and leap > LEAP * duration:
            self.since[foot] = time
            return Doubt(doubt.LEAPT, 1e3 * leap)
        return None
