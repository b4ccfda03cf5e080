# SPDX-License-Identifier: Apache-2.0
"""Read the records that a replay needs from a bag, and tell what they lack."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.errors import BagError
from ros_pad.joining import Joiner
from ros_pad.pace import Progress
from ros_pad.records import KINDS, PRESSURE, SAMPLE, Block, Kind
from ros_pad.trials.comparison import Stream
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import Wanted, read_records

LONGER = 1.6
"""A time between two messages that is longer than their median time by this factor is a gap."""

_NEVER = np.iinfo(np.int64).max


class Gap(NamedTuple):
    """Gaps in a recorded input: log time of the first one, ns, what has them, and their number."""

    time_ns: int
    what: str
    places: int


class Inputs(NamedTuple):
    """What was recorded of a robot.

    Attributes
    ----------
    legs : tuple of int
        Legs that can be replayed.
    streams : dict of Stream
        Records by name of their kind, of these legs.
    topics : dict of str
        Topic of those that were recorded as records, by name of their kind.
    gaps : list of Gap
        The gaps of each input that has any.
    lacks : list of str
        Notes on what was not recorded at all.
    late : str
        Note on samples that are left out because the estimator started later; empty if none are.
    """

    legs: tuple[int, ...]
    streams: dict[str, Stream]
    topics: dict[str, str]
    gaps: list[Gap]
    lacks: list[str]
    late: str


def read(
    bag: BagReader,
    wanted: Mapping[str, Wanted],
    settings: NodeSettings,
    progress: Progress | None = None,
) -> Inputs:
    """Read the records of a robot; what drivers published by leg is joined into records.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    wanted : mapping
        What each topic is, see :func:`ros_pad.trials.recorded.wanted_topics`.
    settings : NodeSettings
        Settings of the replay.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Raises
    ------
    BagError
        When there is no wrench of any leg, or a message cannot be read.
    """
    known, records, times, _ = read_records(bag, wanted, settings.ambient_pressure, progress)
    topics = {
        each.topic.record.name: name
        for name, each in wanted.items()
        if each.topic.record and each.leg is None
    }
    felt = np.isfinite(records.sample.rows['force'][..., 2]).any(axis=0)
    there = {leg for leg, own in zip(known, felt, strict=True) if own or SAMPLE.name in topics}
    if not there or not len(records.sample.stamps):
        raise BagError(
            f'{bag.path}: no wrench of a leg was recorded; the topics are'
            f' {", ".join(sorted(bag.topics))}. If one has wrenches, name it with a remap'
        )
    # Keep the order of the legs in the controller of the bag, around the body.
    legs = (*(leg for leg in settings.legs if leg in there), *sorted(there - {*settings.legs}))
    places = [known.index(leg) for leg in legs]
    streams = {
        kind.name: Stream(kind, legs, times[kind.name], Block(stamps, rows[:, places]))
        for kind, (stamps, rows) in zip(KINDS, records, strict=True)
    }
    joints = settings.tuning.source == 'joints'
    needed = ('force', 'position', 'velocity') if joints else ('force', 'position')
    gaps = [*_gaps(streams, topics, SAMPLE, needed), *_gaps(streams, topics, PRESSURE)]
    if SAMPLE.name not in topics:
        streams[SAMPLE.name] = _joined(streams[SAMPLE.name], needed)
    late = _leave_out(streams)
    gaps = [gap for gap in gaps if gap.time_ns >= streams[SAMPLE.name].times[0]]
    lacks = _lacks(streams, legs, sorted({*known, *settings.legs} - there), joints)
    return Inputs(legs, streams, topics, gaps, lacks, late)


def _leave_out(streams: dict[str, Stream]) -> str:
    """Leave out what no replay can have; return a note on samples among it."""
    samples, estimates, commands = (streams[n] for n in ('sample', 'estimate', 'command'))
    for each in (estimates, commands):
        # Between samples, nodes tell of silent feet, with stamps that no replay has.
        stamps, wide = each.block.stamps, _wide(samples.block.stamps)
        there = np.isin(np.searchsorted(samples.block.stamps, stamps) - 1, wide)
        there |= np.isin(stamps, samples.block.stamps)
        streams[each.kind.name] = each.where(there)
    # An estimator makes its first estimate of its first sample.
    stamps, rows = estimates.block
    begun = np.isin(stamps, samples.block.stamps) | np.isfinite(rows['load']).any(axis=1)
    kept = samples.block.stamps >= stamps[begun].min(initial=_NEVER)
    if kept.all() or not kept.any():  # none, where there are no estimates
        return ''
    streams[SAMPLE.name] = samples.where(kept)
    return (
        'the estimator started later than the recorder, so the replay leaves out the'
        f' {int(np.sum(~kept))} samples before its first recorded estimate'
    )


def _joined(pieces: Stream, needed: tuple[str, ...]) -> Stream:
    """Return records of all legs, with the log time of the last piece of each."""
    kind, legs, times, (stamps, rows) = pieces.where(np.argsort(pieces.times, kind='stable'))
    joiner, found, time_ns = Joiner(kind, legs, needed), [], 0
    numbers = rows.view('f8').reshape(*rows.shape, -1)
    columns = zip(times.tolist(), stamps.tolist(), numbers, strict=True)
    for time_ns, stamp_ns, each in columns:
        for row in np.flatnonzero(~np.isnan(each).all(axis=1)).tolist():
            values = dict(zip(kind.columns, each[row].tolist(), strict=True))
            values = {name: value for name, value in values.items() if not math.isnan(value)}
            found += [(time_ns, block) for block in joiner.add(legs[row], stamp_ns, values)]
    found += [(time_ns, block) for block in joiner.expire(math.inf)]
    return Stream.of(kind, legs, found)


def _gaps(
    streams: Mapping[str, Stream],
    topics: Mapping[str, str],
    kind: Kind,
    fields: tuple[str, ...] = ('pressure',),
) -> Iterator[Gap]:
    """Yield the gaps of records or, where drivers published by leg, of each field and leg."""
    stream, sources = streams[kind.name], {}
    if kind.name in topics:
        sources[kind.name] = np.full(len(stream.times), True)
    else:
        for name in fields:
            own = ~np.isnan(stream.values(name)).all(axis=2)
            sources |= {f'{name} of leg {leg}': own[:, i] for i, leg in enumerate(stream.legs)}
    for what, there in sources.items():
        wide = _wide(stream.block.stamps[there])
        if len(wide):
            yield Gap(int(stream.times[there][wide[0]]), what, len(wide))


def _wide(stamps: np.ndarray) -> np.ndarray:
    """Return the places of the records after which there is a gap."""
    steps = np.diff(stamps)
    return np.flatnonzero(steps > LONGER * max(np.median(steps), 0.0)) if len(steps) else steps


def _lacks(
    streams: Mapping[str, Stream], legs: tuple[int, ...], absent: list[int], joints: bool
) -> list[str]:
    """Return notes on legs of which something was not recorded at all, one sentence each."""
    needed = [
        ('sample', 'position', 'no position was recorded, so there are no estimates'),
        ('pressure', 'pressure', 'no pressure was recorded, so its pads are assumed to be flat'),
    ]
    if joints:
        text = (
            'no velocity of the contact was recorded, which source joints needs, so there are no'
            ' estimates'
        )
        needed.append(('sample', 'velocity', text))
    text = 'no wrench was recorded, so the decisions for other legs lack its footprints'
    found = [(absent, text)]
    for kind, field, text in needed:
        known = np.isfinite(streams[kind].values(field)).any(axis=(0, 2))
        found.append(([leg for leg, own in zip(legs, known, strict=True) if not own], text))
    return [f'leg {", ".join(map(str, some))}: {text}' for some, text in found if some]


__all__ = ['Gap', 'Inputs', 'read']
