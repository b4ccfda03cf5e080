# SPDX-License-Identifier: Apache-2.0
"""Design of a sole: how many pads it holds, what they carry, how high liquid climbs between them.

Thesis 3.83 to 3.101, for pads in a hexagonal pattern whose domes have grown to a sphere radius of
1.5 pad radii. Two readings: ``corrected``, and ``thesis``, as printed. The printed cell of
2.78 radius² per pad is smaller than even the flat pad needs (3.46), so the counts and loads of
that reading are for comparison only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.contact.dome import inflate
from ros_pad.contact.limits import force_limit
from ros_pad.contact.limits import largest_pressure
from ros_pad.contact.limits import pressure_for
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import Pad
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoEquilibrium

READINGS = ('corrected', 'thesis')

# Sphere radius of the dome that the pattern leaves room for, over the pad radius (3.83).
DOME = 1.5
# Floor area per pad over radius²: a hexagon about that sphere; the thesis' 3.87.
CELL = {'corrected': 2.0 * math.sqrt(3.0) * DOME**2, 'thesis': math.pi / 3.0 + math.sqrt(3.0)}
# Pressure that inflates a pad to that dome, over stiffness/radius (3.89). The law of the free
# dome at sin t = height/√(radius² + height²) and sin 2t = 1/1.5.
TENSION = {'corrected': math.sqrt(18.0 + 6.0 * math.sqrt(5.0)) - 4.0 / 3.0, 'thesis': 4.3}
# Area over squared radius from which pads cannot be counted to the last one.
_MOST_PADS = 2.0**53

# The liquid of the thesis' figure 10: water at a contact angle of 60 degrees.
DESIGN_WATER = Liquid(surface_tension=0.073, solid_tension=0.0410625, contact_angle=math.pi / 3)


def pads_in(area: npt.ArrayLike, radius: npt.ArrayLike, reading: str = 'corrected') -> Floats:
    """Return how many pads an area holds in a hexagonal pattern (thesis 3.87).

    Parameters
    ----------
    area : float or array
        Of the sole, m², 0 or more.
    radius : float or array
        Of the flat pads, m, above 0. Broadcasts with the area.
    reading : {'corrected', 'thesis'}
        ``corrected`` gives each dome of 1.5 radii its hexagon of 7.794 radius²; ``thesis`` has
        2.779 radius², on which not even flat pads fit.

    Returns
    -------
    float or array
        The ratio of areas. It is no whole number, and a small sole loses more at its edge:
        :func:`design` rounds down.

    Raises
    ------
    InvalidInput
        For values out of range, an unknown reading, or shapes that do not broadcast.
    """
    cell = CELL[choice('reading', reading, READINGS)]
    room = quantity('area', area, 'm²')
    r = quantity('radius', radius, 'm', above=True)
    return _plain(_broadcast(room, r, names='area and radius')[0] / (cell * r * r))


def design_pressure(
    radius: npt.ArrayLike, stiffness: npt.ArrayLike, reading: str = 'corrected'
) -> Floats:
    """Return the pressure that inflates a pad to a sphere radius of 1.5 radii, Pa (thesis 3.89).

    Parameters
    ----------
    radius : float or array
        Of the flat pad, m, above 0.
    stiffness : float or array
        Of the membrane, N/m, above 0. Broadcasts with the radius.
    reading : {'corrected', 'thesis'}
        4.2717 stiffness/radius, or the 4.3 of the print. Both lie beyond the end of the pressed
        dome (3.426): see :func:`ros_pad.contact.press`.

    Raises
    ------
    InvalidInput
        For values out of range, an unknown reading, or shapes that do not broadcast.
    """
    tension = TENSION[choice('reading', reading, READINGS)]
    r = quantity('radius', radius, 'm', above=True)
    k = quantity('stiffness', stiffness, 'N/m', above=True)
    r, k = _broadcast(r, k, names='radius and stiffness')
    return _plain(tension * k / r)


def foot_force(
    area: npt.ArrayLike,
    radius: npt.ArrayLike,
    stiffness: npt.ArrayLike,
    reading: str = 'corrected',
) -> Floats:
    """Return the force that presses all pads of a sole flat, N (thesis 3.92).

    Every pad is taken to push with :func:`design_pressure` on all of its flat area. What was
    measured is far less: a design rests on :func:`ros_pad.contact.force_limit`.

    Parameters
    ----------
    area : float or array
        Of the sole, m², 0 or more.
    radius : float or array
        Of the flat pads, m, above 0.
    stiffness : float or array
        Of the membrane, N/m, above 0. All three broadcast.
    reading : {'corrected', 'thesis'}
        1.7218 or 4.8606 times ``stiffness * area / radius``.

    Raises
    ------
    InvalidInput
        For values out of range, an unknown reading, or shapes that do not broadcast.
    """
    share = math.pi / CELL[choice('reading', reading, READINGS)]
    room = quantity('area', area, 'm²')
    pressure = design_pressure(radius, stiffness, reading)
    room, pressure = _broadcast(room, pressure, names='area, radius and stiffness')
    return _plain(share * room * pressure)


def rise_height(
    radius: npt.ArrayLike,
    liquid: Liquid = DESIGN_WATER,
    reading: str = 'corrected',
    cell: float | None = None,
) -> Floats:
    """Return how high liquid climbs between the domes of a sole, m (thesis 3.101).

    Parameters
    ----------
    radius : float or array
        Of the flat pads, m, above 0.
    liquid : Liquid
        Its surface tension, density and contact angle count; the angle must be below 90 degrees.
    reading : {'corrected', 'thesis'}
        ``thesis`` is 3.101 as typed. A factor of height is missing there from the last term, so
        its answer depends on the unit of length; it is evaluated in millimetres, as the thesis'
        figure 10 is drawn, and returned in metres.
    cell : float, optional
        Floor area per pad over radius², from that of touching domes, 7.794, which is the default.
        Not for the reading ``thesis``, which has its own.

    Returns
    -------
    float or array
        Between 0 and 3 radii, where the gap between floor and sole is full. NaN in arrays where
        3.101 as typed has no root: below a radius of 0.5652 mm, whatever the liquid.

    Raises
    ------
    NoEquilibrium
        For a scalar radius without a root, status ``no_rise``.
    InvalidInput
        For values out of range, or an unknown reading.

    Notes
    -----
    With ``L = 2 γ cos θ / (ρ g)`` the pull round all domes lifts the liquid between them:
    ``L √((3 r - h) h) = (cell/π) r² h - h (9 r h - 2 h²)/6``. Divided by h, with
    ``u² = (3 r - h)/h``, the left side is proportional to u and meets the right one once; as
    typed, too.

    The wall is taken to be upright. It leans over above the equator of the dome, where liquid
    of contact angle θ stops at ``1.5 r (1 + cos θ)``, at 60 degrees 2.25 r instead of 3 r.
    """
    choice('reading', reading, READINGS)
    r = quantity('radius', radius, 'm', above=True)
    if not isinstance(liquid, Liquid):
        raise InvalidInput(f'liquid = {liquid!r} is not allowed: a Liquid is needed')
    if liquid.angle >= math.pi / 2:
        raise InvalidInput(
            f'contact_angle = {liquid.angle:g} rad is not allowed: below pi/2 rad is needed, '
            'other liquids are not drawn in'
        )
    if cell is not None:
        if reading == 'thesis':
            raise InvalidInput('cell is not allowed with the reading thesis, which has its own')
        cell = number('cell', cell, '(radius²)', low=CELL['corrected'])
    drawn = 2.0 * liquid.surface_tension * math.cos(liquid.angle) / (liquid.density * GRAVITY)
    if reading == 'corrected':
        share = (cell or CELL['corrected']) / math.pi
        u = _crossing(
            drawn / (r * r), lambda y: share + (y / 3.0 - 1.5) * y, share - 1.6875, share
        )
        return _plain(3.0 * r / (1.0 + u * u))
    r_mm = 1e3 * r
    room = CELL['thesis'] / math.pi * r_mm
    if np.ndim(r) == 0 and room <= 0.5:
        raise NoEquilibrium(
            f'radius {r:g} m has no height of rise by 3.101 as typed: '
            f'only above {0.5e-3 * math.pi / CELL["thesis"]:.6g} m has',
            'no_rise',
        )
    room = np.where(room > 0.5, room, np.nan)
    u = _crossing(1e6 * drawn / r_mm, lambda y: room - 1.5 + y / 3.0, 0.0, room - 0.5)
    return _plain(3.0 * r / (1.0 + u * u))


def _crossing(pull: Array, weight: Callable[[Array], Array], low: Floats, high: Floats) -> Array:
    """Return where ``pull u`` comes up to ``weight(y)``, which is from low to high.

    ``y = 3/(1 + u²)`` is height over radius. Halving cannot miss the one crossing.
    """
    low, high = low / pull, high / pull
    for _ in range(80):
        middle = 0.5 * (low + high)
        short = pull * middle < weight(3.0 / (1.0 + middle * middle))
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return 0.5 * (low + high)


@dataclass(frozen=True)
class Design:
    """A sole with equal pads under a load. All figures belong to one reading.

    Attributes
    ----------
    reading : ``corrected`` or ``thesis``.
    pad : Pad
    area : m², of the sole.
    pads : how many it has.
    pitch : m, between the centres of neighbouring pads in a hexagonal pattern.
    load : N, on the whole foot.
    load_per_pad : N.
    margin : factor on the load that the force limit has to cover.
    criterion : of :func:`ros_pad.contact.force_limit`.
    pressure : Pa gauge, needed for the load; NaN where no pressure of the model carries it.
    ceiling : Pa gauge, the highest there is: that of the supply, or where the model or the
        measurements end if that is lower.
    pad_limit : N, the force limit of one pad at the ceiling.
    reachable_load : N, on the whole foot at the ceiling, margin taken off.
    flat_force : N, by :func:`foot_force`'s rule that a pad pushes with all its area, at the
        ceiling. Nobody has measured such forces.
    dome_width : m, the widest diameter of the free domes at the pressure needed, or at the
        ceiling where that is less.
    rise_height : m, of liquid between the domes by :func:`rise_height`; NaN where it has none.
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
        """Whether neighbouring domes touch one another before they touch the floor."""
        return self.dome_width > self.pitch

    @property
    def pads_needed(self) -> float:
        """How many such pads carry the load at the ceiling; infinite where no number does."""
        if self.pad_limit == 0.0:
            return math.inf
        return math.ceil(self.load * self.margin / self.pad_limit)

    @property
    def pads_without_touching(self) -> int:
        """How many pads the sole holds whose domes, as wide as these, just do not touch."""
        return math.floor(self.area / (0.5 * math.sqrt(3.0) * self.dome_width**2))


def design(
    load: float,
    area: float,
    pad: Pad = LARGE_PAD,
    *,
    pads: int | None = None,
    ceiling: float = 90e3,
    margin: float = 1.2,
    criterion: str = 'measured',
    liquid: Liquid = DESIGN_WATER,
    reading: str = 'corrected',
) -> Design:
    """Return what a sole full of pads makes of a load.

    Parameters
    ----------
    load : float
        Normal force on the foot, N, above 0.
    area : float
        Of the sole, m², at least one cell of :func:`pads_in`.
    pad : Pad
        What one pad is made of.
    pads : int, optional
        How many there are. By default as many as :func:`pads_in` says, rounded down.
    ceiling : float
        Highest pressure of the supply, Pa gauge, above 0. Where the model or, for ``measured``,
        the measurements end below it, their end is taken instead and told as ``ceiling``.
    margin : float
        Factor on the load, above 0.
    criterion : {'measured', 'flattening', 'max_depth'}
        Of the force limit.
    liquid : Liquid
        For the height of rise.
    reading : {'corrected', 'thesis'}
        Of the cell and of the height of rise. The force limit has but one.

    Raises
    ------
    InvalidInput
        For values out of range, or a sole too small for its pads.
    """
    load = number('load', load, 'N', above=True)
    area = number('area', area, 'm²', above=True)
    end = largest_pressure(pad, criterion)
    # The end itself is refused where rounding carries it a digit too far.
    ceiling = min(number('ceiling', ceiling, 'Pa', above=True), end * (1.0 - 1e-15))
    margin = number('margin', margin, '(factor)', above=True)
    if area >= _MOST_PADS * pad.radius**2:
        raise InvalidInput(
            f'radius = {pad.radius:g} m is not allowed on an area of {area:g} m²: '
            f'{math.sqrt(area / _MOST_PADS):.3g} m or more is needed, for pads to be counted'
        )
    if pads is None:
        # A sole of exactly so many cells holds them all, whatever the last digit says.
        pads = math.floor(pads_in(area, pad.radius, reading) * (1.0 + 1e-12))
        if pads < 1:
            raise InvalidInput(
                f'area = {area:g} m² is not allowed: one pad of radius {pad.radius:g} m needs '
                f'{CELL[reading] * pad.radius**2:g} m² or more'
            )
    else:
        choice('reading', reading, READINGS)
        most = math.floor(area / (math.pi * pad.radius**2))
        whole = isinstance(pads, int | np.integer) and not isinstance(pads, bool)
        if not whole or not 1 <= pads <= most:
            raise InvalidInput(
                f'pads = {pads!r} is not allowed: a whole number from 1 to {most}, as many as '
                f'lie beside one another on {area:g} m²'
            )
        pads = int(pads)  # a number of NumPy's is no number to JSON
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


def _width(pad: Pad, pressure: float) -> float:
    dome = inflate(pad, pressure)
    return 2.0 * (dome.sphere_radius if dome.height > pad.radius else pad.radius)


def _rise(radius: float, liquid: Liquid, reading: str, cell: float) -> float:
    if reading == 'corrected':
        # Domes of 1.5 radii do not fit on a smaller cell, and 3.101 with them.
        return rise_height(radius, liquid, cell=cell) if cell >= CELL['corrected'] else math.nan
    try:
        return rise_height(radius, liquid, reading)
    except NoEquilibrium:
        return math.nan


def _broadcast(*values: Array, names: str) -> tuple[Array, ...]:
    try:
        return tuple(each[()] for each in np.broadcast_arrays(*values))
    except ValueError as error:
        raise InvalidInput(f'{names} do not broadcast') from error


def _plain(value: Floats) -> Floats:
    return float(value) if np.ndim(value) == 0 else value
