# SPDX-License-Identifier: Apache-2.0
"""Readings from messages of other robots' layouts, and the estimates from them."""

import dataclasses
import functools
import heapq
from types import SimpleNamespace

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.bags import BagReader
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Robot
from ros_pad.sensing import Mapping
from studies.sensing import layouts

GO2 = Robot.load('go2')
FEET = Robot.load('go2_feet')
# The same robot with the names of ANYmal's joints and legs.
ANYMAL = dataclasses.replace(
    GO2,
    legs=('LF', 'RF', 'LH', 'RH'),
    joint_names=tuple(
        f'{leg}_{joint}' for leg in ('LF', 'RF', 'LH', 'RH') for joint in ('HAA', 'HFE', 'KFE')
    ),
)
WEIGHT = GO2.mass * 9.81


@functools.cache
def log():
    """Return a log of a quadruped: 2 s at rest, 1 s of walking."""
    pytest.importorskip('mujoco')
    return layouts.log_of('go2', 'dry', 3, 3.0)


def as_float32(values):
    return values.astype(np.float32).astype(float)


def by_time(*streams):
    return heapq.merge(*streams, key=lambda each: each[3])


def readings(tmp_path, name, robot, *streams):
    """Write a bag of messages, and return the mapping and what it reads from them."""
    mapping = Mapping.load(name, robot)
    bag = BagReader(layouts.write(tmp_path / 'bag', by_time(*streams)))
    found = [mapping.read(topic, message, at) for topic, message, at in bag.messages()]
    assert set(bag.topics) <= {f'/{source.topic}' for source in mapping.sources}
    return mapping, found


def column(found, kind):
    """Return the readings of one kind, of each moment of the log."""
    values = [getattr(each, kind) for each in found if getattr(each, kind) is not None]
    assert len(values) == len(log().time) == 750
    return np.array(values)


def forces(found):
    """Return the forces of all feet, (moments, 4, 3), N."""
    rows = [[each.forces[leg] for each in found if leg in each.forces] for leg in range(4)]
    return np.array(rows).swapaxes(0, 1)


def test_joint_states_and_wrenches(tmp_path):
    streams = [layouts.imu(log()), layouts.joint_states(log(), GO2.joint_names)]
    mapping, found = readings(tmp_path, 'default', GO2, *streams, layouts.wrenches(log(), GO2))
    assert (mapping.missing, mapping.force_axes, mapping.force_kind) == ((), 'foot', 'vector')
    for kind, expected in (
        ('gyro', log().gyro),
        ('accelerometer', log().accelerometer),
        ('positions', log().joint_positions),
        ('velocities', log().joint_velocities),
        ('efforts', log().efforts),
    ):
        assert column(found, kind) == pytest.approx(expected, abs=1e-9)
    turns = np.array([GO2.kinematics(q).rotations for q in log().joint_positions])
    in_base = (turns @ forces(found)[..., None])[..., 0]
    assert in_base == pytest.approx(log().foot_forces, abs=1e-9)
    stamps = [each.stamp for each in found if each.gyro is not None]
    assert np.diff(stamps) == pytest.approx(4e6, abs=1.0)


def test_low_state_of_a_go2(tmp_path):
    mapping, found = readings(tmp_path, 'go2', GO2, layouts.low_state(log(), GO2))
    assert found[0].stamp == layouts.START
    for kind, expected in (
        ('gyro', log().gyro),
        ('accelerometer', log().accelerometer),
        ('positions', log().joint_positions),
        ('velocities', log().joint_velocities),
        ('efforts', log().efforts),
    ):
        assert np.array_equal(column(found, kind), as_float32(expected))
    assert any(each.startswith('force: ') for each in mapping.missing)


def test_a_go2_by_its_feet(tmp_path):
    mapping, found = readings(tmp_path, 'go2_sport', FEET, layouts.sport_state(log(), GO2))
    assert 'friction: unobservable, the force has one axis' in mapping.missing
    pairs = [layouts.feet_in_body(GO2, log(), tick) for tick in range(len(log().time))]
    places, speeds = (as_float32(np.array(part)) for part in zip(*pairs, strict=True))
    hips = np.array(((0.1934, 0.142), (0.1934, -0.142), (-0.1934, 0.142), (-0.1934, -0.142)))
    expected = places - np.pad(hips, ((0, 0), (0, 1)))
    assert column(found, 'positions') == pytest.approx(expected.reshape(-1, 12), abs=1e-9)
    assert np.array_equal(column(found, 'velocities'), speeds.reshape(-1, 12))
    assert forces(found)[..., 2] == pytest.approx(np.round(log().foot_forces[..., 2]))
    assert not forces(found)[..., :2].any()
    # The robot with joints in m has its feet where the messages have them.
    assert FEET.foot_positions(found[5].positions) == pytest.approx(pairs[5][0], abs=1e-6)


def test_feet_of_spot_with_an_imu_of_its_owner(tmp_path):
    streams = [layouts.imu(log()), layouts.spot_feet(log(), GO2)]
    mapping, found = readings(tmp_path, 'spot', FEET, *streams)
    kinds = {each.partition(':')[0] for each in mapping.missing}
    assert kinds == {'joint velocities', 'friction', 'stamps', 'imu', 'rolling'}
    feet = [each for each in found if each.positions is not None]
    assert len(feet) == 750
    assert all(each.velocities is None and each.gyro is None for each in feet)
    places, _ = layouts.feet_in_body(GO2, log(), 700)
    # Legs of go2_feet: hips at 0.1934 and 0.142 m, to which joint positions refer.
    assert FEET.foot_positions(feet[700].positions) == pytest.approx(places, abs=1e-9)
    for tick in (100, 600, 700):
        loads = [feet[tick].forces[leg] for leg in range(4)]
        stands = log().foot_forces[tick, :, 2] > layouts.LOAD
        assert loads == pytest.approx(np.outer(stands * WEIGHT / 2.0, (0.0, 0.0, 1.0)))


def test_a_mapping_for_another_robot_is_refused():
    with pytest.raises(ConfigError, match=r"joint 'LF_HAA' is not among FR_hip"):
        Mapping.load('go2', ANYMAL)


@pytest.mark.parametrize('name', configuration.names('mappings'))
def test_every_shipped_mapping_loads(name):
    robot = FEET if name in ('go2_sport', 'spot') else GO2
    mapping = Mapping.load(name, robot)
    assert mapping.sources
    assert all(': ' in each and len(each) < 120 for each in mapping.missing)


JOINTS = """
topics:
  joints:
    type: my_msgs/msg/Joints
    stamp: header.stamp
    joints:
      names: names
      positions: degrees
      velocities: speeds
      scale: 0.017453292519943295
      rename: {FL_hip_joint: abad}
      reversed: [FL_calf_joint]
      offsets: {FL_calf_joint: 0.5}
"""


def load(tmp_path, text, robot=GO2):
    path = tmp_path / 'my.yaml'
    path.write_text(text)
    return Mapping.load(path, robot)


def message(**fields):
    stamp = SimpleNamespace(sec=12, nanosec=34)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), **fields)


def joints(**changes):
    names = ['abad', *GO2.joint_names[1:]]
    values = {'names': names, 'degrees': [90.0] * 12, 'speeds': [180.0] * 12}
    return message(**(values | changes))


def test_names_signs_offsets_and_units_of_joints(tmp_path):
    found = load(tmp_path, JOINTS).read('/joints', joints(), 0)
    expected = np.full(12, np.pi / 2)
    expected[2] = 0.5 - np.pi / 2
    assert found.stamp == 12_000_000_034
    assert found.positions == pytest.approx(expected)
    assert found.velocities == pytest.approx(np.where(np.arange(12) == 2, -np.pi, np.pi))
    assert found.efforts is None


def test_what_drivers_leave_out_is_no_reading(tmp_path):
    mapping = load(tmp_path, JOINTS)
    for speeds in ([], [float('nan')] * 12):
        assert mapping.read('joints', joints(speeds=speeds), 0).velocities is None


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'names': ['abad', *GO2.joint_names[1:11], 'RR_calf']}, "'RR_calf_joint' is not among"),
        ({'names': ['abad', *GO2.joint_names[1:], 'abad']}, 'one is double'),
        ({'degrees': [90.0] * 11}, 'positions of 11 joints'),
        ({'speeds': [90.0] * 13}, 'velocities of 13 joints'),
        ({'degrees': [90.0] * 11 + [float('nan')]}, '12 finite numbers'),
    ],
)
def test_messages_that_do_not_fit(changes, words, tmp_path):
    with pytest.raises(InvalidInput, match=words):
        load(tmp_path, JOINTS).read('joints', joints(**changes), 0)


def test_a_field_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InvalidInput, match=r"joints .my_msgs/msg/Joints.: .*'degrees'"):
        load(tmp_path, JOINTS).read('joints', message(names=joints().names), 0)
    with pytest.raises(InvalidInput, match="topic 'odom' is not in mapping my: one of joints"):
        load(tmp_path, JOINTS).read('odom', message(), 0)


IMU = """
topics:
  imu:
    type: my_msgs/msg/Imu
    stamp: count
    tick: 1.0e-6
    gyro:
      field: rates[1].xyz
      axes: [-y, x, z]
      absent: covariance
    accelerometer: {field: pull, scale: 9.80665}
"""


def test_axes_units_and_readings_that_are_absent(tmp_path):
    mapping = load(tmp_path, IMU)
    rates = [None, SimpleNamespace(x=1.0, y=2.0, z=3.0)]
    given = {'rates': rates, 'pull': (0.0, 0.0, 1.0), 'count': 5, 'covariance': [0.1] * 9}
    found = mapping.read('imu', SimpleNamespace(**given), 1000)
    assert found.gyro == pytest.approx([-2.0, 1.0, 3.0])
    assert found.accelerometer == pytest.approx([0.0, 0.0, 9.80665])
    given['covariance'] = [-1.0] * 9
    assert mapping.read('imu', SimpleNamespace(**given), 1000).gyro is None


def test_the_delay_of_a_stamp_is_taken_off(tmp_path):
    mapping = load(
        tmp_path, JOINTS.replace('stamp: header.stamp', 'stamp: arrival\n    delay: 0.006')
    )
    assert mapping.read('joints', joints(), 10_000_000).stamp == 4_000_000


def test_stamps_of_a_counter(tmp_path):
    mapping = load(tmp_path, IMU)
    given = {'rates': [0, SimpleNamespace(x=0, y=0, z=0)], 'pull': (0, 0, 0), 'covariance': [0]}

    def stamp(count, arrival):
        return mapping.read('imu', SimpleNamespace(count=count, **given), arrival).stamp

    assert stamp(1000, 7_000_000) == 7_000_000
    assert stamp(3000, 9_400_000) == 9_000_000  # 2000 counts of 1 us later
    assert stamp(0, 2_000_000_000) == 2_000_000_000  # the counter began anew
    assert stamp(500, 2_000_900_000) == 2_000_500_000


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('type: my_msgs/msg/Imu', 'type: Imu', "type = 'Imu' is not allowed: package/msg/Name"),
        ('axes: [-y, x, z]', 'axes: [y, x, -y]', 'x, y and z in any order'),
        ('field: pull', 'field: pull..x', "'pull..x' is not allowed"),
        ('tick: 1.0e-6', 'tick: 0', 'tick = 0'),
        ('gyro:', 'gyros:', "unknown key 'gyros'. Did you mean 'gyro'"),
    ],
)
def test_files_that_are_not_valid(old, new, words, tmp_path):
    assert old in IMU
    with pytest.raises(ConfigError, match=r'my\.yaml: topics: imu') as caught:
        load(tmp_path, IMU.replace(old, new))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('reversed: [FL_calf_joint]', 'reversed: [FL_calf]', "Did you mean 'FL_calf_joint'"),
        ('names: names', 'order: [a, b]', "joint 'abad' is not among a, b"),
    ],
)
def test_joints_that_do_not_fit_the_robot(old, new, words, tmp_path):
    with pytest.raises(ConfigError, match=r'my\.yaml: topics: joints') as caught:
        load(tmp_path, JOINTS.replace(old, new))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ('legs', 'words'),
    [
        ('[front_left, RL]', None),
        ('[FL, front_left]', 'different ones'),
        ('[FL, left]', "'left' is not allowed: different ones of FL"),
    ],
)
def test_legs_by_name_or_corner(legs, words, tmp_path):
    text = f"""
topics:
  feet:
    type: my_msgs/msg/Loads
    stamp: arrival
    normal_force: {{field: loads, legs: {legs}, scale: 2.0, offset: -3.0}}
"""
    if words:
        with pytest.raises(ConfigError, match=words):
            load(tmp_path, text)
        return
    found = load(tmp_path, text).read('feet', SimpleNamespace(loads=[13.0, 23.0]), 99)
    assert found.stamp == 99
    assert {leg: force.tolist() for leg, force in found.forces.items()} == {
        0: [0.0, 0.0, 20.0],
        2: [0.0, 0.0, 40.0],
    }
