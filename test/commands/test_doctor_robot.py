# SPDX-License-Identifier: Apache-2.0
"""``pad doctor --robot`` on bags, and on live topics over DDS."""

import dataclasses
import functools
import heapq
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from ros_pad import cli
from ros_pad.robots import Robot
from studies.sensing import layouts

GO2 = Robot.load('go2')


@functools.cache
def log():
    pytest.importorskip('mujoco')
    return layouts.log_of('go2', 'dry', 3, 6.0)


@functools.cache
def standing():
    """Return a log of a robot that stands, which is as good on any machine."""
    values = {key: value[:490] for key, value in vars(log()).items()}
    return dataclasses.replace(log(), **values)


def bag(folder, *streams):
    return str(layouts.write(folder / 'bag', heapq.merge(*streams, key=lambda each: each[3])))


def doctor(capsys, *words):
    """Return exit status and findings, by what they are about."""
    status = cli.main(['doctor', '--json', *words])
    found = json.loads(capsys.readouterr().out)['findings']
    return status, {each['what']: each for each in found}


def plain(of):
    return layouts.imu(of), layouts.joint_states(of, GO2.joint_names)


def test_a_bag_without_faults(tmp_path, capsys):
    path = bag(tmp_path, *plain(log()), layouts.wrenches(log(), GO2))
    status, found = doctor(capsys, '--robot', 'go2', '--bag', path)
    assert (status, found['sensors']['status']) == (0, 'ok')
    assert found['leg_4/foot_wrench']['found'] == '1500 messages'
    assert 'forces' not in found
    assert {each['status'] for each in found.values()} <= {'ok', 'warning'}


def test_a_robot_without_masses_is_a_problem(tmp_path, capsys):
    path = bag(tmp_path, *plain(standing()), layouts.wrenches(standing(), GO2))
    description = tmp_path / 'light.urdf'
    description.write_text(re.sub('<mass[^>]*/>', '', layouts.urdf(GO2)))
    feet = [f'{leg}_foot' for leg in GO2.legs]
    words = ['--robot', str(description), '--feet', *feet, '--imu', 'imu', '--bag', path]
    status, found = doctor(capsys, *words)
    assert (status, found['robot']['status']) == (1, 'problem')
    assert 'no mass' in found['robot']['found'] and '<inertial>' in found['robot']['found']


def test_a_bag_with_a_fault_in_its_gyro(tmp_path, capsys):
    wrong = dataclasses.replace(log(), gyro=log().gyro * (1.0, 1.0, -1.0))
    status, found = doctor(capsys, '--robot', 'go2', '--bag', bag(tmp_path, *plain(wrong)))
    assert (status, found['gyro']['status']) == (1, 'problem')
    assert 'is on [x, y, -z]' in found['gyro']['found']
    assert 'foot' not in ' '.join(found)  # efforts give the forces
    assert found['forces']['found'].startswith('from the efforts of the joints')


def test_messages_of_a_go2_need_no_package(tmp_path, capsys):
    path = bag(tmp_path, layouts.low_state(log(), GO2))
    words = ['--robot', 'go2', '--mapping', 'go2', '--bag', path]
    status, found = doctor(capsys, *words)
    assert status == 0
    assert found['lowstate']['found'] == '1500 messages'
    assert found['force']['found'].startswith('from estimated torques')  # as the mapping says
    status, found = doctor(capsys, *words, '--seconds', '2')
    assert found['lowstate']['found'] == '501 messages'


def test_silent_topics_and_names_that_do_not_fit(tmp_path, capsys):
    imu = layouts.imu(standing(), '/my_imu')
    names = [f'{name}s' for name in GO2.joint_names]
    path = bag(tmp_path, imu, layouts.joint_states(standing(), names))
    status, found = doctor(capsys, '--robot', 'go2', '--bag', path)
    assert status == 1
    assert found['imu/data']['status'] == 'problem'
    assert 'no message; sensor_msgs/msg/Imu is on /my_imu' in found['imu/data']['found']
    assert "'FL_hip_joint' is not among" in found['joint_states']['found']
    assert found['leg_1/foot_wrench']['found'].startswith('no message')


def test_a_namespace(tmp_path, capsys):
    def moved(stream):
        return ((f'/robot_1{topic}', *rest) for topic, *rest in stream)

    path = bag(tmp_path, *map(moved, plain(standing())))
    words = ['--robot', 'go2', '--bag', path]
    assert doctor(capsys, *words)[0] == 1
    status, found = doctor(capsys, *words, '--namespace', '/robot_1')
    assert (status, found['imu/data']['status']) == (0, 'ok')


# Publishes a log at its rate until it is stopped.
PUBLISHER = """
import sys, time
import numpy as np
import rclpy
from sensor_msgs.msg import Imu, JointState
values = np.load(sys.argv[1])
names = [str(name) for name in values['names']]
rclpy.init()
node = rclpy.create_node('robot')
imu = node.create_publisher(Imu, 'imu/data', 10)
joints = node.create_publisher(JointState, 'joint_states', 10)
start, tick = time.time_ns(), 0
while True:
    place = tick % len(values['time'])
    stamp = start + tick * 4_000_000
    wait = (stamp - time.time_ns()) * 1e-9
    if wait > 0:
        time.sleep(wait)
    one, other = Imu(), JointState(name=names)
    for message in (one, other):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    for field, key in ((one.angular_velocity, 'gyro'), (one.linear_acceleration, 'pull')):
        field.x, field.y, field.z = values[key][place].tolist()
    other.position = values['q'][place].tolist()
    other.velocity = values['dq'][place].tolist()
    other.effort = values['efforts'][place].tolist()
    imu.publish(one)
    joints.publish(other)
    tick += 1
"""


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """Let a robot that stands, without gravity, publish its messages."""
    pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    path = tmp_path / 'log.npz'
    of = standing()
    np.savez(
        path,
        time=of.time,
        gyro=of.gyro,
        pull=of.accelerometer - (0.0, 0.0, 9.81),
        q=of.joint_positions,
        dq=of.joint_velocities,
        efforts=of.efforts,
        names=np.array(GO2.joint_names),
    )
    child = subprocess.Popen([sys.executable, '-c', PUBLISHER, str(path)])
    yield child
    child.terminate()
    child.wait(10.0)


def test_topics_that_nobody_publishes(monkeypatch, capsys):
    pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    status, found = doctor(capsys, '--robot', 'go2', '--seconds', '1')
    assert status == 1
    assert found['imu/data']['found'] == 'no message; sensor_msgs/msg/Imu is on no topic'


def test_live_topics(robot, capsys):
    # A slow machine has gaps, which are found too, and takes long to start a publisher.
    for _ in range(10):
        status, found = doctor(capsys, '--robot', 'go2', '--seconds', '3')
        assert robot.poll() is None
        if 'accelerometer' in found:
            break
    assert status == 1
    assert 'no gravity' in found['accelerometer']['found']
    assert found['joint_states']['status'] == 'ok'
    words = ['--robot', 'go2', '--mapping', 'go2', '--seconds', '1']
    assert cli.main(['doctor', *words]) == 2
    assert 'source its workspace' in capsys.readouterr().err
