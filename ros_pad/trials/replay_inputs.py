# SPDX-License-Identifier: Apache-2.0
"""Read the records that a replay needs from a bag, and tell what they lack."""

from __future__ import annotations

import math
from collections.abc import Iterator
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.errors import BagError
from ros_pad.joining import Joiner
from ros_pad.pace import Progress
from ros_pad.records import COMMAND
from ros_pad.records import ESTIMATE
from ros_pad.records import KINDS
from ros_pad.records import PRESSURE
from ros_pad.records import SAMPLE
from ros_pad.records import Block
from ros_pad.trials.comparison import Stream
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import Wanted
from ros_pad.trials.recorded import read_records

LONGER = 1.6
"""A time between two messages that is longer than their median time by this factor is a gap."""


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
    absent : list of int
        Other legs of the robot.
    streams : dict of Stream
        Records by name of their kind, of these legs.
    topics : dict of str
        Topic of those that were recorded as records, by name of their kind.
    gaps : list of Gap
        The gaps of each input that has any.
    """

    legs: tuple[int, ...]
    absent: list[int]
    streams: dict[str, Stream]
    topics: dict[str, str]
    gaps: list[Gap]


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
    known, records, times = read_records(bag, wanted, settings.ambient_pressure, progress)
    topics = {
        each.topic.record.name: name
        for name, each in wanted.items()
        if each.topic.record and each.leg is None
    }
    felt = np.isfinite(records.sample.rows['force'][..., 2]).any(axis=0)
    legs = {leg for leg, there in zip(known, felt, strict=True) if there or SAMPLE.name in topics}
    if not legs or not len(records.sample.stamps):
        raise BagError(
            f'{bag.path}: no wrench of a leg was recorded; the topics are'
            f' {", ".join(sorted(bag.topics))}. If one has wrenches, name it with a remap'
        )
    # Keep the order of the legs in the controller of the bag, around the body.
    order = (*(leg for leg in settings.legs if leg in legs), *sorted(legs - {*settings.legs}))
    places = [known.index(leg) for leg in order]
    streams = {
        kind.name: Stream(kind, order, times[kind.name], Block(stamps, rows[:, places])).where(
            np.argsort(times[kind.name], kind='stable')
        )
        for kind, (stamps, rows) in zip(KINDS, records, strict=True)
    }
    needed = ('force', 'position', 'velocity')[: 3 if settings.tuning.source == 'joints' else 2]
    gaps: list[Gap] = []
    for kind, fields in ((SAMPLE, needed), (PRESSURE, ('pressure',))):
        if kind.name in topics:
            stream = streams[kind.name]
            gaps += _gaps(kind.name, stream.times, stream.block.stamps)
        else:
            gaps += _gaps_of_legs(streams[kind.name], fields)
    command, estimate = streams[COMMAND.name], streams[ESTIMATE.name]
    if not np.array_equal(command.times, command.block.stamps):
        # In real time, commands without an estimate have stamps that no replay has.
        kept = np.isin(command.block.stamps, estimate.block.stamps)
        kept |= np.isfinite(command.block.rows['setpoint']).any(axis=1)
        streams[COMMAND.name] = command.where(kept)
    if SAMPLE.name not in topics:
        streams[SAMPLE.name] = _joined(streams[SAMPLE.name], needed)
    return Inputs(order, sorted({*known, *settings.legs} - legs), streams, topics, gaps)


def _joined(pieces: Stream, needed: tuple[str, ...]) -> Stream:
    """Return records of all legs, with the log time of the last piece of each."""
    kind, legs, times, (stamps, rows) = pieces
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


def _gaps_of_legs(pieces: Stream, fields: tuple[str, ...]) -> Iterator[Gap]:
    for name in fields:
        there = ~np.isnan(pieces.values(name)).all(axis=2)
        for leg, own in zip(pieces.legs, there.T, strict=True):
            what = f'{name} of leg {leg}'
            yield from _gaps(what, pieces.times[own], pieces.block.stamps[own])


def _gaps(what: str, times: np.ndarray, stamps: np.ndarray) -> Iterator[Gap]:
    steps = np.diff(stamps)
    wide = np.flatnonzero(steps > LONGER * max(np.median(steps), 0.0)) if len(steps) else steps
    if len(wide):
        yield Gap(int(times[wide[0]]), what, len(wide))


def missing(inputs: Inputs, settings: NodeSettings) -> list[str]:
    """Return notes on legs of which something was not recorded at all, one sentence each.

    Parameters
    ----------
    inputs : Inputs
        What was recorded.
    settings : NodeSettings
        Settings of the replay.
    """
    needed = [
        ('sample', 'position', 'no position was recorded, so there are no estimates'),
        ('pressure', 'pressure', 'no pressure was recorded, so its pads are assumed to be flat'),
    ]
    if settings.tuning.source == 'joints':
        text = (
            'no velocity of the contact was recorded, which source joints needs, so there are no'
            ' estimates'
        )
        needed.append(('sample', 'velocity', text))
    text = 'no wrench was recorded, so the decisions for other legs lack its footprints'
    found = [(inputs.absent, text)]
    for kind, field, text in needed:
        known = np.isfinite(inputs.streams[kind].values(field)).any(axis=(0, 2))
        legs = [leg for leg, there in zip(inputs.legs, known, strict=True) if not there]
        found.append((legs, text))
    return [f'leg {", ".join(map(str, legs))}: {text}' for legs, text in found if legs]


__all__ = ['Gap', 'Inputs', 'missing', 'read']
