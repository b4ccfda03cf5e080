# SPDX-License-Identifier: Apache-2.0
"""From what is heard of a leg, whenever it comes, to the calls of its controller.

The controller node and the replay of bags listen with the same object.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ros_pad.control.morphology import MorphologyController

OLD = 0.2
"""After which the last position of a foot serves no more, s."""

LOOK_PERIOD_NS = 100_000_000
"""How often legs without estimates should be looked after, ns."""


class LegListener:
    """What has been heard of one leg since its last estimate.

    Of positions only the last one counts when an estimate comes: it is kept as it travelled, and
    read then. Of loads the heaviest since the last estimate counts: feet that bounce have not
    stepped.

    Parameters
    ----------
    controller : MorphologyController
        Shared by all legs.
    leg : int
        Number of the leg.
    read_position : callable
        Returns x and y, m, of a position as it was handed over.

    Attributes
    ----------
    trouble : str
        Why the sensors of the foot are not believed; empty where they are.
    """

    def __init__(
        self,
        controller: MorphologyController,
        leg: int,
        read_position: Callable[[Any], tuple[float, float]],
    ) -> None:
        self._controller = controller
        self._leg = leg
        self._read = read_position
        self._position: Any = None
        self._new_position = False
        self._position_time = 0.0  # when an estimate last found a new position, s
        self._load, self._heaviest = math.nan, -math.inf
        self._pressure: float | None = None  # since the last look
        self._observed: float | None = None  # time of the last look, s
        self._shape = ''
        self.trouble = ''

    def wrench(self, load: float) -> None:
        """Take a normal force, N."""
        self._load = load
        if self._heaviest < load < math.inf:  # an infinite one is no load, refused below
            self._heaviest = load

    def position(self, position: Any) -> None:
        """Take a position of the foot, to be read when it is needed."""
        self._position = position
        self._new_position = True

    def pressure(self, gauge: float) -> None:
        """Take a gauge pressure of the pad, Pa."""
        self._pressure = gauge

    def estimate(self, now: float, wet_probability: float) -> float | None:
        """Take an estimate and return the gauge pressure wanted, Pa, or None for none.

        Parameters
        ----------
        now : float
            s; of all legs on one clock.
        wet_probability : float
            0 to 1.
        """
        self._observe(now)
        if self._new_position:
            self._new_position = False
            self._position_time = now
        if self._position is None or now - self._position_time > OLD:
            return None  # where the foot is, nobody knows
        x, y = self._read(self._position)
        if not math.isfinite(self._load + wet_probability + x + y):
            # A load that is no number is no lift-off. No set-point follows from it either: if it
            # stays so, the regulators vent.
            return None
        weight = max(self._heaviest, self._load)  # the load where no wrench came since
        self._heaviest = -math.inf
        return self._controller.update(self._leg, weight, wet_probability, (x, y))

    def look(self, now: float) -> bool:
        """Look after a leg without estimates, every :data:`LOOK_PERIOD_NS`; return if it was."""
        if self._observed is None:
            self._observed = now
        elif abs(now - self._observed) > LOOK_PERIOD_NS * 1e-9:
            self._observe(now)
            return True
        return False

    def _observe(self, now: float) -> None:
        self._controller.doubt(self._leg, self.trouble)
        pressure, self._pressure = self._pressure, None
        self._observed = now
        self._controller.observe(self._leg, now, pressure)

    def new_shape(self) -> str | None:
        """Return the shape of the leg if it is another one than at the last call, else None."""
        shape = self._controller.morphology(self._leg)
        if shape == self._shape:
            return None
        self._shape = shape
        return shape
