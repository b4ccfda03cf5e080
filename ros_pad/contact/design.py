# SPDX-License-Identifier: Apache-2.0
"""Design of a sole: number of pads, load they carry, height of liquid between them.

Thesis 3.83 to 3.101, corrected, for pads in a hexagonal pattern with domes of a sphere radius of
1.5 pad radii. The equations as printed are in ``studies/thesis/sole.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import instance, integer, number, quantity
from ros_pad.contact.dome import inflate
from ros_pad.contact.limits import DEFAULT_CRITERION, force_limit, largest_pressure, pressure_for
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.contact.pad import LARGE_PAD, Floats, Pad, broadcast, need_stiffness, plain
from ros_pad.errors import InvalidInput, NoEquilibrium

# Sphere radius of the largest dome for which the pattern has room, over the pad radius (3.83).
DOME = 1.5
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
    drawn = 2.0 * liquid.surface_tension * math.cos(liquid.angle) / (liquid.density * GRAVITY)
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
        Highest available gauge pressure, Pa: that of the supply, or the end of the model or of the
        measurements if that is lower.
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
        return math.floor(self.area / (0.5 * math.sqrt(3.0) * self.dome_width**2))


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
        Area of the sole, m², at least one cell of :func:`pads_in`.
    pad : Pad
        Size and material of one pad.
    pads : int, optional
        Number of pads. By default :func:`pads_in`, rounded down.
    ceiling : float
        Highest pressure of the supply, Pa gauge, above 0. ``ceiling`` of the result is at most
        :func:`ros_pad.contact.limits.largest_pressure` of the criterion.
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
    (51, 39125, 19.5, True)
    """
    instance('pad', pad, Pad)
    load = number('load', load, 'N', above=True)
    need_stiffness('a design', pad)
    area = number('area', area, 'm²', above=True)
    end = largest_pressure(pad, criterion)
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
        pitch=math.sqrt(2.0 * area / (math.sqrt(3.0) * pads)),
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
    cell = CELL * pad.radius**2
    # A float cannot hold the exact number of more than 2^53 pads.
    number(f'area for pads of radius {pad.radius:g} m', area, 'm²', 0.0, 2.0**53 * cell)
    if pads is not None:
        return integer('pads', pads, 1, math.floor(area / (math.pi * pad.radius**2)))
    # Rounding must not remove a pad from a sole whose area is a whole number of cells.
    share = area / cell * (1.0 + 1e-12)
    number(
        f'area for one pad of radius {pad.radius:g} m', area, 'm²', cell if share < 1.0 else 0.0
    )
    return math.floor(share)


def _width(pad: Pad, pressure: float) -> float:
    """Return the largest diameter of the free dome, m."""
    dome = inflate(pad, pressure)
    return 2.0 * (dome.sphere_radius if dome.height > pad.radius else pad.radius)
