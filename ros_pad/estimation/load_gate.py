# SPDX-License-Identifier: Apache-2.0
"""Load gate that decides whether a foot stands, for the estimator and for the controller."""

from __future__ import annotations

CONTACT_SHARE = 0.1
"""Share of the expected load above which a foot stands for the estimator: with less load, feet
slide as they land and lift off."""

LIFT_OFF_SHARE = 0.3
"""Share of the expected load below which a foot has lifted off for the controller."""

TOUCH_DOWN = 0.3
"""Additional share of the expected load from which on a foot stands again for the controller. So
noise does not count as steps. Nor does the bounce of a landing foot, which touches the ground with
up to 0.55 of its load (0.8 on rough ground) and has little load again until the other tripod lifts
off."""


class LoadGate:
    """Decide from its load whether a foot stands, with hysteresis.

    Parameters
    ----------
    expected_load : float
        Normal force in stance, N, above 0.
    share : float
        Share of that load below which a standing foot has lifted off, above 0 up to 1.
    hysteresis : float
        Additional share of that load from which on the foot stands again, 0 or more.

    Attributes
    ----------
    lift_off, touch_down : float
        Loads at which the foot lifts off and touches down, N.
    standing : bool
        Whether the foot stands.
    """

    def __init__(self, expected_load: float, share: float, hysteresis: float = 0.0) -> None:
        self.lift_off = share * expected_load
        self.touch_down = (share + hysteresis) * expected_load
        self.standing = False

    def update(self, load: float) -> bool:
        """Process a load, N; return whether the foot stands."""
        self.standing = load >= (self.lift_off if self.standing else self.touch_down)
        return self.standing
