# SPDX-License-Identifier: Apache-2.0
"""Liquid bridge between a sphere and the plane below it.

The meridian has inclination φ and radius r at arc length s, counted upwards from the plane:
``dr/ds = cos φ``, ``dz/ds = sin φ`` and, by Young and Laplace, ``dφ/ds = p/γ - sin φ / r``, where
p is the pressure difference between liquid and air. The meridian starts at
``φ = π - plane angle`` and ends on the sphere at ``φ = filling angle + contact angle``. The weight
of the liquid is left out.

``ζ = r exp(iφ)`` satisfies ``dζ/ds = 1 + i H ζ`` with ``H = p/γ``: a rotation
about ``i/H``. This one formula covers nodoid, unduloid, catenoid, cylinder and sphere (Kenmotsu's
form of Delaunay's surfaces). The axial force is ``2π γ C`` with the first integral
``C = r sin φ - H r²/2``.

Units inside this module: lengths are divided by the sphere's radius, but in `_Shape` by the radius
of the contact line on the sphere. Shapes then form a family with one parameter (``place``) for
each pair of end inclinations.
"""

from __future__ import annotations

import contextlib
import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import number
from ros_pad.contact.pad import Array, Floats
from ros_pad.errors import InvalidInput, NoBridge

# Allowed filling angles, rad. Outside, the liquid hardly touches the sphere, or covers it.
SMALLEST_FILLING, LARGEST_FILLING = 1e-4, math.pi - 1e-3


@dataclass(frozen=True)
class Bridge:
    """A liquid bridge.

    Attributes
    ----------
    force : float
        Axial force of the liquid on sphere and plane, N, attraction positive: surface tension at
        the contact line minus pressure on the wetted cap.
    pressure : float
        Pressure of the liquid minus that of the air, Pa; negative is suction.
    volume : float
        Volume of the liquid, m³.
    neck_radius : float
        Radius of the narrowest section, m; this may be one of the ends.
    filling_angle : float
        Angle at the sphere's centre between the axis and the contact line, rad.
    floor_radius : float
        Radius of the wetted disc on the plane, m.
    height : float
        Height of the contact line on the sphere above the plane, m.
    status : str
        ``ok``, or ``unstable`` where a bridge of this volume would break or jump to another shape.
    """

    force: float
    pressure: float
    volume: float
    neck_radius: float
    filling_angle: float
    floor_radius: float
    height: float
    status: str


def bridge(
    radius: float,
    surface_tension: float,
    contact_angle: float,
    filling_angle: float | None = None,
    volume: float | None = None,
    separation: float = 0.0,
    plane_angle: float | None = None,
) -> Bridge:
    """Compute the exact liquid bridge between a sphere and a plane, without the liquid's weight.

    Parameters
    ----------
    radius : float
        Radius of the sphere, m, above 0.
    surface_tension : float
        Surface tension of the liquid, N/m, above 0.
    contact_angle : float
        Contact angle on the sphere, rad, from 0 to pi.
    filling_angle : float, optional
        Angle at the sphere's centre between the axis and the contact line, rad, from 1e-4 to
        pi - 1e-3.
    volume : float, optional
        Volume of the liquid, m³, above 0. Exactly one of filling angle and volume is required.
        Where two bridges have this volume, the stable one is returned: it has the larger filling
        angle, and its volume grows with the filling angle.
    separation : float
        Shortest distance between sphere and plane, m, from 0.
    plane_angle : float, optional
        Contact angle on the plane, rad, from 0 to pi; by default equal to ``contact_angle``.

    Returns
    -------
    Bridge
        Force, N, pressure, Pa, volume, m³, radii and height, m, and status.

    Raises
    ------
    NoBridge
        When no bridge has this filling angle or volume: the liquid is too little for the
        separation, or covers the sphere. By volume also where a filling angle has two stable
        bridges and only the one with the thinner neck has this volume; that needs different
        contact angles on sphere and plane.
    InvalidInput
        When a value is not finite or out of range, or both or none of filling angle and volume are
        given.

    Notes
    -----
    The meridian is followed as Kenmotsu's form of Delaunay's surfaces; see
    :mod:`ros_pad.contact.bridge`.

    Examples
    --------
    >>> from ros_pad.contact import bridge
    >>> round(1e6 * bridge(1e-3, 0.073, 0.0, filling_angle=0.1).force, 1)  # micronewtons
    899.0
    """
    size = number('radius', radius, 'm', above=True)
    tension = number('surface_tension', surface_tension, 'N/m', above=True)
    if (filling_angle is None) == (volume is None):
        raise InvalidInput(
            f'filling_angle = {filling_angle!r} and volume = {volume!r} are not allowed: exactly'
            ' one of them is needed'
        )
    theta = plane = number('contact_angle', contact_angle, 'rad', high=math.pi)
    if plane_angle is not None:
        plane = number('plane_angle', plane_angle, 'rad', high=math.pi)
    angles, gap = (theta, plane), number('separation', separation, 'm') / size
    if volume is not None:
        beta = _of_volume(angles, gap, number('volume', volume, 'm³', above=True) / size**3)
    else:
        assert filling_angle is not None
        beta = number('filling_angle', filling_angle, 'rad', SMALLEST_FILLING, LARGEST_FILLING)
    place = _of_filling(angles, gap, beta)
    shape = _shapes(place, *_inclinations(angles, beta), 128)
    edge = math.sin(beta)
    heights = edge * (_cumulative(128) @ shape.rise)
    if shape.floor > 1.0:
        heights = edge * shape.height - heights
    held = edge**3 * float(shape.volume) - _cap(beta)
    inside = np.hypot(edge * shape.radius, heights - gap - 1.0) < 1.0 - 1e-7
    if inside.any() or np.min(heights) < -1e-7 or held <= 0.0:
        raise NoBridge(
            f'no bridge exists at separation = {gap:g} radii: its surface would run through the'
            ' sphere or the plane'
        )
    return Bridge(
        force=2.0 * math.pi * edge * float(shape.integral) * tension * size,
        pressure=float(shape.curvature) / edge * tension / size,
        volume=held * size**3,
        neck_radius=edge * float(shape.neck) * size,
        filling_angle=beta,
        floor_radius=edge * float(shape.floor) * size,
        height=(gap + _rise(beta)) * size,
        status='ok' if _stable(angles, beta, place) else 'unstable',
    )


def _cap(beta: Floats) -> Floats:
    """Return the volume of the wetted cap of the sphere."""
    return math.pi / 3.0 * _rise(beta) ** 2 * (2.0 + np.cos(beta))


def _rise(beta: Floats) -> Floats:
    """Return the height of the contact line over the lowest point of the sphere."""
    return 2.0 * np.sin(0.5 * beta) ** 2


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


def _of_volume(angles: tuple[float, float], gap: float, volume: float) -> float:
    """Return the filling angle of the stable bridge of a volume."""
    from scipy.optimize import brentq, minimize_scalar

    def excess(beta: float) -> float:
        """Return by how much the stable bridge has more than the volume; none has no volume."""
        held = 0.0
        with contextlib.suppress(NoBridge):
            place = _of_filling(angles, gap, beta)
            if _stable(angles, beta, place):
                held = float(_gap_and_volume(angles, beta, place)[1])
        return held - volume

    # Filling angles that are dense near both ends of the allowed range.
    low, high = (math.log(b / (math.pi - b)) for b in (SMALLEST_FILLING, LARGEST_FILLING))
    fillings = (math.pi / (1.0 + np.exp(-np.linspace(low, high, 48)))).tolist()
    off = [excess(beta) for beta in fillings]
    # The grid misses the largest volume by a little.
    top = int(np.argmax(off))
    if off[top] < 0.0 < top < 47:
        ends = fillings[top - 1], fillings[top + 1]
        fillings[top] = minimize_scalar(lambda b: -excess(b), bounds=ends, method='bounded').x
        off[top] = excess(fillings[top])
    for k in range(46, -1, -1):
        if off[k] <= 0.0 <= off[k + 1]:
            ends = fillings[k], fillings[k + 1]
            beta = float(brentq(excess, *ends, xtol=1e-300, rtol=1e-15))
            # Where there is no bridge at the lower end, the search may stop at the smallest one.
            if abs(excess(beta)) < 1e-9 * volume:
                return beta
    known = volume + np.array(off)
    why = 'none of any volume spans it'
    if known.any():
        why = f'about {known[known > 0.0].min():.3g} to {known.max():.3g} radius³ are there; with'
        why += ' less liquid it ruptures, with more it covers the sphere'
    raise NoBridge(
        f'no stable bridge has volume = {volume:.6g} radius³ at separation = {gap:g} radii: {why}'
    )


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
