# SPDX-License-Identifier: Apache-2.0
"""Liquid bridge between a sphere and the plane below it.

The meridian has inclination φ and radius r at arc length s, counted upwards from the plane:
``dr/ds = cos φ``, ``dz/ds = sin φ`` and, by Young and Laplace, ``dφ/ds = p/γ - sin φ / r``, where
p is the pressure difference between liquid and air at height z. The meridian starts at
``φ = π - plane angle`` and ends on the sphere at ``φ = filling angle + contact angle``.

Without gravity ``ζ = r exp(iφ)`` satisfies ``dζ/ds = 1 + i H ζ`` with ``H = p/γ``: a rotation
about ``i/H``. This one formula covers nodoid, unduloid, catenoid, cylinder and sphere (Kenmotsu's
form of Delaunay's surfaces). The axial force is ``2π γ C`` with the first integral
``C = r sin φ - H r²/2``.

Units inside this module: lengths are divided by the sphere's radius, but in `_Shape` by the radius
of the contact line on the sphere. Shapes without gravity then form a family with one parameter
(``place``) for each pair of end inclinations.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, number, quantity
from ros_pad.contact.pad import Array, Floats, broadcast, plain
from ros_pad.errors import InvalidInput, NoBridge

# Allowed filling angles, rad. Outside, the liquid hardly touches the sphere, or covers it.
SMALLEST_FILLING, LARGEST_FILLING = 1e-4, math.pi - 1e-3


@dataclass(frozen=True)
class Bridge:
    """A liquid bridge. Floats for scalar input, arrays otherwise (method ``circle`` only).

    Attributes
    ----------
    force : float or array
        Axial force of the liquid on the sphere, N, attraction positive: surface tension at the
        contact line minus pressure on the wetted cap. With gravity, the force on the plane is
        smaller by the weight of the liquid.
    pressure : float or array
        Pressure of the liquid minus that of the air, at the plane, Pa; negative is suction.
        Without gravity it is the same everywhere.
    volume : float or array
        Volume of the liquid, m³.
    neck_radius : float or array
        Radius of the narrowest section, m; this may be one of the ends.
    filling_angle : float or array
        Angle at the sphere's centre between the axis and the contact line, rad.
    floor_radius : float or array
        Radius of the wetted disc on the plane, m.
    height : float or array
        Height of the contact line on the sphere above the plane, m.
    status : str or array of str
        ``ok``; with ``young_laplace`` also ``unstable``, where a bridge of this volume would break
        or jump to another shape; in arrays also ``no_bridge``, where the numbers are NaN.
    """

    force: Floats
    pressure: Floats
    volume: Floats
    neck_radius: Floats
    filling_angle: Floats
    floor_radius: Floats
    height: Floats
    status: Floats


def bridge(
    radius: float,
    surface_tension: float,
    contact_angle: npt.ArrayLike,
    filling_angle: npt.ArrayLike | None = None,
    volume: float | None = None,
    separation: npt.ArrayLike = 0.0,
    method: str = 'circle',
    gravity: float = 0.0,
    density: float = 1000.0,
    plane_angle: npt.ArrayLike | None = None,
) -> Bridge:
    """Compute the liquid bridge between a sphere and a plane.

    Parameters
    ----------
    radius : float
        Radius of the sphere, m, above 0.
    surface_tension : float
        Surface tension of the liquid, N/m, above 0.
    contact_angle : float or array
        Contact angle on the sphere, rad, from 0 to pi.
    filling_angle : float or array, optional
        Angle at the sphere's centre between the axis and the contact line, rad, from 1e-4 to
        pi - 1e-3.
    volume : float, optional
        Volume of the liquid, m³, above 0. Exactly one of filling angle and volume is required.
        Where two bridges have this volume, the stable one is returned: it has the larger filling
        angle, and its volume grows with the filling angle.
    separation : float or array
        Shortest distance between sphere and plane, m, from 0.
    method : {'circle', 'young_laplace'}
        ``circle`` takes a circular arc as meridian (toroidal approximation), with the pressure and
        force of its narrowest section. Its median error is 1 %, but above 10 % where a bridge is
        wide, flat or close to rupture. ``young_laplace`` is exact. Arrays of angles and
        separations are allowed only for ``circle`` with a filling angle.
    gravity : float
        Gravity towards the plane, m/s², from 0. Above 0 only with ``young_laplace``.
    density : float
        Density of the liquid, kg/m³, above 0.
    plane_angle : float or array, optional
        Contact angle on the plane, rad, from 0 to pi; by default equal to ``contact_angle``.

    Returns
    -------
    Bridge
        Force, N, pressure, Pa, volume, m³, radii and height, m, and status.

    Raises
    ------
    NoBridge
        When no bridge has this filling angle or volume: the liquid is too little for the
        separation, covers the sphere, or is too heavy.
    InvalidInput
        When a value is not finite or out of range, the method is unknown, shapes do not broadcast,
        both or none of filling angle and volume are given, gravity is above 0 with ``circle``, or
        a bridge with gravity is too wide, or its neck too narrow, to be resolved.

    Notes
    -----
    ``young_laplace`` follows the meridian as Kenmotsu's form of Delaunay's surfaces
    without gravity, and integrates it with gravity; see :mod:`ros_pad.contact.bridge`.

    Examples
    --------
    >>> from ros_pad.contact import bridge
    >>> exact = bridge(1e-3, 0.073, 0.0, filling_angle=0.1, method='young_laplace')
    >>> circle = bridge(1e-3, 0.073, 0.0, filling_angle=0.1)
    >>> round(1e6 * exact.force, 1), round(1e6 * circle.force, 1)  # micronewtons
    (899.0, 894.4)
    """
    size = number('radius', radius, 'm', above=True)
    tension = number('surface_tension', surface_tension, 'N/m', above=True)
    circle = choice('method', method, ('young_laplace', 'circle')) == 'circle'
    fall = number('gravity', gravity, 'm/s²', high=0.0 if circle else math.inf)
    weight = number('density', density, 'kg/m³', above=True) * fall
    if (filling_angle is None) == (volume is None):
        raise InvalidInput(
            f'filling_angle = {filling_angle!r} and volume = {volume!r} are not allowed: exactly'
            ' one of them is needed'
        )
    check: Callable[..., Any] = quantity if circle and volume is None else number
    theta = check('contact_angle', contact_angle, 'rad', high=math.pi)
    plane = theta
    if plane_angle is not None:
        plane = check('plane_angle', plane_angle, 'rad', high=math.pi)
    gap = check('separation', separation, 'm') / size
    beta = share = None
    if volume is None:
        beta = check('filling_angle', filling_angle, 'rad', SMALLEST_FILLING, LARGEST_FILLING)
    else:
        share = number('volume', volume, 'm³', above=True) / size**3
    if circle:
        found = _circle(theta, plane, gap, beta, share)
    else:
        found = _young_laplace(theta, plane, gap, beta, share, weight * size**2 / tension)
    return _in_si(found, size, tension)


def _in_si(found: Bridge, size: float, tension: float) -> Bridge:
    """Convert a bridge from units of sphere radius and surface tension to SI units."""
    units = (tension * size, tension / size, size**3, size, 1.0, size, size)
    values: dict[str, Any] = {
        each.name: plain(getattr(found, each.name) * unit)
        for each, unit in zip(dataclasses.fields(Bridge), units, strict=False)
    }
    return Bridge(**values, status=found.status if np.ndim(found.status) else str(found.status))


def _cap(beta: Floats) -> Floats:
    """Return the volume of the wetted cap of the sphere."""
    return math.pi / 3.0 * _rise(beta) ** 2 * (2.0 + np.cos(beta))


def _rise(beta: Floats) -> Floats:
    """Return the height of the contact line over the lowest point of the sphere."""
    return 2.0 * np.sin(0.5 * beta) ** 2


def _fillings(count: int) -> Array:
    """Return filling angles, dense near both ends of the allowed range."""
    low, high = (math.log(b / (math.pi - b)) for b in (SMALLEST_FILLING, LARGEST_FILLING))
    return math.pi / (1.0 + np.exp(-np.linspace(low, high, count)))


def _no_volume(volume: float, gap: float, known: Array) -> NoBridge:
    """Return the error for a volume; ``known`` are some volumes at this separation, or NaN."""
    why = 'none of any volume spans it'
    if np.isfinite(known).any():
        least, most = np.nanmin(known), np.nanmax(known)
        why = f'about {least:.3g} to {most:.3g} radius³ are there; with less liquid it ruptures'
        why += ', with more it covers the sphere'
    return NoBridge(
        f'no stable bridge has volume = {volume:.6g} radius³ at separation = {gap:g} radii: {why}'
    )


# --- Circle ---------------------------------------------------------------------------------


def _circle(
    theta: Array, plane: Array, gap: Array, beta: Array | None, volume: float | None
) -> Bridge:
    """Compute the toroidal bridge in units of sphere radius and surface tension."""
    if volume is not None:
        from scipy.optimize import brentq

        def held(angle: Floats) -> Floats:
            return np.nan_to_num(_arc(theta, plane, gap, angle).volume)

        fillings = _fillings(400)
        known = held(fillings)
        cells = np.flatnonzero((known[:-1] <= volume) & (volume <= known[1:]))
        if cells.size:
            ends = fillings[cells[-1]], fillings[cells[-1] + 1]
            beta = brentq(lambda angle: held(angle) - volume, *ends, xtol=1e-300, rtol=1e-14)
        # Below the smallest bridge the volume counts as 0: there the search ends at its jump.
        if beta is None or abs(held(beta) / volume - 1.0) > 1e-6:
            raise _no_volume(volume, float(gap), np.where(known > 0.0, known, np.nan))
    found = _arc(*broadcast('angles and separation', theta, plane, gap, beta))
    if np.ndim(found.force) == 0 and not math.isfinite(found.force):
        raise NoBridge(
            f"no bridge of method 'circle' has filling_angle = {beta:g} rad at separation ="
            f' {gap:g} radii and contact angles {theta:g} (sphere) and {plane:g} rad (plane): its'
            ' arc would not rise, would have no neck, or would run through the sphere'
        )
    return found


def _arc(theta: Floats, plane: Floats, gap: Floats, beta: Floats) -> Bridge:
    """Compute the bridge of a circular arc at a filling angle; NaN where there is none.

    The formulas use the length and the turning angle of the arc, which stay finite where the arc
    is straight (plane angle + contact angle + filling angle = pi).
    """
    start, end = math.pi - plane, beta + theta
    turn = end - start
    edge, height = np.sin(beta), gap + _rise(beta)
    rise = np.sin(0.5 * (start + end)) * np.sinc(turn / (2.0 * math.pi))
    length = height / np.where(rise > 0.0, rise, np.nan)

    def reach(share: Floats) -> Floats:
        """Return the radius at a share of the arc, counted from the plane."""
        rest = 0.5 * (1.0 - share) * turn
        return edge - length * (1.0 - share) * np.cos(end - rest) * np.sinc(rest / math.pi)

    # The narrowest section is at an end, or where the arc is vertical.
    upright = (0.5 * math.pi - start) / np.where(turn == 0.0, np.nan, turn)
    places = np.stack(
        np.broadcast_arrays(0.0, 1.0, np.clip(np.nan_to_num(upright), 0.0, 1.0) + 0.0 * length)
    )
    radii = reach(places)
    which = np.argmin(radii, axis=0)[None]
    share, neck = (np.take_along_axis(v, which, axis=0)[0] for v in (places, radii))
    nodes, weights = _gauss(24)
    at = np.expand_dims(nodes, tuple(range(1, 1 + np.ndim(neck))))
    under = np.tensordot(weights, reach(at) ** 2 * np.sin(start + at * turn), axes=1)
    volume = math.pi * length * under - _cap(beta)
    there = (neck > 0.0) & (volume > 0.0)  # volume <= 0: the arc runs through the sphere
    good = np.where(there, 0.0, np.nan)
    neck = neck + good
    sine, bend = np.sin(start + share * turn), turn / length
    return Bridge(
        force=math.pi * neck * (sine - neck * bend),
        pressure=sine / neck + bend,
        volume=volume + good,
        neck_radius=neck,
        filling_angle=beta + good,
        floor_radius=reach(0.0) + good,
        height=height + good,
        status=np.where(there, 'ok', 'no_bridge')[()],
    )


# --- Young and Laplace ----------------------------------------------------------------------


class _Shape(NamedTuple):
    """Meridians without gravity, in units of the radius of the contact line on the sphere."""

    floor: Array
    curvature: Array  # H
    integral: Array  # C
    length: Array
    height: Array  # NaN where there is no meridian
    volume: Array  # with the sphere's cap
    neck: Array
    radius: Array  # at the quadrature nodes (last axis), counted from the narrower end
    rise: Array  # derivative of the height over the quadrature variable, at these nodes


# Grid of ``place``; see _floor_and_curvature.
_PLACES = np.linspace(-46.0, 105.0, 303)


def _young_laplace(
    theta: float, plane: float, gap: float, beta: float | None, volume: float | None, bond: float
) -> Bridge:
    """Compute the exact bridge in units of sphere radius and surface tension."""
    angles = theta, plane
    if beta is None:
        assert volume is not None
        beta, place = _of_volume(angles, gap, volume)
    else:
        place = _of_filling(angles, gap, beta)
    stable = _stable(angles, beta, place)
    start, end = _inclinations(angles, beta)
    shape = _shapes(place, start, end, 128)
    edge, height = math.sin(beta), gap + _rise(beta)
    heights = edge * (_cumulative(128) @ shape.rise)
    if shape.floor > 1.0:
        heights = edge * shape.height - heights
    held = edge**3 * float(shape.volume) - _cap(beta)
    if bond > 0.0:
        along = np.linspace(0.0, 1.0, 129)
        zeta = edge * _spokes(1.0, end, shape.curvature, (along - 1.0) * shape.length)
        around = np.unwrap(np.angle(zeta))
        state = around - around[-1] + end, abs(zeta), along * height, along * held
        known = np.array([shape.curvature / edge, shape.length * edge, beta])
        case = _Case(theta, plane, gap, beta, volume)
        return _heavy(case, bond, along, np.array(state), known)
    _clear_of_solids(edge * shape.radius, heights, gap, held)
    return Bridge(
        force=2.0 * math.pi * edge * float(shape.integral),
        pressure=float(shape.curvature) / edge,
        volume=held,
        neck_radius=edge * float(shape.neck),
        filling_angle=beta,
        floor_radius=edge * float(shape.floor),
        height=height,
        status='ok' if stable else 'unstable',
    )


def _clear_of_solids(radii: Array, heights: Array, gap: float, volume: float) -> None:
    """Raise `NoBridge` where a meridian runs through the plane or the sphere."""
    inside = np.hypot(radii, heights - gap - 1.0) < 1.0 - 1e-7
    if inside.any() or np.min(heights) < -1e-7 or volume <= 0.0:
        raise NoBridge(
            f'no bridge exists at separation = {gap:g} radii: its surface would run through the'
            ' sphere or the plane'
        )


def _inclinations(angles: tuple[float, float], beta: Floats) -> tuple[Floats, Floats]:
    """Return the inclinations of the meridian at the plane and on the sphere."""
    start, end = math.pi - angles[1], beta + angles[0]
    # Cylinders of all lengths have the same end inclinations: use an almost cylindrical cone.
    cylinder = np.maximum(abs(np.cos(start)), abs(np.cos(end))) < 1e-7
    upright = 0.5 * math.pi + 1e-7
    return np.where(cylinder, upright, start), np.where(cylinder, upright, end)


@np.errstate(divide='ignore', invalid='ignore')  # radii of 0 belong to no bridge
def _shapes(place: Floats, start: Floats, end: Floats, order: int) -> _Shape:
    """Compute the meridians of the family with these end inclinations.

    Returns arrays that broadcast over the input; ``place`` is the parameter of the family.
    """
    floor, h, tau = _floor_and_curvature(place, start, end)
    length = tau / h
    integral = floor * (np.sin(math.pi - start) - 0.5 * h * floor)
    # From here on arc length and radii are counted from the narrower end.
    outward = floor > 1.0
    radius, slope = np.where(outward, 1.0, floor), np.where(outward, end, start)
    # The narrowest place of the whole periodic curve is where the vector H ζ - i points down.
    below, above = h * floor * np.sin(math.pi - start) - 1.0, h * np.sin(end) - 1.0
    spoke = np.arctan2(h * radius * np.cos(slope), np.where(outward, -above, -below))
    waist_at = np.where(outward, spoke, -spoke) / h
    other = waist_at - np.copysign(2.0 * math.pi / h, waist_at)
    apart, apart_other = (abs(each - np.clip(each, 0.0, length)) for each in (waist_at, other))
    waist_at = np.where(apart_other < apart, other, waist_at)
    swing = np.sqrt(np.maximum(1.0 - 2.0 * h * integral, 0.0))
    waist = 2.0 * abs(integral) / (1.0 + swing)

    # The integrands have poles next to the narrowest place, so the nodes are dense there.
    centre = np.clip(waist_at, 0.0, length)
    width = np.hypot(waist / np.sqrt(np.maximum(swing, 1e-6)), waist_at - centre)
    width = np.clip(width, 1e-100, 10.0 * length + 1e-100)
    first, last = np.arcsinh(-centre / width), np.arcsinh((length - centre) / width)
    nodes, weights = _gauss(order)
    steps = np.expand_dims(first, -1) + np.multiply.outer(last - first, nodes)
    s = np.expand_dims(centre, -1) + np.expand_dims(width, -1) * np.sinh(steps)
    per_node = np.expand_dims(width * (last - first), -1) * np.cosh(steps)  # ds

    s = np.where(np.expand_dims(outward, -1), -s, s)
    radii, slopes, bends = (np.expand_dims(value, -1) for value in (radius, slope, h))
    zeta = _spokes(radii, slopes, bends, s)
    r = abs(zeta)
    rise = zeta.imag / r * per_node
    turn = 0.5 * tau - integral * ((per_node / r**2) @ weights)
    # Past the shape whose neck has closed (a sphere) the arc turns the other way: no bridge.
    good = (floor > 0.0) & (abs(turn - (end - start)) < 1e-3)
    height = np.where(good, rise @ weights, np.nan)
    volume = math.pi * ((r * r * rise) @ weights)
    neck = np.where(waist_at == centre, waist, radius)
    return _Shape(floor, h, integral, length, height, volume, neck, r, rise)


def _floor_and_curvature(place: Floats, start: Floats, end: Floats) -> tuple[Array, Array, Array]:
    """Return floor radius, curvature H and rotation angle about i/H of meridians.

    With x = floor radius - 1 and y = H (1 + x/2) - sin start, the first integral at both ends
    gives the hyperbola ``x y = sin start - sin end``. The branch used begins with the short
    circular arc (place -> -inf: H -> ±inf, x -> 0). Its parameter is ``q = |x| - |y|``, which is
    smooth at the corner of the branch even where the right side is 0. Along the branch the height
    grows from 0 until the neck is too thin.
    """
    spread = 2.0 * np.cos(0.5 * (start + end)) * np.sin(0.5 * (start - end))
    q = 1e-12 * np.sinh(place)
    large = np.maximum(0.5 * (abs(q) + np.sqrt(q * q + 4.0 * abs(spread))), 1e-300)
    small = abs(spread) / large
    bend = np.where(end > start, 1.0, -1.0)
    side = np.where(spread != 0.0, bend * np.sign(spread), np.where(np.cos(start) < 0, 1.0, -1.0))
    x = side * np.where(q > 0.0, large, small)
    y = bend * np.where(q > 0.0, small, large)

    floor = 1.0 + x
    sine = np.sin(math.pi - start)  # 0 for complete wetting
    h = 2.0 * (sine + y) / (1.0 + floor)
    h = np.where(h == 0.0, 1e-300, h)
    # Rotation about i/H from the plane to the sphere: the angle between the two vectors H ζ - i.
    # This form is exactly 0 where x and the turning angle are 0.
    below, above = h * floor * sine - 1.0, h * np.sin(end) - 1.0
    half = 0.5 * (end - start)
    turning = h * floor * np.cos(half) - np.sin(0.5 * (start + end))
    cross = 2.0 * np.sin(half) * turning - x * np.cos(start)
    tau = np.arctan2(h * cross, h * h * floor * np.cos(start) * np.cos(end) + below * above)
    tau = np.where(tau * h < 0.0, tau + 2.0 * math.pi * np.sign(h), tau)
    return floor, h, tau


def _spokes(radius: Floats, slope: Floats, curvature: Floats, s: Floats) -> Floats:
    """Return ``ζ = r exp(iφ)`` after an arc length s: the solution of ``dζ/ds = 1 + i H ζ``."""
    a = curvature * s
    turned = radius * np.exp(1j * (slope + a))
    return turned + s * np.exp(0.5j * a) * np.sinc(a / (2.0 * math.pi))


def _gap_and_volume(
    angles: tuple[float, float], beta: Floats, place: Floats, order: int = 96
) -> Array:
    """Return separation and volume of the bridge at a filling angle and a place."""
    shape = _shapes(place, *_inclinations(angles, beta), order)
    edge = np.sin(beta)
    return np.stack([edge * shape.height - _rise(beta), edge**3 * shape.volume - _cap(beta)])


def _of_filling(angles: tuple[float, float], gap: float, beta: float) -> float:
    """Return the smallest place at which the meridian is high enough to reach the sphere."""
    from scipy.optimize import brentq, minimize_scalar

    def lack(place: Floats) -> Floats:
        return (gap - _gap_and_volume(angles, beta, place)[0]) / (gap + _rise(beta))

    lacks = lack(_PLACES)
    lacks = lacks[: int(np.argmin(np.append(np.isfinite(lacks), False)))]
    # The grid may miss the top of a peak.
    inner = lacks[1:-1]
    tops = 1 + np.flatnonzero((inner < lacks[:-2]) & (inner <= lacks[2:]) & (inner < 0.3))
    for k in np.union1d(tops, 1 + np.flatnonzero((lacks[:-1] > 0.0) & (lacks[1:] <= 0.0))):
        low, high = _PLACES[k - 1], _PLACES[k]
        if lacks[k] > 0.0:
            window = low, _PLACES[k + 1]
            high = minimize_scalar(
                lack, bounds=window, method='bounded', options={'xatol': 1e-9}
            ).x
        if lack(high) <= 0.0 < lack(low):
            return float(brentq(lack, low, high, xtol=1e-14, rtol=1e-15))
    raise NoBridge(
        f'no bridge has filling_angle = {beta:g} rad at separation = {gap:g} radii and contact'
        f' angles {angles[0]:g} (sphere) and {angles[1]:g} rad (plane): the bridge would rupture'
    )


def _stable(angles: tuple[float, float], beta: float, place: float) -> bool:
    """Return whether a bridge is stable: whether more volume allows a larger separation.

    This is the sign of the determinant of (separation, volume) over (filling angle, place). It
    changes at the largest separation for a fixed volume: there the bridge breaks.
    """
    changes = np.array([-1e-5, 1e-5])
    edge = min(beta, math.pi - beta)
    (gap_p, volume_p) = np.diff(_gap_and_volume(angles, beta, place + changes))[:, 0]
    (gap_b, volume_b) = np.diff(_gap_and_volume(angles, beta + edge * changes, place))[:, 0]
    return bool(gap_p * volume_b > gap_b * volume_p)


def _of_volume(angles: tuple[float, float], gap: float, volume: float) -> tuple[float, float]:
    """Return filling angle and place of the stable bridge of a volume.

    A grid of filling angles and places shows about where the bridges of this separation are. In
    most the first place of a filling angle is looked for; where their curve turns back, so that a
    filling angle has two of them, both unknowns together.
    """
    from scipy.optimize import brentq, root

    fillings, places = _fillings(96), _PLACES[:212:2]
    gaps, volumes = _gap_and_volume(angles, fillings[:, None], places, 32)
    rows, volumes_at, places_at = _crossings(gaps - gap, volumes, places)
    first = np.unique(rows, return_index=True)[1]
    angle, held = fillings[rows[first]], volumes_at[first]

    def excess(beta: float) -> float:
        return _gap_and_volume(angles, beta, _of_filling(angles, gap, beta))[1] - volume

    cells = np.flatnonzero((0.98 * held[:-1] <= volume) & (volume <= 1.02 * held[1:]))
    for k in cells[::-1]:
        with contextlib.suppress(NoBridge):
            if excess(angle[k]) <= 0.0 <= excess(angle[k + 1]):
                beta = float(brentq(excess, angle[k], angle[k + 1], rtol=1e-14))
                place = _of_filling(angles, gap, beta)
                if _stable(angles, beta, place):
                    return beta, place

    def misfit(unknown: Array) -> Array:
        beta = math.exp(min(unknown[0], math.log(LARGEST_FILLING)))
        found = _gap_and_volume(angles, beta, np.clip(unknown[1], -200.0, 200.0))
        off = np.array([(found[0] - gap) / (gap + _rise(beta)), found[1] / volume - 1.0])
        return np.where(np.isfinite(off), off, 1e3)

    known = volumes_at
    for width in (6.0, 0.6, 0.0):  # of a finer grid around the nearest bridge
        columns, along, turns = _crossings((gaps - gap).T, volumes.T, np.log(fillings))
        nearby = np.concatenate([volumes_at, along])
        starts = np.stack(
            [
                np.concatenate([np.log(fillings[rows]), turns]),
                np.concatenate([places_at, places[columns]]),
            ],
            axis=1,
        )
        best = np.argsort(abs(np.log(np.maximum(nearby, 1e-300) / volume)))[:4]
        for start in starts[best]:
            found = root(misfit, start, tol=1e-14).x
            beta, place = math.exp(found[0]), float(found[1])
            if abs(misfit(found)).max() < 1e-9 and _stable(angles, beta, place):
                return beta, place
        if not best.size:
            break
        window = starts[best[0]] + np.linspace(-width, width, 96)[:, None] * (0.1, 0.5)
        fillings, places = np.minimum(np.exp(window[:, 0]), LARGEST_FILLING), window[:, 1]
        gaps, volumes = _gap_and_volume(angles, fillings[:, None], places, 32)
        rows, volumes_at, places_at = _crossings(gaps - gap, volumes, places)
    raise _no_volume(volume, gap, known)


def _crossings(off: Array, volumes: Array, at: Array) -> tuple[npt.NDArray[np.intp], Array, Array]:
    """Return where rows of ``off`` change their sign: row, volume and place along the row."""
    known = np.isfinite(off[:, :-1] + off[:, 1:])
    rows, k = np.nonzero(known & ((off[:, :-1] < 0.0) != (off[:, 1:] < 0.0)))
    share = off[rows, k] / (off[rows, k] - off[rows, k + 1])
    held = volumes[rows, k] + share * (volumes[rows, k + 1] - volumes[rows, k])
    return rows, held, at[k] + share * (at[k + 1] - at[k])


# --- Gravity --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """Input of a bridge with gravity, in units of sphere radius and surface tension."""

    theta: float
    plane: float
    gap: float
    beta: float
    volume: float | None
    bond: float = 0.0  # Bond number: density gravity radius² / tension


def _heavy(case: _Case, bond: float, *start: Array) -> Bridge:
    """Follow a bridge from no gravity to ``bond``, halving steps where that fails."""
    from scipy.interpolate import CubicHermiteSpline

    done, step = 0.0, 1.0
    while done < bond:
        ahead = min(bond, done + step * bond)
        found = _settled(dataclasses.replace(case, bond=ahead), *start)
        if found is None:
            step *= 0.5
            if step < 2e-3:
                raise NoBridge(
                    'no bridge of this size carries its weight: when gravity is raised from 0,'
                    ' the bridge ruptures at density gravity radius² / surface_tension ='
                    f' {ahead:.3g}, before the given {bond:.3g}'
                )
        else:
            start, done = (found.x, found.y, found.p), ahead
    _, shape, (pressure, length, beta) = start
    coarse, around = start[0], int(np.argmin(shape[1]))
    ends = coarse[max(around - 1, 0)], coarse[min(around + 1, coarse.size - 1)]
    neck = CubicHermiteSpline(coarse, shape[1], length * np.cos(shape[0]))(np.linspace(*ends, 999))
    _clear_of_solids(shape[1], shape[2], case.gap, shape[3, -1])
    status = 'ok'
    if case.volume is None:
        wider = dataclasses.replace(case, bond=bond, beta=case.beta * (1.0 + 1e-4))
        more = _settled(wider, *start)
        status = 'ok' if more is not None and more.y[3, -1] > shape[3, -1] else 'unstable'
    edge, top = math.sin(beta), case.gap + _rise(beta)
    force = 2.0 * edge * math.sin(beta + case.theta) - edge**2 * (pressure - bond * top)
    return Bridge(
        force=math.pi * force - bond * _cap(beta),
        pressure=pressure,
        volume=shape[3, -1],
        neck_radius=neck.min(),
        filling_angle=beta,
        floor_radius=shape[1, 0],
        height=top,
        status=status,
    )


def _settled(case: _Case, along: Array, state: Array, known: Array) -> Any:
    """Return the meridian in equilibrium near a given one, or None.

    Rows are inclination, radius, height and volume over the relative arc length; parameters are
    pressure at the plane, arc length and filling angle.
    """
    from scipy.integrate import solve_bvp

    # Each length is compared with its own size.
    unit = np.array([1.0, state[1, -1], state[2, -1], abs(state[3]).max()])[:, None]

    def rates(_: Array, state: Array, known: Array) -> Array:
        phi, radius, height, _ = state * unit
        pressure, length, _ = known
        sine = np.sin(phi)
        bend = pressure - case.bond * height - sine / radius
        return length * np.stack([bend, np.cos(phi), sine, math.pi * radius**2 * sine]) / unit

    def misses(low: Array, high: Array, known: Array) -> Array:
        low, high, beta = low * unit[:, 0], high * unit[:, 0], known[2]
        held = high[3]
        given = beta / case.beta if case.volume is None else held / case.volume
        on_plane = low[[0, 2, 3]] - (math.pi - case.plane, 0.0, -_cap(beta))
        on_sphere = high[:3] - (beta + case.theta, np.sin(beta), case.gap + _rise(beta))
        off = np.concatenate([on_plane / unit[[0, 2, 3], 0], on_sphere / unit[:3, 0]])
        return np.append(off, given - 1.0)

    with np.errstate(all='ignore'):
        found = solve_bvp(rates, misses, along, state / unit, known, tol=1e-10, max_nodes=10000)
    found.y = found.y * unit
    near = found.success and abs(found.sol(along)[0] - state[0]).max() < 0.5
    sensible = found.y[1].min() > 0.0 and found.p[1] > 0.0 and 0.0 < found.p[2] < math.pi
    return found if near and sensible else None


@functools.lru_cache(maxsize=8)
def _gauss(order: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on the interval from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@functools.lru_cache(maxsize=8)
def _cumulative(order: int) -> Array:
    """Return the matrix that maps values at the nodes to integrals from 0 to each node."""
    legendre = np.polynomial.legendre
    nodes, weights = legendre.leggauss(order)
    values = legendre.legvander(nodes, order - 1)
    integrals = np.stack(
        [legendre.legval(nodes, legendre.legint(e, lbnd=-1)) for e in np.eye(order)]
    )
    return 0.5 * integrals.T @ ((np.arange(order) + 0.5)[:, None] * values.T * weights)
