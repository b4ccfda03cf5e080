# SPDX-License-Identifier: Apache-2.0
"""Compare recorded records, one by one, with those of a replay: by leg and quantity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.records import Block
from ros_pad.records import Field
from ros_pad.records import Kind

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
    def of(
        cls, kind: Kind, legs: tuple[int, ...], records: list[tuple[int, Block]] | None = None
    ) -> Stream:
        """Return the stream of blocks of one record each, with their log times, ns."""
        times = [time_ns for time_ns, _ in records or ()]
        stamps = [block.last_ns for _, block in records or ()]
        rows = [kind.rows(0, len(legs)), *(block.rows for _, block in records or ())]
        return cls(
            kind,
            legs,
            np.array(times, np.int64),
            Block(np.array(stamps, np.int64), np.concatenate(rows)),
        )

    def of_legs(self, legs: tuple[int, ...]) -> Stream:
        """Return the records of some legs; rows of a leg that has none are NaN."""
        if legs == self.legs:
            return self
        rows = self.kind.rows(len(self.times), len(legs))
        for row, leg in enumerate(legs):
            if leg in self.legs:
                rows[:, row] = self.block.rows[:, self.legs.index(leg)]
        return self._replace(legs=legs, block=Block(self.block.stamps, rows))

    def in_order(self) -> Stream:
        """Return the records in the order of their log times."""
        return self.where(np.argsort(self.times, kind='stable'))

    def where(self, kept: npt.NDArray[Any]) -> Stream:
        """Return some of the records."""
        stamps, rows = self.block
        return self._replace(times=self.times[kept], block=Block(stamps[kept], rows[kept]))

    def track(self, leg: int, field: Field) -> Track:
        """Return the values of a field of a leg."""
        values = self.block.rows[field.name][:, self.legs.index(leg)]
        return Track(self.times, self.block.stamps, values.reshape(len(values), -1))


def quantity(field: Field) -> str:
    """Return the name of what a field is, for people: that of the field, or ``morphology``."""
    return 'morphology' if field.name == 'dome' else field.name


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
    recorded, replayed : int
        Numbers of records.
    compared, equal : int
        Number of records that are in the bag and in the replay, by their stamps, and how many of
        these are equal to the bit.
    missing, not_recorded : int
        Number of records in the bag that the replay does not have, and the other way round.
    largest_difference : float
        Largest difference of two numbers, in that unit; inf if only one of them is NaN.
    first_difference_s : float or None
        Time of the first record that differs or is missing, s after the beginning of the bag.
    rounded : bool
        Whether no record is missing, and no difference is larger than :data:`ROUNDING`.
    excused : bool
        Whether all larger differences and missing records come after a gap in the recorded
        inputs: lost inputs cannot be replayed, and may be the cause.
    """

    topic: str
    leg: int
    quantity: str
    unit: str
    recorded: int
    replayed: int
    compared: int
    equal: int
    missing: int
    not_recorded: int
    largest_difference: float
    first_difference_s: float | None
    rounded: bool
    excused: bool

    @property
    def verdict(self) -> str:
        """``equal``, ``rounding``, ``gap`` (an excused difference) or ``different``."""
        if self.first_difference_s is None:
            return 'equal'
        if self.rounded:
            return 'rounding'
        return 'gap' if self.excused else 'different'


def compare(
    topic: str,
    leg: int,
    field: Field,
    recorded: Track,
    replayed: Track,
    start_ns: int = 0,
    gap_ns: float = math.inf,
) -> Comparison:
    """Compare a quantity of a leg with its replay; records match by their stamps.

    Parameters
    ----------
    topic, leg
        See :class:`Comparison`.
    field : Field
        What is compared.
    recorded, replayed : Track
        Its values, recorded and replayed.
    start_ns : int
        Beginning of the bag, ns.
    gap_ns : float
        Log time of the first gap in the recorded inputs, ns, from which on differences are
        excused.
    """
    _, own, theirs = np.intersect1d(recorded.stamps, replayed.stamps, return_indices=True)
    before, after, times = recorded.values[own], replayed.values[theirs], recorded.times
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid='ignore'):
        apart = np.nan_to_num(np.abs(before - after), nan=math.inf, posinf=math.inf)
    apart[same] = 0.0
    far = apart > ROUNDING * np.maximum(1.0, np.abs(np.nan_to_num(before)))
    lost = np.delete(times, own)
    parting = np.concatenate([times[own][~same.all(axis=1)], lost])
    grave = np.concatenate([times[own][far.any(axis=1)], lost])
    return Comparison(
        topic=topic,
        leg=leg,
        quantity=quantity(field),
        unit=field.unit,
        recorded=len(times),
        replayed=len(replayed.times),
        compared=len(own),
        equal=int(same.all(axis=1).sum()),
        missing=len(lost),
        not_recorded=len(replayed.times) - len(own),
        largest_difference=float(apart.max(initial=0.0)),
        first_difference_s=(int(parting.min()) - start_ns) * 1e-9 if len(parting) else None,
        rounded=not len(grave),
        excused=len(grave) > 0 and int(grave.min()) >= gap_ns,
    )


def compare_streams(
    topic: str, recorded: Stream, replayed: Stream, start_ns: int, gap_ns: float
) -> list[Comparison]:
    """Compare all quantities of all legs that were recorded and replayed; see :func:`compare`."""
    return [
        compare(
            topic, leg, field, recorded.track(leg, field), replayed.track(leg, field), start_ns,
            gap_ns,
        )
        for leg in recorded.legs
        if leg in replayed.legs
        for field in recorded.kind.fields
    ]  # fmt: skip
