# SPDX-License-Identifier: Apache-2.0
"""Logs of simulated robots as bags in the messages of other robots, whose types are in the bag.

``python -m studies.sensing.layouts FOLDER`` makes the example of docs/tutorials/own_robot.md.
"""

from __future__ import annotations

import functools
import heapq
import pathlib
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mcap.records import Channel, Schema

from ros_pad.bags import BagWriter
from ros_pad.bags.codec import MessageType
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from studies.sensing.walks import Course, Log, walk

_PARTS = pathlib.Path(__file__).with_suffix('.msg').read_text('utf-8').split('>>> ')[1:]
DEFINITIONS = {
    name: text.rstrip('\n') for name, _, text in (part.partition('\n') for part in _PARTS)
}
"""Layouts of messages, by type, of layouts.msg."""

START = 1_700_000_000_000_000_000  # ns, first stamp of every bag
GO2_MOTORS = ('FR', 'FL', 'RR', 'RL')
LOAD = 30.0  # N, from which a foot is in contact


@functools.cache
def message_type(name: str) -> MessageType:
    """Return one of the message types above."""
    return MessageType(name, DEFINITIONS[name])


def blank(name: str, stamp: int | None = None) -> Any:
    """Return a message of zeros, with a stamp in ns where it has one."""
    message = message_type(name).blank()
    if stamp is not None:
        place = message.header.stamp if hasattr(message, 'header') else message.stamp
        place.sec, place.nanosec = divmod(stamp, 1_000_000_000)
    return message


def write(folder: pathlib.Path, messages: Iterator[tuple[str, str, Any, int]]) -> pathlib.Path:
    """Write a bag of messages: topic, type, message, log time in ns; return its folder."""
    known = set()
    with BagWriter(folder) as bag:
        for topic, name, message, stamp in messages:
            if topic not in known:
                known.add(topic)
                text = DEFINITIONS[name].encode()
                schema = Schema(id=0, name=name, encoding='ros2msg', data=text)
                channel = Channel(
                    id=0, topic=topic, message_encoding='cdr', metadata={}, schema_id=0
                )
                bag.copy_topic(channel, schema)
            bag.write(topic, message_type(name).encode(message), stamp)
    return folder


def log_of(robot: str, floor: str, seed: int, seconds: float) -> Log:
    """Return a log of a shipped robot: two seconds at rest, then a walk."""
    return walk(Course(robot, floor), seed, seconds)


def stamps(log: Log) -> list[int]:
    """Return the stamps of a log, ns."""
    return [START + round(time * 1e9) for time in log.time.tolist()]


def imu(log: Log, topic: str = '/imu/data') -> Iterator[tuple[str, str, Any, int]]:
    """Yield sensor_msgs/Imu."""
    for stamp, gyro, accelerometer in zip(stamps(log), log.gyro, log.accelerometer, strict=True):
        message = blank('sensor_msgs/msg/Imu', stamp)
        _fill(message.angular_velocity, gyro)
        _fill(message.linear_acceleration, accelerometer)
        yield topic, 'sensor_msgs/msg/Imu', message, stamp


def joint_states(log: Log, names: Sequence[str]) -> Iterator[tuple[str, str, Any, int]]:
    """Yield sensor_msgs/JointState, with the joints in reverse order, and one of an arm."""
    for tick, stamp in enumerate(stamps(log)):
        message = blank('sensor_msgs/msg/JointState', stamp)
        message.name = ['arm', *reversed(names)]
        message.position = np.append(0.0, log.joint_positions[tick][::-1])
        message.velocity = np.append(0.0, log.joint_velocities[tick][::-1])
        message.effort = np.append(0.0, log.efforts[tick][::-1])
        yield '/joint_states', 'sensor_msgs/msg/JointState', message, stamp


def wrenches(log: Log, robot: Robot) -> Iterator[tuple[str, str, Any, int]]:
    """Yield geometry_msgs/WrenchStamped of each foot, in the axes of its link."""
    for tick, stamp in enumerate(stamps(log)):
        turns = robot.kinematics(log.joint_positions[tick]).rotations
        forces = (turns.transpose(0, 2, 1) @ log.foot_forces[tick][..., None])[..., 0]
        for leg, force in enumerate(forces, 1):
            message = blank('geometry_msgs/msg/WrenchStamped', stamp)
            _fill(message.wrench.force, force)
            yield f'/leg_{leg}/foot_wrench', 'geometry_msgs/msg/WrenchStamped', message, stamp


def low_state(log: Log, robot: Robot) -> Iterator[tuple[str, str, Any, int]]:
    """Yield unitree_go/LowState of a quadruped; the stamp is in the counter alone."""
    order = _motors(robot)
    for tick, stamp in enumerate(stamps(log)):
        message = blank('unitree_go/msg/LowState')
        message.tick = 123_000 + round(log.time[tick] * 1e3)
        message.imu_state.gyroscope[:] = log.gyro[tick]
        message.imu_state.accelerometer[:] = log.accelerometer[tick]
        for motor, joint in zip(message.motor_state, order, strict=False):
            motor.q = log.joint_positions[tick, joint]
            motor.dq = log.joint_velocities[tick, joint]
            motor.tau_est = log.efforts[tick, joint]
        yield '/lowstate', 'unitree_go/msg/LowState', message, stamp


def sport_state(log: Log, robot: Robot) -> Iterator[tuple[str, str, Any, int]]:
    """Yield unitree_go/SportModeState of a quadruped: feet in the body, loads as whole numbers."""
    order = [robot.legs.index(leg) for leg in GO2_MOTORS]
    for tick, stamp in enumerate(stamps(log)):
        message = blank('unitree_go/msg/SportModeState', stamp)
        message.imu_state.gyroscope[:] = log.gyro[tick]
        message.imu_state.accelerometer[:] = log.accelerometer[tick]
        places, speeds = feet_in_body(robot, log, tick)
        message.foot_position_body[:] = places[order].ravel()
        message.foot_speed_body[:] = speeds[order].ravel()
        message.foot_force[:] = np.round(log.foot_forces[tick, order, 2])
        yield '/sportmodestate', 'unitree_go/msg/SportModeState', message, stamp


def spot_feet(log: Log, robot: Robot) -> Iterator[tuple[str, str, Any, int]]:
    """Yield spot_msgs/FootStateArray, whose messages have no stamp."""
    for tick, stamp in enumerate(stamps(log)):
        message = blank('spot_msgs/msg/FootStateArray')
        for leg, place in enumerate(feet_in_body(robot, log, tick)[0]):
            state = message_type('spot_msgs/msg/FootStateArray').blank('spot_msgs/msg/FootState')
            _fill(state.foot_position_rt_body, place)
            state.contact = 1 if log.foot_forces[tick, leg, 2] > LOAD else 2
            message.states.append(state)
        yield '/status/feet', 'spot_msgs/msg/FootStateArray', message, stamp


def feet_in_body(robot: Robot, log: Log, tick: int) -> tuple[Array, Array]:
    """Return places and speeds of the feet in the body, (legs, 3), m and m/s."""
    found = robot.kinematics(log.joint_positions[tick])
    speeds = log.joint_velocities[tick].reshape(robot.home.shape)
    return found.positions, (found.jacobians @ speeds[..., None])[..., 0]


def _motors(robot: Robot) -> list[int]:
    """Return the joints of the robot in the order of the motors."""
    return [
        robot.joint_names.index(f'{leg}_{joint}_joint')
        for leg in GO2_MOTORS
        for joint in ('hip', 'thigh', 'calf')
    ]


def _fill(place: Any, values: Array) -> None:
    place.x, place.y, place.z = values.tolist()


def urdf(robot: Robot) -> str:
    """Return the URDF of a robot whose joints have no rotation at zero."""
    trunk = robot.mass - sum(joint.mass for leg in robot.chains.legs for joint in leg)
    lines = [_link('base_link', trunk, np.zeros(3)), '  <link name="imu"/>']
    lines.append(_fixed('imu', 'base_link', robot.imu[:3, 3]))
    for leg, joints, foot in zip(robot.legs, robot.chains.legs, robot.chains.feet, strict=True):
        parent = 'base_link'
        for joint in joints:
            link = joint.name.removesuffix('_joint')
            lines.append(_link(link, joint.mass, joint.centre))
            lines.append(
                f'  <joint name="{joint.name}" type="revolute">{_origin(joint.at[:3, 3])}\n'
                f'    <parent link="{parent}"/><child link="{link}"/>'
                f'<axis xyz="{_words(joint.axis)}"/>\n'
                '    <limit lower="-3" upper="3" effort="40" velocity="30"/></joint>'
            )
            parent = link
        lines.append(f'  <link name="{leg}_foot"/>')
        lines.append(_fixed(f'{leg}_foot', parent, foot[:3, 3]))
    about = '<!-- A quadruped with the dimensions and masses of config/robots/go2.yaml. -->'
    return '\n'.join(['<robot name="quadruped">', about, *lines, '</robot>', ''])


def _link(name: str, mass: float, centre: Array) -> str:
    return (
        f'  <link name="{name}"><inertial>{_origin(centre)}<mass value="{mass:.6g}"/>'
        '</inertial></link>'
    )


def _fixed(name: str, parent: str, place: Array) -> str:
    return (
        f'  <joint name="{name}_fixed" type="fixed">{_origin(place)}\n'
        f'    <parent link="{parent}"/><child link="{name}"/></joint>'
    )


def _origin(place: Array) -> str:
    return f'<origin xyz="{_words(place)}"/>'


def _words(values: Array) -> str:
    return ' '.join(f'{value:.6g}' for value in values)


def example(folder: pathlib.Path) -> None:
    """Write the URDF of a quadruped, and a bag of it with faults.

    The IMU is turned by 90 degrees about z, and one joint is reversed. Readings have the steps of
    real sensors.
    """
    robot = Robot.load('go2')
    log = log_of('go2', 'dry', 3, 8.0)
    turn = np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    signs = np.where(np.array(robot.joint_names) == 'RR_calf_joint', -1.0, 1.0)
    log.gyro = np.round(log.gyro @ turn.T, 3)
    log.accelerometer = np.round(log.accelerometer @ turn.T, 2)
    log.joint_positions = np.round(log.joint_positions * signs, 4)
    log.joint_velocities = np.round(log.joint_velocities * signs, 2)
    log.efforts = np.round(log.efforts * signs, 2)
    folder.mkdir()
    (folder / 'robot.urdf').write_text(urdf(robot), encoding='utf-8')
    messages = (imu(log), joint_states(log, robot.joint_names))
    write(folder / 'bag', heapq.merge(*messages, key=lambda each: each[3]))


if __name__ == '__main__':
    example(pathlib.Path(sys.argv[1]))
