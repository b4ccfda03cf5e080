# SPDX-License-Identifier: Apache-2.0
"""Memory of where the ground was felt: hind feet step where fore feet have been."""

from __future__ import annotations

import math
from collections import deque

from ros_pad.contact.pad import number

PRIOR_EVIDENCE = 2.0
"""Footprints that the prior of the wet share is worth: Beta(1, 1) where it is one half."""

MOST_EVIDENCE = 12.0
"""Footprints that the wet share rests on at most, the prior's included: floors change."""


class Footprints:
    """Remembers flat footprints of all legs, and what each said about the ground.

    Wetness is taken to fade with distance d as in a chain of patches of two kinds,
    P(d) = P0 + (P - P0) exp(-d / ℓ), and of all footprints the one that says most is believed; of
    equal ones the last.

    The share of wet ground is learnt as the mean of a Beta distribution: a footprint that says P
    counts |2P - 1| (1 - exp(-w / ℓ)), w being the way since the last one, so that neither feet
    that could not tell nor many feet on one patch count for much.

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
        self.fading_length = number('fading_length', fading_length, 'm', above=True)
        number('memory', memory, 'footprints', low=1.0)
        self._prints: deque[tuple[float, float, float]] = deque(maxlen=memory)
        self._wet, self._told = PRIOR_EVIDENCE * self._wet_prior, PRIOR_EVIDENCE

    def add(self, x: float, y: float, wet_probability: float, walked: float = 0.0) -> None:
        """Remember what a flat foot felt at a position, m.

        Parameters
        ----------
        x, y : float
            Position, m.
        wet_probability : float
            What it felt.
        walked : float
            Way since the last footprint, m: of a patch that was felt before little is new.
        """
        self._prints.append((x, y, wet_probability - self._wet_prior))
        # A foot that could not tell counts for nothing.
        new = -math.expm1(-walked / self.fading_length) * abs(2.0 * wet_probability - 1.0)
        keep = min(1.0, MOST_EVIDENCE / (self._told + new))
        self._wet = keep * (self._wet + new * wet_probability)
        self._told = keep * (self._told + new)

    @property
    def wet_share(self) -> float:
        """Share of wet ground that has been learnt."""
        return self._wet / self._told

    def wet_probability(self, x: float, y: float) -> float:
        """Probability that the ground is wet at a position, m."""
        return self._wet_prior + self._strongest(x, y)[0]

    def wet_expected(self, x: float, y: float) -> float:
        """Probability of wet ground that fades to the share learnt, not to the prior."""
        felt, known = self._strongest(x, y)
        return self._wet_prior + felt + (1.0 - known) * (self.wet_share - self._wet_prior)

    def _strongest(self, x: float, y: float) -> tuple[float, float]:
        """Return what is felt there above the prior, and how like it is to where it was felt."""
        best, known = 0.0, 0.0
        for at_x, at_y, excess in self._prints:
            likeness = math.exp(-math.hypot(x - at_x, y - at_y) / self.fading_length)
            if abs(excess * likeness) >= abs(best):
                best, known = excess * likeness, likeness
        return best, known
