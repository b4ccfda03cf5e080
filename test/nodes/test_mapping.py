# SPDX-License-Identifier: Apache-2.0
"""The body estimator node reads a robot through a mapping."""

import pathlib

import pytest

pytest.importorskip('rclpy')

from sensor_msgs.msg import Imu, JointState

from ros_pad.bags import BagReader, topics
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


VALUES = {
    'robot': str(EXAMPLE / 'robot.urdf'),
    'feet': 'FL_foot, FR_foot, RL_foot, RR_foot',
    'imu_link': 'imu',
    'foot_radius': 0.022,
    'legs': [1, 2, 3, 4],
    'use_sim_time': False,
}


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


def test_a_robot_with_faults_through_its_mapping(bench, tmp_path):
    (tmp_path / 'my.yaml').write_text(MAPPING)
    node = bench.start(BodyEstimatorNode, mapping=str(tmp_path / 'my.yaml'), **VALUES)
    by_type = {each.msg_type: each.callback for each in node.subscriptions}
    for message in messages():
        by_type[type(message)](message)
    # At rest, upright, with the fourth foot at the right of the rear.
    last = bench.heard(topics.ODOM)[-1].pose.pose
    assert abs(last.position.x) + abs(last.position.y) < 0.01
    assert last.orientation.w > 0.999
    assert bench.last(topics.SAMPLE)[3]['position'][:2] == pytest.approx(
        [-0.193, -0.142], abs=0.02
    )
    assert bench.heard(topics.BODY_DOUBT)[-1].data == ''
    assert node.stage.force_source == 'efforts'
