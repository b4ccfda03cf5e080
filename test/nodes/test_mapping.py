# SPDX-License-Identifier: Apache-2.0
"""The body estimator node reads a robot through a mapping."""

import pathlib

import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ros_pad.bags import BagReader
from ros_pad.errors import ConfigError
from ros_pad.nodes import qos
from ros_pad.nodes.body_estimator import BodyEstimatorNode

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / 'bags' / 'quadruped'

# What the tutorial of an own robot finds.
MAPPING = """
topics:
  imu/data:
    type: sensor_msgs/msg/Imu
    stamp: header.stamp
    gyro: {field: angular_velocity.xyz, axes: [-y, x, z]}
    accelerometer: {field: linear_acceleration.xyz, axes: [-y, x, z]}
  joint_states:
    type: sensor_msgs/msg/JointState
    stamp: header.stamp
    joints:
      names: name
      positions: position
      velocities: velocity
      efforts: effort
      reversed: [RR_calf_joint]
"""


def started(context, mapping):
    values = {
        'robot': str(EXAMPLE / 'robot.urdf'),
        'feet': 'FL_foot, FR_foot, RL_foot, RR_foot',
        'imu_link': 'imu',
        'foot_radius': 0.022,
        'legs': [1, 2, 3, 4],
        'mapping': str(mapping),
    }
    given = [Parameter(name, value=value) for name, value in values.items()]
    return BodyEstimatorNode(context=context, parameter_overrides=given)


def messages():
    """Yield the first second of the example's messages, as rclpy has them."""
    for topic, given, at in BagReader(EXAMPLE / 'bag').messages():
        made = Imu() if topic == '/imu/data' else JointState()
        made.header.stamp.sec = given.header.stamp.sec
        made.header.stamp.nanosec = given.header.stamp.nanosec
        if topic == '/imu/data':
            for name in ('angular_velocity', 'linear_acceleration'):
                place, values = getattr(made, name), getattr(given, name)
                place.x, place.y, place.z = values.x, values.y, values.z
        else:
            made.name, made.position = list(given.name), given.position.tolist()
            made.velocity, made.effort = given.velocity.tolist(), given.effort.tolist()
        yield made
        if at > 1_700_000_001_000_000_000:
            return


def test_a_robot_with_faults_through_its_mapping(context, executor, until, tmp_path):
    (tmp_path / 'my.yaml').write_text(MAPPING)
    node = started(context, tmp_path / 'my.yaml')
    robot = Node('robot', context=context)
    executor.add_node(node)
    executor.add_node(robot)
    found, feet, doubts = [], [], []
    robot.create_subscription(Odometry, 'odom', found.append, qos.SENSOR)
    robot.create_subscription(PointStamped, 'leg_4/position', feet.append, qos.SENSOR)
    robot.create_subscription(String, 'body/doubt', doubts.append, qos.STATE)
    send = {
        Imu: robot.create_publisher(Imu, 'imu/data', 100),
        JointState: robot.create_publisher(JointState, 'joint_states', 100),
    }
    until(lambda: all(each.get_subscription_count() for each in send.values()))
    until(lambda: robot.count_publishers('odom') and robot.count_publishers('leg_4/position'))
    for count, message in enumerate(messages()):
        send[type(message)].publish(message)
        # Few are under way at a time; the first readings only show that the robot is calm.
        until(lambda wanted=count // 2 - 6: node.stage.samples >= wanted, what='samples')
    until(lambda: found and feet and doubts)
    # At rest, upright, with the fourth foot at the right of the rear.
    last = found[-1].pose.pose
    assert abs(last.position.x) + abs(last.position.y) < 0.01
    assert last.orientation.w > 0.999
    assert feet[-1].point.x == pytest.approx(-0.193, abs=0.02)
    assert feet[-1].point.y == pytest.approx(-0.142, abs=0.02)
    assert doubts[-1].data == ''
    values = {each.key: each.value for each in node._status().values}
    assert values['forces'] == 'efforts'


@pytest.mark.parametrize(
    ('mapping', 'words'),
    [
        ('my', "parameter mapping = 'my' is not allowed: no mapping named 'my'"),
        ('go2', 'ros2 interface show unitree_go/msg/LowState'),
    ],
)
def test_mappings_that_cannot_be_used(context, mapping, words):
    with pytest.raises(ConfigError) as caught:
        started(context, mapping)
    assert words in str(caught.value)
