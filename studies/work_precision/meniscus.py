# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of the meniscus: liquid bridges, and the ring around a pressed dome.

The reference is computed differently from :mod:`ros_pad.contact`: by shooting along the meridian
with 12 digits. It is followed from a gap so narrow that the meridian is a circle, and from zero
gravity to that of the earth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from ros_pad.contact import (
    LARGE_PAD,
    WATER,
    Liquid,
    Pressed,
    bridge,
    force_limit,
    inflate,
    meniscus,
    press,
)
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.pad import Array
from ros_pad.pace import Progress
from studies.work_precision.capillary import dome, truth
from studies.work_precision.comparison import Method, Problem, Result, both, chart, run

# The sphere is the dome of the large pad at 75 kPa; the liquid is water.
RADIUS = inflate(LARGE_PAD, 75e3).sphere_radius
_TENSION, _DENSITY = WATER.surface_tension, WATER.density
_UNIT = RADIUS * _TENSION  # unit of force, N
_BOND = _DENSITY * GRAVITY * RADIUS**2 / _TENSION
SHOOTING = 'shooting, start at the circle'

# The sample: contact angle and filling angle, degrees, and separation in radii.
ORDINARY = tuple(
    (theta, beta, 0.0)
    for theta in (0.0, 20.0, 40.0, 60.0, 80.0)
    for beta in (2.0, 5.0, 10.0, 20.0, 30.0, 45.0)
)
CORNERS = (
    *((0.0, 0.1, 0.0), (40.0, 0.1, 0.0), (80.0, 0.1, 0.0)),  # hardly any liquid
    *((60.0, 60.0, 0.0), (60.0, 60.01, 0.0), (75.0, 30.0, 0.0), (35.0, 110.0, 0.0)),  # flat
    *((0.0, 110.0, 0.0), (20.0, 110.0, 0.0), (40.0, 110.0, 0.0), (0.0, 90.0, 0.0)),  # wide
    *((110.0, 20.0, 0.0), (130.0, 40.0, 0.0), (160.0, 60.0, 0.0)),  # not wetting
    *((0.0, 10.0, 0.05), (40.0, 10.0, 0.05), (40.0, 30.0, 0.3)),  # apart
    *((0.0, 3.42, 0.05), (17.0, 2.39, 0.05), (69.0, 1.03, 0.05)),  # about to rupture
)


def measure(progress: Progress) -> list[Result]:
    """Measure bridges without gravity, bridges with gravity, and the ring.

    Progress, 0 to 1, is reported to ``progress``.
    """
    problem, volumes = bridge_problem(0.0, lambda share: progress(0.3 * share))
    methods = _bridge_methods(volumes)
    light = run(problem, methods, SHOOTING, lambda done: progress(0.3 + 0.2 * done / len(methods)))
    problem, volumes = bridge_problem(GRAVITY, lambda share: progress(0.5 + 0.3 * share))
    methods = _heavy_methods(volumes)
    heavy = run(problem, methods, SHOOTING, lambda done: progress(0.8 + 0.1 * done / len(methods)))
    problem = ring_problem(lambda share: progress(0.9 + 0.05 * share))
    rings = run(problem, RING_METHODS, BATH, lambda done: progress(0.95 + 0.01 * done))
    progress(1.0)
    return light + heavy + rings


def figures(results: list[Result], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name."""
    return {'meniscus': chart(results)}


# --- bridges -------------------------------------------------------------------------------------

Case = tuple[float, float, float]


def bridge_problem(gravity: float, progress: Progress) -> tuple[Problem, dict[Case, float]]:
    """Return the sample of bridges with the force on the sphere, and the volume of each, m³.

    Bridges without a reference, because gravity breaks them, are left out.
    """
    bond = _BOND * gravity / GRAVITY
    cases, forces, volumes, ordinary = [], [], {}, []
    sample = ORDINARY + CORNERS
    for number, (theta, beta, gap) in enumerate(sample):
        case = (math.radians(theta), math.radians(beta), gap * RADIUS)
        found = followed(case[0], case[1], gap, bond)
        progress((number + 1) / len(sample))
        if found is None:
            continue
        cases.append(case)
        forces.append(found.force * _UNIT)
        volumes[case] = found.volume * RADIUS**3
        ordinary.append(number < len(ORDINARY))
    angles, fillings, gaps = np.array(cases).T
    inputs = {'contact_angle_rad': angles, 'filling_angle_rad': fillings, 'separation_m': gaps}
    name = 'bridge, force on the sphere' + (', with gravity' if gravity else '')
    return Problem(name, inputs, np.array(forces), np.array(ordinary), wrong=0.1), volumes


@dataclass(frozen=True)
class Shot:
    """A meridian found by shooting, in units of the radius of the sphere and of the tension.

    Attributes
    ----------
    force, volume : float
        Force on the sphere, and volume of the liquid.
    pressure : float
        Pressure at the plane.
    length : float
        Length of the meridian.
    """

    force: float
    volume: float
    pressure: float
    length: float


def followed(theta: float, beta: float, gap: float, bond: float = 0.0) -> Shot | None:
    """Return the bridge by continuation from a narrow gap without gravity; None if that fails.

    ``theta`` is the contact angle on sphere and plane, ``beta`` the filling angle, rad; ``gap`` is
    in radii of the sphere; ``bond`` is density gravity radius² / tension.
    """
    height, edge = gap + 2.0 * math.sin(0.5 * beta) ** 2, math.sin(beta)
    least = min(height, 0.1 * edge)
    steps = np.geomspace(least, height, 1 + math.ceil(math.log(height / least) / 0.3))
    shot = None
    for each in steps:
        shot = _shoot(theta, beta, float(each), 0.0, 1e-12, shot)
    for weight in np.linspace(0.0, bond, 5)[1:] if bond else ():
        shot = shot and _shoot(theta, beta, height, float(weight), 1e-12, shot)
    return shot


def _shoot(
    theta: float, beta: float, height: float, bond: float, rtol: float, start: Shot | None
) -> Shot | None:
    """Return the meridian near a start, by default the circle; None if none is found."""
    edge, end, begin = math.sin(beta), beta + theta, math.pi - theta
    turn = end - begin
    if start is None:
        rise = math.sin(0.5 * (begin + end)) * float(np.sinc(turn / (2.0 * math.pi)))
        length = height / rise
        guess = (turn / length + math.sin(end) / edge, length)
    else:
        guess = (start.pressure, start.length)

    def path(pressure: float, length: float) -> Array:
        """Return radius, height, inclination and volume at the end of the path, on the plane."""

        def rates(_: float, state: Array) -> tuple[float, float, float, float]:
            r, z, phi, _ = state.tolist()
            sine = math.sin(phi)
            bend = pressure - bond * z - sine / r
            return -math.cos(phi), -sine, -bend, math.pi * r * r * sine

        solved = solve_ivp(
            rates,
            (0.0, length),
            (edge, height, end, 0.0),
            method='DOP853',
            rtol=rtol,
            atol=rtol * min(height, edge),
        )
        return np.asarray(solved.y[:, -1])

    def misses(unknown: Array) -> tuple[float, float]:
        if not 0.0 < unknown[1] * height < 10.0 * guess[1]:
            return 1e3, 1e3  # too far off to be worth an integration
        _, z, phi, _ = path(unknown[0] / height, unknown[1] * height)
        return z / height, phi - begin

    # The unknowns are scaled to the order of 1 for every gap.
    root, _, ended, _ = fsolve(
        misses,
        (guess[0] * height, guess[1] / height),
        xtol=0.1 * rtol,
        maxfev=60,
        full_output=True,
    )
    pressure, length = float(root[0]) / height, float(root[1]) * height
    # If fsolve starts at the root, it reports an error, because it makes no progress.
    if (ended != 1 and max(map(abs, misses(root))) > 100.0 * rtol) or length <= 0.0:
        return None
    _, _, _, under = path(pressure, length)
    cap = math.pi / 3.0 * (1.0 - math.cos(beta)) ** 2 * (2.0 + math.cos(beta))
    force = (
        math.pi * (2.0 * edge * math.sin(end) - edge**2 * (pressure - bond * height)) - bond * cap
    )
    return Shot(force, float(under) - cap, pressure, length)


def _shooting(bond: float) -> Callable[[float, float, float], float]:
    """Return a simple shooting method: 8 digits, from the circle, without continuation."""

    def solve(theta: float, beta: float, gap: float) -> float:
        height = gap / RADIUS + 2.0 * math.sin(0.5 * beta) ** 2
        shot = _shoot(theta, beta, height, bond, 1e-8, None)
        return math.nan if shot is None else shot.force * _UNIT

    return solve


def _small_bridge(theta: Array, beta: Array, gap: Array) -> Array:
    """Return Derjaguin's force of a small bridge, with its first correction for a gap."""
    height = RADIUS * (1.0 - np.cos(beta))
    return 4.0 * math.pi * _UNIT * np.cos(theta) / (1.0 + gap / height)


def _circle(theta: Array, beta: Array, gap: Array) -> Array:
    found = bridge(RADIUS, _TENSION, theta, filling_angle=beta, separation=gap, method='circle')
    return np.asarray(found.force)[()]


def _exact(gravity: float) -> Callable[[float, float, float], float]:
    def solve(theta: float, beta: float, gap: float) -> float:
        known: dict[str, Any] = {'separation': gap, 'gravity': gravity, 'density': _DENSITY}
        known |= {'filling_angle': beta, 'method': 'young_laplace'}
        return float(bridge(RADIUS, _TENSION, theta, **known).force)

    return solve


def _by_volume(
    volumes: dict[Case, float], method: str, gravity: float
) -> Callable[[float, float, float], float]:
    def solve(theta: float, beta: float, gap: float) -> float:
        known: dict[str, Any] = {'separation': gap, 'gravity': gravity, 'density': _DENSITY}
        known |= {'volume': volumes[theta, beta, gap], 'method': method}
        return float(bridge(RADIUS, _TENSION, theta, **known).force)

    return solve


def _bridge_methods(volumes: dict[Case, float]) -> tuple[Method, ...]:
    return (
        Method('4 π γ R cos θ, batch', _small_bridge, batch=True),
        *both('circle', _circle),
        Method('circle, by volume', _by_volume(volumes, 'circle', 0.0), ours=True),
        Method(SHOOTING, _shooting(0.0)),
        Method('exact', _exact(0.0), ours=True),
        Method('exact, by volume', _by_volume(volumes, 'young_laplace', 0.0), ours=True),
    )


def _heavy_methods(volumes: dict[Case, float]) -> tuple[Method, ...]:
    return (
        Method('circle, batch', _circle, batch=True, ours=True),
        Method(SHOOTING, _shooting(_BOND)),
        Method('exact, without gravity', _exact(0.0), ours=True),
        Method('exact', _exact(GRAVITY), ours=True),
        Method('exact, by volume', _by_volume(volumes, 'young_laplace', GRAVITY), ours=True),
    )


# --- ring round a pressed dome -------------------------------------------------------------------

BATH = 'exact meniscus of a bath'
PRESSURES = (15e3, 40e3, 60e3, 75e3, 90e3)
SHARES = (1e-6, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.75, 0.9)


def ring_problem(progress: Progress) -> Problem:
    """Return pressed domes, from barely touching to nearly flat, with the height of their ring."""
    pressures, shares = (grid.ravel() for grid in np.meshgrid(PRESSURES, SHARES))
    forces = shares * np.array([force_limit(LARGE_PAD, p, 'flattening') for p in pressures])
    domes = press(LARGE_PAD, pressures, forces, adhesion='none')
    heights = []
    for contact, sphere in zip(domes.contact_radius, domes.sphere_radius, strict=True):
        heights.append(bath(float(contact), float(sphere), 1e-11))
        progress(len(heights) / len(pressures))
    return Problem(
        'ring round a pressed dome, height',
        {'contact_radius_m': domes.contact_radius, 'sphere_radius_m': domes.sphere_radius},
        np.array(heights),
        shares > 0.005,
        wrong=math.inf,
    )


def bath(contact: float, sphere: float, rtol: float, liquid: Liquid = WATER) -> float:
    """Return how high a wide bath at floor level climbs a sphere that the floor cuts, m."""
    centre = math.sqrt((sphere - contact) * (sphere + contact))
    return truth(dome(sphere, contact, centre + 0.99 * sphere), liquid, rtol)[0]


def _ring(reading: str) -> Callable[[Any, Any], Any]:
    def solve(contact: Any, sphere: Any) -> Any:
        status = 'ok' if isinstance(contact, float) else np.full(contact.shape, 'ok')
        dome = Pressed(math.nan, math.nan, contact, sphere, math.nan, status)
        return meniscus(dome, WATER, reading).height

    return solve


RING_METHODS = (
    *both('thesis, 3.80', _ring('thesis')),
    *both('corrected', _ring('corrected')),
    Method(BATH, lambda contact, sphere: bath(contact, sphere, 1e-8)),
)
