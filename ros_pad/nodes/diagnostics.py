# SPDX-License-Identifier: Apache-2.0
"""What a node says of its health on ``/diagnostics``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ros_pad.nodes import topics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import LATE, Pace

OLDEST = 0.1
"""Age of the last sample, s, from which a node that needs samples counts as late."""


class Diagnostics:
    """Publish the health of a node.

    Parameters
    ----------
    node : Node
    messages : Messages
        Its publishers and subscriptions.

    Attributes
    ----------
    reported : object
        What was found when it was last said.
    """

    OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

    def __init__(self, node: Node, messages: Messages) -> None:
        self._name, self._messages = node.get_name(), messages
        self._publish = messages.output(topics.DIAGNOSTICS)
        self._pace = Pace(1_000_000_000)
        self.reported: Any = None
        self._since_ns, self._counted = messages.now_ns(), 0

    def due(self, now_ns: int, found: Any = None) -> bool:
        """Return whether to tell of it: once a second, and as soon as what was found changes."""
        due = self._pace.due(now_ns) or found != self.reported
        self.reported = found
        return due

    def status(
        self,
        name: str,
        level: bytes,
        message: str,
        values: Mapping[str, object] | None = None,
        part: str = '',
    ) -> DiagnosticStatus:
        """Return a status of this node, with values by name, and the part that it is about."""
        return DiagnosticStatus(
            name=f'{self._name}: {name}',
            hardware_id=part,
            level=level,
            message=message,
            values=[KeyValue(key=key, value=str(each)) for key, each in (values or {}).items()],
        )

    def rate(self, now_ns: int, samples: int, last_ns: int) -> DiagnosticStatus:
        """Return rate and age of samples, of which so many have come, the last one at a time."""
        rate = (samples - self._counted) / (max(1, now_ns - self._since_ns) * 1e-9)
        self._since_ns, self._counted = now_ns, samples
        age = (now_ns - last_ns) * 1e-9
        late = rate > 0.0 and not -OLDEST < age < OLDEST
        text = f'samples are {age:.3g} s old' if late else f'{rate:.0f} samples a second'
        values = {
            'samples a second (Hz)': f'{rate:.1f}',
            'age of the last sample (s)': f'{age:.3f}',
        }
        text = f'{LATE}, or clocks differ: {text}' if late else text
        return self.status('rate', self.WARN if late else self.OK, text, values)

    def send(self, now_ns: int, statuses: Sequence[DiagnosticStatus]) -> None:
        """Publish these, and which messages were refused."""
        array = DiagnosticArray(status=[*statuses, *self._messages.refusals.statuses()])
        set_stamp(array.header.stamp, now_ns)
        self._publish(array)
