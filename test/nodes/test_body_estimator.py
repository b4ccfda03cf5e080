# SPDX-License-Identifier: Apache-2.0
"""The body estimator node on messages of a robot that stands."""

import importlib.util
import math

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from rclpy.logging import LoggingSeverity
from rclpy.logging import set_logger_level
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from ros_pad.errors import ConfigError
from ros_pad.nodes import topics
from ros_pad.nodes.body_estimator import BodyEstimatorNode
from ros_pad.nodes.stamps import set_stamp
from ros_pad.robots import Robot as Kinematics

LEGS = (1, 2, 3, 4, 5, 6)
CH3R = Kinematics.load('ch3r')
SHARE = CH3R.mass * 9.81 / 6.0
OUT = (topics.WRENCH, topics.POSITION, topics.CONTACT_VELOCITY)


class Robot:
    """Publishes IMU, joints and forces of a CH3-R that stands, and records what comes back."""

    def __init__(self, context, executor, until):
        self.node = Node('robot', context=context)
        executor.add_node(self.node)
        self._context, self._executor, self.until = context, executor, until
        self.received = {topics.ODOM.name(): [], topics.BODY_DOUBT.name(): []}
        topics.ODOM.subscription(self.node, self.received['odom'].append)
        topics.BODY_DOUBT.subscription(self.node, self.received['body/doubt'].append)
        for topic in OUT:
            self.received[topic.name(2)] = []
            topic.subscription(self.node, self.received[topic.name(2)].append, 2)
        self.status = []
        topics.DIAGNOSTICS.subscription(self.node, self.status.append)
        self._imu = topics.IMU.publisher(self.node)
        self._joints = topics.JOINT_STATES.publisher(self.node)
        self._forces = [topics.FOOT_WRENCH.publisher(self.node, leg) for leg in LEGS]
        self._clock = topics.CLOCK.publisher(self.node)
        self.estimator = None

    def start(self, **parameters):
        self.estimator = BodyEstimatorNode(
            context=self._context,
            parameter_overrides=[
                Parameter(name, value=value)
                for name, value in ({'use_sim_time': True} | parameters).items()
            ],
        )
        self._executor.add_node(self.estimator)
        publishers = [self._imu, self._joints, *self._forces]
        self.until(
            lambda: (
                all(each.get_subscription_count() for each in publishers)
                and self._clock.get_subscription_count() == 2
                and all(self.node.count_publishers(name) for name in self.received)
            )
        )
        return self.estimator

    def tick_until(self, seconds):
        """Advance the simulated time from 0 in steps of 0.1 s."""
        for number in range(1, round(10 * seconds) + 1):
            message = topics.CLOCK.message()
            set_stamp(message.clock, number * 100_000_000)
            self._clock.publish(message)
            self.until(
                lambda n=number: self.estimator.get_clock().now().nanoseconds == n * 100_000_000
            )

    def forces(self, ms, frame='leg_{leg}_foot'):
        for leg, publisher in zip(LEGS, self._forces, strict=True):
            message = WrenchStamped()
            message.header.frame_id = frame.format(leg=leg)
            set_stamp(message.header.stamp, ms * 1_000_000)
            message.wrench.force.z = SHARE
            publisher.publish(message)

    def imu(self, ms, covariance=0.0, z=9.81):
        message = Imu()
        set_stamp(message.header.stamp, ms * 1_000_000)
        message.linear_acceleration.z = z
        message.angular_velocity_covariance[0] = covariance
        self._imu.publish(message)

    def joints(self, ms, names=CH3R.joint_names, **parts):
        message = JointState(name=list(names))
        set_stamp(message.header.stamp, ms * 1_000_000)
        given = {'position': CH3R.home.ravel(), 'velocity': np.zeros(18), 'effort': []} | parts
        for part, values in given.items():
            setattr(message, part, [float(each) for each in values])
        self._joints.publish(message)

    def stand(self, until_ms, first_ms=20, **parts):
        """Stand up to a time; the first sample is used when five readings were calm."""
        for ms in range(4, until_ms + 1, 4):
            forces = self.estimator.forces + 6
            self.forces(ms)
            self.until(lambda forces=forces: self.estimator.forces == forces)
            self.imu(ms)
            self.joints(ms, **parts)
            if ms >= first_ms:
                samples = (ms - first_ms) // 4 + 1
                self.until(lambda samples=samples: self.estimator.stage.samples == samples)


@pytest.fixture
def robot(context, executor, until):
    robot = Robot(context, executor, until)
    yield robot
    if robot.estimator:
        robot.estimator.destroy_node()


def test_a_standing_robot(robot):
    robot.start()
    robot.stand(600)
    robot.until(lambda: len(robot.received['odom']) == robot.estimator.stage.samples == 146)
    odom = robot.received['odom'][-1]
    assert (odom.header.frame_id, odom.child_frame_id) == ('odom', 'base_link')
    assert odom.header.stamp.nanosec == 600_000_000
    place, turn = odom.pose.pose.position, odom.pose.pose.orientation
    assert [place.x, place.y, place.z] == pytest.approx([0.0] * 3, abs=1e-3)
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-3)
    assert odom.twist.twist.linear.x == pytest.approx(0.0, abs=1e-3)
    for part in (odom.pose, odom.twist):
        matrix = part.covariance.reshape(6, 6)
        assert np.allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    wrench, position, velocity = (robot.received[topic.name(2)][-1] for topic in OUT)
    force, point = wrench.wrench.force, position.point
    assert [force.x, force.y, force.z] == pytest.approx([0.0, 0.0, SHARE], abs=0.05)
    # Leg 2 points to the left: 0.138 m of hip, 29 and 57 mm of links, and 141 mm down.
    assert [point.x, point.y, point.z] == pytest.approx([0.0, 0.224, -0.141], abs=2e-3)
    assert position.header.frame_id == velocity.header.frame_id == 'odom'
    assert wrench.header.stamp == position.header.stamp == velocity.header.stamp
    assert velocity.twist.twist.linear.x == pytest.approx(0.0, abs=1e-3)
    variances = velocity.twist.covariance[0], velocity.twist.covariance[7]
    assert variances[0] == variances[1]
    assert 1e-8 < variances[0] < 1e-3
    assert robot.received['body/doubt'][-1].data == ''


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
    estimator = BodyEstimatorNode(
        context=robot._context,
        parameter_overrides=[Parameter('mapping', value=str(file))],
    )
    robot.estimator = estimator
    robot._executor.add_node(estimator)
    types = {'robot/imu': Imu, 'robot/motors': JointState, 'robot/loads': Float64MultiArray}
    imu, motors, loads = (
        robot.node.create_publisher(kind, topic, 10) for topic, kind in types.items()
    )
    robot.until(lambda: all(each.get_subscription_count() for each in (imu, motors, loads)))
    assert not robot._imu.get_subscription_count()
    message = JointState(name=list(CH3R.joint_names), velocity=[0.0] * 18)
    message.position = CH3R.home.ravel().tolist()
    upside_down = Imu()
    upside_down.linear_acceleration.z = -9.81
    doubts = robot.received['body/doubt']

    def stands():
        """Publish one sample of each topic; return whether the motion is known."""
        loads.publish(Float64MultiArray(data=[2.0 * SHARE] * 6))
        now_ns = estimator.get_clock().now().nanoseconds
        for each, publisher in ((upside_down, imu), (message, motors)):
            set_stamp(each.header.stamp, now_ns)
            publisher.publish(each)
        known = doubts and doubts[-1].data.startswith('friction: unobservable')
        return known and len(robot.received['odom']) > 10

    # Contact is known, but nothing can be learnt about friction.
    robot.until(stands, what='an estimate')
    turn = robot.received['odom'][-1].pose.pose.orientation
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-2)
    force = robot.received[topics.WRENCH.name(2)][-1].wrench.force
    assert [force.x, force.y, force.z] == pytest.approx([0.0, 0.0, SHARE], abs=0.05)
    velocity = robot.received[topics.CONTACT_VELOCITY.name(2)][-1]
    assert velocity.twist.covariance[0] == -1.0


@pytest.mark.parametrize(
    ('mapping', 'message'),
    [('go9', "no mapping named 'go9'"), ('go2', 'parameter mapping = ')],
)
def test_a_mapping_that_does_not_fit_is_refused(context, mapping, message):
    with pytest.raises(ConfigError, match=message):
        BodyEstimatorNode(
            context=context, parameter_overrides=[Parameter('mapping', value=mapping)]
        )


def test_joints_are_matched_by_name(robot):
    robot.start()
    order = [*reversed(range(18))]
    names = ['head', *(CH3R.joint_names[place] for place in order)]
    positions = [7.0, *CH3R.home.ravel()[order]]
    robot.stand(40, names=names, position=positions, velocity=np.zeros(19))
    point = robot.received['leg_2/position'][-1].point
    assert [point.x, point.y, point.z] == pytest.approx([0.0, 0.224, -0.141], abs=2e-3)


def test_velocities_may_be_missing(robot):
    robot.start()
    robot.stand(40, 24, velocity=[])  # the first positions have none before them
    robot.tick_until(0.2)
    robot.until(lambda: robot.status)
    (status,) = [each for each in robot.status[-1].status if each.name.endswith('sensing')]
    values = {each.key: each.value for each in status.values}
    assert values['joint velocities'] == 'from positions'
    assert values['forces'] == 'feet'


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda robot, ms: robot.imu(ms, covariance=-1.0), 'angular_velocity_covariance'),
        (lambda robot, ms: robot.imu(ms, z=math.nan), 'accelerometer = nan'),
        (lambda robot, ms: robot.joints(ms, CH3R.joint_names[1:]), 'without leg_1_coxa'),
        (lambda robot, ms: robot.joints(ms, position=[0.0] * 17), '17 values in position'),
        (lambda robot, ms: robot.joints(ms, effort=[0.0]), '1 values in effort'),
        (lambda robot, ms: robot.forces(ms, 'leg_3_foot'), 'leg_3_foot'),
    ],
)
def test_bad_messages_are_refused_with_the_reason(robot, spoil, reason):
    node = robot.start()
    robot.stand(40)
    samples = node.stage.samples
    refused = []
    report = node.stage._reject
    node.stage._reject = lambda error: refused.append(str(error)) or report(error)
    spoil(robot, 44)
    robot.until(lambda: refused)
    assert reason in refused[0]
    assert node.stage.samples == samples
    robot.tick_until(1.0)
    assert robot.received['body/doubt'][-1].data.startswith('reading refused: ')
    robot.until(lambda: robot.status)
    assert any(
        status.message.startswith('reading refused') and status.level == status.WARN
        for status in robot.status[-1].status
    )


def test_the_source_of_the_forces_is_reported_once(robot, capfd):
    robot.start()
    for ms in range(4, 41, 4):
        robot.imu(ms)
        robot.joints(ms, effort=np.zeros(18))
    robot.until(lambda: robot.estimator.stage.last_ns == 40_000_000)
    robot.tick_until(0.2)
    robot.until(lambda: robot.status)
    (status,) = [each for each in robot.status[-1].status if each.name.endswith('sensing')]
    assert 'efforts' in [each.value for each in status.values if each.key == 'forces']
    assert capfd.readouterr().err.count('forces of the feet: from the efforts of the joints') == 1


def test_neither_forces_nor_efforts(robot):
    robot.start(forces='efforts')
    robot.stand(40)
    robot.until(lambda: robot.received['leg_2/contact_velocity'])
    assert robot.received['body/doubt'][-1].data == 'force: neither foot forces nor efforts'
    assert robot.received['leg_2/contact_velocity'][-1].twist.covariance[0] == -1.0


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'legs': [1, 2, 3]}, r"legs = \[1, 2, 3\] is not allowed: robot 'ch3r' has 6 legs"),
        ({'robot': 'ch3'}, "robot = 'ch3' is not allowed: .*ch3r"),
        ({'robot': 'ch3r', 'feet': 'a, b, c'}, "robot = 'ch3r' is not allowed: feet and imu"),
        ({'gyro_noise': 2.0}, 'gyro_noise = 2.0 is not allowed: a number from .* to 1 rad/s'),
        ({'forces': 'arms'}, "forces = 'arms' is not allowed"),
    ],
)
def test_bad_parameters_are_named(context, parameters, message):
    with pytest.raises(ConfigError, match=message):
        BodyEstimatorNode(
            context=context,
            parameter_overrides=[Parameter(key, value=each) for key, each in parameters.items()],
        )


@pytest.mark.skipif(importlib.util.find_spec('tf2_msgs') is not None, reason='tf2_msgs is there')
def test_a_transform_needs_tf2_msgs(context):
    with pytest.raises(ConfigError, match=r'publish_tf = True is not allowed.*tf2_msgs'):
        BodyEstimatorNode(
            context=context, parameter_overrides=[Parameter('publish_tf', value=True)]
        )


@pytest.mark.skipif(importlib.util.find_spec('tf2_msgs') is None, reason='needs tf2_msgs')
def test_the_transform_is_that_of_odom(robot):
    from tf2_msgs.msg import TFMessage

    transforms = []
    robot.node.create_subscription(TFMessage, '/tf', transforms.append, 10)
    robot.start(publish_tf=True)
    robot.until(lambda: robot.node.count_publishers('/tf'))
    robot.stand(40)
    robot.until(lambda: len(transforms) > 1)
    (transform,) = transforms[-1].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ('odom', 'base_link')
    odom = robot.received['odom'][-1]
    assert transform.transform.translation.x == odom.pose.pose.position.x
    assert transform.transform.rotation.w == odom.pose.pose.orientation.w


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


def force_of(stamp, frame, values):
    message = stamped(WrenchStamped(), stamp)
    message.header.frame_id = frame
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = values
    return message


six, three = (st.lists(numbers, min_size=count, max_size=count) for count in (6, 3))
lengths = st.tuples(*[st.sampled_from([0, 1, 18, 19])] * 3)
messages = st.lists(
    st.one_of(
        st.builds(imu_of, stamps, six).map(lambda m: ('/imu/data', m)),
        st.builds(joints_of, stamps, names, lengths, six).map(lambda m: ('/joint_states', m)),
        st.builds(
            force_of, stamps, st.sampled_from(['', 'leg_1_foot', 'leg_2_foot', 'x']), three
        ).map(lambda m: ('/leg_1/foot_wrench', m)),
        st.tuples(
            st.sampled_from(['/imu/data', '/joint_states', '/leg_1/foot_wrench']),
            st.binary(max_size=200),
        ),
    ),
    min_size=1,
    max_size=60,
)


def test_no_messages_stop_the_node_and_nothing_that_is_not_finite_is_published(context):
    """Afterwards it estimates a robot that stands; its clock may have been set back."""
    node = BodyEstimatorNode(context=context)
    published = []
    node._send = lambda *values: published.append(values)
    takers = {each.topic_name: each.callback for each in node.subscriptions}

    def stand():
        for ms in range(4, 400, 4):
            stamp = (0, ms * 1_000_000)
            for leg in LEGS:
                force = force_of(stamp, '', [0.0, 0.0, SHARE])
                takers[f'/leg_{leg}/foot_wrench'](serialize_message(force))
            takers['/imu/data'](serialize_message(imu_of(stamp, [0.0] * 5 + [9.81])))
            still = joints_of(stamp, list(CH3R.joint_names), (18, 18, 0), [0.0])
            takers['/joint_states'](serialize_message(still))

    @settings(max_examples=60, deadline=None)
    @given(sequence=messages)
    def survives(sequence):
        published.clear()
        for topic, message in sequence:
            takers[topic](message if isinstance(message, bytes) else serialize_message(message))
        before = node.stage.samples
        stand()
        assert np.isfinite(np.array(published)).all()
        assert node.stage.samples > before

    set_logger_level('body_estimator', LoggingSeverity.FATAL)
    try:
        survives()
    finally:
        set_logger_level('body_estimator', LoggingSeverity.UNSET)
        node.destroy_node()
