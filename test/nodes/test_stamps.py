# SPDX-License-Identifier: Apache-2.0
import pytest
from builtin_interfaces.msg import Time
from helpers import MS
from rclpy.node import Node

from ros_pad.nodes.messages import Messages
from ros_pad.nodes.stamps import nanoseconds, set_stamp, split


@pytest.mark.parametrize(
    ('time_ns', 'sec', 'nanosec'),
    [
        (0, 0, 0),
        (4_000_000, 0, 4_000_000),
        (999_999_999, 0, 999_999_999),
        (1_000_000_000, 1, 0),
        (1_795_236_777_513_191_887, 1_795_236_777, 513_191_887),
        (-1, -1, 999_999_999),
    ],
)
def test_stamps_are_whole_nanoseconds(time_ns, sec, nanosec):
    stamp = Time()
    set_stamp(stamp, time_ns)
    assert (stamp.sec, stamp.nanosec) == (sec, nanosec)
    assert nanoseconds(stamp) == time_ns
    assert split(time_ns) == (sec, nanosec)
    late_ns = time_ns + 2**32 * 10**9  # a stamp has no more seconds
    assert split(late_ns) == (sec, nanosec)
    set_stamp(stamp, late_ns)
    assert nanoseconds(stamp) == time_ns


def test_in_simulated_time_each_clock_message_is_a_tick_where_no_records_come(bench):
    """Which of a record and the clock of its moment comes first means nothing."""
    ticks, every = [], []

    def probe(**kwargs):
        node = Node('probe', **kwargs)
        node.declare_parameter('legs', [1])
        node.messages = Messages(node)
        node.messages.on_tick(0.001, ticks.append)
        node.messages.on_tick(0.001, every.append, every=True)
        return node

    messages = bench.start(probe).messages

    def clock(*times_ms):
        ticks.clear()
        for time_ms in times_ms:
            bench.clock(time_ms * MS)
        return [each // MS for each in ticks]

    assert clock(1_000, 3_000, 2_000) == [1_000, 3_000, 2_000]
    messages.advance(2_020 * MS)
    assert clock(1_919, 1_920, 2_000, 2_020, 2_040, 2_120, 2_121, 2_200) == [1_919, 2_121, 2_200]
    assert len(every) == 11


def test_in_real_time_a_timer_ticks(context, executor, until):
    node = Node('probe', context=context)
    executor.add_node(node)
    ticks = []
    Messages(node).on_tick(0.01, ticks.append)
    before = node.get_clock().now().nanoseconds
    until(lambda: len(ticks) == 5)
    assert ticks[0] > before
    assert ticks == sorted(ticks)
    (timer,) = node.timers
    assert timer.timer_period_ns == 10_000_000
