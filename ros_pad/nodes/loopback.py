# SPDX-License-Identifier: Apache-2.0
"""Send or receive a message; ``pad doctor`` runs this in two processes to check DDS."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import String

PERIOD = 0.05  # s, from one message to the next


def main() -> int:
    """Publish a word repeatedly, or wait for it; return 0 if it was received here, else 1."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('end', choices=('publisher', 'subscriber'))
    parser.add_argument('topic')
    parser.add_argument('word')
    parser.add_argument('--seconds', type=float, default=10.0, help='longest run time, s')
    options = parser.parse_args()
    rclpy.init()
    received: list[str] = []
    try:
        node = rclpy.create_node(f'ros_pad_doctor_{options.end}')
        if options.end == 'publisher':
            publisher = node.create_publisher(String, options.topic, 10)
            node.create_timer(PERIOD, lambda: publisher.publish(String(data=options.word)))
        else:

            def receive(message: Any) -> None:
                received.append(message.data)

            node.create_subscription(String, options.topic, receive, 10)
        print('ready', flush=True)
        end = time.monotonic() + options.seconds
        while options.word not in received and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0 if options.word in received else 1


if __name__ == '__main__':
    sys.exit(main())
