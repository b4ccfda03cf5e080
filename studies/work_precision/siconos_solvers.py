# SPDX-License-Identifier: Apache-2.0
"""Solve contact problems by siconos: a script for a Python that has it, without ros_pad.

python siconos_solvers.py GIVEN.npz ANSWERS.npz TOLERANCE REPEATS; the study friction_problems
calls it.
"""

from __future__ import annotations

import importlib
import statistics
import sys
import time

import numpy as np

SOLVERS = {
    'siconos NSGS': ('NSGS', 'fc3d_nsgs', 10000),
    'siconos NSN_AC': ('NSN_AC', 'fc3d_nonsmooth_Newton_AlartCurnier', 200),
    'siconos ADMM': ('ADMM', 'fc3d_admm', 10000),
    'siconos TFP': ('TFP', 'fc3d_TrescaFixedPoint', 100),
}
"""Name of the options, function, and most iterations of each solver."""


def solve(
    compliance: np.ndarray, free: np.ndarray, friction: np.ndarray, name: str, tolerance: float
) -> tuple[np.ndarray, int, float]:
    """Return impulses, iterations and time, s."""
    siconos = importlib.import_module('siconos.numerics')
    kind, function, most = SOLVERS[name]
    options = siconos.SolverOptions(getattr(siconos, f'SICONOS_FRICTION_3D_{kind}'))
    options.iparam[siconos.SICONOS_IPARAM_MAX_ITER] = most
    options.dparam[siconos.SICONOS_DPARAM_TOL] = tolerance
    problem = siconos.FrictionContactProblem(3, len(friction), compliance, free, friction)
    impulses, velocity = np.zeros(len(free)), np.zeros(len(free))
    start = time.perf_counter()
    getattr(siconos, function)(problem, impulses, velocity, options)
    taken = time.perf_counter() - start
    return impulses, int(options.iparam[siconos.SICONOS_IPARAM_ITER_DONE]), taken


def main(given: str, answers: str, tolerance: str, repeats: str) -> None:
    """Solve all problems of a file by all solvers."""
    found: dict[str, np.ndarray] = {}
    with np.load(given) as file:
        for index in range(len(file.files) // 3):
            parts = [file[f'{index} {key}'] for key in ('compliance', 'free', 'friction')]
            for name in SOLVERS:
                runs = [
                    solve(*(part.copy() for part in parts), name, 0.1 * float(tolerance))  # type: ignore
                    for _ in range(int(repeats))
                ]
                seconds = statistics.median(each[2] for each in runs)
                found[f'{index} {name} r'] = runs[0][0]
                found[f'{index} {name} s'] = np.array([runs[0][1], seconds])
    np.savez(answers, **found)  # type: ignore[arg-type]


if __name__ == '__main__':
    main(*sys.argv[1:])
