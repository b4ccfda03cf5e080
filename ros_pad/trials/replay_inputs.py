# SPDX-License-Identifier: Apache-2.0
"""Read the records that a replay needs from a bag, also those that drivers published by leg."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.bags import BagReader
from ros_pad.bags.topics import FROM_DRIVERS
from ros_pad.bags.topics import STAMP
from ros_pad.bags.topics import to_record
from ros_pad.errors import BagError
from ros_pad.joining import Joiner
from ros_pad.pace import Progress
from ros_pad.pace import part
from ros_pad.records import COMMAND
from ros_pad.records import ESTIMATE
from ros_pad.records import PRESSURE
from ros_pad.records import SAMPLE
from ros_pad.records import Kind
from ros_pad.trials.comparison import Stream
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.recorded import Wanted

LONGER = 1.6
"""A time between two messages that is longer than their median time by this factor is a gap."""


class Gap(NamedTuple):
    """A gap in the recorded inputs: its log time, ns, what has it, and in how many places."""

    time_ns: int
    what: str
    count: int


class Inputs(NamedTuple):
    """What was recorded of a robot.

    Attributes
    ----------
    legs : tuple of int
        Legs that can be replayed.
    streams : dict of Stream
        Records by name of their kind: ``sample`` and ``pressure`` with these legs; ``estimate``
        and ``command`` only if there are any.
    topics : dict of str
        Topic of recorded records, by name of their kind.
    gaps : list of Gap
        The first gap of each input.
    absent : list of int
        Legs of the robot of which no sample was recorded.
    """

    legs: tuple[int, ...]
    streams: dict[str, Stream]
    topics: dict[str, str]
    gaps: list[Gap]
    absent: list[int]


def read(
    bag: BagReader,
    wanted: Mapping[str, Wanted],
    settings: NodeSettings,
    progress: Progress | None = None,
) -> Inputs:
    """Read the records of a robot.

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
    kinds = {
        name: each.topic.record
        for name, each in wanted.items()
        if each.leg is None and each.topic.record
    }
    streams = {
        kinds[name].name: Stream(kinds[name], *found)
        for name, found in bag.records(kinds, part(progress, 0.0, 0.5)).items()
    }
    arrivals = [(kind, each.times, each.block.stamps) for kind, each in streams.items()]
    for kind in (SAMPLE, PRESSURE):
        if kind.name not in streams:
            pieces = _Pieces(bag, wanted, kind, settings.ambient_pressure)
            arrivals += pieces.arrivals()
            streams[kind.name] = pieces.joined(settings)
    legs = streams[SAMPLE.name].legs
    if not legs:
        raise BagError(
            f'{bag.path}: no wrench of a leg was recorded; the topics are'
            f' {", ".join(sorted(bag.topics))}. If one has wrenches, name it with a remap'
        )
    known = {*settings.legs}.union(*(each.legs for each in streams.values()))
    streams[PRESSURE.name] = streams[PRESSURE.name].of_legs(legs)
    inputs = [each for each in arrivals if each[0] not in (ESTIMATE.name, COMMAND.name)]
    if progress:
        progress(1.0)
    return Inputs(
        legs,
        streams,
        {kind.name: name for name, kind in kinds.items()},
        [gap for each in inputs if (gap := _first_gap(*each))],
        sorted(known - set(legs)),
    )


def _first_gap(
    what: str, times: npt.NDArray[np.int64], stamps: npt.NDArray[np.int64]
) -> Gap | None:
    steps = np.diff(stamps)
    usual = np.median(steps) if len(steps) else 0.0
    wide = np.flatnonzero(steps > LONGER * usual)
    return Gap(int(times[wide[0]]), what, len(wide)) if usual > 0.0 and len(wide) else None


class _Pieces:
    """What drivers published by leg for one kind of record."""

    def __init__(
        self, bag: BagReader, wanted: Mapping[str, Wanted], kind: Kind, ambient: float
    ) -> None:
        self._kind = kind
        self._wanted = {
            name: each
            for name, each in wanted.items()
            if each.topic in FROM_DRIVERS and each.topic.record is kind
        }
        paths = {name: (*STAMP, *each.topic.values) for name, each in self._wanted.items()}
        self._tables = {}
        for name, (times, table) in bag.tables(paths).items():
            seconds, fraction = table[:, :2].astype(np.int64).T
            stamps = seconds * 1_000_000_000 + fraction
            stamps = np.where(stamps == 0, times, stamps)  # a driver may leave the stamp empty
            numbers = to_record(self._wanted[name].topic, table[:, 2:], ambient)
            self._tables[name] = times, stamps, numbers

    def arrivals(self) -> Iterator[tuple[str, npt.NDArray[np.int64], npt.NDArray[np.int64]]]:
        """Yield name, log times and stamps, ns, of the messages on each topic."""
        for name, (times, stamps, _) in self._tables.items():
            each = self._wanted[name]
            yield f'{each.topic.kind} of leg {each.leg}', times, stamps

    def joined(self, settings: NodeSettings) -> Stream:
        """Return the records, with the log time of the last message of each."""
        driving = {'wrench', 'pressure'}
        legs = {
            each.leg
            for each in self._wanted.values()
            if each.leg is not None and each.topic.kind in driving
        }
        # Keep the order of the legs in the controller of the bag, around the body.
        order = (*(leg for leg in settings.legs if leg in legs), *sorted(legs - {*settings.legs}))
        needed: tuple[str, ...] = ()
        if self._kind is SAMPLE:
            needed = ('force', 'position')
            needed += ('velocity',) if settings.tuning.source == 'joints' else ()
        joiner = Joiner(self._kind, order, needed)
        found, last_ns = [], 0
        for last_ns, stamp_ns, each, values in self._messages():
            if each.leg in legs:
                numbers = dict(zip(each.topic.columns, values, strict=True))
                found += [(last_ns, block) for block in joiner.add(each.leg, stamp_ns, numbers)]
        found += [(last_ns, block) for block in joiner.expire(np.inf)]
        return Stream.of(self._kind, order, found)

    def _messages(self) -> Iterator[tuple[int, int, Wanted, list[float]]]:
        """Yield log time and stamp, ns, topic and numbers of all messages, as they came."""
        tables = list(self._tables.values())
        if not tables:
            return
        sources = np.repeat(np.arange(len(tables)), [len(times) for times, _, _ in tables])
        rows = np.concatenate([np.arange(len(times)) for times, _, _ in tables])
        order = np.argsort(np.concatenate([times for times, _, _ in tables]), kind='stable')
        topics = [self._wanted[name] for name in self._tables]
        plain = [
            (times.tolist(), stamps.tolist(), numbers.tolist())
            for times, stamps, numbers in tables
        ]
        for source, row in zip(sources[order].tolist(), rows[order].tolist(), strict=True):
            times, stamps, numbers = plain[source]
            yield times[row], stamps[row], topics[source], numbers[row]
