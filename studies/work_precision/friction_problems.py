# SPDX-License-Identifier: Apache-2.0
"""Solve contact problems of other groups by exact_stick in an outer loop, and by siconos.

Give folders or files of:

- siconos/siconos (Apache-2.0), numerics/src/FrictionContact/test/data: Rover*.dat, and
  Capsules-i125-1213.hdf5, which needs h5py
- Simple-Robotics/ContactBench (BSD-2), tests/python/data: sliding_cube.npz, 2cubes_t0.npz

Other files of a folder are left out. Problems of the legged bodies of ros_pad's scenes are always
added. With ``--siconos PYTHON``, a Python that has siconos (Debian: python3-siconos, then
/usr/bin/python3) solves the same problems by published methods. Writes friction_problems.json.

A problem is: find impulses r and velocities u = W r + q such that each contact sticks, slides
against its friction, or opens. W is divided by its mean diagonal, so that impulses are in m/s. The
residual is the natural map |r - P(r - u - μ|u_t| n)|/|q|, P the projection on the friction cones
(De Saxcé and Feng 1998; the measure of siconos).
"""

from __future__ import annotations

import argparse
import importlib
import itertools
import math
import pathlib
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import nnls

from ros_pad.errors import InvalidInput
from ros_pad.simulation.planar_robot import GRAVITY
from ros_pad.simulation.scene import LeggedBody, Scene
from studies import command
from studies.samples import share_interval
from studies.work_precision.friction import RigidStep, least_energy, least_in_ball

SOLVED = 1e-6
"""Residual up to which a problem counts as solved."""

OUTER, SWEEPS, MEMORY = 200, 200, 5
"""Most steps of the outer loop, most sweeps of exact_stick in each, and steps that mixing uses."""

INEXACT = 1e-2
"""Error of velocity that exact_stick may leave in a step, over the residual sought."""

FREE, NEAR = 1e-14, 1e-6
"""Weight, over the largest compliance, of a change of the normals from those of the last step.
Where contacts may share a load in several ways, only the second keeps them from jumping."""

FILES = ('Rover*.dat', 'Capsules*.hdf5', 'sliding_cube.npz', '2cubes_t0.npz')
LEVERS = (0.5, 1.0, 1.5, 2.0, 3.0)
"""μ h/a to which the body of the first of :data:`SCENES` is raised; see :func:`lever`."""

SCENES = ('hexapod_patches', 'quadruped_patches')
LOOPS = {
    'loop, any loads': (FREE, False),
    'loop, near loads': (NEAR, False),
    'loop, near, mixed': (NEAR, True),
}
"""Weight of a change of the normals, and whether steps are mixed, of each outer loop."""

RIVALS = {
    'siconos NSGS': 'block Gauss-Seidel on cones',
    'siconos NSN_AC': 'Newton of Alart and Curnier',
    'siconos ADMM': 'alternating directions',
    'siconos TFP': 'fixed point on caps, contacts pressed and pulled at once',
}


# --- problems ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Problem:
    """Contacts in one step; each has three rows: normal, then two tangents.

    Attributes
    ----------
    name : str
        Name of the file without its ending, or of the scene with a number.
    compliance : ndarray, shape (3 n, 3 n)
        Velocity for each impulse, with a mean diagonal of 1.
    free : ndarray, shape (3 n,)
        Velocity without impulses, m/s.
    friction : ndarray, shape (n,)
        Coefficients of friction.
    """

    name: str
    compliance: np.ndarray
    free: np.ndarray
    friction: np.ndarray

    @classmethod
    def of(cls, name: str, compliance: Any, free: Any, friction: Any) -> Problem:
        """Return a problem with its compliance divided by the mean diagonal."""
        friction, free = np.asarray(friction, float).ravel(), np.asarray(free, float).ravel()
        size = 3 * len(friction)
        matrix = np.asarray(compliance, float)
        if matrix.shape != (size, size) or free.shape != (size,):
            raise InvalidInput(
                f'{name} has a matrix of {matrix.shape}, {free.size} velocities and'
                f' {friction.size} coefficients of friction: {size} rows and columns are needed'
            )
        return cls(name, matrix / np.mean(np.diag(matrix)), free, friction)

    @cached_property
    def symmetric(self) -> np.ndarray:
        """Symmetric part of the compliance."""
        return 0.5 * (self.compliance + self.compliance.T)

    def residual(self, impulses: np.ndarray) -> float:
        """Return the residual of impulses: 0 at a solution, 1 or less without impulses."""
        velocity = self.compliance @ impulses + self.free
        r, u = impulses.reshape(-1, 3), velocity.reshape(-1, 3).copy()
        u[:, 0] += self.friction * np.hypot(u[:, 1], u[:, 2])
        miss = r - in_cones(r - u, self.friction)
        return float(np.linalg.norm(miss) / np.linalg.norm(self.free))


def in_cones(points: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Return the nearest points, shape (n, 3), inside the friction cones."""
    normal, size = points[:, 0], np.hypot(points[:, 1], points[:, 2])
    on = np.maximum((normal + friction * size) / (1.0 + friction**2), 0.0)
    share = friction * on / np.where(size > 0.0, size, 1.0)
    inside = (size <= friction * normal)[:, None]
    return np.where(inside, points, np.column_stack([on, share[:, None] * points[:, 1:]]))


def read(path: pathlib.Path) -> Problem:
    """Return the problem of a file.

    Raises
    ------
    InvalidInput
        When the file cannot be read as its ending says.
    """
    readers = {'.dat': _read_dat, '.hdf5': _read_hdf5, '.npz': _read_npz}
    if path.suffix not in readers:
        raise InvalidInput(f'{path}: its ending must be one of {", ".join(readers)}')
    try:
        return Problem.of(path.stem, *readers[path.suffix](path))
    except (OSError, ValueError, IndexError, KeyError) as error:
        raise InvalidInput(f'{path} is no contact problem: {error}') from error


def _read_dat(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read siconos' text: dimension, contacts, storage, matrix by columns, velocity, friction."""
    words = path.read_text(encoding='utf-8').split()
    dimension, count, storage, size = (int(word) for word in words[:4])
    if dimension != 3 or storage != 0:
        raise ValueError(f'dimension {dimension}, storage {storage}: 3 and 0 are needed')
    values = np.array(words[7 : 7 + size * size + size + count], float)
    matrix, free, friction = np.split(values, [size * size, size * size + size])
    return matrix.reshape(size, size, order='F'), free, friction


def _read_hdf5(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read an FCLIB file: a matrix compressed by columns (-1) or rows (-2), velocity, friction."""
    try:
        h5py = importlib.import_module('h5py')
    except ImportError as error:
        raise InvalidInput(f'{path}: h5py is needed to read it (pip install h5py)') from error
    with h5py.File(path) as file:
        local = file['fclib_local']
        starts, rows, values = (local['W'][key][()] for key in 'pix')
        matrix = np.zeros((len(starts) - 1, len(starts) - 1))
        columns = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        matrix[rows, columns] = values
        by_rows = int(local['W/nz'][()][0]) == -2
        free, friction = local['vectors/q'][()], local['vectors/mu'][()]
        return matrix.T if by_rows else matrix, free, friction


def _read_npz(path: pathlib.Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read ContactBench's arrays, where the normal is the last of three rows."""
    with np.load(path) as file:
        matrix, free, friction = file['G'], file['g'], file['mus']
    order = np.arange(len(matrix)).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    return matrix[np.ix_(order, order)], free.ravel()[order], friction


def found(paths: Sequence[pathlib.Path]) -> list[Problem]:
    """Return the problems of files, and of the :data:`FILES` in folders."""
    files = []
    for path in paths:
        inside = [sorted(path.glob(pattern)) for pattern in FILES] if path.is_dir() else [[path]]
        if not any(inside):
            raise InvalidInput(f'{path} has none of the files {", ".join(FILES)}')
        files += list(itertools.chain(*inside))
    return [read(file) for file in files]


def standing(
    name: str,
    body: LeggedBody,
    feet: Sequence[int],
    friction: np.ndarray,
    rng: np.random.Generator,
) -> Problem:
    """Return a step of 4 ms of a legged body on rigid feet whose legs work against each other.

    A flat body has half of its moment of inertia about either horizontal axis. It moves forward at
    up to 0.1 m/s, and the feet move against it at up to 0.1 m/s by their gait.
    """
    dt, rows, free = 0.004, [], []
    weight = np.r_[np.full(3, 1.0 / body.mass), 2.0 / body.inertia, 2.0 / body.inertia,
                   1.0 / body.inertia]  # fmt: skip
    twist = np.array([rng.uniform(0.0, 0.1), 0.0, -GRAVITY * dt, 0.0, 0.0, 0.0])
    for foot in feet:
        arm = np.array([*body.homes[foot], -body.height])
        imposed = np.array([0.0, *rng.uniform(-0.1, 0.1, 2)])
        for axis, motion in zip(np.roll(np.eye(3), 1, axis=0), imposed, strict=True):
            row = np.r_[axis, np.cross(arm, axis)]
            rows.append(row)
            free.append(row @ twist + motion)
    arms = np.array(rows)
    return Problem.of(name, arms * weight @ arms.T, free, friction)


def lever(body: LeggedBody, friction: float) -> float:
    """Return how far friction tilts a body: μ h/a, with a the mean distance of its feet."""
    return friction * body.height / float(np.mean(np.hypot(*np.transpose(body.homes))))


def tall(count: int, seed: int) -> list[Problem]:
    """Return problems of the first scene with its body raised to each of :data:`LEVERS`."""
    rng, problems = np.random.default_rng(seed), []
    body = Scene.load(SCENES[0]).body
    assert isinstance(body, LeggedBody)
    for ratio in LEVERS:
        raised = replace(body, height=body.height * ratio / lever(body, 0.8))
        for number in range(count):
            name = f'μh/a {ratio:g} {number}'
            friction = rng.choice([0.8, 0.12], 3)
            problems.append(standing(name, raised, (0, 2, 4), friction, rng))
    return problems


def own(count: int, seed: int) -> list[Problem]:
    """Return problems of the :data:`SCENES`: dry, wet and mixed feet, on a tripod and on all."""
    rng, problems = np.random.default_rng(seed), []
    for name in SCENES:
        scene = Scene.load(name)
        assert isinstance(scene.body, LeggedBody)
        foot, legs, dry = scene.foot, len(scene.body.homes), _dry(scene)
        for number in range(count):
            feet = range(0, legs, 2) if legs == 6 and number % 2 else range(legs)
            friction = rng.choice([dry, foot.boundary_friction], len(feet))
            title = f'{name} on {len(feet)} feet {number}'
            problems.append(standing(title, scene.body, feet, friction, rng))
    return problems


def _dry(scene: Scene) -> float:
    """Return the friction of a flat foot on dry ground at the expected load."""
    load = scene.expected_load
    return scene.foot.resistance_of(0.0, load, 0.0, 0.0, 0.0) / load


def _largest_lever(scene: Scene) -> float:
    assert isinstance(scene.body, LeggedBody)
    return lever(scene.body, _dry(scene))


# --- exact_stick in an outer loop ----------------------------------------------------------------


class _CappedStep(RigidStep):
    """Contacts with given caps and any symmetric compliance, as a step of exact_stick.

    Every contact has a third row that nothing moves, as a foot without a turning radius has.
    """

    def __init__(
        self, compliance: np.ndarray, free: np.ndarray, caps: np.ndarray, tolerance: float
    ) -> None:
        self._limits = caps.tolist()
        self.mass = 1.0  # of the mean compliance
        self._left = SWEEPS
        count = len(caps)
        self._matrix, self._free_slip = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
        self._turns, places = [], np.arange(3 * count).reshape(-1, 3)[:, :2]
        for first, (one, two) in enumerate(places):
            # In the main directions of its own compliance an impulse moves a contact along itself.
            block = slice(2 * first, 2 * first + 2)
            self._turns.append(np.linalg.eigh(compliance[block, block])[1])
            self._free_slip[one : two + 1] = self._turns[-1].T @ free[block]
        turn = np.zeros((2 * count, 2 * count))
        for first, each in enumerate(self._turns):
            turn[2 * first : 2 * first + 2, 2 * first : 2 * first + 2] = each
        flat = places.ravel()
        self._matrix[np.ix_(flat, flat)] = turn.T @ compliance @ turn
        self._at_first = self._free_slip.tolist()
        self._stiff = np.where(np.diag(self._matrix) > 0.0, np.diag(self._matrix), 1.0)
        self._rate = float(np.linalg.eigvalsh(self._matrix)[-1])
        self._allowed = 0.5 * tolerance**2 + 1e-16 * float(caps.sum()) ** 2
        self.gap = 0.0

    @property
    def rate(self) -> float:
        return self._rate

    def settled(self, impulses: Sequence[float]) -> bool:
        """Return whether the gap is small enough, or :data:`SWEEPS` are used up.

        The next step of the outer loop goes on from there.
        """
        self._left -= 1
        return super().settled(impulses) or self._left < 0

    def slips(self, impulses: Sequence[float]) -> list[float]:
        return (self._matrix @ np.asarray(impulses) + self._free_slip).tolist()

    def sweep(self, impulses: Sequence[float]) -> list[float]:
        after = np.array(impulses)
        slip = self._matrix @ after + self._free_slip
        for place, limit in self.blocks():
            block = slice(place, place + 3)
            stiff = self._stiff[block]
            pulls = list(zip(slip[block] - stiff * after[block], stiff, strict=True))
            better = np.array(least_in_ball(pulls, limit))
            slip += self._matrix[:, block] @ (better - after[block])
            after[block] = better
        return after.tolist()

    def turned(self, tangents: np.ndarray) -> list[float]:
        """Return rows of impulses for tangents, shape (n, 2)."""
        rows = [[*(turn.T @ each), 0.0] for turn, each in zip(self._turns, tangents, strict=True)]
        return list(itertools.chain(*rows))

    def tangents(self, impulses: Sequence[float]) -> np.ndarray:
        """Return tangents, shape (n, 2), of rows of impulses."""
        rows = np.reshape(impulses, (-1, 3))[:, :2]
        return np.array([turn @ row for turn, row in zip(self._turns, rows, strict=True)])


@dataclass
class Answer:
    """What a method found.

    Attributes
    ----------
    impulses : ndarray
        Impulses, m/s.
    steps, sweeps : int
        Iterations of the method, and sweeps of exact_stick in them.
    why : str
        Why it stopped before the problem was solved; empty if it did not.
    """

    impulses: np.ndarray
    steps: int
    sweeps: int
    why: str


class _Loop:
    """The two halves of the outer loop: tangents by exact_stick, normals by least squares."""

    def __init__(self, problem: Problem, near: float) -> None:
        self.problem, self.sweeps = problem, 0
        size = len(problem.free)
        self.normal = np.arange(0, size, 3)
        self.tangent = np.arange(size).reshape(-1, 3)[:, 1:]
        inside = problem.symmetric[np.ix_(self.normal, self.normal)]
        values, vectors = np.linalg.eigh(inside)
        self._near = near * values[-1]
        root = np.sqrt(np.maximum(values, 0.0) + self._near)
        self._root, self._inverse = root[:, None] * vectors.T, vectors.T / root[:, None]

    def press(self, impulses: np.ndarray) -> np.ndarray:
        """Return normal impulses of contacts that can only press, with given tangents."""
        lagged, normal = impulses.copy(), self.normal
        lagged[normal] = 0.0
        push = self._free(impulses)[normal] + self.problem.symmetric[normal] @ lagged
        push -= self._near * impulses[normal]
        return np.asarray(nnls(self._root, -self._inverse @ push, maxiter=50 * len(normal))[0])

    def pull(self, normals: np.ndarray, impulses: np.ndarray, error: float) -> np.ndarray:
        """Return all impulses, with tangents by exact_stick for the caps of given normals.

        The error allowed is that of the velocities, over the norm of those without impulses.
        """
        after, caps = np.zeros(len(impulses)), self.problem.friction * normals
        after[self.normal] = normals
        holding = caps > 0.0
        if holding.any():
            flat = self.tangent[holding].ravel()
            matrix = self.problem.symmetric
            free = (self._free(impulses) + matrix @ after)[flat]
            tolerance = error * float(np.linalg.norm(self.problem.free))
            step = _CappedStep(matrix[np.ix_(flat, flat)], free, caps[holding], tolerance)
            first = step.in_balls(step.turned(impulses[flat].reshape(-1, 2)))
            rows, sweeps = least_energy(step, first, 2 * SWEEPS, 'gauss_seidel')
            self.sweeps += sweeps
            after[flat] = step.tangents(rows).ravel()
        return after

    def _free(self, impulses: np.ndarray) -> np.ndarray:
        """Return free velocities, and what is not symmetric in W times impulses."""
        uneven = self.problem.compliance - self.problem.symmetric
        return np.asarray(self.problem.free + uneven @ impulses)


def outer_loop(problem: Problem, near: float = NEAR, mixed: bool = False) -> Answer:
    """Solve a problem by exact_stick with the caps of given normals, and normals in turn.

    Each step begins with the normals of the last, as L1 takes the loads of a step from the
    horizontal forces of the one before; mixed, it begins with normals from the last few steps,
    such that their changes would cancel (Anderson 1965), and never below 0. The weight ``near``
    of a change of the normals does not move the solution (Rockafellar 1976).
    """
    loop, impulses = _Loop(problem, near), np.zeros(len(problem.free))
    normals = loop.press(impulses)
    tried: list[np.ndarray] = []
    became: list[np.ndarray] = []
    best, least = impulses, problem.residual(impulses)
    for step in range(1, OUTER + 1):
        try:
            impulses = loop.pull(normals, impulses, INEXACT * SOLVED)
            after = loop.press(impulses)
        except RuntimeError as error:
            return Answer(best, step, loop.sweeps, f'normals: {error}')
        residual = problem.residual(impulses)
        if residual < least:
            best, least = impulses, residual
        if residual <= SOLVED:
            return Answer(impulses, step, loop.sweeps, '')
        tried, became = [*tried[-MEMORY:], normals], [*became[-MEMORY:], after]
        normals = _mix(tried, became) if mixed else after
    return Answer(best, OUTER, loop.sweeps, f'residual still {least:.1e} after {OUTER} steps')


def _mix(tried: Sequence[np.ndarray], became: Sequence[np.ndarray]) -> np.ndarray:
    """Return the next normals by Anderson's mixing."""
    change = np.array(became) - np.array(tried)
    if len(change) == 1:
        return became[-1]
    shares = np.linalg.lstsq(np.diff(change, axis=0).T, change[-1], rcond=1e-10)[0]
    return np.maximum(became[-1] - shares @ np.diff(np.array(became), axis=0), 0.0)


# --- the study -----------------------------------------------------------------------------------


def by_siconos(problems: Sequence[Problem], python: str, repeats: int) -> dict[str, list[Any]]:
    """Return, by method, impulses, steps and time, s, of siconos in a process of its own."""
    script = pathlib.Path(__file__).with_name('siconos_solvers.py')
    with tempfile.TemporaryDirectory() as folder:
        given, answers = pathlib.Path(folder) / 'given.npz', pathlib.Path(folder) / 'answers.npz'
        arrays: dict[str, Any] = {}
        for index, each in enumerate(problems):
            arrays |= {
                f'{index} {key}': getattr(each, key) for key in ('compliance', 'free', 'friction')
            }
        np.savez(given, **arrays)
        words = [python, str(script), str(given), str(answers), str(SOLVED), str(repeats)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            raise InvalidInput(
                f'{python} cannot run siconos.numerics: {done.stderr.strip().splitlines()[-1:]};'
                ' install python3-siconos (Debian) and give its Python, or leave --siconos out'
            )
        with np.load(answers) as file:
            return {
                name: [
                    (file[f'{index} {name} r'], *file[f'{index} {name} s'].tolist())
                    for index in range(len(problems))
                ]
                for name in RIVALS
            }


def run(problems: Sequence[Problem], python: str | None, repeats: int) -> dict[str, Any]:
    """Return the document: for each problem its size, and what each method found."""
    rows: list[dict[str, Any]] = []
    theirs = by_siconos(problems, python, repeats) if python else {}
    for problem in command.each(problems, 'friction_problems', 'problem'):
        methods: dict[str, Any] = {}
        for name, (near, mixed) in LOOPS.items():
            times = []
            for _ in range(repeats if len(problem.friction) < 50 else 1):
                start = time.perf_counter()
                answer = outer_loop(problem, near, mixed)
                times.append(time.perf_counter() - start)
            methods[name] = _found(problem, answer.impulses, answer.steps, float(np.median(times)))
            methods[name] |= {'sweeps': answer.sweeps, 'why': answer.why}
        rows.append({
            'name': problem.name,
            'contacts': len(problem.friction),
            'friction': [float(problem.friction.min()), float(problem.friction.max())],
            'asymmetry': float(abs(problem.compliance - problem.symmetric).max()),
            'methods': methods,
        })  # fmt: skip
    for name, answers in theirs.items():
        for row, problem, (impulses, steps, seconds) in zip(rows, problems, answers, strict=True):
            row['methods'][name] = _found(problem, impulses, int(steps), seconds)
    return {'solved': SOLVED, 'repeats': repeats, 'rows': rows}


def _found(problem: Problem, impulses: np.ndarray, steps: int, seconds: float) -> dict[str, Any]:
    residual = problem.residual(impulses) if np.isfinite(impulses).all() else math.inf
    return {'residual': residual, 'steps': steps, 'seconds': seconds, 'solved': residual <= SOLVED}


def grouped(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the figures of each method by kind of problem: a name without its number."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        kind = 'Rover' if row['name'].startswith('Rover') else row['name']
        groups.setdefault(kind.rpartition(' ')[0] or kind, []).append(row)
    found = []
    for name, group in groups.items():
        counts = [row['contacts'] for row in group]
        for method in group[0]['methods']:
            each = [row['methods'][method] for row in group]
            solved = sum(one['solved'] for one in each)
            found.append({
                'problems': name,
                'count': len(group),
                'contacts': [min(counts), max(counts)],
                'method': method,
                'solved': solved,
                'interval': share_interval(solved, len(group)),
                'steps': [float(np.median([one['steps'] for one in each])),
                          max(one['steps'] for one in each)],
                'residual': max(one['residual'] for one in each),
                'seconds': float(np.median([one['seconds'] for one in each])),
            })  # fmt: skip
    return found


def table(document: dict[str, Any]) -> str:
    """Return the table of the documentation: a row for each kind of problem.

    A cell has the number solved with its 95 % interval in %, median and largest number of steps,
    and the median time.
    """
    methods = list(dict.fromkeys(each['method'] for each in document['kinds']))
    lines = [f'| problems, contacts | {" | ".join(methods)} |', '|---' * (len(methods) + 1) + '|']
    for name in dict.fromkeys(each['problems'] for each in document['kinds']):
        kind = [each for each in document['kinds'] if each['problems'] == name]
        few, many = kind[0]['contacts']
        head = f'{name}, {few if few == many else f"{few} to {many}"}'
        lines.append(f'| {head} | {" | ".join(map(_cell, kind))} |')
    return '\n'.join(lines)


def _cell(kind: dict[str, Any]) -> str:
    low, high = (100.0 * end for end in kind['interval'])
    interval = f' ({low:.0f} to {high:.0f})' if kind['count'] > 1 else ''
    middle, most = kind['steps']
    steps = f'{middle:.0f}, {most}' if kind['count'] > 1 else f'{most}'
    return (
        f'{kind["solved"]} of {kind["count"]}{interval}; {steps}; {1e3 * kind["seconds"]:.2g} ms'
    )


def main(words: Sequence[str]) -> int:
    """Solve, print and write."""
    parser = command.parser('friction_problems', __doc__)
    parser.add_argument('paths', type=command.present, nargs='*', metavar='PATH')
    parser.add_argument(
        '--siconos', type=command.program, metavar='PYTHON', help='an interpreter that has siconos'
    )
    command.add_count(parser, '--own', 40, 'problems of each scene and of each lever')
    command.add_count(parser, '--repeats', 3, 'how often each is timed; the median counts')
    command.add_count(parser, '--seed', 0, 'seed of the problems of scenes', least=0)
    command.add_out(parser)
    options: argparse.Namespace = parser.parse_args(words)
    made = own(options.own, options.seed) + tall(options.own, options.seed)
    problems = [*found(options.paths), *made]
    # The rows of a problem are kept for problems of others only, which a reader can look up.
    levers = {name: _largest_lever(Scene.load(name)) for name in SCENES}
    document = {'seed': options.seed, 'levers': levers}
    document |= run(problems, options.siconos, options.repeats)
    document['kinds'] = grouped(document['rows'])
    document['rows'] = document['rows'][: len(problems) - len(made)]
    kept = command.write(options.out, 'friction_problems', document)
    command.show(options, kept, table(document))
    return 0
