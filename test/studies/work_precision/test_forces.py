# SPDX-License-Identifier: Apache-2.0
"""Study of the solvers of foot forces."""

import numpy as np
import pytest

pytest.importorskip('mujoco')
pytest.importorskip('numba')
from studies.work_precision import forces


def test_more_rounds_are_nearer_to_a_general_solver():
    cases = forces.problems(seeds=1, cycles=8, most=6)
    best = [forces.slsqp(problem) for problem in cases]
    rows = [
        forces.measured('', forces.alternating(rounds, cases[0]), cases, best)
        for rounds in (1, 20)
    ]
    cut, near = (row['largest_error'] for row in rows)
    assert near < 0.03 < 0.3 < cut  # m/s2
    assert max(row['outside_n'] for row in rows) < 1e-9
    plain = np.linalg.solve(cases[0].matrix, cases[0].push)
    assert forces.outside(plain, cases[0].grips) > 0.0
