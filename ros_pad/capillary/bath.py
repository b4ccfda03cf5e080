# SPDX-License-Identifier: Apache-2.0
"""Exact axisymmetric meniscus around a pad in a wide bath at floor level.

Far away the surface is flat, at floor level, where the liquid has the pressure of the air; at
height z above the floor its pressure relative to the air is ``-ρ g z``. The surface outside a
circle is one curve for each radius and slope (:func:`outer_surface`). So the
only unknown is the place on the wall at which a surface with the contact angle has the height of
this place.

With wall inclination φ (from the floor, through the air, π/2 for a cylinder) the surface falls
outwards from the contact line at ``ψ = π - φ - θ``. Two integrals are known in closed form: by
Young and Laplace ``∫ z 2π r dr = 2π ℓ² r sin ψ`` under the surface, with capillary length ℓ; by
Archimedes the force on the pad is the weight of the raised liquid.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import instance, number, quantity
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, NoSurface

# Upper bound of the height of a bath's surface, in capillary lengths.
HIGHEST = 2.0
# Relative errors of heights during the search, and of the result.
COARSE, FINE = 1e-6, 1e-11
POINTS = 400  # number of points of a surface


@dataclass(frozen=True)
class Wall:
    """The wall of an axisymmetric pad that stands on the floor.

    Parameters
    ----------
    meridian : callable
        Function of a place (a parameter along the wall): returns radius (m), height above the
        floor (m) and inclination (rad, above 0 and below pi; below pi/2 the wall leans outwards).
        The height grows with the place.
    floor : float
        Place at floor level, in the unit of ``meridian``: m, rad or what else it takes.
    top : float
        Place of the upper end of the wall, in that unit (m, rad), above ``floor``.
    bottom : float
        Place of the lower end, in that unit (m, rad): ``floor``, or below it if the pad dips into
        the bath.
    steps : int
        Number of steps in which the wall is searched for the contact line.
    """

    meridian: Callable[[float], tuple[float, float, float]]
    floor: float
    top: float
    bottom: float
    steps: int = 8

    @classmethod
    def dome(cls, sphere_radius: float, contact_radius: float, height: float = math.inf) -> Wall:
        """Return the wall of a spherical dome with a flat contact on the floor.

        Parameters
        ----------
        sphere_radius : float
            Radius of the sphere, m, above 0.
        contact_radius : float
            Radius of the contact, m, above 0 and below that of the sphere.
        height : float
            Height of the upper end, m, above 0; by default the top of the sphere.

        Returns
        -------
        Wall
            The wall.

        Raises
        ------
        InvalidInput
            When a value is not finite or out of range.
        """
        size = number('sphere_radius', sphere_radius, 'm', above=True)
        below = math.nextafter(size, 0.0)
        start = math.asin(number('contact_radius', contact_radius, 'm', 0.0, below, True) / size)
        end, most = math.pi - 1e-6, size * (1.0 + math.cos(start))
        if height != math.inf:
            up = number('height', height, 'm', 0.0, most, True)
            end = math.acos(math.cos(start) - up / size)

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
        """Return the wall of a truncated cone; a cylinder for an inclination of pi/2.

        Parameters
        ----------
        contact_radius : float
            Radius at floor level, m, above 0.
        inclination : float
            Angle from floor to wall, through the air, rad, from 0.01 to pi - 0.01.
        height, depth : float
            Extent of the wall above floor level, m, above 0, and below floor level, m, from 0.
            Both may be infinite; the wall ends at the tip of the cone at the latest.

        Returns
        -------
        Wall
            The wall.

        Raises
        ------
        InvalidInput
            When a value is out of range.
        """
        rest = number('contact_radius', contact_radius, 'm', above=True)
        phi = number('inclination', inclination, 'rad', 0.01, math.pi - 0.01)
        lean = math.cos(phi) / math.sin(phi)
        up = height if height == math.inf else number('height', height, 'm', above=True)
        down = depth if depth == math.inf else number('depth', depth, 'm')
        tip = (1.0 - 1e-6) * rest / abs(lean) if lean else math.inf
        up, down = (min(up, tip), down) if lean < 0 else (up, min(down, tip))
        return cls(lambda z: (rest + lean * z, z, phi), 0.0, up, -down)

    @classmethod
    def cylinder(cls, radius: float, height: float = math.inf, depth: float = math.inf) -> Wall:
        """Return the wall of a cylinder, by default one that dips into the bath like a long fibre.

        Parameters
        ----------
        radius : float
            Radius, m, above 0.
        height, depth : float
            Extent of the wall above floor level, m, above 0, and below it, m, from 0; as for
            :meth:`cone`.

        Returns
        -------
        Wall
            The wall.

        Raises
        ------
        InvalidInput
            When a value is out of range.
        """
        return cls.cone(radius, 0.5 * math.pi, height, depth)

    @classmethod
    def through(cls, radii: npt.ArrayLike, heights: npt.ArrayLike) -> Wall:
        """Return a wall through points, with Akima's spline between them (little overshoot).

        Parameters
        ----------
        radii : array, shape (n,)
            Radii, m, above 0; n from 2.
        heights : array, shape (n,)
            Rising heights, m; the first at most 0, the last above 0.

        Returns
        -------
        Wall
            The wall.

        Raises
        ------
        InvalidInput
            When a value is not finite or out of range, heights do not rise, or shapes differ.
        """
        r = quantity('radii', radii, 'm', above=True)
        z = quantity('heights', heights, 'm', -math.inf)
        shaped = r.ndim == 1 and r.shape == z.shape and r.size > 1
        if not shaped or not ((np.diff(z) > 0.0).all() and z[0] <= 0.0 < z[-1]):
            raise InvalidInput(
                f'radii of shape {np.shape(r)} with heights = {z} m are not allowed: as many'
                ' rising heights as radii are needed, the first at most 0, the last above 0'
            )
        from scipy.interpolate import Akima1DInterpolator

        curve = Akima1DInterpolator(z, r)
        slope = curve.derivative()

        def meridian(height: float) -> tuple[float, float, float]:
            return float(curve(height)), height, math.atan2(1.0, float(slope(height)))

        return cls(meridian, 0.0, float(z[-1]), float(z[0]), steps=32)


@dataclass(frozen=True)
class BathMeniscus:
    """The meniscus around a pad and its force on the pad.

    Attributes
    ----------
    height : float
        Height of the contact line above the floor, m; negative where the liquid is pushed down.
    radius : float
        Radius of the contact line, m.
    slope : float
        Angle by which the surface falls outwards at the contact line, rad; above pi/2 the surface
        first goes inwards.
    pressure : float
        Pressure of the liquid minus that of the air at the contact line, Pa: ``-ρ g height``.
    force : float
        Vertical force of the liquid on the pad, N, positive towards the floor: surface tension
        and suction. It equals the weight of the raised liquid.
    volume : float
        Volume of liquid above floor level minus the missing volume below it, m³.
    radii : array, shape (n,)
        Radii of points of the surface, m, from the contact line outwards to where the slope is a
        millionth of ``slope``.
    heights : array, shape (n,)
        Heights of these points, m.
    status : str
        ``ok``; ``several`` where the wall has other equilibria higher up (the lowest is returned);
        ``rim`` where the liquid reaches the end of the wall and is pinned at its edge; ``dry``
        where the liquid is pushed below a wall that ends at the floor: then all numbers are 0,
        except the radius, which is that of the wall at the floor.
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


def bath_meniscus(wall: Wall, liquid: Liquid) -> BathMeniscus:
    """Compute the meniscus of a wide bath at floor level around a pad.

    Parameters
    ----------
    wall : Wall
        Wall of an axisymmetric pad.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.

    Returns
    -------
    BathMeniscus
        Height, radius, m, force, N, volume, m³, and points of the surface.

    Raises
    ------
    InvalidInput
        When an argument is of the wrong type.
    NoSurface
        With status ``blocked``, where the surface would run through the wall.

    Examples
    --------
    A dome with the force of the water on it, in micronewtons; and a wholly wetted fibre:

    >>> from ros_pad.capillary import Wall, bath_meniscus
    >>> from ros_pad.contact import WATER, Liquid
    >>> found = bath_meniscus(Wall.dome(1.55e-3, 0.583e-3), WATER)
    >>> round(1e3 * found.height, 3), round(1e6 * found.force), found.status
    (0.889, 384, 'ok')
    >>> fibre = bath_meniscus(Wall.cylinder(1e-3), Liquid(0.073, 0.073))
    >>> round(1e3 * fibre.height, 3)
    1.839
    """
    instance('wall', wall, Wall)
    instance('liquid', liquid, Liquid)
    weight, length = liquid.weight, liquid.capillary_length
    place, slope, status = contact(wall, liquid.angle, length)
    radius, height, _ = wall.meridian(place)
    if status == 'dry' or slope == 0.0:
        line = np.array([radius]), np.array([height])
        return BathMeniscus(0.0, radius, 0.0, 0.0, 0.0, 0.0, *line, status)
    _, radii, heights = length * outer_surface(radius / length, slope, FINE, POINTS)[:, ::-1]
    _clear_of(wall, place, radii, heights)
    volume = (
        math.pi * radius**2 * height
        + 2.0 * math.pi * length**2 * radius * math.sin(slope)
        - solid_volume(wall, place)
    )
    pressure, force = -weight * height, weight * volume
    return BathMeniscus(height, radius, slope, pressure, force, volume, radii, heights, status)


def contact(wall: Wall, angle: float, length: float) -> tuple[float, float, str]:
    """Find the contact line on a wall.

    Parameters
    ----------
    wall : Wall
        Wall of the pad.
    angle : float
        Contact angle, rad.
    length : float
        Capillary length, m.

    Returns
    -------
    tuple
        Place on the wall, slope of the surface there (rad), and status as in `BathMeniscus`.

    Notes
    -----
    For each place, its height is compared with that of the surface which meets it at the contact
    angle. The first place, seen from the floor, at which the two agree is the equilibrium. If
    there is none, the liquid is held at the end of the wall (``rim``).
    """

    def slope(place: float) -> float:
        return math.pi - wall.meridian(place)[2] - angle

    start = slope(wall.floor)

    def excess(place: float, tolerance: float) -> float:
        if place == wall.floor:  # the excess has the sign of the slope, but may be infinite
            return start
        radius, height, _ = wall.meridian(place)
        return bath_height(radius / length, slope(place), tolerance) - height / length

    if abs(start) < 1e-12:
        return wall.floor, 0.0, 'ok'
    end = wall.top if start > 0.0 else wall.bottom
    if end == wall.floor:
        return wall.floor, 0.0, 'dry'
    end = _reach(wall, end, length)
    # Smaller steps near the floor, where liquid can stand in a narrow wedge.
    places = wall.floor + (end - wall.floor) * (np.arange(1, wall.steps + 1) / wall.steps) ** 2
    signs = [math.copysign(1.0, start)]
    signs += [math.copysign(1.0, excess(float(place), COARSE)) for place in places]
    turns = np.flatnonzero(np.diff(signs))
    if not turns.size:
        return end, _held(wall, end, length, slope(end)), 'rim'
    from scipy.optimize import brentq, newton

    first = int(turns[0])
    low, high = places[first - 1] if first else wall.floor, places[first]
    step = abs(high - low)
    near = brentq(excess, low, high, args=(COARSE,), xtol=1e-5 * step)
    place = float(newton(excess, near, x1=near + 1e-5 * step, args=(FINE,), tol=1e-12 * step))
    return place, slope(place), 'ok' if turns.size == 1 else 'several'


def solid_volume(wall: Wall, place: float) -> float:
    """Return the volume of the pad between floor level and a place, m³; negative below floor."""
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
    return float(outer_surface(radius, slope, tolerance)[2, -1]) if slope else 0.0


def outer_surface(radius: float, slope: float, tolerance: float = 1e-12, points: int = 2) -> Array:
    """Compute the surface of a wide bath outside a circle on which its slope angle is given.

    Parameters
    ----------
    radius : float
        Radius of the circle, in capillary lengths, above 0.
    slope : float
        Angle by which the surface falls outwards at the circle, rad, from -pi to pi, not 0. Above
        pi/2 the surface first goes inwards, under the circle; below 0 it is the mirror image below
        the bath.
    tolerance : float
        Approximate relative error of the heights.
    points : int
        Number of points to return, from 2.

    Returns
    -------
    array, shape (3, points)
        Slope angle (rad), radius and height above the bath (capillary lengths), from far away to
        the circle, at equal steps of the logarithm of the slope.

    Notes
    -----
    With ψ the slope angle at radius r and height z, ``dr/dψ = -cos ψ / (z + sin ψ / r)`` and
    ``dz/dψ = sin ψ / (z + sin ψ / r)``. They are integrated over ln ψ, from the linear surface far
    away, ``z/ψ = K0(r)/K1(r)``, to the circle.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq
    from scipy.special import k0e, k1e

    if slope < 0.0:
        mirror = np.array([[-1.0], [1.0], [-1.0]])
        return mirror * outer_surface(radius, -slope, tolerance, points)
    outer = 1e-6 * slope  # at this slope the surface is linear, with an error of 1e-12

    def surface(distance: float) -> Array:
        """Return ln slope, r - radius and z of a surface that is linear from this distance on."""
        start = radius + distance

        def rates(log: float, state: Array) -> tuple[float, float]:
            psi, r = math.exp(log), radius + state[0]
            rise = math.sin(psi)
            pull = psi / (state[1] + rise / r)
            return -math.cos(psi) * pull, rise * pull

        ends = math.log(outer), math.log(slope)
        first = distance, outer * k0e(start) / k1e(start)
        steps = np.linspace(*ends, points)
        least = tolerance * min(radius, 1.0), tolerance * outer
        path = solve_ivp(rates, ends, first, 'DOP853', steps, rtol=10.0 * tolerance, atol=least)
        return np.vstack([path.t, path.y])

    # The slope decays at least as fast as exp(-2/3 distance), so 25 is far enough.
    distance = brentq(
        lambda far: math.log1p(surface(far)[1, -1] / radius), 0.0, 25.0, xtol=tolerance
    )
    log, beyond, height = surface(distance)
    return np.vstack([np.exp(log), radius + beyond, height])


def _reach(wall: Wall, end: float, length: float) -> float:
    """Return the end of a wall, or the place at ``HIGHEST`` if it is nearer to the floor."""
    sign = math.copysign(1.0, end - wall.floor)
    if math.isinf(end):
        end = wall.floor + sign * HIGHEST * length
    if abs(wall.meridian(end)[1]) <= HIGHEST * length:
        return end
    from scipy.optimize import brentq

    return float(brentq(lambda p: sign * wall.meridian(p)[1] - HIGHEST * length, wall.floor, end))


def _held(wall: Wall, end: float, length: float, most: float) -> float:
    """Return the slope of a surface that is pinned at the end of the wall."""
    from scipy.optimize import brentq

    radius, height, _ = wall.meridian(end)

    def excess(slope: float) -> float:
        return bath_height(radius / length, slope) - height / length

    return float(brentq(excess, 1e-9 * most, most, xtol=1e-12))


def _clear_of(wall: Wall, place: float, radii: Array, heights: Array) -> None:
    """Raise `NoSurface` where a surface runs through the wall."""
    places = np.linspace(wall.floor, place, POINTS)
    wall_radii, wall_heights, _ = np.transpose([wall.meridian(float(p)) for p in places])
    side = -math.copysign(1.0, heights[0])
    inside = wall_radii - np.interp(side * wall_heights, side * heights, radii)
    if np.max(inside) > 1e-3 * radii[0]:
        raise NoSurface(
            f'the surface that meets the wall at height = {heights[0]:g} m would run through the'
            ' wall between this height and the floor: a ledge there is thinner than a step of the'
            f' search, so more than steps = {wall.steps} of the Wall are needed',
            'blocked',
        )
