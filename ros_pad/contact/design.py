# SPDX-License-Identifier: Apache-2.0
"""Design of a sole: number of pads, load they carry, height of liquid between them.

Thesis 3.83 to 3.101, corrected, for pads in a hexagonal pattern with domes of a sphere radius of
1.5 pad radii. The equations as printed are in ``studies/thesis/sole.py``.

Of pads of materials, which are never sure, each quantity is computed for the material as it is,
and for factors on its stresses over their whole range
(:attr:`ros_pad.contact.Material.factor_range`). Its extremes are not always at the ends of the
range: a stiffer pad stands more pressure before it balloons, but at the pressure of the supply its
dome is lower and may carry less. Extremes inside the range are within 1 %.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import instance, integer, number, quantity
from ros_pad.contact.dome import inflate
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.layout import Layout, edge_of, pads_at
from ros_pad.contact.limits import DEFAULT_CRITERION, force_limit, largest_pressure, pressure_for
from ros_pad.contact.material import Material
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import (
    LARGE_PAD,
    Floats,
    MeasuredLimit,
    Pad,
    broadcast,
    plain,
    with_constant,
)
from ros_pad.errors import InvalidInput, NoEquilibrium

# Sphere radius of the largest dome for which the pattern has room, over the pad radius (3.83).
DOME = 1.5
PITCH = 2.0 * DOME
"""Distance of the centres of neighbouring pads between which such domes touch, in radii."""
# Floor area per pad over radius²: hexagon around that sphere (3.87).
CELL = 2.0 * math.sqrt(3.0) * DOME**2
# The liquid of figure 10 of the thesis: water at a contact angle of 60 degrees.
DESIGN_WATER = Liquid(surface_tension=0.073, solid_tension=0.0410625, contact_angle=math.pi / 3)
"""Water with the contact angle of the design in the thesis (3.101), 60 degrees."""


def pads_in(area: npt.ArrayLike, radius: npt.ArrayLike) -> Floats:
    """Return how many pads fit on an area in a hexagonal pattern (thesis 3.87).

    Parameters
    ----------
    area : float or array
        Area of the sole, m², from 0.
    radius : float or array
        Radius of the flat pads, m, above 0. Broadcasts with the area.

    Returns
    -------
    float or array
        The ratio of areas, not rounded (:func:`design` rounds down), with 7.794 radius² for each
        pad: the hexagon of a dome with a sphere radius of 1.5 radii. Losses at the edge of the
        sole are ignored.

    Raises
    ------
    InvalidInput
        When a value is out of range, or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import pads_in
    >>> round(pads_in(3.14e-4, 1.5e-3), 1)
    17.9
    """
    room = quantity('area', area, 'm²')
    r = quantity('radius', radius, 'm', above=True)
    room, r = broadcast('area and radius', room, r)
    return plain(room / (CELL * r * r))


def rise_height(
    radius: npt.ArrayLike, liquid: Liquid = DESIGN_WATER, cell: float = CELL
) -> Floats:
    """Return the height to which liquid climbs between the domes of a sole, m (thesis 3.101).

    Parameters
    ----------
    radius : float or array
        Radius of the flat pads, m, above 0.
    liquid : Liquid
        Its surface tension, density and contact angle are used; the angle must be below pi/2.
    cell : float
        Ratio of the floor area per pad to radius², from 7.794 (domes that touch, the default).

    Returns
    -------
    float or array
        Height, m, from 0 to 3 radii, where the gap between floor and sole is full.

    Raises
    ------
    InvalidInput
        When a value is out of range or of the wrong type.

    Notes
    -----
    With ``L = 2 γ cos θ / (ρ g)`` the surface tension around all domes carries the liquid between
    them: ``L √((3 r - h) h) = (cell/π) r² h - h (9 r h - 2 h²)/6``. Divided by h, with
    ``u² = (3 r - h)/h``, the left side is proportional to u and crosses the right side once.

    The wall is assumed to be vertical. Above the equator of the dome the real wall leans inwards:
    liquid with contact angle θ stops at ``1.5 r (1 + cos θ)``, for 60 degrees 2.25 r, not 3 r.

    Examples
    --------
    >>> from ros_pad.contact import rise_height
    >>> (1e3 * rise_height([1e-3, 1.5e-3, 2.327e-3, 4e-3])).round(3).tolist()  # mm
    [2.951, 4.194, 5.236, 0.467]
    """
    r = quantity('radius', radius, 'm', above=True)
    instance('liquid', liquid, Liquid)
    if liquid.angle >= math.pi / 2:
        raise InvalidInput(
            f'contact_angle = {liquid.angle:g} rad is not allowed: below pi/2 rad is needed, '
            'because other liquids do not rise'
        )
    share = number('cell', cell, '(radius²)', low=CELL) / math.pi
    drawn = 2.0 * liquid.surface_tension * math.cos(liquid.angle) / liquid.weight
    pull = drawn / (r * r)
    # Bisection; ``y = 3/(1 + u²)`` is height over radius.
    low, high = (share - 1.6875) / pull, share / pull
    for _ in range(80):
        u = 0.5 * (low + high)
        y = 3.0 / (1.0 + u * u)
        short = pull * u < share + (y / 3.0 - 1.5) * y
        low, high = np.where(short, u, low), np.where(short, high, u)
    u = 0.5 * (low + high)
    return plain(3.0 * r / (1.0 + u * u))


@dataclass(frozen=True)
class Design:
    """A sole with equal pads under a load.

    Attributes
    ----------
    pad : Pad
        One of the pads.
    area : float
        Area of the sole, m².
    pads : int
        Number of pads.
    pitch : float
        Distance between the centres of neighbouring pads in a hexagonal pattern, m.
    load : float
        Normal force on the whole foot, N.
    load_per_pad : float
        Normal force on one pad, N.
    margin : float
        Safety factor: the force limit covers the load times this factor.
    criterion : str
        Criterion of :func:`ros_pad.contact.force_limit`.
    pressure : float
        Gauge pressure needed for the load, Pa; NaN where no pressure of the model carries it.
    ceiling : float
        Highest available gauge pressure, Pa: that of the supply, or the end of the model if that
        is lower.
    pad_limit : float
        Force limit of one pad at the ceiling, N.
    reachable_load : float
        Largest load on the whole foot at the ceiling, N, divided by the margin.
    dome_width : float
        Largest diameter of the free domes at the needed pressure, or at the ceiling if that is
        lower, m.
    rise_height : float
        Height of liquid between the domes by :func:`rise_height`, m; NaN where there is none.
    """

    pad: Pad
    area: float
    pads: int
    pitch: float
    load: float
    load_per_pad: float
    margin: float
    criterion: str
    pressure: float
    ceiling: float
    pad_limit: float
    reachable_load: float
    dome_width: float
    rise_height: float

    @property
    def carried(self) -> bool:
        """Whether the pads carry the load with its margin at a pressure up to the ceiling."""
        return self.pressure <= self.ceiling

    @property
    def touching(self) -> bool:
        """Whether neighbouring free domes would touch each other."""
        return self.dome_width > self.pitch

    @property
    def pads_needed(self) -> float:
        """Number of pads, no unit, that carry the load at the ceiling; infinite if none does."""
        if self.pad_limit == 0.0:
            return math.inf
        return math.ceil(self.load * self.margin / self.pad_limit)

    @property
    def pads_without_touching(self) -> int:
        """Largest number of pads on the sole for which domes of this width do not touch."""
        return pads_at(self.dome_width, self.pad.radius, math.sqrt(self.area / math.pi))

    @property
    def radius_needed(self) -> float:
        """Radius of a sole, about, on which :attr:`pads_needed` have room, m."""
        cells = math.sqrt(CELL * self.pads_needed / math.pi) * self.pad.radius
        return cells + edge_of(self.pad.radius)


def design(
    load: float,
    area: float,
    pad: Pad = LARGE_PAD,
    *,
    pads: int | None = None,
    ceiling: float = 90e3,
    margin: float = 1.2,
    criterion: str = DEFAULT_CRITERION,
    liquid: Liquid = DESIGN_WATER,
) -> Design:
    """Design a sole with equal pads for a load.

    Parameters
    ----------
    load : float
        Normal force on the foot, N, above 0.
    area : float
        Area of the sole, m², with room for one pad and the edge around it.
    pad : Pad
        Size and material of one pad.
    pads : int, optional
        Number of pads. By default as many as have room for domes with a sphere radius of 1.5
        radii, and for the edge of a sole that can be cast (:mod:`ros_pad.contact.layout`).
    ceiling : float
        Highest pressure of the supply, Pa gauge, above 0. ``ceiling`` of the result is at most
        :func:`ros_pad.contact.limits.largest_pressure`.
    margin : float
        Safety factor on the load, above 0.
    criterion : {'thickness', 'flattening', 'measured'}
        Criterion of the force limit.
    liquid : Liquid
        Liquid for the rise height.

    Returns
    -------
    Design
        The sole, and the load that it carries.

    Raises
    ------
    InvalidInput
        When a value is out of range, the criterion is unknown, or the sole is too small for
        its pads.

    Examples
    --------
    >>> from ros_pad.contact import design
    >>> sole = design(load=4.0, area=9e-4)
    >>> sole.pads, round(sole.pressure), round(sole.reachable_load, 1), sole.carried
    (31, 50606, 11.8, True)
    """
    instance('pad', pad, Pad)
    load = number('load', load, 'N', above=True)
    area = number('area', area, 'm²', above=True)
    end = largest_pressure(pad)
    # force_limit can refuse the end itself because of rounding.
    ceiling = min(number('ceiling', ceiling, 'Pa', above=True), end * (1.0 - 1e-15))
    margin = number('margin', margin, '(factor)', above=True)
    pads = pads_for(area, pad, pads)
    try:
        pressure = pressure_for(pad, load / pads, criterion, margin)
    except NoEquilibrium:
        pressure = math.nan
    limit = force_limit(pad, ceiling, criterion)
    cell = area / (pads * pad.radius**2)
    return Design(
        pad=pad,
        area=area,
        pads=pads,
        pitch=Layout.of(pads, pad.radius, math.sqrt(area / math.pi)).pitch,
        load=load,
        load_per_pad=load / pads,
        margin=margin,
        criterion=criterion,
        pressure=pressure,
        ceiling=ceiling,
        pad_limit=limit,
        reachable_load=pads * limit / margin,
        dome_width=_width(pad, pressure if pressure <= ceiling else ceiling),
        # 3.101 assumes domes with a sphere radius of 1.5 radii, too wide for a smaller cell.
        rise_height=rise_height(pad.radius, liquid, cell) if cell >= CELL else math.nan,
    )


def pads_for(area: float, pad: Pad, pads: int | None = None) -> int:
    """Return the number of pads on a sole: the given one if allowed, or else as many as fit."""
    least = math.pi * (pad.radius + edge_of(pad.radius)) ** 2
    number(f'area for one pad of radius {pad.radius:g} m', area, 'm²', least * (1.0 - 1e-12))
    if pads is None:
        return pads_at(PITCH * pad.radius, pad.radius, math.sqrt(area / math.pi))
    return integer('pads', pads, 1, math.floor(area / (math.pi * pad.radius**2)))


def _width(pad: Pad, pressure: float) -> float:
    """Return the largest diameter of the free dome, m."""
    dome = inflate(pad, pressure)
    return 2.0 * (dome.sphere_radius if dome.height > pad.radius else pad.radius)


# --- Pads of materials ---------------------------------------------------------------------------


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
        Area of the sole, m², with room for one pad and the edge around it.
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
    found = []
    for material, thickness in itertools.product(materials, thicknesses):
        pad = Pad.of(material, radius, thickness, measured_limit)
        rules: dict[str, Any] = {'ceiling': ceiling, 'margin': margin, 'criterion': criterion}
        first = design(load, area, pad, pads=pads, **rules)
        states, enough = [], []
        for factor in _factors(pad, margin * first.load_per_pad, ceiling, criterion):
            own = with_constant(pad, 'factor', factor)
            sole, end = design(load, area, own, pads=pads, **rules), pressure_end(own)[0]
            pressure = math.inf if math.isnan(sole.pressure) else sole.pressure
            height = inflate(own, min(pressure, end)).height
            states.append((pressure, height, sole.reachable_load, end, end / pressure))
            enough.append(pressure <= ceiling)
        spans = [Span(each[0], min(each), max(each)) for each in zip(*states, strict=True)]
        needed, high, reach, largest, over = spans
        carried = 'yes' if all(enough) else 'in doubt' if any(enough) else 'no'
        balloons = pressure_end(pad)[1] == 'no_inflation'
        found.append(
            Candidate(pad, first.pads, needed, high, reach, largest, balloons, over, carried)
        )
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
