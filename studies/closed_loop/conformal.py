# SPDX-License-Identifier: Apache-2.0
"""Lines that bound errors: quantile regression of their logarithm, and conformal prediction.

Koenker and Bassett 1978; Romano, Patterson and Candès 2019. With exchangeable scenes of which
none took part in the fit, a new one is within the bound with at least the promised probability,
whatever the law of the errors. Calibrated by folds (Vovk 2015) all scenes serve both fit and
calibration, and the probability is only nearly that: it is counted on scenes that are held out.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import optimize

from ros_pad.simulation.fidelity import LEAST

Array = np.ndarray

LEVEL = 0.8
"""Quantile of the error that the line follows before it is shifted."""

PENALTY = 2.0
"""Weight of the slopes, per standard deviation of their feature, against the errors. Of levels
0.7 to 0.9 and penalties 0.3 to 8, these gave the least bounds of L1 and L2 in 54 scenes of the
hexapod, halved at random twelve times; none of those was held out."""

_HIGHEST = 10.0  # error from which a fit does not distinguish


def fit(features: Array, errors: Array, level: float = LEVEL) -> Array:
    """Return constant and slopes of a quantile of the logarithm of errors.

    Parameters
    ----------
    features : ndarray (n, m)
        Of n scenes.
    errors : ndarray (n,)
        From 0; may be infinite.
    level : float
        Quantile, between 0 and 1.

    Returns
    -------
    ndarray (m + 1,)
        Zero for features that do not vary.
    """
    values = np.log(np.minimum(errors, _HIGHEST) + LEAST)
    count, width = features.shape
    spread = features.std(axis=0)
    scale = np.where(spread > 1e-12, spread, np.inf)
    middle = features.mean(axis=0)
    design = np.column_stack([np.ones(count), (features - middle) / scale])
    # Slopes are differences of two numbers from 0, as the distances above and below the line are.
    costs = [np.zeros(2), np.full(2 * width, PENALTY), np.full(count, level)]
    costs.append(np.full(count, 1.0 - level))
    parts = [design[:, :1], -design[:, :1], design[:, 1:], -design[:, 1:]]
    found = optimize.linprog(
        np.concatenate(costs),
        A_eq=np.column_stack([*parts, np.eye(count), -np.eye(count)]),
        b_eq=values,
        method='highs',
    ).x
    slopes = (found[2 : 2 + width] - found[2 + width : 2 + 2 * width]) / scale
    return np.array([found[0] - found[1] - slopes @ middle, *slopes])


def shift(line: Array, features: Array, errors: Array, promise: float) -> float:
    """Return by how much a line must rise to cover a share of scenes like these.

    Infinite if there are too few, or too many errors without bound.
    """
    count = len(errors)
    rank = math.ceil((count + 1) * promise - 1e-9)
    if rank > count:
        return math.inf
    return float(np.sort(np.log(errors + LEAST) - line[0] - features @ line[1:])[rank - 1])


def bounds(line: Array, features: Array) -> Array:
    """Return the bounds of errors on a line."""
    found: Array = np.maximum(LEAST, np.exp(line[0] + features @ line[1:]) - LEAST)
    return found
