# SPDX-License-Identifier: Apache-2.0
"""Every topic of ros_pad: its name, message type and QoS, for all nodes in one place.

Names are relative, so that a namespace moves the whole robot; ``/clock`` and ``/diagnostics``
are global, as everywhere in ROS.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import PoseStamped
from geometry_msgs.msg import TwistWithCovarianceStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_msgs.msg import Float64
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from ros_pad.errors import ConfigError
from ros_pad.nodes import qos

LEGS = (1, 2, 3, 4, 5, 6)
"""Leg numbers of the thesis: 1, 3, 5 and 2, 4, 6 are the tripods."""


@dataclasses.dataclass(frozen=True)
class Topic:
    """A topic, or one per leg.

    Attributes
    ----------
    pattern : str
        The name, with ``{leg}`` where the number of the leg goes.
    message : type
        Message class.
    publish, subscribe : QoSProfile
        What the publisher offers, and what a node that works with the messages asks for.
    """

    pattern: str
    message: type
    publish: QoSProfile
    subscribe: QoSProfile

    @property
    def type_name(self) -> str:
        """The message type as ROS names it, such as ``std_msgs/msg/Float64``."""
        package = self.message.__module__.split('.')[0]
        return f'{package}/msg/{self.message.__name__}'

    def name(self, leg: int | None = None) -> str:
        """Return the name, for a topic of a leg that of one leg."""
        return self.pattern.format(leg=leg)

    def publisher(self, node: Node, leg: int | None = None) -> Publisher:
        """Create a publisher of this topic in a node, which warns of subscriptions that it misses.

        Those ask for more than is offered, and DDS keeps them apart.
        """
        name = node.resolve_topic_name(self.name(leg))

        def warn(event: Any) -> None:
            for peer in node.get_subscriptions_info_by_topic(name):
                for each in qos.mismatches(self.publish, peer.qos_profile):
                    node.get_logger().warning(
                        f'{name}: {_owner(peer, name)} hears nothing from here: its subscription'
                        f' asks for {each.policy} {each.asked}, and {each.offered} is offered;'
                        f' let it ask for {each.policy} {each.offered}'
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
        unheard: Callable[[str], None] | None = None,
    ) -> Subscription:
        """Create a subscription to this topic in a node; a raw one hands over bytes (CDR).

        Of publishers that offer less than is asked for nothing is heard. The node warns of them,
        and passes the words on to `unheard`.
        """
        name = node.resolve_topic_name(self.name(leg))

        def warn(event: Any) -> None:
            for peer in node.get_publishers_info_by_topic(name):
                for each in qos.mismatches(peer.qos_profile, self.subscribe):
                    words = (
                        f'{name}: nothing of {_owner(peer, name)} is heard: its publisher offers'
                        f' {each.policy} {each.offered}, and {each.asked} is asked for;'
                        f' let it offer {each.policy} {each.asked}'
                    )
                    node.get_logger().warning(words)
                    if unheard:
                        unheard(words)

        return node.create_subscription(
            self.message,
            self.name(leg),
            callback,
            self.subscribe,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=warn),
            raw=raw,
        )


def _owner(peer: TopicEndpointInfo, topic: str) -> str:
    """Return which node one end of a topic belongs to."""
    # The ends of a process that has just come are known before its nodes are.
    if 'UNKNOWN' in peer.node_name:
        return f'a node that `ros2 topic info --verbose {topic}` names'
    return f'node {peer.node_namespace.rstrip("/")}/{peer.node_name}'


def _measured(pattern: str, message: type) -> Topic:
    return Topic(pattern, message, qos.SENSOR_PUBLISH, qos.SENSOR)


PRESSURE = _measured('leg_{leg}/pressure', FluidPressure)
PRESSURE_SETPOINT = Topic('leg_{leg}/pressure_setpoint', FluidPressure, qos.COMMAND, qos.COMMAND)
WRENCH = _measured('leg_{leg}/wrench', WrenchStamped)
POSITION = _measured('leg_{leg}/position', PointStamped)
SLIP = _measured('leg_{leg}/slip', TwistWithCovarianceStamped)
WETNESS = _measured('leg_{leg}/wetness', Float64)
FRICTION = _measured('leg_{leg}/friction', Float64)
FRICTION_MARGIN = _measured('leg_{leg}/friction_margin', Float64)
SLIPPING = _measured('leg_{leg}/slipping', Bool)
DOUBT = Topic('leg_{leg}/doubt', String, qos.STATE, qos.STATE)
MORPHOLOGY = Topic('leg_{leg}/morphology', String, qos.STATE, qos.STATE)
BODY_POSE = _measured('body/pose', PoseStamped)
JOINT_STATES = _measured('joint_states', JointState)
MARKERS = Topic('markers', MarkerArray, qos.SENSOR_PUBLISH, qos.SENSOR)
CLOCK = Topic('/clock', Clock, qos.CLOCK_PUBLISH, qos.CLOCK)
DIAGNOSTICS = Topic('/diagnostics', DiagnosticArray, qos.DIAGNOSTICS, qos.DIAGNOSTICS)

LEG_TOPICS = (
    PRESSURE,
    PRESSURE_SETPOINT,
    WRENCH,
    POSITION,
    SLIP,
    WETNESS,
    FRICTION,
    FRICTION_MARGIN,
    SLIPPING,
    DOUBT,
    MORPHOLOGY,
)
"""The topics that every leg has."""

COMMON_TOPICS = (CLOCK, BODY_POSE, JOINT_STATES, MARKERS, DIAGNOSTICS)
"""The topics that there is one of."""


def names(legs: Sequence[int]) -> dict[str, Topic]:
    """Return every topic by name: those that all legs share, ``/clock`` first, then each leg's.

    Raises
    ------
    ConfigError
        When `legs` is empty, repeats a leg, or has a number outside 1 to 6.
    """
    if not legs or len(set(legs)) < len(legs) or not set(legs) <= set(LEGS):
        raise ConfigError(
            f'legs = {list(legs)} is not allowed: different numbers from 1 to 6 are needed'
        )
    common = {topic.name(): topic for topic in COMMON_TOPICS}
    return common | {topic.name(leg): topic for leg in legs for topic in LEG_TOPICS}
