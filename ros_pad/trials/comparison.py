# SPDX-License-Identifier: Apache-2.0
"""Compare the recorded messages of a topic, one by one, with those of its replay."""

from __future__ import annotations

import bisect
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field

import numpy as np

ROUNDING = 1e-12
"""Largest difference that counts as rounding, relative to the recorded number (below 1: to 1).

NumPy's exponential differs between processors in the last bit."""


@dataclass
class Track:
    """The messages on one topic.

    Attributes
    ----------
    width : int
        Number of values in a message; 0 for a text.
    times : array of int
        Log time of each message, ns; in a replay, the log time of the last input before it.
    keys : array of int
        Time by which each message is matched, ns: its stamp, or ``times`` where it has none.
    numbers : array of float
        Values of all messages, one message after the other; empty for texts.
    texts : list of str
        Texts of all messages; empty for numbers.
    """

    width: int
    times: array[int] = field(default_factory=lambda: array('q'))
    keys: array[int] = field(default_factory=lambda: array('q'))
    numbers: array[float] = field(default_factory=lambda: array('d'))
    texts: list[str] = field(default_factory=list)

    def add(self, time_ns: int, numbers: tuple[float, ...], key_ns: int | None = None) -> None:
        """Append a message of numbers: its log time and, if it has one, its stamp, ns."""
        self.times.append(time_ns)
        self.keys.append(time_ns if key_ns is None else key_ns)
        self.numbers.extend(numbers)

    def add_text(self, time_ns: int, text: str) -> None:
        """Append a message of text with its log time, ns."""
        self.times.append(time_ns)
        self.keys.append(time_ns)
        self.texts.append(text)

    def __len__(self) -> int:
        return len(self.times)

    def since(self, time_ns: int) -> Track:
        """Return a track of the texts from a log time, ns, on."""
        made = Track(self.width)
        for at_ns, text in zip(self.times, self.texts, strict=True):
            if at_ns >= time_ns:
                made.add_text(at_ns, text)
        return made

    @property
    def values(self) -> np.ndarray:
        """Values of the messages, shape (messages, width)."""
        return np.array(self.numbers).reshape(len(self), self.width)

    def at(self, time_ns: int) -> float | None:
        """Return the first value of the last message up to a log time, ns, or None."""
        place = bisect.bisect_right(self.times, time_ns)
        return self.numbers[(place - 1) * self.width] if place else None


@dataclass(frozen=True)
class Comparison:
    """Result of comparing a recorded topic with its replay.

    Attributes
    ----------
    topic : str
        Name in the bag.
    leg : int
    kind : str
        Kind of the topic, such as ``wetness``.
    recorded, replayed : int
        Numbers of messages.
    compared, equal : int
        Number of messages that are in the bag and in the replay, and how many of these are equal
        to the bit.
    missing : int
        Number of recorded messages that the replay does not have.
    not_recorded : int
        Number of messages of the replay that were not recorded. Texts among them count as
        differences, because a text is published only when it changes; numbers count as lost by
        the recorder.
    largest_difference : float or None
        Largest difference of two numbers, in the unit of the message, inf if only one of them is
        NaN; None for text.
    first_difference_s : float or None
        Time of the first message that differs or is missing, s after the beginning of the bag.
    rounded : bool
        Whether no message is missing, and no difference is larger than :data:`ROUNDING`.
    excused : bool
        Whether all larger differences and missing messages come after a gap in the recorded
        inputs: lost inputs cannot be replayed, and may be the cause.
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
        """``equal``, ``rounding``, ``gap`` (an excused difference) or ``different``."""
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
    look_ns: int = 0,
) -> Comparison:
    """Compare a topic with its replay, message by message.

    Two messages match when the key of the recorded one is at most 0.9 periods after that of the
    replayed one, and at most 0.1 periods before it: topics may be recorded in another order than
    they were published.

    Parameters
    ----------
    topic, leg, kind
        See :class:`Comparison`.
    recorded, replayed : Track
        Messages on the topic, recorded and replayed.
    start_ns : int
        Beginning of the bag, ns.
    period_ns : int
        Period of the messages, ns.
    gap_ns : int or None
        Time of the first gap in the recorded inputs, ns, after which differences are excused; -1
        if an input is missing altogether, None if nothing is missing.
    look_ns : int
        Largest time between matching texts, ns, for a bag without ``/clock``, which does not show
        when the nodes published them; the duration of a silence, which depends on that time, is
        then not compared. 0 matches texts like numbers.
    """
    content = _without_length if look_ns else str
    early_ns, late_ns = period_ns // 10, 9 * period_ns // 10
    if look_ns and not recorded.width:
        early_ns = late_ns = look_ns
    pairs = _pairs(recorded, replayed, early_ns, late_ns, content)
    own = np.zeros(len(recorded), dtype=bool)
    own[[i for i, _ in pairs]] = True
    theirs = np.array([j for _, j in sorted(pairs)], dtype=int)
    times = np.array(recorded.times, dtype=np.int64)
    lost = np.empty(0, dtype=np.int64)
    largest: float | None = None
    if recorded.width:
        same, far, largest = _differences(recorded.values[own], replayed.values[theirs])
    else:
        same = np.array(
            [content(recorded.texts[i]) == content(replayed.texts[j]) for i, j in sorted(pairs)],
            dtype=bool,
        )
        far = ~same
        # A text is published only when it changes, so an additional one is a difference.
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


def _differences(before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return which messages are equal, which differ by more than rounding, and by how much."""
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid='ignore'):
        apart = np.nan_to_num(np.abs(before - after), nan=math.inf, posinf=math.inf)
    apart[same] = 0.0
    far = apart > ROUNDING * np.maximum(1.0, np.abs(np.nan_to_num(before)))
    return same.all(axis=1), far.any(axis=1), float(apart.max(initial=0.0))


def _pairs(
    recorded: Track, replayed: Track, early_ns: int, late_ns: int, content: Callable[[str], str]
) -> list[tuple[int, int]]:
    """Return the indices of matched messages, in order; each message is used once.

    Of several numbers that match, the nearest is taken; of several texts, the first that is equal
    or, if none is equal, the first.
    """
    rows = sorted(range(len(recorded)), key=recorded.keys.__getitem__)
    theirs = sorted(range(len(replayed)), key=replayed.keys.__getitem__)
    found, at = [], 0

    def fits(place: int, key: int) -> bool:
        return place < len(theirs) and replayed.keys[theirs[place]] <= key + early_ns

    for row in rows:
        key = recorded.keys[row]
        while at < len(theirs) and replayed.keys[theirs[at]] <= key - late_ns:
            at += 1
        best = at
        if recorded.width:
            while fits(best + 1, key) and abs(replayed.keys[theirs[best + 1]] - key) < abs(
                replayed.keys[theirs[best]] - key
            ):
                best += 1
        else:
            text = content(recorded.texts[row])
            while fits(best, key) and content(replayed.texts[theirs[best]]) != text:
                best += 1
            best = best if fits(best, key) else at
        if fits(best, key):
            found.append((row, theirs[best]))
            at = best + 1
    return found


def _without_length(text: str) -> str:
    return text.partition(':')[0] if text.startswith(('no wrench', 'no position')) else text
