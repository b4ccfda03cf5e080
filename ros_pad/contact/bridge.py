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
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, number, quantity
from ros_pad.contact.pad import Array, Floats
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
    weight = number('density', density, 'kg/m³', above=True) * number('gravity', gravity, 'm/s²')
    choice('method', method, ('young_laplace', 'circle'))
    if (filling_angle is None) == (volume is None):
        raise InvalidInput(
            'exactly one of filling_angle and volume is needed, but'
            f' {"none" if volume is None else "both"} is given'
        )
    if plane_angle is None:
        plane_angle = contact_angle
    if method == 'circle' and weight > 0.0:
        raise InvalidInput(
            f"gravity = {gravity:g} m/s² is not allowed with method 'circle', which ignores it: "
            "method='young_laplace' is needed"
        )

    check: Callable[..., Any] = number
    if method == 'circle' and volume is None:
        check = quantity
    theta = check('contact_angle', contact_angle, 'rad', high=math.pi)
    plane = check('plane_angle', plane_angle, 'rad', high=math.pi)
    gap = check('separation', separation, 'm') / size
    if volume is None:
        beta = check('filling_angle', filling_angle, 'rad', SMALLEST_FILLING, LARGEST_FILLING)
        share = None
    else:
        beta = None
        share = number('volume', volume, 'm³', above=True) / size**3

    if method == 'circle':
        found = _circle(theta, plane, gap, beta, share)
    else:
        found = _young_laplace(theta, plane, gap, beta, share, weight * size**2 / tension)
    return _in_si(found, size, tension)


def _in_si(found: Bridge, size: float, tension: float) -> Bridge:
    """Convert a bridge from units of sphere radius and surface tension to SI units."""
    units = {
        'force': tension * size,
        'pressure': tension / size,
        'volume': size**3,
        'neck_radius': size,
        'filling_angle': 1.0,
        'floor_radius': size,
        'height': size,
    }
    values = {name: getattr(found, name) * unit for name, unit in units.items()}
    if np.ndim(found.status):
        return Bridge(**values, status=found.status)
    return Bridge(
        **{name: float(value) for name, value in values.items()}, status=str(found.status)
    )


# --- Circle ---------------------------------------------------------------------------------


def _circle(
    theta: Array, plane: Array, gap: Array, beta: Array | None, volume: float | None
) -> Bridge:
    """Compute the toroidal bridge in units of sphere radius and surface tension."""
    if volume is not None:
        fillings = _fillings(400)
        fillings = np.sort(np.append(fillings, _least_arc(theta, plane, gap, fillings)))
        curve = _arc(theta, plane, gap, fillings).volume
        cells, least, most = _growing(curve, volume)
        k = next((k for k in cells[::2] if curve[k] <= volume <= curve[k + 1]), None)
        if k is None:
            raise NoBridge(_no_volume(volume, least, most))
        from scipy.optimize import brentq

        beta = brentq(
            lambda angle: _arc(theta, plane, gap, angle).volume - volume,
            fillings[k],
            fillings[k + 1],
        )
    try:
        found = _arc(theta, plane, gap, beta)
    except ValueError as error:
        raise InvalidInput(
            'contact_angle, plane_angle, separation and filling_angle of shapes'
            f' {np.shape(theta)}, {np.shape(plane)}, {np.shape(gap)} and'
            f' {np.asarray(beta).shape} do not broadcast'
        ) from error
    if np.ndim(found.force) == 0 and not math.isfinite(found.force):
        raise NoBridge(
            f"no bridge of method 'circle' has filling_angle = {beta:g} rad at separation ="
            f' {gap:g} radii and contact angles {theta:g} (sphere) and {plane:g} rad (plane): its'
            ' arc would not rise, would have no neck, or would run through the sphere'
        )
    return found


def _least_arc(theta: Array, plane: Array, gap: Array, fillings: Array) -> float:
    """Return the smallest filling angle with a neck; circular bridges do not exist below it."""
    there = np.isfinite(_arc(theta, plane, gap, fillings).neck_radius)
    lost = np.flatnonzero(~there[:-1] & there[1:])
    if not lost.size:
        return float(fillings[0])
    low, high = fillings[lost[-1]], fillings[lost[-1] + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        reached = math.isfinite(_arc(theta, plane, gap, middle).neck_radius)
        low, high = (low, middle) if reached else (middle, high)
    return float(high)


def _arc(theta: Array, plane: Array, gap: Array, beta: Floats) -> Bridge:
    """Compute the bridge of a circular arc at a filling angle; NaN where there is none.

    The formulas use the length and the turning angle of the arc, which stay finite where the arc
    is straight (plane angle + contact angle + filling angle = pi).
    """
    start, end = math.pi - plane, beta + theta
    turn = end - start
    edge, height = np.sin(beta), gap + 2.0 * np.sin(0.5 * beta) ** 2
    rise = np.sin(0.5 * (start + end)) * np.sinc(turn / (2.0 * math.pi))
    length = height / np.where(rise > 0.0, rise, np.nan)

    def reach(share: Floats) -> Floats:
        """Return the radius at a share of the arc, counted from the plane."""
        rest = 0.5 * (1.0 - share) * turn
        return edge - length * (1.0 - share) * np.cos(end - rest) * np.sinc(rest / math.pi)

    # The narrowest section is at an end, or where the arc is vertical.
    with np.errstate(divide='ignore', invalid='ignore'):
        upright = np.nan_to_num((0.5 * math.pi - start) / turn)
    places = np.stack(np.broadcast_arrays(0.0, 1.0, np.clip(upright, 0.0, 1.0) + 0.0 * length))
    radii = reach(places)
    which = np.argmin(radii, axis=0)[None]
    share, neck = (np.take_along_axis(v, which, axis=0)[0] for v in (places, radii))
    neck = np.where(neck > 0.0, neck, np.nan)
    sine, bend = np.sin(start + share * turn), turn / length
    nodes, weights = _gauss(24)
    at = np.expand_dims(nodes, tuple(range(1, 1 + np.ndim(neck))))
    under = np.tensordot(weights, reach(at) ** 2 * np.sin(start + at * turn), axes=1)
    volume = math.pi * length * under - _cap(beta)
    neck = np.where(volume > 0.0, neck, np.nan)  # volume <= 0: the arc runs through the sphere
    good = 0.0 * neck
    return Bridge(
        force=math.pi * neck * (sine - neck * bend),
        pressure=sine / neck + bend,
        volume=volume + good,
        neck_radius=neck,
        filling_angle=beta + good,
        floor_radius=reach(0.0) + good,
        height=height + good,
        status=np.where(np.isfinite(neck), 'ok', 'no_bridge')[()],
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


# Grid of ``place``, and the value of q over sinh(place); see _floor_and_curvature.
_PLACES = np.linspace(-46.0, 105.0, 303)
_FINEST = 1e-12


def _young_laplace(
    theta: float,
    plane: float,
    gap: float,
    beta: float | None,
    volume: float | None,
    bond: float,
) -> Bridge:
    """Compute the exact bridge in units of sphere radius and surface tension."""
    if bond > 0.0:
        return _heavy(_Case(theta, plane, beta, volume, gap, bond))
    beta, place = _found_place(theta, plane, gap, beta, volume)
    start, end = _inclinations(theta, plane, beta)
    shape = _shapes(place, start, end, 128)
    edge = math.sin(beta)
    heights = edge * (_cumulative(128) @ shape.rise)
    if shape.floor > 1.0:
        heights = edge * shape.height - heights
    held = edge**3 * float(shape.volume) - _cap(beta)
    _clear_of_solids(edge * shape.radius, heights, gap, held)
    return Bridge(
        force=2.0 * math.pi * edge * float(shape.integral),
        pressure=float(shape.curvature) / edge,
        volume=held,
        neck_radius=edge * float(shape.neck),
        filling_angle=beta,
        floor_radius=edge * float(shape.floor),
        height=gap + 2.0 * math.sin(0.5 * beta) ** 2,
        status='ok' if volume or _stable_filling(theta, plane, gap, beta) else 'unstable',
    )


def _found_place(
    theta: float, plane: float, gap: float, beta: float | None, volume: float | None
) -> tuple[float, float]:
    """Return filling angle and place (parameter of its family) of a bridge without gravity."""
    if beta is not None:
        return beta, _place_of_filling(theta, plane, gap, beta)
    assert volume is not None
    return _place_of_volume(theta, plane, gap, volume)


def _inclinations(theta: float, plane: float, beta: Floats) -> tuple[Floats, Floats]:
    """Return the inclinations of the meridian at the plane and on the sphere."""
    start, end = math.pi - plane, beta + theta
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
    outward = floor > 1.0
    radius, slope = np.where(outward, 1.0, floor), np.where(outward, end, start)
    waist_at, waist, swing = _waist(floor, h, length, integral, start, end)
    neck = np.where(_outside(waist_at, length) > 0.0, radius, waist)

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
    height = rise @ weights
    turn = 0.5 * tau - integral * ((per_node / r**2) @ weights)
    # Past the shape whose neck has closed (a sphere) the arc turns the other way: no bridge.
    good = (floor > 0.0) & (abs(turn - (end - start)) < 1e-3)
    return _Shape(
        floor,
        h,
        integral,
        length,
        np.where(good, height, np.nan),
        math.pi * ((r * r * rise) @ weights),
        neck,
        r,
        rise,
    )


def _floor_and_curvature(place: Floats, start: Floats, end: Floats) -> tuple[Array, Array, Array]:
    """Return floor radius, curvature H and rotation angle about i/H of meridians.

    With x = floor radius - 1 and y = H (1 + x/2) - sin start, the first integral at both ends
    gives the hyperbola ``x y = sin start - sin end``. The branch used begins with the short
    circular arc (place -> -inf: H -> ±inf, x -> 0). Its parameter is ``q = |x| - |y|``, which is
    smooth at the corner of the branch even where the right side is 0. Along the branch the height
    grows from 0 until the neck is too thin.
    """
    spread = 2.0 * np.cos(0.5 * (start + end)) * np.sin(0.5 * (start - end))
    q = _FINEST * np.sinh(place)
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


def _waist(
    floor: Array, h: Array, length: Array, integral: Array, start: Floats, end: Floats
) -> tuple[Array, Array, Array]:
    """Return place, radius and swing of the narrowest place of the whole periodic curve.

    The place is the distance along the arc from its narrower end; at this place the vector
    H ζ - i points down. Swing is the radius of the rotation about i/H, times H.
    """
    outward = floor > 1.0
    radius, slope = np.where(outward, 1.0, floor), np.where(outward, end, start)
    below = h * floor * np.sin(math.pi - start) - 1.0
    above = h * np.sin(end) - 1.0
    spoke = np.arctan2(h * radius * np.cos(slope), np.where(outward, -above, -below))
    waist_at = np.where(outward, spoke, -spoke) / h
    period = 2.0 * math.pi / abs(h)
    other = waist_at - np.copysign(period, waist_at)
    closer = _outside(other, length) < _outside(waist_at, length)
    waist_at = np.where(closer, other, waist_at)
    swing = np.sqrt(np.maximum(1.0 - 2.0 * h * integral, 0.0))
    return waist_at, 2.0 * abs(integral) / (1.0 + swing), swing


def _outside(place: Floats, length: Floats) -> Floats:
    """Return the distance of a place from the interval from 0 to a length."""
    return np.maximum(np.maximum(-place, place - length), 0.0)


def _spokes(radius: Floats, slope: Floats, curvature: Floats, s: Floats) -> Floats:
    """Return ``ζ = r exp(iφ)`` after an arc length s: the solution of ``dζ/ds = 1 + i H ζ``."""
    a = curvature * s
    turned = radius * np.exp(1j * (slope + a))
    return turned + s * np.exp(0.5j * a) * np.sinc(a / (2.0 * math.pi))


def _heights(place: Floats, theta: float, plane: float, beta: Floats, order: int) -> Floats:
    start, end = _inclinations(theta, plane, beta)
    return _shapes(place, start, end, order).height


def _place_of_filling(theta: float, plane: float, gap: float, beta: float) -> float:
    """Return the smallest place at which the meridian is high enough to reach the sphere."""
    from scipy.optimize import brentq, minimize_scalar

    aim = (gap + 2.0 * math.sin(0.5 * beta) ** 2) / math.sin(beta)
    heights = _heights(_PLACES, theta, plane, beta, 96)
    heights = heights[: int(np.argmin(np.append(np.isfinite(heights), False)))]

    def lack(place: float) -> float:
        return aim - float(_heights(place, theta, plane, beta, 96))

    low = high = None
    inner = heights[1:-1]
    peaks = 1 + np.flatnonzero((inner > heights[:-2]) & (inner >= heights[2:]))
    for peak in peaks[heights[peaks] > 0.7 * aim]:  # the grid may miss the top of a peak
        window = _PLACES[peak - 1], _PLACES[peak + 1]
        top = minimize_scalar(lack, bounds=window, method='bounded', options={'xatol': 1e-9})
        if top.fun <= 0.0:
            low, high = (window[0], top.x)
            break
    up = np.flatnonzero((heights[:-1] < aim) & (heights[1:] >= aim))
    if up.size and (high is None or _PLACES[up[0] + 1] <= high):
        low, high = _PLACES[up[0]], _PLACES[up[0] + 1]
    if low is None or high is None:
        raise NoBridge(
            f'no bridge has filling_angle = {beta:g} rad at separation = {gap:g} radii and contact'
            f' angles {theta:g} (sphere) and {plane:g} rad (plane): the bridge would rupture'
        )
    return float(brentq(lack, low, high, xtol=1e-14, rtol=1e-15))


def _stable_place(theta: float, plane: float, beta: float, place: float) -> bool:
    """Return whether a bridge is stable: whether more volume allows a larger separation.

    This is the sign of the determinant of (separation, volume) over (filling angle, place). It
    changes at the largest separation for a fixed volume: there the bridge breaks.
    """
    step = 1e-5
    changes = np.array([-step, step])
    edge = min(beta, math.pi - beta)
    at_place = _gap_and_volume(theta, plane, beta, place + changes)
    at_beta = _gap_and_volume(theta, plane, beta + edge * changes, place)
    (gap_p, volume_p), (gap_b, volume_b) = np.diff(at_place)[:, 0], np.diff(at_beta)[:, 0]
    return bool(gap_p * volume_b > gap_b * volume_p)


def _stable_filling(theta: float, plane: float, gap: float, beta: float) -> bool:
    """Return whether the volume grows with the filling angle at this separation (stable)."""
    step = 1e-4 * min(beta, math.pi - beta)

    def volume(angle: float) -> float:
        place = _place_of_filling(theta, plane, gap, angle)
        return float(_gap_and_volume(theta, plane, angle, place)[1])

    volumes = []
    for angle in (beta - step, beta + step):
        try:
            volumes.append(volume(angle))
        except NoBridge:
            volumes.append(volume(beta))
    return volumes[1] > volumes[0]


def _gap_and_volume(theta: float, plane: float, beta: Floats, place: Floats) -> Array:
    """Return separation and volume of the bridge at a filling angle and a place."""
    start, end = _inclinations(theta, plane, beta)
    shape = _shapes(place, start, end, 96)
    edge = np.sin(beta)
    gap = edge * shape.height - 2.0 * np.sin(0.5 * beta) ** 2
    return np.stack([gap, edge**3 * shape.volume - _cap(beta)])


def _place_of_volume(theta: float, plane: float, gap: float, volume: float) -> tuple[float, float]:
    """Return filling angle and place of the stable bridge of a volume.

    Candidates come from the curve of all bridges at this separation. Each is refined in both
    unknowns at once, because the curve may turn back in the filling angle.
    """
    from scipy.optimize import root

    places, volumes, angles = _curve(theta, plane, gap)
    guesses, least, most = _growing(volumes, volume)

    def misfit(unknown: Array) -> list[float]:
        if np.max(abs(unknown)) > 200.0:
            return [1e3, 1e3]
        beta = math.pi / (1.0 + math.exp(-unknown[0]))
        found = _gap_and_volume(theta, plane, beta, unknown[1])
        width = gap + 2.0 * math.sin(0.5 * beta) ** 2
        values = [(found[0] - gap) / width, found[1] / volume - 1.0]
        return [value if math.isfinite(value) else 1e3 for value in values]

    for k in guesses:
        beta = angles[k]
        found = root(misfit, [math.log(beta / (math.pi - beta)), places[k]], tol=1e-14)
        if max(map(abs, misfit(found.x))) > 1e-9:
            continue
        beta = math.pi / (1.0 + math.exp(-found.x[0]))
        if _stable_place(theta, plane, beta, found.x[1]):
            return beta, float(found.x[1])
    # Near a cylinder the place changes too fast for this search: solve for the place separately.
    for k in guesses[::2]:
        with contextlib.suppress(NoBridge):
            found_beta = _filling_of_volume(theta, plane, gap, volume, angles[k], angles[k + 1])
            if found_beta is not None:
                return found_beta, _place_of_filling(theta, plane, gap, found_beta)
    raise NoBridge(_no_volume(volume, least, most))


def _filling_of_volume(
    theta: float, plane: float, gap: float, volume: float, low: float, high: float
) -> float | None:
    """Return the filling angle from ``low`` to ``high`` at which the bridge has this volume.

    None if the volume does not grow past this value between the two angles.
    """
    from scipy.optimize import brentq

    def excess(beta: float) -> float:
        place = _place_of_filling(theta, plane, gap, beta)
        return float(_gap_and_volume(theta, plane, beta, place)[1]) - volume

    if low < high and excess(low) <= 0.0 <= excess(high):
        return float(brentq(excess, low, high, rtol=1e-14))
    return None


def _curve(theta: float, plane: float, gap: float) -> Array:
    """Return place, volume and filling angle (rows) along all bridges of one separation.

    The curve runs from thin necks through the smallest volume, where a bridge breaks, to large
    volumes.
    """
    fillings = _fillings(96)
    first, second = _scan(theta, plane, gap, fillings)
    first, second = (np.vstack([found, fillings]) for found in (first, second))
    # Between two filling angles the first bridges may end (the curve turns back into the second
    # ones), or their place may jump, perhaps over the smallest volume.
    before, after = first[0, :-1], first[0, 1:]
    pieces, end = [], fillings.size
    for k in np.flatnonzero(np.isfinite(after) & ~(before - after < 3.0))[::-1]:
        stop = np.nan_to_num(np.fmin(second[0, k + 1], before[k]), nan=60.0)
        between = np.linspace(after[k], stop, 81)[1:]
        back = _turning_back(theta, plane, gap, fillings[k : k + 2], between)
        pieces += [first[:, k + 1 : end], back[:, ::-1]]
        end = k + 1
        if np.isfinite(second[0, k + 1]) or np.isnan(before[k]):
            pieces.append(second[:, k + 1 :][:, ::-1])
            break
    else:
        pieces.append(first[:, :end])
    curve: Array = np.concatenate(pieces[::-1], axis=1)
    return curve[:, np.isfinite(curve[0])]


def _scan(theta: float, plane: float, gap: float, fillings: Array) -> Array:
    """Return place and volume of the first and the second bridge of each filling angle.

    Shape (2 bridges, 2 quantities, filling angles); NaN where there is no bridge.
    """
    aims = (gap + 2.0 * np.sin(0.5 * fillings) ** 2) / np.sin(fillings)
    coarse = _PLACES[_PLACES < 60.0]  # at larger places the wetted disc is 1e13 times wider
    ends = np.full((2, 2, fillings.size), np.nan)  # places between which the height is reached
    for row, beta in enumerate(fillings):
        heights = _heights(coarse, theta, plane, beta, 48)
        heights = heights[: int(np.argmin(np.append(np.isfinite(heights), False)))]
        reached = heights >= aims[row]
        for which, k in enumerate(np.flatnonzero(reached[:-1] != reached[1:])[:2]):
            ends[which, :, row] = coarse[k], coarse[k + 1]
    low, high = np.nan_to_num(ends[:, 0]), np.nan_to_num(ends[:, 1])
    for _ in range(12):
        middle = 0.5 * (low + high)
        reached = _heights(middle, theta, plane, fillings, 48) >= aims
        reached[1] = ~reached[1]
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    places = 0.5 * (low + high)
    found = np.stack([places, _gap_and_volume(theta, plane, fillings, places)[1]], axis=1)
    return np.where(np.isfinite(ends), found, np.nan)


def _turning_back(theta: float, plane: float, gap: float, ends: Array, places: Array) -> Array:
    """Return place, volume and filling angle of bridges where the curve turns back.

    ``places`` begin after the first bridge of the second filling angle in ``ends``; the result
    stops before the second bridge of this angle. The first angle has no bridge at these places.
    """
    low, high = (end + 0.0 * places for end in ends)
    within = _gap_and_volume(theta, plane, high, places)[0] >= gap
    for _ in range(25):
        middle = 0.5 * (low + high)
        reached = _gap_and_volume(theta, plane, middle, places)[0] >= gap
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    volumes = _gap_and_volume(theta, plane, high, places)[1]
    return np.stack([places, volumes, high])[:, : int(np.argmin(np.append(within, False)))]


def _fillings(count: int) -> Array:
    """Return filling angles, dense near both ends of the allowed range."""
    low, high = (math.log(b / (math.pi - b)) for b in (SMALLEST_FILLING, LARGEST_FILLING))
    return math.pi / (1.0 + np.exp(-np.linspace(low, high, count)))


def _growing(volumes: Array, volume: float) -> tuple[list[int], float, float]:
    """Find the cells in which growing volumes of bridges of one separation reach a volume.

    A cell is the interval between two neighbours in ``volumes``.

    Returns
    -------
    tuple
        Indices of both ends of these cells, best first (including cells that miss the volume by
        up to 2 %), and the smallest and the largest volume of all growing cells.
    """
    lower, upper = volumes[:-1], volumes[1:]
    grows = upper > lower
    if not grows.any():
        raise NoBridge(
            'no stable bridge of any volume spans this separation: a smaller separation or smaller'
            ' contact angles are needed'
        )
    cells = np.flatnonzero(grows & (0.98 * lower <= volume) & (volume <= 1.02 * upper))
    exact = (lower[cells] <= volume) & (volume <= upper[cells])
    cells = cells[np.lexsort((-cells, ~exact))][:6]
    guesses = np.stack([cells, cells + 1], axis=1).ravel().tolist()
    return guesses, float(lower[grows].min()), float(upper[grows].max())


def _no_volume(volume: float, least: float, most: float) -> str:
    if volume > most:
        why = f'at most {most:.6g} radius³ is allowed, because more liquid covers the sphere'
    elif volume < least:
        why = f'at least {least:.6g} radius³ is needed, because a bridge with less liquid ruptures'
    else:
        why = 'a larger volume is needed, because a bridge of this volume ruptures'
    return f'no stable bridge has volume = {volume:.6g} radius³: {why}'


def _cap(beta: Floats) -> Floats:
    """Return the volume of the wetted cap of the sphere."""
    return math.pi / 3.0 * (2.0 * np.sin(0.5 * beta) ** 2) ** 2 * (2.0 + np.cos(beta))


def _clear_of_solids(radii: Array, heights: Array, gap: float, volume: float) -> None:
    """Raise `NoBridge` where a meridian runs through the plane or the sphere."""
    inside = np.hypot(radii, heights - gap - 1.0) < 1.0 - 1e-7
    if inside.any() or np.min(heights) < -1e-7 or volume <= 0.0:
        raise NoBridge(
            f'no bridge exists at separation = {gap:g} radii: its surface would run through the'
            ' sphere or the plane'
        )


# --- Gravity --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """Input of a bridge with gravity, in units of sphere radius and surface tension."""

    theta: float
    plane: float
    beta: float | None
    volume: float | None
    gap: float
    bond: float  # Bond number: density gravity radius² / tension


def _heavy(case: _Case) -> Bridge:
    """Compute the bridge with gravity by continuation from a bridge without gravity.

    Where this fails, the continuation starts from the sphere in contact with the plane, or from
    the volume that a filling angle of 1 rad gives without gravity.
    """
    paths = [[dataclasses.replace(case, bond=0.0), case]]
    if case.gap > 0.0:
        touching = dataclasses.replace(case, gap=0.0)
        paths.append([dataclasses.replace(touching, bond=0.0), touching, case])
    if case.volume is not None:
        with contextlib.suppress(NoBridge):
            medium = _young_laplace(case.theta, case.plane, case.gap, 1.0, None, 0.0)
            if medium.volume > 0.0:
                other = dataclasses.replace(case, volume=medium.volume)
                paths.append([dataclasses.replace(other, bond=0.0), other, case])
    errors = []
    for path in paths:
        try:
            return _continued(path)
        except NoBridge as error:
            errors.append(error)
    raise errors[0]


def _continued(path: list[_Case]) -> Bridge:
    """Compute the last bridge of a path of cases; increase the number of nodes if needed."""
    for order in (64, 192):
        with contextlib.suppress(_Coarse):
            return _at_order(path, order)
    raise InvalidInput(
        f'a bridge with density gravity radius² / surface_tension = {path[-1].bond:.3g} and'
        f' separation = {path[-1].gap:g} radii is not allowed: its surface is too wide, or its'
        ' neck too narrow, to be resolved with 192 nodes'
    )


class _Coarse(Exception):
    """The nodes are too few to resolve a surface."""


def _at_order(path: list[_Case], order: int) -> Bridge:
    """Compute the last bridge of a path with this number of nodes."""
    first, case = path[0], path[-1]
    state, stable = _without_gravity(first, order)
    sign = _orientation(first, state)
    state = _along_path(path, state)
    nodes = _gauss(order)[0]
    series = np.polynomial.legendre.legfit(2.0 * nodes - 1.0, state[:order], order - 1)
    if np.max(abs(series[-4:])) > 1e-8 * np.max(abs(series)):
        raise _Coarse
    return _bridge_of(case, state, stable == (sign == _orientation(case, state)))


def _without_gravity(first: _Case, order: int) -> tuple[Array, bool]:
    """Return the state of the first case of a path, and whether this bridge is stable."""
    try:
        beta, place = _found_place(first.theta, first.plane, first.gap, first.beta, first.volume)
    except NoBridge as error:
        raise NoBridge(
            f'{error} (without gravity; with gravity no bridge was found either)'
        ) from None
    start, end = _inclinations(first.theta, first.plane, beta)
    shape = _shapes(place, start, end, 128)
    zeta = _spokes(1.0, end, shape.curvature, (_gauss(order)[0] - 1.0) * shape.length)
    turning = shape.length * (0.5 * shape.curvature - shape.integral / abs(zeta) ** 2)
    edge = math.sin(beta)
    state = np.append(turning, [shape.curvature / edge, shape.length * edge, beta])
    stable = bool(first.volume) or _stable_filling(first.theta, first.plane, first.gap, beta)
    return _settled(first, state), stable


def _along_path(path: list[_Case], state: Array) -> Array:
    """Follow the equilibrium along a path of cases, halving steps where Newton's method fails."""
    for old, new in itertools.pairwise(path):
        done, step = 0.0, 1.0
        while done < 1.0:
            ahead = min(1.0, done + step)
            between = dataclasses.replace(
                new,
                gap=old.gap + ahead * (new.gap - old.gap),
                bond=old.bond + ahead * (new.bond - old.bond),
                volume=new.volume and new.volume**ahead * (old.volume or 1.0) ** (1.0 - ahead),
            )
            try:
                state = _settled(between, state)
            except _Lost:
                step *= 0.5
                if step < 2e-3:
                    raise NoBridge(
                        'no bridge of this size carries its weight: when gravity is raised from 0,'
                        ' the bridge ruptures at density gravity radius² / surface_tension ='
                        f' {between.bond:.3g}, before the given {path[-1].bond:.3g}'
                    ) from None
                continue
            done, step = ahead, 2.0 * step
    return state


def _bridge_of(case: _Case, state: Array, stable: bool) -> Bridge:
    """Return the bridge of a state in equilibrium."""
    order = state.size - 3
    nodes, weights = _gauss(order)
    _, radius, height, volume, _ = _surface(case, state)
    _clear_of_solids(radius, height, case.gap, float(volume))
    pressure, length, beta = state[-3:]
    edge, top = math.sin(beta), case.gap + 2.0 * math.sin(0.5 * beta) ** 2
    floor = edge - length * float(np.cos(_surface(case, state)[0]) @ weights)
    series = np.polynomial.legendre.legfit(2.0 * nodes - 1.0, radius, order - 1)
    radii = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 4001), series)
    k = int(np.clip(np.argmin(radii), 1, 3999))
    # The neck is at the minimum of the parabola through three points, or at an end.
    slope, bend = 0.5 * (radii[k + 1] - radii[k - 1]), radii[k + 1] - 2 * radii[k] + radii[k - 1]
    inner = radii[k] - 0.5 * slope**2 / bend if abs(slope) < bend else math.inf
    force = 2.0 * edge * math.sin(beta + case.theta) - edge**2 * (pressure - case.bond * top)
    return Bridge(
        force=math.pi * force - case.bond * _cap(beta),
        pressure=float(pressure),
        volume=float(volume),
        neck_radius=float(min(inner, floor, edge)),
        filling_angle=float(beta),
        floor_radius=floor,
        height=top,
        status='ok' if stable else 'unstable',
    )


class _Lost(Exception):
    """Newton's method does not converge near its start."""


def _surface(case: _Case, state: Array) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return inclination, radius and height at the nodes, volume, and residuals of the equations.

    A state (last axis) is the derivative of the inclination over relative arc length at the nodes,
    then the pressure at the plane, the arc length and the filling angle. Leading axes are allowed.
    """
    order = state.shape[-1] - 3
    turning, rest = state[..., :order], state[..., order:]
    pressure, length, beta = (rest[..., i : i + 1] for i in range(3))
    weights, integral = _gauss(order)[1], _cumulative(order).T
    phi = math.pi - case.plane + turning @ integral
    sine, cosine = np.sin(phi), np.cos(phi)
    edge = np.sin(beta)
    radius = edge - length * ((cosine @ weights)[..., None] - cosine @ integral)
    height = length * (sine @ integral)
    volume = math.pi * length * ((radius**2 * sine) @ weights)[..., None] - _cap(beta)
    misfits = [
        turning - length * (pressure - case.bond * height - sine / radius),
        math.pi - case.plane + (turning @ weights)[..., None] - beta - case.theta,
        length * (sine @ weights)[..., None] - case.gap - 2.0 * np.sin(0.5 * beta) ** 2,
        volume - case.volume if case.volume is not None else beta - (case.beta or 0.0),
    ]
    return phi, radius, height, volume[..., 0], np.concatenate(misfits, axis=-1)


def _slopes(case: _Case, state: Array) -> Array:
    """Return the derivatives of the residuals, one row for each number of the state."""
    tiny = 1e-100j  # the complex step has no cancellation
    steps: Array = _surface(case, state + tiny * np.eye(state.size))[4].imag * 1e100
    return steps


def _orientation(case: _Case, state: Array) -> float:
    """Return a sign that changes where bridges of this volume stop being stable."""
    of_volume = dataclasses.replace(case, volume=0.0)
    return float(np.linalg.slogdet(_slopes(of_volume, state))[0])


def _settled(case: _Case, state: Array) -> Array:
    """Return the state in equilibrium near a given one, by Newton's method."""
    begun = _surface(case, state)[0]
    for _ in range(7):
        misfit = _surface(case, state)[4]
        try:
            step = np.linalg.solve(_slopes(case, state).T, misfit)
        except np.linalg.LinAlgError:
            raise _Lost from None
        state = state - step
        phi, radius, *_ = _surface(case, state)
        near = abs(phi - begun).max() < 0.5 and radius.min() > 0.0 and state[-2] > 0.0
        if not near or not 0.0 < state[-1] < math.pi:
            raise _Lost
        small = abs(step[:-3]).max() < 1e-9 and abs(step[-2:]).max() < 1e-9 * state[-2]
        if small:
            return state
    raise _Lost


@functools.lru_cache(maxsize=8)
def _gauss(order: int) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights on the interval from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@functools.lru_cache(maxsize=8)
def _cumulative(order: int) -> Array:
    """Return the matrix that maps values at the nodes to integrals from 0 to each node."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    values = np.polynomial.legendre.legvander(nodes, order)
    # Integral of P_k from -1: (P_{k+1} - P_{k-1}) / (2k + 1).
    k = np.arange(1, order)
    integrals = np.empty((order, order))
    integrals[:, 0] = nodes + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2 * k + 1)
    coefficients = (np.arange(order) + 0.5)[:, None] * values[:, :order].T * weights
    matrix: Array = 0.5 * integrals @ coefficients
    return matrix
