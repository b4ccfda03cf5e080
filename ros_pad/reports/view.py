# SPDX-License-Identifier: Apache-2.0
"""What the pictures of a trial need besides its series: load gate, order of legs, metrics."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_pad.control import POLICIES
from ros_pad.trials.metrics import LOAD_GATE
from ros_pad.trials.trial import Trial

WINDOW = 8.0  # s, the part of the trial that is drawn in detail


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
    rows : list of dict
        Metrics of this trial and of those to compare with, each with its ``policy``.
    """

    trial: Trial
    order: list[int]
    load_gate: float
    wet: np.ndarray | None
    rows: list[dict[str, Any]]


def view_of(trial: Trial, others: Iterable[Trial] = ()) -> View:
    """Return a trial with the data for its pictures, and the metrics of other trials."""
    own = [(each.policy, each.metrics.as_dict()) for each in (trial, *others) if each.metrics]
    compared = [(row['policy'], row) for row in trial.settings.get('comparison', [])]
    rows: dict[str, dict[str, Any]] = {}
    for policy, metrics in own[:1] + compared + own[1:]:
        rows.setdefault(policy, metrics | {'policy': policy})
    known = [policy for policy in POLICIES if policy in rows]
    return View(
        trial=trial,
        order=_order(trial),
        load_gate=_load_gate(trial),
        wet=trial.wet() if trial.floor is not None else None,
        rows=[rows.pop(policy) for policy in known] + list(rows.values()),
    )


def _order(trial: Trial) -> list[int]:
    """Return the columns of the legs by the times of their stances, else odd legs, then even."""
    gait = (trial.settings.get('conditions') or {}).get('gait') or {}
    legs, middles = trial.legs, gait.get('middles') or ()
    times = middles if len(middles) == len(legs) else [leg % 2 == 0 for leg in legs]
    return sorted(range(len(legs)), key=lambda k: (times[k], legs[k]))


def _load_gate(trial: Trial) -> float:
    if 'expected_load' in trial.settings:
        return float(LOAD_GATE * trial.settings['expected_load'])
    loads = trial.force[:, :, 2]
    # The expected load is not on record: use the 90 % quantile of the normal forces.
    return float(LOAD_GATE * np.nanpercentile(loads, 90.0)) if np.isfinite(loads).any() else 0.0


def spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Return start and duration, s, of each run of True; a row lasts until the next row."""
    if len(time) < 2:
        return []
    ends = np.append(time[1:], time[-1] + (time[-1] - time[-2]))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(float(time[a]), float(ends[b - 1] - time[a])) for a, b in edges.reshape(-1, 2)]


def window_of(view: View) -> tuple[float, float]:
    """Return start and end, s, of the part of a trial around the middle of its changes.

    It lasts :data:`WINDOW` at most. A change is a foot that comes onto wet ground or becomes a
    dome.
    """
    trial = view.trial
    first, last = float(trial.slow_time[0]), float(trial.slow_time[-1])
    changed = [trial.slow['dome']] if view.wet is None else [trial.slow['dome'], view.wet]
    changes = np.concatenate([~each[:-1] & each[1:] for each in changed], axis=1).any(axis=1)
    moments = trial.slow_time[1:][changes]
    middle = float(np.median(moments)) if len(moments) else 0.5 * (first + last)
    start = max(first, min(middle - 0.5 * WINDOW, last - WINDOW))
    return start, min(start + WINDOW, last)
