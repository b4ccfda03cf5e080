# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of every topic: message class and QoS for `ros_pad.bags.topics`.

Names are relative, so that a namespace moves the whole robot; ``/clock`` and ``/diagnostics``
are global, as everywhere in ROS.

Nodes read and write the fields that they need in the bytes of a message: rclpy takes several times
as long to convert whole messages. What is sent does not differ.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import NamedTuple
from weakref import WeakKeyDictionary

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import PoseStamped
from geometry_msgs.msg import TwistWithCovarianceStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.serialization import serialize_message
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_msgs.msg import Float64
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from ros_pad.bags import topics as schemas
from ros_pad.bags.codec import MessageType
from ros_pad.bags.codec import message_type
from ros_pad.bags.definitions import message_definition
from ros_pad.bags.fields import FieldReader
from ros_pad.bags.fields import FieldWriter
from ros_pad.bags.fields import field_of
from ros_pad.errors import BadMessage
from ros_pad.errors import ConfigError
from ros_pad.errors import UnknownEncoding
from ros_pad.nodes import qos

LEGS = (1, 2, 3, 4, 5, 6)
"""Leg numbers of the thesis: 1, 3, 5 and 2, 4, 6 are the tripods."""


class Hooks(NamedTuple):
    """Functions that are called with the messages of all nodes of a context.

    Attributes
    ----------
    published : callable
        Called with full name of the topic and bytes of each message before it is published.
    received : callable
        Called after each message that a node has received and processed.
    """

    published: Callable[[str, bytes], None]
    received: Callable[[], None]


_HOOKS: WeakKeyDictionary[Context, Hooks] = WeakKeyDictionary()


def hook(context: Context, hooks: Hooks) -> None:
    """Set the hooks of all publishers and subscriptions that nodes of a context make from now."""
    _HOOKS[context] = hooks


def unhook(context: Context) -> None:
    """Forget the hooks of a context, which otherwise keep alive what they refer to."""
    _HOOKS.pop(context, None)


Refuse = Callable[[str, Exception], None]
"""Called with the full name of the topic and the reason when a message cannot be read."""


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

    def output(self, node: Node, leg: int | None = None) -> Callable[[Any], None]:
        """Return a function that publishes a message or its bytes; see :meth:`publisher`."""
        publisher = self.publisher(node, leg)
        hooks = _HOOKS.get(node.context)
        if hooks is None:
            return publisher.publish
        name = publisher.topic_name

        def publish(message: Any) -> None:
            data = message if isinstance(message, bytes) else serialize_message(message)
            hooks.published(name, data)
            publisher.publish(data)

        return publish

    def sender(
        self,
        node: Node,
        paths: Sequence[str],
        leg: int | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> Callable[..., None]:
        """Return a function that publishes a message with these numbers, in the order of `paths`.

        The frame is that of the table of topics, other fields are zero; see
        :class:`ros_pad.bags.fields.FieldWriter`.
        """
        frame = {schemas.FRAME: self.schema.frame.format(leg=leg)} if self.schema.frame else {}
        write = FieldWriter(self.message_type, paths, frame | dict(constants or {}))
        publish = self.output(node, leg)
        return lambda *values: publish(write(*values))

    def receive(
        self,
        node: Node,
        callback: Callable[..., None],
        paths: Sequence[str],
        refuse: Refuse,
        leg: int | None = None,
        on_mismatch: Callable[[str], None] | None = None,
    ) -> None:
        """Call a function with some fields of each message, see :meth:`subscription`."""
        name = node.resolve_topic_name(self.name(leg))
        read = FieldReader(self.message_type, paths)
        hooks = _HOOKS.get(node.context)

        def take(data: bytes) -> None:
            try:
                values = read(data)
            except UnknownEncoding:
                try:
                    values = self._decoded(data, paths)
                except Exception as error:  # rclpy raises various ones
                    refuse(name, error)
                    return
            except BadMessage as error:
                refuse(name, error)
                return
            callback(*values)
            if hooks:
                hooks.received()

        self.subscription(node, take, leg, raw=True, on_mismatch=on_mismatch)

    def _decoded(self, data: bytes, paths: Sequence[str]) -> tuple[Any, ...]:
        """Return fields of a message whose encoding only the middleware knows."""
        message = deserialize_message(data, self.message)
        return tuple(field_of(message, path) for path in paths)

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


def _measured(topic: schemas.Topic, message: type) -> Topic:
    return Topic(topic, message, qos.SENSOR_PUBLISH, qos.SENSOR)


PRESSURE = _measured(schemas.PRESSURE, FluidPressure)
PRESSURE_SETPOINT = Topic(schemas.PRESSURE_SETPOINT, FluidPressure, qos.COMMAND, qos.COMMAND)
WRENCH = _measured(schemas.WRENCH, WrenchStamped)
POSITION = _measured(schemas.POSITION, PointStamped)
SLIP = _measured(schemas.SLIP, TwistWithCovarianceStamped)
WETNESS = _measured(schemas.WETNESS, Float64)
FRICTION = _measured(schemas.FRICTION, Float64)
FRICTION_MARGIN = _measured(schemas.FRICTION_MARGIN, Float64)
CONTACT_LOAD = _measured(schemas.CONTACT_LOAD, Float64)
CONTACT_POSITION = _measured(schemas.CONTACT_POSITION, PointStamped)
SLIPPING = _measured(schemas.SLIPPING, Bool)
DOUBT = Topic(schemas.DOUBT, String, qos.STATE, qos.STATE)
MORPHOLOGY = Topic(schemas.MORPHOLOGY, String, qos.STATE, qos.STATE)
BODY_POSE = _measured(schemas.BODY_POSE, PoseStamped)
JOINT_STATES = _measured(schemas.JOINT_STATES, JointState)
MARKERS = Topic(schemas.MARKERS, MarkerArray, qos.SENSOR_PUBLISH, qos.SENSOR)
CLOCK = Topic(schemas.CLOCK, Clock, qos.CLOCK_PUBLISH, qos.CLOCK)
DIAGNOSTICS = Topic(schemas.DIAGNOSTICS, DiagnosticArray, qos.DIAGNOSTICS, qos.DIAGNOSTICS)

LEG_TOPICS = (
    PRESSURE,
    PRESSURE_SETPOINT,
    WRENCH,
    POSITION,
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

COMMON_TOPICS = (CLOCK, BODY_POSE, JOINT_STATES, MARKERS, DIAGNOSTICS)
"""The topics that a robot has only once."""


def names(legs: Sequence[int]) -> dict[str, Topic]:
    """Return every topic by name: ``/clock``, other common topics, then those of each leg.

    Raises
    ------
    ConfigError
        When `legs` is empty, repeats a leg, or has a number outside 1 to 6.
    """
    if not legs or len(set(legs)) < len(legs) or not set(legs) <= set(LEGS):
        raise ConfigError(
            f'legs = {list(legs)} is not allowed: a list of different whole numbers from 1 to 6 is'
            ' needed'
        )
    common = {topic.name(): topic for topic in COMMON_TOPICS}
    return common | {topic.name(leg): topic for leg in legs for topic in LEG_TOPICS}
