# SPDX-License-Identifier: Apache-2.0
"""Compare solvers that share a wrench over the standing feet, within their cones of friction.

The problems are those of the gait with balance where a force left its cone, in walks of the
shipped go2 on wet patches. The error is that of the body's acceleration, m/s², in the norm of its
inertia, from an interior-point solver of second-order cones (Clarabel, 1e-10). Needs
`pip install clarabel quadprog`. Writes forces.json.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.optimize import minimize

from ros_pad.simulation import balance_step, compiled
from ros_pad.simulation.balance_step import DAMPING, GRIP
from ros_pad.simulation.full_robot import FullRobot
from studies import command
from studies.closed_loop.gaits import PERIOD, scene_of


class Problem(NamedTuple):
    """Forces f, N, with the least f·(matrix f/2 - push) within cones of friction are wanted."""

    given: tuple[Any, ...]  # arguments of balance_step.fit but the result
    matrix: np.ndarray
    push: np.ndarray
    grips: np.ndarray
    columns: np.ndarray  # acceleration for each force, m/s2, in the norm of inertia


Solver = Callable[[Problem], np.ndarray]


def problems(seeds: int, cycles: int, most: int) -> list[Problem]:
    """Walk, and return problems in which a force of least squares alone leaves its cone."""
    found: list[Problem] = []
    fit, chosen = balance_step.fit, compiled.worth_loading

    def noted(plan: Any, feet: Any, columns: Any, mean: float, push: Any, force: Any) -> None:
        fit(plan, feet, columns, mean, push, force)
        lines = np.reshape(columns, (len(force), 6))
        matrix = lines @ lines.T + DAMPING / plan.mass * np.eye(len(force))
        given = plan, np.array(feet), np.array(columns), mean, np.array(push)
        problem = Problem(given, matrix, given[-1], given[1][GRIP], lines / plan.mass**0.5)
        if outside(np.linalg.solve(matrix, push), problem.grips) > 1e-6:
            found.append(problem)

    balance_step.fit = noted
    compiled.worth_loading = lambda *_: False  # compiled steps would not see it
    try:
        for seed in command.each(range(seeds), 'walking', 'walk'):
            scene = scene_of('go2', (), 'wet patches', cycles)
            robot = FullRobot(scene, scene.floor.build(seed), PERIOD)
            while robot.time < scene.duration and not robot.verdict:
                robot.step([0.0] * len(robot.legs))
    finally:
        balance_step.fit, compiled.worth_loading = fit, chosen
    return found[:: max(1, len(found) // most)]


def outside(force: np.ndarray, grips: np.ndarray) -> float:
    """Return by how much, N, a force leaves its cone at most."""
    x, y, z = force.reshape(-1, 3).T
    return float(np.max(np.hypot(x, y) - grips * np.maximum(z, 0.0)))


# --- solvers -------------------------------------------------------------------------------------


def alternating(rounds: int, first: Problem) -> Solver:
    """Return the solver of the gait with so many rounds; one is least squares cut to the cones."""
    import numba

    compiled.dispatcher(balance_step)  # makes its functions known to numba
    fit: Any = numba.njit(error_model='numpy')(balance_step.fit)
    usual = balance_step.ROUNDS
    balance_step.ROUNDS = rounds
    fit(*first.given, np.zeros(len(first.push)))  # it is compiled with this number
    balance_step.ROUNDS = usual

    def solve(problem: Problem) -> np.ndarray:
        force = np.zeros(len(problem.push))
        fit(*problem.given, force)
        return force

    return solve


def slsqp(problem: Problem) -> np.ndarray:
    """Solve by SciPy's sequential quadratic programming."""
    matrix, push, grips = problem.matrix, problem.push, problem.grips

    def room(force: np.ndarray) -> np.ndarray:
        x, y, z = force.reshape(-1, 3).T
        return np.concatenate([z, (grips * z) ** 2 - x * x - y * y])

    found = minimize(
        lambda f: 0.5 * f @ matrix @ f - push @ f,
        np.tile((0.0, 0.0, 30.0), len(grips)),
        jac=lambda f: matrix @ f - push,
        constraints={'type': 'ineq', 'fun': room},
        method='SLSQP',
    )
    return np.asarray(found.x)


def pyramids(sides: int) -> Solver:
    """Return a dense active-set solver (quadprog) with pyramids inside of the cones."""
    import quadprog

    turns = 2.0 * np.pi * np.arange(sides) / sides
    walls = np.column_stack([-np.cos(turns), -np.sin(turns)])

    def solve(problem: Problem) -> np.ndarray:
        legs = len(problem.grips)
        rows = np.zeros((legs, sides, legs, 3))
        for leg, grip in enumerate(problem.grips):
            rows[leg, :, leg, :2], rows[leg, :, leg, 2] = walls, grip * np.cos(np.pi / sides)
        flat = rows.reshape(-1, 3 * legs)
        ends = np.zeros(len(flat))
        return np.asarray(quadprog.solve_qp(problem.matrix, problem.push, flat.T, ends)[0])

    return solve


def cones(accuracy: float) -> Solver:
    """Return an interior-point solver with the cones themselves (Clarabel)."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = accuracy

    def solve(problem: Problem) -> np.ndarray:
        size = len(problem.push)
        upper = sparse.csc_matrix(np.triu(problem.matrix))
        rows = np.zeros((size, size))
        for leg, grip in enumerate(problem.grips):
            at = 3 * leg
            rows[at, at + 2], rows[at + 1, at], rows[at + 2, at + 1] = -grip, -1.0, -1.0
        kinds = [clarabel.SecondOrderConeT(3)] * (size // 3)
        solver = clarabel.DefaultSolver(
            upper, -problem.push, sparse.csc_matrix(rows), np.zeros(size), kinds, settings
        )
        return np.array(solver.solve().x)

    return solve


# --- the study -----------------------------------------------------------------------------------


def measured(
    name: str, solver: Solver, cases: Sequence[Problem], best: list[Any]
) -> dict[str, Any]:
    """Return time and error of a solver over all problems."""
    times, errors, over = [], [], []
    for problem, truth in zip(cases, best, strict=True):
        start = time.perf_counter()
        force = solver(problem)
        times.append(1e6 * (time.perf_counter() - start))
        errors.append(float(np.linalg.norm((force - truth) @ problem.columns)))
        over.append(outside(force, problem.grips))
    return {
        'solver': name,
        'time_us': float(np.median(times)),
        'median_error': float(np.median(errors)),
        'largest_error': max(errors),
        'outside_n': max(over),
    }


def main(words: Sequence[str] | None = None) -> int:
    """Run the study; return the exit status."""
    part = command.parser('forces', __doc__)
    command.add_count(part, '--cycles', 40, 'gait cycles of a walk')
    command.add_count(part, '--seeds', 8, 'walks')
    command.add_count(part, '--most', 300, 'problems, about')
    command.add_out(part)
    args = part.parse_args(words)
    cases = problems(args.seeds, args.cycles, args.most)
    solvers = {
        **{
            f'alternating directions, {n} rounds': alternating(n, cases[0])
            for n in (1, 5, 10, 20, 40)
        },
        'SLSQP (SciPy)': slsqp,
        'quadprog, 4 sides': pyramids(4),
        'quadprog, 8 sides': pyramids(8),
        'Clarabel, 1e-6': cones(1e-6),
    }
    best = [cones(1e-10)(problem) for problem in command.each(cases, 'references', 'problem')]
    rows = [measured(*row, cases, best) for row in command.each([*solvers.items()], 'solving', '')]
    document = {'problems': len(cases), 'rows': rows}
    title = f'{len(cases)} problems; errors in m/s², forces outside of cones in N'
    command.show(args, command.write(args.out, 'forces', document), command.listed(rows, title))
    return 0
