# SPDX-License-Identifier: Apache-2.0
"""``pad doctor --robot``: find what is wrong with the sensors of a robot."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from ros_pad.bags import BagReader
from ros_pad.commands.progress import bar
from ros_pad.configuration import number
from ros_pad.errors import ConfigError
from ros_pad.robots import Robot
from ros_pad.sensing import Mapping
from ros_pad.sensing.checks import Finding
from ros_pad.sensing.collector import Collector


def findings(options: argparse.Namespace) -> Iterator[Finding]:
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
        yield Finding('robot', 'ok', about, '')
    else:
        advice = 'give the links an <inertial> with <mass>: the body estimator needs the weight'
        yield Finding('robot', 'problem', f'{about}: its links have no mass', advice)
    collector = Collector(mapping, robot)
    topics = (_recorded if options.bag else _live)(options, mapping, seconds, collector)
    for topic, count in collector.counts.items():
        yield Finding(topic, 'ok', f'{count} messages', '')
    with bar('checking', 1.0, 'robot') as progress:
        found = collector.findings(topics, progress)
        progress(1.0)
    yield from found


def _live(
    options: argparse.Namespace, mapping: Mapping, seconds: float, collector: Collector
) -> dict[str, str]:
    """Collect messages that arrive; return the types of all topics."""
    try:
        from ros_pad.nodes.listening import receive
    except ImportError as error:
        raise ConfigError(
            f'live topics need ROS 2 ({error}): source its setup.bash, or'
            ' pip install "ros_pad[ros]", or give a recording with --bag'
        ) from error
    with bar('listening', seconds) as progress:
        messages, topics = receive(mapping.sources, seconds, options.namespace, progress)
    for message in messages:
        collector.add(*message)
    return topics


def _recorded(
    options: argparse.Namespace, mapping: Mapping, seconds: float, collector: Collector
) -> dict[str, str]:
    """Collect the messages of the first seconds of a bag; return the types of all its topics."""
    with bar('opening', 1.0, 'bag', delay=1.0) as progress:
        reader = BagReader(options.bag, progress)
    prefix = f'/{options.namespace.strip("/")}/' if options.namespace else '/'
    names = {
        name: source.topic
        for source in mapping.sources
        for name in (prefix + source.topic.lstrip('/'), source.topic)
    }
    end = min(reader.start + round(seconds * 1e9), reader.end)
    with bar('reading', (end - reader.start) * 1e-9) as progress:
        for topic, message, at in reader.messages(names):
            if at > end:
                break
            collector.add(names[topic], message, at)
            progress((at - reader.start) * 1e-9)
    return {topic: of_type for topic, of_type in reader.topics.items() if reader.counts[topic]}
