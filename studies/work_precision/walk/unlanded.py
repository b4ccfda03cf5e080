# SPDX-License-Identifier: Apache-2.0
"""Levels as they are without landing: MuJoCo's own contact, and films of rigid discs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any
from unittest.mock import patch

from ros_pad.contact import laws
from ros_pad.simulation import planar_step, rail_leg
from ros_pad.simulation.soles import Sole, Soles
from studies.work_precision.walk.walkers import Walk, Walked, Walker, named


def drained(foot: Any, film: Any, *given: float) -> tuple[float, float]:
    """Drain a film as rigid discs do; arguments and result are those of ``laws.drained``.

    Where the contact of a dome grows, the new area has the film of touch-down, and 1/h² is
    averaged over the area: it is what ``film[laws.CORE]`` has here.
    """
    on_domes, on_sole, pressure, time, _ = given
    if film[laws.FRESH] <= 0.0:
        return 0.0, 0.0
    fresh = film[laws.FRESH] ** -2
    if on_sole > 0.0:
        film[laws.SOLE] += foot.sole_drain * on_sole / foot.sole_area * time
    before, film[laws.AREA] = film[laws.AREA], 0.0
    if on_domes > 0.0:
        film[laws.AREA] = area = on_domes / (foot.pads * pressure)
        domes = film[laws.CORE] if before > 0.0 else fresh
        if area > before:
            domes = fresh + before / area * (domes - fresh)
        growth = 4.0 * math.pi * pressure / (3.0 * foot.viscosity * area)
        film[laws.CORE] = fresh = domes + growth * time
    return fresh**-0.5, film[laws.SOLE] ** -0.5


def _stock(soles: Soles, sole: Sole, depth: float) -> None:
    """Leave the contact of a foot to MuJoCo, in place of ``Soles._give_way``."""
    sole.tangential[0] = 0.0


def stock(walker: Walker) -> Walker:
    """Return a walker on L2 whose feet have MuJoCo's own contact."""

    def walk(case: Walk) -> Walked:
        with patch.object(Soles, '_give_way', _stock):
            return walker.walk(case)

    return replace(walker, walk=walk)


def unlanded(walker: Walker) -> Walker:
    """Return a walker without landing.

    Feet have films of rigid discs, on L2 MuJoCo's own contact, and on L0 the whole load at once.
    """

    def walk(case: Walk) -> Walked:
        with (
            patch.object(laws, 'drained', drained),
            patch.object(planar_step, 'drained', drained),
            patch.object(rail_leg, 'landed', lambda *_: 1.0),
        ):
            return stock(walker).walk(case)

    family = f'{walker.family} without landing'
    return replace(walker, family=family, name=named(family, walker.step or 0.0), walk=walk)
