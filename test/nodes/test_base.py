# SPDX-License-Identifier: Apache-2.0
"""What all nodes have in common: ticks, stamps, and QoS of topics."""

import pytest
from helpers import MS
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSCompatibility,
    ReliabilityPolicy,
    qos_check_compatible,
)

from ros_pad.bags import topics
from ros_pad.nodes import qos
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import LEGS


@pytest.mark.parametrize('all_steps', [False, True])
def test_in_simulated_time_the_clock_ticks_where_no_records_come(bench, all_steps):
    """Which of a record and the clock of its moment comes first means nothing."""
    ticks = []

    def probe(**kwargs):
        node = PadNode('probe', (LEGS,), **kwargs)
        node.on_tick(ticks.append, 0.001, all_steps=all_steps)
        return node

    node = bench.start(probe)

    def clock(*times_ms):
        ticks.clear()
        for time_ms in times_ms:
            bench.clock(time_ms * MS)
        return [each // MS for each in ticks]

    times = [1_000, 1_010, 3_000, 2_000]  # once in 0.1 s, or all; also where it is set back
    assert clock(*times) == (times if all_steps else [1_000, 3_000, 2_000])
    node.advance(2_020 * MS)
    assert (ticks[-1] == 2_020 * MS) == all_steps
    node.advance(2_120 * MS)
    assert ticks[-1] == 2_120 * MS
    times = [2_019, 2_020, 2_100, 2_120, 2_140, 2_220, 2_221, 2_300]
    assert clock(*times) == (times if all_steps else [2_019, 2_221, 2_300])


def test_in_real_time_a_timer_ticks(context, executor, until):
    node = PadNode('probe', (), context=context)
    executor.add_node(node)
    ticks = []
    node.on_tick(ticks.append, 0.01, all_steps=True)
    before = node.get_clock().now().nanoseconds
    until(lambda: len(ticks) == 5)
    assert ticks[0] > before
    assert ticks == sorted(ticks)
    node.advance(0)  # records are no ticks
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
    for wanted in (False, True):  # a recorder may ask for repetition
        profile = qos.recording(topic, wanted)
        assert profile.history == HistoryPolicy.KEEP_ALL
        assert (profile.reliability == ReliabilityPolicy.RELIABLE) == (reliable or wanted)
