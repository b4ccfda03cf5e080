# SPDX-License-Identifier: Apache-2.0
"""Take the messages of many topics together, with times of receipt; listen to a robot.

An executor calls a function for each message, which takes twice as long. rclpy's EventsExecutor
gives no times, and may hang when the middleware reports lost messages (rmw_fastrtps #890), so that
lost messages are counted from the numbers that publishers give to their messages.
"""

from __future__ import annotations

import operator
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from ros_pad.nodes.qos import message_class
from ros_pad.pace import Progress
from ros_pad.sensing.mapping import Source

# Best effort receives from publishers of both kinds.
_LISTEN = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT
)


class Intake:
    """Subscriptions of a node whose messages wait until :meth:`take`.

    The node must not hand them to its executor: see :attr:`subscriptions`.

    Attributes
    ----------
    lost : Counter of str
        Messages that were lost before they arrived, by topic. Where several publishers share a
        topic, none are counted.
    subscriptions : dict of Subscription
        By full name of the topic; no executor may take messages from them.
    """

    def __init__(self, node: Node) -> None:
        self.lost: Counter[str] = Counter()
        self.subscriptions: dict[str, Subscription] = {}
        self._node = node
        self._numbers: dict[str, int | None] = {}  # of the last message of a topic
        self._held: list[tuple[int, str, bytes]] = []

    def add(self, name: str, message: type, profile: QoSProfile) -> None:
        """Subscribe to a topic by its full name, with a message class and QoS."""
        self.subscriptions[name] = self._node.create_subscription(
            message, name, lambda data: None, profile, raw=True
        )

    def take(self, write: Callable[[str, bytes, int], object]) -> None:
        """Hand over topic, bytes and time of receipt, ns, of all messages, in order of receipt."""
        until_ns = time.time_ns()
        received = self._held
        for name, subscription in self.subscriptions.items():
            take, message = subscription.handle.take_message, subscription.msg_type
            while (found := take(message, True)) is not None:
                data, info = found
                self._count(name, info['publication_sequence_number'])
                received.append((info['received_timestamp'] or until_ns, name, data))
        received.sort(key=operator.itemgetter(0))
        # A message that came meanwhile may be later than others that are not taken yet.
        held = len(received)
        while held and received[held - 1][0] > until_ns:
            held -= 1
        self._held = received[held:]
        for received_ns, name, data in received[:held]:
            write(name, data, received_ns)

    def _count(self, name: str, number: int | None) -> None:
        """Count the messages that are missing before the one with this number."""
        last, self._numbers[name] = self._numbers.get(name), number
        if number is None or last is None or number <= last + 1:
            return
        # Each publisher has numbers of its own.
        if self._node.count_publishers(name) == 1:
            self.lost[name] += number - last - 1

    def close(self) -> None:
        """Destroy the subscriptions."""
        for subscription in self.subscriptions.values():
            self._node.destroy_subscription(subscription)
        self.subscriptions.clear()


def receive(
    sources: Sequence[Source],
    seconds: float,
    namespace: str = '',
    progress: Progress | None = None,
) -> tuple[list[tuple[str, Any, int]], dict[str, str]]:
    """Receive messages for some seconds.

    Parameters
    ----------
    sources : sequence of Source
        Topics and types.
    seconds : float
        How long, s.
    namespace : str
        Namespace of the topics.
    progress : callable, optional
        Called with the time that has passed, s.

    Returns
    -------
    messages : list of (str, message, int)
        Topic as in its source, message, and time of arrival, ns.
    topics : dict of str to str
        Type of each topic that somebody publishes.

    Raises
    ------
    ConfigError
        When a message type is not installed.
    """
    classes = {source.type_name: message_class(source.type_name) for source in sources}
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Node('doctor', context=context, namespace=namespace, start_parameter_services=False)
        intake, names, found = Intake(node), {}, []
        for source in sources:
            name = node.resolve_topic_name(source.topic)
            names[name] = source
            intake.add(name, classes[source.type_name], _LISTEN)
        start = time.monotonic()
        while (passed := time.monotonic() - start) < seconds:
            time.sleep(0.02)
            intake.take(lambda *message: found.append(message))
            if progress:
                progress(min(passed, seconds))
        topics = {
            name: types[0]
            for name, types in node.get_topic_names_and_types()
            if node.count_publishers(name)
        }
        node.destroy_node()
    finally:
        context.try_shutdown()
    messages = [
        (names[name].topic, deserialize_message(data, classes[names[name].type_name]), at)
        for name, data, at in found
    ]
    return messages, topics
