# SPDX-License-Identifier: Apache-2.0
"""What a node sends and receives: records, and messages of others.

Nodes read the fields that they need in the bytes of a message, and send bytes in which only
numbers differ: rclpy takes several times as long to convert whole messages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from ros_pad.bags import topics as schemas
from ros_pad.bags.fields import FieldReader, FieldWriter, field_of
from ros_pad.bags.wire import Wire
from ros_pad.errors import BadMessage, UnknownEncoding
from ros_pad.nodes import topics
from ros_pad.nodes.refusals import Refusals
from ros_pad.nodes.stamps import clock_of
from ros_pad.nodes.topics import Topic
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.records import Block


class Messages:
    """Publishers and subscriptions of a node.

    Parameters
    ----------
    node : Node

    Attributes
    ----------
    refusals : Refusals
        Counts of messages that could not be read.
    now_ns : callable
        Returns the node's time, ns.
    simulated : bool
        Whether this is the time of ``/clock``.
    """

    def __init__(self, node: Node) -> None:
        self.refusals = Refusals(node)
        self.now_ns = clock_of(node)
        self.simulated: bool = node.get_parameter('use_sim_time').value
        self._node = node
        self._record_ns = 0

    def output(self, topic: Topic, leg: int | None = None) -> Callable[[Any], None]:
        """Return a function that publishes whole messages, or their bytes."""
        publish, of_type = topic.publisher(self._node, leg).publish, topic.message_type

        def send(message: Any) -> None:
            if not isinstance(message, bytes):
                # rclpy leaves what was in memory between numbers: a trial has the same bytes.
                message = of_type.encode(of_type.decode(serialize_message(message)))
            publish(message)

        return send

    def sender(
        self,
        topic: Topic,
        paths: Sequence[str],
        leg: int | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> Callable[..., None]:
        """Return a function that sends a message with these numbers, in the order of `paths`.

        The frame is that of the table of topics, other fields are zero; see
        :class:`ros_pad.bags.fields.FieldWriter`.
        """
        schema, publish = topic.schema, topic.publisher(self._node, leg).publish
        frame = {schemas.FRAME: schema.frame.format(leg=leg)} if schema.frame else {}
        write = FieldWriter(topic.message_type, paths, frame | dict(constants or {}))
        return lambda *values: publish(write(*values))

    def record_output(
        self, topic: Topic, legs: Sequence[int], fields: Sequence[str] | None = None
    ) -> Callable[[Block], None]:
        """Return a function that publishes blocks of records of these legs, with some fields."""
        assert topic.schema.record
        encode = Wire(topic.schema.record, legs, fields).encode
        publish = topic.publisher(self._node).publish
        return lambda block: publish(encode(block))

    def receive_record(
        self,
        topic: Topic,
        legs: Sequence[int],
        callback: Callable[[Block], None],
        on_mismatch: Callable[[str], None] | None = None,
    ) -> None:
        """Call a function with each block of records of these legs."""
        assert topic.schema.record
        decode, name = Wire(topic.schema.record, legs).decode, topic.name()

        def take(data: bytes) -> None:
            try:
                block = decode(data)
            except BadMessage as error:
                self.refusals(self._node.resolve_topic_name(name), error)
            else:
                callback(block)

        topic.subscription(self._node, take, raw=True, on_mismatch=on_mismatch)

    def receive(
        self,
        topic: Topic,
        callback: Callable[..., None],
        paths: Sequence[str] = (),
        leg: int | None = None,
        on_mismatch: Callable[[str], None] | None = None,
    ) -> None:
        """Call a function with some fields of each message; without paths, with the message."""
        name = self._node.resolve_topic_name(topic.name(leg))
        read = FieldReader(topic.message_type, paths) if paths else None

        def values_of(data: bytes) -> tuple[Any, ...]:
            if read:
                with suppress(UnknownEncoding):  # only the middleware knows it
                    return read(data)
            message = deserialize_message(data, topic.message)
            return tuple(field_of(message, path) for path in paths) if paths else (message,)

        def take(data: bytes) -> None:
            try:
                values = values_of(data)
            except Exception as error:  # rclpy raises various ones
                self.refusals(name, error)
            else:
                callback(*values)

        topic.subscription(self._node, take, leg, raw=True, on_mismatch=on_mismatch)

    def on_tick(self, period: float, callback: Callable[[int], None], every: bool = False) -> None:
        """Call a function again and again with the node's time, ns.

        In real time a timer calls it every ``period`` seconds; its clock keeps running when the
        time of day is changed. In simulated time nodes live by the stamps of records, see
        :meth:`advance`, and ``/clock`` calls it where no records come, or at ``every`` step.
        """
        if not self.simulated:
            steady = NodeClock(clock_type=ClockType.STEADY_TIME)
            self._node.create_timer(period, lambda: callback(self.now_ns()), clock=steady)
            return

        def on_clock(seconds: int, fraction: int) -> None:
            now_ns = seconds * 1_000_000_000 + fraction
            # Which of a record and the clock of its moment comes first must mean nothing.
            if every or abs(now_ns - self._record_ns) > TICK_PERIOD_NS:
                callback(now_ns)

        self.receive(topics.CLOCK, on_clock, topics.CLOCK.schema.values)

    def advance(self, stamp_ns: int) -> None:
        """Note the stamp of a record that is processed, ns."""
        self._record_ns = stamp_ns
