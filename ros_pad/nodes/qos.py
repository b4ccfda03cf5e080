# SPDX-License-Identifier: Apache-2.0
"""QoS profiles and message classes of the topics, and the form of profiles in a bag."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any, NamedTuple

import yaml
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from ros_pad.bags import topics
from ros_pad.bags.topics import Topic
from ros_pad.errors import ConfigError

_BEST_EFFORT, _RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE

SENSOR = QoSProfile(depth=10, reliability=_BEST_EFFORT)
"""Subscribe to measurements: only recent ones are kept, and any driver's publisher matches."""

RECORDS = QoSProfile(depth=100, reliability=_BEST_EFFORT)
"""Subscribe to records: a node that pauses for some tenths of a second loses none."""

NEWEST = QoSProfile(depth=1, reliability=_RELIABLE)
"""Set-points of a leg, and publishers of ``/clock``: only the newest must arrive."""

RELIABLE = QoSProfile(depth=10, reliability=_RELIABLE)
"""Commands, of which one may lack the legs of the one before it, ``/diagnostics``, and publishers
of measurements and estimates: reliable and best-effort subscribers both match."""

STATE = QoSProfile(
    depth=1, reliability=_RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)  # fmt: skip
"""Latched state such as the morphology: a late subscriber receives the last one."""

STATES = QoSProfile(
    depth=100, reliability=_RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)  # fmt: skip
"""Subscribe to the latched states of several publishers."""

CLOCK = QoSProfile(depth=1, reliability=_BEST_EFFORT)
"""Subscribe to ``/clock``, as rclpy itself does."""


class Profiles(NamedTuple):
    """QoS that publishers of a topic offer, and QoS that subscriptions request.

    DDS does not connect a subscription to a publisher that offers less than it requests; rclpy
    warns of them.
    """

    publish: QoSProfile
    subscribe: QoSProfile


_OF = {
    topics.COMMAND.pattern: Profiles(RELIABLE, RELIABLE),
    topics.LEG_SETPOINT.pattern: Profiles(NEWEST, NEWEST),
    topics.CLOCK.pattern: Profiles(NEWEST, CLOCK),
    topics.DIAGNOSTICS.pattern: Profiles(RELIABLE, RELIABLE),
    topics.PARAMETERS.pattern: Profiles(STATE, STATES),
}


def profiles(topic: Topic) -> Profiles:
    """Return the QoS of a topic."""
    usual = Profiles(RELIABLE, RECORDS if topic in topics.RECORDS else SENSOR)
    return _OF.get(topic.pattern, Profiles(STATE, STATE) if topic.text else usual)


def publisher(node: Node, topic: Topic, leg: int | None = None) -> Publisher:
    """Create a publisher of a topic in a node."""
    kind, name = message_class(topic.type_name), topic.name(leg)
    return node.create_publisher(kind, name, profiles(topic).publish)


def subscription(
    node: Node,
    topic: Topic,
    callback: Callable[[Any], None],
    leg: int | None = None,
    raw: bool = False,
) -> Subscription:
    """Create a subscription in a node; a raw one hands over messages as bytes."""
    kind, name = message_class(topic.type_name), topic.name(leg)
    return node.create_subscription(kind, name, callback, profiles(topic).subscribe, raw=raw)


def recording(topic: Topic, reliable: bool) -> QoSProfile:
    """Return the profile with which a topic is recorded: each message waits until it is taken.

    Measurements are best effort, as other subscribers of them are, unless ``reliable`` is True.
    Acknowledging 6,000 messages a second takes a sixth more processor time of all nodes; a
    publisher keeps ten messages for repetition, the shared memory of one computer holds more.
    """
    asked = profiles(topic).subscribe
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL,
        reliability=_RELIABLE if reliable else asked.reliability,
        durability=asked.durability,
    )


def offered(topic: Topic) -> str:
    """Return what publishers of a topic offer, as YAML text, in the form of bags of ROS 2."""
    profile = profiles(topic).publish
    policies = {
        name: getattr(profile, name).name.lower()
        for name in ('history', 'reliability', 'durability')
    }
    times = {
        name: {'sec': 9223372036, 'nsec': 854775807}  # no limit
        for name in ('deadline', 'lifespan', 'liveliness_lease_duration')
    }
    others = {'liveliness': 'automatic', 'avoid_ros_namespace_conventions': False}
    return yaml.safe_dump([{**policies, 'depth': profile.depth, **times, **others}])


@functools.cache
def message_class(type_name: str) -> Any:
    """Return the class of a message type such as ``sensor_msgs/msg/Imu``.

    Raises
    ------
    ConfigError
        When its package is not installed.
    """
    package, _, name = type_name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError) as error:
        raise ConfigError(
            f'message type {type_name} is not installed ({error}): build the message package'
            f' {package} with colcon, and source its workspace until'
            f' `ros2 interface show {type_name}` shows it; a bag needs no package'
        ) from error
