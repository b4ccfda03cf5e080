# SPDX-License-Identifier: Apache-2.0
"""What was recorded on a topic against what a replay has on it, message by message."""

from __future__ import annotations

import bisect
import math
from array import array
from collections.abc import Callable
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

    def since(self, time_ns: int) -> Track:
        """Return the texts from a time on."""
        made = Track(self.width)
        for at_ns, text in zip(self.times, self.texts, strict=True):
            if at_ns >= time_ns:
                made.say(at_ns, text)
        return made

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
    look_ns: int = 0,
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
    look_ns : int
        Where texts are told when somebody looks, and nobody knows when that was: how far they
        may be apart. How long a silence lasted by then is not compared.
    """
    said = _without_length if look_ns else str
    early_ns, late_ns = period_ns // 10, 9 * period_ns // 10
    if look_ns and not recorded.width:
        early_ns = late_ns = look_ns
    pairs = _pairs(recorded, replayed, early_ns, late_ns, said)
    own = np.zeros(len(recorded), dtype=bool)
    own[[i for i, _ in pairs]] = True
    theirs = np.array([j for _, j in sorted(pairs)], dtype=int)
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
        same = np.array(
            [said(recorded.texts[i]) == said(replayed.texts[j]) for i, j in sorted(pairs)],
            dtype=bool,
        )
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


def _pairs(
    recorded: Track, replayed: Track, early_ns: int, late_ns: int, said: Callable[[str], str]
) -> list[tuple[int, int]]:
    """Return the places of messages that belong together, in order: each is used once.

    Of several that fit, the nearest one is taken, or of texts the first that says the same.
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
            text = said(recorded.texts[row])
            while fits(best, key) and said(replayed.texts[theirs[best]]) != text:
                best += 1
            best = best if fits(best, key) else at
        if fits(best, key):
            found.append((row, theirs[best]))
            at = best + 1
    return found


def _without_length(text: str) -> str:
    return text.partition(':')[0] if text.startswith(('no wrench', 'no position')) else text
