# SPDX-License-Identifier: Apache-2.0
"""Memory of where the ground was felt: hind feet step where fore feet have been."""

from __future__ import annotations

import math
from collections import deque

from ros_pad.contact.pad import number


class Footprints:
    """Remembers flat footprints of all legs, and what each said about the ground.

    Wetness is taken to fade with distance d as in a chain of patches of two kinds,
    P(d) = P0 + (P - P0) exp(-d / ℓ), and of all footprints the one that says most is believed; of
    equal ones the last.

    Parameters
    ----------
    wet_prior : float
        Probability P0 of wet ground where nothing is known, 0 to 1.
    fading_length : float
        ℓ, m, above 0.
    memory : int
        How many footprints are kept, 1 or more.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    """

    def __init__(
        self, wet_prior: float = 0.5, fading_length: float = 1.0, memory: int = 60
    ) -> None:
        self._wet_prior = number('wet_prior', wet_prior, '(probability)', high=1.0)
        self._fading_length = number('fading_length', fading_length, 'm', above=True)
        number('memory', memory, 'footprints', low=1.0)
        self._prints: deque[tuple[float, float, float]] = deque(maxlen=memory)

    def add(self, x: float, y: float, wet_probability: float) -> None:
        """Remember what a flat foot felt at a position, m."""
        self._prints.append((x, y, wet_probability - self._wet_prior))

    def wet_probability(self, x: float, y: float) -> float:
        """Probability that the ground is wet at a position, m."""
        best = 0.0
        for at_x, at_y, excess in self._prints:
            felt = excess * math.exp(-math.hypot(x - at_x, y - at_y) / self._fading_length)
            if abs(felt) >= abs(best):
                best = felt
        return self._wet_prior + best
