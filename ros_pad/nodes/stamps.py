# SPDX-License-Identifier: Apache-2.0
"""Time stamps of messages as whole nanoseconds, and a clock tick that works in both times."""

from __future__ import annotations

import struct
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node

from ros_pad.nodes import topics


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def set_stamp(stamp: Time, time_ns: int) -> None:
    """Write a time in ns into a stamp."""
    stamp.sec, stamp.nanosec = divmod(time_ns, 1_000_000_000)


def clock_time(data: bytes) -> int | None:
    """Return the time in ns in a ``/clock`` message as it travels; None where the bytes are none.

    It comes with every sample, and most nodes only glance at it. CDR: four bytes of
    encapsulation, seconds, nanoseconds.
    """
    if len(data) < 12:  # anybody can publish any bytes
        return None
    order = '<' if data[1] & 1 else '>'
    seconds, nanoseconds = struct.unpack_from(order + 'iI', data, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def on_tick(node: Node, period: float, callback: Callable[[int], None]) -> None:
    """Call back with the node's time in ns, every ``period`` seconds or faster.

    In simulated time that is at each ``/clock`` message, with the message's own time, so that
    what a node does at a time depends on that time alone; otherwise a timer does it, which goes
    on whatever happens to the time of day.
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
