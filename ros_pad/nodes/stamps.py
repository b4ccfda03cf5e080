# SPDX-License-Identifier: Apache-2.0
"""Time stamps of messages in ns, and a timer that follows real or simulated time."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node

from ros_pad.bags.codec import clock_time
from ros_pad.nodes import topics


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def set_stamp(stamp: Time, time_ns: int) -> None:
    """Write a time in ns into a stamp."""
    stamp.sec, stamp.nanosec = divmod(time_ns, 1_000_000_000)


def on_tick(node: Node, period: float, callback: Callable[[int], None]) -> None:
    """Call a function again and again with the node's time, ns.

    In simulated time it is called at each ``/clock`` message with the time in that message, so
    that a run can be repeated exactly. Otherwise a timer calls it every ``period`` seconds; the
    timer uses the steady clock, which keeps running when the time of day is changed.
    """
    if node.get_parameter('use_sim_time').value:

        def tick(data: bytes) -> None:
            now_ns = clock_time(data)
            if now_ns is not None:
                callback(now_ns)

        topics.CLOCK.subscription(node, tick, raw=True)
    else:
        clock = node.get_clock()
        steady = NodeClock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(period, lambda: callback(clock.now().nanoseconds), clock=steady)
