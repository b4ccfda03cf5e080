# SPDX-License-Identifier: Apache-2.0
"""Receive the messages of a robot for some seconds."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions

from ros_pad.nodes.intake import Intake
from ros_pad.nodes.qos import message_class
from ros_pad.pace import Progress
from ros_pad.sensing.mapping import Source

_PERIOD = 0.02  # s, between two looks at what has arrived
# Best effort receives from publishers of both kinds.
_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT
)


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
            intake.add(name, classes[source.type_name], _QOS)
        start = time.monotonic()
        while (passed := time.monotonic() - start) < seconds:
            time.sleep(_PERIOD)
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


__all__ = ['receive']
