# SPDX-License-Identifier: Apache-2.0
"""``pad doctor --robot``: find what is wrong with the sensors of a robot."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np

from ros_pad.bags import BagReader
from ros_pad.commands.progress import bar
from ros_pad.configuration import number
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing import Mapping, Readings
from ros_pad.sensing.checks import Check, Recording, check

SHORTEST, FEWEST = 1.0, 10  # s, readings: less is not checked

_Readings = dict[str, list[tuple[Readings, int]]]  # by topic, with the time of arrival, ns


def findings(options: argparse.Namespace) -> Iterator[Check]:
    """Check the sensors of a robot, and yield what is found; ``ok`` for each topic that is read.

    Raises
    ------
    PadError
        When robot, mapping or bag cannot be read.
    """
    seconds = number('--seconds', options.seconds, 's', 1.0, 60.0)
    robot = Robot.load(options.robot, options.feet, options.imu, options.foot_radius)
    mapping = Mapping.load(options.mapping, robot)
    joints = len(robot.joint_names)
    about = f'{robot.name}: {len(robot.legs)} legs, {joints} joints, {robot.mass:.3g} kg'
    if robot.mass > 0.0:
        yield Check('robot', 'ok', about)
    else:
        text = f'{about}: its links have no mass, <inertial> with <mass>: the body estimator'
        yield Check('robot', 'problem', f'{text} needs the weight')
    messages, topics = (_recorded if options.bag else _live)(options, mapping, seconds)
    found: _Readings = defaultdict(list)
    refused: dict[str, str] = {}
    for topic, message, arrival in messages:
        try:
            readings = mapping.read(topic, message, arrival)
        except InvalidInput as error:
            refused.setdefault(topic, str(error))
        else:
            found[topic].append((readings, arrival))
    for topic, rows in found.items():
        yield Check(topic, 'ok', f'{len(rows)} messages')
    for topic, text in refused.items():
        yield Check(topic, 'problem', f'messages do not fit the mapping: {text}')
    yield from silent(mapping, topics, found, refused)
    for text in mapping.missing:
        what, _, missing = text.partition(': ')
        yield Check(what, 'warning', missing)
    yield from _judged(robot, mapping, found)


def silent(
    mapping: Mapping, topics: dict[str, str], found: _Readings, refused: dict[str, str]
) -> Iterator[Check]:
    """Yield the topics without messages; ``topics`` has the type of each that there is."""
    rows = [each for readings in found.values() for each, _ in readings]
    efforts = any(each.efforts is not None for each in rows)
    if efforts and not any(each.forces for each in rows):
        yield Check('forces', 'ok', 'from the efforts of the joints: no foot force arrives')
    for source in mapping.sources:
        needed = source.gives & {'gyro', 'accelerometer', 'positions'} or not efforts
        if needed and source.topic not in {**found, **refused}:
            same = [name for name, each in topics.items() if each == source.type_name]
            text = f'no message; {source.type_name} is on {", ".join(same) or "no topic"}'
            yield Check(source.topic, 'problem', text)


def _judged(robot: Robot, mapping: Mapping, found: _Readings) -> Iterator[Check]:
    """Check the readings against one another, where there are enough of them."""
    rows = [row for readings in found.values() for row in readings]
    rows.sort(key=lambda row: row[1])
    imu = [row for row in rows if row[0].gyro is not None and row[0].accelerometer is not None]
    joints = [row for row in rows if row[0].positions is not None]
    short = False
    for what, readings in (('imu', imu), ('joints', joints)):
        length = (readings[-1][1] - readings[0][1]) * 1e-9 if len(readings) > FEWEST else 0.0
        if length < SHORTEST:
            short = True
            if found:
                text = f'readings of {length:.3g} s; at least {SHORTEST:g} s are needed'
                yield Check(what, 'problem', text)
    if not short:
        faults = check(_recording(robot, mapping, imu, joints, rows))
        if all(each.what == 'not judged' for each in faults):
            yield Check('sensors', 'ok', 'no fault in rates, stamps, units, axes and signs')
        yield from faults


def _recording(
    robot: Robot,
    mapping: Mapping,
    imu: list[tuple[Readings, int]],
    joints: list[tuple[Readings, int]],
    rows: list[tuple[Readings, int]],
) -> Recording:
    """Return the readings as arrays; the first stamp of the joints is time 0."""
    start = joints[0][0].stamp

    def seconds(stamps: list[int]) -> Array:
        return np.array([stamp - start for stamp in stamps]) * 1e-9

    def column(name: str) -> Array | None:
        values = [getattr(each, name) for each, _ in joints]
        return None if any(each is None for each in values) else np.array(values)

    times = seconds([each.stamp for each, _ in joints])
    forces = None
    if any(each.forces for each, _ in rows):
        forces = np.zeros((len(times), len(robot.legs), 3))  # a foot without readings has none
        for leg in range(len(robot.legs)):
            own = sorted((each.stamp, *each.forces[leg]) for each, _ in rows if leg in each.forces)
            for axis in range(3) if own else ():
                stamps = seconds([row[0] for row in own])
                forces[:, leg, axis] = np.interp(times, stamps, [row[1 + axis] for row in own])
    return Recording(
        robot,
        seconds([each.stamp for each, _ in imu]),
        np.array([each.gyro for each, _ in imu]),
        np.array([each.accelerometer for each, _ in imu]),
        times,
        np.array([each.positions for each, _ in joints]),
        column('velocities'),
        column('efforts'),
        forces,
        mapping.force_axes,
        mapping.force_kind or 'vector',
        seconds([at for _, at in imu]),
        seconds([at for _, at in joints]),
    )


def _live(
    options: argparse.Namespace, mapping: Mapping, seconds: float
) -> tuple[list[tuple[str, Any, int]], dict[str, str]]:
    """Return messages that arrive, and the types of all topics."""
    try:
        from ros_pad.nodes.intake import receive
    except ImportError as error:
        raise ConfigError(
            f'live topics need ROS 2 ({error}): source its setup.bash, or'
            ' pip install "ros_pad[ros]", or give a recording with --bag'
        ) from error
    with bar('listening', seconds) as progress:
        return receive(mapping.sources, seconds, options.namespace, progress)


def _recorded(
    options: argparse.Namespace, mapping: Mapping, seconds: float
) -> tuple[list[tuple[str, Any, int]], dict[str, str]]:
    """Return the messages of the first seconds of a bag, and the types of all its topics."""
    reader = BagReader(options.bag)
    prefix = f'/{options.namespace.strip("/")}/' if options.namespace else '/'
    names = {
        name: source.topic
        for source in mapping.sources
        for name in (prefix + source.topic.lstrip('/'), source.topic)
    }
    end, messages = reader.start + round(seconds * 1e9), []
    with bar('reading', seconds) as progress:
        for topic, message, at in reader.messages(names):
            if at > end:
                break
            messages.append((names[topic], message, at))
            progress((at - reader.start) * 1e-9)
    return messages, {name: kind for name, kind in reader.topics.items() if reader.counts[name]}
