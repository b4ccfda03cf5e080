# SPDX-License-Identifier: Apache-2.0
"""Statistics that several studies compute from samples."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy import stats

Flags = np.ndarray[Any, np.dtype[np.bool_]]


def runs(mask: Flags, join: int = 0) -> list[tuple[int, int]]:
    """Return start and end (exclusive) of each stretch where a mask is true.

    Gaps of up to ``join`` samples between two stretches are closed.
    """
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(int)))
    found: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if found and start - found[-1][1] <= join:
            found[-1] = (found[-1][0], stop)
        else:
            found.append((start, stop))
    return found


def auc(positive: np.ndarray, negative: np.ndarray) -> float:
    """Return the probability that a positive has a higher score than a negative; ties count half.

    NaN if there are no positives or no negatives.
    """
    if not (len(positive) and len(negative)):
        return math.nan
    ranks = stats.rankdata(np.concatenate([positive, negative]))
    wins = ranks[: len(positive)].sum() - 0.5 * len(positive) * (len(positive) + 1)
    return float(wins / (len(positive) * len(negative)))


def share_interval(hits: int, count: int) -> list[float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    if not count:
        return [0.0, 1.0]
    interval = stats.binomtest(hits, count).proportion_ci(method='wilson')
    return [float(interval.low), float(interval.high)]
