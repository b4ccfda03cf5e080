# SPDX-License-Identifier: Apache-2.0
import math
import time
import types
from itertools import pairwise

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure

from ros_pad import configuration
from ros_pad.nodes import simulator
from ros_pad.nodes import topics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.simulator import SimulatorNode
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp

AMBIENT = 101325.0
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
LEGS = (1, 2, 3, 4, 5, 6)


@pytest.fixture
def start(context, executor):
    def start(**parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = SimulatorNode(context=context, parameter_overrides=overrides)
        executor.add_node(node)
        return node

    return start


@pytest.fixture
def observer(context, executor):
    """Return a node that records messages: ``heard[topic]`` is a list of them."""
    node = Node('observer', context=context)
    node.heard = {}
    for topic in (topics.WRENCH, topics.POSITION):
        for leg in LEGS:
            node.heard[topic.name(leg)] = []
            topic.subscription(node, node.heard[topic.name(leg)].append, leg)
    for topic in (topics.BODY_POSE, topics.CLOCK):
        node.heard[topic.name()] = []
        topic.subscription(node, node.heard[topic.name()].append)
    executor.add_node(node)
    return node


def found(observer, clock):
    return lambda: all(
        observer.count_publishers(name) for name in observer.heard if clock or name != '/clock'
    )


def test_a_step_is_one_message_of_everything(start, observer, until):
    node = start(free_running=False, publish_clock=True, rate=100.0, fidelity='L1')
    until(found(observer, clock=True))
    for number in range(1, 6):
        node.step()
        until(lambda n=number: all(len(each) == n for each in observer.heard.values()))
    for name, messages in observer.heard.items():
        stamps = [nanoseconds(m.clock if name == '/clock' else m.header.stamp) for m in messages]
        assert stamps == [10_000_000, 20_000_000, 30_000_000, 40_000_000, 50_000_000], name
    assert observer.heard['leg_3/wrench'][0].header.frame_id == 'leg_3_sole'
    assert observer.heard['leg_3/position'][0].header.frame_id == 'world'
    assert observer.heard['body/pose'][0].header.frame_id == 'world'
    # The robot, 2.09 kg, stands on six legs; the noise is 0.03 N per leg.
    load = sum(observer.heard[f'leg_{leg}/wrench'][0].wrench.force.z for leg in LEGS)
    assert load == pytest.approx(2.09 * 9.81, abs=0.5)
    q = observer.heard['body/pose'][0].pose.orientation
    assert (q.x, q.y, math.hypot(q.z, q.w)) == (0.0, 0.0, pytest.approx(1.0))
    # In the thesis legs 1 to 3 are on the left; legs 1 and 6 are in front.
    points = {leg: observer.heard[f'leg_{leg}/position'][0].point for leg in LEGS}
    assert [leg for leg in LEGS if points[leg].y > 0.0] == [1, 2, 3]
    assert [leg for leg in LEGS if points[leg].x > 0.1] == [1, 6]


def test_full_dynamics_publish_the_joints(start, robot, until):
    heard = []
    topics.JOINT_STATES.subscription(robot, heard.append)
    node = start(free_running=False, publish_clock=True, fidelity='L2')
    until(lambda: robot.count_publishers('joint_states'))
    seen = []
    for number in range(1, 501):
        node.step()
        seen.append(node.robot.joint_positions)
        until(lambda n=number: len(heard) == n)
    assert [nanoseconds(each.header.stamp) for each in heard[:2]] == [4_000_000, 8_000_000]
    assert {tuple(each.name) for each in heard} == {tuple(node.robot.joint_names)}
    assert len(set(node.robot.joint_names)) == 18
    assert [tuple(each.position) for each in heard] == seen
    # The robot stands first and walks then; each joint moves within what a leg can do.
    travel = np.ptp(seen, axis=0)
    assert np.all(travel > 0.001) and np.all(travel < 1.5)


@pytest.mark.realtime
def test_free_running_keeps_its_rate_and_the_time_of_day(start, observer, until):
    start(rate=100.0)
    until(found(observer, clock=False))
    heard = observer.heard['leg_1/wrench']
    until(lambda: heard)
    first, count = time.monotonic(), len(heard)
    until(lambda: time.monotonic() > first + 1.0)
    assert 90 <= len(heard) - count <= 103
    assert abs(nanoseconds(heard[-1].header.stamp) - time.time_ns()) < 200_000_000
    assert not observer.heard['/clock']
    assert not observer.count_publishers('/clock')


@pytest.fixture
def rates(robot):
    """Return a list that receives the statuses of the simulator's rate from /diagnostics."""
    found = []

    def receive(array):
        found.extend((array, each) for each in array.status if each.name == 'simulator: rate')

    topics.DIAGNOSTICS.subscription(robot, receive)
    return found


def delay(node, seconds, monkeypatch):
    """Let each step of the robot take a time, s."""
    step = node.robot.step

    def slow(pressures):
        time.sleep(seconds)
        step(pressures)

    monkeypatch.setattr(node.robot, 'step', slow)


def figures(status):
    return [float(each.value) for each in status.values]


def test_a_simulator_that_is_too_slow_reports_its_rate(
    start, observer, rates, until, monkeypatch, capfd
):
    """A step of 40 ms at 100 Hz: samples are left out, and then time itself."""
    node = start(scene='leg_wet_dome_40', fidelity='L0', rate=100.0)
    delay(node, 0.04, monkeypatch)
    heard = observer.heard['leg_1/wrench']
    until(lambda: len(rates) >= 4 and len(heard) >= 4)  # not so slow in the first two seconds
    array, status = rates[-1]
    assert status.level == WARN
    assert [each.key for each in status.values] == [
        'wanted rate (Hz)', 'reached rate (Hz)', 'speed (times real time)',
    ]  # fmt: skip
    wanted, reached, speed = figures(status)
    assert wanted == 100.0
    # At most ten samples of 40 ms each pass between two messages.
    assert 0.0 < reached < 20.0
    assert 0.0 < speed <= 0.27
    assert status.message.startswith(f'too slow: {reached:.0f} of 100 samples a second: choose ')
    assert 'too slow: ' in capfd.readouterr().err
    assert abs(nanoseconds(array.header.stamp) - time.time_ns()) < 60_000_000_000
    # Stamps are those of the time of day, so that other nodes do not take readings for old ones.
    stamps = [nanoseconds(each.header.stamp) for each in heard]
    assert all(late - early >= 40_000_000 for early, late in pairwise(stamps))


def test_the_rate_is_measured_over_whole_seconds_from_the_first_tick(start, monkeypatch, capfd):
    """A start that takes long is no reason to warn; the time here is not that of the machine."""
    sent = []

    def output(messages, topic, leg=None):
        return sent.append if topic is topics.DIAGNOSTICS else lambda message: None

    monkeypatch.setattr(Messages, 'output', output)
    node = start(scene='leg_wet_dome_40', fidelity='L0', rate=100.0)
    (timer,) = node.timers
    now = 10**12

    def tick_until(end_ms, step_ms):
        nonlocal now
        for _ in range(round((end_ms - (now - 10**12) / 1e6) / step_ms)):
            now += step_ms * 1_000_000
            timer.callback()

    monkeypatch.setattr(simulator, 'time', types.SimpleNamespace(monotonic_ns=lambda: now))
    timer.callback()
    assert node.robot.time == 0.0
    tick_until(2000, 10)
    assert node.robot.time == pytest.approx(2.0)
    tick_until(3000, 50)  # five samples at a time: four are left out
    assert node.robot.time == pytest.approx(3.0)
    tick_until(4000, 200)  # ten of twenty
    assert node.robot.time == pytest.approx(3.5)
    statuses = [array.status[0] for array in sent]
    assert [figures(each) for each in statuses] == [
        [100.0, 100.0, 1.0], [100.0, 100.0, 1.0], [100.0, 20.0, 1.0], [100.0, 5.0, 0.5],
    ]  # fmt: skip
    assert [each.level for each in statuses] == 2 * [OK] + 2 * [WARN]
    assert statuses[0].message == '100 of 100 samples a second'
    assert capfd.readouterr().err.count('too slow: 20 of 100 samples a second') == 1


def test_late_samples_are_left_out_and_simulated_time_is_kept(start, observer, until):
    """The robot advances at each sample; only the last one of those that are due is published."""
    node = start(
        scene='leg_wet_dome_40', fidelity='L0', rate=100.0, publish_clock=True, free_running=False
    )
    heard, clock = observer.heard['leg_1/wrench'], observer.heard['/clock']
    until(lambda: observer.count_publishers('leg_1/wrench'))
    until(lambda: observer.count_publishers('/clock'))
    for number, samples in enumerate((7, 1), 1):
        node.step(samples)
        until(lambda n=number: len(heard) == len(clock) == n)
    assert node.time_ns == 80_000_000
    assert node.robot.time == pytest.approx(0.08)
    assert [nanoseconds(each.header.stamp) for each in heard] == [70_000_000, 80_000_000]
    stamps = [nanoseconds(each.clock) for each in clock]
    assert stamps == [70_000_000, 80_000_000]


@pytest.mark.realtime
def test_a_simulator_that_keeps_up_reports_that(start, rates, until):
    start(scene='leg_wet_dome_40', fidelity='L0', rate=50.0)
    until(lambda: len(rates) >= 2)
    _, status = rates[-1]
    assert status.level == OK
    assert status.message.endswith('of 50 samples a second')
    wanted, reached, speed = figures(status)
    assert (wanted, reached, speed) == pytest.approx((50.0, 50.0, 1.0), rel=0.05)


def test_without_real_time_there_is_no_rate(start, robot):
    node = start(free_running=False)
    node.step()
    assert not robot.count_publishers('/diagnostics')


def test_it_does_not_wait_for_its_own_clock(start, observer, until):
    start(rate=100.0, publish_clock=True, use_sim_time=True)
    until(lambda: len(observer.heard['/clock']) > 5 and len(observer.heard['leg_1/wrench']) > 5)
    stamps = [nanoseconds(each.clock) for each in observer.heard['/clock'][:6]]
    # Only the newest clock is kept, so that a late subscriber misses messages.
    assert all(
        late > early and (late - early) % 10_000_000 == 0 for early, late in pairwise(stamps)
    )


def test_it_reports_the_fidelity_level_and_the_end_of_the_walk(start, until, tmp_path, capfd):
    """The log reports a robot that has fallen, which topics alone do not show."""
    text = (configuration.shared_folder() / 'scenes' / 'hexapod_patches.yaml').read_text()
    top_heavy = tmp_path / 'top_heavy.yaml'
    top_heavy.write_text(f'{text}\nbody: {{height: 0.9}}\n')
    node = start(scene=str(top_heavy), fidelity='L1')
    until(lambda: node.robot.verdict)
    until(lambda end=node.robot.time + 0.1: node.robot.time > end)
    log = capfd.readouterr().err
    assert 'top_heavy on L1: ' in log
    assert log.count('tip-over at') == 1


def test_the_scene_gives_rate_and_legs(start, observer, until):
    node = start(scene='leg_wet_flat', free_running=False)
    assert node.period_ns == 4_000_000  # 250 Hz
    assert observer.count_publishers('leg_1/wrench') == 1
    assert observer.count_publishers('leg_2/wrench') == 0


def walk(node, robot, until, gauge, ambient=AMBIENT, seconds=4.0):
    """Walk for a time, s, with a pressure, Pa gauge, in all pads; return the distance, m."""
    publishers = [topics.PRESSURE.publisher(robot, leg) for leg in LEGS]
    until(lambda: all(p.get_subscription_count() for p in publishers))
    for publisher in publishers:
        message = FluidPressure(fluid_pressure=gauge + ambient)
        set_stamp(message.header.stamp, 1)
        publisher.publish(message)
    until(lambda: node.pressure_stamps == [1] * 6, what='the pressures')
    for _ in range(round(seconds / 0.004)):
        node.step()
    return node.robot.body[0]


@pytest.fixture
def robot(context, executor):
    node = Node('robot', context=context)
    executor.add_node(node)
    return node


def test_domes_walk_further_on_wet_ground(start, robot, until):
    """The simulator receives the pressure from its topic only."""
    flat = start(scene='hexapod_smooth_wet_flat', free_running=False)
    flat_way = walk(flat, robot, until, 0.0)
    flat.destroy_node()
    dome = start(scene='hexapod_smooth_wet_flat', free_running=False)
    dome_way = walk(dome, robot, until, 75e3)
    assert dome_way > 1.2 * flat_way > 0.0


def test_pressures_are_absolute(start, robot, until):
    """At another ambient pressure the same gauge pressure gives the same walk."""
    sea = start(free_running=False)
    way = walk(sea, robot, until, 60e3)
    sea.destroy_node()
    mountain = start(free_running=False, ambient_pressure=80000.0)
    assert walk(mountain, robot, until, 60e3, ambient=80000.0) == way


def test_a_pressure_that_is_none_changes_nothing(start, robot, until):
    node = start(free_running=False)
    heard = []
    topics.PRESSURE.subscription(node, heard.append, 2)  # called after the node's subscription
    publisher = topics.PRESSURE.publisher(robot, 2)
    until(lambda: publisher.get_subscription_count() == 2)
    taken = []
    for absolute in (AMBIENT + 50e3, math.nan, math.inf, -math.inf, AMBIENT - 3.0):
        heard.clear()
        publisher.publish(FluidPressure(fluid_pressure=absolute))
        until(lambda: heard)
        taken.append(node.pressures[1])
    # Values that are not finite are ignored; slightly below ambient counts as zero.
    assert taken == [50e3, 50e3, 50e3, 50e3, 0.0]


class Outbox:
    """Records messages of one topic: bytes, or those of markers as text."""

    def __init__(self, name):
        self.topic_name, self.handle, self.sent = name, self, []

    def get_subscription_count(self):
        return 1

    def publish(self, message):
        self.sent.append(message if isinstance(message, bytes) else repr(message))


def test_the_same_seed_is_the_same_walk(start, monkeypatch):
    boxes = {}

    def publisher(topic, node, leg=None):
        return boxes.setdefault(topic.name(leg), Outbox(topic.name(leg)))

    monkeypatch.setattr(topics.Topic, 'publisher', publisher)

    def steps(seed):
        boxes.clear()
        node = start(free_running=False, publish_clock=True, seed=seed)
        seen = []
        for _ in range(100):
            node.step()
            seen.append([foot.force for foot in node.robot.feet])
        node.destroy_node()
        sent = {name: box.sent for name, box in boxes.items()}
        assert len(sent[topics.WRENCH.name(1)]) == 100
        return seen, sent

    assert steps(3) == steps(3)
    wrench = topics.WRENCH.name(1)
    assert steps(3)[1][wrench] != steps(4)[1][wrench]
