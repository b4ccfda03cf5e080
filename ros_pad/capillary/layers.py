# SPDX-License-Identifier: Apache-2.0
"""Height to which liquid climbs a pad, from balances in slices or layers (thesis chapter 4).

The floor around the pad is wet; far away the liquid has height 0. In a slice of azimuth the wall
is a curve r(z) with inclination a(z) to the floor. The surface of the liquid is approximated by a
circular arc that meets the wall at height h with the contact angle θ and ends on the floor with
the angle θ_f: its radius is R = h/(cos(θ + a) + cos θ_f). One of three balances gives h:

- ``energy``: h minimises the energy of weight, surface and wetted wall;
- ``force``: the surface tension carries the weight, γ sin(θ + a) r = ρ g V;
- ``thesis``: Eq. 4.11 summed from the floor, γ cos θ A_wet = 2 ρ g Σ z V. In a tube this is
  Jurin's law; elsewhere it is not an equilibrium, and it gives no rise for contact angles of 90
  degrees and more.

The last two also have solutions where there is no equilibrium. They are compared with ``energy``:
a relative difference in height above ``AGREEMENT`` is refused. The arc is a bad approximation on
straight walls if the pad is slender (the true surface extends farther out) or the wall is steep
and completely wetted: at ``SLENDER`` and ``WETTING`` the error of the height is about a sixth. On
walls that bulge, like those of domes, the wall limits the rise, whatever the surface is like.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.mesh import Indices, Mesh
from ros_pad.capillary.sections import Layers, Walls, centre, layered, walls
from ros_pad.configuration import choice, instance, integer, number
from ros_pad.contact.meniscus import Liquid, hysteresis_force
from ros_pad.contact.pad import Array, Floats
from ros_pad.errors import InvalidInput, MeshError

BALANCES = ('energy', 'force', 'thesis')
AGREEMENT = 0.15  # allowed relative difference between the heights of a balance and of ``energy``
SLENDER = 0.35  # radius in capillary lengths below which arcs fail on a straight pad
WETTING = math.radians(10.0)  # contact angle below which arcs are too high on steep straight walls
_STEEP = math.radians(70.0)  # inclination from which a wall is steep
_STRAIGHT = math.radians(10.0)  # a straight wall changes its inclination by less than this
WIDEST_GAP = 0.7  # capillary lengths; between pads farther apart the surface is not level
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_ROUND = 720  # pieces of a contact line, for projections


@dataclass(frozen=True)
class Wet:
    """Liquid around one pad, in slices of azimuth.

    Where a slice has no result, its numbers are NaN and its status gives the reason: ``dry`` (no
    rise: the liquid is pushed down), ``coarse`` (the rise is less than two layers, or within a
    layer of the height above which no arc exists: more layers are needed), ``saturated`` (the
    liquid rises above the top of the mesh), ``no_circle`` (no circular arc fits between wall and
    floor), ``far_off`` (an error of a sixth or more: the height differs from that of lowest energy
    by more than ``AGREEMENT``, or the wall is straight, and slender or steep and completely
    wetted).

    Attributes
    ----------
    azimuths : array, shape (slices,)
        Azimuth of each slice, rad from the x axis.
    heights : array, shape (slices,)
        Height of the contact line, where liquid, wall and air meet, m.
    ring_radii : array, shape (slices,)
        Distance of the contact line from the axis, m.
    floor_radii : array, shape (slices,)
        Distance from the axis at which the surface ends on the floor, m.
    curvature_radius : array, shape (slices,)
        Radius R of the surface in the plane of the slice, m.
    pressure : array, shape (slices,)
        Pressure of the liquid minus that of the air, γ(1/r - 1/R), Pa: suction below 0.
    status : array of str, shape (slices,)
        ``ok`` or the reason why there is no result.
    axis : tuple of float
        x and y of the axis, m.
    balance : str
        One of ``BALANCES``.
    liquid : Liquid
        The liquid.
    """

    azimuths: Array
    heights: Array
    ring_radii: Array
    floor_radii: Array
    curvature_radius: Array
    pressure: Array
    status: npt.NDArray[np.str_]
    axis: tuple[float, float]
    balance: str
    liquid: Liquid

    @property
    def mean_height(self) -> float:
        """Mean height over the slices, m; NaN if one of them has no result."""
        return float(np.mean(self.heights))

    @property
    def height_spread(self) -> float:
        """Difference between the highest and the lowest slice, m; NaN if one has no result."""
        return float(np.ptp(self.heights))

    def section(self, direction: float) -> float:
        """Return the liquid's area projected along a direction of motion, m².

        NaN if a slice has no result.

        Parameters
        ----------
        direction : float
            Azimuth of the motion, rad from the x axis.

        Returns
        -------
        float
            Area, m².

        Raises
        ------
        InvalidInput
            When the direction is not finite.
        """
        return self._projected(direction, np.ones_like(self.heights))

    def force(self, direction: float) -> float:
        """Return pressure times section for a direction of motion (thesis 4.18).

        This is the thesis' estimate of the force on one side of the pad. It is not a bound,
        because the pressure is that of an arc. Exact surfaces pull many times as much on each of
        the two sides, and around a symmetric pad these forces cancel.

        Parameters
        ----------
        direction : float
            Azimuth of the motion, rad from the x axis.

        Returns
        -------
        float
            Force, N; below 0 the liquid pulls. NaN if a slice has no result.

        Raises
        ------
        InvalidInput
            As for :meth:`section`.
        """
        return self._projected(direction, self.pressure)

    def hysteresis_force(
        self, direction: float, advancing_angle: float, receding_angle: float
    ) -> float:
        """Return the largest force of the pinned contact line against a motion.

        This is the width of the line across the direction, times tension, times cos θ_receding -
        cos θ_advancing; see :func:`ros_pad.contact.hysteresis_force`.

        Parameters
        ----------
        direction : float
            Azimuth of the motion, rad from the x axis.
        advancing_angle, receding_angle : float
            Contact angles at which the line starts to move, rad, from 0 to pi; advancing >=
            receding.

        Returns
        -------
        float
            Force, N; NaN if a slice has no result.

        Raises
        ------
        InvalidInput
            When an angle is out of range, or as for :meth:`section`.
        """
        across = self._across(direction)
        width = float(np.ptp(across)) if np.isfinite(self.heights).all() else math.nan
        if math.isnan(width):
            return math.nan
        tension = self.liquid.surface_tension
        return float(hysteresis_force(0.5 * width, tension, advancing_angle, receding_angle))

    def surface(self, count: int = 17) -> Array:
        """Return points of the surface from floor to wall.

        Parameters
        ----------
        count : int
            Number of points in each slice, 2 to 1000.

        Returns
        -------
        array, shape (slices, count, 3)
            Points, m; NaN in slices without a result.

        Raises
        ------
        InvalidInput
            When the count is out of range.
        """
        integer('count', count, 2, 1000)
        last = np.arccos(np.clip(1.0 - self.heights / self.curvature_radius, -1.0, 1.0))
        turn = np.linspace(0.0, 1.0, count) * last[:, None]
        curvature = self.curvature_radius[:, None]
        inward = curvature * np.sin(turn)
        r, z = self.floor_radii[:, None] - inward, curvature * (1.0 - np.cos(turn))
        x = self.axis[0] + r * np.cos(self.azimuths)[:, None]
        y = self.axis[1] + r * np.sin(self.azimuths)[:, None]
        return np.stack([x, y, z], axis=2)

    def _across(self, direction: float) -> Array:
        """Return the coordinate across a direction along the closed contact line, m."""
        forward = number('direction', direction, 'rad', low=-math.inf)
        turns = np.linspace(0.0, 2.0 * math.pi, _ROUND + 1)
        radii = np.interp(turns, self.azimuths, self.ring_radii, period=2.0 * math.pi)
        return radii * np.sin(turns - forward)

    def _projected(self, direction: float, factor: Array) -> float:
        across = self._across(direction)
        middle = 2.0 * math.pi * (np.arange(_ROUND) + 0.5) / _ROUND
        load = np.interp(middle, self.azimuths, factor * self.heights, period=2.0 * math.pi)
        # The sum covers front and rear, each with the whole section.
        return 0.5 * float(np.sum(load * np.abs(np.diff(across))))


@dataclass(frozen=True)
class WetPattern:
    """Liquid between many pads, with a level surface. Numbers are NaN if there is no result.

    Attributes
    ----------
    height : float
        Height of the surface above the floor, m.
    pressure : float
        Pressure of the liquid just below the surface minus that of the air, -ρ g h, Pa: suction.
    volume : float
        Volume of the liquid, m³.
    void_area : float
        Area between the pads at this height, m².
    status : str
        As for :class:`Wet`, or ``far_apart``: void area over outline is more than ``WIDEST_GAP``
        capillary lengths, so that the surface sags between the pads.
    area : float
        Area of the whole pattern, m².
    pads : int
        Number of copies of the mesh in the pattern.
    balance : str
        One of ``BALANCES``.
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
        """Projected area of a circular pattern, along any direction, m²."""
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
    strict: bool = True,
) -> Wet:
    """Compute the height to which liquid climbs around one pad.

    Parameters
    ----------
    mesh : Mesh
        A single pad; each horizontal section is star-shaped as seen from the axis.
    liquid : Liquid
        Its contact angle is ``liquid.angle``.
    balance : {'energy', 'force', 'thesis'}
        Balance that gives the height. With ``energy`` the error against the exact meniscus of a
        dome is 4 to 9 % if the tension of the solid is up to 0.7 of that of the liquid, 6 to 15 %
        above.
    layers : int
        Number of layers from floor to top, from 4. The error falls with their square.
    slices : int
        Number of slices around the axis, from 3. Each slice has its own balance.
    axis : tuple of float, optional
        x and y of the axis, m; by default the centroid of the lowest layer.
    strict : bool
        Refuse heights that are ``far_off``. If False they are returned, up to 3 times too high or
        low; use them only for comparison.

    Returns
    -------
    Wet
        Height and radius of the contact line, m, pressure, Pa, and status of each slice.

    Raises
    ------
    InvalidInput
        When a value is out of range or of the wrong type.
    MeshError
        Where a slice does not meet the wall exactly once in every layer.

    Examples
    --------
    The exact meniscus of this dome in a wide bath is 0.889 mm high (:func:`bath_meniscus`):

    >>> from ros_pad.capillary import Mesh, wet
    >>> from ros_pad.contact import WATER
    >>> found = wet(Mesh.dome(1.55e-3, 0.583e-3), WATER)
    >>> round(1e3 * found.mean_height, 3), set(found.status.tolist())
    (0.957, {'ok'})
    """
    _check(mesh, liquid, balance)
    integer('layers', layers, 4, 100000)
    integer('slices', slices, 3, 3600)
    if axis is None:
        axis = centre(mesh, 0.5 * mesh.height / layers)
    if len(axis) != 2:
        raise InvalidInput(f'axis = {axis!r} is not allowed: x and y, m, are needed')
    x, y = (number('axis', value, 'm', low=-math.inf) for value in axis)
    cut = walls(mesh, layers, slices, (x, y))
    z, r, a = cut.heights, cut.radii, cut.inclinations
    cells, rows = z.size - 1, np.arange(len(r))
    place, least, no_rise = _places(cut, liquid, balance)
    judge = least if strict else place
    status = _first_statuses(place, judge, no_rise, cells)
    place = np.where(status == 'ok', place, np.nan)

    at = np.clip(np.nan_to_num(place), 0.0, cells - 1e-9)
    k = at.astype(int)
    share = at - k

    def here(values: Array) -> Array:
        return (1.0 - share) * values[rows, k] + share * values[rows, k + 1]

    heights = np.where(status == 'ok', z[-1] / cells * place, np.nan)
    radii, angles = here(r), here(a)
    top = _Arc(heights[:, None], radii[:, None], angles[:, None], liquid.angle)
    for j in np.flatnonzero(status == 'ok'):
        wall = np.interp(top.z[j, 0], z, r[j])
        # Walls are faceted: an arc may be slightly inside.
        through = (top.r[j, 0] < wall - 0.01 * heights[j]).any()
        if through or not top.open[j, 0]:
            status[j] = 'no_circle'
    if strict:
        far = _disagree(place, judge) | _no_arc(place, cut, liquid)
        status[far & (status == 'ok')] = 'far_off'
    good = status == 'ok'
    curvature = np.where(good, top.radius[:, 0], np.nan)
    with np.errstate(divide='ignore'):
        pressure = liquid.surface_tension * (1.0 / radii - 1.0 / curvature)
    return Wet(
        azimuths=cut.azimuths,
        heights=np.where(good, heights, np.nan),
        ring_radii=np.where(good, radii, np.nan),
        floor_radii=np.where(good, top.floor_radius[:, 0], np.nan),
        curvature_radius=curvature,
        pressure=np.where(good, pressure, np.nan),
        status=status,
        axis=(x, y),
        balance=balance,
        liquid=liquid,
    )


def _first_statuses(
    place: Array, judge: Array, no_rise: npt.NDArray[np.bool_], cells: int
) -> npt.NDArray[np.str_]:
    """Return the status of each slice as far as its heights, in layers, determine it."""
    status = np.full(len(place), 'ok', dtype='<U9')
    status[np.isnan(place) | np.isnan(judge)] = 'coarse'
    status[(place >= cells) | (judge >= cells)] = 'saturated'
    status[no_rise] = 'dry'
    return status


def _places(
    cut: Walls, liquid: Liquid, balance: str
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Find the heights of the balance and of the lowest energy of each slice, in layers.

    Also returns the slices in which the liquid does not rise.
    """
    theta, tension = liquid.angle, liquid.surface_tension
    weight = liquid.weight
    z, r, a = cut.heights, cut.radii, cut.inclinations
    arc = _Arc(z, r, a, theta)

    # Per radian of azimuth: moments of the liquid's section, and the area of the wall below.
    inner = _cumulative(z, r**2), _cumulative(z, z * r**2)
    volume, lifted = 0.5 * (arc.volume - inner[0]), 0.5 * (arc.moment - inner[1])
    slant = 0.5 * (r[:, 1:] + r[:, :-1]) * np.hypot(np.diff(z), np.diff(r))
    wall = np.concatenate([np.zeros((len(r), 1)), np.cumsum(slant, axis=1)], axis=1)
    covered = 0.5 * (arc.floor_radius**2 - r[:, :1] ** 2)

    free = arc.area - covered - math.cos(theta) * wall
    least = _lowest(np.where(arc.open, weight * lifted + tension * free, np.inf))
    no_rise = ~arc.open[:, 1]
    if balance == 'energy':
        return least, least, no_rise
    if balance == 'force':
        misfit = tension * np.sin(theta + a) * r - weight * volume
    else:
        misfit = tension * math.cos(theta) * wall - 2.0 * weight * lifted
        no_rise |= math.cos(theta) <= 1e-12
    return _first_root(np.where(arc.open, misfit, -np.inf)), least, no_rise


class _Arc:
    """Circular arcs from the wall down to the floor, one for each height of the contact line.

    ``volume`` and ``moment`` are the integrals of r² and z r² over the height, ``area`` is that of
    r over the arc length; ``open`` is true where an arc exists. ``r`` and ``z`` are its points.
    """

    def __init__(self, height: Array, wall: Array, slope: Array, theta: float):
        last = math.pi - theta - slope  # inclination of the arc at the wall
        self.open = last > 1e-9
        last = np.where(self.open, last, 1.0)
        self.radius = height / (1.0 - np.cos(last))
        self.floor_radius = wall + self.radius * np.sin(last)
        half = 0.5 * last[..., None]
        turn = half * (1.0 + _NODES)
        radius = self.radius[..., None]
        self.r = self.floor_radius[..., None] - radius * np.sin(turn)
        self.z = radius * (1.0 - np.cos(turn))
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
    """Compute the height of liquid between many pads (thesis 4.19 to 4.23).

    Parameters
    ----------
    mesh : Mesh
        One pad of many, or all of them: any shape.
    liquid : Liquid
        The liquid between them.
    area : float
        Area of the whole pattern, m², above 0: ``pads`` times the area for one ``mesh``.
    pads : int
        Number of copies of the mesh in the pattern, from 1.
    balance : {'energy', 'force', 'thesis'}
        As for :func:`wet`. In narrow gaps ``energy`` and ``force`` give the height at which the
        slope of a dome is the contact angle: h = R(1 + cos θ) for a sphere that touches the floor,
        for every pitch.
    layers : int
        Number of layers from floor to top, from 4.
    strict : bool
        Refuse heights that are ``far_off``, as for :func:`wet`, or ``far_apart``: in wide gaps the
        level surface is lower than the meniscus of each pad.

    Returns
    -------
    WetPattern
        Height, m, pressure, Pa, volume, m³, and status.

    Raises
    ------
    MeshError
        Where the pads fill the whole area.
    InvalidInput
        When a value is out of range or of the wrong type.

    Examples
    --------
    >>> from ros_pad.capillary import Mesh, wet_pattern
    >>> from ros_pad.contact import WATER
    >>> mesh = Mesh.dome(1.55e-3, 0.583e-3, height=2.9e-3)
    >>> found = wet_pattern(mesh, WATER, area=10.4e-6)
    >>> round(1e3 * found.height, 3), found.status
    (1.664, 'ok')
    """
    _check(mesh, liquid, balance)
    number('area', area, 'm²', above=True)
    integer('pads', pads, 1, 10**6)
    integer('layers', layers, 4, 100000)
    cut = layered(mesh, layers, liquid.angle)
    void = area - pads * cut.areas
    if void.min() <= 0.0:
        k = int(np.argmax(void <= 0.0))
        raise MeshError(
            f'{mesh.source}: {pads} copies of the mesh need {pads * cut.areas[k]:.4g} m² at'
            f' z = {cut.heights[k]:.4g} m, but area = {area:.4g} m²: the pads overlap'
        )
    z, cells = cut.heights, cut.heights.size - 1
    place, no_rise = _level(cut, void, pads, liquid, balance)
    judge = place
    if strict:
        judge, nowhere = _level(cut, void, pads, liquid, 'energy')
        no_rise |= nowhere
    status = _first_statuses(np.array([place]), np.array([judge]), np.array([no_rise]), cells)[0]
    if status == 'ok':
        layers_up = np.arange(z.size)
        room, shore = (np.interp(place, layers_up, each) for each in (void, pads * cut.outline))
        if strict and room > WIDEST_GAP * liquid.capillary_length * shore:
            status = 'far_apart'
        elif _disagree(place, judge):
            status = 'far_off'
    height = place * z[1] if status == 'ok' else math.nan

    def here(values: Array) -> float:
        return float(np.interp(height, z, values)) if status == 'ok' else math.nan

    return WetPattern(
        height=float(height),
        pressure=-liquid.weight * float(height),
        volume=here(_cumulative(z, void)),
        void_area=here(void),
        status=str(status),
        area=float(area),
        pads=pads,
        balance=balance,
    )


def _level(
    cut: Layers, void: Array, pads: int, liquid: Liquid, balance: str
) -> tuple[float, bool]:
    """Return where a level surface is in balance, in layers, and whether there is no rise."""
    tension, weight = liquid.surface_tension, liquid.weight
    z = cut.heights
    if balance == 'energy':
        # Minus the derivative of the energy, from smooth normals; facet areas would have steps.
        misfit = tension * pads * cut.gain - weight * z * void
        no_rise = misfit[0] <= 0.0 and misfit[1] <= 0.0
        lowest = int(np.argmin(-_cumulative(z, misfit)))
        first = misfit[: max(lowest - 1, 0)]
        np.abs(first, out=first)  # ignore local minima of the energy at lower heights
    elif balance == 'force':
        misfit = tension * pads * cut.pull - weight * _cumulative(z, void)
        no_rise = cut.pull[0] <= 0.0 and cut.pull[1] <= 0.0
    else:
        lifted = _cumulative(z, z * void)
        misfit = tension * math.cos(liquid.angle) * pads * cut.wetted - 2.0 * weight * lifted
        no_rise = math.cos(liquid.angle) <= 1e-12
    return float(_first_root(misfit[None])[0]), bool(no_rise)


# --- Roots and minima over layers -------------------------------------------------------------


def _cumulative(z: Array, values: Array) -> Array:
    """Return the integral over height from the floor to every layer, by the trapezoidal rule."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1]) * np.diff(z)
    total = np.zeros(values.shape)
    np.cumsum(steps, axis=-1, out=total[..., 1:])
    return total


def _disagree(place: Floats, judge: Floats) -> npt.NDArray[np.bool_]:
    """Return where two heights, in layers, differ by more than ``AGREEMENT``."""
    return np.abs(np.subtract(place, judge)) > AGREEMENT * np.asarray(judge)


def _no_arc(place: Array, cut: Walls, liquid: Liquid) -> npt.NDArray[np.bool_]:
    """Return the walls on which the surface is known to be far from a circular arc."""
    z, rows = cut.heights, np.arange(len(cut.radii))
    layer = np.nan_to_num(place).clip(0, z.size - 1).astype(int)
    ring = cut.radii[rows, layer]
    mean = np.arctan2(z[layer], ring - cut.radii[:, 0])
    straight = cut.inclinations[rows, layer] - mean < _STRAIGHT
    slender = ring < SLENDER * liquid.capillary_length
    return straight & (slender | ((mean > _STEEP) & (liquid.angle < WETTING)))


def _lowest(energy: Array) -> Array:
    """Return the minimum of each row, in layers, or the last layer if the energy falls to there.

    NaN below the second layer, and next to the end of the arcs, where the minimum is not resolved.
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
    """Return where each row falls to 0 for the first time, in layers, or the last layer.

    NaN below the second layer, and next to the end of the arcs.
    """
    last = misfit.shape[1] - 1
    fallen = misfit[:, 1:] <= 0.0
    k = np.argmax(fallen, axis=1)
    rows = np.arange(len(misfit))
    good = np.isfinite(misfit[rows, k + 1]) & (k >= 2)
    place = np.where(good, _between(misfit, rows, k), np.nan)
    return np.where(fallen.any(axis=1), place, float(last))


def _between(values: Array, rows: Indices, k: Indices) -> Array:
    """Return where rows of values, above 0 at k and not at k + 1, cross 0.

    The parabola through both values and the value before them gives a smooth error.
    """
    before, here, after = values[rows, np.maximum(k - 1, 0)], values[rows, k], values[rows, k + 1]
    with np.errstate(divide='ignore', invalid='ignore'):
        bend = np.where(k > 0, 0.5 * (after + before) - here, 0.0)
        slope = after - here - bend
        return k + 2.0 * here / (np.sqrt(slope**2 - 4.0 * bend * here) - slope)


# --- Checks of arguments ----------------------------------------------------------------------


def _check(mesh: Mesh, liquid: Liquid, balance: str) -> None:
    instance('mesh', mesh, Mesh)
    instance('liquid', liquid, Liquid)
    choice('balance', balance, BALANCES)
