# SPDX-License-Identifier: Apache-2.0
"""The series of a trial from its records, whether they come from the loop or from a bag."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ros_pad.estimation import doubt as doubts
from ros_pad.records import Block


class Records(NamedTuple):
    """All records of a trial, each kind in the order of its stamps.

    Attributes
    ----------
    sample, estimate, command, pressure : Block
    """

    sample: Block
    estimate: Block
    command: Block
    pressure: Block


def by_row(function: Callable[..., float], values: np.ndarray) -> np.ndarray:
    """Apply a function of ``math`` to the rows of the last axis.

    NumPy's functions differ from it in the last bit.
    """
    columns = values.reshape(-1, values.shape[-1]).T.tolist()
    return np.reshape(list(map(function, *columns)), values.shape[:-1])


def held(stamps: np.ndarray, values: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Return the last known values up to each time of a grid, NaN before the first ones.

    Parameters
    ----------
    stamps, grid : array of int (n,), (m,)
        Times, ns, ascending.
    values : array (n, ...)
        NaN where a value is not known.

    Returns
    -------
    array (m, ...)
    """
    places = np.arange(1, len(stamps) + 1).reshape(-1, *[1] * (values.ndim - 1))
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, places), axis=0)
    last = np.concatenate([np.zeros_like(last[:1], shape=(1, *values.shape[1:])), last])
    first = np.full((1, *values.shape[1:]), np.nan)
    rows = last[np.searchsorted(stamps, grid, side='right')]
    return np.take_along_axis(np.concatenate([first, values]), rows, axis=0)


def series(sample: Block, estimate: Block, command: Block, pressure: Block) -> dict[str, Any]:
    """Return the series of :class:`ros_pad.trials.trial.Trial` by name, times in ns.

    Fast series have a row for each sample of any foot; slow ones for each estimate with a sample,
    without loads for each wetness, and without that for each pressure.
    """
    fast = sample.stamps[np.isfinite(sample.rows['force']).all(axis=2).any(axis=1)]
    grids = (estimate.stamps[np.isfinite(estimate.rows[name]).any(axis=1)]
             for name in ('load', 'wetness'))  # fmt: skip
    slow = next((each for each in grids if len(each)), pressure.stamps)
    fast, slow = np.unique(fast), np.unique(slow)

    def of(block: Block, name: str, grid: np.ndarray = slow) -> np.ndarray:
        return held(block.stamps, block.rows[name], grid)

    codes, places = np.unique(of(estimate, 'doubt'), return_inverse=True)
    kinds = np.array([_kind_of(code) for code in codes.tolist()], int)
    return {
        'time': fast,
        'force': of(sample, 'force', fast),
        'position': of(sample, 'position', fast),
        'slow_time': slow,
        'pressure': of(pressure, 'pressure'),
        'setpoint': of(command, 'setpoint'),
        'wet_probability': of(estimate, 'wetness'),
        'friction': of(estimate, 'friction'),
        'margin': of(estimate, 'margin'),
        'slip_speed': by_row(math.hypot, of(estimate, 'slip')),
        'slipping': of(estimate, 'slipping') == 1.0,
        'dome': of(command, 'dome') == 1.0,
        'doubt': kinds[places],
    }


def _kind_of(code: float) -> int:
    """Return the place of a doubt in the list of kinds; -1 if it is not known."""
    return -1 if math.isnan(code) else doubts.DOUBTS.index(doubts.kind(code))
