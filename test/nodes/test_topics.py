# SPDX-License-Identifier: Apache-2.0
"""If DDS does not connect two ends of a topic, a warning states where, why, and what to change."""

import pytest
from helpers import command, encoded, overrides
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from ros_pad.bags import topics as schemas
from ros_pad.nodes import qos, topics
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
    remapped = ['--ros-args', '-r', 'body/doubt:=body/other']
    node = Node('ours', namespace='/robot', context=context, cli_args=remapped)
    executor.add_node(node)
    return node


@pytest.mark.parametrize(
    ('topic', 'name', 'offered', 'words'),
    [
        (
            topics.COMMAND,
            '/robot/feet/command',
            BEST_EFFORT,
            ('reliability best_effort', 'change the publisher to reliability reliable'),
        ),
        (
            topics.BODY_DOUBT,
            '/robot/body/other',
            RELIABLE,
            ('durability volatile', 'change the publisher to durability transient_local'),
        ),
    ],
    ids=['best effort', 'volatile'],
)
def test_a_subscription_warns_of_a_publisher_that_offers_too_little(
    foreign, ours, until, warnings, topic, name, offered, words
):
    passed_on = []
    topic.subscription(ours, print, on_mismatch=passed_on.append)
    foreign.create_publisher(topic.message, name, offered)
    until(lambda: warnings, what='a warning')
    assert all(word in warnings[0] for word in (f'{name}: ', 'node /lab/foreign ', *words))
    assert passed_on == warnings


def test_a_publisher_warns_of_a_subscription_that_requests_too_much(
    foreign, ours, until, warnings
):
    topics.PRESSURE.publisher(ours)
    name = '/robot/feet/pressure'
    foreign.create_subscription(topics.PRESSURE.message, name, print, LATCHED)
    until(lambda: warnings, what='a warning')
    words = (f'{name}: node /lab/foreign ', 'durability transient_local', 'durability volatile')
    assert all(word in warnings[0] for word in words)


OF_LEGS = [topics.of_leg(schema) for schema in schemas.OF_LEGS]


@pytest.mark.parametrize(
    'topic',
    (*topics.COMMON_TOPICS, *OF_LEGS, topics.FEET_MARKERS),
    ids=lambda topic: topic.pattern,
)
def test_both_ends_of_each_topic_here_match(topic):
    assert qos.mismatches(topic.publish, topic.subscribe) == []


def test_records_of_a_best_effort_publisher_arrive(foreign, ours, until):
    """As from a driver of others; commands alone must be reliable."""
    for topic in (topics.SAMPLE, topics.FORCE, topics.ESTIMATE, topics.PRESSURE):
        assert qos.mismatches(BEST_EFFORT, topic.subscribe) == []
    assert qos.mismatches(BEST_EFFORT, topics.COMMAND.subscribe)


def test_the_regulator_has_it_on_diagnostics_until_commands_come(
    context, executor, foreign, until
):
    regulator = RegulatorNode(context=context, parameter_overrides=overrides({'legs': [1, 2]}))
    executor.add_node(regulator)
    said = []
    topics.DIAGNOSTICS.subscription(foreign, lambda array: said.append(array.status[0].message))
    topic, name = topics.COMMAND, '/feet/command'
    foreign.create_publisher(topic.message, name, BEST_EFFORT)
    until(lambda: any('change the publisher to reliability reliable' in words for words in said))
    answers = regulator.channels[1].answers
    assert answers.accepted == 0
    publisher = foreign.create_publisher(topic.message, name, topic.publish)

    def accepted():
        block = command(foreign.get_clock().now().nanoseconds, 0.0)
        publisher.publish(encoded(topic, block, (1, 2)))
        return answers.accepted

    until(accepted)
    said.clear()
    until(lambda: said and said[-1] == 'no set-points are received: vented')
    assert not any('change the publisher to' in words for words in said[-1:])
