# SPDX-License-Identifier: Apache-2.0
"""Memory of where ground was wet or dry, because hind feet step where fore feet have stood."""

from __future__ import annotations

import math
from collections import deque

from ros_pad.configuration import number
from ros_pad.estimation import Tuning

PRIOR_EVIDENCE = 2.0
"""Weight of the prior of the wet share, in footprints: for a prior of 1/2 this is Beta(1, 1)."""

MOST_EVIDENCE = 12.0
"""Largest weight of all footprints and the prior together: older footprints lose weight, because
floors change.
"""


class Footprints:
    """Footprints of the flat feet of all legs, and the wet share estimated from them.

    With the distance d from a footprint, the probability fades to the prior as in a two-state
    Markov chain of patches, P(d) = P0 + (P - P0) exp(-d / ℓ). Only the footprint whose P(d) is
    farthest from P0 counts, and of equally far ones the last.

    The wet share is estimated as the mean of a Beta distribution. A footprint with P has the
    weight |2P - 1| (1 - exp(-w / ℓ)), with w the distance since the last footprint: footprints
    with P near 1/2, and many footprints on one patch, count little.

    Parameters
    ----------
    wet_prior : float
        Prior probability P0 of wet ground, 0 to 1.
    fading_length : float
        ℓ, m, above 0.
    memory : int
        Number of footprints that are kept, 1 or more.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    def __init__(
        self, wet_prior: float = Tuning.wet_prior, fading_length: float = 1.0, memory: int = 60
    ) -> None:
        self._wet_prior = number('wet_prior', wet_prior, '(probability)', high=1.0)
        self.fading_length = number('fading_length', fading_length, 'm', above=True)
        number('memory', memory, 'footprints', low=1.0)
        self._prints: deque[tuple[float, float, float]] = deque(maxlen=memory)
        self._wet, self._evidence = PRIOR_EVIDENCE * self._wet_prior, PRIOR_EVIDENCE

    def add(self, x: float, y: float, wet_probability: float, walked: float = 0.0) -> None:
        """Add a footprint of a flat foot.

        Parameters
        ----------
        x, y : float
            Position of the foot, m.
        wet_probability : float
            Probability of wet ground that the foot has estimated, 0 to 1.
        walked : float
            Distance since the last footprint, m: the shorter it is, the less this footprint counts
            in the wet share.
        """
        self._prints.append((x, y, wet_probability - self._wet_prior))
        new = -math.expm1(-walked / self.fading_length) * abs(2.0 * wet_probability - 1.0)
        keep = min(1.0, MOST_EVIDENCE / (self._evidence + new))
        self._wet = keep * (self._wet + new * wet_probability)
        self._evidence = keep * (self._evidence + new)

    @property
    def wet_share(self) -> float:
        """Estimated share of wet ground, 0 to 1."""
        return self._wet / self._evidence

    def wet_probability(self, x: float, y: float) -> float:
        """Return the probability that the ground is wet at a position, m."""
        return self._wet_prior + self._strongest(x, y)[0]

    def wet_expected(self, x: float, y: float) -> float:
        """Return the probability that the ground is wet at a position, m, from the wet share.

        Far from all footprints this is the wet share, where :meth:`wet_probability` is the prior.
        """
        felt, known = self._strongest(x, y)
        return self._wet_prior + felt + (1.0 - known) * (self.wet_share - self._wet_prior)

    def _strongest(self, x: float, y: float) -> tuple[float, float]:
        """Return the largest excess over the prior at a position, m, and its fading factor."""
        best, known = 0.0, 0.0
        for at_x, at_y, excess in self._prints:
            likeness = math.exp(-math.hypot(x - at_x, y - at_y) / self.fading_length)
            if abs(excess * likeness) >= abs(best):
                best, known = excess * likeness, likeness
        return best, known
