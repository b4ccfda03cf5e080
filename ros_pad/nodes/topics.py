# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of every topic: message class and QoS for `ros_pad.bags.topics`.

Names are relative, so that a namespace moves the whole robot; ``/clock`` and ``/diagnostics``
are global, as everywhere in ROS.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import PoseStamped
from geometry_msgs.msg import TwistWithCovarianceStamped
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure
from sensor_msgs.msg import Imu
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_msgs.msg import Float64
from std_msgs.msg import String
from std_msgs.msg import UInt8MultiArray
from visualization_msgs.msg import MarkerArray

from ros_pad.bags import topics as schemas
from ros_pad.bags.codec import MessageType
from ros_pad.bags.codec import message_type
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
    sources : tuple of str
        The nodes of ros_pad that may send it in batches too; empty where none does.
    """

    schema: schemas.Topic
    message: type
    publish: QoSProfile
    subscribe: QoSProfile
    sources: tuple[str, ...] = ()

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


def _measured(topic: schemas.Topic, message: type, *sources: str) -> Topic:
    return Topic(topic, message, qos.SENSOR_PUBLISH, qos.SENSOR, sources)


PRESSURE = _measured(schemas.PRESSURE, FluidPressure, 'regulator')
PRESSURE_SETPOINT = Topic(
    schemas.PRESSURE_SETPOINT, FluidPressure, qos.COMMAND, qos.COMMAND, ('controller',)
)
WRENCH = _measured(schemas.WRENCH, WrenchStamped, 'simulator', 'body_estimator')
POSITION = _measured(schemas.POSITION, PointStamped, 'simulator', 'body_estimator')
FOOT_WRENCH = _measured(schemas.FOOT_WRENCH, WrenchStamped, 'simulator')
CONTACT_VELOCITY = _measured(
    schemas.CONTACT_VELOCITY, TwistWithCovarianceStamped, 'body_estimator'
)
SLIP = _measured(schemas.SLIP, TwistWithCovarianceStamped, 'estimator')
WETNESS = _measured(schemas.WETNESS, Float64, 'estimator')
FRICTION = _measured(schemas.FRICTION, Float64, 'estimator')
FRICTION_MARGIN = _measured(schemas.FRICTION_MARGIN, Float64, 'estimator')
CONTACT_LOAD = _measured(schemas.CONTACT_LOAD, Float64, 'estimator')
CONTACT_POSITION = _measured(schemas.CONTACT_POSITION, PointStamped, 'estimator')
SLIPPING = _measured(schemas.SLIPPING, Bool, 'estimator')
DOUBT = Topic(schemas.DOUBT, String, qos.STATE, qos.STATE)
MORPHOLOGY = Topic(schemas.MORPHOLOGY, String, qos.STATE, qos.STATE)
BODY_POSE = _measured(schemas.BODY_POSE, PoseStamped, 'simulator')
IMU = _measured(schemas.IMU, Imu, 'simulator')
ODOM = _measured(schemas.ODOM, Odometry, 'body_estimator')
BODY_DOUBT = Topic(schemas.BODY_DOUBT, String, qos.STATE, qos.STATE)
JOINT_STATES = _measured(schemas.JOINT_STATES, JointState, 'simulator')
MARKERS = Topic(schemas.MARKERS, MarkerArray, qos.SENSOR_PUBLISH, qos.SENSOR)
CLOCK = Topic(schemas.CLOCK, Clock, qos.CLOCK_PUBLISH, qos.CLOCK)
DIAGNOSTICS = Topic(schemas.DIAGNOSTICS, DiagnosticArray, qos.DIAGNOSTICS, qos.DIAGNOSTICS)

_BATCHES = 'std_msgs/msg/UInt8MultiArray'
BATCHES = {
    **{
        source: _measured(schemas.Topic(f'_batches/{source}', _BATCHES), UInt8MultiArray)
        for source in ('simulator', 'regulator', 'body_estimator', 'estimator')
    },
    'controller': Topic(
        schemas.Topic('_batches/controller', _BATCHES), UInt8MultiArray, qos.COMMANDS, qos.COMMANDS
    ),
}
"""The topic with the batches of each node that sends some, see `ros_pad.nodes.batches`."""

LEG_TOPICS = (
    PRESSURE,
    PRESSURE_SETPOINT,
    WRENCH,
    POSITION,
    FOOT_WRENCH,
    CONTACT_VELOCITY,
    SLIP,
    WETNESS,
    FRICTION,
    FRICTION_MARGIN,
    CONTACT_LOAD,
    CONTACT_POSITION,
    SLIPPING,
    DOUBT,
    MORPHOLOGY,
)
"""The topics that every leg has."""

COMMON_TOPICS = (
    *(CLOCK, BODY_POSE, IMU, JOINT_STATES),
    *(ODOM, BODY_DOUBT, MARKERS, DIAGNOSTICS),
)
"""The topics that a robot has only once."""


def names(legs: Sequence[int]) -> dict[str, Topic]:
    """Return every topic by name: ``/clock``, other common topics, then those of each leg.

    Raises
    ------
    ConfigError
        When `legs` is empty, repeats a leg, or has a number outside 1 to 8.
    """
    if not legs or len(set(legs)) < len(legs) or not set(legs) <= set(range(1, MOST_LEGS + 1)):
        raise ConfigError(
            f'legs = {list(legs)} is not allowed: a list of different whole numbers from 1 to 8 is'
            ' needed'
        )
    common = {topic.name(): topic for topic in COMMON_TOPICS}
    return common | {topic.name(leg): topic for leg in legs for topic in LEG_TOPICS}
