# SPDX-License-Identifier: Apache-2.0
"""Liquid that rises round a pad from a wide bath at floor level: the exact axisymmetric meniscus.

Far away the surface is flat, at the level of the floor, and its pressure is that of the air; at
height z above the floor it is ``-ρ g z``. The surface of such a bath outside a circle is one
curve for each radius and slope (:func:`ros_pad.contact.fibre.outer_surface`), so that the only
unknown is where on the wall it stands as high as the wall, at the contact angle.

With wall inclination φ (from the floor, through the air, π/2 for a cylinder) the surface falls
outwards from the contact line at ``ψ = π - φ - θ``. Two integrals need no quadrature of the
surface: by Young and Laplace ``∫ z 2π r dr = 2π ℓ² r sin ψ`` under it, with capillary length ℓ,
and by Archimedes the pull on the pad is the weight of the liquid that it raises.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.contact.fibre import outer_surface
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoSurface

# No surface of a bath is higher than this, in capillary lengths.
HIGHEST = 2.0
# Relative errors of heights while searching, and at the end.
COARSE, FINE = 1e-6, 1e-11
POINTS = 400  # of a surface


@dataclass(frozen=True)
class Wall:
    """The wall of a pad that is round about a vertical axis and stands on the floor.

    Parameters
    ----------
    meridian : callable
        From a place to radius (m), height over the floor (m) and inclination (rad, above 0 and
        below pi; below pi/2 the wall leans outwards). The height grows with the place.
    floor : float
        The place at floor level.
    top : float
        The place where the wall ends above, over ``floor``.
    bottom : float
        The place where it ends below: below ``floor`` if the pad dips into the bath.
    steps : int
        In how many steps the wall is searched for where the liquid stands.
    """

    meridian: Callable[[float], tuple[float, float, float]]
    floor: float
    top: float
    bottom: float
    steps: int = 8

    @classmethod
    def dome(cls, sphere_radius: float, contact_radius: float, height: float = math.inf) -> Wall:
        """Return a spherical dome that rests on a disc.

        Parameters
        ----------
        sphere_radius : float
            m, above 0.
        contact_radius : float
            Of the disc, m, above 0, below that of the sphere.
        height : float
            At which the dome ends, m; by default where the sphere ends.
        """
        size = number('sphere_radius', sphere_radius, 'm', above=True)
        rest = number('contact_radius', contact_radius, 'm', high=size, above=True)
        start = math.asin(rest / size)
        if start > 0.5 * math.pi - 1e-9:
            raise InvalidInput(
                f'contact_radius = {rest:g} m is not allowed: above 0 and below the sphere_radius,'
                f' {size:g} m, is needed'
            )
        end = math.pi - 1e-6
        if height != math.inf:
            most = size * (1.0 + math.cos(start))
            end = math.acos(
                math.cos(start) - number('height', height, 'm', 0.0, most, True) / size
            )

        def meridian(phi: float) -> tuple[float, float, float]:
            rise = 2.0 * math.sin(0.5 * (phi + start)) * math.sin(0.5 * (phi - start))
            return size * math.sin(phi), size * rise, phi

        return cls(meridian, start, end, start)

    @classmethod
    def cone(
        cls,
        contact_radius: float,
        inclination: float,
        height: float = math.inf,
        depth: float = 0.0,
    ) -> Wall:
        """Return a truncated cone; with an inclination of pi/2 a cylinder.

        Parameters
        ----------
        contact_radius : float
            At floor level, m, above 0.
        inclination : float
            Of the wall to the floor, through the air, rad, from 0.01 to pi - 0.01.
        height, depth : float
            How far the wall reaches above and below floor level, m.
        """
        rest = number('contact_radius', contact_radius, 'm', above=True)
        phi = number('inclination', inclination, 'rad', 0.01, math.pi - 0.01)
        lean = math.cos(phi) / math.sin(phi)
        up, down = math.inf, math.inf
        if height != math.inf:
            up = number('height', height, 'm', above=True)
        if depth != math.inf:
            down = number('depth', depth, 'm')
        tip = (1.0 - 1e-6) * rest / abs(lean) if lean else math.inf
        up, down = (min(up, tip), down) if lean < 0 else (up, min(down, tip))
        return cls(lambda z: (rest + lean * z, z, phi), 0.0, up, -down)

    @classmethod
    def cylinder(cls, radius: float, height: float = math.inf, depth: float = math.inf) -> Wall:
        """Return a cylinder, which by default dips into the bath as a fibre does."""
        return cls.cone(radius, 0.5 * math.pi, height, depth)

    @classmethod
    def through(cls, radii: npt.ArrayLike, heights: npt.ArrayLike) -> Wall:
        """Return a wall through points.

        Parameters
        ----------
        radii : array, shape (n,)
            m, above 0; n from 2.
        heights : array, shape (n,)
            m, growing, from 0 or below to above 0. Between the points the radius follows
            Akima's spline, which does not overshoot.
        """
        r, z = quantity('radii', radii, 'm', above=True), np.asarray(heights, dtype=float)
        if r.ndim != 1 or r.shape != z.shape or r.size < 2:
            raise InvalidInput(
                f'radii of shape {np.shape(r)} and heights of shape {z.shape} are not allowed: two'
                ' rows of the same length, at least 2, are needed'
            )
        if not (np.isfinite(z).all() and (np.diff(z) > 0.0).all() and z[0] <= 0.0 < z[-1]):
            raise InvalidInput('heights are not allowed: from 0 or below they must grow, m')
        from scipy.interpolate import Akima1DInterpolator

        curve = Akima1DInterpolator(z, r)
        slope = curve.derivative()

        def meridian(height: float) -> tuple[float, float, float]:
            return float(curve(height)), height, math.atan2(1.0, float(slope(height)))

        return cls(meridian, 0.0, float(z[-1]), float(z[0]), steps=32)


@dataclass(frozen=True)
class BathMeniscus:
    """Liquid round a pad, and what it does to the pad.

    Attributes
    ----------
    height : m, of the contact line over the floor; negative where the liquid is pushed down.
    radius : m, of the contact line.
    slope : rad, by which the surface falls outwards there; above pi/2 it leads inwards first.
    pressure : Pa, of the liquid over that of the air at the contact line: ``-ρ g height``.
    force : N, vertical, of the liquid on the pad, towards the floor positive: the pull of the
        surface and the suction on the wall. It is the weight of the raised liquid.
    volume : m³ of liquid above floor level, less what is missing below it.
    radii, heights : m, shape (n,): the surface from the contact line outwards, to where its slope
        is a millionth of that here.
    status : ``ok``; ``several`` where the wall has other equilibria higher up (returned is the
        one reached by rising from the floor); ``rim`` where the liquid reaches the end of the
        wall and is held by its edge; ``dry`` where it is pushed below a wall that ends at the
        floor: all numbers are then 0, and the radius that of the floor.
    """

    height: float
    radius: float
    slope: float
    pressure: float
    force: float
    volume: float
    radii: Array
    heights: Array
    status: str


def bath_meniscus(
    sphere_radius: float | None = None,
    contact_radius: float | None = None,
    *,
    liquid: Liquid,
    wall: Wall | None = None,
    gravity: float = GRAVITY,
) -> BathMeniscus:
    """Return the meniscus of a wide bath at floor level round a pad.

    Parameters
    ----------
    sphere_radius, contact_radius : float
        Of a dome and of the disc on which it rests, m.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    wall : Wall
        Of any other pad, in place of the two radii.
    gravity : float
        m/s², above 0: without it no bath is flat far away.

    Raises
    ------
    InvalidInput
        For values that are not finite or not in range, or both a dome and a wall.
    NoSurface
        With status ``blocked``, where the surface would run through the wall.

    Examples
    --------
    >>> from ros_pad.contact import WATER
    >>> round(1e3 * bath_meniscus(1.55e-3, 0.583e-3, liquid=WATER).height, 3)
    1.128
    """
    if not isinstance(liquid, Liquid):
        raise InvalidInput(f'liquid = {liquid!r} is not allowed: a Liquid is needed')
    if (wall is None) != (sphere_radius is not None and contact_radius is not None):
        raise InvalidInput('either sphere_radius and contact_radius or a wall is needed')
    if wall is None:
        assert sphere_radius is not None and contact_radius is not None
        wall = Wall.dome(sphere_radius, contact_radius)
    weight = liquid.density * number('gravity', gravity, 'm/s²', above=True)
    length = math.sqrt(liquid.surface_tension / weight)
    place, slope, status = contact(wall, liquid.angle, length)
    radius, height, _ = wall.meridian(place)
    if status == 'dry' or slope == 0.0:
        line = np.array([radius]), np.array([height])
        return BathMeniscus(0.0, radius, 0.0, 0.0, 0.0, 0.0, *line, status)
    _, radii, heights = length * _surface(radius / length, slope, FINE, POINTS)[:, ::-1]
    _clear_of(wall, place, radii, heights)
    volume = (
        math.pi * radius**2 * height
        + 2.0 * math.pi * length**2 * radius * math.sin(slope)
        - solid_volume(wall, place)
    )
    return BathMeniscus(
        height,
        radius,
        slope,
        -weight * height,
        weight * volume,
        volume,
        radii,
        heights,
        status,
    )


def contact(wall: Wall, angle: float, length: float) -> tuple[float, float, str]:
    """Return where the surface meets a wall: place, slope there, and status.

    Parameters
    ----------
    wall : Wall
        Of the pad.
    angle : float
        Contact angle, rad.
    length : float
        Capillary length, m.

    Notes
    -----
    On the way from the floor the surface that would meet the wall here at the contact angle is
    first higher than here; the equilibrium is where this ends.
    """

    def slope(place: float) -> float:
        return math.pi - wall.meridian(place)[2] - angle

    start = slope(wall.floor)

    def excess(place: float, tolerance: float) -> float:
        if place == wall.floor:  # the sign is that of the slope, which may be near pi here
            return start
        radius, height, _ = wall.meridian(place)
        return bath_height(radius / length, slope(place), tolerance) - height / length

    if abs(start) < 1e-12:
        return wall.floor, 0.0, 'ok'
    end = wall.top if start > 0.0 else wall.bottom
    if end == wall.floor:
        return wall.floor, 0.0, 'dry'
    end = _reach(wall, end, length)
    # Closer near the floor, where a wedge holds its liquid.
    places = wall.floor + (end - wall.floor) * (np.arange(1, wall.steps + 1) / wall.steps) ** 2
    signs = [math.copysign(1.0, start)]
    signs += [math.copysign(1.0, excess(float(place), COARSE)) for place in places]
    turns = np.flatnonzero(np.diff(signs))
    if not turns.size:
        return end, _held(wall, end, length, slope(end)), 'rim'
    from scipy.optimize import brentq
    from scipy.optimize import newton

    first = int(turns[0])
    low, high = places[first - 1] if first else wall.floor, places[first]
    step = abs(high - low)
    near = brentq(excess, low, high, args=(COARSE,), xtol=1e-5 * step)
    place = float(newton(excess, near, x1=near + 1e-5 * step, args=(FINE,), tol=1e-12 * step))
    return place, slope(place), 'ok' if turns.size == 1 else 'several'


def solid_volume(wall: Wall, place: float) -> float:
    """Return the volume of the pad between floor level and a place, m³; negative below."""
    legendre = np.polynomial.legendre
    nodes, weights = legendre.leggauss(16)
    edges = np.linspace(wall.floor, place, 17)
    total = 0.0
    for low, high in itertools.pairwise(edges):
        at = 0.5 * (low + high + nodes * (high - low))
        radii, heights, _ = np.transpose([wall.meridian(float(p)) for p in at])
        rise = legendre.legval(nodes, legendre.legder(legendre.legfit(nodes, heights, 15)))
        total += math.pi * float((radii**2 * rise) @ weights)
    return total


def bath_height(radius: float, slope: float, tolerance: float = FINE) -> float:
    """Return the height of the surface at a radius and slope, in capillary lengths."""
    return float(_surface(radius, slope, tolerance)[2, -1]) if slope else 0.0


def _surface(radius: float, slope: float, tolerance: float, points: int = 2) -> Array:
    """Return slope, radius and height of the surface, inwards; below the bath it is mirrored."""
    if slope > 0.0:
        return outer_surface(radius, slope, tolerance, points)
    return outer_surface(radius, -slope, tolerance, points) * np.array([[-1.0], [1.0], [-1.0]])


def _reach(wall: Wall, end: float, length: float) -> float:
    """Return the end of a wall, or the place higher than any surface."""
    sign = math.copysign(1.0, end - wall.floor)
    if math.isinf(end):
        end = wall.floor + sign * HIGHEST * length
    if abs(wall.meridian(end)[1]) <= HIGHEST * length:
        return end
    from scipy.optimize import brentq

    return float(brentq(lambda p: sign * wall.meridian(p)[1] - HIGHEST * length, wall.floor, end))


def _held(wall: Wall, end: float, length: float, most: float) -> float:
    """Return the slope at which an edge holds the surface."""
    from scipy.optimize import brentq

    radius, height, _ = wall.meridian(end)
    return float(
        brentq(
            lambda slope: bath_height(radius / length, slope, FINE) - height / length,
            1e-9 * most,
            most,
            xtol=1e-12,
        )
    )


def _clear_of(wall: Wall, place: float, radii: Array, heights: Array) -> None:
    """Refuse a surface that runs through the wall."""
    places = np.linspace(wall.floor, place, POINTS)
    wall_radii, wall_heights, _ = np.transpose([wall.meridian(float(p)) for p in places])
    side = -math.copysign(1.0, heights[0])
    inside = wall_radii - np.interp(side * wall_heights, side * heights, radii)
    if np.max(inside) > 1e-3 * radii[0]:
        raise NoSurface(
            f'the surface that reaches {heights[0]:g} m at the contact angle would run through the'
            ' wall below: something there juts out that is thinner than the steps of the search',
            'blocked',
        )
