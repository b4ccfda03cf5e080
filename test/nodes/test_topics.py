# SPDX-License-Identifier: Apache-2.0
"""If DDS does not connect two ends of a topic, a warning states where, why, and what to change."""

import pytest
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy
from rclpy.qos import LivelinessPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy

from ros_pad.nodes import qos
from ros_pad.nodes import topics
from ros_pad.nodes.regulator import RegulatorNode

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=1)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ASSERTED = QoSProfile(depth=1, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC)
PUNCTUAL = QoSProfile(depth=1, deadline=Duration(seconds=1))
SLOWER = QoSProfile(depth=1, deadline=Duration(seconds=2))
LEASED = QoSProfile(depth=1, liveliness_lease_duration=Duration(seconds=1))


@pytest.mark.parametrize(
    ('offered', 'asked', 'expected'),
    [
        (BEST_EFFORT, RELIABLE, [('reliability', 'best_effort', 'reliable')]),
        (RELIABLE, LATCHED, [('durability', 'volatile', 'transient_local')]),
        (RELIABLE, ASSERTED, [('liveliness', 'automatic', 'manual_by_topic')]),
        (RELIABLE, PUNCTUAL, [('deadline', 'infinite', '1 s')]),
        (SLOWER, PUNCTUAL, [('deadline', '2 s', '1 s')]),
        (RELIABLE, LEASED, [('liveliness_lease_duration', 'infinite', '1 s')]),
        (
            BEST_EFFORT,
            LATCHED,
            [
                ('reliability', 'best_effort', 'reliable'),
                ('durability', 'volatile', 'transient_local'),
            ],
        ),
        (RELIABLE, BEST_EFFORT, []),
        (LATCHED, RELIABLE, []),
        (ASSERTED, RELIABLE, []),
        (PUNCTUAL, SLOWER, []),
        (PUNCTUAL, RELIABLE, []),
        (LEASED, RELIABLE, []),
    ],
)
def test_a_subscription_may_ask_for_no_more_than_is_offered(offered, asked, expected):
    """Cases from the tables of requested and offered QoS in the DDS specification, 2.2.3."""
    found = qos.mismatches(offered, asked)
    assert [(each.policy, each.offered, each.asked) for each in found] == expected


@pytest.fixture
def warnings(monkeypatch):
    """Return a list that receives every warning of the nodes."""
    said = []

    class Logger:
        def warning(self, words):
            said.append(words)

    monkeypatch.setattr(Node, 'get_logger', lambda self: Logger())
    return said


@pytest.fixture
def foreign(context, executor):
    node = Node('foreign', namespace='/lab', context=context)
    executor.add_node(node)
    return node


@pytest.fixture
def ours(context, executor):
    remapped = ['--ros-args', '-r', 'leg_2/doubt:=leg_2/other']
    node = Node('ours', namespace='/robot', context=context, cli_args=remapped)
    executor.add_node(node)
    return node


@pytest.mark.parametrize(
    ('topic', 'leg', 'name', 'offered', 'words'),
    [
        (
            topics.PRESSURE_SETPOINT,
            1,
            '/robot/leg_1/pressure_setpoint',
            BEST_EFFORT,
            ('reliability best_effort', 'change the publisher to reliability reliable'),
        ),
        (
            topics.DOUBT,
            2,
            '/robot/leg_2/other',
            RELIABLE,
            ('durability volatile', 'change the publisher to durability transient_local'),
        ),
    ],
    ids=['best effort', 'volatile'],
)
def test_a_subscription_warns_of_a_publisher_that_offers_too_little(
    foreign, ours, until, warnings, topic, leg, name, offered, words
):
    passed_on = []
    topic.subscription(ours, print, leg, on_mismatch=passed_on.append)
    foreign.create_publisher(topic.message, name, offered)
    until(lambda: warnings, what='a warning')
    assert all(word in warnings[0] for word in (f'{name}: ', 'node /lab/foreign ', *words))
    assert passed_on == warnings


def test_a_publisher_warns_of_a_subscription_that_requests_too_much(
    foreign, ours, until, warnings
):
    topics.PRESSURE.publisher(ours, 1)
    name = '/robot/leg_1/pressure'
    foreign.create_subscription(topics.PRESSURE.message, name, print, LATCHED)
    until(lambda: warnings, what='a warning')
    words = (f'{name}: node /lab/foreign ', 'durability transient_local', 'durability volatile')
    assert all(word in warnings[0] for word in words)


@pytest.mark.parametrize('topic', topics.LEG_TOPICS, ids=lambda topic: topic.pattern)
def test_both_ends_of_each_topic_here_match(topic):
    assert qos.mismatches(topic.publish, topic.subscribe) == []


def test_the_regulator_has_it_on_diagnostics_until_set_points_come(
    context, executor, foreign, until
):
    regulator = RegulatorNode(context=context, parameter_overrides=[Parameter('legs', value=[1])])
    executor.add_node(regulator)
    said = []
    foreign.create_subscription(
        topics.DIAGNOSTICS.message,
        '/diagnostics',
        lambda array: said.append(array.status[0].message),
        topics.DIAGNOSTICS.subscribe,
    )
    message = topics.PRESSURE_SETPOINT.message
    name = '/leg_1/pressure_setpoint'
    foreign.create_publisher(message, name, BEST_EFFORT)
    until(lambda: any('change the publisher to reliability reliable' in words for words in said))
    assert regulator.answered == 0
    setpoint = message(fluid_pressure=101325.0)
    publisher = foreign.create_publisher(message, name, topics.PRESSURE_SETPOINT.publish)

    def accepted():
        setpoint.header.stamp = foreign.get_clock().now().to_msg()
        publisher.publish(setpoint)
        return regulator.answered

    until(accepted)
    said.clear()
    until(lambda: said and said[-1] == 'no set-points are received: vented')
    assert regulator.channels[1].accepted >= 1
    assert not any('change the publisher to' in words for words in said[-1:])
