# SPDX-License-Identifier: Apache-2.0
"""Work-precision study of a walk: every fidelity level, against the finest.

The hexapod walks open loop, its pads at the pressure that a controller would begin with, on the
floors of the shipped scenes. Errors are relative to L2 with steps of 0.25 ms; the row with half of
this step shows the uncertainty of this reference. Without MuJoCo, errors are relative to L1 with
steps of 0.25 ms, which does not show the effect of what L1 leaves out. The rail leg is compared
with an event-driven integration of its equations of motion, phase by phase, to 1e-11.

Times are those of the steps alone: making the robot is not timed, nor are requests for the state
of the feet (L2 computes this state in every step, L1 only on request).

Of the laws in studies.work_precision.friction, the hexapod walks only with the elastic one. The
study stability compares the others.
"""

from __future__ import annotations

from ros_pad.pace import Progress
from studies.work_precision.walk.chart import figures
from studies.work_precision.walk.chart import table
from studies.work_precision.walk.hexapod import hexapod_walkers
from studies.work_precision.walk.hexapod import hexapod_walks
from studies.work_precision.walk.rail import EVENTS
from studies.work_precision.walk.rail import LEG
from studies.work_precision.walk.rail import rail_walkers
from studies.work_precision.walk.rail import rail_walks
from studies.work_precision.walk.results import WalkResult
from studies.work_precision.walk.results import run
from studies.work_precision.walk.walkers import HEXAPOD
from studies.work_precision.walk.walkers import RAIL

__all__ = ['figures', 'measure', 'table']


def measure(progress: Progress) -> list[WalkResult]:
    """Walk every scene at every fidelity level; report progress, 0 to 1, to ``progress``."""
    walkers, top, baseline = hexapod_walkers()
    hexapod = run(
        HEXAPOD, hexapod_walks(), walkers, top, baseline, lambda done: progress(0.85 * done)
    )
    rail = run(
        RAIL, rail_walks(), rail_walkers(), EVENTS, LEG, lambda done: progress(0.85 + 0.15 * done)
    )
    return hexapod + rail
