# SPDX-License-Identifier: Apache-2.0
"""Messages that cannot be read are counted and reported, and the node goes on."""

import contextlib
import struct

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import WrenchStamped
from rclpy._rclpy_pybind11 import RCLError  # rclpy has no public name for it
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Float64

from ros_pad.errors import BadMessage
from ros_pad.nodes import topics
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.refusals import Refusals
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.simulator import SimulatorNode
from ros_pad.nodes.stamps import set_stamp

AMBIENT = 101325.0
LEGS = {'legs': [1, 2]}
WALK = {'scene': 'leg_wet_dome_40', 'fidelity': 'L0', 'rate': 50.0}


def wrench(frame='leg_1_sole', load=7.0, time_ns=10**9):
    message = WrenchStamped()
    message.header.frame_id = frame
    message.wrench.force.z = load
    set_stamp(message.header.stamp, time_ns)
    return serialize_message(message)


def pressure(gauge, time_ns):
    message = FluidPressure(fluid_pressure=AMBIENT + gauge)
    set_stamp(message.header.stamp, time_ns)
    return serialize_message(message)


def too_long_frame(data):
    """Return a message whose frame claims to have more bytes than there are."""
    return data[:12] + struct.pack('<I', 4000) + data[16:]


class Sender:
    """Makes a node, publishes bytes on a topic of leg 1, and records /diagnostics."""

    def __init__(self, context, executor, until):
        self._context, self._executor, self.until = context, executor, until
        self.node = Node('sender', context=context)
        executor.add_node(self.node)
        self.statuses = []
        topics.DIAGNOSTICS.subscription(self.node, lambda a: self.statuses.extend(a.status))
        self._publisher = None

    def start(self, kind, parameters, topic):
        node = kind(
            context=self._context,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        self._executor.add_node(node)
        self._publisher = topic.publisher(self.node, 1)
        self.until(self._publisher.get_subscription_count)
        self.until(lambda: self.node.count_publishers('/diagnostics'))
        return node

    def send(self, data):
        # The middleware may also raise the error of a subscription in the same process.
        with contextlib.suppress(RCLError):
            self._publisher.publish(data)

    def reported(self, node):
        """Return the last report of refused messages, once there is one."""
        name = f'{node.get_name()}: refused messages'
        self.until(lambda: any(each.name == name for each in self.statuses), what=name)
        return [each for each in self.statuses if each.name == name][-1]


@pytest.fixture
def sender(context, executor, until):
    return Sender(context, executor, until)


def now_ns(node):
    return node.get_clock().now().nanoseconds


CASES = {
    'estimator': (EstimatorNode, LEGS, topics.WRENCH, wrench(), True),
    'controller': (ControllerNode, LEGS, topics.WETNESS, serialize_message(Float64()), False),
    'regulator': (RegulatorNode, LEGS, topics.PRESSURE_SETPOINT, pressure(10e3, 1), True),
    'simulator': (SimulatorNode, WALK, topics.PRESSURE, pressure(10e3, 1), True),
}


@pytest.mark.parametrize('name', CASES)
def test_messages_that_cannot_be_read_are_counted_and_reported(sender, name):
    kind, parameters, topic, good, stamped = CASES[name]
    node = sender.start(kind, parameters, topic)
    full_name = f'/{topic.name(1)}'
    sender.send(good[:-1])
    sender.until(lambda: node.messages.refusals.counts[full_name] == 1, what='the first refusal')
    report = sender.reported(node)
    assert report.level == DiagnosticStatus.WARN
    assert report.message == (f'{full_name}: message refused: {len(good) - 1} bytes are too few')
    assert [(each.key, each.value) for each in report.values] == [(full_name, '1')]
    if stamped:
        sender.send(too_long_frame(good))
        sender.until(
            lambda: node.messages.refusals.counts[full_name] == 2, what='the second refusal'
        )
        sender.statuses.clear()
        report = sender.reported(node)
        assert report.message.endswith(f'{len(good)} bytes are too few for a text of 4000 bytes')
        assert report.values[0].value == '2'
    # No other status is lost, and sound messages are still read.
    sender.statuses.clear()
    own = len(node.get_name()) + 2
    sender.until(lambda: sender.statuses)
    assert {each.name[own:].rpartition(' ')[2] for each in sender.statuses} > {'messages'}
    RESUMED[name](sender, node)
    assert dict(node.messages.refusals.counts) == {full_name: 2 if stamped else 1}


def estimator_goes_on(sender, node):
    before = node.samples
    place = topics.POSITION.publisher(sender.node, 1)
    sender.until(lambda: place.get_subscription_count())
    point = PointStamped()
    set_stamp(point.header.stamp, 10**9)
    place.publish(point)
    sender.send(wrench())
    sender.until(lambda: node.samples == before + 1, what='a sample')


def controller_goes_on(sender, node):
    setpoints = []
    topics.PRESSURE_SETPOINT.subscription(sender.node, setpoints.append, 1)
    load, place = (
        topic.publisher(sender.node, 1) for topic in (topics.CONTACT_LOAD, topics.CONTACT_POSITION)
    )
    sender.until(lambda: load.get_subscription_count() and place.get_subscription_count())
    sender.until(lambda: sender.node.count_publishers('leg_1/pressure_setpoint'))

    def answered():
        place.publish(PointStamped())
        load.publish(Float64(data=7.0))
        sender.send(serialize_message(Float64(data=0.5)))
        return setpoints

    sender.until(answered, what='a set-point')


def regulator_goes_on(sender, node):
    channel = node.channels[1]
    sender.send(pressure(20e3, now_ns(node)))
    sender.until(lambda: channel.accepted, what='an accepted set-point')
    assert channel.refused == 0  # bytes that are no set-point are not counted as one


def simulator_goes_on(sender, node):
    sender.send(pressure(20e3, 7))
    sender.until(lambda: node.pressure_stamps == [7], what='a pressure')
    assert node.pressures == [20e3]


RESUMED = {
    'estimator': estimator_goes_on,
    'controller': controller_goes_on,
    'regulator': regulator_goes_on,
    'simulator': simulator_goes_on,
}


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


@pytest.mark.parametrize('name', ENCAPSULATIONS)
def test_other_encapsulations_that_rclpy_knows_are_read(sender, name, monkeypatch):
    """In CDR2 the doubles are at multiples of 4 bytes only; the length of the frame shows it."""
    node = sender.start(EstimatorNode, LEGS, topics.WRENCH)
    taken = []
    monkeypatch.setattr(node.legs[1].stage, 'wrench', lambda *values: taken.append(values))
    sender.send(encapsulated(name, 'foot', 1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    sender.until(lambda: taken, what='a wrench')
    assert taken == [(5_000_000_006, (1.0, 2.0, 3.0), 6.0)]
    assert not node.messages.refusals.counts


@pytest.mark.parametrize('start', [b'\0\5\0\0', b'\1\1\0\0', b'\xff\xff\0\0'])
def test_encapsulations_that_rclpy_does_not_know_are_refused(sender, start):
    node = sender.start(EstimatorNode, LEGS, topics.WRENCH)
    sender.send(start + wrench()[4:])
    sender.until(lambda: node.messages.refusals.counts['/leg_1/wrench'] == 1, what='a refusal')
    assert 'refused: failed to deserialize' in sender.reported(node).message
    estimator_goes_on(sender, node)


def test_a_cut_message_of_another_encapsulation_is_refused(sender):
    node = sender.start(EstimatorNode, LEGS, topics.WRENCH)
    whole = encapsulated('CDR2_LE', 'foot', 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    sender.send(whole[:-4])
    sender.until(lambda: node.messages.refusals.counts, what='a refusal')
    assert dict(node.messages.refusals.counts) == {'/leg_1/wrench': 1}
    estimator_goes_on(sender, node)


def test_a_clock_that_cannot_be_read_is_refused(context):
    """The node's own clock is rclpy's, which is not protected: the tick alone is tested here."""
    node = EstimatorNode(
        context=context, parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    try:
        (tick,) = [each for each in node.subscriptions if each.topic_name == '/clock' and each.raw]
        tick.callback(b'\0\1\0\0\1\0\0\0')
        assert dict(node.messages.refusals.counts) == {'/clock': 1}
    finally:
        node.destroy_node()


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
