# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure

from ros_pad.errors import ConfigError
from ros_pad.estimation.scales import GRID
from ros_pad.estimation.scales import Felt
from ros_pad.nodes import topics
from ros_pad.nodes.estimator import EstimatorNode
from ros_pad.nodes.messages import Hooks
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.messages import hook
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp

ESTIMATES = (
    topics.SLIP, topics.SLIPPING, topics.FRICTION, topics.FRICTION_MARGIN, topics.CONTACT_LOAD,
    topics.CONTACT_POSITION, topics.WETNESS, topics.DOUBT,
)  # fmt: skip
LOAD = 6.83
AMBIENT = 101325.0


class Robot:
    """Publishes readings of the sensors of legs 1 and 2, and records the estimates."""

    def __init__(self, context, executor, until):
        self.node = Node('robot', context=context)
        executor.add_node(self.node)
        self._context, self._executor, self.until = context, executor, until
        self.heard = {}
        self.torque = 0.0
        for leg in (1, 2):
            for topic in ESTIMATES:
                self.heard[topic.name(leg)] = []
                topic.subscription(self.node, self.heard[topic.name(leg)].append, leg)
        self._publishers = {
            topic.name(leg): topic.publisher(self.node, leg)
            for leg in (1, 2)
            for topic in (topics.WRENCH, topics.POSITION, topics.PRESSURE)
        }
        self._clock = topics.CLOCK.publisher(self.node)
        self.estimator = None

    def start(self, **parameters):
        parameters = {'legs': [1, 2], 'publish_rate': 1000.0, 'use_sim_time': True} | parameters
        self.estimator = EstimatorNode(
            context=self._context,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        self._executor.add_node(self.estimator)
        self.until(
            lambda: (
                all(p.get_subscription_count() for p in self._publishers.values())
                and self._clock.get_subscription_count() == 2  # two subscriptions: time and ticks
                and all(self.node.count_publishers(name) for name in self.heard)
            )
        )
        return self.estimator

    def tick(self, seconds):
        """Set the simulated time, s, and wait until the estimator has received it."""
        message = topics.CLOCK.message()
        set_stamp(message.clock, round(seconds * 1e9))
        self._clock.publish(message)
        self.until(
            lambda: self.estimator.get_clock().now().nanoseconds == nanoseconds(message.clock)
        )

    def tick_until(self, seconds):
        """Advance the simulated time from 0 to a time, s, in steps of 10 ms."""
        for number in range(1, round(100 * seconds) + 1):
            self.tick(0.01 * number)

    def wrench(self, seconds, force=(0.0, 0.0, LOAD), leg=1):
        message = WrenchStamped()
        set_stamp(message.header.stamp, round(seconds * 1e9))
        f = message.wrench.force
        f.x, f.y, f.z = map(float, force)
        self._send(topics.WRENCH, message, leg)

    def position(self, seconds, point=(0.0, 0.0, 0.0), leg=1):
        message = PointStamped()
        set_stamp(message.header.stamp, round(seconds * 1e9))
        p = message.point
        p.x, p.y, p.z = map(float, point)
        self._send(topics.POSITION, message, leg)

    def pressure(self, gauge, leg=1):
        self._send(topics.PRESSURE, FluidPressure(fluid_pressure=AMBIENT + gauge), leg)

    def _send(self, topic, message, leg):
        """Publish a message and wait until the estimator has processed it."""
        taken = []
        subscription = topic.subscription(self.estimator, taken.append, leg)
        publisher = self._publishers[topic.name(leg)]
        self.until(lambda: publisher.get_subscription_count() == 2)
        publisher.publish(message)
        self.until(lambda: taken)
        self.estimator.destroy_subscription(subscription)
        self.until(lambda: publisher.get_subscription_count() == 1)

    def sample_refused(self, seconds):
        self.wrench(seconds, (math.nan, 0.0, LOAD))
        self.position(seconds)

    def sample(self, seconds, force=(0.0, 0.0, LOAD), point=(0.0, 0.0, 0.0), leg=1):
        """Publish wrench and position with one stamp, and wait until they are processed."""
        message = WrenchStamped()
        before = self.estimator.samples
        set_stamp(message.header.stamp, round(seconds * 1e9))
        f = message.wrench.force
        f.x, f.y, f.z = map(float, force)
        message.wrench.torque.z = self.torque
        self._publishers[topics.WRENCH.name(leg)].publish(message)
        place = PointStamped(header=message.header)
        p = place.point
        p.x, p.y, p.z = map(float, point)
        self._publishers[topics.POSITION.name(leg)].publish(place)
        self.until(lambda: self.estimator.samples == before + 1)


@pytest.fixture
def robot(context, executor, until):
    return Robot(context, executor, until)


def test_an_estimate_is_one_message_of_each_kind(robot):
    robot.start()
    robot.sample(1.0)
    robot.until(lambda: all(robot.heard[topic.name(1)] for topic in ESTIMATES))
    assert all(len(robot.heard[topic.name(1)]) == 1 for topic in ESTIMATES)
    assert not any(robot.heard[topic.name(2)] for topic in ESTIMATES)
    (slip,) = robot.heard['leg_1/slip']
    assert nanoseconds(slip.header.stamp) == 10**9
    assert slip.header.frame_id == 'world'
    assert slip.twist.twist.linear.z == 0.0
    covariance = list(slip.twist.covariance)
    assert covariance[0] == covariance[7] > 0.0
    assert sum(map(abs, covariance)) == 2 * covariance[0]
    assert robot.heard['leg_1/slipping'][0].data is False
    assert robot.heard['leg_1/wetness'][0].data == pytest.approx(0.5)
    assert 0.1 < robot.heard['leg_1/friction'][0].data < 1.0
    assert -1.0 < robot.heard['leg_1/friction_margin'][0].data < 1.0
    assert robot.heard['leg_1/contact_load'][0].data == LOAD
    (place,) = robot.heard['leg_1/contact_position']
    assert (nanoseconds(place.header.stamp), place.header.frame_id) == (10**9, 'world')


def test_an_estimate_has_the_largest_load_and_the_last_position_since_the_last_one(robot):
    robot.start(publish_rate=50.0)
    loads = (1.0, 9.0, 4.0, 2.0, 3.0, 5.0, 8.0, 7.0, 6.0, 0.5, 0.0)
    for number, load in enumerate(loads):
        robot.sample(0.020 + 0.004 * number, (0.0, 0.0, load), (0.1 * number, -0.2 * number, 9.0))
    robot.until(lambda: len(robot.heard['leg_1/wetness']) == 3)
    # The estimates are at 0.02, 0.04 and 0.06 s, with samples 0, 1 to 5, and 6 to 10.
    assert [each.data for each in robot.heard['leg_1/contact_load']] == [1.0, 9.0, 8.0]
    places = robot.heard['leg_1/contact_position']
    assert [(p.point.x, p.point.y) for p in places] == [(0.0, 0.0), (0.5, -1.0), (1.0, -2.0)]
    assert [nanoseconds(p.header.stamp) for p in places] == [20_000_000, 40_000_000, 60_000_000]


def test_a_hidden_marker_gives_estimates_without_a_position(robot):
    robot.start()
    robot.sample(0.004)
    robot.wrench(0.008)
    robot.wrench(0.012, (0.0, 0.0, 2.0))  # the wrench before it is used now
    robot.until(lambda: len(robot.heard['leg_1/wetness']) == 2)
    robot.until(lambda: len(robot.heard['leg_1/contact_load']) == 2)
    assert len(robot.heard['leg_1/contact_position']) == 1


def test_load_and_position_come_before_the_wetness_that_uses_them(context):
    """The controller decides when the wetness arrives."""
    sent = []
    hook(context, Hooks(lambda name, _: sent.append(name), lambda: None))
    node = EstimatorNode(context=context, parameter_overrides=[Parameter('legs', value=[1])])
    stage = node.legs[1].stage
    sent.clear()
    stage.wrench(4_000_000, (0.0, 0.0, LOAD), 0.0)
    stage.position(4_000_000, (0.0, 0.0, 0.0))
    node.destroy_node()
    names = [name for name in sent if name.startswith('/leg_1')]
    assert sorted(names) == sorted(f'/{topic.name(1)}' for topic in ESTIMATES)
    assert names[-1] == '/leg_1/wetness'


@pytest.mark.parametrize('first', ['wrench', 'position'])
def test_either_may_come_first(robot, first):
    node = robot.start()
    other = {'wrench': 'position', 'position': 'wrench'}[first]
    for number in range(1, 6):
        getattr(robot, first)(0.004 * number)
        assert node.samples == number - 1
        getattr(robot, other)(0.004 * number)
        robot.until(lambda n=number: node.samples == n)


def test_a_missing_position_costs_no_wrench(robot):
    node = robot.start()
    robot.wrench(0.004)
    robot.position(0.004)
    for number in (2, 3, 4):  # the marker is out of sight
        robot.wrench(0.004 * number)
    robot.wrench(0.020)
    robot.position(0.020)
    assert node.samples == 5
    robot.until(lambda: len(robot.heard['leg_1/slip']) == 5)
    stamps = [nanoseconds(slip.header.stamp) for slip in robot.heard['leg_1/slip']]
    assert stamps == [4_000_000, 8_000_000, 12_000_000, 16_000_000, 20_000_000]


def test_a_marker_slower_than_the_force_costs_no_wrench(robot):
    node = robot.start()
    for number in range(1, 21):
        if number % 4 == 1:
            robot.position(0.004 * number)
        robot.wrench(0.004 * number)
    assert node.samples in (19, 20)  # the last one may still wait for its position


def test_without_any_position_nothing_is_published(robot):
    node = robot.start()
    for number in (1, 2, 3):
        robot.wrench(0.004 * number)
    assert node.samples == 0
    assert not any(robot.heard.values())


@pytest.mark.parametrize('noise', [0.0, 1e-4])
def test_sensors_without_noise_may_repeat_themselves(robot, noise):
    node = robot.start(force_noise=noise, position_noise=noise)
    for number in range(1, 31):
        robot.sample(0.004 * number)
    assert node.legs[1].stage.sound == (noise == 0.0)


def test_a_pressure_that_is_no_number_leaves_the_last_one_in_force(robot):
    node = robot.start()
    robot.pressure(80e3)
    robot.sample(0.004)
    robot.pressure(math.nan)
    for number in range(2, 14):
        robot.sample(0.004 * number)
    assert node.samples == 13
    assert node.legs[1].stage.doubt.startswith('domed')


def test_legs_do_not_mix(robot):
    node = robot.start()
    robot.wrench(0.004, leg=1)
    robot.position(0.004, leg=2)
    assert node.samples == 0
    robot.position(0.004, leg=1)
    assert (node.legs[1].stage.samples, node.legs[2].stage.samples) == (1, 0)


BAD = {
    'force x': {'force': (math.nan, 0.0, LOAD)},
    'load': {'force': (0.0, 0.0, math.nan)},
    'infinite load': {'force': (0.0, 0.0, math.inf)},
}


@pytest.mark.parametrize('case', BAD)
def test_a_sample_that_is_no_number_is_ignored_with_a_warning(robot, case, capfd):
    node = robot.start()
    robot.sample(0.004)
    bad = BAD[case]
    robot.wrench(0.008, bad.get('force', (0.0, 0.0, LOAD)))
    robot.position(0.008, bad.get('point', (0.0, 0.0, 0.0)))
    assert node.samples == 1
    warning = capfd.readouterr().err
    assert 'sample ignored' in warning
    assert 'must be finite' in warning
    robot.sample(0.012)
    robot.until(lambda: len(robot.heard['leg_1/wetness']) == 2)
    for topic in (topics.WETNESS, topics.FRICTION, topics.FRICTION_MARGIN):
        assert all(math.isfinite(m.data) for m in robot.heard[topic.name(1)])


def test_a_marker_out_of_sight_leaves_the_last_position(robot):
    """Some motion capture sends NaN for it; the last position is used until it is too old."""
    node = robot.start()
    robot.position(0.002, (math.nan, 0.0, 0.0))
    robot.wrench(0.002)
    assert node.samples == 0
    robot.sample(0.004)
    for number in range(2, 30):
        jitter = 1e-9 * math.sin(number)
        robot.wrench(0.004 * number, (jitter, 0.0, LOAD + jitter))
        robot.position(0.004 * number, (math.nan, 0.0, 0.0))
        assert node.samples == number
    doubts = [message.data for message in robot.heard['leg_1/doubt']]
    assert doubts[-1].startswith('marker lost: last seen 0.05')
    assert not any(doubt.startswith('marker') for doubt in doubts[:-1])


def test_a_sample_that_comes_twice_counts_once(robot):
    node = robot.start()
    robot.sample(0.004)
    robot.wrench(0.004)
    robot.position(0.004)
    assert node.samples == 1


def test_estimates_come_at_their_rate(robot):
    robot.start(publish_rate=50.0)
    for number in range(1, 251):
        robot.sample(0.004 * number)
    robot.until(lambda: len(robot.heard['leg_1/wetness']) >= 51)
    assert len(robot.heard['leg_1/wetness']) == 51  # 0.004, 0.020, 0.040 ... 1.000 s


def stance(robot, ratio, speed, seconds=1.0, start=0.0, foot_at=0.0):
    """Let a foot stand under LOAD with T/N = ``ratio``, sliding at ``speed``, m/s."""
    for number in range(1, round(seconds / 0.004) + 1):
        time = start + 0.004 * number
        jitter = 1e-9 * math.sin(number)  # exactly equal readings would be faulty
        force = (-ratio * LOAD + jitter, 0.0, LOAD + jitter)
        robot.sample(time, force, (foot_at + speed * 0.004 * number + jitter, 0, 0))
    robot.until(lambda: robot.heard['leg_1/slip'] and robot.heard['leg_1/wetness'])


def test_a_foot_that_holds_a_strong_pull_stands_on_dry_ground(robot):
    robot.start()
    stance(robot, ratio=0.6, speed=0.0)
    assert robot.heard['leg_1/wetness'][-1].data < 0.2
    assert robot.heard['leg_1/friction'][-1].data > 0.6
    assert not any(each.data for each in robot.heard['leg_1/slipping'])


def test_a_foot_that_slides_under_a_weak_pull_stands_on_wet_ground(robot):
    robot.start()
    stance(robot, ratio=0.2, speed=0.1)
    assert robot.heard['leg_1/wetness'][-1].data > 0.8
    assert robot.heard['leg_1/friction'][-1].data == pytest.approx(0.2, abs=0.1)
    assert robot.heard['leg_1/slipping'][-1].data
    last = robot.heard['leg_1/slip'][-1].twist.twist.linear
    assert last.x == pytest.approx(0.1, rel=0.1)
    assert last.y == 0.0


def test_evidence_of_a_pull_depends_on_the_morphology(robot):
    """A dome sticks equally well on wet and dry ground; pressure shows whether the foot is one."""
    robot.start()
    robot.pressure(75e3)
    stance(robot, ratio=0.3, speed=0.0)
    domed = robot.heard['leg_1/wetness'][-1].data
    robot.pressure(0.0)
    robot.sample(1.5, (0.0, 0.0, 0.0))  # swing: the next stance is 10 m away
    stance(robot, ratio=0.3, speed=0.0, start=1.6, foot_at=10.0)
    flat = robot.heard['leg_1/wetness'][-1].data
    assert abs(domed - 0.5) < 0.2
    assert flat < 0.2


def test_every_wrench_changes_the_estimator(robot):
    """Each sample changes the estimate, also between two messages."""
    node = robot.start(publish_rate=5.0)
    estimator = node.legs[1].stage.estimator
    states = []
    for number in range(1, 11):
        robot.sample(0.004 * number, (0.1 * number, 0.0, LOAD), (1e-5 * number, 0.0, 0.0))
        states.append((estimator.estimate.time, estimator.estimate.slip_speed))
    assert len(set(states)) == 10
    assert [time for time, _ in states] == pytest.approx([0.004 * n for n in range(1, 11)])


# --- doubts -------------------------------------------------------------------------------------


def sensing(statuses, leg):
    """Return the last status of a leg's sensors on /diagnostics."""
    return [status for status in statuses if f'leg {leg} sensing' in status.name][-1]


@pytest.fixture
def health(robot):
    statuses = []
    topics.DIAGNOSTICS.subscription(robot.node, lambda array: statuses.extend(array.status))
    return statuses


def test_a_doubt_is_published_when_it_changes_and_ends(robot):
    robot.start()
    stance(robot, ratio=0.02, speed=0.0, seconds=0.2)
    assert robot.heard['leg_1/doubt'][-1].data.startswith('not pulled: T/N up to 0.02')
    assert len(robot.heard['leg_1/doubt']) == 2  # before, the foot had not stood
    # A force that leaps while the marker stays looks like motion at first.
    stance(robot, ratio=0.6, speed=0.0, seconds=0.6, start=0.2)
    robot.until(lambda: robot.heard['leg_1/doubt'][-1].data == '')
    kinds = [each.data.partition(':')[0] for each in robot.heard['leg_1/doubt']]
    assert kinds == ['not yet', 'not pulled', 'undecided', '']


def test_a_force_sensor_that_stands_still_is_an_error_at_the_next_tick(robot, health):
    robot.start()
    stance(robot, ratio=0.1, speed=0.0, seconds=0.2)
    robot.tick(0.2)
    robot.until(lambda: health and sensing(health, 1).level == DiagnosticStatus.OK)
    for number in range(51, 85):
        robot.sample(0.004 * number, point=(1e-9 * math.sin(number), 0.0, 0.0))
    robot.tick(0.34)
    robot.until(lambda: sensing(health, 1).level == DiagnosticStatus.ERROR)
    assert sensing(health, 1).message.startswith('force stands still: 6.83 N')
    assert robot.heard['leg_1/doubt'][-1].data.startswith('force stands still')
    robot.sample(0.4, (0.001, 0.0, LOAD + 0.01))
    robot.tick(0.4)
    robot.until(lambda: sensing(health, 1).level == DiagnosticStatus.OK)
    assert math.isfinite(robot.heard['leg_1/friction_margin'][-1].data)


def test_a_foot_without_samples_is_an_error_within_a_second(robot, health):
    robot.start()
    robot.sample(0.004)
    robot.tick_until(1.0)
    robot.until(lambda: health and sensing(health, 1).level == DiagnosticStatus.ERROR)
    silence = float(re.match(r'no wrench: for ([\d.]+) s', sensing(health, 1).message)[1])
    assert 0.3 < silence <= 1.0  # the message at 1 s has one decimal
    robot.wrench(0.008, leg=2)
    robot.tick(2.1)
    robot.until(lambda: 'no position' in sensing(health, 2).message)
    robot.sample(0.012)
    robot.tick(2.2)
    robot.until(lambda: sensing(health, 1).level == DiagnosticStatus.OK)


def test_refused_samples_are_reported_with_the_reason(robot, health):
    robot.start()
    robot.sample(0.004)
    for number in range(2, 6):
        robot.sample_refused(0.004 * number)
    robot.tick_until(1.0)
    robot.until(lambda: health and 'sample refused' in sensing(health, 1).message)
    assert 'must be finite' in sensing(health, 1).message


def test_rate_and_age_of_the_samples_are_reported(context, monkeypatch):
    """The times are given, so that the machine does not matter."""
    sent, ticks = [], []

    def output(messages, topic, leg=None):
        return sent.append if topic is topics.DIAGNOSTICS else lambda message: None

    monkeypatch.setattr(Messages, 'output', output)
    monkeypatch.setattr(Messages, 'on_tick', lambda self, period, call: ticks.append(call))
    legs = Parameter('legs', value=[1, 2])
    node = EstimatorNode(context=context, parameter_overrides=[legs])
    (tick,) = ticks
    start_ns = node.get_clock().now().nanoseconds // 10**9 * 10**9 + 10**9
    tick(start_ns)

    def second(number, age_ns):
        """Give each leg 50 samples in a second, with stamps of an age, and return the status."""
        for sample in range(50):
            now_ns = start_ns + (number - 1) * 10**9 + (sample + 1) * 20_000_000
            for leg in node.legs.values():
                stamp_ns = now_ns - age_ns
                leg.stage.wrench(stamp_ns, (0.001 * sample, 0.0, LOAD), 0.0)
                leg.stage.position(stamp_ns, (1e-6 * sample, 0.0, 0.0))
        tick(start_ns + number * 10**9)
        (status,) = [each for each in sent[-1].status if each.name == 'estimator: rate']
        return status

    good = second(1, 5_000_000)
    assert (good.level, good.message) == (DiagnosticStatus.OK, '50 samples a second')
    assert [each.value for each in good.values] == ['50.0', '0.005']
    late = second(2, 150_000_000)
    assert (late.level, late.message) == (
        DiagnosticStatus.WARN, 'too slow, or clocks differ: samples are 0.15 s old',
    )  # fmt: skip
    early = second(3, -300_000_000)  # the other clock is ahead
    assert (early.level, early.values[1].value) == (DiagnosticStatus.WARN, '-0.300')
    node.destroy_node()


def test_in_simulated_time_no_rate_is_reported(robot, health):
    robot.start()
    robot.tick(1.0)
    robot.until(lambda: health)
    assert {each.name for each in health} == {
        *(f'estimator: leg {leg} sensing' for leg in (1, 2)),
        'estimator: friction of the floor',
    }


def test_a_moment_counts_where_there_is_one(robot):
    """Friction holds the yaw moment: 0.04 N m over the turning radius is half of the load."""
    robot.start(moment_noise=5e-4)
    stance(robot, ratio=0.05, speed=0.0, seconds=0.2)
    assert robot.heard['leg_1/wetness'][-1].data > 0.4
    robot.torque = 0.04
    stance(robot, ratio=0.05, speed=0.0, seconds=0.2, start=0.2)
    robot.until(lambda: robot.heard['leg_1/wetness'][-1].data < 0.2)
    assert robot.heard['leg_1/friction'][-1].data > 0.5


def test_what_is_learnt_is_kept_and_reported(context, tmp_path):
    """A file gives parameters at the start, before any other source, and is written at the end."""
    path = tmp_path / 'learnt.yaml'
    given = (
        'flat_dry: {scale: 0.7, sd: 0.05}\nflat_wet: {scale: 1.0, sd: 0.3}\n'
        'dome: {scale: 1.0, sd: 0.4}\n'
    )
    path.write_text('foot: large37\n' + given)

    def made(**more):
        values = {'legs': [1], 'scale.flat_dry': 2.0, 'learnt': str(path), **more}
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        return EstimatorNode(context=context, parameter_overrides=overrides)

    node = made()
    assert node.get_parameter('scale.flat_dry').value == 0.7
    assert node.get_parameter('scale_sd.flat_wet').value == pytest.approx(math.hypot(0.3, 0.1))
    status = node._learnt_status()
    values = {each.key: each.value for each in status.values}
    assert values['flat_dry'] == '0.70 (0.56 to 0.87)'  # 0.7 exp(±1.96 × √(0.05² + 0.1²))
    node.destroy_node()
    assert path.read_text() == 'foot: large37\n' + given  # nothing was learnt
    node = made()
    slips = -0.5 * (np.log(GRID / 0.6) / 0.05) ** 2
    for step in range(9):
        node.shared.add(Felt(step, 0, False, 1e-6, np.array([slips, slips]), 1.0))
    node.shared.expected(10.0)
    path.unlink()
    node.destroy_node()
    kept = yaml.safe_load(path.read_text())
    assert kept['foot'] == 'large37'
    assert kept['flat_dry']['scale'] == pytest.approx(0.75, abs=0.05)  # 0.6 over 0.8 of large37
    assert kept['flat_dry']['sd'] < 0.06
    assert kept['dome']['sd'] == pytest.approx(0.4, abs=0.01)
    path.write_text('foot: small19\n' + given)
    with pytest.raises(ConfigError, match="foot = 'small19' is not allowed"):
        made()
