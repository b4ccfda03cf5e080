# SPDX-License-Identifier: Apache-2.0
"""What was recorded on a topic against what a replay has on it, message by message."""

from __future__ import annotations

import bisect
import math
from array import array
from dataclasses import dataclass
from dataclasses import field

import numpy as np

ROUNDING = 1e-12
"""Difference, of the larger of the number and 1, that another processor may make: NumPy has an
exponential of its own for each, and they differ in the last bit."""


@dataclass
class Track:
    """The messages on one topic.

    Attributes
    ----------
    width : int
        Numbers in a message; 0 for a text.
    times : array of int
        When they were recorded, or when the last message that they follow from was, ns.
    keys : array of int
        What tells them apart, ns: their stamp, or the time.
    numbers : array of float
    texts : list of str
    """

    width: int
    times: array[int] = field(default_factory=lambda: array('q'))
    keys: array[int] = field(default_factory=lambda: array('q'))
    numbers: array[float] = field(default_factory=lambda: array('d'))
    texts: list[str] = field(default_factory=list)

    def add(self, time_ns: int, numbers: tuple[float, ...], key_ns: int | None = None) -> None:
        """Append a message of numbers."""
        self.times.append(time_ns)
        self.keys.append(time_ns if key_ns is None else key_ns)
        self.numbers.extend(numbers)

    def say(self, time_ns: int, text: str) -> None:
        """Append a message of text."""
        self.times.append(time_ns)
        self.keys.append(time_ns)
        self.texts.append(text)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def values(self) -> np.ndarray:
        """The numbers: (messages, width)."""
        return np.array(self.numbers).reshape(len(self), self.width)

    def at(self, time_ns: int) -> float | None:
        """Return the first number of the last message until then."""
        place = bisect.bisect_right(self.times, time_ns)
        return self.numbers[(place - 1) * self.width] if place else None


@dataclass(frozen=True)
class Comparison:
    """How a topic that was recorded compares with its replay.

    Attributes
    ----------
    topic : str
        As it is called in the bag.
    leg : int
    kind : str
        Such as ``wetness``.
    recorded, replayed : int
        Messages.
    compared, equal : int
        Messages of one moment that both have, and those of them that are equal to the bit.
    missing : int
        Messages that were recorded and that the replay does not have.
    not_recorded : int
        Messages of the replay that were not recorded. Where they are text, which is sent only
        when it changes, this is a difference; otherwise they were lost.
    largest_difference : float or None
        In the unit of the message; None for text.
    first_difference_s : float or None
        When they part, s since the bag begins.
    rounded : bool
        Whether no difference is larger than :data:`ROUNDING`.
    excused : bool
        Whether all differences come after a gap in what the nodes heard: what was not recorded
        cannot be replayed, so nobody knows whether they would be there without it.
    """

    topic: str
    leg: int
    kind: str
    recorded: int
    replayed: int
    compared: int
    equal: int
    missing: int
    not_recorded: int
    largest_difference: float | None
    first_difference_s: float | None
    rounded: bool
    excused: bool

    @property
    def verdict(self) -> str:
        """One of ``equal``, ``rounding``, ``different`` and, if excused, ``gap``."""
        if self.first_difference_s is None:
            return 'equal'
        if self.rounded:
            return 'rounding'
        return 'gap' if self.excused else 'different'


def compare(
    topic: str,
    leg: int,
    kind: str,
    recorded: Track,
    replayed: Track,
    start_ns: int = 0,
    period_ns: int = 20_000_000,
    gap_ns: int | None = None,
) -> Comparison:
    """Compare a topic with its replay, message by message.

    Messages belong together when the recorded one came at most nine tenths of a period after
    what the replayed one follows from, and not more than one tenth before it: topics may
    overtake one another on their way into a bag.

    Parameters
    ----------
    topic, leg, kind
        See :class:`Comparison`.
    recorded, replayed : Track
        What was recorded on the topic, and what the replay has.
    start_ns : int
        When the bag begins.
    period_ns : int
        Between messages.
    gap_ns : int or None
        Since when what was not recorded may tell.
    """
    one, other = np.array(recorded.keys, dtype=np.int64), np.array(replayed.keys, dtype=np.int64)
    rows = np.argsort(other, kind='stable')
    place = np.searchsorted(other[rows], one + period_ns // 10, 'right') - 1
    near = place >= 0
    near[near] = one[near] - other[rows[place[near]]] < 9 * period_ns // 10
    # The first of several that fit is the one.
    _, first = np.unique(np.where(near, place, -1), return_index=True)
    own = np.zeros(len(one), dtype=bool)
    own[first] = True
    own &= near
    theirs = rows[place[own]]
    times = np.array(recorded.times, dtype=np.int64)
    lost = np.empty(0, dtype=np.int64)
    largest: float | None = None
    if recorded.width:
        before, after = recorded.values[own], replayed.values[theirs]
        both_nan = np.isnan(before) & np.isnan(after)
        same = (before == after) | both_nan
        with np.errstate(invalid='ignore'):
            apart = np.nan_to_num(np.abs(before - after), nan=math.inf, posinf=math.inf)
        apart[same] = 0.0
        largest = float(apart.max(initial=0.0))
        far = (apart > ROUNDING * np.maximum(1.0, np.abs(np.nan_to_num(before)))).any(axis=1)
        same = same.all(axis=1)
    else:
        pairs = zip(np.flatnonzero(own), theirs, strict=True)
        same = np.array([recorded.texts[i] == replayed.texts[j] for i, j in pairs], dtype=bool)
        far = ~same
        # Text is sent when it changes: one more is a difference.
        lost = np.delete(np.array(replayed.times, dtype=np.int64), theirs)
    parting = np.concatenate([times[own][~same], times[~own], lost])
    grave = np.concatenate([times[own][far], times[~own], lost])
    return Comparison(
        topic=topic,
        leg=leg,
        kind=kind,
        recorded=len(recorded),
        replayed=len(replayed),
        compared=int(own.sum()),
        equal=int(same.sum()),
        missing=int((~own).sum()),
        not_recorded=len(replayed) - int(own.sum()),
        largest_difference=largest,
        first_difference_s=(int(parting.min()) - start_ns) * 1e-9 if len(parting) else None,
        rounded=not len(grave),
        excused=gap_ns is not None and len(grave) > 0 and int(grave.min()) >= gap_ns,
    )
