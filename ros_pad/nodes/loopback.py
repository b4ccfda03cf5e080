# SPDX-License-Identifier: Apache-2.0
"""One end of a message from process to process, with which ``pad doctor`` tries DDS."""

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
    """Say a word again and again, or wait until it is heard; return 0 when it was."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('end', choices=('say', 'hear'))
    parser.add_argument('topic')
    parser.add_argument('word')
    parser.add_argument('--seconds', type=float, default=10.0, help='at most, s')
    options = parser.parse_args()
    rclpy.init()
    heard: list[str] = []
    try:
        node = rclpy.create_node(f'ros_pad_doctor_{options.end}s')
        if options.end == 'say':
            publisher = node.create_publisher(String, options.topic, 10)
            node.create_timer(PERIOD, lambda: publisher.publish(String(data=options.word)))
        else:

            def hear(message: Any) -> None:
                heard.append(message.data)

            node.create_subscription(String, options.topic, hear, 10)
        print('ready', flush=True)
        end = time.monotonic() + options.seconds
        while options.word not in heard and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0 if options.word in heard else 1


if __name__ == '__main__':
    sys.exit(main())
