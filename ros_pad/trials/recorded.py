# SPDX-License-Identifier: Apache-2.0
"""Read trials from bags, simulated or of a robot: their series and metrics.

A bag of ``pad run`` gives the same series as the loop without ROS to the bit, but for
the body's heading, which is published as a quaternion (1e-15 rad). The bag of a robot may have
other rates, gaps, missing legs and a namespace, and messages by leg in place of records: a series
repeats the last value, and is NaN before the first one.
"""

from __future__ import annotations

import contextlib
import datetime
import json
import math
import operator
import os
import pathlib
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.reader import Table
from ros_pad.bags.recovery import KEY as REPAIR
from ros_pad.bags.topics import BODY_POSE, DIAGNOSTICS, ODOM, STAMP, TRIAL, Topic, to_record
from ros_pad.configuration import choice
from ros_pad.errors import BagError, InvalidInput
from ros_pad.joining import Joiner
from ros_pad.pace import LATE, Progress, part
from ros_pad.records import KINDS, Kind
from ros_pad.trials import bag_notes
from ros_pad.trials.comparison import Stream
from ros_pad.trials.series import Poses, Records, by_row, trial_of
from ros_pad.trials.trial import Trial, heading

NEEDED = ('force', 'position', 'velocity')
"""Fields for which a record of samples waits, if anybody publishes them."""

_Piece: TypeAlias = tuple[int, int, int, dict[str, float]]
_KNOWN = {topic.pattern: topic for topic in TRIAL}
_NAME = r'(.*?/)(?:leg_(\d+)/)?((?:feet/|body/)?[^/]*)'  # namespace, leg, topic
_FIRST_DATE_NS = 10**18  # a log time after 2001 is a date, an earlier one is simulated time


class Recording(NamedTuple):
    """What a bag has of a robot.

    Attributes
    ----------
    legs : tuple of int
    streams : dict of Stream
        Records by name of their kind, in the order of their stamps; also those that drivers
        published by leg, whose other fields are missing.
    topics : dict of str
        Topic of those that were recorded as records, by name of their kind.
    poses : dict of Table
        What was recorded of the pose of the body.
    """

    legs: tuple[int, ...]
    streams: dict[str, Stream]
    topics: dict[str, str]
    poses: dict[Topic, Table]


def load(
    folder: str | os.PathLike[str],
    namespace: str | None = None,
    progress: Progress | None = None,
) -> Trial:
    """Read a trial from a bag.

    Parameters
    ----------
    folder : path
        Folder of a bag, or one MCAP file.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    Trial
        Fast series have a row for each time stamp of a wrench, slow series a row for each estimate
        of wetness or, without estimates, for each pressure. If the times are dates, they become
        seconds since the first message, whose date is in ``settings['recorded']``, in UTC.

    Raises
    ------
    BagError
        When there is no such bag, when it has no topic of a leg or several robots, when a topic
        has another message type than in ros_pad, or when its custom data are not those of ros_pad.
    """
    bag = BagReader(folder, part(progress, 0.0, 0.4))
    about = bag_notes.read(bag)
    settings = about['settings']
    settings['lost'] = dict(json.loads(bag.custom_data.get(bag_notes.LOST, '{}')))
    settings['repaired'] = REPAIR in bag.custom_data
    if bag.problem:
        settings['problem'] = bag.problem
    recording = read(
        bag,
        settings['ambient_pressure'],
        namespace,
        progress=part(progress, 0.4, 0.8),
        by_stamp=True,
    )
    settings['late'] = []
    with contextlib.suppress(BagError):  # a trial can be read without it
        settings['late'] = late(bag, part(progress, 0.8, 1.0))
    if progress:
        progress(1.0)
    body, odom = (_poses(recording, topic) for topic in (BODY_POSE, ODOM))
    zero_ns = 0
    if bag.start > _FIRST_DATE_NS:
        zero_ns = bag.start
        moment = datetime.datetime.fromtimestamp(bag.start // 10**9, datetime.UTC)
        settings['recorded'] = f'{moment:%Y-%m-%d %H:%M:%S} UTC'
    about['scene'] = pathlib.PurePath(about['scene']).stem
    records = Records(*(recording.streams[kind.name].block for kind in KINDS))
    return trial_of(records, recording.legs, body, odom, zero_ns, **about)


def _poses(recording: Recording, topic: Topic) -> Poses | None:
    """Return what was recorded of x and y, m, and heading, rad; None if nothing was."""
    if topic not in recording.poses:
        return None
    stamps, _, values = stamped(*recording.poses[topic])
    return stamps, np.column_stack([values[:, :2], by_row(heading, values[:, -4:])])


def stamps_of(table: np.ndarray) -> np.ndarray:
    """Return the stamps, ns, with which the rows of a table begin."""
    return table[:, :2].astype(np.int64) @ np.array([10**9, 1])


def stamped(times: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps, log times, ns, and values of a table that begins with stamps, in order."""
    stamps = stamps_of(table)
    stamps = np.where(stamps == 0, times, stamps)  # a driver may leave the stamp empty
    order = np.argsort(stamps, kind='stable')
    return stamps[order], np.sort(times), table[order, 2:]


def read(
    bag: BagReader,
    ambient: float,
    namespace: str | None = None,
    remaps: Mapping[str, str] | None = None,
    progress: Progress | None = None,
    by_stamp: bool = False,
) -> Recording:
    """Return what was recorded of a robot.

    Where there are records, what drivers published by leg for them is left out.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    ambient : float
        Ambient pressure, Pa: drivers publish absolute pressures.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag, by its name in ros_pad: ``{'leg_1/wrench': '/ft'}``, or, for all legs,
        ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``. As in ROS, a topic that does not begin with a
        slash is in the namespace.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.
    by_stamp : bool
        Join what drivers published by leg in the order of its stamps, so that nothing is too late;
        otherwise in the order in which it was recorded, as the nodes do.

    Raises
    ------
    BagError
        When there is no topic of a leg or several robots, when a topic has another message type
        than in ros_pad, or when a message cannot be read.
    InvalidInput
        When a remap is of a topic that ros_pad does not have, or to one that the bag does not
        have; when two remaps name the same topic, or only one side of a remap has ``{leg}``.
    """
    wanted = _wanted(bag, namespace, remaps or {})
    kinds = {n: topic.record for n, (topic, leg) in wanted.items() if leg is None and topic.record}
    paths = {
        name: (*(STAMP if topic.frame else ()), *topic.values)
        for name, (topic, _) in wanted.items()
        if topic.columns or topic in (BODY_POSE, ODOM)
    }
    records, tables = bag.read(kinds, paths, progress)
    streams = {}
    for name, own in records.items():
        stream = Stream(kinds[name], *own)
        streams[stream.kind.name] = stream.where(np.argsort(stream.block.stamps, kind='stable'))
    pieces: dict[Kind, list[_Piece]] = {}
    for name, table in tables.items():
        topic, leg = wanted[name]
        if topic.record and leg is not None:
            pieces.setdefault(topic.record, []).extend(_pieces(topic, leg, table, ambient))
    legs = {leg for each in streams.values() for leg in each.legs}
    legs |= {leg for each in pieces.values() for _, leg, _, _ in each}
    for kind in KINDS:
        streams.setdefault(kind.name, _joined(kind, sorted(legs), pieces.get(kind, []), by_stamp))
    return Recording(
        tuple(sorted(legs)),
        {name: each.of_legs(sorted(legs)) for name, each in streams.items()},
        {kind.name: name for name, kind in kinds.items()},
        {wanted[name][0]: table for name, table in tables.items()},
    )


def _pieces(topic: Topic, leg: int, table: Table, ambient: float) -> Iterator[_Piece]:
    """Yield log time, ns, leg, stamp, ns, and numbers by column of the messages of a leg."""
    stamps, times, values = stamped(*table) if topic.frame else (table[0], *table)
    numbers = to_record(topic, values, ambient).tolist()
    for time_ns, stamp_ns, own in zip(times.tolist(), stamps.tolist(), numbers, strict=True):
        yield time_ns, leg, stamp_ns, dict(zip(topic.columns, own, strict=True))


def _joined(kind: Kind, legs: Sequence[int], pieces: list[_Piece], by_stamp: bool) -> Stream:
    """Return records of all legs, with the log time of the last piece of each."""
    there = {column for _, _, _, values in pieces for column in values}
    needed = [name for name in NEEDED if there & {f'{name}_{axis}' for axis in 'xyz'}]
    joiner, found, time_ns = Joiner(kind, legs, needed), [], 0
    order = operator.itemgetter(2 if by_stamp else 0)
    for time_ns, leg, stamp_ns, values in sorted(pieces, key=order):
        found += [(time_ns, block) for block in joiner.add(leg, stamp_ns, values)]
    found += [(time_ns, block) for block in joiner.expire(math.inf)]
    return Stream.of(kind, tuple(legs), found)


def late(bag: BagReader, progress: Progress | None = None) -> list[str]:
    """Return a line for each node that reported on ``/diagnostics`` that it did not keep up.

    The callback is called now and then with the share that is done, 0 to 1.
    """
    if bag.topics.get(DIAGNOSTICS.pattern) != DIAGNOSTICS.type_name:
        return []
    found: dict[str, list[tuple[float, str]]] = {}
    for _, array, log_ns in bag.messages([DIAGNOSTICS.pattern], progress):
        for status in array.status:
            if status.message.startswith(LATE):
                seconds = (log_ns - bag.start) * 1e-9
                found.setdefault(status.name, []).append((seconds, status.message))
    return [
        f'{name}, reported {len(each)} times from {each[0][0]:.1f} s on: {each[-1][1]}'
        for name, each in found.items()
    ]


def _wanted(
    bag: BagReader, namespace: str | None, remaps: Mapping[str, str]
) -> dict[str, tuple[Topic, int | None]]:
    """Return what the topics of a robot in a bag are, with the number of the leg if it has one."""
    prefix = f'/{(namespace or "").strip("/")}/'.replace('//', '/')
    renamed = _renamed(bag, prefix, remaps)
    there = {*renamed, *renamed.values()}
    names = [*renamed.items(), *((topic, topic) for topic in bag.topics if topic not in there)]
    robots: dict[str, dict[str, tuple[Topic, int | None]]] = {}
    for full, name in names:
        match = re.fullmatch(_NAME, full)
        if match is None:  # no slash, or a line break: no name in ROS
            continue
        space, leg, own = match.groups()
        topic = _KNOWN.get(f'leg_{{leg}}/{own}' if leg else own)
        if topic is None or not bag.counts[name]:
            continue
        if bag.topics[name] != topic.type_name:
            raise BagError(
                f'{bag.path}: {name} is a {bag.topics[name]}: {topic.type_name} is needed'
            )
        robots.setdefault(space, {})[name] = topic, int(leg) if leg else None
    robots = {
        each: own for each, own in robots.items() if any(topic.record for topic, _ in own.values())
    }
    listed = ', '.join(f'legs in {each}' for each in sorted(robots)) or 'no topics of legs'
    if namespace is not None:
        robots = {each: own for each, own in robots.items() if each == prefix}
    if len(robots) != 1:
        where = '' if namespace is None else f' in namespace {prefix}'
        raise BagError(f'{bag.path}: one robot{where} is needed, the bag has {listed}')
    (topics,) = robots.values()
    whole = {topic.record for topic, leg in topics.values() if leg is None}
    return {
        name: (topic, leg)
        for name, (topic, leg) in topics.items()
        if leg is None or topic.record not in whole
    }


def _renamed(bag: BagReader, prefix: str, remaps: Mapping[str, str]) -> dict[str, str]:
    """Return the topics that are remapped, by their full names in ros_pad."""
    found: dict[str, str] = {}
    for given, other in remaps.items():
        words, own = f'--remap {given}:={other}', given.removeprefix('/')
        choice(words, re.sub(r'leg_\d+/', 'leg_{leg}/', own), tuple(_KNOWN))
        if ('{leg}' in own) != ('{leg}' in other):
            raise InvalidInput(f'{words}: {{leg}} is needed on both sides of := or on neither')
        full = other if other.startswith('/') else prefix + other
        pattern = re.escape(full).replace(r'\{leg\}', r'(?P<leg>\d+)', 1)
        pattern = pattern.replace(r'\{leg\}', '(?P=leg)')
        matches = [match for topic in bag.topics if (match := re.fullmatch(pattern, topic))]
        if not matches:
            choice(words, full, tuple(bag.topics))
        for match in matches:
            name = prefix + own.replace('{leg}', match.groupdict().get('leg', ''))
            if found.setdefault(name, match[0]) != match[0]:
                raise InvalidInput(f'{words}: another remap already takes {name}')
    return found


__all__ = ['load']
