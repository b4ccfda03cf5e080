# SPDX-License-Identifier: Apache-2.0
"""Join what the drivers of single legs publish into records of all feet, by their stamps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.records import Block, Kind

WAIT_NS = 10_000_000
"""Longest time for which a record waits for its pieces, ns, on the clock of the stamps."""

SET_BACK_NS = 100_000_000
"""Step back of a stamp from which on a clock has been set back, ns; less is a late piece."""

_MOST = 1000  # stamps that wait

LOOSE = 'position'
"""Field that may come with stamps of its own, such as those of a slower motion capture."""


class _Record(NamedTuple):
    """A record that waits for pieces."""

    rows: np.ndarray
    begun_ns: float  # newest stamp of a record when its first piece came
    there: set[tuple[int, str]]  # rows and fields that have come, also if they are NaN


class Joiner:
    """Join pieces of records: some fields of one leg, with a stamp.

    A record begins with the first of the needed fields of any leg. It is given out when all needed
    fields of all legs have come, when a later record is complete, or when it has waited too long;
    what is missing is NaN then. A position whose stamp is that of no record goes into the next
    record of its leg that lacks one, once. Pieces of records that have been given out are dropped.

    Parameters
    ----------
    kind : Kind
        Kind of the records.
    legs : sequence of int
        Numbers of the legs, in the order of the rows.
    needed : sequence of str
        Fields of a complete record; without any, each piece is a record.
    """

    def __init__(self, kind: Kind, legs: Sequence[int], needed: Sequence[str] = ()) -> None:
        self._kind = kind
        self._row = {leg: row for row, leg in enumerate(legs)}
        self._columns = [(each, field.name) for field in kind.fields for each in field.columns]
        self._needed = tuple(needed)
        self._complete = {(row, name) for row in self._row.values() for name in needed}
        self._begin()

    def _begin(self) -> None:
        self._waiting: dict[int, _Record] = {}
        self._loose: dict[int, np.ndarray] = {}  # position that belongs to no record, by row
        self._newest = self._given = -math.inf  # stamps of records, begun and given out

    def add(self, leg: int, stamp_ns: int, values: Mapping[str, float]) -> list[Block]:
        """Add numbers of a leg; return the records, of one moment each, that go out with them.

        Parameters
        ----------
        leg : int
            Number of the leg.
        stamp_ns : int
            Time stamp, ns; one that is more than 0.1 s before the last ones begins anew.
        values : mapping
            Numbers of whole fields, by column: ``{'force_x': 0.0, 'force_y': ...}``.
        """
        row, given = self._row[leg], []
        fields = {field for column, field in self._columns if column in values}
        if not self._needed:
            rows = self._kind.rows(len(self._row))
            self._put(rows, row, values)
            return [Block.of(stamp_ns, rows)]
        drives = self._needed[0] in fields
        if drives and stamp_ns < self._newest - SET_BACK_NS:
            given = self._give(math.inf)
            self._begin()
        if stamp_ns <= self._given:
            if LOOSE in fields and not drives:
                rows = self._kind.rows(len(self._row))
                self._put(rows, row, values)
                self._loose[row] = rows[LOOSE][row]
            return given
        if drives:
            self._newest = max(self._newest, stamp_ns)
        record = self._waiting.get(stamp_ns)
        if record is None:
            rows = self._kind.rows(len(self._row))
            record = self._waiting[stamp_ns] = _Record(rows, self._newest, set())
            if len(self._waiting) > _MOST:  # no record begins
                self._loosen(self._waiting.pop(next(iter(self._waiting))))
        self._put(record.rows, row, values)
        record.there.update((row, field) for field in fields)
        if self._complete <= record.there:
            given += self._give(stamp_ns)
        return given + self.expire(self._newest)

    def _put(self, rows: np.ndarray, row: int, values: Mapping[str, float]) -> None:
        numbers = rows.view('f8').reshape(len(rows), -1)[row]
        for place, (column, _) in enumerate(self._columns):
            if column in values:
                numbers[place] = values[column]

    def expire(self, now_ns: float) -> list[Block]:
        """Return the records that have waited too long at a time on the clock of stamps, ns."""
        for stamp_ns, record in list(self._waiting.items()):
            # Without a beginning, these may be pieces whose stamps are from another clock.
            if record.begun_ns < now_ns - WAIT_NS and not self._rows_of(record):
                self._loosen(self._waiting.pop(stamp_ns))
        return self._give(now_ns - WAIT_NS)

    def _rows_of(self, record: _Record) -> list[int]:
        """Return the rows of the legs with which a record has begun."""
        return [row for row in self._row.values() if (row, self._needed[0]) in record.there]

    def _loosen(self, record: _Record) -> None:
        for row, name in record.there:
            if name == LOOSE:
                self._loose[row] = record.rows[LOOSE][row]

    def _give(self, until_ns: float) -> list[Block]:
        """Give out the records up to a stamp, ns."""
        given = []
        for stamp_ns in sorted(each for each in self._waiting if each <= until_ns):
            record = self._waiting.pop(stamp_ns)
            begun = self._rows_of(record)
            if not begun:
                self._loosen(record)
                continue
            for row in begun:
                position = self._loose.pop(row, None)  # an older one, if the record has its own
                if position is not None and (row, LOOSE) not in record.there:
                    record.rows[LOOSE][row] = position
            self._given = stamp_ns
            given.append(Block.of(stamp_ns, record.rows))
        return given
