# SPDX-License-Identifier: Apache-2.0
"""Take the messages of many topics together, with the times at which they were received.

An executor calls a function for each message, which takes twice as long. rclpy's EventsExecutor
gives no times, and may hang when the middleware reports lost messages (rmw_fastrtps #890), so that
lost messages are counted from the numbers that publishers give to their messages.
"""

from __future__ import annotations

import dataclasses
import operator
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

_Received = tuple[int, str, bytes]  # time of receipt, ns, topic, message


@dataclasses.dataclass
class _Source:
    """A subscription, with the number of its last message."""

    subscription: Subscription
    last: int | None = None


class Intake:
    """Subscriptions of a node whose messages wait until :meth:`take`.

    The node must not hand them to its executor: see :attr:`subscriptions`.

    Attributes
    ----------
    lost : Counter of str
        Messages that were lost before they arrived, by topic. Where several publishers share a
        topic, none are counted.
    """

    def __init__(self, node: Node) -> None:
        self.lost: Counter[str] = Counter()
        self._node = node
        self._sources: dict[str, _Source] = {}
        self._replaced: list[Subscription] = []
        self._held: list[_Received] = []

    @property
    def subscriptions(self) -> list[Subscription]:
        """All subscriptions that no executor may take messages from."""
        return [*self._replaced, *(each.subscription for each in self._sources.values())]

    def add(
        self,
        name: str,
        message: type,
        profile: Callable[[list[QoSProfile]], QoSProfile],
    ) -> None:
        """Subscribe to a topic.

        Parameters
        ----------
        name : str
            Full name of the topic.
        message : type
            Message class.
        profile : callable
            Returns the QoS to request from the QoS that publishers are known to offer. It is
            called again when a publisher offers less.
        """
        self._subscribe(name, message, profile([]), profile)

    def _subscribe(
        self,
        name: str,
        message: type,
        requested: QoSProfile,
        profile: Callable[[list[QoSProfile]], QoSProfile],
    ) -> None:
        def adapt(_event: object) -> None:
            if self._sources[name].subscription is subscription:
                # rclpy may crash when a subscription is destroyed in its own callback: it stays.
                self._replaced.append(subscription)
                peers = self._node.get_publishers_info_by_topic(name)
                offered = profile([peer.qos_profile for peer in peers])
                self._subscribe(name, message, offered, profile)

        subscription = self._node.create_subscription(
            message, name, _unused, requested, raw=True,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=adapt),
        )  # fmt: skip
        self._sources[name] = _Source(subscription)

    def take(self, write: Callable[[str, bytes, int], None]) -> None:
        """Hand over topic, bytes and time of receipt, ns, of all messages, in order of receipt."""
        until_ns = time.time_ns()
        for subscription in self._replaced:  # they would keep thousands of messages
            while subscription.handle.take_message(subscription.msg_type, True) is not None:
                pass
        received = self._held
        for name, source in self._sources.items():
            take, message = source.subscription.handle.take_message, source.subscription.msg_type
            while (found := take(message, True)) is not None:
                data, info = found
                self._count(name, source, info['publication_sequence_number'])
                received.append((info['received_timestamp'] or until_ns, name, data))
        received.sort(key=operator.itemgetter(0))
        # A message that came meanwhile may be later than others that are not taken yet.
        held = len(received)
        while held and received[held - 1][0] > until_ns:
            held -= 1
        self._held = received[held:]
        for received_ns, name, data in received[:held]:
            write(name, data, received_ns)

    def _count(self, name: str, source: _Source, number: int | None) -> None:
        """Count the messages that are missing before the one with this number."""
        last, source.last = source.last, number
        if number is None or last is None or number <= last + 1:
            return
        # Each publisher has numbers of its own.
        if self._node.count_publishers(name) == 1:
            self.lost[name] += number - last - 1

    def close(self) -> None:
        """Destroy the subscriptions."""
        for subscription in self.subscriptions:
            self._node.destroy_subscription(subscription)
        self._sources.clear()
        self._replaced.clear()
        self._held.clear()


def _unused(message: Any) -> None:
    """Receive nothing: :meth:`Intake.take` does."""
