# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors of a foot, measured while it stands.

Second differences cancel what is steady or changes evenly, and leave the noise. Those of single
samples show white noise, also while a foot slips. Those of means over blocks of samples show how
much of it is correlated in time, as in filtered or repeated readings; they are taken at rest only.
"""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Sequence
from itertools import compress, pairwise
from operator import mul, sub

PRIOR_WINDOWS = 5
"""Windows of 40 ms that the configured noise is worth."""

KEPT_WINDOWS = 101
"""Windows over which noise is measured: those of about half a minute of walking."""

COARSE = 0.5
"""Least noise of a sensor with steps, share of a step: one step is then no alarm for fast slip."""

FINE = 0.1
"""Change of a reading, share of the noise, from which on a sensor has no steps that count."""

FEWEST_CHANGES = 16
"""Changes of a reading from which on the smallest of them is the step of the sensor."""

LAG = 2
"""Blocks between those that are compared: noise that is correlated over one of them counts."""

EAGER, PAUSE = 12, 3
"""Windows that are all measured at first, and of how many one is measured later."""

READINGS = 8
"""Last readings of a window in which second differences are taken."""

STEADY = 0.03
"""Change of the force over blocks up to which a foot is at rest, share of the expected load."""

STILL = 1e-3
"""Motion over blocks, m, up to which a foot is at rest: one that slips at 5 mm/s moves so far."""

_UNEVEN = 0.5
"""Relative change of the sampling period above which no second difference is taken."""

_MEDIAN = 0.69
"""Median over mean of the sum of two squares, that of a second difference in the plane."""


class Pool:
    """Median of positive values, of which the first are assumed.

    Parameters
    ----------
    prior : float
        Assumed value, worth :data:`PRIOR_WINDOWS` values.

    Attributes
    ----------
    median : float
        Median of the last :data:`KEPT_WINDOWS` values.
    """

    def __init__(self, prior: float) -> None:
        self._sorted = [prior] * PRIOR_WINDOWS
        self._recent = deque(self._sorted)
        self.median = prior

    def add(self, value: float) -> None:
        """Add a value."""
        self._recent.append(value)
        insort(self._sorted, value)
        if len(self._sorted) > KEPT_WINDOWS:
            del self._sorted[bisect_left(self._sorted, self._recent.popleft())]
        self.median = self._sorted[len(self._sorted) // 2]


class Meter:
    """Measure the noise of one sensor.

    Parameters
    ----------
    configured : float
        Standard deviation of each component with which to begin; at 0 nothing is measured.

    Attributes
    ----------
    configured : float
        As given.
    white : float
        Standard deviation of a component from one sample to the next.
    noise : float
        Standard deviation of the white noise that has the same effect on means over a block:
        `white`, or more if noise is correlated in time or the sensor has steps.
    """

    def __init__(self, configured: float) -> None:
        self.configured = self.white = self.noise = configured
        self._variances = Pool(configured * configured)
        self._ratios = Pool(1.0)
        self._step, self._steps = math.inf, 0  # smallest change of a component; number of changes

    def add_blocks(self, bend_x: float, bend_y: float, samples: float) -> None:
        """Process the second difference of means over blocks of so many samples."""
        variance = self.white * self.white
        if variance > 0.0:
            square = samples * (bend_x * bend_x + bend_y * bend_y) / 12.0
            self._ratios.add(square / (_MEDIAN * variance))

    def add_changes(self, *components: Sequence[float]) -> None:
        """Look for the steps of the sensor in the readings of each component."""
        if self.configured and self._step > FINE * self.white:
            moves = [abs(each) for values in components for each in _changes(values) if each]
            self._steps += len(moves)
            self._step = min(self._step, *moves, math.inf)

    def add_window(self, squares: float, count: int) -> None:
        """Process the second differences of a window: their sum of squares and their number."""
        # The median of chi-square over its mean; half of the differences are independent.
        median = (1.0 - 4.0 / (9.0 * count)) ** 3
        self._variances.add(squares / (6.0 * count * median))
        self.white = math.sqrt(self._variances.median)
        least = COARSE * self._step if self._steps >= FEWEST_CHANGES else 0.0
        self.noise = max(least, self.white * math.sqrt(max(1.0, self._ratios.median)))

    def text(self, unit: str) -> str:
        """Return the noise for people, measured and configured."""
        if not self.configured:
            return 'not measured'
        return f'{self.noise:.2g} {unit}, configured {self.configured:.2g} {unit}'


class SensorNoise:
    """Measure the noise of the marker and of the force sensor of a foot.

    Parameters
    ----------
    position, force : float
        Configured standard deviations of a component, m and N; 0: not measured.
    load : float
        Expected normal force in stance, N.

    Attributes
    ----------
    position, force : Meter
        Noise of a coordinate, m, and of a component of the force, N.
    """

    def __init__(self, position: float, force: float, load: float) -> None:
        self.position, self.force = Meter(position), Meter(force)
        self._steady = STEADY * load
        self._blocks: deque[tuple[Sequence[float], int]] = deque(maxlen=2 * LAG + 1)
        self._windows = 0

    def begin(self) -> None:
        """Begin a stance."""
        self._blocks.clear()

    def add(self, readings: Sequence[Sequence[float]], means: Sequence[float], count: int) -> bool:
        """Process a block of a standing foot; return whether noise was measured in it.

        ``readings`` has a column each of times, s, positions x and y, m, and forces x, y and z, N,
        which may begin before the block; ``means`` are those of so many readings of the block
        itself, without the times.
        """
        self._blocks.append((means, count))
        self._windows += 1
        _, x, y, *forces = readings
        self.position.add_changes(x, y)
        self.force.add_changes(*forces)
        if self._windows > EAGER and self._windows % PAUSE:
            return False
        times, x, y, *forces = (each[-READINGS:] for each in readings)
        steps = _changes(times)
        even = [abs(b - a) <= _UNEVEN * b for a, b in pairwise(steps)]
        bends = sum(even)
        if bends < 2:
            return False
        if self.position.configured:
            self.position.add_window(_bent(x, even) + _bent(y, even), 2 * bends)
        if self.force.configured:
            self.force.add_window(sum(_bent(each, even) for each in forces), 3 * bends)
        if len(self._blocks) > 2 * LAG:
            self._compare_blocks()
        return True

    def _compare_blocks(self) -> None:
        """Compare means over blocks, if the foot was at rest in them."""
        last, count = self._blocks[-1]
        noise = 4.0 / math.sqrt(count)
        steady = self._steady + noise * self.force.noise
        still = STILL + noise * self.position.noise
        for means, _ in self._blocks:
            a, b, c, d, e = map(sub, last, means)
            if max(abs(a), abs(b)) > still or max(abs(c), abs(d), abs(e)) > steady:
                return
        (first, some), (middle, more) = self._blocks[0], self._blocks[LAG]
        x, y, fx, fy, _ = (a - b - b + c for a, b, c in zip(first, middle, last, strict=True))
        samples = 6.0 / (1.0 / some + 4.0 / more + 1.0 / count)
        self.position.add_blocks(x, y, samples)
        self.force.add_blocks(fx, fy, samples)


def _changes(values: Sequence[float]) -> list[float]:
    return list(map(sub, values[1:], values))


def _bent(values: Sequence[float], even: Sequence[bool]) -> float:
    """Return the sum of the squared second differences of values at even times."""
    bends = _changes(_changes(values))
    return sum(compress(map(mul, bends, bends), even))
