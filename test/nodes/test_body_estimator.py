# SPDX-License-Identifier: Apache-2.0
"""The body estimator node on messages of a robot that stands."""

import math
import pathlib

import numpy as np
import pytest
from helpers import MS, header, overrides, record
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.logging import LoggingSeverity, set_logger_level
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

from ros_pad.bags import topics
from ros_pad.errors import ConfigError
from ros_pad.nodes.body_estimator import BodyEstimatorNode
from ros_pad.records import SAMPLE
from ros_pad.robots import Robot as Kinematics

LEGS = (1, 2, 3, 4, 5, 6)
QUADRUPED = pathlib.Path(__file__).parents[2] / 'bags' / 'quadruped' / 'robot.urdf'
CH3R = Kinematics.load('ch3r')
SHARE = CH3R.mass * 9.81 / 6.0
NONE = (math.nan, math.nan, math.nan)


def standing_joints(ms, names=CH3R.joint_names, **parts):
    given = {'position': CH3R.home.ravel(), 'velocity': np.zeros(18), 'effort': []} | parts
    values = {part: [float(each) for each in given[part]] for part in given}
    return JointState(header=header(ms * MS), name=list(names), **values)


def standing_imu(ms, covariance=0.0, z=9.81):
    message = Imu(header=header(ms * MS))
    message.linear_acceleration.z = z
    message.angular_velocity_covariance[0] = covariance
    return message


class Robot:
    """A body estimator on a bench, and readings of a CH3-R that stands, one every 4 ms."""

    def __init__(self, bench):
        self.bench = bench
        bench.legs = LEGS

    def start(self, **parameters):
        self.node = self.bench.start(BodyEstimatorNode, **parameters)
        return self.node

    def forces(self, ms, force=(0.0, 0.0, SHARE)):
        self.bench.give(topics.FORCE, record(SAMPLE, ms * MS, 6, force=force))

    def imu(self, ms, **more):
        self.bench.give(topics.IMU, standing_imu(ms, **more))

    def joints(self, ms, *names, **parts):
        self.bench.give(topics.JOINT_STATES, standing_joints(ms, *names, **parts))

    def stand(self, until_ms, *names, first_ms=4, force=(0.0, 0.0, SHARE), **parts):
        for ms in range(first_ms, until_ms + 1, 4):
            self.forces(ms, force)
            self.imu(ms)
            self.joints(ms, *names, **parts)

    def samples(self, leg=2):
        """Return all rows of a leg, with their stamps in ms."""
        blocks = self.bench.heard(topics.SAMPLE)
        stamps = np.concatenate([each.stamps for each in blocks])
        return stamps // MS, np.concatenate([each.rows[:, leg - 1] for each in blocks])

    def doubt(self):
        return self.bench.heard(topics.BODY_DOUBT)[-1].data

    def status(self):
        self.bench.tick(1.0)
        return self.bench.statuses('sensing')[-1][1]

    def figures(self):
        return {each.key: each.value for each in self.status().values}


@pytest.fixture
def robot(bench):
    return Robot(bench)


def test_a_standing_robot(robot):
    node, sent = robot.start(), []
    node._send_tf = sent.append  # as with publish_tf, for which tf2_msgs must be installed
    robot.stand(600)
    odom = robot.bench.heard(topics.ODOM)[-1]
    (shown,) = sent[-1]
    assert (shown.header.frame_id, shown.child_frame_id) == ('odom', 'base_link')
    assert shown.transform.rotation.w == odom.pose.pose.orientation.w
    assert shown.transform.translation.z == odom.pose.pose.position.z
    assert len(robot.bench.heard(topics.ODOM)) == robot.node.stage.samples == 146
    assert (odom.header.frame_id, odom.child_frame_id) == ('odom', 'base_link')
    assert odom.header.stamp.nanosec == 600 * MS
    place, turn = odom.pose.pose.position, odom.pose.pose.orientation
    assert [place.x, place.y, place.z] == pytest.approx([0.0] * 3, abs=1e-3)
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-3)
    assert odom.twist.twist.linear.x == pytest.approx(0.0, abs=1e-3)
    for part in (odom.pose, odom.twist):
        matrix = part.covariance.reshape(6, 6)
        assert np.allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    stamps, rows = robot.samples()
    assert stamps.tolist() == list(range(4, 601, 4))  # each moment has one row
    assert robot.bench.heard(topics.SAMPLE)[-1].stamps.tolist()[0] == 584 * MS  # in blocks
    known = np.isfinite(rows['force']).all(axis=1)
    assert known.tolist() == [False] * 4 + [True] * 146  # the first ones show that it is calm
    last = rows[-1]
    assert last['force'] == pytest.approx([0.0, 0.0, SHARE], abs=0.05)
    # Leg 2 points to the left: 0.138 m of hip, 29 and 57 mm of links, and 141 mm down.
    assert last['position'] == pytest.approx([0.0, 0.224, -0.141], abs=2e-3)
    assert last['velocity'][0] == pytest.approx(0.0, abs=1e-3)
    assert last['variance'][0] == last['variance'][1]
    assert 1e-8 < last['variance'][0] < 1e-3
    assert math.isnan(last['moment'])
    assert robot.doubt() == ''


MAPPING = """
force_axes: base
topics:
  robot/imu:
    type: sensor_msgs/msg/Imu
    stamp: header.stamp
    gyro: {field: angular_velocity.xyz, axes: [-x, y, -z]}
    accelerometer: {field: linear_acceleration.xyz, axes: [-x, y, -z]}
  robot/motors:
    type: sensor_msgs/msg/JointState
    stamp: header.stamp
    joints: {names: name, positions: position, velocities: velocity}
  robot/loads:
    type: std_msgs/msg/Float64MultiArray
    stamp: arrival
    normal_force: {field: data, legs: [1, 2, 3, 4, 5, 6], scale: 0.5}
"""


def test_another_robots_topics_by_a_mapping(robot, tmp_path):
    """The IMU is mounted upside down; loads come as counts of half a newton, in one axis."""
    file = tmp_path / 'mine.yaml'
    file.write_text(MAPPING)
    node = robot.start(mapping=str(file))
    by_name = {each.topic_name: each.callback for each in node.subscriptions}
    assert '/imu/data' not in by_name
    for ms in range(4, 401, 4):
        robot.bench.clock(ms * MS)
        by_name['/robot/loads'](Float64MultiArray(data=[2.0 * SHARE] * 6))
        by_name['/robot/imu'](standing_imu(ms, z=-9.81))
        by_name['/robot/motors'](standing_joints(ms))
    # Contact is known, but nothing can be learnt about friction.
    assert robot.doubt().startswith('friction: unobservable')
    turn = robot.bench.heard(topics.ODOM)[-1].pose.pose.orientation
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-2)
    _, rows = robot.samples()
    assert rows[-1]['force'] == pytest.approx([0.0, 0.0, SHARE], abs=0.05)
    assert np.isinf(rows[-1]['variance']).all()


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda robot, ms: robot.imu(ms, covariance=-1.0), 'angular_velocity_covariance'),
        (lambda robot, ms: robot.joints(ms, CH3R.joint_names[1:]), "'leg_1_coxa' is not among"),
        (lambda robot, ms: robot.joints(ms, position=[0.0] * 17), 'positions of 17 joints'),
        (lambda robot, ms: robot.joints(ms, effort=[0.0]), 'efforts of 1 joints'),
        (lambda robot, ms: robot.forces(ms, (1e300, 0.0, 0.0)), 'force'),
    ],
)
def test_bad_messages_are_refused_with_the_reason(robot, spoil, reason, capfd):
    node = robot.start()
    robot.stand(40)
    samples = node.stage.samples
    robot.bench.now_ns = 40 * MS
    spoil(robot, 44)
    assert node.stage.samples == samples
    log = capfd.readouterr().err
    assert 'reading ignored' in log and reason in log
    status = robot.status()
    assert robot.doubt().startswith('reading refused: ')
    assert status.message.startswith('reading refused') and status.level == status.WARN


@pytest.mark.parametrize('missing', ['force', 'imu', 'joints'])
def test_a_reading_that_is_missing_leaves_a_gap_and_no_more(robot, missing, capfd):
    """NaN is none: each moment has its record all the same, so that nobody waits for it."""
    robot.start()
    robot.stand(60)
    robot.forces(64, NONE if missing == 'force' else (0.0, 0.0, SHARE))
    robot.imu(64, z=math.nan if missing == 'imu' else 9.81)
    wrong = {'position': [math.nan] * 18} if missing == 'joints' else {}
    robot.joints(64, **wrong)
    robot.stand(200, first_ms=68)
    stamps, rows = robot.samples()
    assert stamps.tolist() == list(range(4, 201, 4))
    assert np.isfinite(rows['force'][-20:]).all()
    assert robot.doubt() == ''
    assert 'reading ignored' not in capfd.readouterr().err


def test_a_robot_of_a_urdf(robot):
    robot.start(
        robot=str(QUADRUPED),
        feet='FL_foot, FR_foot, RL_foot, RR_foot',
        imu_link='imu',
        foot_radius=0.022,
        legs=[1, 2, 3, 4],
    )
    assert robot.status().hardware_id == 'quadruped'


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'legs': [1, 2, 3]}, r'legs = \[1, 2, 3\]: 6 are needed'),
        ({'robot': 'ch3'}, "robot = 'ch3' .*is not allowed: .*ch3r"),
        ({'gyro_noise': 2.0}, 'gyro_noise = 2.0 is not allowed: a number from .* to 1 rad/s'),
        ({'mapping': 'go9'}, "no mapping named 'go9'"),
        ({'mapping': 'go2'}, "mapping = 'go2' is not allowed"),
    ],
)
def test_bad_parameters_are_named(context, parameters, message):
    with pytest.raises(ConfigError, match=message):
        BodyEstimatorNode(context=context, parameter_overrides=overrides(parameters))


# --- any messages -------------------------------------------------------------------------------

numbers = st.one_of(
    st.floats(),
    st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 1e308, -1e308, 9.81, 1e5]),
)
stamps = st.one_of(
    st.integers(0, 400).map(lambda ms: (0, ms * 1_000_000)),
    st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
)
names = st.one_of(
    st.just(list(CH3R.joint_names)),
    st.lists(st.text('abc', max_size=3), max_size=20),
    st.just([*CH3R.joint_names, CH3R.joint_names[0]]),
)


def stamped(message, stamp):
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    return message


def imu_of(stamp, values):
    message = stamped(Imu(), stamp)
    vectors = message.angular_velocity, message.linear_acceleration
    for vector, three in zip(vectors, (values[:3], values[3:]), strict=True):
        vector.x, vector.y, vector.z = three
    message.linear_acceleration_covariance[0] = values[0]
    return message


def joints_of(stamp, given, lengths, values):
    parts = {
        part: [values[place % len(values)] for place in range(length)]
        for part, length in zip(('position', 'velocity', 'effort'), lengths, strict=True)
    }
    return stamped(JointState(name=given, **parts), stamp)


def forces_of(stamp, values):
    block = record(SAMPLE, stamp[0] * 1_000_000_000 + stamp[1], 6, force=values[:3])
    block.rows['force'][0, 0] = values[3:]
    return block


six = st.lists(numbers, min_size=6, max_size=6)
lengths = st.tuples(*[st.sampled_from([0, 1, 18, 19])] * 3)
INPUTS = (topics.FORCE, topics.IMU, topics.JOINT_STATES)
messages = st.lists(
    st.one_of(
        st.builds(imu_of, stamps, six).map(lambda m: (topics.IMU, m)),
        st.builds(joints_of, stamps, names, lengths, six).map(lambda m: (topics.JOINT_STATES, m)),
        st.builds(forces_of, stamps, six).map(lambda m: (topics.FORCE, m)),
        st.tuples(st.sampled_from(INPUTS), st.binary(max_size=200)),
    ),
    min_size=1,
    max_size=60,
)


@pytest.mark.parametrize('simulated', [False, True])
def test_no_messages_stop_the_node_and_nothing_that_is_not_finite_is_published(robot, simulated):
    """Afterwards it estimates a robot that stands; its clock may have been set back."""
    node = robot.start(use_sim_time=simulated)

    @settings(max_examples=25, deadline=None)
    @given(sequence=messages)
    def survives(sequence):
        robot.bench.sent.clear()
        for topic, message in sequence:
            robot.bench.give(topic, message)
        before = node.stage.samples
        robot.stand(400)
        assert node.stage.samples > before
        for block in robot.bench.heard(topics.SAMPLE):
            assert not np.isinf(block.rows['force']).any()
            assert not np.isinf(block.rows['position']).any()
        for odom in robot.bench.heard(topics.ODOM):
            assert np.isfinite(odom.pose.covariance).all()

    set_logger_level('body_estimator', LoggingSeverity.FATAL)
    try:
        survives()
    finally:
        set_logger_level('body_estimator', LoggingSeverity.UNSET)
