# SPDX-License-Identifier: Apache-2.0
"""The series of a trial from its records, whether they come from the loop or from a bag."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad.estimation import doubt as doubts
from ros_pad.records import Block
from ros_pad.trials.trial import SLOW, Trial

Poses: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Stamps, ns, and position x and y, m, and heading, rad, at each of them."""


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


def trial_of(
    records: Records,
    legs: tuple[int, ...],
    body: Poses | None,
    odom: Poses | None,
    zero_ns: int = 0,
    **about: Any,
) -> Trial:
    """Return the trial of all records.

    Fast series have a row for each sample of any foot; slow ones for each estimate with a sample,
    without loads for each wetness, and without that for each pressure.

    Parameters
    ----------
    records : Records
        All records.
    legs : tuple of int
        Numbers of the legs, in the order of the rows.
    body, odom : pair of arrays or None
        Stamps, ns, and true poses of the body, and those that were estimated, in whose frame the
        feet are then.
    zero_ns : int
        Stamp at which the trial begins, ns.
    **about
        Other fields of the trial, by name.
    """
    sample, estimate, command, pressure = records
    fast = sample.stamps[np.isfinite(sample.rows['force']).all(axis=2).any(axis=1)]
    grids = (estimate.stamps[np.isfinite(estimate.rows[name]).any(axis=1)]
             for name in ('load', 'wetness'))  # fmt: skip
    slow = next((each for each in grids if len(each)), pressure.stamps)
    fast, slow = np.unique(fast), np.unique(slow)
    there: dict[str, Any] = {}
    for block, names in (
        (estimate, ('wetness', 'friction', 'margin', 'slip', 'slipping', 'doubt')),
        (command, ('setpoint', 'dome')),
        (pressure, ('pressure',)),
    ):
        there |= {name: held(block.stamps, block.rows[name], slow) for name in names}
    codes, places = np.unique(there['doubt'], return_inverse=True)
    kinds = np.array([_kind_of(code) for code in codes.tolist()], int)
    # NumPy 1 returns the places of a table as one row.
    there['doubt'] = kinds[places].reshape(there['doubt'].shape)
    there['slip_speed'] = by_row(math.hypot, there.pop('slip'))
    rows = np.empty((len(slow), len(legs)), SLOW)
    for name, values in there.items():
        rows[name] = values == 1.0 if name in ('slipping', 'dome') else values
    force = held(sample.stamps, sample.rows['force'], fast)
    position = held(sample.stamps, sample.rows['position'], fast)
    true = held(*body, fast) if body else np.full((len(fast), 3), np.nan)
    estimated = np.zeros((0, 3))
    if odom:
        estimated = held(*odom, fast)
        true = true if body else estimated
        force, position = in_world(force, position, estimated, true)
    return Trial(
        time=(fast - zero_ns) * 1e-9,
        slow_time=(slow - zero_ns) * 1e-9,
        legs=legs,
        body=true,
        force=force,
        position=position,
        slow=rows,
        odom=estimated,
        **about,
    )


def in_world(
    force: np.ndarray, position: np.ndarray, odom: np.ndarray, body: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces and positions of feet in the world in place of those in odom.

    Odom is where the body estimator takes the robot to be; it drifts. Feet are placed by the true
    pose of the body, as they stand to its estimated one.
    """
    turn = (body[:, 2] - odom[:, 2])[:, None]
    cosine, sine = np.cos(turn), np.sin(turn)

    def turned(vectors: np.ndarray) -> np.ndarray:
        x, y = vectors[..., 0], vectors[..., 1]
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=2)

    arms = turned(position[:, :, :2] - odom[:, None, :2])
    return (
        np.concatenate([turned(force), force[:, :, 2:]], axis=2),
        np.concatenate([body[:, None, :2] + arms, position[:, :, 2:]], axis=2),
    )


def _kind_of(code: float) -> int:
    """Return the place of a doubt in the list of kinds; -1 if it is not known."""
    return -1 if math.isnan(code) else doubts.DOUBTS.index(doubts.kind(code))
