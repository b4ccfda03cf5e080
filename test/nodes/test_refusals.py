# SPDX-License-Identifier: Apache-2.0
"""Messages that cannot be read are counted and reported, and the node goes on."""

import struct

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import MS, command, encoded, estimate, fluid, position, pressure, sample, wrench
from rclpy.node import Node
from rclpy.serialization import serialize_message

from ros_pad.bags import topics as schemas
from ros_pad.errors import BadMessage
from ros_pad.nodes import topics
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.merge import MergeNode
from ros_pad.nodes.refusals import Refusals
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.views import ViewsNode

WRENCH, POSITION, PRESSURE = map(
    topics.of_leg, (schemas.LEG_WRENCH, schemas.LEG_POSITION, schemas.LEG_PRESSURE)
)
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
    'joints': serialize_message(topics.JOINT_STATES.message(name=['knee'], position=[1.0])),
}  # fmt: skip


@pytest.mark.parametrize('name', CASES)
def test_records_that_cannot_be_read_are_counted_and_reported(bench, name):
    kind, topic, content, answer = CASES[name]
    node = bench.start(kind)
    full_name = f'/{topic.name()}'
    bench.clock(10_000 * MS)
    for count, data in enumerate(BAD.values(), 1):
        bench.give(topic, data)
        assert (
            node.messages.refusals.counts == {full_name: count} or data is BAD['too many values']
        )
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


# Encapsulations of DDS-XTypes 1.3, 7.6.3.1.2, that rclpy decodes and the reader of fields does
# not know: byte order, identifier, and the largest alignment of numbers.
ENCAPSULATIONS = {
    'PL_CDR_BE': ('>', 2, 8), 'PL_CDR_LE': ('<', 3, 8), 'CDR2_BE': ('>', 6, 4),
    'CDR2_LE': ('<', 7, 4),
}  # fmt: skip


def encapsulated(name, frame, *values):
    """Return bytes of a header with stamp 5.000000006 s and of the numbers after it."""
    order, identifier, alignment = ENCAPSULATIONS[name]
    text = frame.encode() + b'\0'
    header = struct.pack(f'{order}iiI{len(text)}s', 5, 6, len(text), text)
    header += bytes(-len(header) % alignment)
    return bytes([0, identifier, 0, 0]) + header + struct.pack(f'{order}{len(values)}d', *values)


@pytest.fixture
def merge(bench, monkeypatch):
    monkeypatch.setattr(MergeNode, 'count_publishers', lambda node, name: 0)
    return bench.start(MergeNode)


def joins(bench):
    """Give the rest of a record that begins at 5.000000006 s; return its wrench of leg 1."""
    stamp_ns = 5_000 * MS + 6
    bench.give(POSITION, position(stamp_ns), 1)
    for topic, message in ((WRENCH, wrench(stamp_ns)), (POSITION, position(stamp_ns))):
        bench.give(topic, message, 2)
    (block,) = bench.heard(topics.SAMPLE)
    assert block.last_ns == stamp_ns
    return [*block.rows['force'][0, 0], block.rows['moment'][0, 0]]


@pytest.mark.parametrize('name', ENCAPSULATIONS)
def test_other_encapsulations_that_rclpy_knows_are_read(bench, merge, name):
    """In CDR2 the doubles are at multiples of 4 bytes only; the length of the frame shows it."""
    bench.give(WRENCH, encapsulated(name, 'foot', 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 1)
    assert joins(bench) == [1.0, 2.0, 3.0, 6.0]
    assert not merge.messages.refusals.counts


WHOLE = serialize_message(wrench(1, frame='leg_1_sole'))


@pytest.mark.parametrize(
    ('data', 'reason'),
    [
        (b'\0\5\0\0' + WHOLE[4:], 'failed to deserialize'),
        (b'\1\1\0\0' + WHOLE[4:], 'failed to deserialize'),
        (encapsulated('CDR2_LE', 'foot', 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)[:-4], ''),
        (WHOLE[:-1], f'{len(WHOLE) - 1} bytes are too few'),
        (WHOLE[:12] + struct.pack('<I', 4000) + WHOLE[16:], 'too few for a text of 4000 bytes'),
    ],
    ids=['CDR2_BE', 'big endian', 'CDR2 cut', 'cut', 'long frame'],
)
def test_messages_of_drivers_that_cannot_be_read_are_refused(bench, merge, data, reason):
    bench.give(WRENCH, data, 1)
    assert merge.messages.refusals.counts == {'/leg_1/wrench': 1}
    bench.clock(1_000 * MS)
    assert reason in bench.statuses('refused messages')[-1][1].message
    bench.give(WRENCH, wrench(5_000 * MS + 6, (1.0, 2.0, 3.0)), 1)
    assert joins(bench) == [1.0, 2.0, 3.0, 0.0]


def test_topics_of_two_legs_may_be_one(bench, monkeypatch):
    """By remapping, as for one sensor of air below two pads."""
    monkeypatch.setattr(MergeNode, 'count_publishers', lambda node, name: 0)
    remaps = ['--ros-args', '-r', 'leg_2/pressure:=leg_1/pressure']

    def kind(**kwargs):
        return MergeNode(cli_args=remaps, **kwargs)

    bench.start(kind)
    bench.give(PRESSURE, fluid(1, 60e3), 1)
    pressures = [block.rows['pressure'][0] for block in bench.heard(topics.PRESSURE)]
    assert sorted(each[~(each != each)].tolist() for each in pressures) == [[60e3], [60e3]]


def test_views_and_simulators_have_no_records_of_other_legs(bench):
    node = bench.start(ViewsNode)
    bench.legs = (1, 2, 3)
    bench.give(
        topics.PRESSURE, pressure(1, 0.0)._replace(rows=pressure(1, 0.0).rows[:, [0, 0, 1]])
    )
    assert node.messages.refusals.counts == {'/feet/pressure': 1}


def test_a_clock_that_cannot_be_read_is_refused(bench):
    """The node's own clock is rclpy's, which is not protected: the tick alone is tested here."""
    node = bench.start(EstimatorNode)
    (tick,) = [each for each in node.subscriptions if each.topic_name == '/clock' and each.raw]
    tick.callback(b'\0\1\0\0\1\0\0\0')
    assert dict(node.messages.refusals.counts) == {'/clock': 1}


def test_refusals_of_several_topics_are_one_status(context):
    node = Node('probe', context=context)
    refusals = Refusals(node)
    assert refusals.statuses() == []
    for topic in ('/a', '/b', '/a'):
        refusals(topic, BadMessage(f'reason of {topic}'))
    (status,) = refusals.statuses()
    assert status.name == 'probe: refused messages'
    assert status.message == '/a: message refused: reason of /a'
    assert {each.key: each.value for each in status.values} == {'/a': '2', '/b': '1'}
    node.destroy_node()
