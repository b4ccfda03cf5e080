# SPDX-License-Identifier: Apache-2.0
"""Statistics that several studies compute from samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
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


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Clopper and Pearson 1934)."""
    if not count:
        return 0.0, 1.0
    found = stats.binomtest(hits, count).proportion_ci(0.95, 'exact')
    return float(found.low), float(found.high)


def bootstrap(pairs: Sequence[Sequence[float]], draws: int) -> tuple[float, float]:
    """Return the 95 % interval of Σ hits over Σ counts, of pairs of both that are drawn anew.

    NaN where a draw has no counts.
    """
    drawn = np.random.default_rng(0).integers(len(pairs), size=(draws, len(pairs)))
    hits, counts = np.array(pairs, dtype=float)[drawn].sum(axis=1).T
    if not (counts > 0.0).all():
        return math.nan, math.nan
    low, high = np.quantile(hits / counts, (0.025, 0.975))
    return float(low), float(high)
