# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors of a foot, measured while it stands.

Second differences cancel what is steady or changes evenly, and leave the noise. Those of single
samples show white noise, also while a foot slips. Those of means over blocks of samples show how
much of it is correlated in time, as in filtered or repeated readings; they are taken at rest only.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from operator import sub
from statistics import median_high

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

_MEDIAN = 0.69
"""Median over mean of the sum of two squares, that of a second difference in the plane."""


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
        variances = [configured * configured] * PRIOR_WINDOWS
        self._variances = deque(variances, maxlen=KEPT_WINDOWS)
        self._ratios = deque([1.0] * PRIOR_WINDOWS, maxlen=KEPT_WINDOWS)
        self._correlation = 1.0  # variance that counts over that of white noise
        self._step, self._steps = math.inf, 0  # smallest change of a component; number of changes

    def add_blocks(self, bend_x: float, bend_y: float, samples: float) -> None:
        """Process the second difference of means over blocks of so many samples."""
        variance = self.white * self.white
        if variance > 0.0:
            square = samples * (bend_x * bend_x + bend_y * bend_y) / 12.0
            self._ratios.append(square / (_MEDIAN * variance))
            self._correlation = max(1.0, median_high(self._ratios))

    def add_changes(self, *components: Sequence[float]) -> None:
        """Look for the steps of the sensor in the readings of each component."""
        if self.configured and self._step > FINE * self.white:
            moves = [abs(each) for values in components for each in changes(values) if each]
            self._steps += len(moves)
            self._step = min(self._step, *moves, math.inf)

    def add_window(self, squares: float, count: int) -> None:
        """Process the second differences of a window: their sum of squares and their number."""
        # The median of chi-square over its mean; half of the differences are independent.
        median = (1.0 - 4.0 / (9.0 * count)) ** 3
        self._variances.append(squares / (6.0 * count * median))
        self.white = math.sqrt(median_high(self._variances))
        least = COARSE * self._step if self._steps >= FEWEST_CHANGES else 0.0
        self.noise = max(least, self.white * math.sqrt(self._correlation))

    def text(self, unit: str) -> str:
        """Return the noise for people, measured and configured."""
        if not self.configured:
            return 'not measured'
        return f'{self.noise:.2g} {unit}, configured {self.configured:.2g} {unit}'


def changes(values: Sequence[float]) -> list[float]:
    """Return the changes from one value to the next."""
    return list(map(sub, values[1:], values))
