# SPDX-License-Identifier: Apache-2.0
"""Time stamps of messages in ns, and a timer that follows real or simulated time."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.clock import Clock as NodeClock
from rclpy.clock import ClockType
from rclpy.node import Node

from ros_pad.nodes import topics


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def split(time_ns: int) -> tuple[int, int]:
    """Return a time in ns as whole seconds and the nanoseconds after them.

    Seconds beyond the 32 bits of a stamp wrap round, as they do in rclpy.
    """
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return (seconds + 2**31) % 2**32 - 2**31, rest


def set_stamp(stamp: Time, time_ns: int) -> None:
    """Write a time in ns into a stamp."""
    stamp.sec, stamp.nanosec = divmod(time_ns, 1_000_000_000)


def on_tick(
    node: Node, period: float, callback: Callable[[int], None], refuse: topics.Refuse
) -> None:
    """Call a function again and again with the node's time, ns.

    In simulated time it is called at each ``/clock`` message with the time in that message, so
    that a run can be repeated exactly. Otherwise a timer calls it every ``period`` seconds; the
    timer uses the steady clock, which keeps running when the time of day is changed. A ``/clock``
    message that cannot be read goes to ``refuse``.
    """
    if node.get_parameter('use_sim_time').value:

        def tick(seconds: int, fraction: int) -> None:
            callback(seconds * 1_000_000_000 + fraction)

        topics.CLOCK.receive(node, tick, topics.CLOCK.schema.values, refuse)
    else:
        clock = node.get_clock()
        steady = NodeClock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(period, lambda: callback(clock.now().nanoseconds), clock=steady)
