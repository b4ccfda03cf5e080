# SPDX-License-Identifier: Apache-2.0
"""Memory of what feet have felt: where the ground was wet or dry, and friction.

Hind feet step where fore feet have stood.
"""

from __future__ import annotations

import math
from collections import deque

from ros_pad.contact.resistance import Foot, expected_friction

WET_PRIOR = 0.5
"""Prior probability P0 of wet ground where no foot has stood: no opinion, whatever the estimator's
setting ``wet_prior``."""

FADING_LENGTH = 1.0
"""Distance ℓ over which footprints fade, m."""

KEPT = 60
"""Number of footprints that are kept."""

DRY, WET = 0.35, 0.65
"""Probability of wet ground below which the friction of a flat foot is that of dry ground, and
above which friction is that of wet ground."""

CHANCE = 1.1
"""Friction of domes on wet ground over that of flat feet that may be chance: no gain."""

CERTAIN = 0.98
"""Highest probability of wet ground that makes domes: so their friction is felt again."""

NEW_SHARE = 0.2
"""Weight of the last step in the mean friction of a morphology."""

PAYS, PAYS_NOT = 1.6, 1.4
"""Friction of flat feet on dry ground over that of domes, from which on flat feet pay, and below
which they do not: less gain than steps onto the next wet patch cost.
"""


class Footprints:
    """Footprints of the flat feet of all legs, by which P(wet) is known ahead.

    With the distance d from a footprint, the probability fades to the prior as in a two-state
    Markov chain of patches, P(d) = P0 + (P - P0) exp(-d / ℓ). Only the footprint whose P(d) is
    farthest from P0 counts, and of equally far ones the last.
    """

    def __init__(self) -> None:
        self._prints: deque[tuple[float, float, float]] = deque(maxlen=KEPT)

    def add(self, x: float, y: float, wet_probability: float) -> None:
        """Add a footprint of a flat foot.

        Parameters
        ----------
        x, y : float
            Position of the foot, m.
        wet_probability : float
            Probability of wet ground that the foot has estimated, 0 to 1.
        """
        self._prints.append((x, y, wet_probability - WET_PRIOR))

    def wet_probability(self, x: float, y: float) -> float:
        """Return the probability that the ground is wet at a position, m."""
        best = 0.0
        for at_x, at_y, excess in self._prints:
            faded = excess * math.exp(-math.hypot(x - at_x, y - at_y) / FADING_LENGTH)
            if abs(faded) >= abs(best):
                best = faded
        return WET_PRIOR + best


class FrictionFelt:
    """Mean friction of flat feet and of domes, from the steps of all legs.

    The foot file may promise adhesion that this floor does not have, or domes that drain a film
    that they do not.

    Parameters
    ----------
    foot : Foot
        Its contact model predicts friction before the first step.
    load : float
        Normal force on a foot in stance, N, above 0.

    Attributes
    ----------
    flat_pays : bool
        Whether flat feet have more friction on dry ground than domes, by the factor :data:`PAYS`;
        once they have, until the factor falls below :data:`PAYS_NOT`.
    """

    def __init__(self, foot: Foot, load: float) -> None:
        self._flat_dry, self._flat_wet, self._dome, self._wet_dome = expected_friction(foot, load)
        self._dry_dome = self._dome
        self.flat_pays = self._flat_dry >= PAYS * self._dome

    def add(self, flat: bool, wet_probability: float, friction: float) -> None:
        """Add P(wet) and coefficient of friction of a step; NaN or less than 0 is not known."""
        if not 0.0 <= friction < math.inf:
            return
        if not flat:
            self._dome += NEW_SHARE * (friction - self._dome)
            if wet_probability > WET:
                self._wet_dome += NEW_SHARE * (friction - self._wet_dome)
            else:
                self._dry_dome += NEW_SHARE * (friction - self._dry_dome)
        elif wet_probability < DRY:
            self._flat_dry += NEW_SHARE * (friction - self._flat_dry)
        elif wet_probability > WET:
            self._flat_wet += NEW_SHARE * (friction - self._flat_wet)
        self.flat_pays = self._flat_dry >= (PAYS_NOT if self.flat_pays else PAYS) * self._dome

    @property
    def break_even(self) -> float:
        """Probability of wet ground at which flat feet and domes are expected to hold alike.

        From 0 to :data:`CERTAIN`; on wet ground domes must hold more by :data:`CHANCE`.
        """
        lost = max(self._flat_dry - self._dry_dome, 0.0)
        won = max(self._wet_dome - CHANCE * self._flat_wet, 1e-9)
        return min(lost / (lost + won), CERTAIN)
