# SPDX-License-Identifier: Apache-2.0
import pytest
from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.parameter import Parameter

from ros_pad.nodes import topics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp
from ros_pad.nodes.stamps import split


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
    assert split(time_ns + 2**32 * 10**9) == (sec, nanosec)  # a stamp has no more seconds


def test_in_simulated_time_each_clock_message_is_a_tick(context, executor, until):
    node = Node(
        'probe', context=context, parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    executor.add_node(node)
    ticks = []
    Messages(node).on_tick(0.001, ticks.append)
    clock = topics.CLOCK.publisher(node)
    until(lambda: clock.get_subscription_count() == 2)  # two subscriptions: time and ticks
    for time_ns in (7, 1_000_000_000, 3_000_000_004):
        message = topics.CLOCK.message()
        set_stamp(message.clock, time_ns)
        clock.publish(message)
        until(lambda t=time_ns: ticks and ticks[-1] == t)
    assert ticks == [7, 1_000_000_000, 3_000_000_004]


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
