# SPDX-License-Identifier: Apache-2.0
"""Pads of different materials and thicknesses for one load, with what is unsure of the materials.

Each quantity is computed for the material as it is, and for factors on its stresses over their
whole range (:attr:`ros_pad.contact.Material.factor_range`). Its extremes are not always at the
ends of the range: a stiffer pad stands more pressure before it balloons, but at the pressure of
the supply its dome is lower and may carry less. Extremes inside the range are within 1 %.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import number
from ros_pad.contact.design import pads_for
from ros_pad.contact.dome import inflate
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.limits import force_limit, pressure_for
from ros_pad.contact.material import Material
from ros_pad.contact.pad import MeasuredLimit, Pad, with_constant
from ros_pad.errors import NoEquilibrium


class Span(NamedTuple):
    """A value, and its lowest and highest one by the doubts about the material."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Candidate:
    """A pad for a load. Where no pressure is enough, numbers that need one are NaN.

    Attributes
    ----------
    pad : Pad
        The pad.
    pads : int
        Number of pads that share the load.
    pressure : Span
        Lowest pressure for the load with its margin, Pa gauge; infinite where none is enough.
    height : Span
        Height of the free dome at this pressure, m; of the largest dome where none is enough.
    load : Span
        Largest load of the whole foot at the ceiling, N, divided by the margin.
    largest_pressure : Span
        Pressure at which the pad balloons, or at which the range of its material ends, Pa.
    balloons : bool
        Whether it balloons there; otherwise it does so at this or a higher pressure.
    ballooning_margin : Span
        Largest over needed pressure; 0 where no pressure is enough.
    carried : str
        Whether a pressure up to the ceiling is enough: ``yes`` and ``no`` for the whole range of
        the factor, else ``in doubt``.
    """

    pad: Pad
    pads: int
    pressure: Span
    height: Span
    load: Span
    largest_pressure: Span
    balloons: bool
    ballooning_margin: Span
    carried: str

    @property
    def material(self) -> str:
        """Name of the material, or its law."""
        material = self.pad.material
        return '' if material is None else material.name or str(material)


def candidates(
    load: float,
    area: float,
    materials: Sequence[Material],
    thicknesses: Sequence[float],
    radius: float,
    *,
    pads: int | None = None,
    ceiling: float = 90e3,
    margin: float = 1.2,
    criterion: str = 'flattening',
    measured_limit: MeasuredLimit | None = None,
) -> tuple[Candidate, ...]:
    """Return pads of each material and thickness for a load.

    Parameters
    ----------
    load : float
        Normal force on the foot, N, above 0.
    area : float
        Area of the sole, m², at least one cell of :func:`ros_pad.contact.pads_in`.
    materials : sequence of Material
        The materials.
    thicknesses : sequence of float
        Thicknesses of the sheet, m, above 0 up to the radius.
    radius : float
        Radius of the pads, m, above 0.
    pads : int, optional
        Number of pads. By default as many as fit.
    ceiling : float
        Highest pressure of the supply, Pa gauge, above 0.
    margin : float
        Safety factor on the load, above 0.
    criterion : str
        Criterion of the force limit, one of :func:`ros_pad.contact.limits.criteria`.
    measured_limit : MeasuredLimit, optional
        Force limits measured on such pads.

    Raises
    ------
    InvalidInput
        When a value is out of range, a pad has no such criterion, or the sole is too small.
    """
    number('load', load, 'N', above=True)
    number('ceiling', ceiling, 'Pa', above=True)
    number('margin', margin, '(factor)', above=True)
    found = []
    for material, thickness in itertools.product(materials, thicknesses):
        pad = Pad.of(material, radius, thickness, measured_limit)
        count = pads_for(area, pad, pads)
        force = load / count  # on one pad
        states = []
        for factor in _factors(pad, force * margin, ceiling, criterion):
            own = with_constant(pad, 'factor', factor)
            end = pressure_end(own)[0]
            try:
                pressure = pressure_for(own, force, criterion, margin)
            except NoEquilibrium:
                pressure = math.inf
            height = inflate(own, min(pressure, end)).height
            # force_limit can refuse the end itself because of rounding.
            limit = force_limit(own, min(ceiling, end * (1.0 - 1e-15)), criterion)
            states.append((pressure, height, count * limit / margin, end, end / pressure))
        enough = [state[0] <= ceiling for state in states]
        spans = [Span(each[0], min(each), max(each)) for each in zip(*states, strict=True)]
        carried = 'yes' if all(enough) else 'in doubt' if any(enough) else 'no'
        balloons = pressure_end(pad)[1] == 'no_inflation'
        needed, high, reach, largest, over = spans
        found.append(Candidate(pad, count, needed, high, reach, largest, balloons, over, carried))
    return tuple(found)


def _factors(pad: Pad, force: float, ceiling: float, criterion: str) -> list[float]:
    """Return the factor of a pad's material, and factors over the range of the doubts about it.

    Among them are those at which the largest pressure is the ceiling, and at which the pad just
    carries the force: there the quantities have kinks.
    """
    material = pad.material
    assert material is not None and material.factor_range is not None
    end = pressure_end(pad)[0] * (1.0 - 1e-15)
    strongest = force_limit(pad, end, criterion)
    kinks = [ceiling / end, force / strongest * (1.0 + 1e-9) if strongest > 0.0 else math.inf]
    low, high = material.factor_range
    inside = [material.factor * each for each in kinks if low < material.factor * each < high]
    spread = np.linspace(low, high, 9).tolist() if low < high else []
    return [material.factor, *spread, *inside]
