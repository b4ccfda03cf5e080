# SPDX-License-Identifier: Apache-2.0
"""Liquid bridge between a sphere and the plane below it.

A meridian is described by its inclination φ and radius r at arc length s, upwards from the plane:
``dr/ds = cos φ``, ``dz/ds = sin φ`` and, by Young and Laplace, ``dφ/ds = p/γ - sin φ / r`` where
p, less its hydrostatic part, is the pressure of the liquid over that of the air. It starts at
``φ = π - plane angle`` and ends on the sphere at ``φ = filling angle + contact angle``.

Without gravity ``ζ = r exp(iφ)`` obeys ``dζ/ds = 1 + i H ζ`` with ``H = p/γ``: a rotation about
``i/H``, which is every nodoid, unduloid, catenoid, cylinder and sphere in one formula without
cases (Kenmotsu's form of Delaunay's surfaces). The axial force is ``2π γ C`` with the first
integral ``C = r sin φ - H r²/2``.

Inside this module lengths are in units of the sphere's radius, those of the shapes without
gravity in units of the radius of the contact line on the sphere, which makes them a family of
one parameter for each pair of end inclinations.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array
from ros_pad.contact.pad import Floats
from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoBridge

# Filling angles beyond these, rad, are a liquid that hardly touches the sphere, or drowns it.
SMALLEST_FILLING, LARGEST_FILLING = 1e-4, math.pi - 1e-3


@dataclass(frozen=True)
class Bridge:
    """A liquid bridge. Floats for scalar input, arrays (circle only) otherwise.

    Attributes
    ----------
    force : N, axial force of the liquid on the sphere, attraction positive: the pull of the
        surface at the contact line less the pressure on the wetted cap. With gravity the plane is
        pulled with this force less the liquid's weight.
    pressure : Pa, of the liquid over that of the air, at the plane; negative is suction. Without
        gravity it is the same everywhere.
    volume : m³ of liquid.
    neck_radius : m, of the narrowest section, which may be one of the ends.
    filling_angle : rad, between the axis and the contact line, seen from the sphere's centre.
    floor_radius : m, of the wetted disc on the plane.
    height : m, of the contact line on the sphere above the plane.
    status : ``ok``; ``unstable`` where a bridge of this volume would snap or slip to another
        shape; in arrays ``no_bridge``, the numbers are then NaN.
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
    """Return the liquid bridge between a sphere and a plane.

    Parameters
    ----------
    radius : float
        Of the sphere, m, above 0.
    surface_tension : float
        N/m, above 0.
    contact_angle : float
        On the sphere, rad, from 0 to pi.
    filling_angle : float, optional
        Half angle, at the sphere's centre, of the wetted cap, rad, from 1e-4 to pi - 1e-3.
    volume : float, optional
        Of the liquid, m³, above 0. Exactly one of filling angle and volume is given. Where a
        volume has two bridges the stable one is returned: that with the larger filling angle,
        whose volume grows with it.
    separation : float
        Least distance between sphere and plane, m, from 0.
    method : {'circle', 'young_laplace'}
        With a circular arc for a meridian (the toroidal approximation), whose pressure and force
        are those of its narrowest section, or exact. The circle is 1 % off in the median, above
        10 % where a bridge is wide, flat or near rupture. It takes arrays for angles and
        separation, with a filling angle; all else is for scalars.
    gravity : float
        m/s², from 0, towards the plane. Above 0 for ``young_laplace`` alone.
    density : float
        Of the liquid, kg/m³, above 0.
    plane_angle : float, optional
        Contact angle on the plane, rad, from 0 to pi; by default that on the sphere.

    Raises
    ------
    NoBridge
        When no bridge has this filling angle, or this volume: too little liquid for the
        separation, or so much that it drowns the sphere.
    InvalidInput
        For values that are not finite or not in range, or an unknown method.

    Examples
    --------
    >>> round(1e6 * bridge(1e-3, 0.073, 0.0, filling_angle=0.1, method='young_laplace').force, 1)
    899.0
    """
    size = number('radius', radius, 'm', above=True)
    tension = number('surface_tension', surface_tension, 'N/m', above=True)
    weight = number('density', density, 'kg/m³', above=True) * number('gravity', gravity, 'm/s²')
    choice('method', method, ('young_laplace', 'circle'))
    if (filling_angle is None) == (volume is None):
        raise InvalidInput('exactly one of filling_angle and volume is needed')
    if plane_angle is None:
        plane_angle = contact_angle
    if method == 'circle' and weight > 0.0:
        raise InvalidInput(
            f"gravity = {gravity:g} m/s² is not allowed with method 'circle', which has none: "
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
    """Return the toroidal bridge in units of sphere radius and surface tension."""
    if volume is not None:
        turns = _fillings(400)
        turns = np.sort(np.append(turns, _least_arc(theta, plane, gap, turns)))
        curve = _arc(theta, plane, gap, turns).volume
        cells, least, most = _growing(curve, volume)
        k = next((k for k in cells[::2] if curve[k] <= volume <= curve[k + 1]), None)
        if k is None:
            raise NoBridge(_no_volume(volume, least, most))
        from scipy.optimize import brentq

        beta = brentq(
            lambda angle: _arc(theta, plane, gap, angle).volume - volume, turns[k], turns[k + 1]
        )
    try:
        found = _arc(theta, plane, gap, beta)
    except ValueError as error:
        raise InvalidInput('angles and separation do not broadcast') from error
    if np.ndim(found.force) == 0 and not math.isfinite(found.force):
        raise NoBridge(
            f'no circle joins the plane to the sphere at filling_angle = {beta:g} rad with a neck'
            ' of positive radius'
        )
    return found


def _least_arc(theta: Array, plane: Array, gap: Array, turns: Array) -> float:
    """Return the least filling angle whose arc has a neck: there bridges of a circle end."""
    there = np.isfinite(_arc(theta, plane, gap, turns).neck_radius)
    lost = np.flatnonzero(~there[:-1] & there[1:])
    if not lost.size:
        return float(turns[0])
    low, high = turns[lost[-1]], turns[lost[-1] + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        reached = math.isfinite(_arc(theta, plane, gap, middle).neck_radius)
        low, high = (low, middle) if reached else (middle, high)
    return float(high)


def _arc(theta: Array, plane: Array, gap: Array, beta: Floats) -> Bridge:
    """Return the circular arc at a filling angle; NaN where there is none.

    Everything is written in the arc's length and turning, which stay finite where the arc is
    flat (plane angle, contact angle and filling angle together pi).
    """
    start, end = math.pi - plane, beta + theta
    turn = end - start
    edge, height = np.sin(beta), gap + 2.0 * np.sin(0.5 * beta) ** 2
    rise = np.sin(0.5 * (start + end)) * np.sinc(turn / (2.0 * math.pi))
    length = height / np.where(rise > 0.0, rise, np.nan)

    def reach(share: Floats) -> Floats:
        """Radius at a share of the arc, from the plane."""
        rest = 0.5 * (1.0 - share) * turn
        return edge - length * (1.0 - share) * np.cos(end - rest) * np.sinc(rest / math.pi)

    # Narrowest is an end, or where the arc stands upright.
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
    neck = np.where(volume > 0.0, neck, np.nan)  # else the arc runs through the sphere
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
    radius: Array  # at the nodes of the quadrature, from the narrower end, along the last axis
    rise: Array  # rate of the height there, per unit of the quadrature's variable


# Places along a family, see _shapes.
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
    """Return the exact bridge in units of sphere radius and surface tension."""
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
    """Return filling angle and place, along its family, of a bridge without gravity."""
    if beta is not None:
        return beta, _place_of_filling(theta, plane, gap, beta)
    assert volume is not None
    return _place_of_volume(theta, plane, gap, volume)


def _inclinations(theta: float, plane: float, beta: Floats) -> tuple[Floats, Floats]:
    """Return the inclinations of the meridian at the plane and on the sphere."""
    start, end = math.pi - plane, beta + theta
    # The cylinder is the one shape whose length its ends do not tell: take a cone beside it.
    cylinder = np.maximum(abs(np.cos(start)), abs(np.cos(end))) < 1e-7
    upright = 0.5 * math.pi + 1e-7
    return np.where(cylinder, upright, start), np.where(cylinder, upright, end)


@np.errstate(divide='ignore', invalid='ignore')  # necks and floors of 0, which are no bridges
def _shapes(place: Floats, start: Floats, end: Floats, order: int) -> _Shape:
    """Return meridians of the family with these end inclinations.

    With x = floor radius - 1 and y = H (1 + x/2) - sin start the first integral at both ends
    reads ``x y = sin start - sin end``. The branch of this hyperbola that begins with the short
    circular arc (place -> -inf, where H -> ±inf and x -> 0) is followed by ``q = |x| - |y|``,
    which passes round its corner smoothly even where the right side is 0. The height grows from 0
    along it until the neck is too thin.
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
    # Angle of the rotation about i/H from the plane to the sphere, between the spokes H ζ - i.
    # Written in x and the turning, it is 0 where both are, however the sines are rounded.
    below, above = h * floor * sine - 1.0, h * np.sin(end) - 1.0
    half = 0.5 * (end - start)
    turning = h * floor * np.cos(half) - np.sin(0.5 * (start + end))
    cross = 2.0 * np.sin(half) * turning - x * np.cos(start)
    tau = np.arctan2(h * cross, h * h * floor * np.cos(start) * np.cos(end) + below * above)
    tau = np.where(tau * h < 0.0, tau + 2.0 * math.pi * np.sign(h), tau)
    length = tau / h
    integral = floor * (sine - 0.5 * h * floor)

    # Distance, along the arc from its narrower end, of the narrowest place of the whole curve:
    # there the spoke H ζ - i points down.
    outward = floor > 1.0
    radius, slope = np.where(outward, 1.0, floor), np.where(outward, end, start)
    spoke = np.arctan2(h * radius * np.cos(slope), np.where(outward, -above, -below))
    waist_at = np.where(outward, spoke, -spoke) / h
    period = 2.0 * math.pi / abs(h)
    other = waist_at - np.copysign(period, waist_at)
    closer = _outside(other, length) < _outside(waist_at, length)
    waist_at = np.where(closer, other, waist_at)
    swing = np.sqrt(np.maximum(1.0 - 2.0 * h * integral, 0.0))
    waist = 2.0 * abs(integral) / (1.0 + swing)
    neck = np.where(_outside(waist_at, length) > 0.0, radius, waist)

    # The integrands have poles beside the narrowest place, so the nodes are close there.
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
    # Past the sphere, where the neck has closed, the arc winds the other way.
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


def _outside(place: Floats, length: Floats) -> Floats:
    """Return how far a place is from the stretch from 0 to a length."""
    return np.maximum(np.maximum(-place, place - length), 0.0)


def _spokes(radius: Floats, slope: Floats, curvature: Floats, s: Floats) -> Floats:
    """Return ``ζ = r exp(iφ)`` an arc length s on: the solution of ``dζ/ds = 1 + i H ζ``."""
    a = curvature * s
    turned = radius * np.exp(1j * (slope + a))
    return turned + s * np.exp(0.5j * a) * np.sinc(a / (2.0 * math.pi))


def _heights(place: Floats, theta: float, plane: float, beta: Floats, order: int) -> Floats:
    start, end = _inclinations(theta, plane, beta)
    return _shapes(place, start, end, order).height


def _place_of_filling(theta: float, plane: float, gap: float, beta: float) -> float:
    """Return the place of the first meridian, of growing height, that spans the gap."""
    from scipy.optimize import brentq
    from scipy.optimize import minimize_scalar

    aim = (gap + 2.0 * math.sin(0.5 * beta) ** 2) / math.sin(beta)
    heights = _heights(_PLACES, theta, plane, beta, 96)
    heights = heights[: int(np.argmin(np.append(np.isfinite(heights), False)))]

    def lack(place: float) -> float:
        return aim - float(_heights(place, theta, plane, beta, 96))

    low = high = None
    inner = heights[1:-1]
    peaks = 1 + np.flatnonzero((inner > heights[:-2]) & (inner >= heights[2:]))
    for peak in peaks[heights[peaks] > 0.7 * aim]:  # the grid may just miss the top of a hump
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
            f' angles {theta:g} and {plane:g} rad: it has ruptured'
        )
    return float(brentq(lack, low, high, xtol=1e-14, rtol=1e-15))


def _stable_place(theta: float, plane: float, beta: float, place: float) -> bool:
    """Return whether more volume makes a larger separation possible, near a bridge.

    That is the sign of the determinant of separation and volume over filling angle and place. It
    changes where, with the volume fixed, the separation is largest: there the bridge snaps.
    """
    step = 1e-5
    changes = np.array([-step, step])
    edge = min(beta, math.pi - beta)
    at_place = _gap_and_volume(theta, plane, beta, place + changes)
    at_beta = _gap_and_volume(theta, plane, beta + edge * changes, place)
    (gap_p, volume_p), (gap_b, volume_b) = np.diff(at_place)[:, 0], np.diff(at_beta)[:, 0]
    return bool(gap_p * volume_b > gap_b * volume_p)


def _stable_filling(theta: float, plane: float, gap: float, beta: float) -> bool:
    """Return whether the volume grows with the filling angle, at this separation."""
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

    At a fixed separation the bridges are a curve: from large volumes down to the least one,
    where it snaps, and on to thinner necks. Filling angles are scanned for it, the crossing is
    polished on both unknowns, because the curve may turn back in the filling angle.
    """
    from scipy.optimize import brentq
    from scipy.optimize import root

    turns = _fillings(96)
    first, second = _scan(theta, plane, gap, turns)
    first, second = (np.vstack([found, turns]) for found in (first, second))
    # Between two rows the first bridges may end, the curve turning back into the second ones, or
    # their place may leap, perhaps past the least volume.
    before, after = first[0, :-1], first[0, 1:]
    pieces, end = [], turns.size
    for k in np.flatnonzero(np.isfinite(after) & ~(before - after < 3.0))[::-1]:
        stop = np.nan_to_num(np.fmin(second[0, k + 1], before[k]), nan=60.0)
        between = np.linspace(after[k], stop, 81)[1:]
        turn = _turn(theta, plane, gap, turns[k : k + 2], between)
        pieces += [first[:, k + 1 : end], turn[:, ::-1]]
        end = k + 1
        if np.isfinite(second[0, k + 1]) or np.isnan(before[k]):
            pieces.append(second[:, k + 1 :][:, ::-1])
            break
    else:
        pieces.append(first[:, :end])
    curve = np.concatenate(pieces[::-1], axis=1)
    places, volumes, angles = curve[:, np.isfinite(curve[0])]
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

    # Next to a cylinder places change too fast for that: solve for them, filling angles apart.
    def excess(beta: float) -> float:
        place = _place_of_filling(theta, plane, gap, beta)
        return float(_gap_and_volume(theta, plane, beta, place)[1]) - volume

    for k in guesses[::2]:
        low, high = angles[k], angles[k + 1]
        with contextlib.suppress(NoBridge):
            if low < high and excess(low) <= 0.0 <= excess(high):
                beta = float(brentq(excess, low, high, rtol=1e-14))
                return beta, _place_of_filling(theta, plane, gap, beta)
    raise NoBridge(_no_volume(volume, least, most))


def _scan(theta: float, plane: float, gap: float, turns: Array) -> Array:
    """Return place and volume of the first and the second bridge of each filling angle.

    Shape: which bridge, which of the two, filling angle. NaN where there is none.
    """
    aims = (gap + 2.0 * np.sin(0.5 * turns) ** 2) / np.sin(turns)
    coarse = _PLACES[_PLACES < 60.0]  # beyond, plane discs of 1e13 radii
    ends = np.full((2, 2, turns.size), np.nan)  # of the cell in which the aim is crossed
    for row, beta in enumerate(turns):
        heights = _heights(coarse, theta, plane, beta, 48)
        heights = heights[: int(np.argmin(np.append(np.isfinite(heights), False)))]
        reached = heights >= aims[row]
        for which, k in enumerate(np.flatnonzero(reached[:-1] != reached[1:])[:2]):
            ends[which, :, row] = coarse[k], coarse[k + 1]
    low, high = np.nan_to_num(ends[:, 0]), np.nan_to_num(ends[:, 1])
    for _ in range(12):
        middle = 0.5 * (low + high)
        reached = _heights(middle, theta, plane, turns, 48) >= aims
        reached[1] = ~reached[1]
        low, high = np.where(reached, low, middle), np.where(reached, middle, high)
    places = 0.5 * (low + high)
    found = np.stack([places, _gap_and_volume(theta, plane, turns, places)[1]], axis=1)
    return np.where(np.isfinite(ends), found, np.nan)


def _turn(theta: float, plane: float, gap: float, ends: Array, places: Array) -> Array:
    """Return place, volume and filling angle of bridges between two filling angles.

    At the first of them there is no bridge, at the second the places begin past one; returned are
    the places up to where the next is.
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
    """Return filling angles, dense in proportion at both ends."""
    low, high = (math.log(b / (math.pi - b)) for b in (SMALLEST_FILLING, LARGEST_FILLING))
    return math.pi / (1.0 + np.exp(-np.linspace(low, high, count)))


def _growing(volumes: Array, volume: float) -> tuple[list[int], float, float]:
    """Return where, along bridges of one separation, a volume is reached while it grows.

    The places, best first, include ends of growth that just miss the volume; with them come the
    least and the largest volume reached.
    """
    lower, upper = volumes[:-1], volumes[1:]
    grows = upper > lower
    if not grows.any():
        raise NoBridge('no stable bridge spans this separation, whatever its volume')
    cells = np.flatnonzero(grows & (0.98 * lower <= volume) & (volume <= 1.02 * upper))
    exact = (lower[cells] <= volume) & (volume <= upper[cells])
    cells = cells[np.lexsort((-cells, ~exact))][:6]
    guesses = np.stack([cells, cells + 1], axis=1).ravel().tolist()
    return guesses, float(lower[grows].min()), float(upper[grows].max())


def _no_volume(volume: float, least: float, most: float) -> str:
    if volume > most:
        why = f'at most {most:.6g}: more drowns the sphere'
    elif volume < least:
        why = f'at least {least:.6g}: with less the bridge has ruptured'
    else:
        why = 'more: with this the bridge has ruptured'
    return f'no stable bridge has the volume {volume:.6g} cubed radii: it takes {why}'


def _cap(beta: Floats) -> Floats:
    """Return the volume of the wetted cap of the sphere."""
    return math.pi / 3.0 * (2.0 * np.sin(0.5 * beta) ** 2) ** 2 * (2.0 + np.cos(beta))


def _clear_of_solids(radii: Array, heights: Array, gap: float, volume: float) -> None:
    """Refuse a meridian that runs through the plane or the sphere."""
    inside = np.hypot(radii, heights - gap - 1.0) < 1.0 - 1e-7
    if inside.any() or np.min(heights) < -1e-7 or volume <= 0.0:
        raise NoBridge('no bridge is free there: its surface would run through sphere or plane')


# --- Gravity --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Case:
    """What is asked of a heavy bridge, in units of sphere radius and surface tension."""

    theta: float
    plane: float
    beta: float | None
    volume: float | None
    gap: float
    bond: float  # density gravity radius² / tension: its weight


def _heavy(case: _Case) -> Bridge:
    """Return the bridge with gravity, followed from one without.

    Where this one is none without gravity, the way leads over the touching sphere, or over the
    volume that a middling filling angle has.
    """
    ways = [[dataclasses.replace(case, bond=0.0), case]]
    if case.gap > 0.0:
        touching = dataclasses.replace(case, gap=0.0)
        ways.append([dataclasses.replace(touching, bond=0.0), touching, case])
    if case.volume is not None:
        with contextlib.suppress(NoBridge):
            middling = _young_laplace(case.theta, case.plane, case.gap, 1.0, None, 0.0)
            if middling.volume > 0.0:
                other = dataclasses.replace(case, volume=middling.volume)
                ways.append([dataclasses.replace(other, bond=0.0), other, case])
    refusals = []
    for way in ways:
        try:
            return _followed(way)
        except NoBridge as refusal:
            refusals.append(refusal)
    raise refusals[0]


def _followed(way: list[_Case]) -> Bridge:
    for order in (64, 192):
        with contextlib.suppress(_Coarse):
            return _at_order(way, order)
    raise InvalidInput(
        'this bridge is not allowed: its surface is too wide, or its neck too narrow, for the'
        ' nodes that there are'
    )


class _Coarse(Exception):
    """The nodes are too few for a surface."""


def _at_order(way: list[_Case], order: int) -> Bridge:
    first, case = way[0], way[-1]
    try:
        beta, place = _found_place(first.theta, first.plane, first.gap, first.beta, first.volume)
    except NoBridge as refusal:
        raise NoBridge(f'{refusal} (without gravity; none was found with it, either)') from None
    start, end = _inclinations(first.theta, first.plane, beta)
    shape = _shapes(place, start, end, 128)
    nodes, weights = _gauss(order)
    zeta = _spokes(1.0, end, shape.curvature, (nodes - 1.0) * shape.length)
    turning = shape.length * (0.5 * shape.curvature - shape.integral / abs(zeta) ** 2)
    edge = math.sin(beta)
    state = np.append(turning, [shape.curvature / edge, shape.length * edge, beta])
    stable = bool(first.volume) or _stable_filling(first.theta, first.plane, first.gap, beta)

    state = _settled(first, state)
    sign = _orientation(first, state)
    for old, new in itertools.pairwise(way):
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
                        'no bridge of this size carries its weight: as density gravity radius² /'
                        f' tension grows to {case.bond:.3g} it tears at {between.bond:.3g}'
                    ) from None
                continue
            done, step = ahead, 2.0 * step

    series = np.polynomial.legendre.legfit(2.0 * nodes - 1.0, state[:order], order - 1)
    if np.max(abs(series[-4:])) > 1e-8 * np.max(abs(series)):
        raise _Coarse
    _, radius, height, volume, _ = _surface(case, state)
    _clear_of_solids(radius, height, case.gap, float(volume))
    pressure, length, beta = state[-3:]
    edge, top = math.sin(beta), case.gap + 2.0 * math.sin(0.5 * beta) ** 2
    floor = edge - length * float(np.cos(_surface(case, state)[0]) @ weights)
    series = np.polynomial.legendre.legfit(2.0 * nodes - 1.0, radius, order - 1)
    radii = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 4001), series)
    k = int(np.clip(np.argmin(radii), 1, 3999))
    # The lowest point of the parabola through three, or an end.
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
        status='ok' if stable == (sign == _orientation(case, state)) else 'unstable',
    )


class _Lost(Exception):
    """Newton does not settle near where it started."""


def _surface(case: _Case, state: Array) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return inclination, radius and height at the nodes, volume, and the equations' misfits.

    A state is the turning rate at the nodes, per unit of relative arc length, then the pressure
    at the plane, the arc's length and the filling angle; any leading axes are many states.
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
    """Return the derivatives of the misfits, a row for each number of the state."""
    tiny = 1e-100j  # a complex step has no cancellation
    steps: Array = _surface(case, state + tiny * np.eye(state.size))[4].imag * 1e100
    return steps


def _orientation(case: _Case, state: Array) -> float:
    """Return the sign that changes where bridges of this volume cease."""
    of_volume = dataclasses.replace(case, volume=0.0)
    return float(np.linalg.slogdet(_slopes(of_volume, state))[0])


def _settled(case: _Case, state: Array) -> Array:
    """Return the state in equilibrium near a given one, by Newton."""
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
    """Return Gauss' nodes and weights on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@functools.lru_cache(maxsize=8)
def _cumulative(order: int) -> Array:
    """Return the matrix that takes values at the nodes to integrals from 0 to the nodes."""
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
