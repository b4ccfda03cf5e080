# SPDX-License-Identifier: Apache-2.0
"""Nodes of ros_pad send one another batches, and each message alone to whoever else wants it."""

import struct

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rclpy.serialization import serialize_message
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Float64
from std_msgs.msg import Header
from std_msgs.msg import MultiArrayDimension
from std_msgs.msg import UInt8MultiArray

from ros_pad.errors import BadMessage
from ros_pad.nodes import topics
from ros_pad.nodes.batches import BatchReader
from ros_pad.nodes.batches import batch_head
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.messages import Hooks
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.messages import Once
from ros_pad.nodes.messages import hook
from ros_pad.nodes.messages import unhook
from ros_pad.nodes.simulator import SimulatorNode

names = st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=20)


def batch_of(content):
    """Return a batch of messages: topics and bytes."""
    head = batch_head([name for name, _ in content], [len(data) for _, data in content])
    return head + b''.join(data for _, data in content)


contents = st.lists(st.tuples(names, st.binary(max_size=40)), max_size=8)


@given(contents)
def test_rclpy_reads_a_batch_as_an_ordinary_message(content):
    batch = batch_of(content)
    message = deserialize_message(batch, UInt8MultiArray)
    assert bytes(message.data) == b''.join(data for _, data in content)
    start = 0
    for (name, data), dimension in zip(content, message.layout.dim, strict=True):
        assert (dimension.label, dimension.size) == (name, len(data))
        assert dimension.stride == start
        start += len(data)


@given(st.lists(contents, max_size=5))
def test_a_batch_is_read_as_it_was_written(batches):
    """Repeated, because layouts are remembered."""
    read = BatchReader()
    for content in batches * 2:
        assert read(batch_of(content)) == content


@given(contents)
def test_a_batch_of_rclpy_is_read(content):
    message = UInt8MultiArray()
    message.layout.dim = [MultiArrayDimension(label=n, size=len(d)) for n, d in content]
    message.data = b''.join(data for _, data in content)
    read = BatchReader()
    assert list(read(serialize_message(message))) == content
    assert list(read(serialize_message(message) + b'\0\0\0')) == content  # DDS may pad


def test_a_big_endian_batch_is_read():
    label = b'/leg_1/wetness\0'
    head = struct.pack('>II', 1, len(label)) + label + b'\0' + struct.pack('>II', 3, 0)
    batch = b'\0\0\0\0' + head + struct.pack('>II', 0, 3) + b'abc'
    assert list(BatchReader()(batch)) == [('/leg_1/wetness', b'abc')]


@settings(max_examples=500)
@given(contents, st.data())
def test_bytes_that_are_no_batch_are_refused_or_read(content, data):
    """A wrong size, a wrong count and missing bytes raise nothing but BadMessage."""
    batch = bytearray(batch_of(content))
    for _ in range(data.draw(st.integers(0, 3))):
        batch[data.draw(st.integers(0, len(batch) - 1))] = data.draw(st.integers(0, 255))
    read = BatchReader()
    for _ in range(2):
        try:
            found = read(bytes(batch[: data.draw(st.integers(0, len(batch)))]))
            assert all(isinstance(each, bytes) for _, each in found)
        except BadMessage:
            pass


def test_missing_bytes_are_refused_also_when_the_layout_is_known():
    read, batch = BatchReader(), batch_of([('/a', b'12'), ('/b', b'3456')])
    read(batch)
    with pytest.raises(BadMessage, match='too few for 2 messages'):
        read(batch[:-1])


def test_a_message_that_comes_both_ways_is_new_once():
    once = Once()
    batch = [('/a', b'1'), ('/b', b'2')]
    assert once.of_batch([*batch]) == batch
    assert [once.is_new('/a', b'1'), once.is_new('/b', b'1'), once.is_new('/b', b'2')] == [
        False, True, False,
    ]  # fmt: skip
    assert once.of_batch([*batch, ('/b', b'1')]) == batch
    # Equal ones that come the same way are different messages.
    assert [once.is_new('/c', b'3') for _ in range(3)] == [True] * 3
    assert once.of_batch([('/c', b'3')] * 4) == [('/c', b'3')]


class Pair:
    """A simulator that is stepped, and a node of ros_pad that receives the forces of leg 1."""

    def __init__(self, context, executor, until):
        self.until, self.heard = until, []
        values = {'scene': 'hexapod_patches', 'fidelity': 'L1', 'free_running': False}
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        self.simulator = SimulatorNode(context=context, parameter_overrides=overrides)
        self.receiver = Node('receiver', context=context)
        self.other = Node('other', context=context)
        for node in (self.simulator, self.receiver, self.other):
            executor.add_node(node)
        receive = Messages(self.receiver).receive
        receive(topics.WRENCH, lambda *force: self.heard.append(force), ('wrench.force.z',), 1)
        (self.wrench,) = self._publishers('/leg_1/wrench')
        (self.batches,) = self._publishers('/_batches/simulator')
        until(lambda: self.wrench.get_subscription_count() == 1)
        until(lambda: self.batches.get_subscription_count() == 1)

    def _publishers(self, name):
        return [each for each in self.simulator.publishers if each.topic_name == name]

    def step(self, samples=1):
        for _ in range(samples):
            before = len(self.heard)
            self.simulator.step()
            self.until(lambda n=before: len(self.heard) > n, what='a force')


@pytest.fixture
def pair(context, executor, until):
    return Pair(context, executor, until)


def test_among_nodes_of_ros_pad_only_batches_travel(pair, monkeypatch):
    alone = []
    monkeypatch.setattr(type(pair.wrench), 'publish', published(alone, type(pair.wrench).publish))
    pair.until(lambda: pair.step() or ('/leg_1/wrench' not in alone and not alone.clear()))
    alone.clear()
    pair.step(20)
    assert set(alone) == {'/_batches/simulator'}


def published(names_sent, publish):
    """Return a method for publishers that notes their topics."""

    def watched(publisher, message):
        names_sent.append(publisher.topic_name)
        publish(publisher, message)

    return watched


def test_another_subscriber_gets_every_message_alone(pair):
    """And the node of ros_pad does not get them twice, before, while and after it listens."""
    pair.step(20)
    seen = []
    subscription = pair.other.create_subscription(WrenchStamped, 'leg_1/wrench', seen.append, 100)
    pair.until(lambda: pair.wrench.get_subscription_count() == 2)
    before = len(pair.heard)
    pair.step(20)
    pair.until(lambda: len(seen) == 20, what='all forces')
    assert [each.wrench.force.z for each in seen] == [z for (z,) in pair.heard[before:]]
    assert len(pair.heard) == before + 20
    pair.other.destroy_subscription(subscription)
    pair.until(lambda: pair.wrench.get_subscription_count() == 1)
    pair.step(20)
    assert len(pair.heard) == before + 40
    assert len(seen) == 20


def test_a_message_of_another_publisher_is_received_beside_batches(pair):
    pair.step(3)
    stranger = pair.other.create_publisher(WrenchStamped, 'leg_1/wrench', 10)
    pair.until(lambda: stranger.get_subscription_count() == 1)
    message = WrenchStamped()
    message.wrench.force.z = 123.0
    stranger.publish(message)
    pair.until(lambda: (123.0,) in pair.heard)
    assert len(pair.heard) == 4


def test_a_second_subscription_of_a_receiver_gets_messages_too(pair):
    """Of one's own node in a program with callbacks of one's own."""
    seen = []
    pair.receiver.create_subscription(WrenchStamped, 'leg_1/wrench', seen.append, 100)
    pair.until(lambda: pair.wrench.get_subscription_count() == 2)
    pair.step(5)
    pair.until(lambda: len(seen) == 5, what='all forces')
    assert len(pair.heard) == 5


def test_a_batch_may_only_have_topics_of_its_node(context, executor, until):
    """Whoever may send estimates may not move a valve."""
    receiver, sender = (Node(name, context=context) for name in ('receiver', 'sender'))
    for node in (receiver, sender):
        executor.add_node(node)
    pressures, loads = [], []
    messages = Messages(receiver)
    messages.receive(topics.PRESSURE_SETPOINT, pressures.append, ('fluid_pressure',), 1)
    messages.receive(topics.CONTACT_LOAD, loads.append, ('data',), 1)
    batches = topics.BATCHES['estimator'].publisher(sender)
    until(lambda: batches.get_subscription_count() == 1)
    content = [
        ('/leg_1/pressure_setpoint', serialize_message(FluidPressure(fluid_pressure=2e5))),
        ('/leg_1/contact_load', serialize_message(topics.CONTACT_LOAD.message(data=7.0))),
    ]
    batches.publish(batch_of(content))
    batches.publish(b'\0\1\0\0\xff\xff\xff\xff')
    until(lambda: loads and messages.refusals.counts)
    assert (pressures, loads) == ([], [7.0])
    assert dict(messages.refusals.counts) == {'/_batches/estimator': 1}


def test_batches_wait_in_order_until_one_is_due_or_something_else_comes(context, executor, until):
    receiver, sender = (Node(name, context=context) for name in ('receiver', 'sender'))
    for node in (receiver, sender):
        executor.add_node(node)
    heard, seen = [], []
    messages = Messages(receiver)
    messages.receive(topics.CONTACT_LOAD, heard.append, ('data',), 1)
    messages.receive(topics.PRESSURE_SETPOINT, heard.append, ('fluid_pressure',), 1)

    def due(content):
        (value,) = (deserialize_message(data, Float64).data for _, data in content)
        seen.append(value)
        return value == 3.0

    messages.hold(due)
    batches = topics.BATCHES['estimator'].publisher(sender)
    setpoint = topics.PRESSURE_SETPOINT.publisher(sender, 1)
    until(lambda: batches.get_subscription_count() and setpoint.get_subscription_count())

    def send(value):
        count = len(seen)
        load = serialize_message(Float64(data=value))
        batches.publish(batch_of([('/leg_1/contact_load', load)]))
        until(lambda: len(seen) > count or value in heard, what='a batch')

    for value in (1.0, 2.0):
        send(value)
    assert heard == []
    send(3.0)
    assert heard == [1.0, 2.0, 3.0]
    send(4.0)
    setpoint.publish(FluidPressure(fluid_pressure=5.0))
    until(lambda: 5.0 in heard)
    assert heard == [1.0, 2.0, 3.0, 4.0, 5.0]
    for value in range(10, 60):
        send(float(value))
    assert heard[5:] == [float(value) for value in range(10, 60)]  # no more than these wait
    send(60.0)
    messages.on_tick(0.01, lambda now_ns: None)
    until(lambda: heard[-1] == 60.0, what='the tick')


def test_samples_that_wait_give_the_same_estimates(context):
    """In batches, of which an estimator in real time processes those of a period together."""

    def estimates(way):
        sent = []
        hook(context, Hooks(lambda name, data: sent.append((name, data)), lambda: None))
        node = EstimatorNode(context=context, parameter_overrides=[Parameter('legs', value=[1])])
        unhook(context)
        by_name = {each.topic_name: each.callback for each in node.subscriptions}
        for number in range(60):
            stamp = Time(sec=9, nanosec=4_000_000 * number)
            force = WrenchStamped(header=Header(stamp=stamp))
            force.wrench.force.x, force.wrench.force.z = 0.02 * number, 7.0 + 0.01 * (number % 3)
            place = PointStamped(header=Header(stamp=stamp))
            place.point.x = 1e-4 * (number % 5)
            air = FluidPressure(fluid_pressure=101325.0 + 1e3 * number)
            content = [('/leg_1/wrench', force), ('/leg_1/position', place)]
            content = [(name, serialize_message(each)) for name, each in content]
            pressure = ('/leg_1/pressure', serialize_message(air))
            if way != 'alone':
                by_name['/_batches/simulator'](batch_of(content))
                by_name['/_batches/regulator'](batch_of([pressure]))
            if way != 'in batches':
                for name, data in [*content, pressure]:
                    by_name[name](data)
        node.destroy_node()
        return sent

    together = estimates('in batches')
    assert len(together) > 60
    assert together == estimates('alone')
    assert together == estimates('both ways')  # while others listen to all topics


def test_topics_of_two_legs_may_be_one(context, executor, until):
    remaps = ['--ros-args', '-r', 'leg_2/pressure:=leg_1/pressure']
    receiver = Node('receiver', context=context, cli_args=remaps)
    sender = Node('sender', context=context)
    for node in (receiver, sender):
        executor.add_node(node)
    heard = {1: [], 2: []}
    messages = Messages(receiver)
    for leg in (1, 2):
        messages.receive(topics.PRESSURE, heard[leg].append, ('fluid_pressure',), leg)
    batches = topics.BATCHES['regulator'].publisher(sender)
    alone = topics.PRESSURE.publisher(sender, 1)
    until(lambda: batches.get_subscription_count() and alone.get_subscription_count())
    for value in (1.0, 2.0):
        message = serialize_message(FluidPressure(fluid_pressure=value))
        batches.publish(batch_of([('/leg_1/pressure', message)]))
        alone.publish(message)
    alone.publish(serialize_message(FluidPressure(fluid_pressure=3.0)))
    until(lambda: 3.0 in heard[2])
    assert heard == {1: [1.0, 2.0, 3.0], 2: [1.0, 2.0, 3.0]}


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        ([('/leg_1/pressure', b'')] * 1001, '1001 messages are too many: at most 1000'),
        ([('/leg_1/pressure', bytes(262_144))], 'bytes are too many: at most 262144'),
    ],
    ids=['messages', 'bytes'],
)
def test_a_batch_larger_than_any_of_a_robot_is_refused(content, reason):
    with pytest.raises(BadMessage, match=reason):
        BatchReader()(batch_of(content))


def test_a_batch_is_read_up_to_its_first_bad_message(context):
    """Thousands of refusals in one callback would keep the timer from venting."""
    node = Node('receiver', context=context)
    heard = []
    messages = Messages(node)
    messages.receive(topics.PRESSURE_SETPOINT, heard.append, ('fluid_pressure',), 1)
    (take,) = (e.callback for e in node.subscriptions if e.topic_name == '/_batches/controller')
    good = serialize_message(FluidPressure(fluid_pressure=1.0))
    take(batch_of([('/leg_1/pressure_setpoint', each) for each in (good, b'bad', good)]))
    assert heard == [1.0]
    assert messages.refusals.counts['/leg_1/pressure_setpoint'] == 1
    node.destroy_node()


def test_a_node_whose_name_is_not_known_yet_may_want_messages(pair, monkeypatch):
    """Endpoints of a new process appear on the graph before the names of its nodes."""
    pair.step(3)
    known = Node.get_subscriptions_info_by_topic

    def nameless(node, name):
        found = known(node, name)
        for each in found:
            each.node_name = '_NODE_NAME_UNKNOWN_'
        return found

    monkeypatch.setattr(Node, 'get_subscriptions_info_by_topic', nameless)
    seen = []
    pair.receiver.create_subscription(WrenchStamped, 'leg_1/wrench', seen.append, 100)
    pair.until(lambda: pair.wrench.get_subscription_count() == 2)
    pair.step(3)
    pair.until(lambda: len(seen) == 3, what='all forces')
    assert len(pair.heard) == 6
