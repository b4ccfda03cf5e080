# SPDX-License-Identifier: Apache-2.0
"""For any messages the nodes go on, and no set-point is above the ceiling."""

import contextlib
import math
import struct
import types

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistWithCovarianceStamped
from helpers import (
    MS,
    SECOND,
    command,
    encoded,
    estimate,
    overrides,
    position,
    pressure,
    sample,
    wrench,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy._rclpy_pybind11 import RCLError
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import FluidPressure, JointState
from shared import Device
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from ros_pad.bags import topics
from ros_pad.errors import TransportError
from ros_pad.nodes import qos, regulator
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.merge import MergeNode
from ros_pad.nodes.qos import message_class
from ros_pad.nodes.regulator import RegulatorNode
from ros_pad.nodes.views import ViewsNode
from ros_pad.records import Block
from ros_pad.regulators import BACKENDS

CEILING = 80e3
LEGS = (1, 2)
TICK_NS = 10 * MS
START_NS = 1_000 * SECOND
LAST_NS = 2**31 * SECOND - 1  # the last stamp of ROS, in 2038
NAN = math.nan

numbers = st.one_of(
    st.floats(),
    st.floats(width=32),
    st.sampled_from([
        NAN, math.inf, -math.inf, 0.0, -0.0, 5e-324, -1.0, 1.7976931348623157e308, -1e308, 1e300,
    ]),
)  # fmt: skip
frames = st.one_of(
    st.sampled_from(['', 'leg_1_pad', 'leg_2_pad', 'leg_1_sole', 'a/leg_2_pad', 'world']),
    st.text(st.characters(exclude_categories=['Cs'], exclude_characters='\0'), max_size=20),
)
# Seconds and nanoseconds of a ROS stamp are int32 and uint32.
anywhen = st.integers(-(2**31) * SECOND, 2**31 * SECOND + 3 * SECOND)
soon = st.integers(0, 400).map(lambda number: START_NS + number * TICK_NS)
stamps = st.one_of(anywhen, soon)


def records_of(topic, usual):
    """Return records of two legs: any, usual ones, and blocks of several."""
    kind = topic.record
    width = len(kind.columns)

    def made(stamp_ns, values, steps):
        rows = np.array([values] * len(steps)).view(kind.dtype).reshape(len(steps), 2)
        return topic, Block(stamp_ns + np.cumsum([0, *steps[1:]]), rows)

    values = st.lists(numbers, min_size=2 * width, max_size=2 * width)
    steps = st.lists(st.integers(1, 10**9), min_size=1, max_size=3)
    return st.one_of(
        st.builds(made, stamps, values, steps),
        usual.map(lambda block: (topic, block)),
    )


def broken(*of_topics):
    """Return bytes for these topics: any, and the first ones of a record."""
    whole = serialize_message(JointState(name=['leg_1/load'], position=[1.0]))
    pieces = st.integers(0, len(whole)).map(lambda size: whole[:size])
    return st.tuples(st.sampled_from(of_topics), st.one_of(st.binary(max_size=120), pieces))


@pytest.fixture(autouse=True)
def quiet():
    """Do not log thousands of refusals."""
    names = ('regulator', 'estimator', 'controller', 'simulator', 'merge', 'views')
    for name in names:
        set_logger_level(name, LoggingSeverity.FATAL)
    yield
    for name in names:
        set_logger_level(name, LoggingSeverity.UNSET)


@pytest.fixture
def ticks(monkeypatch):
    """Replace timers of ticks; return their callbacks."""
    callbacks = []
    monkeypatch.setattr(
        RegulatorNode, 'on_tick', lambda self, call, *_, **__: callbacks.append(call)
    )
    return callbacks


class Rig:
    """A regulator node in simulated time, with checks of its set-points."""

    def __init__(self, bench, node):
        self.bench, self.node = bench, node
        self.time_ns = START_NS
        self.accepted_ns = dict.fromkeys(LEGS, -math.inf)

    def begin(self):
        """Start an example: an active node with devices that answer."""
        with contextlib.suppress(Exception):  # the node may already be inactive
            self.node.trigger_deactivate()
        self.node.trigger_cleanup()
        Device.made = ()
        for name, value in (('command_timeout', 0.5), ('on_fault', 'report')):
            assert self.bench.set(name, value).successful
        self.node.trigger_configure()
        self.node.trigger_activate()
        assert self.node.active
        assert len(Device.made) == len(LEGS)
        self.accepted_ns = dict.fromkeys(LEGS, -math.inf)
        self.time_ns = START_NS
        self.tick(0)

    @property
    def timeout_ns(self):
        return round(self.node.get_parameter('command_timeout').value * 1e9)

    def device(self, leg):
        channels = {each.leg: each for each in self.node.supervision.channels}
        return channels[leg].regulator if channels else None

    def tick(self, step_ns):
        """Advance the clock; where records come, it matters 0.1 s after the last one."""
        self.time_ns = min(max(self.time_ns + step_ns, 1), LAST_NS)
        self.bench.clock(self.time_ns)
        for leg in LEGS:
            device = self.device(leg)
            if device is None or device.broken:
                continue
            if abs(self.time_ns - self.accepted_ns[leg]) > self.timeout_ns + 100 * MS:
                assert device.setpoint == 0.0
        self.check()

    def send(self, setpoints, stamp_ns):
        before = [each.answers.accepted for each in self.node.supervision.channels]
        self.bench.give(topics.COMMAND, command(stamp_ns, setpoints))
        for channel, count in zip(self.node.supervision.channels, before, strict=True):
            if channel.answers.accepted > count:
                leg = channel.leg
                self.accepted_ns[leg] = max(self.time_ns, stamp_ns)
                assert not math.isnan(setpoints[leg - 1])
        self.check()

    def send_now(self, *setpoints):
        self.send(setpoints, self.time_ns)

    def bytes(self, data):
        self.bench.give(topics.COMMAND, data)
        self.check()

    def transit(self, name):
        with contextlib.suppress(Exception):  # rclpy refuses impossible transitions
            getattr(self.node, f'trigger_{name}')()
        self.check()

    def vent(self):
        answer = self.bench.call('/vent', Trigger.Request())
        devices = [each for each in map(self.device, LEGS) if each]
        assert answer.success == (bool(devices) and not any(each.broken for each in devices))
        self.check()

    def set(self, name, value):
        self.bench.set(name, value)

    def cable(self, leg, broken):
        if device := self.device(leg):
            device.broken = TransportError('cable') if broken else None

    def gauge(self, leg, value):
        """Let a device read a pressure, and read it."""
        if device := self.device(leg):
            device.reads = value
            channel = self.node.supervision.channels[leg - 1]
            pressure = channel.read(self.time_ns)
            assert pressure is None or math.isfinite(pressure)
            if pressure is not None and pressure > 1.02 * CEILING:
                assert channel.held and device.setpoint == 0.0

    def check(self):
        for device in Device.made:
            assert all(math.isfinite(each) and 0.0 <= each <= CEILING for each in device.received)


def action(name, *arguments):
    return st.tuples(st.just(name), *arguments)


legs = st.sampled_from(LEGS)
usual = st.one_of(st.floats(0.0, CEILING), st.just(NAN))
ACTIONS = st.one_of(
    action('send_now', usual, usual),
    action('send_now', st.floats(0.9 * CEILING, 1.2 * CEILING), usual),
    action('send_now', numbers, numbers),
    action('send', st.tuples(numbers, usual), stamps),
    action('bytes', st.binary(max_size=60)),
    action('tick', st.integers(0, 10**9)),
    action('tick', st.one_of(st.integers(-(10**9), 0), st.integers(-(2**62), 2**61))),
    action('vent'),
    action('transit', st.sampled_from(['configure', 'activate', 'deactivate', 'cleanup'])),
    action('set', st.sampled_from(['command_timeout', 'ceiling']), numbers),
    action('set', st.just('on_fault'), st.sampled_from(['report', 'vent', 'x'])),
    action('cable', legs, st.booleans()),
    action('gauge', legs, st.one_of(st.none(), numbers, st.floats(0.0, 1.1 * CEILING))),
)


@pytest.fixture
def rig(bench, monkeypatch):
    monkeypatch.setitem(BACKENDS, 'simulated', Device)
    monkeypatch.setattr(Device, 'made', ())
    return Rig(bench, bench.start(RegulatorNode, ceiling=CEILING))


def test_no_sequence_of_messages_passes_the_ceiling_or_stops_the_timeout(rig):
    @settings(max_examples=100, deadline=None)
    @given(st.lists(ACTIONS, max_size=25))
    def behave(actions):
        rig.begin()
        for name, *arguments in actions:
            getattr(rig, name)(*arguments)
        for leg in LEGS:
            rig.cable(leg, broken=False)
            rig.gauge(leg, None)
        # Time goes on, whatever stamps came.
        rig.time_ns = min(rig.time_ns, LAST_NS - rig.timeout_ns - SECOND)
        rig.tick(rig.timeout_ns + 200 * MS)
        rig.tick(200 * MS)
        assert all(
            device.setpoint == 0.0 for device in Device.made if rig.node.supervision.channels
        )
        for name in ('deactivate', 'configure', 'activate'):
            rig.transit(name)
        if rig.time_ns < LAST_NS - SECOND:
            rig.tick(200 * MS)
            rig.send_now(30e3, NAN)
            assert rig.node.supervision.channels[0].answers.accepted
        rig.bench.sent.clear()

    behave()


def test_the_time_of_day_does_not_make_a_command_last(bench, monkeypatch, ticks):
    """The time of day goes back at each tick; the timeout of commands uses another clock."""
    monkeypatch.setattr(Device, 'made', ())
    monkeypatch.setitem(BACKENDS, 'simulated', Device)
    node = bench.start(RegulatorNode, use_sim_time=False)
    (tick,) = ticks
    steady_ns = 10**12
    monkeypatch.setattr(regulator, 'time', types.SimpleNamespace(monotonic_ns=lambda: steady_ns))
    now_ns = node.get_clock().now().nanoseconds
    tick(now_ns)
    bench.give(topics.COMMAND, command(node.get_clock().now().nanoseconds, (50e3, NAN)))
    device = Device.made[0]
    for step in range(1, 51):
        assert device.setpoint == 50e3
        steady_ns += TICK_NS
        tick(now_ns - step * TICK_NS)
    steady_ns += TICK_NS
    tick(now_ns - 51 * TICK_NS)
    assert device.setpoint == 0.0


def test_a_flood_of_commands_for_one_leg_does_not_delay_the_timeout_of_another(rig):
    """There may be no tick between them."""
    rig.begin()
    rig.send_now(NAN, 50e3)
    for number in range(1, 52):
        assert Device.made[1].setpoint == 50e3
        rig.bench.clock(START_NS + number * TICK_NS)  # no tick, where records come
        rig.send((30e3, NAN), START_NS + number * TICK_NS)
    assert [each.setpoint for each in Device.made] == [30e3, 0.0]


def survives(node, bench, actions, check, examples=200):
    """Hand any records to a node, and check what it publishes."""

    @settings(max_examples=examples, deadline=None)
    @given(st.lists(actions, max_size=20))
    def behave(given_actions):
        for topic, content in given_actions:
            bench.give(topic, content)
        for array in bench.heard(topics.DIAGNOSTICS):
            assert isinstance(array, DiagnosticArray)
        check(node)
        bench.sent.clear()

    behave()


usual_samples = st.builds(
    lambda stamp, load, way: sample(stamp, (0.1, 0.0, load), (way, 0.0, 0.0)),
    soon, st.floats(-1.0, 20.0), st.floats(0.0, 1.0),
)  # fmt: skip
usual_pressures = st.builds(pressure, soon, st.floats(-1e3, 90e3))
usual_estimates = st.builds(estimate, soon, st.floats(-1.0, 20.0), st.floats(0.0, 1.0))
pressures = records_of(topics.PRESSURE, usual_pressures)


@pytest.mark.parametrize('simulated', [False, True])
def test_the_estimator_survives_and_estimates_what_is_possible(bench, simulated):
    node = bench.start(
        EstimatorNode, publish_rate=1000.0, moment_noise=0.01, use_sim_time=simulated
    )

    def check(node):
        for block in bench.heard(topics.ESTIMATE):
            wetness, friction = block.rows['wetness'], block.rows['friction']
            assert ((wetness >= 0.0) & (wetness <= 1.0)).all()
            assert (np.isfinite(friction) & (friction >= 0.0)).all()
        # A valid sample is used afterwards; at least one of these is later than the last stamp.
        taken = np.array(node.stage.used)
        for second in (100, 200_000):
            bench.give(topics.SAMPLE, sample(second * SECOND))
        assert (node.stage.used > taken).all()

    survives(
        node,
        bench,
        st.one_of(
            records_of(topics.SAMPLE, usual_samples), pressures,
            broken(topics.SAMPLE, topics.PRESSURE),
        ),
        check,
        100,
    )  # fmt: skip


def test_the_last_stamp_that_a_message_can_have_ends_no_node(bench):
    """Its nanoseconds add four seconds to the largest number of seconds."""
    last_ns = (2**31 - 1) * SECOND + 2**32 - 1
    bench.start(EstimatorNode, publish_rate=1000.0)
    bench.start(ControllerNode)
    bench.start(RegulatorNode)
    bench.start(ViewsNode)
    bench.give(topics.SAMPLE, sample(last_ns))
    (block,) = bench.heard(topics.ESTIMATE)
    # The same as rclpy makes of such a number.
    assert block.last_ns == (-(2**31) + 3) * SECOND + 294_967_295
    bench.give(topics.ESTIMATE, estimate(last_ns))
    bench.give(topics.COMMAND, command(last_ns, 0.0))
    bench.give(topics.PRESSURE, pressure(last_ns, 0.0))


@pytest.mark.parametrize('policy', ['adaptive', 'dome'])
def test_the_controller_survives_and_commands_no_more_than_the_ceiling(bench, policy):
    node = bench.start(ControllerNode, policy=policy)

    def check(node):
        for block in bench.heard(topics.COMMAND):
            setpoint, dome = block.rows['setpoint'], block.rows['dome']
            assert (np.isnan(setpoint) | ((setpoint >= 0.0) & (setpoint <= 90e3))).all()
            assert ((dome == 0.0) | (dome == 1.0)).all()
        # Valid input is answered afterwards.
        for second in (2_000, 2_001, 2_002):
            bench.give(topics.ESTIMATE, estimate(second * SECOND))
        assert np.isfinite(bench.last(topics.COMMAND)['setpoint']).all()

    survives(
        node,
        bench,
        st.one_of(
            records_of(topics.ESTIMATE, usual_estimates), pressures,
            broken(topics.ESTIMATE, topics.PRESSURE),
        ),
        check,
    )  # fmt: skip


DRIVERS = {each.kind: each for each in topics.FROM_DRIVERS}


def of_driver(kind, leg, stamp_ns, frame, values):
    """Return a message of a driver of others."""
    topic = DRIVERS[kind]
    message = message_class(topic.type_name)(header=Header(frame_id=frame))
    seconds, rest = divmod(stamp_ns, SECOND)
    message.header.stamp.sec = (seconds + 2**31) % 2**32 - 2**31
    message.header.stamp.nanosec = rest
    if isinstance(message, FluidPressure):
        message.fluid_pressure = values[0]
    elif isinstance(message, TwistWithCovarianceStamped):
        message.twist.twist.linear.x, message.twist.covariance[0] = values[:2]
    else:
        point = message.wrench.force if hasattr(message, 'wrench') else message.point
        point.x, point.y, point.z = values
    return topic, message, leg


def test_merge_survives_and_joins_what_is_possible(bench, monkeypatch):
    monkeypatch.setattr(MergeNode, 'count_publishers', lambda node, name: 0)
    node = bench.start(MergeNode, topics=', '.join(DRIVERS))
    names = st.sampled_from(list(DRIVERS))
    three = st.lists(numbers, min_size=3, max_size=3)
    messages = st.builds(of_driver, names, legs, stamps, frames, three)
    nonsense = st.builds(
        lambda name, leg, data: (DRIVERS[name], data, leg), names, legs, st.binary(max_size=120)
    )
    clocks = st.integers(0, LAST_NS)

    @settings(max_examples=200, deadline=None)
    @given(st.lists(st.one_of(messages, nonsense, clocks), max_size=30))
    def behave(actions):
        for each in actions:
            if isinstance(each, int):
                bench.clock(each)
            else:
                bench.give(*each)
        for topic in (topics.SAMPLE, topics.FORCE, topics.COMMAND, topics.PRESSURE):
            for block in bench.heard(topic):
                assert block.rows.shape == (1, 2)
        bench.sent.clear()
        for second in (2, 200_000):  # one of these is later than the last stamp
            for leg in LEGS:
                bench.give(DRIVERS['wrench'], wrench(second * SECOND), leg)
                bench.give(DRIVERS['position'], position(second * SECOND, (0.0, 0.0, leg)), leg)
        assert bench.last(topics.SAMPLE)['position'][:, 2].tolist() == [1.0, 2.0]
        bench.sent.clear()

    behave()
    assert node.refused


TORN = (
    b'', b'\0\1\0\0', b'\0\1\0\0' + b'\1' * 10, b'\7' * 40,
    struct.pack('<4xiII', 1, 2, 0x7FFFFFFF) + b'abc', struct.pack('<4xI4s', 4, b'\xff\xfe\xc3\0'),
)  # fmt: skip


def test_messages_that_are_no_messages_stop_no_node(context, executor, until):
    """Through DDS, which may look into them."""
    kinds = (RegulatorNode, EstimatorNode, ControllerNode, MergeNode, ViewsNode)
    one = overrides({'legs': [1, 2]})
    nodes = [kind(context=context, parameter_overrides=one) for kind in kinds]
    attacker = Node('attacker', context=context)
    for node in (*nodes, attacker):
        executor.add_node(node)
    heard = []
    qos.subscription(attacker, topics.PRESSURE, heard.append)
    published = [(topic, None) for topic in topics.RECORDS if topic is not topics.FORCE]
    published += [(topic, 1) for name, topic in DRIVERS.items() if 'pressure' not in name][:2]
    for topic, leg in published:
        publisher = qos.publisher(attacker, topic, leg)
        until(publisher.get_subscription_count)
        for data in TORN:
            # In one process the error may be raised here; later pressures must still arrive.
            with contextlib.suppress(RCLError):
                publisher.publish(data)
            count = len(heard)
            until(lambda count=count: len(heard) > count, what='a pressure')  # the node goes on
        attacker.destroy_publisher(publisher)
    publisher = qos.publisher(attacker, topics.SAMPLE)
    until(lambda: publisher.get_subscription_count() == 2)
    channel = nodes[0].supervision.channels[0]

    def answered():
        now_ns = attacker.get_clock().now().nanoseconds
        publisher.publish(encoded(topics.SAMPLE, sample(now_ns), (1, 2)))
        return channel.answers.accepted

    until(answered, what='a set-point after a sound sample')
    assert channel.answers.accepted
