# SPDX-License-Identifier: Apache-2.0
"""How high liquid climbs a pad: balances of weight and tension, layer by layer (thesis chapter 4).

The floor round the pad is wet, and the liquid there stands at height 0. In a slice of azimuth the
wall is a curve r(z), inclined by a(z) against the floor, and the surface of the liquid is taken as
the arc of a circle that meets the wall at height h with the contact angle θ and runs out on the
floor with the angle θ_f: its radius is R = h/(cos(θ + a) + cos θ_f). Three balances find h:

- ``energy``: h has the least energy of weight, surface and wetted wall;
- ``force``: the tension lifts the weight, γ sin(θ + a) r = ρ g V;
- ``thesis``: Eq. 4.11 summed up from the floor, γ cos θ A_wet = 2 ρ g Σ z V. In a tube this is
  Jurin's law; elsewhere it is no equilibrium, and it has no rise at contact angles from 90
  degrees.

The last two also have answers where there is no equilibrium. Energy, which is least in one, judges
them: what is farther from its height than ``AGREEMENT`` is refused. The arc itself fails on
straight walls, if the pad is slender (the true surface reaches farther out) or the wall is steep
and wholly wetted: ``SLENDER`` and ``WETTING`` are where its height is a sixth off the exact one. A
wall that bulges, as that of a dome, stops the liquid whatever the surface is like.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.mesh import Indices
from ros_pad.capillary.mesh import Mesh
from ros_pad.capillary.sections import Layers
from ros_pad.capillary.sections import Walls
from ros_pad.capillary.sections import centre
from ros_pad.capillary.sections import layered
from ros_pad.capillary.sections import walls
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.meniscus import hysteresis_force
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.errors import MeshError

BALANCES = ('energy', 'force', 'thesis')
STATUSES = ('ok', 'dry', 'coarse', 'saturated', 'no_circle', 'far_off', 'far_apart')
AGREEMENT = 0.15  # of the height of least energy: farther off, another balance is refused
SLENDER = 0.35  # capillary lengths: radius below which a straight pad is too thin for arcs
WETTING = math.radians(10.0)  # contact angle below which arcs are too high on walls
_STEEP = math.radians(70.0)  # as steep as this and straight
_STRAIGHT = math.radians(10.0)  # from the mean inclination of a wall to that at the line
WIDEST_GAP = 1.0  # capillary lengths: between pads farther apart the surface is not level
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_THROUGH_WALL = 0.01  # of the height: by which an arc may dip into a wall of facets
_ROUND = 720  # pieces of a contact line, for its projections


@dataclass(frozen=True)
class Wet:
    """Liquid round one pad, slice by slice.

    Where a slice has no answer its numbers are NaN and its status says why: ``dry`` (no rise:
    the liquid is pushed down), ``coarse`` (a rise of less than two layers, or an end of the arcs
    within one: more layers are needed), ``saturated`` (over the top of the mesh), ``no_circle``
    (no arc of a circle fits between this wall and the floor), ``far_off`` (of a kind that is
    off by about a sixth and more: the energy is least elsewhere by more than ``AGREEMENT``, or the
    wall is straight and slender, or steep and wholly wetted).

    Attributes
    ----------
    azimuths : array, shape (slices,), rad from the x axis.
    heights : array, shape (slices,), m, of the line where liquid, wall and air meet.
    ring_radii : array, shape (slices,), m, of that line from the axis.
    floor_radii : array, shape (slices,), m, where the liquid's surface runs out on the floor.
    curvature_radius : array, shape (slices,), m, of the surface in the plane of the slice.
    pressure : array, shape (slices,), Pa
        Of the liquid over the air, γ(1/r - 1/R): below 0 the liquid pulls.
    status : array of str, shape (slices,)
    axis : tuple of float, x and y of the axis, m.
    top : float, height of the mesh, m.
    floor_angle : float, rad, between floor and liquid.
    balance : str
    liquid : Liquid
    """

    azimuths: Array
    heights: Array
    ring_radii: Array
    floor_radii: Array
    curvature_radius: Array
    pressure: Array
    status: npt.NDArray[np.str_]
    axis: tuple[float, float]
    top: float
    floor_angle: float
    balance: str
    liquid: Liquid

    @property
    def mean_height(self) -> float:
        """Mean over the slices, m; NaN when one of them has no answer."""
        return float(np.mean(self.heights))

    @property
    def height_spread(self) -> float:
        """Highest less lowest slice, m; NaN when one has no answer."""
        return float(np.ptp(self.heights))

    def section(self, direction: float | npt.ArrayLike) -> float:
        """Return the liquid's area projected along a direction of motion, m².

        Parameters
        ----------
        direction : float or array of 2 or 3 numbers
            Azimuth, rad from the x axis, or a vector, whose vertical part does not count.

        Raises
        ------
        InvalidInput
            When it is not finite, or a vector that does not point anywhere on the floor.
        """
        return self._projected(direction, np.ones_like(self.heights))

    def force(self, direction: float | npt.ArrayLike) -> float:
        """Return pressure times section for a direction of motion, N (thesis 4.18).

        The thesis' estimate of what one side of the pad feels: no bound, for the pressure is that
        of an arc. Exact surfaces pull many times as much on one side, and by as much on the other,
        so that nothing is left of it round a symmetric pad. Below 0 the liquid pulls.
        Directions as for :meth:`section`.
        """
        return self._projected(direction, self.pressure)

    def hysteresis_force(
        self, direction: float | npt.ArrayLike, advancing_angle: float, receding_angle: float
    ) -> float:
        """Return the most that pinning of the contact line resists, N.

        Its width across the direction, times tension, times cos θ_receding - cos θ_advancing; see
        :func:`ros_pad.contact.hysteresis_force`. Directions as for :meth:`section`.
        """
        across = self._across(direction)
        width = float(np.ptp(across)) if np.isfinite(self.heights).all() else math.nan
        if math.isnan(width):
            return math.nan
        tension = self.liquid.surface_tension
        return float(hysteresis_force(0.5 * width, tension, advancing_angle, receding_angle))

    def surface(self, count: int = 17) -> Array:
        """Return points of the liquid's surface, shape (slices, count, 3), m, from floor to wall.

        Slices without an answer are NaN.
        """
        _whole('count', count, 2, 1000)
        start = math.cos(self.floor_angle)
        last = np.arccos(np.clip(start - self.heights / self.curvature_radius, -1.0, 1.0))
        turn = self.floor_angle + np.linspace(0.0, 1.0, count) * (last - self.floor_angle)[:, None]
        curvature = self.curvature_radius[:, None]
        inward = curvature * (np.sin(turn) - math.sin(self.floor_angle))
        r, z = self.floor_radii[:, None] - inward, curvature * (start - np.cos(turn))
        x = self.axis[0] + r * np.cos(self.azimuths)[:, None]
        y = self.axis[1] + r * np.sin(self.azimuths)[:, None]
        return np.stack([x, y, z], axis=2)

    def _across(self, direction: float | npt.ArrayLike) -> Array:
        """Return the contact line's points measured across a direction, closed, m."""
        forward = _azimuth(direction)
        turns = np.linspace(0.0, 2.0 * math.pi, _ROUND + 1)
        radii = np.interp(turns, self.azimuths, self.ring_radii, period=2.0 * math.pi)
        return radii * np.sin(turns - forward)

    def _projected(self, direction: float | npt.ArrayLike, factor: Array) -> float:
        across = self._across(direction)
        middle = 2.0 * math.pi * (np.arange(_ROUND) + 0.5) / _ROUND
        load = np.interp(middle, self.azimuths, factor * self.heights, period=2.0 * math.pi)
        # Front and rear each cover the whole section.
        return 0.5 * float(np.sum(load * np.abs(np.diff(across))))


@dataclass(frozen=True)
class WetPattern:
    """Liquid between many pads, with a level surface. NaN where there is no answer.

    Attributes
    ----------
    height : float, m.
    pressure : float, Pa
        Of the liquid below its surface over the air, -ρ g h: below 0 the liquid pulls.
    volume : float, m³, of the liquid.
    void_area : float, m², between the pads at that height.
    status : str
        As for :class:`Wet`, or ``far_apart``: void area over outline is more than ``WIDEST_GAP``
        capillary lengths, so that the surface sags between the pads.
    area : float, m², of the whole pattern.
    pads : int, how often the mesh stands there.
    balance : str
    """

    height: float
    pressure: float
    volume: float
    void_area: float
    status: str
    area: float
    pads: int
    balance: str

    @property
    def section(self) -> float:
        """Area projected along any direction, m², of a pattern that is round."""
        return self.height * 2.0 * math.sqrt(self.area / math.pi)

    @property
    def force(self) -> float:
        """Pressure times section, N (thesis 4.18): an estimate, see :meth:`Wet.force`."""
        return self.pressure * self.section


def wet(
    mesh: Mesh,
    liquid: Liquid,
    balance: str = 'energy',
    layers: int = 100,
    slices: int = 36,
    axis: tuple[float, float] | None = None,
    floor_angle: float = 0.0,
    strict: bool = True,
) -> Wet:
    """Return how high liquid climbs round one pad.

    Parameters
    ----------
    mesh : Mesh
        A single pad, a star as seen from its axis.
    liquid : Liquid
        Its contact angle is ``liquid.angle``.
    balance : {'energy', 'force', 'thesis'}
        What holds the liquid up. ``energy`` is within 4 to 9 % of the exact meniscus of a dome
        where the solid has up to 0.7 of the liquid's tension, 6 to 15 % above that.
    layers : int
        From floor to top, from 4. The error falls with their square.
    slices : int
        Round the axis, from 3. Each is in balance by itself.
    axis : tuple of float, optional
        x and y of the axis, m: by default the centroid of the lowest layer.
    floor_angle : float
        Contact angle on the floor, rad, from 0 (the floor is wet all over) to below pi/2.
    strict : bool
        Refuse heights that are ``far_off``. Without it they are taken as they are, up to 3 times
        too high or low: to compare, not to use.

    Raises
    ------
    InvalidInput
        When a value is not allowed.
    MeshError
        Where a slice does not meet the wall just once in every layer.
    """
    _check(mesh, liquid, balance)
    _whole('layers', layers, 4, 100000)
    _whole('slices', slices, 3, 3600)
    number('floor_angle', floor_angle, 'rad', high=math.nextafter(0.5 * math.pi, 0.0))
    if axis is None:
        axis = centre(mesh, 0.5 * mesh.height / layers)
    else:
        axis = _pair(axis)
    cut = walls(mesh, layers, slices, axis)
    return _climb(cut, liquid, balance, floor_angle, axis, strict)


def _climb(
    cut: Walls,
    liquid: Liquid,
    balance: str,
    floor_angle: float,
    axis: tuple[float, float],
    strict: bool,
) -> Wet:
    """Balance every slice of a wall."""
    theta, tension = liquid.angle, liquid.surface_tension
    weight = liquid.density * GRAVITY
    z, r, a = cut.heights, cut.radii, cut.inclinations
    cells, rows = z.size - 1, np.arange(len(r))
    arc = _Arc(z, r, a, theta, floor_angle)

    # Per radian of azimuth: moments of the liquid's section, and the wall below.
    inner = _cumulative(z, r**2), _cumulative(z, z * r**2)
    volume, lifted = 0.5 * (arc.volume - inner[0]), 0.5 * (arc.moment - inner[1])
    slant = 0.5 * (r[:, 1:] + r[:, :-1]) * np.hypot(np.diff(z), np.diff(r))
    wall = np.concatenate([np.zeros((len(r), 1)), np.cumsum(slant, axis=1)], axis=1)
    covered = 0.5 * (arc.floor_radius**2 - r[:, :1] ** 2)

    free = arc.area - math.cos(floor_angle) * covered - math.cos(theta) * wall
    least = _lowest(np.where(arc.open, weight * lifted + tension * free, np.inf))
    if balance == 'energy':
        place = least
    else:
        if balance == 'force':
            misfit = tension * np.sin(theta + a) * r - weight * volume
        else:
            misfit = tension * math.cos(theta) * wall - 2.0 * weight * lifted
        place = _first_root(np.where(arc.open, misfit, -np.inf))
    judge = least if strict else place
    # No way up: the liquid would leave the wall downwards at once.
    no_rise = ~arc.open[:, 1]
    if balance == 'thesis' and math.cos(theta) <= 1e-12:
        no_rise[:] = True

    status = np.full(len(r), 'ok', dtype='<U9')
    status[np.isnan(place) | np.isnan(judge)] = 'coarse'
    status[(place >= cells) | (judge >= cells)] = 'saturated'
    status[no_rise] = 'dry'
    place = np.where(status == 'ok', place, np.nan)

    at = np.clip(np.nan_to_num(place), 0.0, cells - 1e-9)
    k = at.astype(int)
    share = at - k

    def here(values: Array) -> Array:
        return (1.0 - share) * values[rows, k] + share * values[rows, k + 1]

    heights = np.where(status == 'ok', z[-1] / cells * place, np.nan)
    radii, angles = here(r), here(a)
    top = _Arc(heights[:, None], radii[:, None], angles[:, None], theta, floor_angle)
    # The arc must stay clear of the wall below it.
    for j in np.flatnonzero(status == 'ok'):
        wall_there = np.interp(top.z[j, 0], z, r[j])
        if (top.r[j, 0] < wall_there - _THROUGH_WALL * heights[j]).any() or not top.open[j, 0]:
            status[j] = 'no_circle'
    if strict:
        far = _disagree(place, judge) | _no_arc(place, cut, liquid)
        status[far & (status == 'ok')] = 'far_off'
    good = status == 'ok'
    curvature = np.where(good, top.radius[:, 0], np.nan)
    with np.errstate(divide='ignore'):
        pressure = tension * (1.0 / radii - 1.0 / curvature)
    return Wet(
        azimuths=cut.azimuths,
        heights=np.where(good, heights, np.nan),
        ring_radii=np.where(good, radii, np.nan),
        floor_radii=np.where(good, top.floor_radius[:, 0], np.nan),
        curvature_radius=curvature,
        pressure=np.where(good, pressure, np.nan),
        status=status,
        axis=axis,
        top=float(z[-1]),
        floor_angle=floor_angle,
        balance=balance,
        liquid=liquid,
    )


class _Arc:
    """Arcs of circles from the wall down to the floor, one for each height they could end at.

    ``volume`` and ``moment`` are the integrals of r² and z r² over the height, ``area`` that of r
    over the arc's length; ``open`` says where there is an arc.
    """

    def __init__(self, height: Array, wall: Array, slope: Array, theta: float, floor: float):
        last = math.pi - theta - slope  # inclination where the arc meets the wall
        self.open = last > floor + 1e-9
        last = np.where(self.open, last, floor + 1.0)
        self.radius = height / (math.cos(floor) - np.cos(last))
        self.floor_radius = wall + self.radius * (np.sin(last) - math.sin(floor))
        half = 0.5 * (last - floor)[..., None]
        turn = floor + half * (1.0 + _NODES)
        radius = self.radius[..., None]
        centre = (self.floor_radius + self.radius * math.sin(floor))[..., None]
        self.r = centre - radius * np.sin(turn)
        self.z = radius * (math.cos(floor) - np.cos(turn))
        length = radius * half * _WEIGHTS
        rise = length * np.sin(turn)
        self.area = (self.r * length).sum(axis=-1)
        self.volume = (self.r**2 * rise).sum(axis=-1)
        self.moment = (self.r**2 * self.z * rise).sum(axis=-1)


def wet_pattern(
    mesh: Mesh,
    liquid: Liquid,
    area: float,
    pads: int = 1,
    balance: str = 'energy',
    layers: int = 200,
    strict: bool = True,
) -> WetPattern:
    """Return how high liquid stands between many pads (thesis 4.19 to 4.23).

    Parameters
    ----------
    mesh : Mesh
        One pad of many, or all of them: any shape.
    liquid : Liquid
        What is between them.
    area : float
        Of the whole pattern, m²: ``pads`` times what ``mesh`` stands for.
    pads : int
        How often the mesh stands there, from 1.
    balance : {'energy', 'force', 'thesis'}
        As for :func:`wet`. In narrow gaps ``energy`` and ``force`` meet the wall of a dome where
        its slope is the contact angle, h = R(1 + cos θ) above a floor it touches, whatever the
        pitch.
    layers : int
        From floor to top, from 4.
    strict : bool
        Refuse what is ``far_off``, as for :func:`wet`, and what is ``far_apart``: heights of
        pads with wide gaps, where the level surface is lower than the meniscus of each pad.

    Raises
    ------
    MeshError
        Where no room is left between the pads.
    InvalidInput
        When a value is not allowed.
    """
    _check(mesh, liquid, balance)
    number('area', area, 'm²', above=True)
    _whole('pads', pads, 1, 10**6)
    _whole('layers', layers, 4, 100000)
    cut = layered(mesh, layers, liquid.angle)
    void = area - pads * cut.areas
    if void.min() <= 0.0:
        k = int(np.argmax(void <= 0.0))
        raise MeshError(
            f'{mesh.source}: {pads} of these fill {pads * cut.areas[k]:.4g} m² at'
            f' z = {cut.heights[k]:.4g} m, and the pattern has only area = {area:.4g} m²:'
            ' the pads overlap'
        )
    return _fill(cut, void, pads, liquid, area, balance, strict)


def _fill(
    cut: Layers, void: Array, pads: int, liquid: Liquid, area: float, balance: str, strict: bool
) -> WetPattern:
    """Balance a level surface between pads."""
    z, cells = cut.heights, cut.heights.size - 1
    place, no_rise = _level(cut, void, pads, liquid, balance)
    judge = place
    if strict:
        judge, nowhere = _level(cut, void, pads, liquid, 'energy')
        no_rise |= nowhere
    room, shore = (
        np.interp(place, np.arange(z.size), each) for each in (void, pads * cut.outline)
    )
    if no_rise:
        status = 'dry'
    elif math.isnan(place) or math.isnan(judge):
        status = 'coarse'
    elif max(place, judge) >= cells:
        status = 'saturated'
    elif strict and room > WIDEST_GAP * _capillary_length(liquid) * shore:
        status = 'far_apart'
    elif _disagree(place, judge):
        status = 'far_off'
    else:
        status = 'ok'
    height = place * z[1] if status == 'ok' else math.nan

    def here(values: Array) -> float:
        return float(np.interp(height, z, values)) if status == 'ok' else math.nan

    return WetPattern(
        height=float(height),
        pressure=-liquid.density * GRAVITY * float(height),
        volume=here(_cumulative(z, void)),
        void_area=here(void),
        status=status,
        area=float(area),
        pads=pads,
        balance=balance,
    )


def _level(
    cut: Layers, void: Array, pads: int, liquid: Liquid, balance: str
) -> tuple[float, bool]:
    """Return where a level surface is in balance, in layers, and whether nothing rises."""
    tension, weight = liquid.surface_tension, liquid.density * GRAVITY
    z = cut.heights
    if balance == 'energy':
        # The slope of the energy; the areas of facets by themselves have one with steps.
        misfit = tension * pads * cut.gain - weight * z * void
        no_rise = misfit[0] <= 0.0 and misfit[1] <= 0.0
        lowest = int(np.argmin(-_cumulative(z, misfit)))
        first = misfit[: max(lowest - 1, 0)]
        np.abs(first, out=first)  # hills on the way are passed
    elif balance == 'force':
        misfit = tension * pads * cut.pull - weight * _cumulative(z, void)
        no_rise = cut.pull[0] <= 0.0 and cut.pull[1] <= 0.0
    else:
        lifted = _cumulative(z, z * void)
        misfit = tension * math.cos(liquid.angle) * pads * cut.wetted - 2.0 * weight * lifted
        no_rise = math.cos(liquid.angle) <= 1e-12
    return float(_first_root(misfit[None])[0]), bool(no_rise)


# --- Where a balance is met -------------------------------------------------------------------


def _cumulative(z: Array, values: Array) -> Array:
    """Return the integral over height from the floor up to every layer, by trapezia."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1]) * np.diff(z)
    total = np.zeros(values.shape)
    np.cumsum(steps, axis=-1, out=total[..., 1:])
    return total


def _disagree(place: Floats, judge: Floats) -> npt.NDArray[np.bool_]:
    """Tell where a balance is met too far from where another is."""
    return np.abs(np.subtract(place, judge)) > AGREEMENT * np.asarray(judge)


def _no_arc(place: Array, cut: Walls, liquid: Liquid) -> npt.NDArray[np.bool_]:
    """Tell on which walls the liquid's surface is known to be no arc of a circle."""
    z, rows = cut.heights, np.arange(len(cut.radii))
    layer = np.nan_to_num(place).clip(0, z.size - 1).astype(int)
    ring = cut.radii[rows, layer]
    mean = np.arctan2(z[layer], ring - cut.radii[:, 0])
    straight = cut.inclinations[rows, layer] - mean < _STRAIGHT
    slender = ring < SLENDER * _capillary_length(liquid)
    return straight & (slender | ((mean > _STEEP) & (liquid.angle < WETTING)))


def _capillary_length(liquid: Liquid) -> float:
    return math.sqrt(liquid.surface_tension / (liquid.density * GRAVITY))


def _lowest(energy: Array) -> Array:
    """Return where each row is least, in layers: NaN below the second, the last for the end.

    Next to where arcs end the place is known to a layer only, and NaN, too.
    """
    last = energy.shape[1] - 1
    k = np.argmin(energy, axis=1)
    with np.errstate(invalid='ignore'):
        slope = np.diff(energy, axis=1)  # between two layers
    rows = np.arange(len(energy))
    inner = np.clip(k, 1, last - 1)
    place = _between(-slope, rows, inner - 1) + 0.5
    sharp = ~np.isfinite(energy[rows, inner + 1])
    return np.where(k == last, float(last), np.where((k < 2) | sharp, np.nan, place))


def _first_root(misfit: Array) -> Array:
    """Return where each row falls to 0 for the first time, in layers: NaN below the second.

    Rows that never do give the last layer; NaN, too, is what falls next to where arcs end.
    """
    last = misfit.shape[1] - 1
    fallen = misfit[:, 1:] <= 0.0
    k = np.argmax(fallen, axis=1)
    rows = np.arange(len(misfit))
    good = np.isfinite(misfit[rows, k + 1]) & (k >= 2)
    place = np.where(good, _between(misfit, rows, k), np.nan)
    return np.where(fallen.any(axis=1), place, float(last))


def _between(values: Array, rows: Indices, k: Indices) -> Array:
    """Return where rows of values, above 0 at k, pass 0 before k + 1.

    On the parabola through both and the value before them, so that the error falls smoothly.
    """
    before, here, after = values[rows, np.maximum(k - 1, 0)], values[rows, k], values[rows, k + 1]
    with np.errstate(divide='ignore', invalid='ignore'):
        bend = np.where(k > 0, 0.5 * (after + before) - here, 0.0)
        slope = after - here - bend
        return k + 2.0 * here / (np.sqrt(slope**2 - 4.0 * bend * here) - slope)


# --- What is asked ----------------------------------------------------------------------------


def _check(mesh: Mesh, liquid: Liquid, balance: str) -> None:
    if not isinstance(mesh, Mesh):
        raise InvalidInput(f'mesh = {mesh!r} is not allowed: a Mesh is needed')
    if not isinstance(liquid, Liquid):
        raise InvalidInput(f'liquid = {liquid!r} is not allowed: a Liquid is needed')
    choice('balance', balance, BALANCES)


def _whole(name: str, value: int, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InvalidInput(
            f'{name} = {value!r} is not allowed: a whole number from {low} to {high}'
        )


def _pair(axis: tuple[float, float]) -> tuple[float, float]:
    if np.shape(axis) != (2,):
        raise InvalidInput(f'axis = {axis!r} is not allowed: x and y, m, are needed')
    x, y = (number('axis', value, 'm', low=-math.inf) for value in axis)
    return x, y


def _azimuth(direction: Floats) -> float:
    """Return the azimuth of a direction, rad."""
    if np.ndim(direction) == 0:
        return number('direction', direction, 'rad', low=-math.inf)
    vector = np.asarray(direction)
    if vector.shape not in ((2,), (3,)) or vector.dtype.kind not in 'iuf':
        raise InvalidInput(
            f'direction = {direction!r} is not allowed: an azimuth in rad, or 2 or 3 numbers'
        )
    if not np.isfinite(vector).all() or not np.hypot(*vector[:2]) > 0.0:
        raise InvalidInput(f'direction = {direction!r} is not allowed: it points nowhere')
    return math.atan2(vector[1], vector[0])


# --- Time -------------------------------------------------------------------------------------


def timed(mesh: Mesh, liquid: Liquid, repeats: int = 5, **options: int | str) -> float:
    """Return the shortest time that :func:`wet` takes of several, s."""
    shortest = math.inf
    for _ in range(repeats):
        begun = time.perf_counter()
        wet(mesh, liquid, **options)  # type: ignore[arg-type]
        shortest = min(shortest, time.perf_counter() - begun)
    return shortest
