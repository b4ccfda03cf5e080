# SPDX-License-Identifier: Apache-2.0
"""Whether force sensor and marker of a foot can be believed, from what they say alone.

Analogue sensors scatter: one that repeats a number to the last bit has stopped, or has reached the
end of its range. Nothing here knows what is being sensed, or by how much a believable sensor is
off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

PATIENCE = 0.1
"""Time for which a value may stay the same to the last bit, s: markers are slower than forces, and
converters have steps."""

FEWEST = 12
"""Samples that must agree besides: at low rates two may do so by chance."""

OLDEST_POSITION = 0.05
"""Age of the last position from which slip cannot be told, s: a foot slides 2 mm in it at 40
mm/s."""

DEAD = 2.0
"""Time for which a force sensor may read exactly nothing, s: simulated feet do so in the air. And
for which one may repeat itself whose steps are larger than twice its noise."""

DEAD_ON_GROUND = 0.4
"""The same at the height where the foot has stood, s."""

TROUBLES = (
    'force stands still', 'force out of range',
    'marker lost', 'marker stands still', 'marker leapt',
    'no wrench', 'no position', 'sample refused',
)  # fmt: skip
"""How doubts begin that are of sensors and not of the ground; the last three are the node's."""


LEAP = 5.0
"""Speed at which nothing moves that carries load, m/s ..."""

LEAP_WAY = 0.02
"""... over a way that no jitter of a clock makes up, m."""


def trouble_in(doubt: str) -> str:
    """Return what of a doubt is trouble with sensors: how it begins; empty where it is none."""
    kind = doubt.partition(':')[0]
    return kind if kind in TROUBLES else ''


class Repeats:
    """How long each of some values has not changed at all.

    Parameters
    ----------
    values : int
        How many there are.
    noise : float
        Their standard deviation; values without noise never count as stopped.
    """

    __slots__ = ('_counts', '_last', '_noise', '_since', '_steps')

    def __init__(self, values: int, noise: float) -> None:
        self._noise = noise
        self._steps = [math.inf] * values  # smallest change so far
        self._last = [math.nan] * values
        self._since = [math.inf] * values
        self._counts = [0] * values

    def since(self, place: int) -> float:
        """Return the time at which a value was first what it is, s."""
        return self._since[place]

    def update(self, time: float, values: Sequence[float]) -> list[int]:
        """Take the values of a time, s; return the places of those that have stopped."""
        stopped: list[int] = []
        if not self._noise:
            return stopped
        last, counts = self._last, self._counts
        for place, value in enumerate(values):
            if value != last[place]:
                change = abs(value - last[place])
                if change < self._steps[place]:
                    self._steps[place] = change
                last[place] = value
                self._since[place] = time
                counts[place] = 1
                continue
            counts[place] += 1
            if counts[place] >= FEWEST and time - self._since[place] > PATIENCE:
                coarse = 2.0 * self._noise < self._steps[place] < math.inf
                if not coarse or time - self._since[place] > DEAD:
                    stopped.append(place)
        return stopped


class Sensing:
    """Watches the force sensor and the marker of one foot.

    Parameters
    ----------
    force_noise, position_noise : float
        Standard deviations that the sensors are said to have, N and m; one without noise may
        repeat itself.
    force_range : float
        Largest component of force that the sensor shows, N.

    Attributes
    ----------
    marker_sound : bool
        Whether the last position can be believed.
    since : float
        When that which is the trouble began, s.
    """

    def __init__(self, force_noise: float, position_noise: float, force_range: float) -> None:
        self._force_noise = force_noise
        self._position_noise = position_noise
        self._range = force_range
        self.restart()

    def restart(self) -> None:
        """Forget what was seen: the clock has been set."""
        self._forces = Repeats(3, self._force_noise)
        self._positions = Repeats(3, self._position_noise)
        self._last: tuple[float, Sequence[float]] | None = None
        self._grounded = math.inf
        self._dead = False
        self.marker_sound = True
        self.since = math.inf

    def trouble(
        self,
        time: float,
        force: Sequence[float],
        position: Sequence[float],
        age: float,
        standing: bool,
        aloft: bool,
    ) -> str:
        """Take a sample; return why nothing can be learnt from it, or '' where something can.

        Parameters
        ----------
        time : float
            s.
        force, position : sequence of 3 floats
            N and m.
        age : float
            Of the position, s.
        standing : bool
            Whether the foot stood at the sample before: then it cannot be elsewhere at once.
        aloft : bool
            Whether it is above where it stood last, or has not stood yet.
        """
        if aloft:
            self._grounded = math.inf
        elif self._grounded == math.inf:
            self._grounded = time
        forces = self._forces.update(time, force)
        marker = self._trouble_of_marker(time, position, age, standing)
        self.marker_sound = not marker
        return self._trouble_of_force(time, force, forces) or marker

    def _trouble_of_force(self, time: float, force: Sequence[float], stopped: list[int]) -> str:
        nothing = not any(force)
        if len(stopped) == 3:
            self.since = max(map(self._forces.since, stopped))
            if not nothing:
                return f'force stands still: {force[2]:.3g} N to the last digit'
            grounded = time - max(self._grounded, self.since)
            # Once found dead it is so in the air as well, until it reads anything.
            self._dead |= time - self.since > DEAD or grounded > DEAD_ON_GROUND
            if self._dead:
                return 'force stands still: reads exactly nothing'
            return ''
        self._dead = False
        for place, axis in enumerate('xyz'):
            if abs(force[place]) >= self._range:
                self.since = time
                return f'force out of range: {axis} = {force[place]:.3g} N'
            # An axis that a sensor does not have reads zero for ever.
            if place in stopped and force[place]:
                self.since = self._forces.since(place)
                return f'force out of range: {axis} stays at {force[place]:.3g} N'
        return ''

    def _trouble_of_marker(
        self, time: float, position: Sequence[float], age: float, standing: bool
    ) -> str:
        stopped = self._positions.update(time, position)
        # Markers may be slower than forces: what counts is when each was where it was.
        seen = time - age
        last, self._last = self._last, (seen, tuple(position))
        if age > OLDEST_POSITION:
            self.since = time - age
            return f'marker lost: last seen {age:.2g} s ago'
        if len(stopped) == 3:
            self.since = max(map(self._positions.since, stopped))
            return 'marker stands still: to the last digit'
        if standing and last and 0.0 < seen - last[0] < PATIENCE:
            way = math.dist(last[1], position)
            if way > LEAP_WAY and way > LEAP * (seen - last[0]):
                self.since = time
                return f'marker leapt: {1e3 * way:.0f} mm'
        return ''
