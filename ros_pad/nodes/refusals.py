# SPDX-License-Identifier: Apache-2.0
"""Messages that a node cannot read: counted by topic, logged, reported on ``/diagnostics``."""

from __future__ import annotations

import time
from collections import Counter

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node


class Refusals:
    """Count the messages that a node cannot read.

    Attributes
    ----------
    counts : Counter of str
        Number of refused messages by full name of the topic.
    """

    def __init__(self, node: Node) -> None:
        self.counts: Counter[str] = Counter()
        self._node = node
        self._reason = ''
        self._quiet_until = 0.0

    def __call__(self, topic: str, error: Exception) -> None:
        """Count a message of a topic that is refused for the reason in `error`, and warn of it."""
        self.counts[topic] += 1
        self._reason = f'{topic}: message refused: {error}'
        # rclpy's own throttle takes 0.3 ms for each text that it drops.
        if time.monotonic() > self._quiet_until:
            self._quiet_until = time.monotonic() + 1.0
            self._node.get_logger().warning(f'{self._reason}; {self.counts[topic]} so far')

    def statuses(self) -> list[DiagnosticStatus]:
        """Return a status with the counts for ``/diagnostics``; none if nothing was refused."""
        if not self.counts:
            return []
        return [
            DiagnosticStatus(
                name=f'{self._node.get_name()}: refused messages',
                level=DiagnosticStatus.WARN,
                message=self._reason,
                values=[KeyValue(key=topic, value=str(n)) for topic, n in self.counts.items()],
            )
        ]
