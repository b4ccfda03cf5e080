# SPDX-License-Identifier: Apache-2.0
"""What is said of topics on which nothing arrives."""

import pytest

from ros_pad.robots import Robot
from ros_pad.sensing import Mapping
from ros_pad.sensing.collector import Collector


@pytest.mark.parametrize(
    ('topics', 'advice'),
    [
        ({}, 'no topic has sensor_msgs/msg/Imu: does the driver run, in this namespace?'),
        ({'/imu/data': 'sensor_msgs/msg/Imu'}, 'it has a publisher, from which nothing was'),
        ({'/two/imu/data': 'sensor_msgs/msg/Imu'}, 'sensor_msgs/msg/Imu is on /two/imu/data: '),
    ],
)
def test_a_silent_topic(topics, advice):
    robot = Robot.load('go2')
    found = Collector(Mapping.load('default', robot), robot).findings(topics, lambda share: None)
    (silent,) = [each for each in found if each.what == 'imu/data']
    assert silent.advice.startswith(advice)
