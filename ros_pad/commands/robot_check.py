# SPDX-License-Identifier: Apache-2.0
"""``pad doctor --robot``: find what is wrong with the sensors of a robot."""

from __future__ import annotations

import argparse
from collections import Counter
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

_Row = tuple[Readings, int]  # with the time of arrival, ns


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
    rows: list[_Row] = []
    counts: Counter[str] = Counter()
    refused: dict[str, str] = {}
    for topic, message, arrival in messages:
        try:
            rows.append((mapping.read(topic, message, arrival), arrival))
            counts[topic] += 1
        except InvalidInput as error:
            refused.setdefault(topic, str(error))
    for topic, count in counts.items():
        yield Check(topic, 'ok', f'{count} messages')
    for topic, text in refused.items():
        yield Check(topic, 'problem', f'messages do not fit the mapping: {text}')
    efforts = any(each.efforts is not None for each, _ in rows)
    if efforts and not any(each.forces for each, _ in rows):
        yield Check('forces', 'ok', 'from the efforts of the joints: no foot force arrives')
    for source in mapping.sources:
        needed = source.gives & {'gyro', 'accelerometer', 'positions'} or not efforts
        if needed and source.topic not in {**counts, **refused}:
            same = [name for name, kind in topics.items() if kind == source.type_name]
            text = f'no message; {source.type_name} is on {", ".join(same) or "no topic"}'
            yield Check(source.topic, 'problem', text)
    for text in mapping.missing:
        what, _, missing = text.partition(': ')
        yield Check(what, 'warning', missing)
    yield from _judged(robot, mapping, rows)


def _judged(robot: Robot, mapping: Mapping, rows: list[_Row]) -> Iterator[Check]:
    """Check the readings against one another, where there are enough of them."""
    imu = [row for row in rows if row[0].gyro is not None and row[0].accelerometer is not None]
    joints = [row for row in rows if row[0].positions is not None]
    short = False
    for what, readings in (('imu', imu), ('joints', joints)):
        length = (readings[-1][1] - readings[0][1]) * 1e-9 if len(readings) > 10 else 0.0
        if length < 1.0:
            short = True
            if rows:
                yield Check(what, 'problem', f'readings of {length:.3g} s; 1 s is needed')
    if not short:
        faults = check(_recording(robot, mapping, imu, joints, rows))
        if all(each.what == 'not judged' for each in faults):
            yield Check('sensors', 'ok', 'no fault in rates, stamps, units, axes and signs')
        yield from faults


def _recording(
    robot: Robot, mapping: Mapping, imu: list[_Row], joints: list[_Row], rows: list[_Row]
) -> Recording:
    """Return the readings as arrays; the first stamp of the joints is time 0."""
    start = joints[0][0].stamp

    def stamps(part: list[_Row]) -> Array:
        return np.array([each.stamp - start for each, _ in part]) * 1e-9

    def arrivals(part: list[_Row]) -> Array:
        return np.array([at - start for _, at in part]) * 1e-9

    def column(name: str) -> Array | None:
        values = [getattr(each, name) for each, _ in joints]
        return None if any(each is None for each in values) else np.array(values)

    times, forces = stamps(joints), None
    for leg in range(len(robot.legs)):
        own = sorted((row for row in rows if leg in row[0].forces), key=lambda row: row[0].stamp)
        if own:
            if forces is None:  # a foot without readings has none
                forces = np.zeros((len(times), len(robot.legs), 3))
            columns = np.array([each.forces[leg] for each, _ in own]).T
            axes = [np.interp(times, stamps(own), values) for values in columns]
            forces[:, leg] = np.transpose(axes)
    return Recording(
        robot,
        stamps(imu),
        np.array([each.gyro for each, _ in imu]),
        np.array([each.accelerometer for each, _ in imu]),
        times,
        np.array([each.positions for each, _ in joints]),
        column('velocities'),
        column('efforts'),
        forces,
        mapping.force_axes,
        mapping.force_kind or 'vector',
        arrivals(imu),
        arrivals(joints),
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
