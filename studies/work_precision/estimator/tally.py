# SPDX-License-Identifier: Apache-2.0
"""Count the results of an estimator on recorded walks: slips, false alarms, wetness, friction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator
from ros_pad.estimation.friction import GroundModel
from ros_pad.estimation.track import LOAD_GATE
from studies import slips
from studies.samples import bootstrap
from studies.slips import Alarms, judged
from studies.work_precision.estimator.walks import LOADED, SETTLED, Flags, Floats, Recording

STANCE = 0.1  # s: shorter stances are not counted for wetness


TARGETS: dict[str, Any] = {
    'misses': 0.01,
    'false_per_minute': 1.0,
    'wet_right': 0.97,
    'coverage': (0.90, 0.99),
    'us_per_update': 20.0,
}
"""Targets of a :class:`Row`: upper bounds; lower for ``wet_right``, two for ``coverage``."""


@dataclass(frozen=True)
class Estimates:
    """Results of an estimator for a recording; arrays have the shape (samples, legs).

    A sample that did not arrive, or was rejected, has the values of the sample before.

    Attributes
    ----------
    slipping, standing, fresh : array of bool
    wet, mean, sd, margin : array
        P(wet), friction and its standard deviation, friction margin.
    """

    slipping: Flags
    standing: Flags
    fresh: Flags
    wet: Floats
    mean: Floats
    sd: Floats
    margin: Floats


def replay(walk: Recording) -> Estimates:
    """Return the results for the readings of a robot, whose feet learn together."""
    legs = walk.load.shape[1]
    model = GroundModel.of(*walk.settings)
    estimators = [FootEstimator(*walk.settings, model) for _ in range(legs)]
    out = np.empty((*walk.load.shape, 7))
    rows = walk.rows
    for sample, (stamp, arrived) in enumerate(
        zip(walk.stamps.tolist(), walk.arrived.tolist(), strict=True)
    ):
        found = []
        for estimator, mine, new in zip(estimators, rows, arrived, strict=True):
            if new:
                row = mine[sample]
                try:
                    estimator.update(stamp, row[:3], row[3:6], row[6])
                except InvalidInput:
                    new = False
            now = estimator.estimate
            found.append(
                (now.slipping, now.standing, new and now.fresh, now.wet_probability,
                 now.friction_mean, now.friction_sd, now.margin)
            )  # fmt: skip
        out[sample] = found
    slipping, standing, fresh = np.moveaxis(out[..., :3] > 0.5, 2, 0)
    wet, mean, sd, margin = np.moveaxis(out[..., 3:], 2, 0)
    return Estimates(slipping, standing, fresh, wet, mean, sd, margin)


@dataclass
class Tally:
    """Counts of a walk; those of several walks can be added.

    Attributes
    ----------
    alarms : list of Alarms
        What the alarm did, for each walk.
    wet_ends : list of tuple
        For each flat stance, whether it was wet, and P(wet) at its end.
    covered, below : dict of list of array
        By ground and morphology (``dry``, ``wet``, ``dome``), whether the true friction was within
        2 sigma, and whether the true margin was below its estimated 5 % quantile.
    """

    alarms: list[Alarms] = field(default_factory=list)
    wet_ends: list[tuple[bool, float]] = field(default_factory=list)
    covered: dict[str, list[Flags]] = field(default_factory=dict)
    below: dict[str, list[Flags]] = field(default_factory=dict)

    def add(self, other: Tally) -> None:
        """Add the counts of other walks."""
        for name, value in vars(other).items():
            if isinstance(value, dict):
                for key, arrays in value.items():
                    getattr(self, name).setdefault(key, []).extend(arrays)
            else:
                setattr(self, name, getattr(self, name) + value)


def counted(walk: Recording) -> Tally:
    """Return the counts of the estimator on a walk."""
    tally, estimates = Tally(), replay(walk)
    count_alarms(tally, walk, estimates.slipping)
    count_estimates(tally, walk, estimates)
    return tally


def count_alarms(tally: Tally, walk: Recording, alarms: Flags) -> None:
    """Add what alarms, array (samples, legs), did to a tally."""
    loaded = walk.load > LOAD_GATE * walk.expected_load
    found = judged(alarms, loaded, walk.place, walk.period, SETTLED)
    if walk.sticks_only:
        found = Alarms(false=found.false, minutes=found.minutes)
    tally.alarms.append(found)


def count_estimates(tally: Tally, walk: Recording, estimates: Estimates) -> None:
    """Add to a tally whether the estimates of wetness and friction are right."""
    if walk.sticks_only:
        return
    settled = round(SETTLED / walk.period)
    tip = 0.5 * walk.expected_load
    for leg in range(walk.load.shape[1]):
        load = walk.load[:, leg]
        pressures, of = np.unique(walk.pressure[:, leg], return_inverse=True)
        domed = np.array([walk.foot.dome_load(2.0 * tip, p) > tip for p in pressures.tolist()])[of]
        judged = estimates.standing[:, leg] & estimates.fresh[:, leg] & (load > 1e-6)
        judged[:settled] = False
        friction = walk.grip[:, leg] / np.maximum(load, 1e-6)
        mean, sd, margin = (
            each[:, leg] for each in (estimates.mean, estimates.sd, estimates.margin)
        )
        right = abs(mean - friction) <= 2.0 * sd
        below = friction - walk.tangential[:, leg] / np.maximum(load, 1e-6) < margin
        wet = walk.wet[:, leg]
        for name, where in (('dry', ~domed & ~wet), ('wet', ~domed & wet), ('dome', domed)):
            tally.covered.setdefault(name, []).append(right[judged & where])
            tally.below.setdefault(name, []).append(below[judged & where])
        for start, end in _stretches(load > LOADED * walk.expected_load):
            middle = (start + end) // 2
            if start >= settled and (end - start) * walk.period > STANCE and not domed[middle]:
                tally.wet_ends.append((bool(wet[middle]), float(estimates.wet[end - 1, leg])))


def _stretches(on: Flags) -> Iterator[tuple[int, int]]:
    """Yield start and end, exclusive, of each run of True that starts and ends in the array."""
    edges = np.diff(on.astype(int))
    ends = np.flatnonzero(edges < 0) + 1
    for start in (np.flatnonzero(edges > 0) + 1).tolist():
        after = ends[ends > start]
        if len(after):
            yield start, int(after[0])


@dataclass(frozen=True)
class Row:
    """Results of one method, or of the estimator under one condition.

    Attributes
    ----------
    part : str
        ``methods``, ``robustness`` or ``walks``.
    name : str
        Method, or changed condition.
    variant : str
        Variant of the method or of the change.
    value : float
        Threshold of the method, or size of the change.
    unit : str
    shipped : bool
        Whether this is the estimator as shipped, under ordinary conditions.
    delay : float or None
        Median of the times before the alarm, s, of slips of 5 mm.
    misses : float or None
        Share of slips of 5 mm that are missed.
    slips : int
    others : dict of list of float
        Share missed of slips of other sizes, with its 95 % interval.
    false_per_minute : float or None
        False alarms in a minute of stick.
    stick_minutes : float
    us_per_update : float or None
        Mean time of an update, microseconds.
    brier, wet_right : float or None
        Mean squared error of P(wet) at the end of flat stances, and share of these stances with
        P(wet) on the right side of 0.5.
    stances : int
    coverage, below : float or None
        Share of updates with the true friction within 2 sigma, and with the true margin below its
        estimated 5 % quantile.
    coverages, belows : dict of float
        The same by ground and morphology.
    note : str
        Remark.
    walks : int
        Number of walks; 0 if they are not counted.
    intervals : dict of list of float
        95 % intervals of measures, from the walks drawn anew.
    """

    part: str
    name: str
    variant: str
    value: float
    unit: str
    shipped: bool
    delay: float | None
    misses: float | None
    slips: int
    others: dict[str, list[float | None]]
    false_per_minute: float | None
    stick_minutes: float
    us_per_update: float | None
    brier: float | None
    wet_right: float | None
    stances: int
    coverage: float | None
    below: float | None
    coverages: dict[str, float]
    belows: dict[str, float]
    note: str = ''
    walks: int = 0
    intervals: dict[str, list[float]] = field(default_factory=dict)


def row_of(tally: Tally, us_per_update: float | None = None, **names: Any) -> Row:
    """Return the row of a tally."""
    found = slips.row_of(tally.alarms)
    probabilities = np.array(tally.wet_ends, dtype=np.float64).reshape(-1, 2)
    wet, estimated = probabilities.T
    return Row(
        delay=found['latency_s'],
        misses=found['missed_5_mm'],
        slips=found['slips_5_mm'],
        others={
            f'{size} mm': [found[f'missed_{size}_mm'], *found[f'missed_{size}_mm_interval']]
            for size in (3, 10)
        },
        false_per_minute=found['false_alarms_a_minute'],
        stick_minutes=found['minutes_of_sticking'],
        us_per_update=us_per_update,
        brier=_mean((estimated - wet) ** 2),
        wet_right=_mean((estimated > 0.5) == (wet > 0.5)),
        stances=len(wet),
        coverage=_mean(_joined(tally.covered.values())),
        below=_mean(_joined(tally.below.values())),
        coverages=_means(tally.covered),
        belows=_means(tally.below),
        **names,
    )


def row_of_walks(tallies: Sequence[Tally], **names: Any) -> Row:
    """Return the row of several walks, with intervals over the walks."""
    whole = Tally()
    for each in tallies:
        whole.add(each)
    parts: dict[str, list[tuple[float, float]]] = {
        'wet_right': [
            (sum((p > 0.5) == wet for wet, p in each.wet_ends), len(each.wet_ends))
            for each in tallies
        ],
        'coverage': [
            (int(found.sum()), len(found))
            for found in (_joined(each.covered.values()) for each in tallies)
        ],
    }
    found = {name: bootstrap(pairs, 2000) for name, pairs in parts.items()}
    alarms = slips.row_of(whole.alarms)
    if alarms['slips_5_mm']:
        found['misses'] = alarms['missed_5_mm_interval']
    if alarms['minutes_of_sticking']:
        found['false_per_minute'] = alarms['false_alarms_interval']
    intervals = {name: list(ends) for name, ends in found.items() if math.isfinite(sum(ends))}
    return row_of(whole, walks=len(tallies), intervals=intervals, **names)


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _joined(lists: Any) -> Floats:
    arrays = [array for each in lists for array in each]
    return np.concatenate(arrays) if arrays else np.array([])


def _means(parts: dict[str, list[Flags]]) -> dict[str, float]:
    means = {name: _mean(_joined([arrays])) for name, arrays in parts.items()}
    return {name: mean for name, mean in means.items() if mean is not None}
