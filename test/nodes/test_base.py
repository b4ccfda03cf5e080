# SPDX-License-Identifier: Apache-2.0
"""What all nodes have in common: ticks, stamps, and QoS of topics."""

import pytest
from builtin_interfaces.msg import Time
from helpers import MS, nanoseconds
from rclpy.qos import DurabilityPolicy, QoSCompatibility, ReliabilityPolicy, qos_check_compatible

from ros_pad.bags import topics
from ros_pad.nodes import qos
from ros_pad.nodes.base import PadNode, set_stamp


@pytest.mark.parametrize(
    ('time_ns', 'sec', 'nanosec'),
    [(0, 0, 0), (999_999_999, 0, 999_999_999), (-1, -1, 999_999_999)],
)
def test_stamps_are_whole_nanoseconds(time_ns, sec, nanosec):
    for late_ns in (0, 2**32 * 10**9):  # a stamp has no more seconds
        stamp = Time()
        set_stamp(stamp, time_ns + late_ns)
        assert (stamp.sec, stamp.nanosec) == (sec, nanosec)
        assert nanoseconds(stamp) == time_ns


def test_in_simulated_time_each_clock_message_is_a_tick_where_no_records_come(bench):
    """Which of a record and the clock of its moment comes first means nothing."""
    ticks, all_steps = [], []

    def probe(**kwargs):
        node = PadNode('probe', (), **kwargs)
        node.on_tick(ticks.append, 0.001)
        node.on_tick(all_steps.append, 0.001, all_steps=True)
        return node

    node = bench.start(probe)

    def clock(*times_ms):
        ticks.clear()
        for time_ms in times_ms:
            bench.clock(time_ms * MS)
        return [each // MS for each in ticks]

    assert clock(1_000, 3_000, 2_000) == [1_000, 3_000, 2_000]
    node.advance(2_020 * MS, ticks.append)
    assert ticks[-1] == 2_020 * MS
    assert clock(1_919, 1_920, 2_000, 2_020, 2_040, 2_120, 2_121, 2_200) == [1_919, 2_121, 2_200]
    assert len(all_steps) == 11


def test_in_real_time_a_timer_ticks(context, executor, until):
    node = PadNode('probe', (), context=context)
    executor.add_node(node)
    ticks = []
    node.on_tick(ticks.append, 0.01)
    before = node.get_clock().now().nanoseconds
    until(lambda: len(ticks) == 5)
    assert ticks[0] > before
    assert ticks == sorted(ticks)
    node.advance(0, ticks.append)  # records are no ticks
    assert ticks[-1] > before


@pytest.mark.parametrize(
    'topic', (*topics.RECORDED, *topics.OF_LEGS, topics.FEET_MARKERS), ids=lambda t: t.pattern
)
def test_both_ends_of_each_topic_match_and_what_must_arrive_is_reliable(topic):
    ends = qos.profiles(topic)
    assert qos_check_compatible(*ends)[0] != QoSCompatibility.ERROR
    certain = (topics.COMMAND, topics.LEG_SETPOINT, topics.DIAGNOSTICS)
    reliable = ends.subscribe.reliability == ReliabilityPolicy.RELIABLE
    assert reliable == (topic in certain or topic.text)
    assert (ends.publish.durability == DurabilityPolicy.TRANSIENT_LOCAL) == topic.text
