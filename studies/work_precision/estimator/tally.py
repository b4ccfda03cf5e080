# SPDX-License-Identifier: Apache-2.0
"""Count the results of an estimator on recorded walks: slips, false alarms, wetness, friction."""

from __future__ import annotations

import bisect
import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator
from ros_pad.estimation.friction import GroundModel
from studies.samples import bootstrap
from studies.work_precision.estimator.walks import LOADED, SETTLED, Flags, Floats, Recording

MOVING = 5e-3  # m/s: a faster contact slips
BRIDGED = 0.02  # s: shorter gaps do not split a slip
COUNTS = 3e-3  # m: shorter slips are not counted
LATE = 0.06  # s: an alarm up to this time after a slip still counts for it
BEFORE = 0.3  # s: in a stick, the contact has stood still for this time
STILL = 5e-4  # m: motion that is allowed in a stick
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
    slips, missed : int
        Numbers of slips, and of missed ones.
    displaced, displaced_missed : int
        The same of slips at whose end the contact was as far away as slips must be long: a foot
        that lands chatters.
    delays, slip_distances : list of float
        For each slip that did not begin in an alarm, time, s, and slip distance, m, until the
        alarm; infinite if missed.
    false_alarms : int
    stick_time : float
        Total time of sticks, s.
    wet_ends : list of tuple
        For each flat stance, whether it was wet, and P(wet) at its end.
    covered, below : dict of list of array
        By ground and morphology (``dry``, ``wet``, ``dome``), whether the true friction was within
        2 sigma, and whether the true margin was below its estimated 5 % quantile.
    """

    slips: int = 0
    missed: int = 0
    displaced: int = 0
    displaced_missed: int = 0
    delays: list[float] = field(default_factory=list)
    slip_distances: list[float] = field(default_factory=list)
    false_alarms: int = 0
    stick_time: float = 0.0
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
    count_alarms(tally, walk, estimates.slipping, walk.place)
    count_estimates(tally, walk, estimates)
    return tally


def slips(speed: Floats, load: Floats, period: float, gate: float) -> Iterator[tuple[int, int]]:
    """Yield first and last sample of each stretch of motion under load, of any length."""
    moving = (speed > MOVING) & (load > gate)
    unloaded = np.concatenate([[0], np.cumsum(load <= gate)])
    found = np.flatnonzero(moving)
    if not len(found):
        return
    # Split at gaps that are too long, or in which the foot was unloaded.
    gaps = np.diff(found)
    lifted = unloaded[found[1:]] > unloaded[found[:-1]]
    cut = (gaps > round(BRIDGED / period)) | lifted
    starts = found[np.concatenate([[True], cut])]
    ends = found[np.concatenate([cut, [True]])]
    yield from zip(starts.tolist(), ends.tolist(), strict=True)


def count_alarms(
    tally: Tally, walk: Recording, alarms: Flags, place: Floats | None = None
) -> None:
    """Add delays, misses and false alarms of alarms, array (samples, legs), to a tally.

    With the places of the contacts, m, slips that displaced them are counted as well.
    """
    period, count = walk.period, len(walk.stamps)
    gate = LOADED * walk.expected_load
    settled, late, before = (round(span / period) for span in (SETTLED, LATE, BEFORE))
    sample = np.arange(count)
    for leg in range(alarms.shape[1]):
        on, load, speed = alarms[:, leg], walk.load[:, leg], walk.speed[:, leg]
        path = np.concatenate([[0.0], np.cumsum(speed) * period])
        lasts = np.minimum(count, sample + late + 1)
        stick = path[lasts] - path[np.maximum(0, sample - before)] < STILL
        stick &= (load > gate) & (sample >= settled)
        tally.stick_time += float(stick.sum()) * period
        false = on & stick
        tally.false_alarms += int((false[1:] & ~false[:-1]).sum())
        if walk.sticks_only:
            continue
        alarms_at = np.flatnonzero(on).tolist()
        for first, last in slips(speed, load, period, gate):
            if first < settled or path[last + 1] - path[first] <= COUNTS:
                continue
            near = bisect.bisect_left(alarms_at, first)
            alarmed = near < len(alarms_at) and alarms_at[near] <= last + late
            tally.slips += 1
            if place is not None and math.dist(place[first, leg], place[last, leg]) > COUNTS:
                tally.displaced += 1
                tally.displaced_missed += not alarmed
            if not alarmed:
                tally.missed += 1
                tally.delays.append(math.inf)
                tally.slip_distances.append(math.inf)
            elif alarms_at[near] > first:
                tally.delays.append((alarms_at[near] - first) * period)
                # If the slip ended before the alarm, this is its whole distance.
                end = min(alarms_at[near], last + 1)
                tally.slip_distances.append(float(path[end] - path[first]))


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
    delay, slip_distance : float or None
        Medians of time, s, and distance slipped, m, before the alarm, over slips that did not
        begin in one; None where more than half of these are missed, or of all began in one.
    misses : float or None
        Share of slips that are missed.
    already : float or None
        Share of slips that began in an alarm.
    slips : int
    displaced_misses : float or None
        Share of slips that are missed, of those that displaced the contact by as much as counts.
    displaced : int
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
    slip_distance: float | None
    misses: float | None
    already: float | None
    slips: int
    displaced_misses: float | None
    displaced: int
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
    minutes = tally.stick_time / 60.0
    timed = 2 * len(tally.delays) >= tally.slips
    probabilities = np.array(tally.wet_ends, dtype=np.float64).reshape(-1, 2)
    wet, estimated = probabilities.T
    return Row(
        delay=_median(tally.delays) if timed else None,
        slip_distance=_median(tally.slip_distances) if timed else None,
        misses=tally.missed / tally.slips if tally.slips else None,
        already=1.0 - len(tally.delays) / tally.slips if tally.slips else None,
        slips=tally.slips,
        displaced_misses=tally.displaced_missed / tally.displaced if tally.displaced else None,
        displaced=tally.displaced,
        false_per_minute=tally.false_alarms / minutes if minutes else None,
        stick_minutes=minutes,
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
        'misses': [(each.missed, each.slips) for each in tallies],
        'displaced_misses': [(each.displaced_missed, each.displaced) for each in tallies],
        'false_per_minute': [(each.false_alarms, each.stick_time / 60.0) for each in tallies],
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
    intervals = {name: list(ends) for name, ends in found.items() if math.isfinite(ends[0])}
    return row_of(whole, walks=len(tallies), intervals=intervals, **names)


def _median(values: Sequence[float]) -> float | None:
    median = statistics.median(values) if values else math.inf
    return median if math.isfinite(median) else None


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _joined(lists: Any) -> Floats:
    arrays = [array for each in lists for array in each]
    return np.concatenate(arrays) if arrays else np.array([])


def _means(parts: dict[str, list[Flags]]) -> dict[str, float]:
    means = {name: _mean(_joined([arrays])) for name, arrays in parts.items()}
    return {name: mean for name, mean in means.items() if mean is not None}
