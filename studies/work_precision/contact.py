# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of the contact model: free and pressed dome by many methods.

The reference has at least 30 digits and is computed differently from :mod:`ros_pad.contact.dome`:
the free dome by bisection of equation 3.60 of the thesis, the pressed dome by continuation. For
this, the root of 3.58 is followed from the free dome to each force in small steps, so that it
stays on the physical branch.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve

from ros_pad.contact import LARGE_PAD, force_limit, inflate, press
from ros_pad.contact.pad import Array
from ros_pad.errors import NoEquilibrium
from ros_pad.pace import Progress
from studies.drawing import GREEN, PALE, VERMILION
from studies.work_precision import comparison, measured
from studies.work_precision.comparison import Method, Problem, Result, both, run

PAD = LARGE_PAD
BASELINE = 'fsolve, good start'
_R, _K, _ADHESION = PAD.radius, PAD.stiffness, PAD.adhesion_energy
# Relative distance of a good start from the root.
_GOOD = 1.03

# The sample includes extremes: free domes that are nearly flat or nearly burst, pressed domes at
# 1e-9 N, near flattening, and near the pressure at which the dome model ends (the cusp).
FREE_PRESSURES = (
    *(1.0, 100.0, 1e3, 5e3, 15e3, 25e3, 35e3, 45e3, 55e3, 65e3, 75e3, 85e3, 95e3),
    *(105e3, 115e3, 125e3, 135e3, 145e3, 155e3, 159e3, 159.9e3, 159.99e3, 159.999e3),
)
PRESSURES = (5e3, 15e3, 30e3, 50e3, 65e3, 75e3, 85e3, 90e3, 91.3e3)
SHARES = (
    *(0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    *(0.95, 0.99, 0.999),
)  # of the force that flattens the pad
FORCES = (1e-9, 1e-6, 1e-4)  # N


def measure(progress: Progress) -> list[Result]:
    """Measure free dome, pressed dome and gap; report progress, 0 to 1, to ``progress``."""
    problem = free_problem()
    methods = _free_methods(problem)
    free = run(problem, methods, BASELINE, lambda done: progress(0.4 * done / len(methods)))
    problem, starts = pressed_problem(lambda share: progress(0.4 + 0.2 * share))
    others = _pressed_methods(starts)
    pressed = run(problem, others, BASELINE, lambda done: progress(0.6 + 0.3 * done / len(others)))
    model = run(gap_problem(), GAP_METHODS, QUADRATURE, lambda done: progress(0.9 + 0.015 * done))
    question, laws = measured.problem()
    world = run(question, laws, laws[0].name, lambda done: progress(0.97 + 0.005 * done))
    return free + pressed + model + world


def figures(results: list[Result], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the pictures by name: the chart, and the map of where methods fail."""
    maps = failure_maps(progress=progress)
    return {'contact': figure(results), 'contact_failures': draw_maps(maps)}


def figure(results: list[Result]) -> Figure:
    """Return the chart: times and errors of the methods, and below errors of the laws."""
    above, below = comparison.inches(results), 4.3
    whole = Figure(figsize=(comparison.WIDTH, above + below), layout='constrained')
    parts: Any = whole.subfigures(2, 1, height_ratios=(above, below))
    comparison.draw(results, parts[0])
    measured.draw(parts[1])
    return whole


# --- free dome -----------------------------------------------------------------------------------


def free_problem() -> Problem:
    """Return the sample of free domes with their heights."""
    pressures = np.array(FREE_PRESSURES)
    heights = []
    with mpmath.workdps(40):
        # Radius and stiffness are read as decimal numbers, because the last bit of their binary
        # values matters near bursting.
        radius, stiffness = mpmath.mpf(str(_R)), mpmath.mpf(str(_K))
        for pressure in FREE_PRESSURES:
            tension = mpmath.mpf(pressure) * radius / stiffness
            low, high = mpmath.mpf(0), mpmath.pi / 2
            for _ in range(130):
                t = (low + high) / 2
                if 6 * mpmath.sin(t) - 2 * mpmath.sin(2 * t) < tension:
                    low = t
                else:
                    high = t
            heights.append(float(radius * mpmath.tan(low)))
    return Problem(
        'free dome',
        {'pressure_pa': pressures},
        np.array(heights),
        (pressures >= 5e3) & (pressures <= 125e3),
    )


def _free_residual(height: Any, pressure: float) -> Any:
    """Return the residual of the appendix' equation (7.2.1)."""
    squared = _R * _R + height * height
    return pressure * squared / (2.0 * height) - 2.0 * _K * (1.5 * squared**0.5 - _R) / _R


def _free_mpmath(pressure: float) -> float:
    with mpmath.workdps(32):
        return float(mpmath.findroot(lambda height: _free_residual(height, pressure), _R))


def _free_fsolve(pressure: float, start: float) -> float:
    root, _, ended, _ = fsolve(
        lambda height: _free_residual(height[0], pressure), start, full_output=True
    )
    return float(root[0]) if ended == 1 else math.nan


def _free_brentq(pressure: float) -> float:
    return float(brentq(_free_residual, 1e-7, 0.05, args=(pressure,), xtol=1e-16))


def _free_methods(problem: Problem) -> tuple[Method, ...]:
    starts = dict(zip(problem.inputs['pressure_pa'].tolist(), problem.truth * _GOOD, strict=True))
    return (
        Method('mpmath, as vpasolve', _free_mpmath),
        Method('fsolve, start at the pad radius', lambda p: _free_fsolve(p, _R)),
        Method(BASELINE, lambda p: _free_fsolve(p, starts[p])),
        Method('brentq', _free_brentq),
        *both('inflate', lambda p: inflate(PAD, p).height),
    )


# --- pressed dome --------------------------------------------------------------------------------


def _one_unknown(height: Any, pressure: Any, force: Any, root: Callable[[Any], Any]) -> Any:
    """Return the residual of 3.58 in the height alone, with the depth from 3.53 and 3.48."""
    sphere = (_R * _R + height * height) / (2 * height)
    squared = (force / math.pi + 2 * _ADHESION * sphere) / pressure
    depth = squared / (sphere + root(sphere * sphere - squared))
    stretch = root(_R * _R + height * height - depth * depth) / _R
    pull = 2 * _K * (height + depth) * (1.5 * stretch - 1)
    return pressure / 2 * (squared + depth**2 + _R**2 + height**2) - pull - force / math.pi


def _two_unknowns(pressure: Any, force: Any, root: Callable[[Any], Any]) -> Callable[..., Any]:
    """Return the residuals of the appendix' equations 1 and 2 (7.2.2) in depth and height."""

    def residuals(depth: Any, height: Any) -> list[Any]:
        sphere = (_R * _R + height * height) / (2 * height)
        squared = (force + 2 * _ADHESION * math.pi * sphere) / (pressure * math.pi)
        bent = 1.5 * root(_R * _R + height * height - depth * depth) - _R
        return [
            sphere - root(sphere * sphere - squared) - depth,
            pressure * math.pi / 2 * (squared + depth**2 + _R**2 + height**2)
            - 2 * _K * math.pi * (height + depth) * bent / _R
            - force,
        ]

    return residuals


@dataclass(frozen=True)
class Start:
    """Depth and height, m, at which a method for one case starts."""

    depth: float
    height: float


def pressed_problem(progress: Progress) -> tuple[Problem, dict[tuple[float, float], Start]]:
    """Return the sample of pressed domes with their heights, and a good start for each."""
    cases, heights, starts = [], [], {}
    for number, pressure in enumerate(PRESSURES):
        flattening = force_limit(PAD, pressure, 'flattening')
        forces = [*FORCES, *(share * flattening for share in SHARES)]
        followed = follow(pressure, forces, flattening)
        for force, (depth, height) in zip(forces, followed, strict=True):
            cases.append((pressure, force, force / flattening))
            heights.append(height)
            starts[pressure, force] = Start(_GOOD * depth, _GOOD * height)
        progress((number + 1) / len(PRESSURES))
    pressures, loads, shares = np.array(cases).T
    ordinary = (pressures > 1e4) & (pressures < 86e3) & (shares > 0.04) & (shares < 0.91)
    inputs = {'pressure_pa': pressures, 'force_n': loads}
    return Problem('pressed dome', inputs, np.array(heights), ordinary), starts


def follow(pressure: float, forces: list[float], end: float) -> list[tuple[float, float]]:
    """Return depth and height at each force, by continuation from the free dome with 30 digits."""
    # The steps decrease towards the end, where the height changes fastest.
    path = sorted({*forces, *(end * (1.0 - 0.87**n) for n in range(1, 45))})
    reached: dict[float, tuple[float, float]] = {}
    with mpmath.workdps(30):
        # _one_unknown divides the force by math.pi, which has only 16 digits.
        correction = mpmath.mpf(math.pi) / mpmath.pi
        height, step = mpmath.mpf(inflate(PAD, pressure).height), mpmath.mpf(10) ** -9
        for force in (force for force in path if force <= max(forces)):
            load = force * correction

            def residual(x: Any, load: Any = load) -> Any:
                return _one_unknown(x, mpmath.mpf(pressure), load, mpmath.sqrt)

            # More force gives less height, so the root is the first one below the last height.
            high = height * (1 + mpmath.mpf(10) ** -3 * (not reached))
            low = high * (1 - step)
            while residual(low) <= 0:
                low *= 1 - step
                step *= mpmath.mpf('1.3')
            last, height = high, mpmath.findroot(residual, (low, high), solver='anderson')
            step = (1 - height / last) / 4
            sphere = (_R * _R + height * height) / (2 * height)
            squared = (load / math.pi + 2 * _ADHESION * sphere) / pressure
            depth = squared / (sphere + mpmath.sqrt(sphere * sphere - squared))
            reached[force] = (float(depth), float(height))
    return [reached[force] for force in forces]


def _pressed_mpmath(pressure: float, force: float) -> float:
    start = (0.1 * _R, inflate(PAD, pressure).height)
    with mpmath.workdps(32):
        root = mpmath.findroot(_two_unknowns(pressure, force, mpmath.sqrt), start)
        # A complex root counts as no root.
        return float(root[1]) if mpmath.im(root[1]) == 0 else math.nan


def _pressed_fsolve(pressure: float, force: float, start: Start) -> float:
    residuals = _two_unknowns(pressure, force, math.sqrt)
    root, _, ended, _ = fsolve(
        lambda unknown: residuals(*unknown.tolist()), (start.depth, start.height), full_output=True
    )
    return float(root[1]) if ended == 1 else math.nan


def _pressed_brentq(pressure: float, force: float) -> float:
    free = inflate(PAD, pressure).height
    low = 1e-3 * free
    # Start at the lowest height at which the contact exists.
    while math.isnan(_residual_or_nan(low, pressure, force)) and low < free:
        low *= 1.5
    return float(
        brentq(_one_unknown, low, 1.01 * free, args=(pressure, force, math.sqrt), xtol=1e-17)
    )


def _residual_or_nan(height: float, pressure: float, force: float) -> float:
    try:
        return float(_one_unknown(height, pressure, force, math.sqrt))
    except ValueError:
        return math.nan


def _pressed_methods(starts: dict[tuple[float, float], Start]) -> tuple[Method, ...]:
    cold = Start(1e-4, 1e-3)
    return (
        Method('mpmath, as vpasolve', _pressed_mpmath),
        Method('fsolve, start at 0.1 and 1 mm', lambda p, f: _pressed_fsolve(p, f, cold)),
        Method(BASELINE, lambda p, f: _pressed_fsolve(p, f, starts[p, f])),
        Method('brentq, one unknown', _pressed_brentq),
        *both('press', lambda p, f: press(PAD, p, f).height),
    )


# --- error of the spherical cap ------------------------------------------------------------------

QUADRATURE = 'membrane, quadrature and brentq'


def gap_problem() -> Problem:
    """Return pressed pads with the gap under the exact membrane of the same energy."""
    pressures, shares = (each.ravel() for each in np.meshgrid(PRESSURES, SHARES))
    forces = shares * math.pi * _R * _R * pressures
    gaps = [membrane_gap(*case) for case in zip(pressures.tolist(), forces.tolist(), strict=True)]
    return Problem(
        'gap, against the exact membrane',
        {'pressure_pa': pressures, 'force_n': forces},
        np.array(gaps),
        (pressures > 1e4) & (pressures < 86e3) & (shares > 0.04) & (shares < 0.91),
        wrong=math.inf,
    )


def membrane_gap(pressure: float, force: float) -> float:
    """Return the gap, m, from the integrals of a wall of constant mean curvature."""
    tension, share = pressure * _R / _K, force / (pressure * math.pi * _R * _R)

    def wall(rim: float) -> tuple[float, float]:
        """Return gap over pad radius and misfit of the tension for the wall's angle at the rim."""
        curve = 0.5 * (1.0 - share) / math.sin(rim)

        def radii(angle: float) -> tuple[float, float]:
            width = math.hypot(curve * math.sin(angle), math.sqrt(share))
            return curve * math.sin(angle) + width, width

        def rise(angle: float) -> float:
            radius, width = radii(angle)
            return curve * radius / width * math.sin(angle)

        def area(angle: float) -> float:
            radius, width = radii(angle)
            return 2.0 * curve * radius / width * radius

        # Near the floor the wall curves within a distance of the contact radius.
        bend = min(math.sqrt(share) / curve, 0.5 * rim)
        rules = {'epsabs': 0.0, 'epsrel': 1e-10, 'limit': 200, 'points': (bend, 0.5 * rim)}
        stretch = math.sqrt(share + quad(area, 0.0, rim, **rules)[0])
        return quad(rise, 0.0, rim, **rules)[0], 1.5 * stretch - 1.0 - tension * curve

    rim = brentq(lambda rim: wall(rim)[1], 1e-4, math.pi - 1e-4, xtol=1e-15, rtol=1e-14)
    return _R * wall(rim)[0]


GAP_METHODS = (
    Method(QUADRATURE, membrane_gap),
    *both('press, membrane', lambda p, f: press(PAD, p, f, model='membrane').gap),
    *both('press, spherical cap', lambda p, f: press(PAD, p, f, 'none').gap),
)


# --- where methods fail --------------------------------------------------------------------------

RIGHT, COARSE, WRONG, INVENTED, REFUSED = range(5)
_MEANING = {
    RIGHT: ('right', GREEN),
    COARSE: ('off by up to 1 %', '#B8DE9C'),
    WRONG: ('a wrong root, without a warning', VERMILION),
    INVENTED: ('an answer where there is none', '#E69F00'),
    REFUSED: ('no answer, or a warning', '#DDDDDD'),
}


@dataclass(frozen=True)
class FailureMap:
    """Outcomes of a method on a grid of pressure and force.

    Attributes
    ----------
    method : str
    pressures : (n,) Pa
    shares : (m,) force over pressure times area of the pad
    outcome : (m, n) of RIGHT, COARSE, WRONG, INVENTED, REFUSED
    """

    method: str
    pressures: Array
    shares: Array
    outcome: np.ndarray[Any, np.dtype[np.int8]]


def failure_maps(size: int = 54, progress: Progress | None = None) -> list[FailureMap]:
    """Return the outcomes of methods on a grid of pressure and force.

    Progress, 0 to 1, is reported to ``progress``. The reference is :func:`press`, which
    :func:`measure` compares with a reference of 30 digits.
    """
    methods: list[tuple[str, Callable[[float, float], float]]] = [
        ('mpmath, as vpasolve', _pressed_mpmath),
        ('fsolve, start at 0.1 and 1 mm', lambda p, f: _pressed_fsolve(p, f, Start(1e-4, 1e-3))),
        ('brentq, one unknown', _pressed_brentq),
        ('press', lambda p, f: press(PAD, p, f).height),
    ]
    maps = []
    for number, (name, solve) in enumerate(methods):
        # Multiprecision takes milliseconds for each point, so its grid is coarser.
        points = size // 2 if 'mpmath' in name else size
        pressures, shares = np.linspace(2e3, 100e3, points), np.linspace(0.02, 1.1, points)
        outcome = np.empty((points, points), dtype=np.int8)
        for row, share in enumerate(shares):
            forces = share * math.pi * _R * _R * pressures
            truth = press(PAD, pressures, forces).height
            for column in range(points):
                outcome[row, column] = _outcome(
                    solve, float(pressures[column]), float(forces[column]), truth[column]
                )
            if progress is not None:
                progress((number + (row + 1) / points) / len(methods))
        maps.append(FailureMap(name, pressures, shares, outcome))
    return maps


def _outcome(
    solve: Callable[[float, float], float], pressure: float, force: float, truth: float
) -> int:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        try:
            height = solve(pressure, force)
        except (ArithmeticError, ValueError, NoEquilibrium, Warning):
            return REFUSED
    if math.isnan(height):
        return REFUSED
    if math.isnan(truth):
        return INVENTED
    error = abs(height / truth - 1.0)
    return RIGHT if error < 1e-6 else COARSE if error < 0.01 else WRONG


def draw_maps(maps: list[FailureMap]) -> Figure:
    """Return the picture of where each method is right, is wrong, or has no result."""
    figure = Figure(figsize=(9.6, 7.0), layout='constrained')
    colours = ListedColormap([colour for _, colour in _MEANING.values()])
    above, below = figure.subfigures(2, 1, height_ratios=[12, 1], squeeze=False)[:, 0]
    grid = above.subplots(2, len(maps) // 2, sharex=True, sharey=True)
    panels = grid.ravel()
    edge = PAD.stiffness / PAD.radius
    pressures = np.linspace(2e3, 91.3e3, 200)
    limit = force_limit(PAD, pressures, 'flattening') / (math.pi * _R * _R * pressures)
    for panel, each in zip(panels, maps, strict=True):
        panel.pcolormesh(
            each.pressures / 1e3, each.shares, each.outcome, cmap=colours, vmin=-0.5, vmax=4.5
        )
        panel.plot(pressures / 1e3, limit, color='black', lw=0.8)
        panel.axvline(3.426 * edge / 1e3, color='black', lw=0.8, ls=':')
        panel.set(title=each.method, xlim=(0.0, 100.0), ylim=(0.0, 1.1))
        panel.title.set_fontsize(10)
    panels[-1].text(
        96.0, 0.5, 'history decides', rotation=90, ha='center', va='center', fontsize=8
    )
    panels[-1].text(45.0, 1.05, 'flattened', ha='center', va='center', fontsize=8)
    for panel in grid[-1]:
        panel.set_xlabel('gauge pressure, kPa')
    for panel in grid[:, 0]:
        panel.set_ylabel('force / (pressure × area of the pad)')
    seen = np.unique(np.concatenate([np.unique(each.outcome) for each in maps]))
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor=PALE, label=text)
        for outcome, (text, colour) in _MEANING.items()
        if outcome in seen
    ]
    handles += [
        Line2D([], [], color='black', lw=0.8, label='contact reaches the rim'),
        Line2D([], [], color='black', lw=0.8, ls=':', label='the dome model ends'),
    ]
    below.legend(handles=handles, loc='center', ncol=3, frameon=False)
    return figure
