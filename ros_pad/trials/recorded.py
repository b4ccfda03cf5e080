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
import difflib
import json
import os
import pathlib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.bags.reader import Table
from ros_pad.bags.recovery import KEY as REPAIR
from ros_pad.bags.topics import BODY_POSE, DIAGNOSTICS, ODOM, STAMP, TRIAL, Topic, to_record
from ros_pad.errors import BagError, InvalidInput
from ros_pad.pace import LATE, Progress, part
from ros_pad.records import KINDS, Block, Kind
from ros_pad.trials import label
from ros_pad.trials.series import Records, by_row, held, series
from ros_pad.trials.trial import Trial, heading

_OF_LEG = re.compile(r'(?P<namespace>.*?/)leg_(?P<leg>\d+)/(?P<kind>\w+)')
POSES = (BODY_POSE, ODOM)

_KNOWN = {topic.pattern: topic for topic in TRIAL}
# A log time after 2001 is a date, an earlier one is simulated time.
_FIRST_DATE_NS = 10**18


def load(
    folder: str | os.PathLike[str],
    namespace: str | None = None,
    progress: Progress | None = None,
    remaps: Mapping[str, str] | None = None,
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
    remaps : mapping or None
        Topics with other names, see :func:`wanted_topics`.

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
    InvalidInput
        When a remap is not allowed.
    """
    bag = BagReader(folder, part(progress, 0.0, 0.4))
    wanted = wanted_topics(bag, namespace, remaps)
    first = 0.4 if bag.problem else 0.0  # a bag without damage is opened at once
    trial = _described(bag)
    ambient = trial['settings']['ambient_pressure']
    legs, records, _, tables = read_records(bag, wanted, ambient, part(progress, first, 0.8))
    found = series(records)
    fast_ns = found.pop('time')
    slow_ns = found.pop('slow_time')
    odom = np.zeros((0, 3))
    body = _poses(tables, BODY_POSE, fast_ns)
    if (estimated := _poses(tables, ODOM, fast_ns)) is not None:
        odom = estimated
        body = odom if body is None else body
    zero_ns = 0
    if bag.start > _FIRST_DATE_NS:
        zero_ns = bag.start
        moment = datetime.datetime.fromtimestamp(bag.start // 10**9, datetime.UTC)
        trial['settings']['recorded'] = f'{moment:%Y-%m-%d %H:%M:%S} UTC'
    if bag.problem:
        trial['settings']['problem'] = bag.problem
    trial['settings']['late'] = []
    with contextlib.suppress(BagError):  # a trial can be read without it
        trial['settings']['late'] = late(bag, part(progress, 0.8, 1.0))
    if progress:
        progress(1.0)
    read = Trial(
        **trial,
        **found,
        legs=legs,
        time=(fast_ns - zero_ns) * 1e-9,
        slow_time=(slow_ns - zero_ns) * 1e-9,
        body=np.full((len(fast_ns), 3), np.nan) if body is None else body,
        odom=odom,
    )
    if len(odom):
        read.move_to_world()
    return read


def _poses(tables: Mapping[Topic, Table], topic: Topic, grid: np.ndarray) -> np.ndarray | None:
    """Return x and y, m, and heading, rad, at times, ns, (n, 3); None if they are not recorded."""
    if topic not in tables:
        return None
    stamps, values = _stamped(*tables[topic])
    poses = np.column_stack([values[:, :2], by_row(heading, values[:, -4:])])
    return held(stamps, poses, grid)


def _stamped(log_times: np.ndarray, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps, ns, and values of a table that begins with stamps, in their order."""
    seconds, nanoseconds = table[:, :2].astype(np.int64).T
    stamps = seconds * 10**9 + nanoseconds
    stamps = np.where(stamps == 0, log_times, stamps)  # a driver may leave the stamp empty
    order = np.argsort(stamps, kind='stable')
    return stamps[order], table[order, 2:]


def read_records(
    bag: BagReader,
    wanted: Mapping[str, Wanted],
    ambient: float,
    progress: Progress | None = None,
) -> tuple[tuple[int, ...], Records, dict[str, np.ndarray], dict[Topic, Table]]:
    """Return the records of a robot in a bag, also those that its drivers published by leg.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    wanted : mapping
        What each topic is, see :func:`wanted_topics`.
    ambient : float
        Ambient pressure, Pa: drivers publish absolute pressures.
    progress : callable or None
        Called now and then with the share that is done, 0 to 1.

    Returns
    -------
    legs : tuple of int
    records : Records
        In the order of their stamps.
    log_times : dict of array
        Log time of each of them, ns, by kind.
    tables : dict of Table
        What was recorded of the poses of the body, :data:`POSES`.

    Raises
    ------
    BagError
        When a message cannot be read, or records of two kinds have other legs.
    """
    kinds = {
        name: each.topic.record
        for name, each in wanted.items()
        if each.leg is None and each.topic.record
    }
    paths = {
        name: (*(STAMP if each.topic.frame else ()), *each.topic.values)
        for name, each in wanted.items()
        if each.topic.columns or each.topic in POSES
    }
    found, tables = bag.read(kinds, paths, progress)
    blocks: dict[str, list[tuple[tuple[int, ...], np.ndarray, Block]]] = {}
    for name, read in found.items():
        blocks.setdefault(kinds[name].name, []).append(read)
    for name, table in tables.items():
        if kind := wanted[name].topic.record:
            blocks.setdefault(kind.name, []).append(_of_leg(wanted[name], *table, ambient))
    legs = tuple(sorted({leg for parts in blocks.values() for part in parts for leg in part[0]}))
    joined = {kind.name: _joined(kind, legs, blocks.get(kind.name, ())) for kind in KINDS}
    return (
        legs,
        Records(*(block for block, _ in joined.values())),
        {name: times for name, (_, times) in joined.items()},
        {wanted[name].topic: table for name, table in tables.items()},
    )


def _of_leg(
    wanted: Wanted, log_times: np.ndarray, table: np.ndarray, ambient: float
) -> tuple[tuple[int, ...], np.ndarray, Block]:
    """Return the records that the messages of a leg are; other fields are missing."""
    topic, leg = wanted.topic, wanted.leg
    assert topic.record and leg is not None
    stamps, values = log_times, table
    if topic.frame:
        stamps, values = _stamped(log_times, table)
    rows = topic.record.rows(len(stamps), 1)
    numbers = rows.view('f8').reshape(len(stamps), -1)
    places = [topic.record.columns.index(column) for column in topic.columns]
    numbers[:, places] = to_record(topic, values, ambient)
    return (leg,), np.sort(log_times) if topic.frame else log_times, Block(stamps, rows)


def _joined(
    kind: Kind, legs: tuple[int, ...], parts: Sequence[tuple[tuple[int, ...], np.ndarray, Block]]
) -> tuple[Block, np.ndarray]:
    """Return the records of several sources as one block with all legs, and their log times."""
    count = sum(len(block.stamps) for _, _, block in parts)
    rows, stamps = kind.rows(count, len(legs)), np.empty(count, np.int64)
    times, start = np.empty(count, np.int64), 0
    for own, log_times, block in parts:
        place = slice(start, start + len(block.stamps))
        columns = [legs.index(leg) for leg in own]
        rows[place, columns], stamps[place], times[place] = block.rows, block.stamps, log_times
        start = place.stop
    order = np.argsort(stamps, kind='stable')
    return Block(stamps[order], rows[order]), times[order]


def late(bag: BagReader, progress: Progress | None = None) -> list[str]:
    """Return a line for each node that reported on ``/diagnostics`` that it did not keep up.

    The callback is called now and then with the share that is done, 0 to 1.
    """
    if bag.topics.get(DIAGNOSTICS.pattern) != DIAGNOSTICS.type_name:
        return []
    found: dict[str, list[tuple[float, str]]] = {}
    for _, array, log_ns in bag.messages([DIAGNOSTICS.pattern], LATE.encode(), progress):
        for status in array.status:
            if status.message.startswith(LATE):
                seconds = (log_ns - bag.start) * 1e-9
                found.setdefault(status.name, []).append((seconds, status.message))
    return [
        f'{name}, reported {len(each)} times from {each[0][0]:.1f} s on: {each[-1][1]}'
        for name, each in found.items()
    ]


def _described(bag: BagReader) -> dict[str, Any]:
    """Return the fields of a trial that follow from the custom data of a bag."""
    about = label.read(bag)
    settings = {
        'ambient_pressure': about.ambient_pressure,
        'lost': dict(json.loads(bag.custom_data.get(label.LOST, '{}'))),
        'repaired': REPAIR in bag.custom_data,
    }
    return {
        'scene': pathlib.PurePath(about.scene).stem,
        'policy': about.policy,
        'fidelity': about.fidelity,
        'seed': about.seed,
        'floor': about.floor.build(about.seed) if about.floor else None,
        'metrics': about.metrics,
        'settings': about.settings | settings,
        'real_time_factor': about.real_time_factor,
    }


class Wanted(NamedTuple):
    """What a topic of a bag is: a topic of ros_pad, and the number of the leg if it has one."""

    topic: Topic
    leg: int | None


def wanted_topics(
    bag: BagReader, namespace: str | None = None, remaps: Mapping[str, str] | None = None
) -> dict[str, Wanted]:
    """Return what each topic is that a trial is read from.

    Where there are records, what drivers published by leg for them is left out.

    Parameters
    ----------
    bag : BagReader
        What was recorded.
    namespace : str or None
        Namespace of the robot, such as ``/robot_1``; None takes the only one.
    remaps : mapping or None
        Topic of the bag, by its name in ros_pad: ``{'leg_1/wrench': '/ft'}``, or, for all legs,
        ``{'leg_{leg}/wrench': '/foot_{leg}/ft'}``. As in ROS, a topic that does not begin with a
        slash is in the namespace.

    Raises
    ------
    BagError
        When there is no topic of a leg or several robots, or when a topic has another message
        type than in ros_pad.
    InvalidInput
        When a remap is of a topic that ros_pad does not have, or to one that the bag does not
        have; when two remaps name the same topic, or only one side of a remap has ``{leg}``.
    """
    found: dict[str, dict[str, Wanted]] = {}
    for name, own_name in _names(bag, namespace, remaps or {}):
        prefix, own, leg = _parsed(own_name)
        if own not in _KNOWN or not bag.counts[name]:
            continue
        topic = _KNOWN[own]
        if bag.topics[name] != topic.type_name:
            raise BagError(
                f'{bag.path}: {name} is a {bag.topics[name]}: {topic.type_name} is needed'
            )
        found.setdefault(prefix, {})[name] = Wanted(topic, leg)
    robots = {
        prefix: _without_copies(topics)
        for prefix, topics in found.items()
        if any(each.topic.record for each in topics.values())
    }
    if namespace is not None:
        prefix = _prefix(namespace)
        if prefix not in robots:
            raise BagError(
                f'{bag.path}: no legs in namespace {prefix}; the bag has {_listed(robots)}'
            )
        return robots[prefix]
    if len(robots) != 1:
        raise BagError(f'{bag.path}: one robot is needed, the bag has {_listed(robots)}')
    return next(iter(robots.values()))


def _parsed(name: str) -> tuple[str, str, int | None]:
    """Return the namespace of a topic, its name with ``{leg}`` for the number, and the number."""
    if match := _OF_LEG.fullmatch(name):
        return match['namespace'], f'leg_{{leg}}/{match["kind"]}', int(match['leg'])
    own = next((own for own in _KNOWN if name.endswith(f'/{own}')), '')
    return name.removesuffix(own), own, None


def _without_copies(topics: dict[str, Wanted]) -> dict[str, Wanted]:
    """Return topics without those of legs of which there are records."""
    whole = {each.topic.record for each in topics.values() if each.leg is None}
    return {
        name: each
        for name, each in topics.items()
        if each.leg is None or each.topic.record not in whole
    }


def _prefix(namespace: str | None) -> str:
    return f'/{(namespace or "").strip("/")}/'.replace('//', '/')


def _names(
    bag: BagReader, namespace: str | None, remaps: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Return pairs of each topic of a bag and its full name in ros_pad after the remaps."""
    prefix = _prefix(namespace)
    renamed: dict[str, str] = {}  # topic of the bag by its name in ros_pad
    for own, other in remaps.items():
        given = f'--remap {own}:={other}'
        _, known, number = _parsed(f'/{own.removeprefix("/")}'.replace('{leg}', '0'))
        if known not in _KNOWN:
            near = difflib.get_close_matches(own, _KNOWN, n=1)
            hint = f' Did you mean {near[0]}?' if near else ''
            raise InvalidInput(
                f'{given}: {own} is no topic of ros_pad.{hint} Allowed: {", ".join(_KNOWN)}'
            )
        leg = '{leg}' if '{leg}' in own else str(number)
        if (leg == '{leg}') != ('{leg}' in other):
            raise InvalidInput(f'{given}: {{leg}} is needed on both sides of := or on neither')
        full = other if other.startswith('/') else prefix + other
        pattern = re.escape(full).replace(r'\{leg\}', r'(?P<leg>\d+)', 1)
        pattern = pattern.replace(r'\{leg\}', '(?P=leg)')
        matches = [match for topic in bag.topics if (match := re.fullmatch(pattern, topic))]
        if not matches:
            near = difflib.get_close_matches(full, bag.topics, n=3, cutoff=0.0)
            raise InvalidInput(
                f'{given}: {bag.path} has no topic {full}; similar ones are {", ".join(near)}'
            )
        for match in matches:
            found = match.groupdict().get('leg') or leg
            name = own.removeprefix('/').replace('{leg}', found)
            if renamed.setdefault(prefix + name, match[0]) != match[0]:
                raise InvalidInput(
                    f'{given}: another remap already takes {name} from {renamed[prefix + name]}'
                )
    moved = set(renamed.values())
    return [
        *((topic, name) for name, topic in renamed.items()),
        *((topic, topic) for topic in bag.topics if topic not in moved | set(renamed)),
    ]


def _listed(robots: Iterable[str]) -> str:
    return ', '.join(f'legs in {prefix}' for prefix in sorted(robots)) or 'no topics of legs'


__all__ = ['load']
