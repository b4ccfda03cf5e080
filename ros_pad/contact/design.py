# SPDX-License-Identifier: Apache-2.0
"""Design of a sole: number of pads, load they carry, height of liquid between them.

Thesis 3.83 to 3.101, for pads in a hexagonal pattern with domes of a sphere radius of 1.5 pad
radii. The parameter ``reading`` selects the equations: ``corrected``, or ``thesis`` as printed.
The printed cell of 2.78 radius² per pad is smaller than a flat pad needs (3.46), so numbers of
pads and loads by ``thesis`` are for comparison only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, integer, number, quantity
from ros_pad.contact.dome import inflate
from ros_pad.contact.limits import DEFAULT_CRITERION, force_limit, largest_pressure, pressure_for
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.contact.pad import LARGE_PAD, Array, Floats, Pad, broadcast, need_stiffness, plain
from ros_pad.errors import InvalidInput, NoEquilibrium

READINGS = ('corrected', 'thesis')

# Sphere radius of the largest dome for which the pattern has room, over the pad radius (3.83).
DOME = 1.5
# Floor area per pad over radius²: hexagon around that sphere; 3.87 of the thesis.
CELL = {'corrected': 2.0 * math.sqrt(3.0) * DOME**2, 'thesis': math.pi / 3.0 + math.sqrt(3.0)}
# Pressure that inflates a pad to that dome, over stiffness/radius (3.89): the law of the free dome
# with sin t = height/√(radius² + height²) and sin 2t = 1/1.5.
TENSION = {'corrected': math.sqrt(18.0 + 6.0 * math.sqrt(5.0)) - 4.0 / 3.0, 'thesis': 4.3}
# Area over squared radius above which a float cannot hold the exact number of pads.
_MOST_PADS = 2.0**53

# The liquid of figure 10 of the thesis: water at a contact angle of 60 degrees.
DESIGN_WATER = Liquid(surface_tension=0.073, solid_tension=0.0410625, contact_angle=math.pi / 3)
"""Water with the contact angle of the design in the thesis (3.101), 60 degrees."""


def pads_in(area: npt.ArrayLike, radius: npt.ArrayLike, reading: str = 'corrected') -> Floats:
    """Return how many pads fit on an area in a hexagonal pattern (thesis 3.87).

    Parameters
    ----------
    area : float or array
        Area of the sole, m², from 0.
    radius : float or array
        Radius of the flat pads, m, above 0. Broadcasts with the area.
    reading : {'corrected', 'thesis'}
        ``corrected`` gives each dome (sphere radius 1.5 radii) a hexagon of 7.794 radius².
        ``thesis`` has 2.779 radius², which is too small even for flat pads.

    Returns
    -------
    float or array
        The ratio of areas, not rounded (:func:`design` rounds down). Losses at the edge of the
        sole are ignored.

    Raises
    ------
    InvalidInput
        When a value is out of range, the reading is unknown, or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import pads_in
    >>> round(pads_in(3.14e-4, 1.5e-3), 1), round(pads_in(3.14e-4, 1.5e-3, 'thesis'), 1)
    (17.9, 50.2)
    """
    cell = CELL[choice('reading', reading, READINGS)]
    room = quantity('area', area, 'm²')
    r = quantity('radius', radius, 'm', above=True)
    room, r = broadcast('area and radius', room, r)
    return plain(room / (cell * r * r))


def design_pressure(
    radius: npt.ArrayLike, stiffness: npt.ArrayLike, reading: str = 'corrected'
) -> Floats:
    """Return the pressure that inflates a pad to a sphere radius of 1.5 radii, Pa (thesis 3.89).

    Parameters
    ----------
    radius : float or array
        Radius of the flat pad, m, above 0.
    stiffness : float or array
        Stiffness of the membrane, N/m, above 0. Broadcasts with the radius.
    reading : {'corrected', 'thesis'}
        4.2717 stiffness/radius, or 4.3 as printed. Both are above the end of the model of the
        pressed dome (3.426), see :func:`ros_pad.contact.press`.

    Returns
    -------
    float or array
        Gauge pressure, Pa.

    Raises
    ------
    InvalidInput
        When a value is out of range, the reading is unknown, or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import design_pressure
    >>> round(design_pressure(1.5e-3, 40.0))  # Pa
    113912
    """
    tension = TENSION[choice('reading', reading, READINGS)]
    r = quantity('radius', radius, 'm', above=True)
    k = quantity('stiffness', stiffness, 'N/m', above=True)
    r, k = broadcast('radius and stiffness', r, k)
    return plain(tension * k / r)


def foot_force(
    area: npt.ArrayLike,
    radius: npt.ArrayLike,
    stiffness: npt.ArrayLike,
    reading: str = 'corrected',
) -> Floats:
    """Return the force that presses all pads of a sole flat, N (thesis 3.92).

    The pressure :func:`design_pressure` is assumed to act on the whole flat area of each pad.
    Measured forces are much smaller: use :func:`ros_pad.contact.force_limit` for a design.

    Parameters
    ----------
    area : float or array
        Area of the sole, m², from 0.
    radius : float or array
        Radius of the flat pads, m, above 0.
    stiffness : float or array
        Stiffness of the membrane, N/m, above 0. All three broadcast.
    reading : {'corrected', 'thesis'}
        1.7218 or 4.8606 times ``stiffness * area / radius``.

    Returns
    -------
    float or array
        Force, N, broadcast over the inputs.

    Raises
    ------
    InvalidInput
        When a value is out of range, the reading is unknown, or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import foot_force
    >>> round(foot_force(3.14e-4, 1.5e-3, 40.0), 2)
    14.42
    >>> round(foot_force(3.14e-4, 1.5e-3, 40.0, 'thesis'), 2)
    40.7
    """
    share = math.pi / CELL[choice('reading', reading, READINGS)]
    room = quantity('area', area, 'm²')
    pressure = design_pressure(radius, stiffness, reading)
    room, pressure = broadcast('area, radius and stiffness', room, pressure)
    return plain(share * room * pressure)


def rise_height(
    radius: npt.ArrayLike,
    liquid: Liquid = DESIGN_WATER,
    reading: str = 'corrected',
    cell: float | None = None,
) -> Floats:
    """Return the height to which liquid climbs between the domes of a sole, m (thesis 3.101).

    Parameters
    ----------
    radius : float or array
        Radius of the flat pads, m, above 0.
    liquid : Liquid
        Its surface tension, density and contact angle are used; the angle must be below pi/2.
    reading : {'corrected', 'thesis'}
        ``thesis`` is 3.101 as printed. There a factor of height is missing in the last term, so
        the result depends on the unit of length. It is evaluated in millimetres, as in figure 10
        of the thesis, and returned in metres.
    cell : float, optional
        Ratio of the floor area per pad to radius², from 7.794 (domes that touch, the default). Not
        allowed with the reading ``thesis``, which has a fixed cell.

    Returns
    -------
    float or array
        Height, m, from 0 to 3 radii, where the gap between floor and sole is full. NaN in arrays
        where 3.101 as printed has no root: below a radius of 0.5652 mm, for every liquid.

    Raises
    ------
    NoEquilibrium
        For a scalar radius without a root, status ``no_rise``.
    InvalidInput
        When a value is out of range or of the wrong type, the reading is unknown, or ``cell`` is
        given with the reading ``thesis``.

    Notes
    -----
    With ``L = 2 γ cos θ / (ρ g)`` the surface tension around all domes carries the liquid between
    them: ``L √((3 r - h) h) = (cell/π) r² h - h (9 r h - 2 h²)/6``. Divided by h, with
    ``u² = (3 r - h)/h``, the left side is proportional to u and crosses the right side once. The
    same holds for the equation as printed.

    The wall is assumed to be vertical. Above the equator of the dome the real wall leans inwards:
    liquid with contact angle θ stops at ``1.5 r (1 + cos θ)``, for 60 degrees 2.25 r, not 3 r.

    Examples
    --------
    >>> from ros_pad.contact import rise_height
    >>> (1e3 * rise_height([1e-3, 1.5e-3, 2.327e-3, 4e-3])).round(3).tolist()  # mm
    [2.951, 4.194, 5.236, 0.467]
    """
    choice('reading', reading, READINGS)
    r = quantity('radius', radius, 'm', above=True)
    if not isinstance(liquid, Liquid):
        raise InvalidInput(f'liquid = {liquid!r} is not allowed: a Liquid is needed')
    if liquid.angle >= math.pi / 2:
        raise InvalidInput(
            f'contact_angle = {liquid.angle:g} rad is not allowed: below pi/2 rad is needed, '
            'because other liquids do not rise'
        )
    if cell is not None:
        if reading == 'thesis':
            raise InvalidInput(
                f"cell = {cell:g} is not allowed with reading='thesis', which has a fixed cell"
            )
        cell = number('cell', cell, '(radius²)', low=CELL['corrected'])
    drawn = 2.0 * liquid.surface_tension * math.cos(liquid.angle) / (liquid.density * GRAVITY)
    if reading == 'corrected':
        share = (cell or CELL['corrected']) / math.pi
        u = _crossing(
            drawn / (r * r), lambda y: share + (y / 3.0 - 1.5) * y, share - 1.6875, share
        )
        return plain(3.0 * r / (1.0 + u * u))
    r_mm = 1e3 * r
    room = CELL['thesis'] / math.pi * r_mm
    if np.ndim(r) == 0 and room <= 0.5:
        least = 0.5e-3 * math.pi / CELL['thesis']
        raise NoEquilibrium(
            f'radius = {r:g} m has no rise height by equation 3.101 as printed in the thesis:'
            f' above {least:.6g} m is needed',
            'no_rise',
        )
    room = np.where(room > 0.5, room, np.nan)
    u = _crossing(1e6 * drawn / r_mm, lambda y: room - 1.5 + y / 3.0, 0.0, room - 0.5)
    return plain(3.0 * r / (1.0 + u * u))


def _crossing(pull: Array, weight: Callable[[Array], Array], low: Floats, high: Floats) -> Array:
    """Return u where ``pull u = weight(y)``, by bisection; the weight is between low and high.

    ``y = 3/(1 + u²)`` is height over radius.
    """
    low, high = low / pull, high / pull
    for _ in range(80):
        middle = 0.5 * (low + high)
        short = pull * middle < weight(3.0 / (1.0 + middle * middle))
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return 0.5 * (low + high)


@dataclass(frozen=True)
class Design:
    """A sole with equal pads under a load. All numbers belong to one reading.

    Attributes
    ----------
    reading : str
        ``corrected`` or ``thesis``.
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
    flat_force : float
        Ceiling times the area of all pads, N, the rule of :func:`foot_force`. Such forces have
        never been measured.
    dome_width : float
        Largest diameter of the free domes at the needed pressure, or at the ceiling if that is
        lower, m.
    rise_height : float
        Height of liquid between the domes by :func:`rise_height`, m; NaN where there is none.
    """

    reading: str
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
    flat_force: float
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
    reading: str = 'corrected',
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
    criterion : {'thickness', 'wall', 'flattening', 'max_depth', 'measured'}
        Criterion of the force limit.
    liquid : Liquid
        Liquid for the rise height.
    reading : {'corrected', 'thesis'}
        Reading of the cell and of the rise height. The force limit has only one reading.

    Returns
    -------
    Design
        The sole, and the load that it carries.

    Raises
    ------
    InvalidInput
        When a value is out of range, criterion or reading is unknown, or the sole is too small for
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
    pads = pads_for(area, pad, pads, choice('reading', reading, READINGS))
    try:
        pressure = pressure_for(pad, load / pads, criterion, margin)
    except NoEquilibrium:
        pressure = math.nan
    limit = force_limit(pad, ceiling, criterion)
    cell = area / (pads * pad.radius**2)
    return Design(
        reading=reading,
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
        flat_force=pads * math.pi * pad.radius**2 * ceiling,
        dome_width=_width(pad, pressure if pressure <= ceiling else ceiling),
        rise_height=_rise(pad.radius, liquid, reading, cell),
    )


def pads_for(area: float, pad: Pad, pads: int | None = None, reading: str = 'corrected') -> int:
    """Return the number of pads on a sole: the given one if allowed, or else as many as fit."""
    if area >= _MOST_PADS * pad.radius**2:
        least = math.sqrt(area / _MOST_PADS)
        raise InvalidInput(
            f'radius = {pad.radius:g} m is not allowed on an area of {area:g} m²: at least'
            f' {least:.3g} m is needed, because more than 2^53 pads cannot be counted exactly'
        )
    if pads is not None:
        return integer('pads', pads, 1, math.floor(area / (math.pi * pad.radius**2)))
    # Rounding must not remove a pad from a sole whose area is a whole number of cells.
    fitting = math.floor(pads_in(area, pad.radius, reading) * (1.0 + 1e-12))
    if fitting < 1:
        raise InvalidInput(
            f'area = {area:g} m² is not allowed: at least {CELL[reading] * pad.radius**2:g} m² is'
            f' needed for one pad of radius {pad.radius:g} m'
        )
    return fitting


def _width(pad: Pad, pressure: float) -> float:
    """Return the largest diameter of the free dome, m."""
    dome = inflate(pad, pressure)
    return 2.0 * (dome.sphere_radius if dome.height > pad.radius else pad.radius)


def _rise(radius: float, liquid: Liquid, reading: str, cell: float) -> float:
    """Return the rise height, m; NaN where there is none."""
    if reading == 'corrected':
        # 3.101 assumes domes with a sphere radius of 1.5 radii, too wide for a smaller cell.
        return rise_height(radius, liquid, cell=cell) if cell >= CELL['corrected'] else math.nan
    try:
        return rise_height(radius, liquid, reading)
    except NoEquilibrium:
        return math.nan
