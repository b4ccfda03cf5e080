# SPDX-License-Identifier: Apache-2.0
"""Compare recorded records, one by one, with those of a replay: by leg and quantity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.records import Block, Kind

ROUNDING = 1e-12
"""Largest difference that counts as rounding, relative to the recorded number (below 1: to 1).

NumPy's exponential differs between processors in the last bit."""


class Track(NamedTuple):
    """Values of one quantity of a leg.

    Attributes
    ----------
    times : array of int64 (n,)
        Log time of each record, ns; in a replay, that of the last sample before it.
    stamps : array of int64 (n,)
        Time stamps, ns.
    values : array (n, components)
        Values, in SI units.
    """

    times: npt.NDArray[np.int64]
    stamps: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]

    def at(self, stamp_ns: int) -> float:
        """Return the first value of the last record up to a stamp, ns; NaN before the first."""
        place = int(np.searchsorted(self.stamps, stamp_ns, side='right'))
        return float(self.values[place - 1, 0]) if place else math.nan


class Stream(NamedTuple):
    """All records of a kind in a bag or of a replay.

    Attributes
    ----------
    kind : Kind
    legs : tuple of int
        Numbers of the legs, in the order of the rows.
    times : array of int64 (n,)
        Log times, ns.
    block : Block
    """

    kind: Kind
    legs: tuple[int, ...]
    times: npt.NDArray[np.int64]
    block: Block

    @classmethod
    def of(cls, kind: Kind, legs: tuple[int, ...], records: list[tuple[int, Block]]) -> Stream:
        """Return the stream of blocks of one record each, with their log times, ns."""
        times = np.array([time_ns for time_ns, _ in records], np.int64)
        return cls(
            kind, legs, times, Block.joined(kind, [block for _, block in records], len(legs))
        )

    def where(self, kept: npt.NDArray[Any]) -> Stream:
        """Return some of the records."""
        stamps, rows = self.block
        return self._replace(times=self.times[kept], block=Block(stamps[kept], rows[kept]))

    def of_legs(self, legs: Sequence[int]) -> Stream:
        """Return the records of these legs; those of other legs are missing."""
        rows = self.kind.rows(len(self.times), len(legs))
        for place, leg in enumerate(legs):
            if leg in self.legs:
                rows[:, place] = self.block.rows[:, self.legs.index(leg)]
        return self._replace(legs=tuple(legs), block=Block(self.block.stamps, rows))

    def values(self, name: str) -> np.ndarray:
        """Return the values of a field, (n, legs, components)."""
        values: np.ndarray = self.block.rows[name]
        return values if values.ndim == 3 else values[:, :, None]

    def tracks(self) -> dict[tuple[int, str], Track]:
        """Return the values of each quantity, by leg and name."""
        return {
            (leg, field.name): Track(
                self.times, self.block.stamps, self.values(field.name)[:, place]
            )
            for place, leg in enumerate(self.legs)
            for field in self.kind.fields
        }


@dataclass(frozen=True)
class Comparison:
    """Result of comparing a recorded quantity of a leg with its replay.

    Attributes
    ----------
    topic : str
        Topic of the records in the bag.
    leg : int
        Number of the leg; -1 for the body.
    quantity, unit : str
        What is compared, such as ``wetness``, and its unit.
    compared, equal : int
        Number of records that are in the bag and in the replay, by their stamps, and how many of
        these are equal to the bit.
    missing, not_recorded : int
        Number of records in the bag that the replay does not have, and the other way round.
    largest_difference : float
        Largest difference of two numbers, in that unit; inf if only one of them is NaN.
    first_difference_s : float or None
        Time of the first record that differs by more than rounding or is missing, s after the
        beginning of the bag.
    verdict : str
        ``equal``; ``rounding``: no record is missing, and no difference is larger than
        :data:`ROUNDING`; ``gap``: all larger differences and missing records come after a gap in
        the recorded inputs, which cannot be replayed and may be the cause; else ``different``.
    """

    topic: str
    leg: int
    quantity: str
    unit: str
    compared: int
    equal: int
    missing: int
    not_recorded: int
    largest_difference: float
    first_difference_s: float | None
    verdict: str


def compare(
    topic: str,
    recorded: Stream,
    replayed: Stream,
    start_ns: int = 0,
    gap_ns: float = math.inf,
) -> list[Comparison]:
    """Compare records with their replay, by leg and quantity; records match by their stamps.

    Parameters
    ----------
    topic : str
        Topic of the records in the bag.
    recorded, replayed : Stream
        Records of the same kind.
    start_ns : int
        Beginning of the bag, ns.
    gap_ns : float
        Log time of the first gap in the recorded inputs, ns, from which on differences are
        excused.
    """
    _, own, theirs = np.intersect1d(
        recorded.block.stamps, replayed.block.stamps, return_indices=True
    )
    lost = np.delete(recorded.times, own)
    before, after = recorded.tracks(), replayed.tracks()
    found = []
    for leg in recorded.legs:
        for field in recorded.kind.fields:
            key = leg, field.name
            apart, far = _apart(before[key].values[own], after[key].values[theirs])
            grave = np.concatenate([recorded.times[own][far], lost])
            verdict = 'rounding' if apart.any() else 'equal'
            if len(grave):
                verdict = 'gap' if grave.min() >= gap_ns else 'different'
            first = (int(grave.min()) - start_ns) * 1e-9 if len(grave) else None
            found.append(
                Comparison(
                    topic=topic,
                    leg=leg,
                    quantity=field.name,
                    unit=field.unit,
                    compared=len(own),
                    equal=int(np.sum(apart == 0.0)),
                    missing=len(lost),
                    not_recorded=len(replayed.times) - len(own),
                    largest_difference=float(apart.max(initial=0.0)),
                    first_difference_s=first,
                    verdict=verdict,
                )
            )
    return found


def _apart(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest difference in each row, and whether it is more than rounding."""
    with np.errstate(invalid='ignore'):
        apart = np.nan_to_num(np.abs(before - after), nan=math.inf, posinf=math.inf)
    apart[(before == after) | (np.isnan(before) & np.isnan(after))] = 0.0
    far = apart > ROUNDING * np.maximum(1.0, np.abs(np.nan_to_num(before)))
    return apart.max(axis=1, initial=0.0), far.any(axis=1)
