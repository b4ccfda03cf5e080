# SPDX-License-Identifier: Apache-2.0
"""Each fault put into an honest log is found, and no other; honest logs have none."""

import dataclasses
import functools

import numpy as np
import pytest

from ros_pad.robots import Robot
from ros_pad.robots.rotation import from_rpy, transform
from ros_pad.sensing.checks import Recording, check
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.sensors import BodySensors
from studies.closed_loop import gaits
from studies.sensing import layouts

GO2 = Robot.load('go2')


@functools.cache
def log(name='go2', floor='dry', seed=3, seconds=6.0):
    """Return a log: 2 s at rest, then walking."""
    pytest.importorskip('mujoco')
    return layouts.log_of(name, floor, seed, seconds)


def recording(log, name='go2', part=slice(None), **changes):
    times = log.time[part]
    given = {
        'robot': Robot.load(name),
        'imu_time': times,
        'gyro': log.gyro[part],
        'accelerometer': log.accelerometer[part],
        'joint_time': times,
        'positions': log.joint_positions[part],
        'velocities': log.joint_velocities[part],
        'efforts': log.efforts[part],
        'forces': log.foot_forces[part],
        'imu_arrival': times + 0.001,
        'joint_arrival': times + 0.002,
    }
    return Recording(**(given | changes))


def faults(recording):
    """Return what is found but for what could not be judged."""
    return [each for each in check(recording) if each.what != 'not judged']


def only(recording, what, words, status='problem'):
    (found,) = faults(recording)
    assert (found.what, found.status) == (what, status)
    assert words in found.found


STANDING = slice(0, 490)


@pytest.mark.parametrize('part', [slice(None), STANDING, slice(650, None)])
@pytest.mark.parametrize(('name', 'seed'), [('go2', 4), ('ch3r', 3)])
def test_nothing_is_found_in_an_honest_log(name, seed, part):
    assert faults(recording(log(name, 'patches', seed), name, part)) == []


@pytest.mark.parametrize('changes', [{'forces': None}, {'velocities': None}])
def test_nothing_is_found_with_fewer_sensors(changes):
    assert faults(recording(log(), **changes)) == []


@functools.cache
def even_walk():
    """Return readings of a walk on L2, in which nothing but its legs moves the body."""
    pytest.importorskip('mujoco')
    scene = gaits.scene_of('go2', (), 'dry', cycles=12)
    robot = FullRobot(scene, scene.floor.build(1), gaits.PERIOD)
    sensors, rows = BodySensors(scene, 1, len(robot.joint_names)), []
    for _ in range(round(scene.duration / gaits.PERIOD)):
        robot.step([0.0] * 4)
        rows.append((robot.time, *sensors.read(robot.proprioception(), robot.time)))
    time, imu, joints, feet = map(np.array, zip(*rows, strict=True))
    return time, imu[:, 0], imu[:, 1], time, *np.moveaxis(joints, 1, 0), feet['force']


def test_nothing_is_found_in_an_even_walk():
    """Swinging legs move the base, and not the centre of mass, along x."""
    whole = Recording(GO2, *even_walk(), force_axes='foot')
    part = (each[500:] for each in even_walk())
    assert faults(whole) == faults(Recording(GO2, *part, force_axes='foot')) == []
    forces = whole.ground_forces * (1.0, -1.0, 1.0)
    turned = Recording(GO2, *even_walk()[:-1], forces)
    only(turned, 'accelerometer or foot forces', 'are [x, -y] of')


def test_forces_in_the_axes_of_the_feet_are_understood():
    turns = recording(log()).kinematics.rotations
    turned = (turns.transpose(0, 1, 3, 2) @ log().foot_forces[..., None])[..., 0]
    assert faults(recording(log(), forces=turned, force_axes='foot')) == []
    only(recording(log(), forces=turned), 'foot forces', 'along [x] of the base at rest')


def test_a_turned_imu_is_no_fault_where_the_robot_file_says_so():
    pose = transform((0.0, 0.0, 0.0), from_rpy((np.pi, 0.0, 0.7)))
    robot = dataclasses.replace(GO2, imu=pose)
    gyro, accelerometer = (x @ pose[:3, :3] for x in (log().gyro, log().accelerometer))
    given = {'gyro': gyro, 'accelerometer': accelerometer}
    assert faults(recording(log(), robot=robot, **given)) == []
    assert faults(recording(log(), **given))


@pytest.mark.parametrize('joint', ['FL_hip_joint', 'RR_calf_joint'])
def test_a_reversed_joint(joint):
    walk = log(seconds=8.0)  # hips move little
    signs = np.where(np.array(GO2.joint_names) == joint, -1.0, 1.0)
    turned = {
        'positions': walk.joint_positions * signs,
        'velocities': walk.joint_velocities * signs,
        'efforts': walk.efforts * signs,
    }
    only(recording(walk, **turned), f'joint {joint}', 'is reversed')


# A sensor that has the base's y on its x, and the base's -x on its y.
TURNED = np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))


@pytest.mark.parametrize(
    ('turn', 'words'),
    [
        (np.diag((1.0, 1.0, -1.0)), 'is on [x, y, -z], not on [x, y, z]'),
        (TURNED, 'is on [-y, x, z]'),
        (np.eye(3) * 180.0 / np.pi, 'degrees per second'),
    ],
)
def test_a_turned_gyro(turn, words):
    only(recording(log(), gyro=log().gyro @ turn.T), 'gyro', words)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda f: f / 9.81, 'shows 1 m/s2 at rest, not 9.81 +- 0.3'),
        (lambda f: f[:, [2, 1, 0]], 'gravity is on [x] of the base'),
        (lambda f: f * (1.0, -1.0, -1.0), 'gravity is on [-z] of the base'),
    ],
)
def test_an_accelerometer_that_is_wrong(change, words):
    changed = recording(log(), accelerometer=change(log().accelerometer))
    only(changed, 'accelerometer', words)


FR = np.array((1.0, -1.0, 1.0, 1.0))[:, None]


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda f: -f, 'are along [-z]'),
        (lambda f: FR * f, 'foot FR is along [-z]'),
        (lambda f: np.round(12.0 * f), 'weighs 147 N: 0.083'),
        (lambda f: np.where(FR > 0.0, f, 0.0), 'foot FR never carries load'),
        (lambda f: 0.0 * f, 'are all zero'),
    ],
)
def test_foot_forces_that_are_wrong(change, words):
    only(recording(log(), forces=change(log().foot_forces)), 'foot forces', words)


def test_horizontal_axes_that_are_turned_against_the_motion():
    forces = log().foot_forces[..., [1, 0, 2]] * (1.0, -1.0, 1.0)
    only(recording(log(), forces=forces), 'accelerometer or foot forces', 'are [y, -x] of')


def test_efforts_that_are_reversed_or_absent():
    only(recording(log(), forces=None, efforts=-log().efforts), 'efforts', 'along [-z]')
    only(recording(log(), forces=None, efforts=None), 'force', 'neither foot forces nor efforts')


def test_what_the_body_estimator_doubts_is_found():
    stuck = log().gyro.copy()
    stuck[900:1100] = stuck[900]
    only(recording(log(), gyro=stuck), 'imu', 'the gyro repeats its reading')
    signs = np.where(np.arange(12) == 4, -1.0, 1.0)
    speeds = recording(log(), velocities=signs * log().joint_velocities)
    only(speeds, 'joints', 'the position of FR_thigh_joint does not follow its velocity')


@pytest.mark.parametrize('late', [-0.008, 0.006])
def test_stamps_of_imu_and_joints_that_are_apart(late):
    words = f'{abs(1e3 * late):.0f} ms {"later" if late > 0.0 else "earlier"} than the IMU'
    only(recording(log(), joint_time=log().time + late), 'joints', words, 'warning')


def test_a_delay_that_is_not_seen_is_not_judged():
    """Later fits worse and earlier does not."""
    walk, part = log('go2', 'patches', 4), slice(490, 1100)
    (found,) = check(recording(walk, part=part, joint_time=walk.time[part] - 0.012))
    assert found.what == 'not judged' and found.found.endswith('delay between IMU and joints')


def test_positions_in_degrees():
    degrees = np.degrees(log().joint_positions)
    only(recording(log(), positions=degrees), 'joints', 'positions up to 1')


def test_stamps_of_other_clocks():
    arrival = log().time + 1_700_000_000.0
    both = {'imu_arrival': arrival, 'joint_arrival': arrival}
    only(recording(log(), **both), 'stamps', '-1.7e+09 s', 'warning')
    shifted = {'joint_time': log().time + 3.0, 'joint_arrival': log().time}
    only(recording(log(), **shifted), 'imu', 'are -3 s after those of the joints')


def test_stamps_that_are_no_times():
    # As in a log of others: 10.73 s of stamps for 8.18 s.
    slow = {'imu_time': log().time * 10.73 / 8.18, 'joint_time': log().time}
    only(recording(log(), **slow), 'imu', '1 s of its stamps takes 0.76')
    back = log().time.copy()
    back[700:] -= 0.5
    only(recording(log(), joint_time=back), 'joints', '1 stamps are not after')


def test_rates_and_gaps():
    imu = ('imu_time', 'imu_arrival', 'gyro', 'accelerometer')
    honest = recording(log())
    few = {name: getattr(honest, name)[::4] for name in imu}
    only(recording(log(), **few), 'imu', '62 samples a second', 'warning')
    gap = {name: getattr(honest, name)[np.r_[0:700, 720:1500]] for name in imu}
    only(recording(log(), **gap), 'imu', 'the longest of 0.084 s', 'warning')


def test_feet_that_are_not_in_a_plane():
    # Both front thighs 0.6 rad off: their feet are high, and no single joint mends that.
    off = np.where(np.isin(np.arange(12), (1, 5)), 0.6, 0.0)
    positions = log().joint_positions[STANDING] + off
    only(recording(log(), part=STANDING, positions=positions), 'feet', 'off the plane')


def test_what_did_not_move_is_not_judged():
    (found,) = check(recording(log(), part=STANDING))
    assert found.found.startswith('gyro, joints and their delay: the robot did not move')
    (found,) = check(recording(log('ch3r', 'patches'), 'ch3r'))
    # Its gait is level: it turns about y and z alone, and its middle femurs hardly move.
    assert 'gyro about x' in found.found and 'joint leg_2_femur' in found.found
    assert 'joint leg_1_coxa' not in found.found


@pytest.mark.parametrize('every', [12, 50])
def test_low_rates_find_no_other_faults(every):
    found = faults(recording(log(), part=slice(None, None, every)))
    assert {(each.what, each.status) for each in found} <= {
        ('imu', 'warning'),
        ('joints', 'warning'),
    }


@pytest.mark.parametrize('size', [0.0, 1.0, 1e6])
@pytest.mark.parametrize('count', [12, 300])
def test_nonsense_has_findings_and_no_errors(size, count):
    generator = np.random.default_rng(1)
    times = np.arange(count) * 0.004

    def random(*shape):
        return size * generator.standard_normal((count, *shape))

    arrays = (random(3), random(3), times, random(12), random(12), random(12), random(4, 3))
    assert check(Recording(GO2, times, *arrays))
