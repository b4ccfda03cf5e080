# SPDX-License-Identifier: Apache-2.0
"""Send or receive a word; ``pad doctor`` runs this in two processes to check DDS."""

from __future__ import annotations

import sys
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import String

PERIOD = 0.05  # s, from one message to the next


def main(end: str, topic: str, word: str, seconds: str) -> int:
    """Publish a word again and again, or wait for it as ``subscriber``; 0 if it was received."""
    rclpy.init()
    received: list[str] = []

    def hear(message: Any) -> None:
        received.append(message.data)

    try:
        node = rclpy.create_node(f'ros_pad_doctor_{end}')
        if end == 'publisher':
            publisher = node.create_publisher(String, topic, 10)
            node.create_timer(PERIOD, lambda: publisher.publish(String(data=word)))
        else:
            node.create_subscription(String, topic, hear, 10)
        print('ready', flush=True)
        last = time.monotonic() + float(seconds)
        while word not in received and time.monotonic() < last:
            rclpy.spin_once(node, timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0 if word in received else 1


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
