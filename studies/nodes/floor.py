# SPDX-License-Identifier: Apache-2.0
"""The least that the messages of a robot cost: one bare publisher, one bare subscriber, no work.

``python -m studies.nodes.floor publish`` sends the bytes of every topic of six legs at its rate,
``subscribe`` receives them. Neither knows what is in them.
"""

from __future__ import annotations

import sys

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.task import Future

from ros_pad.nodes import qos
from ros_pad.nodes import topics

SAMPLED = (topics.WRENCH, topics.POSITION)
"""Topics at the rate of the sensors, 250 Hz."""

ESTIMATED = (
    *(topics.SLIP, topics.SLIPPING, topics.FRICTION, topics.FRICTION_MARGIN),
    *(topics.CONTACT_LOAD, topics.CONTACT_POSITION, topics.WETNESS),
    *(topics.PRESSURE, topics.PRESSURE_SETPOINT),
)
"""Topics at the rate of the estimates, 50 Hz."""


def _publish(node: Node, chosen: tuple[topics.Topic, ...], period: float) -> None:
    """Publish messages of zeros on these topics of every leg."""
    outputs = [
        (topic.publisher(node, leg).publish, serialize_message(topic.message()))
        for leg in topics.LEGS
        for topic in chosen
    ]

    def send() -> None:
        for output, data in outputs:
            output(data)

    node.create_timer(period, send)


def main(role: str) -> None:
    """Publish, or subscribe, until the process is ended."""
    rclpy.init()
    node = Node(f'floor_{role}')
    if role == 'publish':
        _publish(node, SAMPLED, 0.004)
        _publish(node, ESTIMATED, 0.02)
    else:
        for topic in (*SAMPLED, *ESTIMATED):
            for leg in topics.LEGS:
                node.create_subscription(
                    topic.message, topic.name(leg), lambda data: None, qos.SENSOR, raw=True
                )
    executor = EventsExecutor()
    executor.add_node(node)
    while True:  # without a timeout, rclpy 7.1 may spin without calling anything
        executor.spin_until_future_complete(Future(), timeout_sec=60.0)


if __name__ == '__main__':
    main(sys.argv[1])
