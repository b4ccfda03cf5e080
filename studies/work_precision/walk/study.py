# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of a walk: every fidelity level, MuJoCo's defaults, and Drake.

The hexapod walks open loop, its pads at the pressure that a controller would begin with, on the
floors of the shipped scenes. Errors are relative to Drake at 0.1 ms, whose contact has the spring
and the damper of the pads, and again to the mean of it and L2 at 0.1 ms. Drake is needed for it
(pip install drake, mainly BSD-3-Clause). Levels without landing
have films of rigid discs and MuJoCo's own contact, which MuJoCo's defaults have as well.

Without Drake, errors are relative to L2 with steps of 0.25 ms; the row with half of this step
shows the uncertainty of this reference. Without MuJoCo, errors are relative to L1 with steps of
0.25 ms, which does not show the effect of what L1 leaves out. The rail leg is compared with an
event-driven integration of its equations of motion, phase by phase, to 1e-11.

Times are those of the steps alone: making the robot is not timed, nor are requests for the state
of the feet (L2 computes this state in every step, L1 only on request). Drake is stepped from
Python, which writes forces before each step.
"""

from __future__ import annotations

from ros_pad.pace import Progress
from studies.work_precision.walk.chart import figures, table
from studies.work_precision.walk.hexapod import hexapod_walkers, hexapod_walks
from studies.work_precision.walk.rail import EVENTS, LEG, rail_walkers, rail_walks
from studies.work_precision.walk.results import WalkResult, run
from studies.work_precision.walk.walkers import HEXAPOD, RAIL

__all__ = ['figures', 'measure', 'table']


def measure(progress: Progress, cycles: int | None = None) -> list[WalkResult]:
    """Walk every scene with every method; report progress, 0 to 1, to ``progress``.

    ``cycles`` is the number of gait cycles of a walk, that of ``CYCLES`` by default.
    """
    walkers, tops, baseline = hexapod_walkers()
    results = run(
        HEXAPOD, hexapod_walks(), walkers, tops, baseline, lambda done: progress(0.8 * done),
        cycles,
    )  # fmt: skip
    return results + run(
        RAIL, rail_walks(), rail_walkers(), (EVENTS,), LEG,
        lambda done: progress(0.8 + 0.2 * done), cycles,
    )  # fmt: skip
