# SPDX-License-Identifier: Apache-2.0
"""One definition of slip for all studies, and what an alarm makes of it.

A slip is a displacement of the contact in one stance, of 3, 5 or 10 mm from where it was when the
foot had landed, 24 ms after touch-down. It begins when the contact was last within a quarter of a
millimetre of there, or at touch-down if it left within 24 ms more. It is found by an alarm that
begins later in that stance: one that is already on finds nothing. A foot sticks while its contact
moves less than half a millimetre from 0.1 s before to 60 ms after; an alarm that begins then is
false.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import stats

from ros_pad.robots.rotation import Array
from studies.samples import Flags, bootstrap, runs, share_interval

SIZES = (3e-3, 5e-3, 10e-3)
"""Sizes of slips, m."""

LANDING = 0.024  # s, in which feet skid on any ground
BEGINS, STILL = 0.25e-3, 0.5e-3  # m
BEFORE, AFTER = 0.1, 0.06  # s
FEW = 10  # events a walk, on average, below which intervals are exact


@dataclass
class Alarms:
    """What an alarm did in one walk.

    Attributes
    ----------
    slips, missed : dict of float to int
        Numbers of slips by size, m, and of those that were not found.
    delays : list of float
        Times from the beginnings of slips of 5 mm to their alarms, s.
    false : int
        False alarms.
    minutes : float
        Time in which feet stick, min.
    """

    slips: dict[float, int] = field(default_factory=lambda: dict.fromkeys(SIZES, 0))
    missed: dict[float, int] = field(default_factory=lambda: dict.fromkeys(SIZES, 0))
    delays: list[float] = field(default_factory=list)
    false: int = 0
    minutes: float = 0.0


def judged(on: Flags, loaded: Flags, place: Array, period: float, begin: float) -> Alarms:
    """Return what alarms did.

    Parameters
    ----------
    on, loaded : array of bool (samples, legs)
        Whether the alarm is on, and whether the foot carries load.
    place : array (samples, legs, 2)
        Places of the contacts, m.
    period : float
        Between samples, s.
    begin : float
        Time from which samples count, s.
    """
    found = Alarms()
    for leg in range(on.shape[1]):
        for first, last in runs(loaded[:, leg]):
            first = max(first, round(begin / period))
            if (last - first) * period > 2.0 * LANDING:
                stance = slice(first, last)
                _judge(found, on[stance, leg], place[stance, leg], period)
    return found


def _judge(found: Alarms, on: Flags, place: Array, period: float) -> None:
    """Add a stance."""
    landing, before, after = (round(span / period) for span in (LANDING, BEFORE, AFTER))
    starts = on & ~np.r_[False, on[:-1]]
    index = np.arange(landing, len(on))
    early, late = np.maximum(index - before, 0), np.minimum(index + after, len(on) - 1)
    apart = np.linalg.norm(
        [place[late] - place[early], place[late] - place[index], place[index] - place[early]],
        axis=2,
    )
    sticks = apart.max(0) < STILL
    found.minutes += float(sticks.sum()) * period / 60.0
    found.false += int(starts[landing:][sticks].sum())
    away = np.linalg.norm(place[landing:] - place[landing], axis=1)
    for size in SIZES:
        if not (away > size).any():
            continue
        end = int(np.argmax(away > size))
        begins = int(np.flatnonzero(away[:end] < BEGINS)[-1])
        begins = begins + landing if begins > landing else 0
        found.slips[size] += 1
        later = np.flatnonzero(starts[begins:])
        found.missed[size] += not later.size
        if later.size and size == SIZES[1]:
            found.delays.append(float(later[0]) * period)


def missed(walks: Sequence[Alarms], size: float) -> tuple[float | None, float, float]:
    """Return the share of slips of a size, m, that were missed, and its 95 % interval.

    By bootstrap over walks where there are several misses a walk, else Clopper and Pearson's.
    """
    pairs = [(each.missed[size], each.slips[size]) for each in walks if each.slips[size]]
    hits, count = sum(pair[0] for pair in pairs), sum(pair[1] for pair in pairs)
    low, high = share_interval(hits, count)
    if pairs and hits >= FEW * len(pairs):
        low, high = bootstrap(pairs, 2000)
    return hits / count if count else None, low, high


def false_alarms(walks: Sequence[Alarms]) -> tuple[float | None, float, float]:
    """Return false alarms a minute of sticking, and their 95 % interval.

    By bootstrap over walks where there are several a walk, else that of a Poisson process: with
    none, at most about three in all the time (rule of three).
    """
    count, minutes = (sum(getattr(each, name) for each in walks) for name in ('false', 'minutes'))
    if not minutes:
        return None, 0.0, math.inf
    if count >= FEW * len(walks):
        low, high = bootstrap([(each.false, each.minutes) for each in walks], 2000)
        return count / minutes, low, high
    low = stats.chi2.ppf(0.025, 2 * count) / 2.0 if count else 0.0
    high = stats.chi2.ppf(0.975 if count else 0.95, 2 * count + 2) / 2.0
    return count / minutes, float(low) / minutes, float(high) / minutes


def differences(walks: Sequence[Alarms], others: Sequence[Alarms], size: float) -> Array:
    """Return the 95 % intervals, (2, 2), of what an alarm misses more than another.

    Of the share of slips of a size, m, then of false alarms a minute, by bootstrap over the walks,
    which both have in common.
    """
    drawn = np.random.default_rng(0).integers(len(walks), size=(2000, len(walks)))
    counts = np.array([
        [(each.missed[size], each.false, each.slips[size], each.minutes) for each in alarms]
        for alarms in (walks, others)
    ], dtype=float)[:, drawn].sum(axis=2)  # fmt: skip
    ours, theirs = counts[..., :2] / np.maximum(counts[..., 2:], 1e-9)
    return np.asarray(np.quantile(ours - theirs, (0.025, 0.975), axis=0).T)


def row_of(walks: Sequence[Alarms]) -> dict[str, Any]:
    """Return slips, shares missed, false alarms a minute with intervals, minutes and latency."""
    delays = [each for walk in walks for each in walk.delays]
    found: dict[str, Any] = {}
    for size in SIZES:
        name = f'{1e3 * size:g}_mm'
        found[f'slips_{name}'] = sum(each.slips[size] for each in walks)
        share, *interval = missed(walks, size)
        found |= {f'missed_{name}': share, f'missed_{name}_interval': interval}
    rate, *interval = false_alarms(walks)
    return found | {
        'false_alarms_a_minute': rate,
        'false_alarms_interval': interval,
        'minutes_of_sticking': sum(each.minutes for each in walks),
        'latency_s': float(np.median(delays)) if delays else None,
    }
