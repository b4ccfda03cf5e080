# SPDX-License-Identifier: Apache-2.0
"""Each fault put into an honest log is found, and no other; honest logs have none."""

import dataclasses
import functools

import numpy as np
import pytest

from ros_pad.robots import Robot
from ros_pad.robots.rotation import from_rpy, transform
from ros_pad.sensing import checks, examine
from studies.sensing import layouts

GO2 = Robot.load('go2')
ORIGIN = 1_700_000_000.0  # s, of the clock in tests


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
    return checks.Recording(**(given | changes))


def only(found, what, words, status='problem'):
    assert [each.what for each in found] == [what], found
    assert words in found[0].found
    assert (found[0].status, bool(found[0].advice)) == (status, True)


PARTS = {'all': slice(None), 'standing': slice(0, 490), 'walking': slice(650, None)}


@pytest.mark.parametrize('part', PARTS)
@pytest.mark.parametrize(
    ('name', 'floor', 'seed'),
    [
        ('go2', 'patches', 4),
        ('ch3r', 'patches', 3),
        pytest.param('go2', 'dry', 5, marks=pytest.mark.slow),
        pytest.param('go2', 'ice', 5, marks=pytest.mark.slow),
        pytest.param('ch3r', 'dry', 4, marks=pytest.mark.slow),
    ],
)
def test_nothing_is_found_in_an_honest_log(name, floor, seed, part):
    honest = recording(log(name, floor, seed), name, PARTS[part])
    assert examine.examine(honest) == []


@pytest.mark.parametrize('changes', [{'forces': None}, {'velocities': None}])
def test_nothing_is_found_with_fewer_sensors(changes):
    assert examine.examine(recording(log(), **changes)) == []


def test_forces_in_the_axes_of_the_feet_are_understood():
    honest = recording(log())
    turns = honest.kinematics[1]
    turned = (turns.transpose(0, 1, 3, 2) @ log().foot_forces[..., None])[..., 0]
    assert examine.examine(recording(log(), forces=turned, force_axes='foot')) == []
    found = examine.examine(recording(log(), forces=turned))
    only(found, 'foot forces', 'along x of the base at rest')
    assert found[0].advice == 'force_axes: foot in the mapping'


def test_a_turned_imu_is_no_fault_where_the_robot_file_says_so():
    pose = transform((0.0, 0.0, 0.0), from_rpy((np.pi, 0.0, 0.7)))
    robot = dataclasses.replace(GO2, imu=pose)
    gyro, accelerometer = (x @ pose[:3, :3] for x in (log().gyro, log().accelerometer))
    given = {'gyro': gyro, 'accelerometer': accelerometer}
    assert examine.examine(recording(log(), robot=robot, **given)) == []
    assert examine.examine(recording(log(), **given))


SOME = ('FL_hip_joint', 'FR_thigh_joint', 'RR_calf_joint')


@pytest.mark.parametrize(
    'joint',
    [
        each if each in SOME else pytest.param(each, marks=pytest.mark.slow)
        for each in GO2.joint_names
    ],
)
def test_a_reversed_joint(joint):
    walk = log(seconds=8.0)  # hips move little
    signs = np.where(np.array(GO2.joint_names) == joint, -1.0, 1.0)
    turned = {
        'positions': walk.joint_positions * signs,
        'velocities': walk.joint_velocities * signs,
        'efforts': walk.efforts * signs,
    }
    only(examine.examine(recording(walk, **turned)), f'joint {joint}', 'is reversed')


@pytest.mark.slow
@pytest.mark.parametrize('joint', ['leg_1_coxa', 'leg_3_tibia', 'leg_4_femur'])
def test_a_reversed_joint_of_a_hexapod(joint):
    walk = log('ch3r', 'patches')
    signs = np.where(np.array(Robot.load('ch3r').joint_names) == joint, -1.0, 1.0)
    turned = {
        'positions': walk.joint_positions * signs,
        'velocities': walk.joint_velocities * signs,
    }
    only(examine.examine(recording(walk, 'ch3r', **turned)), f'joint {joint}', 'is reversed')


@pytest.mark.parametrize(
    ('turn', 'words'),
    [
        (np.diag((-1.0, 1.0, 1.0)), 'about x is on -x'),
        (np.diag((1.0, -1.0, 1.0)), 'about y is on -y'),
        (np.diag((1.0, 1.0, -1.0)), 'about z is on -z'),
        (np.eye(3)[[1, 0, 2]], 'about x is on y, about y is on x'),
        # The gyro has the base's y on its x, and the base's -x on its y.
        (np.array(((0, 1, 0), (-1, 0, 0), (0, 0, 1))), 'about x is on -y, about y is on x'),
        (np.eye(3) * 180.0 / np.pi, 'in degrees per second'),
    ],
)
def test_a_turned_gyro(turn, words):
    only(examine.examine(recording(log(), gyro=log().gyro @ turn.T)), 'gyro', words)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda f: f / 9.81, 'is in g: 1 m/s2'),
        (lambda f: f - (0.0, 0.0, 9.81), 'shows no gravity'),
        (lambda f: f[:, [2, 1, 0]], 'gravity is on x of the base'),
        (lambda f: f * (1.0, -1.0, -1.0), 'gravity is on -z of the base'),
        (lambda f: 1.1 * f, 'has a wrong scale: 10.8 m/s2'),
        (lambda f: f * (-1.0, -1.0, 1.0), 'horizontal axes are turned'),
    ],
)
def test_an_accelerometer_that_is_wrong(change, words):
    found = examine.examine(recording(log(), accelerometer=change(log().accelerometer)))
    only(found, 'accelerometer', words)


FR = np.array((1.0, -1.0, 1.0, 1.0))[:, None]


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (lambda f: -f, 'are reversed'),
        (lambda f: FR * f, 'foot FR is reversed'),
        (lambda f: f[..., [2, 1, 0]], 'along x of the base'),
        (lambda f: np.where(FR > 0.0, f, f[..., [0, 2, 1]]), 'foot FR is along y of the base'),
        (lambda f: np.round(12.0 * f), 'weighs 147 N'),
        (lambda f: np.where(FR > 0.0, f, 0.0), 'foot FR never carries load'),
        (lambda f: f * (-1.0, -1.0, 1.0), 'x of the accelerometer is -x of the forces'),
        (lambda f: f[..., [1, 0, 2]] * (1.0, -1.0, 1.0), 'is -y of the forces, y is x'),
    ],
)
def test_foot_forces_that_are_wrong(change, words):
    found = examine.examine(recording(log(), forces=change(log().foot_forces)))
    only(found, 'foot forces', words)


def test_advice_turns_an_imu_back():
    # Its x is the base's y, and its y the base's -x.
    turn = np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    gyro, accelerometer = log().gyro @ turn.T, log().accelerometer @ turn.T
    found = examine.examine(recording(log(), gyro=gyro, accelerometer=accelerometer))
    assert [each.what for each in found] == ['gyro', 'accelerometer']
    assert all(each.advice.startswith('axes: [-y, x, z] in the mapping') for each in found)


def test_counts_get_a_scale():
    (found,) = examine.examine(recording(log(), forces=np.round(12.0 * log().foot_forces)))
    assert found.advice.startswith('counts, not newtons: scale: 0.083')


def test_forces_that_are_all_zero():
    found = examine.examine(recording(log(), forces=0.0 * log().foot_forces))
    only(found, 'foot forces', 'are all zero')
    found = examine.examine(recording(log(), forces=None, efforts=0.0 * log().efforts))
    only(found, 'efforts', 'are all zero')


def test_efforts_that_are_reversed_or_absent():
    found = examine.examine(recording(log(), forces=None, efforts=-log().efforts))
    only(found, 'efforts', 'are reversed')
    found = examine.examine(recording(log(), forces=None, efforts=None))
    only(found, 'force', 'neither foot forces nor efforts')


@pytest.mark.parametrize(
    ('factor', 'what', 'words'),
    [
        (np.where(np.arange(12) == 4, -1.0, 1.0), 'joint FR_thigh_joint', 'reversed against'),
        (np.full(12, 180.0 / np.pi), 'joints', ' times the change'),
    ],
)
def test_velocities_that_are_not_those_of_the_positions(factor, what, words):
    found = examine.examine(recording(log(), velocities=factor * log().joint_velocities))
    only(found, what, words)


@pytest.mark.parametrize(
    ('changes', 'what', 'words'),
    [
        ({'gyro': 0.02}, 'imu', 'the gyro repeats its reading'),
        ({'forces': 3.0}, 'force', 'foot FR shows more than half of the expected load in the air'),
    ],
)
def test_what_the_body_estimator_doubts_is_found(changes, what, words):
    walk = log()
    if 'gyro' in changes:
        stuck = walk.gyro.copy()
        stuck[900:1100] = stuck[900]
        given = {'gyro': stuck}
    else:
        load = GO2.mass * 9.81 / 2.0
        given = {'forces': walk.foot_forces + 0.7 * load * (FR < 0.0) * np.array((0.0, 0.0, 1.0))}
    only(examine.contradictions(recording(walk, **given)), what, words)


@pytest.mark.parametrize('late', [-0.008, 0.006])
def test_stamps_of_imu_and_joints_that_are_apart(late):
    found = examine.examine(recording(log(), joint_time=log().time + late))
    words = f'{abs(1e3 * late):.0f} ms {"later" if late > 0.0 else "earlier"} than the IMU'
    only(found, 'joints', words, 'warning')


def test_positions_in_degrees():
    degrees = {'positions': np.degrees(log().joint_positions)}
    only(examine.examine(recording(log(), **degrees)), 'joints', 'positions up to 1')


def test_stamps_of_other_clocks():
    arrival = log().time + ORIGIN
    both = {'imu_arrival': arrival, 'joint_arrival': arrival}
    only(examine.examine(recording(log(), **both)), 'stamps', '-1.7e+09 s: another', 'warning')
    shifted = {'joint_time': log().time + 3.0, 'joint_arrival': log().time + 3.0}
    assert checks.stamps(recording(log(), **shifted)) == []
    shifted['joint_arrival'] = log().time
    only(examine.examine(recording(log(), **shifted)), 'imu', 'are -3 s after those of the joints')


def test_stamps_that_are_no_times():
    # As in a log of others: 10.73 s of stamps for 8.18 s.
    slow = {'imu_time': log().time * 10.73 / 8.18, 'joint_time': log().time}
    only(examine.examine(recording(log(), **slow)), 'imu', '1 s of its stamps takes 0.76')
    both = {'imu_arrival': 1.3 * log().time, 'joint_arrival': 1.3 * log().time}
    only(examine.examine(recording(log(), **both)), 'stamps', '1 s of them takes 1.3 s', 'warning')
    back = log().time.copy()
    back[700:] -= 0.5
    only(examine.examine(recording(log(), joint_time=back)), 'joints', '1 stamps are not after')


def test_rates_and_gaps():
    few = {name: getattr(recording(log()), name)[::4] for name in ('imu_time', 'imu_arrival')}
    few |= {'gyro': log().gyro[::4], 'accelerometer': log().accelerometer[::4]}
    only(examine.examine(recording(log(), **few)), 'imu', '62 samples a second', 'warning')
    kept = np.r_[0:700, 720:1500]
    gap = {name: getattr(recording(log()), name)[kept] for name in few}
    only(examine.examine(recording(log(), **gap)), 'imu', 'the longest of 0.084 s', 'warning')


def test_feet_that_are_not_in_a_plane():
    # Both front thighs 0.6 rad off: their feet are high, and no single joint mends that.
    off = np.where(np.isin(np.arange(12), (1, 5)), 0.6, 0.0)
    part = PARTS['standing']
    off = {'positions': log().joint_positions[part] + off}
    (found, *_) = examine.examine(recording(log(), part=part, **off))
    assert (found.what, 'off the plane' in found.found) == ('feet', True)


def test_a_swinging_foot_below_the_floor():
    honest = recording(log())
    heights = honest.kinematics[0].copy()
    swings = log().load[:, 1] < 1.0
    heights[swings, 1, 2] -= 0.15
    vars(honest)['kinematics'] = (heights, *honest.kinematics[1:])
    only(examine.swings(honest), 'feet', 'foot FR goes')


def test_what_did_not_move_is_not_judged():
    found = examine.unjudged(recording(log(), part=PARTS['standing']))
    assert found == ['gyro, joints and their delay: the robot did not move on its feet']
    found = examine.unjudged(recording(log('ch3r', 'patches'), 'ch3r'))
    # Its gait is level: it turns about y and z alone, and its middle femurs hardly move.
    assert 'gyro about x' in found and 'joint leg_2_femur' in found
    assert 'joint leg_1_coxa' not in found


@pytest.mark.parametrize('every', [12, 25, 50])
def test_low_rates_find_no_other_faults(every):
    part = slice(None, None, every)
    found = examine.examine(recording(log(), part=part))
    assert {(each.what, each.status) for each in found} <= {
        ('imu', 'warning'),
        ('joints', 'warning'),
    }
    examine.unjudged(recording(log(), part=part))


@pytest.mark.parametrize('size', [0.0, 1.0, 1e6])
@pytest.mark.parametrize('count', [12, 300])
def test_nonsense_has_findings_and_no_errors(size, count):
    generator = np.random.default_rng(1)
    times = np.arange(count) * 0.004

    def random(*shape):
        return size * generator.standard_normal((count, *shape))

    nonsense = checks.Recording(
        GO2, times, random(3), random(3), times, random(12), random(12), random(12), random(4, 3)
    )
    assert examine.examine(nonsense)
    assert examine.unjudged(nonsense)
