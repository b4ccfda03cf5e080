# SPDX-License-Identifier: Apache-2.0
"""Liquid squeezed out from under a soft surface: an elastohydrodynamic film.

Under a rigid disc a film is plane (:mod:`ros_pad.contact.film`). Under a soft one its pressure
dents the surface: the film is thickest in the middle (the *dimple*), and its rim closes first. The
Reynolds equation of a round film without inertia, both walls without slip,

    ∂h/∂t = 1/(12 η r) ∂/∂r (r h³ ∂p/∂r),    p = 0 at the rim,

is solved with h = H(t) + κ r²/2 + w(r): height, which follows from the load, curvature of the
surface, and its deflection by the pressure, as a half-space or as a membrane.

Finite volumes on rings. Pressure is uniform on each, so deflections are closed forms. The flux
between rings uses the mean 2 h₁² h₂²/(h₁ + h₂) of h³, which vanishes with either film, so films
stay positive (Zhornitskaya and Bertozzi, SIAM J. Numer. Anal. 37 (2000) 523). In time: Radau IIA
of SciPy, whose steps keep the sum of liquid in the film and liquid that has left.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ros_pad.configuration import instance, integer, number, quantity
from ros_pad.contact.film import WATER_VISCOSITY
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, NoSurface

_STIFFEST = 1e-6  # of the initial film: a smaller dimple is lost in rounding


class Squeezed(NamedTuple):
    """A film over time.

    Attributes
    ----------
    time : array
        Times, s, (times,).
    radius : array
        Middles of the rings, m, (rings,).
    area : array
        Area of each ring, m², (rings,).
    thickness : array
        Thickness of the film, m, (times, rings).
    pressure : array
        Pressure in the film, Pa, (times, rings).
    load : array
        Force of the film on the surface, N, (times,).
    drained : array
        Volume that has left the film, m³, (times,).
    status : str
        ``ok``; ``large_strain`` where the mean pressure on a half-space exceeds 0.2 of its
        modulus; ``touching`` where a film is thinner than 1 nm somewhere, in reality a contact.
    """

    time: Array
    radius: Array
    area: Array
    thickness: Array
    pressure: Array
    load: Array
    drained: Array
    status: str

    @property
    def mean(self) -> Array:
        """Mean thickness, m, shape (times,)."""
        return np.asarray(self.thickness @ self.area / self.area.sum())

    def dry_share(self, critical_film: float, exponent: float = 2.0) -> Array:
        """Return the share of dry contact exp(-(h/h_c)^m), averaged over the area.

        Parameters
        ----------
        critical_film : float
            Film h_c that leaves 1/e of dry contact, m, above 0.
        exponent : float
            Exponent m, dimensionless, above 0.

        Returns
        -------
        array, shape (times,)
            Share, 0 to 1.
        """
        dry = np.exp(-((self.thickness / critical_film) ** exponent))
        return np.asarray(dry @ self.area / self.area.sum())


@dataclass(frozen=True)
class HalfSpace:
    """A thick elastic body with a flat round sole, or with a sphere's cap.

    Parameters
    ----------
    radius : float
        Radius of the sole, m, above 0. Of a sphere: where the pressure is that around the film, at
        least 1.5 times the radius of the contact.
    modulus : float
        Reduced modulus E/(1 - ν²), Pa, above 0: 4 μ for rubber with shear modulus μ.
    curvature : float
        One over the radius of the sphere, 1/m; 0 for a flat sole.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range.
    """

    radius: float
    modulus: float
    curvature: float = 0.0

    def __post_init__(self) -> None:
        number('radius', self.radius, 'm', above=True)
        number('modulus', self.modulus, 'Pa', above=True)
        number('curvature', self.curvature, '1/m')

    @property
    def compliance(self) -> float:
        """Deflection by unit pressure, without the factor of shape, m/Pa."""
        return self.radius / self.modulus

    def contact_radius(self, load: float) -> float:
        """Return the radius of the dry contact under a load.

        Parameters
        ----------
        load : float
            Force on the surface, N, from 0.

        Returns
        -------
        float
            Radius, m, by Hertz, or that of the sole if it is flat.
        """
        if self.curvature == 0.0:
            return self.radius
        return float((0.75 * load / (self.curvature * self.modulus)) ** (1.0 / 3.0))

    def deflection(self, edges: Array, at: Array) -> Array:
        """Return the deflection at radii by unit pressure on each ring.

        Parameters
        ----------
        edges : array, shape (rings + 1,)
            Radii of the edges of the rings, over the radius (no unit), rising.
        at : array, shape (n,)
            Radii, over the radius (no unit), above 0.

        Returns
        -------
        array, shape (n, rings)
            Deflection over :attr:`compliance`, no unit.
        """
        from scipy.special import ellipe, ellipkm1

        # Johnson, Contact Mechanics (1985), 3.4.2: uniform pressure on a disc.
        reach, r = np.broadcast_arrays(edges, at[:, None])
        far, near = np.maximum(reach, r), np.minimum(reach, r)
        rest = (far - near) * (far + near) / far**2
        inside = far * ellipe(1.0 - rest)
        kernel = rest * ellipkm1(np.where(rest > 0.0, rest, 1.0))
        discs = 4.0 / math.pi * np.where(r <= reach, inside, inside - far * kernel)
        return np.diff(np.where(reach > 0.0, discs, 0.0), axis=1)


@dataclass(frozen=True)
class Membrane:
    """The bottom of a dome: a membrane of constant tension under air, nearly flat.

    Parameters
    ----------
    radius : float
        Where the pressure is that around the film, m: at least 1.5 times the radius of the
        contact.
    tension : float
        Tension, N/m, above 0.
    pressure : float
        Gauge pressure of the air, Pa, above 0.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range.
    """

    radius: float
    tension: float
    pressure: float

    def __post_init__(self) -> None:
        number('radius', self.radius, 'm', above=True)
        number('tension', self.tension, 'N/m', above=True)
        number('pressure', self.pressure, 'Pa', above=True)

    @property
    def curvature(self) -> float:
        """One over the radius of the free dome, 1/m."""
        return 0.5 * self.pressure / self.tension

    @property
    def compliance(self) -> float:
        """Deflection by unit pressure, without the factor of shape, m/Pa."""
        return self.radius**2 / self.tension

    def contact_radius(self, load: float) -> float:
        """Return the radius of the dry contact under a load that the air carries.

        Parameters
        ----------
        load : float
            Force on the surface, N, from 0.

        Returns
        -------
        float
            Radius, m.
        """
        return math.sqrt(load / (math.pi * self.pressure))

    def deflection(self, edges: Array, at: Array) -> Array:
        """Return the deflection at radii by unit pressure on each ring.

        Parameters
        ----------
        edges : array, shape (rings + 1,)
            Radii of the edges of the rings, over the radius (no unit), rising.
        at : array, shape (n,)
            Radii, over the radius (no unit), above 0.

        Returns
        -------
        array, shape (n, rings)
            Deflection over :attr:`compliance`, no unit.
        """
        reach, r = np.broadcast_arrays(edges, at[:, None])
        far = np.maximum(reach, r)
        inner = np.where(r < reach, 0.25 * (reach**2 - r**2), 0.0)
        return np.diff(inner - 0.5 * reach**2 * np.log(far), axis=1)


def squeeze(
    surface: HalfSpace | Membrane,
    initial: float,
    time: ArrayLike,
    load: float,
    viscosity: float = WATER_VISCOSITY,
    rise: float = 0.0,
    rings: int = 200,
    tolerance: float = 1e-6,
) -> Squeezed:
    """Return the film under a soft surface on a rigid plane, over time.

    Roughness, wetting and contact through the film are left out; and liquid is taken to surround
    the film.

    Parameters
    ----------
    surface : HalfSpace or Membrane
        The soft surface, undeformed at time 0.
    initial : float
        Thinnest film at time 0, m, above 0. The film is that plus the surface's curvature.
    time : array
        Times, s, rising, from 0.
    load : float
        Force on the surface, N, above 0.
    viscosity : float
        Dynamic viscosity, Pa s, above 0.
    rise : float
        Time in which the load grows from 0 to its value, linearly, s; 0 applies it at once.
    rings : int
        Number of rings, 10 to 2000. The error falls with its square.
    tolerance : float
        Relative tolerance of each time step, 1e-10 to 1e-2.

    Returns
    -------
    Squeezed
        Thickness, m, and pressure, Pa, of each ring at each time, load, N, and volume that has
        left, m³.

    Raises
    ------
    InvalidInput
        When a value is out of range, or the surface is so stiff that it is rigid: use
        :func:`ros_pad.contact.film_thickness`.
    NoSurface
        With status ``no_convergence``, when the time steps fail.

    Examples
    --------
    A flat soft sole of 10 mm under 2 N traps liquid that a rigid disc would press out:

    >>> from ros_pad.contact import HalfSpace, film_thickness, squeeze
    >>> film = squeeze(HalfSpace(10e-3, 2e6), 0.1e-3, [0.0, 1.0], load=2.0, rings=40)
    >>> f'{1e6 * film.mean[-1]:.1f} micrometres'
    '15.0 micrometres'
    >>> rigid = film_thickness(0.1e-3, 2.0 / film.area.sum(), 10e-3, 1.0)
    >>> f'{1e6 * rigid:.1f} micrometres'
    '3.4 micrometres'
    """
    from scipy.integrate import solve_ivp

    instance('surface', surface, HalfSpace, Membrane)
    number('initial', initial, 'm', above=True)
    number('viscosity', viscosity, 'Pa s', above=True)
    number('load', load, 'N', above=True)
    number('rise', rise, 's')
    integer('rings', rings, 10, 2000)
    number('tolerance', tolerance, '', 1e-10, 1e-2)
    times = np.atleast_1d(quantity('time', time, 's'))
    if times.ndim > 1 or not times.size or np.any(np.diff(times) <= 0.0) or times[-1] <= 0.0:
        raise InvalidInput(f'time = {times} is not allowed: rising values from 0 s are needed')
    a, eta = surface.radius, viscosity
    # Units: radius a, film `initial`, pressure p0, time η a²/(p0 h0²).
    p0 = load / (math.pi * a**2)
    unit = eta * a**2 / (p0 * initial**2)
    softness = surface.compliance * p0 / initial
    if softness < _STIFFEST:
        raise InvalidInput(
            f'the surface deflects by {softness * initial:.2g} m, less than {_STIFFEST:g} of the'
            f' initial film of {initial:g} m: it is rigid, use film_thickness'
        )
    edges = _edges(rings, surface, load)
    middles, area = 0.5 * (edges[1:] + edges[:-1]), math.pi * np.diff(edges**2)
    profile = 0.5 * surface.curvature * a**2 / initial * middles**2
    compliance = softness * surface.deflection(edges, middles)
    pressure_of, slope = _loaded(compliance, area, profile, rise / unit)
    flow, jacobian = _flow(edges, middles, area, pressure_of, slope)
    start = np.append(1.0 + profile, 0.0)
    found = solve_ivp(
        flow, (0.0, times[-1] / unit), start, 'Radau', times / unit,
        jac=jacobian, rtol=tolerance, atol=1e-4 * tolerance,
    )  # fmt: skip
    if not found.success or not np.all(found.y[:-1] > 0.0):
        raise NoSurface(
            f'the film under {surface} was not found: {found.message}', 'no_convergence'
        )
    films = found.y[:-1].T
    pressures = np.array([pressure_of(t, h) for t, h in zip(found.t, films, strict=True)])
    strained = isinstance(surface, HalfSpace) and p0 > 0.2 * surface.modulus
    touching = float(films.min()) * initial < 1e-9
    return Squeezed(
        times, a * middles, a**2 * area, initial * films, p0 * pressures,
        p0 * a**2 * (pressures @ area), a**2 * initial * found.y[-1],
        'large_strain' if strained else 'touching' if touching else 'ok',
    )  # fmt: skip


def trapped_film(radius: float, modulus: float, pressure: float) -> float:
    """Return the mean film that a flat soft sole traps for good once its rim has closed.

    It is the dimple of a half-space under uniform pressure, 4 (4/3 - 1)/π p a/E*: the mean
    deflection of the loaded disc less that of its rim. A film that drains outward everywhere has a
    pressure that falls outward, and of these pressures the uniform one has the flattest dimple.

    Parameters
    ----------
    radius : float
        Radius a of the sole, m, above 0.
    modulus : float
        Reduced modulus E*, Pa, above 0, as for :class:`HalfSpace`.
    pressure : float
        Mean pressure p, Pa, from 0.

    Returns
    -------
    float
        Film, m.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range.

    Examples
    --------
    >>> from ros_pad.contact import trapped_film
    >>> round(1e6 * trapped_film(10e-3, 2e6, 6.4e3), 1)  # micrometres
    13.6
    """
    number('pressure', pressure, 'Pa')
    return 4.0 / math.pi * (4.0 / 3.0 - 1.0) * pressure * HalfSpace(radius, modulus).compliance


def _edges(rings: int, surface: HalfSpace | Membrane, load: float) -> Array:
    """Return the edges of the rings, 0 to 1: they are narrow near the rim of the contact."""
    rim, width = 1.0, 1e-4
    if surface.curvature > 0.0:
        rim = surface.contact_radius(load) / surface.radius
        width = 0.03 * rim
        if rim > 1.0 / 1.5:
            raise InvalidInput(
                f'radius = {surface.radius:g} m is not allowed: at least 1.5 times the radius of'
                f' the contact, {1.5 * rim * surface.radius:.4g} m, is needed'
            )
    places = np.linspace(math.asinh(-rim / width), math.asinh((1.0 - rim) / width), rings + 1)
    edges = rim + width * np.sinh(places)
    edges[0], edges[-1] = 0.0, 1.0
    return edges


Pressures = Callable[[float, Array], Array]


def _loaded(
    compliance: Array, area: Array, profile: Array, rise: float
) -> tuple[Pressures, Array]:
    """Return pressure as a function of time and film, and its derivative by the film.

    The height is such that the load is π, from a time ``rise`` on.
    """
    count = len(area)
    whole = np.block([[compliance, np.ones((count, 1))], [area[None, :], np.zeros((1, 1))]])
    inverse = np.asarray(np.linalg.inv(whole), dtype=np.float64)
    slope, base = inverse[:count, :count], math.pi * inverse[:count, count]

    def pressures(time: float, film: Array) -> Array:
        return slope @ (film - profile) + (base if time >= rise else time / rise * base)

    return pressures, slope


def _flow(
    edges: Array, middles: Array, area: Array, pressure_of: Pressures, slope: Array
) -> tuple[Callable[[float, Array], Array], Callable[[float, Array], Array]]:
    """Return the rate of films and of drained liquid, and its Jacobian."""
    count = len(area)
    ways = np.append(np.diff(middles), 1.0 - middles[-1])
    conductance = 2.0 * math.pi * edges[1:] / ways / 12.0
    drops = -np.diff(slope, axis=0, append=0.0)
    inner = np.arange(count - 1)

    def cubes(h: Array) -> Array:
        return np.append(2.0 * (h[:-1] * h[1:]) ** 2 / (h[:-1] + h[1:]), h[-1] ** 3)

    def flow(time: float, state: Array) -> Array:
        film = state[:-1]
        drop = -np.diff(pressure_of(time, film), append=0.0)
        flux = conductance * cubes(film) * drop
        return np.append(-np.diff(flux, prepend=0.0) / area, flux[-1])

    def jacobian(time: float, state: Array) -> Array:
        film = state[:-1]
        drop = -np.diff(pressure_of(time, film), append=0.0)
        by_film = (conductance * cubes(film))[:, None] * drops
        near, far = film[:-1], film[1:]
        common = 2.0 * near * far / (near + far) ** 2 * (conductance * drop)[:-1]
        by_film[inner, inner] += common * far * (near + 2.0 * far)
        by_film[inner, inner + 1] += common * near * (far + 2.0 * near)
        by_film[-1, -1] += 3.0 * conductance[-1] * film[-1] ** 2 * drop[-1]
        whole = np.zeros((count + 1, count + 1))
        whole[:count, :count] = -np.diff(by_film, axis=0, prepend=0.0) / area[:, None]
        whole[count, :count] = by_film[-1]
        return whole

    return flow, jacobian
