# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of every topic: message class and QoS for `ros_pad.bags.topics`.

Names are relative, so that a namespace moves the whole robot; ``/clock`` and ``/diagnostics``
are global, as everywhere in ROS.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, TwistWithCovarianceStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState
from std_msgs.msg import Bool, Float64, String
from visualization_msgs.msg import MarkerArray

from ros_pad.bags import topics as schemas
from ros_pad.bags.codec import MessageType, message_type
from ros_pad.bags.definitions import message_definition
from ros_pad.errors import ConfigError
from ros_pad.nodes import qos

LEGS = (1, 2, 3, 4, 5, 6)
"""Numbers of the legs where a node is not given others."""

MOST_LEGS = 8
"""Largest number of a leg."""


@dataclasses.dataclass(frozen=True)
class Topic:
    """A topic, or one per leg, with its message class and QoS.

    Attributes
    ----------
    schema : ros_pad.bags.topics.Topic
        Name and message type.
    message : type
        Message class.
    publish, subscribe : QoSProfile
        QoS that publishers offer, and QoS that subscriptions request.
    """

    schema: schemas.Topic
    message: type
    publish: QoSProfile
    subscribe: QoSProfile

    @property
    def pattern(self) -> str:
        """The name, with ``{leg}`` in place of the leg's number."""
        return self.schema.pattern

    @property
    def type_name(self) -> str:
        """The message type as ROS names it, such as ``std_msgs/msg/Float64``."""
        return self.schema.type_name

    def name(self, leg: int | None = None) -> str:
        """Return the name; a topic of each leg needs the number of the leg."""
        return self.schema.name(leg)

    @functools.cached_property
    def message_type(self) -> MessageType:
        """The message type, from its installed definition."""
        return message_type(self.type_name, message_definition(self.type_name))

    def publisher(self, node: Node, leg: int | None = None) -> Publisher:
        """Create a publisher in a node.

        DDS does not connect it to subscriptions that request more than it offers. The node warns
        of them.
        """
        name = node.resolve_topic_name(self.name(leg))

        def warn(event: Any) -> None:
            for peer in node.get_subscriptions_info_by_topic(name):
                for each in qos.mismatches(self.publish, peer.qos_profile):
                    node.get_logger().warning(
                        f'{name}: {_owner(peer, name)} receives nothing: its subscription'
                        f' requests {each.policy} {each.asked}, and {each.offered} is offered;'
                        f' change the subscription to {each.policy} {each.offered}'
                    )

        return node.create_publisher(
            self.message,
            self.name(leg),
            self.publish,
            event_callbacks=PublisherEventCallbacks(incompatible_qos=warn),
        )

    def subscription(
        self,
        node: Node,
        callback: Callable[[Any], None],
        leg: int | None = None,
        raw: bool = False,
        on_mismatch: Callable[[str], None] | None = None,
    ) -> Subscription:
        """Create a subscription in a node; a raw one hands over messages as bytes.

        DDS does not connect it to publishers that offer less than it requests. The node warns of
        them, and calls `on_mismatch` with the text of the warning.
        """
        name = node.resolve_topic_name(self.name(leg))

        def warn(event: Any) -> None:
            for peer in node.get_publishers_info_by_topic(name):
                for each in qos.mismatches(peer.qos_profile, self.subscribe):
                    text = (
                        f'{name}: no message of {_owner(peer, name)} arrives: its publisher offers'
                        f' {each.policy} {each.offered}, and {each.asked} is requested;'
                        f' change the publisher to {each.policy} {each.asked}'
                    )
                    node.get_logger().warning(text)
                    if on_mismatch:
                        on_mismatch(text)

        return node.create_subscription(
            self.message,
            self.name(leg),
            callback,
            self.subscribe,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=warn),
            raw=raw,
        )


def _owner(peer: TopicEndpointInfo, topic: str) -> str:
    """Return words for the node that owns a publisher or subscription of a topic."""
    # Publishers of a new process appear on the graph before the names of its nodes.
    if 'UNKNOWN' in peer.node_name:
        return f'a node that `ros2 topic info --verbose {topic}` names'
    return f'node {peer.node_namespace.rstrip("/")}/{peer.node_name}'


_CLASSES = {
    **{
        f'{each.__module__.split(".")[0]}/msg/{each.__name__}': each
        for each in (
            *(PointStamped, PoseStamped, TwistWithCovarianceStamped, WrenchStamped),
            *(FluidPressure, Imu, JointState, Odometry, Bool, Float64, String),
            *(Clock, DiagnosticArray, MarkerArray),
        )
    },
}


def _topic(schema: schemas.Topic, publish: QoSProfile, subscribe: QoSProfile) -> Topic:
    return Topic(schema, _CLASSES[schema.type_name], publish, subscribe)


def _measured(schema: schemas.Topic) -> Topic:
    return _topic(schema, qos.SENSOR_PUBLISH, qos.SENSOR)


SAMPLE, FORCE, ESTIMATE, PRESSURE = (
    _topic(schema, qos.SENSOR_PUBLISH, qos.RECORDS)
    for schema in (schemas.SAMPLE, schemas.FORCE, schemas.ESTIMATE, schemas.PRESSURE)
)
COMMAND = _topic(schemas.COMMAND, qos.COMMANDS, qos.COMMANDS)
RECORDS = (SAMPLE, FORCE, ESTIMATE, COMMAND, PRESSURE)

BODY_POSE = _measured(schemas.BODY_POSE)
IMU = _measured(schemas.IMU)
ODOM = _measured(schemas.ODOM)
JOINT_STATES = _measured(schemas.JOINT_STATES)
MARKERS = _measured(schemas.MARKERS)
FEET_MARKERS = _measured(schemas.FEET_MARKERS)
BODY_DOUBT = _topic(schemas.BODY_DOUBT, qos.STATE, qos.STATE)
CLOCK = _topic(schemas.CLOCK, qos.CLOCK_PUBLISH, qos.CLOCK)
DIAGNOSTICS = _topic(schemas.DIAGNOSTICS, qos.DIAGNOSTICS, qos.DIAGNOSTICS)

COMMON_TOPICS = (
    *(CLOCK, *RECORDS, BODY_POSE, IMU, JOINT_STATES),
    *(ODOM, BODY_DOUBT, MARKERS, DIAGNOSTICS),
)
"""The topics that a robot has only once."""


def of_leg(schema: schemas.Topic) -> Topic:
    """Return a topic that each leg has; see :data:`ros_pad.bags.topics.OF_LEGS`."""
    if schema.text:
        return _topic(schema, qos.STATE, qos.STATE)
    if schema is schemas.LEG_SETPOINT:
        return _topic(schema, qos.COMMAND, qos.COMMAND)
    return _measured(schema)


def chosen(text: str, known: Sequence[schemas.Topic]) -> list[schemas.Topic]:
    """Return the topics of each leg that a text names, with commas between them.

    Raises
    ------
    ConfigError
        When one is not known.
    """
    kinds = {schema.kind: schema for schema in known}
    names = [each.strip() for each in text.split(',') if each.strip()]
    for name in names:
        if name not in kinds:
            raise ConfigError(
                f'{name!r} is no topic of a leg: some of {", ".join(kinds)} are needed'
            )
    return [kinds[name] for name in names]


def names() -> dict[str, Topic]:
    """Return every topic that a robot has once by name; they are what a bag has."""
    return {topic.name(): topic for topic in COMMON_TOPICS}
