# SPDX-License-Identifier: Apache-2.0
"""Measure time and errors of all methods of simulating walks."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import asdict, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ros_pad.errors import PadError
from ros_pad.pace import Progress
from studies.work_precision.walk.walkers import Walk, Walked, Walker

FAILED = 0.1  # relative error of distance or slip above which a walk has failed
LEAST = 0.01  # share of the stride: errors of shorter distances are relative to this share


WalkResult = SimpleNamespace
"""Results of a walker.

- ``robot``, ``method``, ``family``; ``step_s``: time step, s, None if the method chooses it
- ``ms_per_second``, ``us_per_step``: median computing time of a simulated second, ms, and of a
  step, us; on L2 of a step of MuJoCo
- ``versus``: time of a simulated second over that of the baseline, median over walks of the ratio
- ``baseline``, ``top``: names of the walkers that times and errors are relative to
- ``errors``, ``worst``: median and largest relative error of ``distance`` and ``slip``, of walks
  without a verdict; else NaN
- ``second``: name of a second reference, or again ``top``
- ``mean_errors``: median errors relative to the mean of both references
- ``failures``, ``slip_failures``: walks whose distance, or slip path, is off by more than 10 %, or
  that have no valid result; ``refused``: those that ended with a verdict or an error
- ``cases``, ``cycles``: number of walks, and of gait cycles of each
- ``walks``: each walk, with its results and the relative error of its distance
- ``ours``: whether the method belongs to ros_pad
"""

MEASURES = ('distance', 'slip')


def run(
    robot: str,
    walks: Sequence[Walk],
    walkers: Sequence[Walker],
    tops: Sequence[str],
    baseline: str,
    progress: Progress,
    cycles: int | None = None,
) -> list[WalkResult]:
    """Measure each walker; ``tops``, one or two, and ``baseline`` are names of walkers.

    Walkers take turns on each walk, so that other load of the machine affects all of them.
    Progress, 0 to 1, is reported to ``progress``. ``cycles`` is the length of the walks, if it is
    not theirs.
    """
    if cycles:
        walks = [replace(walk, scene=replace(walk.scene, cycles=cycles)) for walk in walks]
    went: dict[str, list[Walked]] = {walker.name: [] for walker in walkers}
    for number, walk in enumerate(walks):
        for turn, walker in enumerate(walkers):
            went[walker.name].append(_attempt(walker, walk))
            progress((number + (turn + 1) / len(walkers)) / len(walks))
    return [_result(robot, walker, walks, went, tops, baseline) for walker in walkers]


def _attempt(walker: Walker, walk: Walk) -> Walked:
    try:
        return walker.walk(walk)
    except (ArithmeticError, PadError) as error:
        return Walked(*(math.nan,) * 4, f'{type(error).__name__}: {error}', 1, math.nan)


def _result(
    robot: str,
    walker: Walker,
    walks: Sequence[Walk],
    went: dict[str, list[Walked]],
    tops: Sequence[str],
    baseline: str,
) -> WalkResult:
    here, truth = went[walker.name], went[tops[0]]
    means = [_between(*pair) for pair in zip(truth, went[tops[-1]], strict=True)]
    durations = [walk.scene.duration for walk in walks]
    least = [LEAST * walk.scene.gait.stride for walk in walks]
    valid = [not each.verdict and math.isfinite(each.distance) for each in here]
    off, apart = (
        {
            measure: np.array(
                [
                    _off(measure, each, true, floor) if good else math.nan
                    for each, true, good, floor in zip(here, wanted, valid, least, strict=True)
                ]
            )
            for measure in MEASURES
        }
        for wanted in (truth, means)
    )
    return WalkResult(
        robot=robot,
        method=walker.name,
        family=walker.family,
        step_s=walker.step,
        ms_per_second=1e3
        * median(each.seconds / duration for each, duration in zip(here, durations, strict=True)),
        us_per_step=1e6 * median(each.seconds / each.steps for each in here),
        versus=median(
            each.seconds / base.seconds for each, base in zip(here, went[baseline], strict=True)
        ),
        baseline=baseline,
        top=tops[0],
        errors={name: median(errors) for name, errors in off.items()},
        worst={
            name: max(errors[np.isfinite(errors)], default=math.nan)
            for name, errors in off.items()
        },
        second=tops[-1],
        mean_errors={name: median(errors) for name, errors in apart.items()},
        # NaN counts as an error above the limit.
        failures=int((~(off['distance'] <= FAILED)).sum()),
        slip_failures=int((~(off['slip'] <= FAILED)).sum()),
        refused=valid.count(False),
        cases=len(walks),
        cycles=walks[0].scene.cycles,
        walks=[
            {'walk': walk.name}
            | asdict(each)
            | {'distance_error': each.distance / true.distance - 1.0}
            for walk, each, true in zip(walks, here, truth, strict=True)
        ],
        ours=walker.ours,
    )


def _between(one: Walked, other: Walked) -> Walked:
    """Return the mean of two results of one walk."""
    means = {
        measure: 0.5 * (getattr(one, measure) + getattr(other, measure)) for measure in MEASURES
    }
    return replace(one, **means)


def _off(measure: str, each: Walked, true: Walked, floor: float) -> float:
    found, wanted = getattr(each, measure), getattr(true, measure)
    return float(abs(found - wanted) / max(abs(wanted), floor))


def median(values: Any) -> float:
    finite = [float(value) for value in values if math.isfinite(value)]
    return statistics.median(finite) if finite else math.nan
