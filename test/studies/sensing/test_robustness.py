# SPDX-License-Identifier: Apache-2.0
"""What goes wrong on robots, made on simulated walks: a good estimate, or a doubt."""

import copy
import dataclasses

import numpy as np
import pytest

from ros_pad.robots import Chains, Robot
from ros_pad.sensing import BodyEstimator
from studies.sensing import walks

SENSORS = (*('gyro', 'accelerometer'), *('joint_positions', 'joint_velocities', 'foot_forces'))
GO2 = Robot.load('go2')


@pytest.fixture(scope='module')
def walked():
    pytest.importorskip('mujoco')
    return walks.walk(walks.COURSES['patches'], 5, 14.0)


@pytest.fixture
def log(walked):
    return copy.deepcopy(walked)


def run(log, robot=GO2, chosen=None, **arguments):
    """Return the estimates, the errors of velocity x y, m/s, and the estimator."""
    estimator = BodyEstimator(robot, **arguments)
    rows = range(len(log.time)) if chosen is None else chosen
    found = [
        estimator.update(float(log.time[row]), *(getattr(log, name)[row] for name in SENSORS))
        for row in rows
    ]
    for each in found[:: max(1, len(found) // 200)]:
        assert np.isfinite([*each.position, *each.velocity, *each.orientation]).all()
    error = np.array([each.velocity[:2] for each in found]) - log.velocity[list(rows), :2]
    return found, np.linalg.norm(error, axis=1), estimator


def doubts(found):
    return {each.doubt.split(':')[0] for each in found}


def rms(values):
    return float(np.sqrt((values * values).mean()))


def test_honest_readings_leave_no_doubt_and_no_delay(log):
    found, error, estimator = run(log)
    assert {each.doubt for each in found} == {''}
    assert rms(error[750:]) < 0.012  # m/s, "must" of issue 16 on patches
    assert abs(estimator.delay[0]) < 1.5e-3


@pytest.mark.parametrize('joint', [2])
def test_a_reversed_joint_is_named_by_its_leg(log, joint):
    log.joint_positions[:, joint] *= -1.0
    log.joint_velocities[:, joint] *= -1.0
    found, error, _ = run(log)
    assert found[-1].doubt.startswith('kinematics: leg FL moves against the other legs')
    assert rms(error[1500:]) < 0.015  # the other legs carry the estimate
    front = [each.feet[0] for each in found[1500:] if each.feet[0].in_contact]
    assert np.mean([foot.excluded for foot in front]) > 0.9


def test_a_wrong_foot_link_is_named_by_its_leg(log):
    feet = GO2.chains.feet.copy()
    feet[0, :3, 3] *= 0.1  # the foot is taken to be at the knee
    found, _, _ = run(log, dataclasses.replace(GO2, chains=Chains(GO2.chains.legs, feet)))
    assert 'kinematics' in doubts(found)
    named = [each.doubt for each in found if each.doubt.startswith('kinematics: leg')]
    assert all('leg FL moves' in doubt for doubt in named)


@pytest.mark.parametrize('delay', [0.006])
def test_a_delay_is_found(walked, delay):
    log = copy.deepcopy(walked)
    for key in ('joint_positions', 'joint_velocities', 'foot_forces'):
        values = getattr(log, key)
        columns = values.reshape(len(values), -1).T
        late = [np.interp(log.time - delay, log.time, column) for column in columns]
        setattr(log, key, np.array(late).T.reshape(values.shape))
    found, _, estimator = run(log)
    word = 'later' if delay > 0.0 else 'earlier'
    assert found[-1].doubt.startswith('delay: joints are ')
    assert found[-1].doubt.endswith(f' ms {word} than the IMU')
    assert estimator.delay[0] == pytest.approx(delay, abs=2.5e-3)


@pytest.mark.parametrize(('name', 'doubt'), [('gyro', 'imu'), ('joint_positions', 'joints')])
def test_a_sensor_that_repeats_is_in_doubt_until_it_lives_again(log, name, doubt):
    values = getattr(log, name)
    values[1500:1900] = values[1499]
    found, error, _ = run(log)
    assert doubt in doubts(found[1500:1900])
    assert doubts(found[:1500]) == {''}
    assert found[-1].doubt == ''
    assert rms(error[-500:]) < 0.015


def test_a_joint_that_is_stuck_is_named(log):
    log.joint_positions[1000:, 4] = log.joint_positions[999, 4]
    found, _, _ = run(log)
    assert any(
        each.doubt == 'joints: the position of FR_thigh_joint does not follow its velocity'
        for each in found
    )


def test_drop_outs_are_bridged(log):
    kept = np.random.default_rng(1).random(len(log.time)) > 0.1
    gaps = (1200, 1800, 2400)
    for start in gaps:
        kept[start : start + 30] = False  # 0.12 s
    rows = np.flatnonzero(kept)
    found, error, _ = run(log, chosen=rows)
    assert 'gap' not in doubts(found)
    since = np.min([np.where(rows >= gap + 30, rows - gap - 30, 9999) for gap in gaps], axis=0)
    assert rms(error[(rows > 750) & (since > 50)]) < 0.012
    deviation = np.sqrt([np.diag(each.covariance)[6:8] for each in found])
    miss = np.array([each.velocity[:2] for each in found]) - log.velocity[rows, :2]
    assert (np.abs(miss) < 2.0 * deviation)[rows > 750].mean() > 0.9


def test_a_long_gap_is_in_doubt_and_then_recovered(log):
    rows = [row for row in range(len(log.time)) if not 1500 <= row < 1700]
    found, error, _ = run(log, chosen=rows)
    assert found[1500].doubt.startswith('gap: ')
    assert found[-1].doubt == ''
    assert rms(error[-500:]) < 0.012


def test_long_pushes_on_ice_are_within_the_stated_deviation():
    pytest.importorskip('mujoco')
    log = walks.walk(walks.COURSES['long pushes, ice'], 6, 14.0)
    found, error, _ = run(log)
    walking = slice(750, None)
    assert rms(error[walking]) < 0.018  # "must" on ice, with far shorter pushes
    deviation = np.sqrt([np.diag(each.covariance)[6:8] for each in found])[walking]
    miss = np.array([each.velocity[:2] for each in found])[walking] - log.velocity[walking, :2]
    assert (np.abs(miss) < 2.0 * deviation).mean() > 0.9
    assert doubts(found) <= {'', 'slipping'}
    all_slip = (np.linalg.norm(log.slip, axis=2) > 0.03) | (log.load < 5.0)
    assert all_slip.all(1).sum() > 250  # that is what this walk is for


def test_forces_that_repeat_are_in_doubt(log):
    log.foot_forces[1500:] = log.foot_forces[1499]
    found, _, _ = run(log)
    assert any(each.doubt == 'force: all foot forces repeat' for each in found)


@pytest.mark.parametrize('offset', [-8.0, 25.0])
def test_force_sensors_that_show_something_in_the_air_are_zeroed(log, offset):
    log.foot_forces[..., 2] += offset
    found, error, _ = run(log)
    assert rms(error[750:]) < 0.012
    loads = np.array([[foot.force[2] for foot in each.feet] for each in found[1000:]])
    assert np.abs(loads - log.load[1000:]).mean() < 2.0
    in_contact = np.array([[foot.in_contact for foot in each.feet] for each in found[1000:]])
    assert np.mean(in_contact == (log.load[1000:] > 7.5)) > 0.97
