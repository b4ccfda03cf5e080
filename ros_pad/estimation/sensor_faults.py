# SPDX-License-Identifier: Apache-2.0
"""Find faults of the force sensor and the marker of a foot from their readings alone.

Readings of analogue sensors have noise: a sensor that repeats a number to the last bit has
stopped, or is at the end of its range. Readings are also faulty if they are too large, too old or
change faster than a foot can move. An offset cannot be found from one sensor, and is not a fault
here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import eq
from typing import TYPE_CHECKING

from ros_pad.estimation import doubt
from ros_pad.estimation.doubt import Doubt

if TYPE_CHECKING:
    from ros_pad.estimation.track import Sample

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


class SensorFaults:
    """Find faults of the force sensor and the marker of one foot.

    Parameters
    ----------
    force_noise, position_noise : float
        Standard deviations of the sensors, N and m; if one is 0, its sensor may repeat readings.
    force_range : float
        Largest component of force that the sensor can show, N; infinite if not known.

    Attributes
    ----------
    marker_valid : bool
        Whether the last position can be used.
    """

    def __init__(self, force_noise: float, position_noise: float, force_range: float) -> None:
        self._noises: Sequence[float] = (force_noise,) * 3 + (position_noise,) * 3
        self._range = force_range
        self.restart()

    def restart(self) -> None:
        """Discard all readings, because the clock has been set back."""
        self._last: Sequence[float] = (math.nan,) * 6
        self._steps = [math.inf] * 6  # smallest change so far
        # Whether each value has changed by twice its noise or less: then none of them stops while
        # all of them change.
        self._fine = False
        self._since, self._counts = [0.0] * 6, [1] * 6  # of equal readings
        self._seen = -math.inf  # time of the last position, s
        self._grounded = math.inf
        self._dead = False
        self.marker_valid = True

    def set_noise(self, force_noise: float, position_noise: float) -> None:
        """Change the standard deviations, N and m; a sensor without noise stays so.

        One that has noise, but repeats itself, is at the least taken to have hardly any.
        """
        new = (force_noise,) * 3 + (position_noise,) * 3
        self._noises = [
            max(a, LEAST) if b else 0.0 for a, b in zip(new, self._noises, strict=True)
        ]

    def _stopped(self, time: float, values: Sequence[float]) -> Sequence[int]:
        """Return which values of a time, s, have not changed for too long, by their places."""
        last, self._last = self._last, values
        if self._fine and not any(map(eq, values, last)):
            self._since, self._counts = [time] * 6, [1] * 6
            return ()
        stopped: list[int] = []
        since, counts, steps = self._since, self._counts, self._steps
        for place, (value, noise) in enumerate(zip(values, self._noises, strict=True)):
            if value != last[place]:
                steps[place] = min(steps[place], abs(value - last[place]))
                since[place], counts[place] = time, 1
                continue
            counts[place] += 1
            if noise and counts[place] >= FEWEST and time - since[place] > PATIENCE:
                coarse = 2.0 * noise < steps[place] < math.inf
                if not coarse or time - since[place] > DEAD:
                    stopped.append(place)
        self._fine = all(
            step <= 2.0 * noise or not noise
            for step, noise in zip(steps, self._noises, strict=True)
        )
        return stopped

    def update(self, time: float, sample: Sample, standing: bool, air: float) -> Doubt | None:
        """Process a sample; return why it cannot be used, or None if it can.

        Parameters
        ----------
        time : float
            Time of the sample, s.
        sample : Sample
            The sample.
        standing : bool
            Whether the foot stood at the sample before: then its position cannot jump.
        air : float
            Height above which the foot touches nothing, m; infinite if it has not stood yet.
        """
        last, force, position, age = self._last, sample[:3], sample[4:7], sample.age
        if not sample.z <= air < math.inf:
            self._grounded = math.inf
        elif self._grounded == math.inf:
            self._grounded = time
        stopped = self._stopped(time, force + position)
        # Markers may be sampled more slowly than forces, so speeds need the positions' own times.
        since, self._seen = self._seen, time - age
        leap = 0.0
        if standing and 0.0 < self._seen - since < PATIENCE:
            leap = math.dist(last[3:], position)
        if not (
            stopped or leap > LEAP_DISTANCE or age > OLDEST_POSITION or self._range < math.inf
        ):
            self._dead, self.marker_valid = False, True
            return None
        forces = [place for place in stopped if place < 3]
        marker = self._marker_fault(time, age, stopped[len(forces) :], leap, self._seen - since)
        self.marker_valid = not marker
        return self._force_fault(time, force, forces) or marker

    def _force_fault(
        self, time: float, force: Sequence[float], stopped: Sequence[int]
    ) -> Doubt | None:
        if not stopped and self._range == math.inf:
            self._dead = False
            return None
        if len(stopped) == 3:
            if any(force):
                return Doubt(doubt.STILL, force[2])
            since = max(self._since[place] for place in stopped)
            grounded = time - max(self._grounded, since)
            # A sensor once found dead also counts as dead in the air, until it reads a force.
            self._dead |= time - since > DEAD or grounded > DEAD_ON_GROUND
            if self._dead:
                return Doubt(doubt.DEAD)
            return None
        self._dead = False
        for place in range(3):
            if abs(force[place]) >= self._range:
                return Doubt(doubt.RANGE, place, force[place])
            # An axis that a sensor does not have always reads zero.
            if place in stopped and force[place]:
                return Doubt(doubt.STUCK, place, force[place])
        return None

    def _marker_fault(
        self, time: float, age: float, stopped: Sequence[int], leap: float, duration: float
    ) -> Doubt | None:
        if age > OLDEST_POSITION:
            return Doubt(doubt.LOST, age)
        if len(stopped) == 3:
            return Doubt(doubt.MARKER_STILL)
        if leap > LEAP_DISTANCE and leap > LEAP * duration:
            return Doubt(doubt.LEAPT, 1e3 * leap)
        return None
