# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of liquid around one pad, against the exact meniscus of a wide bath.

The reference is computed differently from :mod:`ros_pad.capillary`: the surface, and the volume
below it, are integrated from far away inwards until the surface meets the wall.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp, trapezoid
from scipy.optimize import brentq
from scipy.special import k0e, k1e

from ros_pad.capillary import Mesh, Wall, Wet, WetSurface, bath_meniscus, wet, wet_surface
from ros_pad.contact.meniscus import GRAVITY, WATER, Liquid
from ros_pad.contact.pad import Array
from ros_pad.errors import PadError
from ros_pad.pace import Progress
from studies.machine import spent_time
from studies.work_precision import capillary_chart

Pair = tuple[float, float]  # height, m, and force, N

TENSIONS = (0.004, 0.073)  # N/m: the thesis' highest, and water
RATIOS = (0.3, 0.5, 0.65, 0.8, 0.95)  # tension of the solid over tension of the liquid
# The minimiser is slow, so it solves only these of the ten cases.
FEW = slice(1, None, 4)

BALANCES = ('thesis', 'force', 'energy')
# Layers, slices, rings and sectors of the mesh.
SIZES = ((25, 12, 12, 48), (100, 36, 48, 72), (100, 36, 100, 100), (400, 36, 100, 100))
# Vertices round the pad, and how often triangles are halved.
MINIMISED = ((12, 0), (24, 0), (24, 1))
EXACT = 'exact meniscus'


@dataclass(frozen=True)
class Shape:
    """A round pad as a wall, as a mesh, and as functions for the reference.

    Attributes
    ----------
    name : str
    wall : Wall
    mesh : callable
        Returns the mesh for numbers of rings and sectors.
    outside : callable
        Returns a number for a radius and a height, m: above 0 outside the pad.
    inclination : callable
        Returns the inclination of the wall, rad, at a height, m.
    solid : callable
        Returns the volume of the pad, m³, up to a height, m.
    """

    name: str
    wall: Wall
    mesh: Callable[[int, int], Mesh]
    outside: Callable[[float, float], float]
    inclination: Callable[[float], float]
    solid: Callable[[float], float]


def dome(sphere: float, rest: float, top: float) -> Shape:
    """Return a dome with the radii of its sphere and its contact, cut off at a height, m."""
    centre = math.sqrt((sphere - rest) * (sphere + rest))

    def solid(z: float) -> float:
        return math.pi * (sphere**2 * z + ((centre - z) ** 3 - centre**3) / 3.0)

    return Shape(
        'dome',
        Wall.dome(sphere, rest, top),
        lambda rings, sectors: Mesh.dome(sphere, rest, top, rings, sectors),
        lambda r, z: math.hypot(r, z - centre) - sphere,
        lambda z: math.acos((centre - z) / sphere),
        solid,
    )


def cone(name: str, radius: float, degrees: float, top: float) -> Shape:
    """Return a truncated cone with an inclined wall, degrees; with 90 it is a cylinder."""
    phi = math.radians(degrees)
    lean = math.cos(phi) / math.sin(phi)

    def solid(z: float) -> float:
        above = radius + lean * z
        return math.pi * z * (radius**2 + radius * above + above**2) / 3.0

    return Shape(
        name,
        Wall.cone(radius, phi, top),
        lambda rings, sectors: Mesh.cone(radius, radius + lean * top, top, rings, sectors),
        lambda r, z: r - radius - lean * z,
        lambda z: phi,
        solid,
    )


SHAPES = (
    dome(1.55e-3, 0.583e-3, 2.9e-3),  # that of the reference table
    cone('truncated cone', 1.6e-3, 110.0, 3e-3),
    cone('cylinder', 1.2e-3, 90.0, 4e-3),
)


Row = SimpleNamespace
"""Result of a method on a shape:

- ``shape``, ``family``, ``size``: shape of the pad, family of the method, and its resolution
- ``ms_per_solve``: median time of one case, milliseconds
- ``height_error``, ``force_error``: median relative errors; with ``worst_`` the largest
- ``dry``, ``false``: cases in which liquid does not rise, and the method has no result, or has one
- ``refused``: cases in which liquid rises, and the method has no result
- ``cases``: tension (N/m), ratio of tensions, height (m), force (N), those that are exact, and
  status; without a result, height and force are None, and the status is the reason
"""


def measure(progress: Progress) -> list[Row]:
    """Measure every method on every shape; report progress, 0 to 1, to ``progress``."""
    rows: list[Row] = []
    share = 1.0 / len(SHAPES)
    _minimised(SHAPES[0], *MINIMISED[0])(WATER)  # imports are not timed
    for k, shape in enumerate(SHAPES):
        begin = k * share
        rows += run(shape, lambda done, begin=begin: progress(begin + share * done))  # type: ignore[misc]
    return rows


def figures(rows: list[Row], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name."""
    return {'capillary': capillary_chart.draw(rows)}


# --- truth ---------------------------------------------------------------------------------------


def truth(shape: Shape, liquid: Liquid, rtol: float = 1e-10) -> Pair:
    """Return the height of a wide bath at floor level, m, and the weight of the raised liquid, N.

    The contact angle must be above 0; the result is (0, 0) where the liquid does not rise. The
    surface is integrated in capillary lengths over its slope angle ψ, from far away, where its
    equation is linear, to the wall. The starting distance is found such that the surface meets the
    wall at the contact angle. The force of the liquid on the pad is the weight of the raised
    liquid.
    """
    if math.pi - shape.inclination(0.0) - liquid.angle <= 0.0:
        return 0.0, 0.0
    weight = liquid.density * GRAVITY
    length = math.sqrt(liquid.surface_tension / weight)
    start = shape.wall.meridian(shape.wall.floor)[0] / length

    def rates(log: float, state: Array) -> tuple[float, float, float]:
        psi, (r, z, _) = math.exp(log), state.tolist()
        pull = psi / (z + math.sin(psi) / r)
        inward = math.cos(psi) * pull
        return -inward, math.sin(psi) * pull, 2.0 * math.pi * r * z * inward

    def touch(_: float, state: Array) -> float:
        return shape.outside(length * state[0], length * state[1])

    touch.terminal = True  # type: ignore[attr-defined]

    def meet(distance: float) -> tuple[float, float, float]:
        """Return slope angle minus the required one, height, and raised volume."""
        first, far = 1e-6, start + distance
        height = first * k0e(far) / k1e(far)
        met = solve_ivp(
            rates,
            (math.log(first), math.log(math.pi)),
            # The surface carries the liquid farther out, so its slope here gives that volume.
            (far, height, 2.0 * math.pi * far * first),
            method='DOP853',
            rtol=rtol,
            atol=rtol * min(start, first),
            events=touch,
            dense_output=True,
        )
        if not met.t_events[0].size:
            return math.pi, math.nan, math.nan
        r, z, ring = met.y_events[0][0].tolist()
        wanted = math.pi - shape.inclination(length * z) - liquid.angle
        lifted = length**3 * (ring + math.pi * r**2 * z) - shape.solid(length * z)
        return math.exp(met.t_events[0][0]) - wanted, length * z, lifted

    # Search up to 30 capillary lengths: farther out the surface is flatter than the starting
    # slope of 1e-6.
    distance = brentq(lambda far: meet(far)[0], 1e-3, 30.0, xtol=1e-13, rtol=0.1 * rtol)
    _, height, lifted = meet(distance)
    return height, weight * lifted


# --- methods -------------------------------------------------------------------------------------


def weight_lifted(found: Wet, solid: Callable[[float], float]) -> float:
    """Return the weight of the liquid between the arcs, the floor and a round pad, N.

    By the balances and by the exact meniscus, this is the vertical force on the pad.
    """
    points = found.surface(65)
    r = np.hypot(points[..., 0] - found.axis[0], points[..., 1] - found.axis[1])
    z = points[..., 2]
    inside = math.pi * float(np.mean(trapezoid(r**2, z, axis=1)))
    return found.liquid.density * GRAVITY * (inside - solid(found.mean_height))


def _layers(shape: Shape, balance: str, size: tuple[int, ...]) -> Callable[[Liquid], Any]:
    layers, slices, rings, sectors = size
    mesh = shape.mesh(rings, sectors)
    # The errors of heights that a strict call refuses as far_off are measured, too.
    return lambda liquid: wet(mesh, liquid, balance, layers, slices, strict=False)


def _minimised(shape: Shape, sectors: int, refinements: int) -> Callable[[Liquid], Any]:
    return lambda liquid: wet_surface(shape.wall, liquid, None, sectors, refinements)


def _read(shape: Shape, found: Any) -> tuple[Pair | None, str]:
    """Return height and force, if there are any, and status of a method's result."""
    if isinstance(found, tuple):
        return found, 'ok'
    if isinstance(found, Wet):
        status = str(found.status[0])
        if status != 'ok':
            return None, status
        return (found.mean_height, weight_lifted(found, shape.solid)), status
    if isinstance(found, WetSurface):
        return (found.mean_height, -float(found.force[2])), 'ok'
    if found.status not in ('ok', 'several'):
        return None, found.status
    return (found.height, found.force), found.status


def run(shape: Shape, progress: Progress) -> list[Row]:
    """Measure every method on a shape; report progress, 0 to 1, to ``progress``."""
    cases = [(tension, ratio) for tension in TENSIONS for ratio in RATIOS]
    exact = []
    for tension, ratio in cases:
        exact.append(truth(shape, Liquid(tension, ratio * tension)))
        progress(0.2 * len(exact) / len(cases))
    # Family, size, method, and the cases that it solves.
    methods: list[tuple[str, str, Callable[[Liquid], Any], slice]] = [
        (balance, _worded(size), _layers(shape, balance, size), slice(None))
        for balance in BALANCES
        for size in (SIZES if balance == 'energy' else SIZES[::2])
    ]
    methods += [
        (
            'minimised',
            f'{sectors} sectors, {halved}x halved',
            _minimised(shape, sectors, halved),
            FEW,
        )
        for sectors, halved in MINIMISED
    ]

    def meniscus(liquid: Liquid) -> Any:
        return bath_meniscus(shape.wall, liquid)

    methods.append((EXACT, '', meniscus, slice(None)))
    results = []
    for family, size, solve, which in methods:
        results.append(result(shape, family, size, solve, cases[which], exact[which]))
        progress(0.2 + 0.8 * len(results) / len(methods))
    return results


def _worded(size: tuple[int, ...]) -> str:
    layers, slices, rings, sectors = size
    return f'{layers} × {slices}, {2 * (rings + 1) * sectors} triangles'


def result(
    shape: Shape,
    family: str,
    size: str,
    solve: Callable[[Liquid], Any],
    cases: Sequence[Pair],
    exact: Sequence[Pair],
) -> Row:
    times: list[float] = []
    answers: list[dict[str, Any]] = []
    for (tension, ratio), (height, force) in zip(cases, exact, strict=True):
        liquid = Liquid(tension, ratio * tension)
        begun = spent_time()
        pair: Pair | None = None
        try:
            found = solve(liquid)
        except PadError as error:
            status = str(getattr(error, 'status', type(error).__name__))
        else:
            took = spent_time() - begun
            pair, status = _read(shape, found)
            if pair:
                times.append(1e3 * took)
        given, lifted = pair or (None, None)
        answers.append({
            'tension': tension, 'ratio': ratio, 'height': given, 'force': lifted,
            'exact_height': height, 'exact_force': force, 'status': status,
        })  # fmt: skip
    rising = [case for case in answers if case['exact_height'] > 0.0]
    still = [case for case in answers if case['exact_height'] == 0.0]
    good = errors(answers)
    heights, forces = [each[0] for each in good], [each[1] for each in good]
    return Row(
        shape=shape.name,
        family=family,
        size=size,
        ms_per_solve=statistics.median(times) if times else math.nan,
        height_error=statistics.median(heights) if good else math.nan,
        worst_height_error=max(heights, default=math.nan),
        force_error=statistics.median(forces) if good else math.nan,
        worst_force_error=max(forces, default=math.nan),
        dry=sum(case['height'] is None for case in still),
        refused=len(rising) - len(good),
        false=sum(case['height'] is not None for case in still),
        cases=answers,
    )


def errors(cases: Sequence[dict[str, Any]]) -> list[Pair]:
    """Return the relative errors of height and force where liquid rises and there is a result."""
    return [
        (abs(case['height'] / case['exact_height'] - 1.0),
         abs(case['force'] / case['exact_force'] - 1.0))
        for case in cases
        if case['height'] is not None and case['exact_height'] > 0.0
    ]  # fmt: skip
