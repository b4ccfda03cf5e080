# SPDX-License-Identifier: Apache-2.0
"""Surface Evolver, a rival of ``ros_pad.capillary``: input files, runs and results.

Lengths are in mm, energies in the liquid's tension times mm². One pad stands in the middle of a
cell, or of a wide bath, whose outer walls are vertical symmetry planes. By symmetry a part of it
is enough. The liquid is connected to a bath at floor level. Wetted wall, and volume and weight of
the liquid below an overhanging wall, are line integrals along the contact line.
"""

from __future__ import annotations

import math
import pathlib
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ros_pad.errors import ConfigError
from studies.machine import spent_time

FINE = 6  # order of the quadrature along edges and on facets: 12 changes no digit of seven
LIMIT = 900.0  # s for one run


@dataclass(frozen=True)
class Solid:
    """A pad of revolution, lengths in mm, as Evolver takes it.

    Attributes
    ----------
    formula : str
        The wall, as an equation of x, y and z.
    radius : callable
        Radius at a height.
    wet, raised, moment : str
        Integrals from the floor to z, for each radian of azimuth: area of the wall, and of z' and
        z'²/2 over the floor that the wall covers.
    """

    formula: str
    radius: Callable[[float], float]
    wet: str
    raised: str
    moment: str

    @classmethod
    def dome(cls, sphere: float, rest: float) -> Solid:
        """Return a dome, with the radii of its sphere and of its contact, mm."""
        c = math.sqrt(sphere**2 - rest**2)
        return cls(
            f'x^2 + y^2 + (z - {c!r})^2 = {sphere**2!r}',
            lambda z: math.sqrt(sphere**2 - (z - c) ** 2),
            f'{sphere!r}*z',
            f'{c!r}*z^2/2 - z^3/3',
            f'{c!r}*z^3/6 - z^4/8',
        )

    @classmethod
    def cone(cls, rest: float, lean: float) -> Solid:
        """Return a truncated cone; its radius, ``rest`` mm at the floor, grows by ``lean`` z."""
        return cls(
            f'sqrt(x^2 + y^2) = {rest!r} + {lean!r}*z',
            lambda z: rest + lean * z,
            f'{math.hypot(1.0, lean)!r}*({rest!r}*z + {lean!r}*z^2/2)',
            f'{lean!r}*({rest!r}*z^2/2 + {lean!r}*z^3/3)',
            f'{lean!r}*({rest!r}*z^3/6 + {lean!r}*z^4/8)',
        )


@dataclass(frozen=True)
class Task:
    """A surface to be found: a pad, its liquid, and the walls around it.

    Attributes
    ----------
    solid : Solid
    angle : float
        Contact angle, rad.
    weight : float
        Density times gravity over tension, 1/mm².
    start : float
        First guess of the height of the contact line, mm.
    outer : float
        Distance of the walls from the axis of the pad, mm.
    sides : int
        Number of these walls, 4 or 6; 0 for a round one.
    whole : bool
        Whether the whole cell is solved, or the part of it that symmetry leaves.
    """

    solid: Solid
    angle: float
    weight: float
    start: float
    outer: float
    sides: int = 6
    whole: bool = False

    @property
    def turn(self) -> float:
        """Azimuth of the part that is solved, rad."""
        return 2.0 * math.pi if self.whole else math.pi / (self.sides or 6)


@dataclass(frozen=True)
class Found:
    """A result in mm: mean height of the line, volume and energy of the whole cell; and s."""

    facets: int
    height: float
    volume: float
    energy: float
    seconds: float


def solve(program: str, task: Task, refinements: int, quadratic: bool = False) -> Found:
    """Run Surface Evolver on a task, from two rows of facets, refined so many times.

    With ``quadratic`` facets are curved in the end, which is Evolver's own way to more digits.

    Raises
    ------
    ConfigError
        When the program cannot be run, takes too long, or does not converge.
    """
    show = 'printf "FOUND %d %.15g %.15g %.15g %.15g\\n", facet_count, line.value,'
    show += ' above.value + under.value, total_energy, total_energy - last\n'
    # The shortest steps with which as many cases converge as with many more.
    first = 'u; g 30; hessian_seek; hessian_seek; hessian_seek; hessian; hessian;'
    finer = 'r; u; g 10; hessian_seek; hessian_seek; hessian;'
    lines = [*datafile(task), 'read', first, *[finer] * refinements]
    lines += ['M 2; hessian; hessian; hessian;'] if quadratic else []
    lines += ['last := total_energy; hessian;', show, 'q', '']
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / 'task.fe'
        path.write_text('\n'.join(lines), encoding='ascii')
        begun = spent_time()
        try:
            ran = subprocess.run(
                [program, '-x', path],
                input='q\nq\n',
                capture_output=True,
                text=True,
                timeout=LIMIT,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise ConfigError(f'--evolver {program}: {error}') from error
        took = spent_time() - begun
    said = [line.split() for line in ran.stdout.splitlines() if line.startswith('FOUND')]
    if not said or not abs(float(said[-1][5])) < 1e-7:
        tail = ' / '.join((ran.stdout + ran.stderr).strip().splitlines()[-3:])
        raise ConfigError(f'--evolver {program} has found no surface: {tail}')
    facets, line, volume, energy = (float(word) for word in said[-1][1:5])
    parts = 2.0 * math.pi / task.turn
    return Found(int(facets), line / task.turn, parts * volume, parts * energy, took)


def datafile(task: Task) -> Iterator[str]:
    """Yield the lines of Evolver's input file, without commands."""
    solid, cosine, heavy = task.solid, math.cos(task.angle), repr(task.weight)
    yield f'integral_order {FINE}'
    yield 'parameter last = 0'
    walls = [f'constraint 1\nformula: {solid.formula}']
    s, c = math.sin(task.turn), math.cos(task.turn)
    walls += [f'constraint 2\nformula: y\nconstraint 3\nformula: {s!r}*x - {c!r}*y']
    if task.sides:
        for k in range(task.sides):
            at = 2.0 * math.pi * k / task.sides
            x, y = math.cos(at), math.sin(at)
            walls += [f'constraint {4 + k}\nformula: {x!r}*x + {y!r}*y = {task.outer!r}']
    else:
        walls += [f'constraint 4\nformula: x^2 + y^2 = {task.outer**2!r}']
    yield from walls
    for name, kind, up in (('weight', 'energy', f'{heavy}*z^2/2'), ('above', 'info_only', 'z')):
        yield f'quantity {name} {kind} method facet_vector_integral global'
        yield f'vector_integrand:\nq1: 0\nq2: 0\nq3: {up}'
    along = [('wall', 'energy', f'{heavy}*({solid.moment}) - ({cosine!r})*({solid.wet})')]
    along += [('under', 'info_only', solid.raised), ('line', 'info_only', 'z')]
    for name, kind, rate in along:  # rates over azimuth
        yield f'quantity {name} {kind} method edge_vector_integral'
        yield f'vector_integrand:\nq1: -y/(x^2 + y^2)*({rate})\nq2: x/(x^2 + y^2)*({rate})\nq3: 0'
    yield from _mesh(task)


def _mesh(task: Task) -> Iterator[str]:
    """Yield vertices, edges and facets of the first surface: rows of vertices around the pad."""
    columns = round(task.turn / (math.pi / 12.0))
    across = math.sqrt(1.0 / task.weight) if task.weight else math.inf
    inner = task.solid.radius(task.start)
    # In a wide bath rows grow outwards.
    rows = 2 if task.sides else 6
    steps = [1.0 if task.sides else 2.0**k for k in range(rows)]
    shares = [sum(steps[:k]) / sum(steps) for k in range(rows + 1)]
    around = columns if task.whole else columns + 1
    vertices: list[str] = []
    edges: dict[tuple[int, int], tuple[int, str]] = {}

    def held(row: int, column: int) -> list[int]:
        on = [1] if row == 0 else []
        if not task.whole:
            on += [2] if column == 0 else [3] if column == columns else []
        if row == rows:
            on += outside(column)
        return on

    def outside(column: int) -> list[int]:
        """Return the constraints of a vertex on the outer walls: two at a corner."""
        if not task.sides:
            return [4]
        side = column * task.turn / columns * task.sides / (2.0 * math.pi)
        low, high = math.ceil(side - 0.5 - 1e-9), math.floor(side + 0.5 + 1e-9)
        both = [low, high] if task.whole and low != high else [low]
        return [4 + k % task.sides for k in both]

    def vertex(row: int, column: int) -> int:
        return row * around + column % around + 1

    def edge(a: int, b: int, words: str = '') -> int:
        if (b, a) in edges:
            return -edges[b, a][0]
        return edges.setdefault((a, b), (len(edges) + 1, words))[0]

    for row in range(rows + 1):
        for column in range(around):
            at = column * task.turn / columns
            sector = 2.0 * math.pi / task.sides if task.sides else 0.0
            off = (at + 0.5 * sector) % sector - 0.5 * sector if sector else 0.0
            r = inner + shares[row] * (task.outer / math.cos(off) - inner)
            z = task.start * (1.0 if task.sides else math.exp((inner - r) / across))
            on = ' '.join(map(str, held(row, column)))
            words = f' constraints {on}' if on else ''
            vertices.append(f'{r * math.cos(at)!r} {r * math.sin(at)!r} {z!r}{words}')
    for column in range(columns):
        edge(vertex(0, column), vertex(0, column + 1), ' constraint 1 wall under line')
        middle = set(outside(column)) & set(outside(column + 1))
        edge(vertex(rows, column), vertex(rows, column + 1), f' constraint {middle.pop()}')
    for row in range(0 if task.whole else rows):
        edge(vertex(row, 0), vertex(row + 1, 0), ' constraint 2')
        edge(vertex(row, columns), vertex(row + 1, columns), ' constraint 3')
    faces = []
    for row in range(rows):
        for column in range(columns):
            a, b = vertex(row, column), vertex(row, column + 1)
            c, d = vertex(row + 1, column), vertex(row + 1, column + 1)
            pair = ((a, c, d), (a, d, b)) if (row + column) % 2 else ((a, c, b), (b, c, d))
            faces += [[edge(t[k], t[(k + 1) % 3]) for k in range(3)] for t in pair]
    yield 'vertices'
    yield from (f'{k} {each}' for k, each in enumerate(vertices, start=1))
    yield 'edges'
    yield from (f'{k} {a} {b}{words}' for (a, b), (k, words) in edges.items())
    yield 'faces'
    yield from (f'{k} {" ".join(map(str, each))}' for k, each in enumerate(faces, start=1))
