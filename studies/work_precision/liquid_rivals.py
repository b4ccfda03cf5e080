# SPDX-License-Identifier: Apache-2.0
"""Surface Evolver and YADE's bridges beside ``ros_pad``: rows for ``python -m studies capillary``.

- Arrays of domes: ``wet_surface`` and ``wet_pattern`` against Surface Evolver on a twelfth (or
  an eighth) of a cell with curved facets, extrapolated by Richardson from its two finest meshes;
  what that changes is given as Evolver's own error.
- One pad in a wide bath: Evolver against the exact meniscus, as the methods of ros_pad.
- Bridges between two equal spheres: ``bridge`` and YADE's Laplace-Young solver against quadrature
  of the first integral of the meridian.

Times are processor times; with OPENBLAS_NUM_THREADS=1 all have one thread, as Evolver and YADE
have. Rows of rivals that are not given are those stored in ``docs/charts``.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import json
import math
import pathlib
import re
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from scipy.integrate import quad
from scipy.optimize import brentq

from ros_pad.capillary import Mesh, Wall, wet_pattern, wet_surface
from ros_pad.contact import bridge
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.errors import ConfigError
from ros_pad.pace import Progress
from ros_pad.reports.style import legend
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, SKY, VERMILION
from studies.machine import spent_time
from studies.work_precision import capillary, evolver
from studies.work_precision.capillary import REST, SPHERE

PITCHES = (3.4e-3, 4.4e-3, 6e-3, 9e-3)  # m, in turn hexagonal and square
LIQUIDS = (
    Liquid(0.073, 0.027),
    Liquid(0.073, 0.073, contact_angle=math.radians(30.0)),
    Liquid(0.01, 0.006),
)
SIZES = ((24, 0), (24, 1), (24, 2))  # vertices round a dome, and how often triangles are halved
FINEST = 3  # how often Evolver refines the mesh of the reference
STEPS = (1e-3, 1e-4, 1e-5)  # of YADE's meridian, over the radius
REACH = 8.0  # capillary lengths from a pad to the end of Evolver's bath

OURS, LEVEL = 'wet_surface', 'wet_pattern'
EVOLVER, CURVED = 'Surface Evolver', 'Surface Evolver, curved facets'
PART, WHOLE = ', part of a cell', ', whole cell'
# How often facets are refined, for each way in which Evolver is asked.
WAYS = {EVOLVER + PART: (0, 1, 2, 3), CURVED + PART: (1, 2), EVOLVER + WHOLE: (0, 1, 2)}
WAYS |= {CURVED + WHOLE: (0, 1)}
IN_BATHS = ('minimised', EVOLVER, CURVED)
BATHS = [(EVOLVER, k) for k in range(4)] + [(CURVED, k) for k in (1, 2)]
YADE = 'YADE'
EXACT, CIRCLE = 'bridge, young_laplace', 'bridge, circle'
ARRAY, BATH, BRIDGE = 'arrays of domes', 'pads in a wide bath', 'bridges of spheres'
QUANTITIES = ('height', 'force', 'volume', 'energy')
LOOKS = {
    OURS: (PURPLE, 'D'),
    LEVEL: (GREEN, '^'),
    EVOLVER + PART: (ORANGE, 'P'),
    CURVED + PART: (BLACK, 'p'),
    EVOLVER + WHOLE: (VERMILION, 'X'),
    CURVED + WHOLE: (VERMILION, 's'),
    EXACT: (BLUE, '*'),
    CIRCLE: (SKY, 'o'),
    YADE: (ORANGE, 'v'),
}


@dataclass(frozen=True)
class Array:
    """An array of domes: pitch, m, tension, N/m, contact angle, rad, and Evolver's result.

    ``exact`` has height (m), force (N), volume (m³) and energy (J) of a cell, ``own`` Evolver's
    own relative errors of them.
    """

    kind: str
    pitch: float
    sides: int
    tension: float
    angle: float
    exact: Mapping[str, float]
    own: Mapping[str, float]

    @property
    def liquid(self) -> Liquid:
        """The liquid, with the density of water."""
        return Liquid(self.tension, self.tension, contact_angle=self.angle)

    @property
    def cell(self) -> float:
        """Area of a cell, m²."""
        return self.pitch**2 * (1.0 if self.sides == 4 else math.sqrt(0.75))

    def errors(self, found: Mapping[str, float]) -> dict[str, float]:
        """Return relative errors; of the energy over tension and area of the cell."""
        scale = {**self.exact, 'energy': self.tension * self.cell}
        return {
            name: abs(found[name] - self.exact[name]) / abs(scale[name])
            for name in QUANTITIES
            if name in found
        }


@dataclass(frozen=True)
class Compared:
    """A method on arrays or bridges: median time, ms, and median and largest relative errors."""

    kind: str
    problem: str
    method: str
    size: str
    cases: int
    ms: float
    errors: Mapping[str, tuple[float, float]]


Row = Array | Compared | capillary.Result
Solved = tuple[float, dict[str, float]]  # s, and errors


def add_options(part: argparse.ArgumentParser) -> None:
    """Add the paths of the rivals, and how many cases are compared."""
    part.add_argument(
        '--evolver',
        type=command.program,
        metavar='PROGRAM',
        help='Surface Evolver 2.70 (K. Brakke, free to use and copy), for example evolver-nox-d of'
        ' the Debian package evolver-nox; by default its stored rows are kept (about 3 min more)',
    )
    part.add_argument(
        '--yade',
        type=load_yade,
        metavar='FILE',
        help='examples/capillaryLaplaceYoung/solveLiqBridge.py of github.com/bchareyre/yade-mpi'
        ' (GPL 2); by default its stored rows are kept',
    )
    command.add_count(part, '--arrays', 12, 'how many arrays of domes are compared')


def measure(options: argparse.Namespace, progress: Progress) -> list[Row]:
    """Measure rivals that are given, keep the stored rows of others, and compare our methods."""
    path = command.CHARTS / 'capillary.json'
    kept = stored(path)
    for name in ('evolver', 'yade'):
        if not getattr(options, name):
            print(f'without --{name} its rows are those of {path.name}', file=sys.stderr)
    rows: list[Row] = []
    if options.evolver:
        rows += _evolved(options.evolver, options.arrays, progress)
    else:
        rows += [row for row in kept if _rival(row) in (ARRAY, EVOLVER, CURVED, *WAYS)]
    arrays = [row for row in rows if isinstance(row, Array)][: options.arrays]
    rows += our_arrays(arrays)
    progress(0.9)
    given = bridges()
    rows += our_bridges(given)
    if options.yade:
        rows += yade_bridges(options.yade, given)
    else:
        rows += [row for row in kept if _rival(row) == YADE]
    progress(1.0)
    return rows


def _rival(row: Row) -> str:
    if isinstance(row, Array):
        return ARRAY
    return row.method if isinstance(row, Compared) else row.family


def stored(path: pathlib.Path) -> list[Row]:
    """Return the rows of a file in which rivals or their arrays are."""
    kinds: dict[str, Callable[..., Row]] = {'array': Array, 'compared': Compared}
    rows = json.loads(path.read_text(encoding='utf-8'))['rows']
    found: list[Row] = [kinds[row['kind']](**row) for row in rows if row['kind'] in kinds]
    for row in rows:
        if row['kind'] == 'result' and row['family'] in IN_BATHS:
            cases = [capillary.Case(**case) for case in row['cases']]
            found.append(capillary.Result(**{**row, 'cases': cases}))
    return found


def _summed(problem: str, method: str, size: str, solved: Sequence[Solved]) -> Compared:
    """Return the medians and largest errors of the cases of a method."""
    names = solved[0][1]
    errors = {name: [each[name] for _, each in solved] for name in names}
    return Compared(
        'compared',
        problem,
        method,
        size,
        len(solved),
        1e3 * statistics.median(took for took, _ in solved),
        {name: (statistics.median(each), max(each)) for name, each in errors.items()},
    )


# --- arrays of domes -----------------------------------------------------------------------------


def _evolved(program: str, count: int, progress: Progress) -> list[Row]:
    """Return arrays solved by Evolver, its errors on coarser meshes, and those in baths."""
    wanted = [(pitch, each) for each in LIQUIDS for pitch in PITCHES][:count]
    arrays: list[Array] = []
    runs: dict[tuple[str, int], list[Solved]] = {}
    for number, (pitch, liquid) in enumerate(wanted):
        sides = 4 if number % 2 else 6
        coarse, fine = (
            _cell(program, pitch, sides, liquid, k, CURVED + PART) for k in (FINEST - 1, FINEST)
        )
        exact = {name: (4.0 * fine[name] - coarse[name]) / 3.0 for name in QUANTITIES}
        array = Array('array', pitch, sides, liquid.surface_tension, liquid.angle, exact, {})
        array = dataclasses.replace(array, own=array.errors(fine))
        arrays.append(array)
        for way, levels in WAYS.items():
            for k in levels:
                with contextlib.suppress(ConfigError):  # no surface: one case less in the table
                    found = _cell(program, pitch, sides, liquid, k, way)
                    runs.setdefault((way, k), []).append((found['s'], array.errors(found)))
        progress(0.6 * (number + 1) / len(wanted))
    rows: list[Row] = [
        _summed(ARRAY, method, f'{24 * 2**k} vertices round a dome', solved)
        for (method, k), solved in runs.items()
    ]
    for number, shape in enumerate(capillary.SHAPES):
        rows += [_bath(program, shape, k, family) for family, k in BATHS]
        progress(0.6 + 0.1 * (number + 1))
    return [*arrays, *rows]


def _cell(
    program: str, pitch: float, sides: int, liquid: Liquid, refinements: int, way: str
) -> dict[str, float]:
    """Return Evolver's result for a cell, in SI units, from a level surface at first."""
    cell = pitch**2 * (1.0 if sides == 4 else math.sqrt(0.75))
    task = evolver.Task(
        evolver.Solid.dome(1e3 * SPHERE, 1e3 * REST),
        liquid.angle,
        1e-6 * liquid.density * GRAVITY / liquid.surface_tension,
        1e3 * wet_pattern(_mesh(), liquid, cell, strict=False).height,
        0.5e3 * pitch,
        sides,
        way.endswith(WHOLE),
    )
    return _in_si(evolver.solve(program, task, refinements, way.startswith(CURVED)), liquid)


@functools.cache
def _mesh() -> Mesh:
    return Mesh.dome(SPHERE, REST, 2.9e-3)


def _in_si(found: evolver.Found, liquid: Liquid) -> dict[str, float]:
    return {
        's': found.seconds,
        'height': 1e-3 * found.height,
        'volume': 1e-9 * found.volume,
        'force': 1e-9 * liquid.density * GRAVITY * found.volume,
        'energy': 1e-6 * liquid.surface_tension * found.energy,
    }


def our_arrays(arrays: Sequence[Array]) -> list[Row]:
    """Return the errors of our surfaces of least energy, and of level surfaces."""
    wall = Wall.dome(SPHERE, REST)

    def least(array: Array, sectors: int, halved: int) -> dict[str, float]:
        found = wet_surface(
            wall, array.liquid, array.cell, sectors, halved, square=array.sides == 4
        )
        pull = -float(found.force[2])
        values = (found.mean_height, pull, found.volume, found.energy)
        return dict(zip(QUANTITIES, values, strict=True))

    def level(array: Array) -> dict[str, float]:
        found = wet_pattern(_mesh(), array.liquid, array.cell, strict=False)
        return {'height': found.height, 'volume': found.volume}

    least(arrays[0], *SIZES[0])  # imports are not timed
    rows: list[Row] = []
    for sectors, halved in SIZES:
        solved = [_timed(lambda a: least(a, sectors, halved), a) for a in arrays]  # noqa: B023
        size = f'{sectors * 2**halved} vertices round a dome'
        rows.append(_summed(ARRAY, OURS, size, solved))
    return [*rows, _summed(ARRAY, LEVEL, '200 layers', [_timed(level, a) for a in arrays])]


def _timed(solve: Callable[[Array], dict[str, float]], array: Array) -> Solved:
    begun = spent_time()
    found = solve(array)
    return spent_time() - begun, array.errors(found)


# --- baths ---------------------------------------------------------------------------------------


def _bath(program: str, shape: capillary.Shape, refinements: int, family: str) -> capillary.Result:
    """Return Evolver's errors in a wide bath, on the cases that our minimiser solves."""
    cases = [(tension, ratio) for tension in capillary.TENSIONS for ratio in capillary.RATIOS]
    few = cases[capillary.FEW]
    exact = [capillary.truth(shape, Liquid(t, r * t)) for t, r in few]

    def solve(liquid: Liquid) -> Any:
        weight = liquid.density * GRAVITY
        length = 1e3 * math.sqrt(liquid.surface_tension / weight)
        task = evolver.Task(
            _solid(shape),
            liquid.angle,
            length**-2,
            0.2 * length,
            _solid(shape).radius(0.0) + REACH * length,
            0,
        )
        found = _in_si(evolver.solve(program, task, refinements, family == CURVED), liquid)
        return found['height'], found['force']

    size = f'{24 * 2**refinements} vertices round a pad'
    return capillary.result(shape, family, size, solve, few, exact)


def _solid(shape: capillary.Shape) -> evolver.Solid:
    if shape.name == 'dome':
        return evolver.Solid.dome(1e3 * SPHERE, 1e3 * REST)
    (low, _, slope), (high, *_) = shape.wall.meridian(0.0), shape.wall.meridian(1e-3)
    return evolver.Solid.cone(1e3 * low, 1e3 * (high - low) if slope != 0.5 * math.pi else 0.0)


# --- bridges -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Neck:
    """A bridge between two equal spheres, over their radius and the tension.

    Contact and filling angle in degrees, suction, and by quadrature distance, volume, force over
    2π, and the change of force with distance at this filling angle.
    """

    contact: float
    filling: float
    suction: float
    distance: float
    volume: float
    force: float
    slope: float


def bridges() -> list[Neck]:
    """Return bridges of narrow and wide necks, touching and apart."""
    found = []
    for contact, filling in ((0.0, 5.0), (0.0, 20.0), (20.0, 20.0), (40.0, 10.0), (20.0, 40.0)):
        for share in (0.0, 0.1, 0.25):  # distance over the height of both caps
            caps = 2.0 * (1.0 - math.cos(math.radians(filling)))
            suction = brentq(
                lambda u: quadrature(contact, filling, u)[0] - share * caps,  # noqa: B023
                0.01,
                10.0 / caps,
                xtol=1e-13,
                rtol=1e-14,
            )
            step = 1e-4 * (1.0 + abs(suction))
            low, high = (quadrature(contact, filling, suction + d) for d in (-step, step))
            slope = (high[2] - low[2]) / (high[0] - low[0])
            values = quadrature(contact, filling, suction)
            found.append(Neck(contact, filling, suction, *values, slope))
    return found


def quadrature(contact: float, filling: float, suction: float) -> tuple[float, float, float]:
    """Return distance, volume and force over 2π of a bridge of unit spheres; angles in degrees.

    Along the meridian ``r sin ψ = F - p r²/2`` with the suction p: this and ``dz/dr = tan ψ`` give
    height and volume as integrals over r from the neck outwards, here over the root of r - neck.
    """
    beta, end = math.radians(filling), math.radians(filling + contact)
    edge = math.sin(beta)
    force = edge * math.sin(end) + 0.5 * suction * edge**2
    root = math.sqrt(1.0 + 2.0 * suction * force)
    neck = 2.0 * force / (1.0 + root)

    def rise(s: float) -> float:
        r = neck + s * s
        flat = force - 0.5 * suction * r * r
        # r - flat is (r - neck) times this factor.
        factor = 0.5 * (suction * (r + neck)) + 1.0
        return 2.0 * flat / math.sqrt(factor * (r + flat))

    far = math.sqrt(max(edge - neck, 0.0))
    accuracy: dict[str, Any] = {'epsabs': 1e-14, 'epsrel': 1e-12}
    height = 2.0 * quad(rise, 0.0, far, **accuracy)[0]
    held = 2.0 * math.pi * quad(lambda s: rise(s) * (neck + s * s) ** 2, 0.0, far, **accuracy)[0]
    cap = math.pi / 3.0 * (1.0 - math.cos(beta)) ** 2 * (2.0 + math.cos(beta))
    return height - 2.0 * (1.0 - math.cos(beta)), held - 2.0 * cap, force


def our_bridges(necks: Sequence[Neck]) -> list[Row]:
    """Return errors of ``bridge`` at given filling angle and distance: a plane in the middle."""

    def solve(neck: Neck, method: str) -> Solved:
        known: dict[str, Any] = {'filling_angle': math.radians(neck.filling), 'method': method}
        known |= {'separation': 0.5 * max(neck.distance, 0.0), 'plane_angle': 0.5 * math.pi}
        begun = spent_time()
        found = bridge(1.0, 1.0, math.radians(neck.contact), **known)
        took = spent_time() - begun
        force, volume = float(found.force) / (2.0 * math.pi), 2.0 * float(found.volume)
        return took, {
            'force': abs(force / neck.force - 1.0),
            'volume': abs(volume / neck.volume - 1.0),
        }

    methods = {EXACT: 'young_laplace', CIRCLE: 'circle'}
    solve(necks[0], 'young_laplace')  # imports are not timed
    return [
        _summed(BRIDGE, name, '', [solve(neck, method) for neck in necks])
        for name, method in methods.items()
    ]


def load_yade(path: str) -> Callable[..., Any]:
    """Return YADE's function ``solveLiqBridge``; the file is for Python 2."""
    text = command.present(path).read_text(encoding='utf-8')
    text = re.sub(r'^(\s*)print (.*)$', r'\1print(\2)', text, flags=re.MULTILINE)
    names: dict[str, Any] = {name: getattr(math, name) for name in ('sin', 'cos', 'tan', 'sqrt')}
    names |= {'pi': math.pi, 'numpy': np}
    try:
        exec(compile(text, path, 'exec'), names)
        solve: Callable[..., Any] = names['solveLiqBridge']
    except Exception as error:
        raise ConfigError(
            f'--yade {path}: no function solveLiqBridge there ({type(error).__name__}: {error});'
            ' give solveLiqBridge.py of yade-mpi'
        ) from error
    return solve


def yade_bridges(solve: Callable[..., Any], necks: Sequence[Neck]) -> list[Row]:
    """Return YADE's errors: it takes the suction, and returns distance and volume.

    Its force is exact for this suction, but belongs to another distance; that makes its error.
    """
    rows: list[Row] = []
    for step in STEPS:
        solved = []
        for neck in necks:
            begun = spent_time()
            found = solve(1, neck.contact, neck.suction, neck.filling, step, 0, 0, 0)
            took = spent_time() - begun
            if not found[8]:  # it reports a meridian that has missed its neck
                continue
            moved = neck.slope * (found[0] - neck.distance)
            errors = {
                'force': abs((found[2] - moved) / neck.force - 1.0),
                'volume': abs(found[1] / neck.volume - 1.0),
            }
            solved.append((took, errors))
        if solved:
            rows.append(_summed(BRIDGE, YADE, f'steps of {step:g} radii', solved))
    return rows


# --- table and picture ---------------------------------------------------------------------------


def table(rows: Sequence[Any]) -> str:
    """Return the compared rows as tables of Markdown, with the error of the reference."""
    arrays = [row for row in rows if isinstance(row, Array)]
    compared = [row for row in rows if isinstance(row, Compared)]
    compared += in_baths([row for row in rows if isinstance(row, capillary.Result)])
    lines = []
    for problem, names in (
        (ARRAY, QUANTITIES),
        (BATH, QUANTITIES[:2]),
        (BRIDGE, ('force', 'volume')),
    ):
        part = [row for row in compared if row.problem == problem]
        lines += [f'| {problem} | time | {" | ".join(names)} |', '|---' * (2 + len(names)) + '|']
        for row in part:
            cells = [_shown(row.errors.get(name)) for name in names]
            size = f', {row.size}' if row.size else ''
            lines.append(
                f'| {row.method}{size} ({row.cases}) | {_brief(row.ms)} ms | {" | ".join(cells)} |'
            )
        if problem == ARRAY and arrays:
            own = [[array.own[name] for array in arrays] for name in names]
            cells = [_shown((statistics.median(each), max(each))) for each in own]
            lines.append(f'| the reference itself ({len(arrays)}) | | {" | ".join(cells)} |')
        lines.append('')
    return '\n'.join(lines)


def in_baths(results: Sequence[capillary.Result]) -> list[Compared]:
    """Return the rows of a wide bath, each over pads of all shapes."""
    rows = []
    for family in IN_BATHS:
        part = [each for each in results if each.family == family]
        for size in dict.fromkeys(each.size for each in part):
            solved = [
                (1e-3 * each.ms_per_solve, dict(zip(QUANTITIES, errors, strict=False)))
                for each in part
                if each.size == size
                for errors in capillary.errors(each.cases)
            ]
            method = 'wet_surface' if family == 'minimised' else family + PART
            rows.append(_summed(BATH, method, size, solved))
    return rows


def _brief(value: float) -> str:
    return f'{value:.0f}' if value >= 9.5 else f'{value:.1g}'


def _shown(pair: Sequence[float] | None) -> str:
    """Return median and largest error in percent."""
    if pair is None:
        return '–'
    return ' / '.join(f'{100.0 * each:.2g}' for each in pair) + ' %'


def figures(rows: Sequence[Any]) -> dict[str, Figure]:
    """Return the picture of errors over time, by name."""
    compared = [row for row in rows if isinstance(row, Compared)]
    panels = [(ARRAY, name) for name in QUANTITIES]
    panels += [(BRIDGE, name) for name in ('force', 'volume')]
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(8.4, 5.4), layout='constrained')
        axes = figure.subplots(2, 3).ravel()
        for letter, axis, (problem, name) in zip('abcdef', axes, panels, strict=True):
            axis.set_title(f'{letter}  {problem}: {name}')
            for method, (colour, mark) in LOOKS.items():
                part = [
                    row
                    for row in compared
                    if (row.problem, row.method) == (problem, method) and name in row.errors
                ]
                times = [row.ms for row in part]
                for k, row in enumerate(part):
                    median, worst = row.errors[name]
                    axis.plot([row.ms] * 2, [median, worst], '-_', color=colour, lw=0.8, alpha=0.6)
                    axis.plot(row.ms, median, mark, color=colour, ms=5.5 + 1.2 * k, mew=0.0)
                axis.plot(times, [row.errors[name][0] for row in part], color=colour, lw=0.7)
            axis.set(xscale='log', yscale='log')
            axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.xaxis.set_major_formatter('{x:g}')
            axis.xaxis.set_minor_formatter('')
            axis.grid(color=PALE, alpha=0.3, lw=0.5)
        for axis in axes[::3]:
            axis.set_ylabel('relative error')
        for axis in axes[3:]:
            axis.set_xlabel('processor time of one case / ms')
        handles = [
            matplotlib.lines.Line2D([], [], color=colour, marker=mark, ls='', label=method)
            for method, (colour, mark) in LOOKS.items()
        ]
        legend(figure, handles, 3)
    return {'capillary_rivals': figure}
