# SPDX-License-Identifier: Apache-2.0
"""What a node sends and receives.

Nodes read and write the fields that they need in the bytes of a message: rclpy takes several times
as long to convert whole messages. What is sent does not differ.

Nodes of ros_pad send one another the measurements and set-points of one moment in one message, see
`ros_pad.nodes.batches`. The topic of each is published while others subscribe to it. A message
that comes both ways is received once.
"""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import NamedTuple
from weakref import WeakKeyDictionary

from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.serialization import serialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ros_pad.bags import topics as schemas
from ros_pad.bags.fields import FieldReader
from ros_pad.bags.fields import FieldWriter
from ros_pad.bags.fields import field_of
from ros_pad.errors import BadMessage
from ros_pad.errors import UnknownEncoding
from ros_pad.nodes import topics
from ros_pad.nodes.batches import BatchReader
from ros_pad.nodes.batches import batch_head
from ros_pad.nodes.refusals import Refusals
from ros_pad.nodes.stamps import clock_of
from ros_pad.nodes.topics import Topic


class Hooks(NamedTuple):
    """Functions that are called with the messages of all nodes of a context.

    Attributes
    ----------
    published : callable
        Called with full name of the topic and bytes of each message before it is published.
    received : callable
        Called after each message, or batch, that a node has received and processed.
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


_Take = Callable[[bytes], bool]
"""Processes a message; returns False when it cannot be read."""

_MOST_HEADS = 64  # of batches, that are remembered
_MOST_HELD = 50  # batches that wait at most
_LOOK_PERIOD = 1.0  # s, between looks at the subscriptions of a topic that others want
_LONG_PERIOD = 10.0  # s, the same where none do
_MEMORY = 1.0  # s, in which a message comes both ways


class Once:
    """Drop messages that came before, once in a batch of a node and once alone."""

    def __init__(self) -> None:
        self._batches: deque[tuple[float, list[tuple[str, bytes]]]] = deque(maxlen=16)
        self._alone: deque[tuple[float, tuple[str, bytes]]] = deque(maxlen=64)

    def of_batch(self, messages: list[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
        """Return the messages of a batch that have not come alone: topics and bytes."""
        now = time.monotonic()
        while self._alone and self._alone[0][0] < now - _MEMORY:
            self._alone.popleft()
        if self._alone:
            messages = [each for each in messages if not self._came_alone(each)]
        self._batches.append((now, [*messages]))
        return messages

    def _came_alone(self, message: tuple[str, bytes]) -> bool:
        for before in self._alone:
            if before[1] == message:
                self._alone.remove(before)
                return True
        return False

    def is_new(self, topic: str, data: bytes) -> bool:
        """Return whether a message that has come alone has not come in a batch."""
        now = time.monotonic()
        for at, batch in self._batches:
            if at > now - _MEMORY and (topic, data) in batch:
                batch.remove((topic, data))
                return False
        self._alone.append((now, (topic, data)))
        return True


def _whole(topic: Topic) -> Callable[[bytes], tuple[Any, ...]]:
    """Return a function that reads whole messages, for those of which the parts have no place."""

    def read(data: bytes) -> tuple[Any, ...]:
        try:
            return (deserialize_message(data, topic.message),)
        except Exception as error:  # rclpy raises various ones
            raise BadMessage(str(error)) from None

    return read


class _Output:
    """A topic whose messages go out in batches, and alone where others subscribe to it."""

    def __init__(self, node: Node, publisher: Publisher, batches: Publisher) -> None:
        self.name = publisher.topic_name
        self.publish = publisher.publish
        self._node = node
        self._batches = batches.topic_name
        self._count = publisher.handle.get_subscription_count
        self._counts = (0, 0)
        self._wanted = False
        self._look_at = 0.0  # monotonic time of the next look

    def wanted(self, receivers: int, now: float) -> bool:
        """Return whether a node that does not receive batches subscribes to the topic.

        Parameters
        ----------
        receivers : int
            Number of subscriptions to the batches.
        now : float
            Monotonic time, s.
        """
        counts = self._count(), receivers
        if counts != self._counts or now >= self._look_at:
            again = counts == self._counts
            self._counts = counts
            self._wanted = counts[0] > 0 and self._has_others(counts[0])
            # A first look may see a graph that is older than the counts.
            self._look_at = now + (_LONG_PERIOD if again and not self._wanted else _LOOK_PERIOD)
        return self._wanted

    def _has_others(self, count: int) -> bool:
        owners = Counter(map(_owner, self._node.get_subscriptions_info_by_topic(self.name)))
        receivers = map(_owner, self._node.get_subscriptions_info_by_topic(self._batches))
        # The graph may not yet know all that DDS has connected, nor all names.
        unknown = owners.total() < count or any('UNKNOWN' in name for _, _, name in owners)
        return unknown or owners != Counter(set(receivers) & set(owners))


def _owner(peer: TopicEndpointInfo) -> tuple[bytes, str, str]:
    """Return what distinguishes a node from all others: its process and its name."""
    return bytes(peer.endpoint_gid)[:12], peer.node_namespace, peer.node_name


class Outgoing(NamedTuple):
    """A message that differs from the one before in some numbers; see :meth:`Messages.sender`."""

    topic: Topic
    paths: Sequence[str]
    leg: int | None = None
    constants: Mapping[str, Any] | None = None

    def writer(self) -> FieldWriter:
        """Return what writes the message."""
        schema = self.topic.schema
        frame = {schemas.FRAME: schema.frame.format(leg=self.leg)} if schema.frame else {}
        constants = frame | dict(self.constants or {})
        return FieldWriter(self.topic.message_type, self.paths, constants)


class _Part:
    """Messages that are written together: their topics, sizes and places in the bytes of all."""

    def __init__(self, outputs: Sequence[_Output], sizes: Sequence[int]) -> None:
        self.outputs, self.sizes = outputs, sizes
        ends = itertools.accumulate(sizes, initial=0)
        self.places = [slice(start, end) for start, end in itertools.pairwise(ends)]


class Messages:
    """Publishers and subscriptions of a node.

    Parameters
    ----------
    node : Node
    source : str
        Key in :data:`ros_pad.nodes.topics.BATCHES` of the batches that it sends; empty: the first
        source of what it sends.

    Attributes
    ----------
    refusals : Refusals
        Counts of messages that could not be read.
    now_ns : callable
        Returns the node's time, ns.
    """

    def __init__(self, node: Node, source: str = '') -> None:
        self.refusals = Refusals(node)
        self._source = source
        self.now_ns = clock_of(node)
        self._node = node
        self._hooks = _HOOKS.get(node.context)
        self._takers: dict[str, dict[str, list[_Take]]] = {}  # by source and topic
        self._once: dict[str, Once] = {}  # by source
        self._held: list[tuple[dict[str, list[_Take]], list[tuple[str, bytes]]]] = []
        self._due: Callable[[list[tuple[str, bytes]]], bool] = lambda messages: True
        self._batches: Publisher | None = None
        self._pending: list[tuple[_Part, bytes]] = []  # for the next batch
        self._heads: dict[tuple[_Part, ...], bytes] = {}
        self._outputs: dict[str, _Output] = {}  # by name of the topic

    def output(self, topic: Topic, leg: int | None = None) -> Callable[[Any], None]:
        """Return a function that publishes a message, or its bytes, alone at once."""
        publisher, hooks = topic.publisher(self._node, leg), self._hooks
        name = publisher.topic_name
        if hooks is None:
            return publisher.publish

        def publish(message: Any) -> None:
            data = message if isinstance(message, bytes) else serialize_message(message)
            hooks.published(name, data)
            publisher.publish(data)

        return publish

    def sender(
        self,
        topic: Topic,
        paths: Sequence[str],
        leg: int | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> Callable[..., None]:
        """Return a function that sends a message with these numbers, in the order of `paths`.

        The frame is that of the table of topics, other fields are zero; see
        :class:`ros_pad.bags.fields.FieldWriter`. What goes out in batches is published by
        :meth:`flush`, which is called after each received message and each tick.
        """
        outgoing = Outgoing(topic, paths, leg, constants)
        if topic.sources:
            return self.joint_sender([outgoing])
        write, publish = outgoing.writer(), self.output(topic, leg)
        return lambda *values: publish(write(*values))

    def joint_sender(self, outgoing: Sequence[Outgoing]) -> Callable[..., None]:
        """Return a function that sends several messages with the numbers of all, in their order.

        All of them go out in batches. This is faster than a sender for each. All topics of a node
        have one source in common, whose batches these are.
        """
        writers = [each.writer() for each in outgoing]
        write = FieldWriter.joined(writers)
        part = _Part(
            [self._batched(each.topic, each.leg) for each in outgoing],
            [each.size for each in writers],
        )
        add, hooks = self._pending.append, self._hooks

        def send(*values: float) -> None:
            data = write(*values)
            add((part, data))
            if hooks:
                for output, place in zip(part.outputs, part.places, strict=True):
                    hooks.published(output.name, data[place])

        return send

    def _batched(self, topic: Topic, leg: int | None) -> _Output:
        if self._batches is None:
            self._batches = topics.BATCHES[self._source or topic.sources[0]].publisher(self._node)
        name = topic.name(leg)
        if name not in self._outputs:
            publisher = topic.publisher(self._node, leg)
            self._outputs[name] = _Output(self._node, publisher, self._batches)
        return self._outputs[name]

    def flush(self) -> None:
        """Publish the batch of what was sent since the last call, then what others want alone."""
        if not self._pending:
            return
        assert self._batches is not None
        pending = [*self._pending]
        self._pending.clear()
        receivers, now = self._batches.handle.get_subscription_count(), time.monotonic()
        if receivers:
            head = self._head(tuple(part for part, _ in pending))
            self._batches.publish(head + b''.join([data for _, data in pending]))
        for part, data in pending:
            for place, output in enumerate(part.outputs):
                if output.wanted(receivers, now):
                    output.publish(data[part.places[place]])

    def _head(self, parts: tuple[_Part, ...]) -> bytes:
        """Return what comes before these parts in a batch."""
        head = self._heads.get(parts)
        if head is None:
            if len(self._heads) == _MOST_HEADS:
                self._heads.clear()
            names = [output.name for part in parts for output in part.outputs]
            sizes = [size for part in parts for size in part.sizes]
            head = self._heads[parts] = batch_head(names, sizes)
        return head

    def receive(
        self,
        topic: Topic,
        callback: Callable[..., None],
        paths: Sequence[str],
        leg: int | None = None,
        on_mismatch: Callable[[str], None] | None = None,
    ) -> None:
        """Call a function with some fields of each message, see :meth:`Topic.subscription`.

        Without paths it is called with the whole message.
        """
        name = self._node.resolve_topic_name(topic.name(leg))
        take = self._taker(topic, name, callback, paths)
        if not topic.sources:

            def take_only(data: bytes) -> None:
                take(data)
                self._finish()

            topic.subscription(self._node, take_only, leg, raw=True, on_mismatch=on_mismatch)
            return
        for source in topic.sources:
            if source not in self._takers:
                self._receive_batches(source)
        takers = [self._takers[source] for source in topic.sources]
        if name in takers[0]:  # topics of two legs may be remapped to one
            takers[0][name].append(take)
            return
        takes = [take]  # the same list for all sources
        for each in takers:
            each[name] = takes
        onces = [self._once[source] for source in topic.sources]

        def take_alone(data: bytes) -> None:
            if all(once.is_new(name, data) for once in onces):
                self._take_held()
                for each in takes:
                    each(data)
                self._finish()

        topic.subscription(self._node, take_alone, leg, raw=True, on_mismatch=on_mismatch)

    def _taker(
        self, topic: Topic, name: str, callback: Callable[..., None], paths: Sequence[str]
    ) -> _Take:
        """Return a function that reads a message and calls another one with its fields."""
        refuse = self.refusals
        read = FieldReader(topic.message_type, paths) if paths else _whole(topic)

        def take(data: bytes) -> bool:
            try:
                values = read(data)
            except UnknownEncoding:  # only the middleware knows it
                try:
                    message = deserialize_message(data, topic.message)
                    values = tuple(field_of(message, path) for path in paths)
                except Exception as error:  # rclpy raises various ones
                    refuse(name, error)
                    return False
            except BadMessage as error:
                refuse(name, error)
                return False
            callback(*values)
            return True

        return take

    def _receive_batches(self, source: str) -> None:
        takers: dict[str, list[_Take]] = {}
        once = Once()
        self._takers[source], self._once[source] = takers, once
        batches = topics.BATCHES[source]
        name = self._node.resolve_topic_name(batches.name())
        read = BatchReader()

        def take(batch: bytes) -> None:
            try:
                messages = read(batch)
            except BadMessage as error:
                self.refusals(name, error)
                return
            messages = once.of_batch([each for each in messages if each[0] in takers])
            self._held.append((takers, messages))
            if len(self._held) >= _MOST_HELD or self._due(messages):
                self._take_held()
                self._finish()

        batches.subscription(self._node, take, raw=True)

    def hold(self, due: Callable[[list[tuple[str, bytes]]], bool]) -> None:
        """Let batches wait, in order, until one of them is due, or something else happens.

        Work that is done in one go takes less processor time than the same work in parts.

        Parameters
        ----------
        due : callable
            Called with the messages of each batch, topics and bytes; returns whether they and all
            that wait are to be processed now.
        """
        self._due = due

    def _take_held(self) -> None:
        held = [*self._held]
        self._held.clear()
        for takers, messages in held:
            for topic, data in messages:
                # What follows a bad message in a batch is not worth the time.
                if not all(take(data) for take in takers[topic]):
                    break

    def _finish(self) -> None:
        """End the work on a message, or batch."""
        self.flush()
        if self._hooks:
            self._hooks.received()

    def on_tick(self, period: float, callback: Callable[[int], None]) -> None:
        """Call a function again and again with the node's time, ns.

        In simulated time it is called at each ``/clock`` message with the time in that message, so
        that a run can be repeated exactly. Otherwise a timer calls it every ``period`` seconds;
        its clock keeps running when the time of day is changed.
        """
        if self._node.get_parameter('use_sim_time').value:

            def take(seconds: int, fraction: int) -> None:
                callback(seconds * 1_000_000_000 + fraction)

            self.receive(topics.CLOCK, take, topics.CLOCK.schema.values)
        else:

            def tick() -> None:
                self._take_held()
                callback(self.now_ns())
                self.flush()

            steady = NodeClock(clock_type=ClockType.STEADY_TIME)
            self._node.create_timer(period, tick, clock=steady)
