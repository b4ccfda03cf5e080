# SPDX-License-Identifier: Apache-2.0
"""Data for the pictures of a trial: stances, ground, and metrics to compare with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_pad.contact import Foot
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.control import POLICIES
from ros_pad.errors import ConfigError
from ros_pad.trials.metrics import LOAD_GATE
from ros_pad.trials.trial import Trial

WINDOW = 8.0  # s, the part of the trial that is drawn in detail


@dataclass(frozen=True)
class Stance:
    """A stance of a foot: times, s, places (x, y) of touch-down and lift-off, m, morphology."""

    leg: int
    start: float
    end: float
    touched: tuple[float, float]
    left: tuple[float, float]
    dome: bool


@dataclass(frozen=True)
class View:
    """A trial with further data for its pictures.

    Attributes
    ----------
    order : list of int
        Columns of the legs, so that those are side by side that stand together.
    load_gate : float
        Normal force above which a foot stands, N.
    wet : ndarray of bool (m, legs) or None
        Whether the true ground is wet at each control step; None where it is unknown.
    stances : list of Stance
    rows : list of dict
        Metrics of this trial and of those to compare with, each with its ``policy``.
    settings : dict
        Result of :func:`ros_pad.trials.label.settings`; empty where it is unknown.
    foot : Foot or None
        Foot of the robot; None if no file describes it.
    """

    trial: Trial
    order: list[int]
    load_gate: float
    wet: np.ndarray | None
    stances: list[Stance]
    rows: list[dict[str, Any]]
    settings: dict[str, Any]
    foot: Foot | None


def _order(legs: Sequence[int], settings: Mapping[str, Any]) -> list[int]:
    """Return the columns of the legs by the times of their stances, else odd legs, then even."""
    gait = (settings.get('conditions') or {}).get('gait') or {}
    middles = gait.get('middles') or ()
    times = middles if len(middles) == len(legs) else [leg % 2 == 0 for leg in legs]
    return sorted(range(len(legs)), key=lambda k: (times[k], legs[k]))


def view_of(trial: Trial, others: Iterable[Trial] = ()) -> View:
    """Return a trial with the data for its pictures, and the metrics of other trials."""
    settings = dict(trial.settings)
    gate = _load_gate(trial, settings)
    own = [(trial.policy, trial.metrics.as_dict())] if trial.metrics else []
    compared = [(row['policy'], row) for row in settings.get('comparison', [])]
    rest = [(other.policy, other.metrics.as_dict()) for other in others if other.metrics]
    rows: dict[str, dict[str, Any]] = {}
    for policy, metrics in own + compared + rest:
        rows.setdefault(policy, metrics | {'policy': policy})
    known = [policy for policy in POLICIES if policy in rows]
    return View(
        trial=trial,
        order=_order(trial.legs, settings),
        load_gate=gate,
        wet=trial.wet() if trial.floor is not None else None,
        stances=_stances(trial, gate),
        rows=[rows.pop(policy) for policy in known] + list(rows.values()),
        settings=settings,
        foot=_foot(settings),
    )


def _foot(settings: dict[str, Any]) -> Foot | None:
    try:
        return Foot.load(str(settings.get('foot') or ''))
    except ConfigError:  # a foot file from another machine
        return None


def _load_gate(trial: Trial, settings: dict[str, Any]) -> float:
    if 'expected_load' in settings:
        return float(LOAD_GATE * settings['expected_load'])
    loads = trial.force[:, :, 2]
    # The expected load is not on record: use the 90 % quantile of the normal forces.
    return float(LOAD_GATE * np.nanpercentile(loads, 90.0)) if np.isfinite(loads).any() else 0.0


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return first index and length of each uninterrupted run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Return start and duration, s, of each run of True; a row lasts until the next row."""
    if len(time) < 2:
        return []
    ends = np.append(time[1:], time[-1] + (time[-1] - time[-2]))
    return [(float(time[a]), float(ends[a + n - 1] - time[a])) for a, n in _runs(mask)]


def _stances(trial: Trial, load_gate: float) -> list[Stance]:
    standing = trial.standing(load_gate)
    found = []
    for column, leg in enumerate(trial.legs):
        for start, length in _runs(standing[:, column]):
            rows = slice(start, start + length)
            places = trial.position[rows, column, :2]
            places = places[np.isfinite(places).all(axis=1)]
            if not len(places):
                continue
            tenth = max(1, len(places) // 10)  # average, because the marker is noisy
            first, last = places[:tenth].mean(axis=0), places[-tenth:].mean(axis=0)
            found.append(
                Stance(
                    leg=leg,
                    start=float(trial.time[start]),
                    end=float(trial.time[start + length - 1]),
                    touched=(float(first[0]), float(first[1])),
                    left=(float(last[0]), float(last[1])),
                    dome=_is_dome(trial, column, float(trial.time[start + length // 2])),
                )
            )
    return found


def _is_dome(trial: Trial, column: int, time: float) -> bool:
    """Return whether a foot is a dome at a time, s: by pressure or, without one, by decision."""
    row = int(np.searchsorted(trial.slow_time, time, side='right')) - 1
    if row < 0:
        return False
    pressure = trial.pressure[row, column]
    return bool(trial.dome[row, column] if math.isnan(pressure) else pressure > DOME_PRESSURE)


def window_of(view: View) -> tuple[float, float]:
    """Return start and end, s, of the part of a trial that shows most changes.

    It lasts :data:`WINDOW` at most. In it the largest number of feet come onto wet ground or
    become domes.
    """
    trial = view.trial
    if not len(trial.slow_time):
        return (0.0, WINDOW)
    first, last = float(trial.slow_time[0]), float(trial.slow_time[-1])
    if last - first <= WINDOW:
        return (first, last)
    changed = [trial.dome] if view.wet is None else [trial.dome, view.wet]
    changes = np.concatenate([~each[:-1] & each[1:] for each in changed], axis=1)
    times = trial.slow_time[1:]

    def inside(start: float) -> np.ndarray:
        return changes[(times >= start) & (times < start + WINDOW)]

    starts = np.arange(first, last - WINDOW + 0.25, 0.5)
    best = max(starts, key=lambda start: np.count_nonzero(inside(start).any(axis=0)))
    # Then centre the window on the changes.
    moments = times[(times >= best) & (times < best + WINDOW)][inside(best).any(axis=1)]
    middle = float(moments.mean()) if len(moments) else best + 0.5 * WINDOW
    start = min(max(first, middle - 0.5 * WINDOW), last - WINDOW)
    return (start, start + WINDOW)


__all__ = ['WINDOW', 'Stance', 'View', 'spans', 'view_of', 'window_of']
