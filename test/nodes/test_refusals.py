# SPDX-License-Identifier: Apache-2.0
"""Messages that cannot be read are counted and reported, and the node goes on."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import MS, command, encoded, estimate, sample
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ros_pad.bags import topics
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.regulator import RegulatorNode

# Node, topic and content that it answers, and the topic of the answer.
CASES = {
    'estimator': (EstimatorNode, topics.SAMPLE, sample, topics.ESTIMATE),
    'controller': (ControllerNode, topics.ESTIMATE, estimate, topics.COMMAND),
    'regulator': (
        RegulatorNode, topics.COMMAND, lambda at: command(at, 0.0), topics.PRESSURE,
    ),
}  # fmt: skip
RECORD = encoded(topics.SAMPLE, sample(1), (1, 2))
BAD = {
    'no bytes': b'',
    'other encapsulation': b'\xff\xff\0\0' + RECORD[4:],
    'cut': RECORD[:-20],
    'other legs': encoded(topics.SAMPLE, sample(1), (1, 3)),
    'joints': serialize_message(JointState(name=['knee'], position=[1.0])),
}  # fmt: skip


@pytest.mark.parametrize('name', CASES)
def test_records_that_cannot_be_read_are_counted_and_reported(bench, name):
    kind, topic, content, answer = CASES[name]
    node = bench.start(kind)
    full_name = f'/{topic.name()}'
    bench.clock(10_000 * MS)
    for count, data in enumerate(BAD.values(), 1):
        bench.give(topic, data)
        assert node.refused == {full_name: count}
    before = len(bench.heard(answer))
    for second in (11, 12):  # sound ones are still read
        bench.clock(second * 1_000 * MS)
        bench.give(topic, content(second * 1_000 * MS))
    assert len(bench.heard(answer)) >= before + 2
    _, report = bench.statuses('refused messages')[-1]
    assert report.level == DiagnosticStatus.WARN
    assert report.message.startswith(f'{full_name}: message refused: unknown names knee')
    assert [each.key for each in report.values] == [full_name]
    assert len({each.name for _, each in bench.statuses()}) > 1  # no other status is lost


def test_a_clock_that_cannot_be_read_is_refused(bench):
    """The node's own clock is rclpy's, which is not protected: the tick alone is tested here."""
    node = bench.start(EstimatorNode)
    (tick,) = [each for each in node.subscriptions if each.topic_name == '/clock' and each.raw]
    tick.callback(b'\0\1\0\0\1\0\0\0')
    assert dict(node.refused) == {'/clock': 1}
