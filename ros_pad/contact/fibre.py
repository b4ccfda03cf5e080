# SPDX-License-Identifier: Apache-2.0
"""Meniscus around a vertical fibre in a wide bath."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, number, quantity
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import Array, Floats, broadcast, plain

# Radii over capillary length: range in which the exact method is checked, and upper end of the
# range of the asymptote.
THINNEST, THICKEST, THIN = 1e-6, 1e4, 0.1


def fibre_meniscus(
    radius: npt.ArrayLike,
    surface_tension: npt.ArrayLike,
    contact_angle: npt.ArrayLike,
    density: npt.ArrayLike = 1000.0,
    gravity: npt.ArrayLike = GRAVITY,
    method: str = 'young_laplace',
) -> Floats:
    """Return the height to which a liquid climbs the outside of a vertical fibre, m.

    Parameters
    ----------
    radius : float or array
        Radius of the fibre, m; from 1e-6 to 1e4 capillary lengths sqrt(surface_tension / (density
        gravity)) for ``young_laplace``, above 0 to 0.1 of them for ``derjaguin``.
    surface_tension : float or array
        Surface tension, N/m, above 0.
    contact_angle : float or array
        Contact angle, rad, from 0 to pi. Above pi/2 the liquid is pushed down: height below 0.
    density : float or array
        Density of the liquid minus that of the gas, kg/m³, above 0.
    gravity : float or array
        Gravity, m/s², above 0.
    method : {'young_laplace', 'derjaguin'}
        ``young_laplace`` is exact (scalars only). ``derjaguin`` is the asymptote for thin fibres
        of Derjaguin and James (scalars and arrays). At 0.1 capillary lengths its error is
        +0.006 % at complete wetting, -0.7 % at 30 degrees and -1.5 % at 60 degrees.

    Returns
    -------
    float or array
        Height above the level of the bath, m.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, shapes do not broadcast, or the method is
        unknown.

    Notes
    -----
    With lengths in capillary lengths and ψ the slope angle of the surface at radius r and height
    z, ``dr/dψ = -cos ψ / (z + sin ψ / r)`` and ``dz/dψ = sin ψ / (z + sin ψ / r)``. They are
    integrated over ln ψ, from the linear surface far away, ``z/ψ = K0(r)/K1(r)``, to the fibre.
    The asymptote is ``ε cos θ (ln(4 / (ε (1 + sin θ))) - 0.57722)`` with ε the radius in
    capillary lengths.

    Examples
    --------
    >>> round(1e3 * fibre_meniscus(1e-3, 0.073, 0.0), 3)
    1.839
    """
    choice('method', method, ('young_laplace', 'derjaguin'))
    check: Callable[..., Any] = number if method == 'young_laplace' else quantity
    a = check('radius', radius, 'm', above=True)
    tension = check('surface_tension', surface_tension, 'N/m', above=True)
    theta = check('contact_angle', contact_angle, 'rad', high=math.pi)
    rho = check('density', density, 'kg/m³', above=True)
    g = check('gravity', gravity, 'm/s²', above=True)
    names = 'radius, surface_tension, contact_angle, density and gravity'
    a, tension, theta, rho, g = broadcast(names, a, tension, theta, rho, g)
    length = np.sqrt(tension / (rho * g))
    thickness = a / length
    if method == 'derjaguin':
        quantity('radius / capillary length', thickness, '(ratio)', high=THIN, above=True)
        cosine, sine = np.cos(theta), np.sin(theta)
        logarithm = np.log(4.0 / (thickness * (1.0 + sine))) - np.euler_gamma
        return plain(length * thickness * cosine * logarithm)
    thickness = number('radius / capillary length', thickness, '(ratio)', THINNEST, THICKEST)
    return float(length) * _height(thickness, 0.5 * math.pi - theta)


def _height(radius: float, slope: float) -> float:
    """Return the height at a radius and slope angle, in capillary lengths."""
    if slope <= 0.0:
        return -_height(radius, -slope) if slope < 0.0 else 0.0
    return float(outer_surface(radius, slope)[2, -1])


def outer_surface(radius: float, slope: float, tolerance: float = 1e-12, points: int = 2) -> Array:
    """Compute the surface of a wide bath outside a circle on which its slope angle is given.

    Parameters
    ----------
    radius : float
        Radius of the circle, in capillary lengths, above 0.
    slope : float
        Angle by which the surface falls outwards at the circle, rad, above 0 and below pi. Above
        pi/2 the surface first goes inwards, under the circle.
    tolerance : float
        Approximate relative error of the heights.
    points : int
        Number of points to return, from 2.

    Returns
    -------
    array, shape (3, points)
        Slope angle (rad), radius and height above the bath (capillary lengths), from far away to
        the circle, at equal steps of the logarithm of the slope.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq
    from scipy.special import k0e, k1e

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
        path = solve_ivp(
            rates,
            ends,
            (distance, outer * k0e(start) / k1e(start)),
            method='DOP853',
            rtol=10.0 * tolerance,
            atol=(tolerance * min(radius, 1.0), tolerance * outer),
            t_eval=np.linspace(*ends, points),
        )
        return np.vstack([path.t, path.y])

    # The slope decays at least as fast as exp(-2/3 distance), so 25 is far enough.
    distance = brentq(
        lambda far: math.log1p(surface(far)[1, -1] / radius), 0.0, 25.0, xtol=tolerance
    )
    log, beyond, height = surface(distance)
    return np.vstack([np.exp(log), radius + beyond, height])
