# SPDX-License-Identifier: Apache-2.0
"""Walks that are changed to show where estimates of the velocity diverge, and their laws."""

import dataclasses

import numpy as np
import pytest

from ros_pad.robots import Robot
from ros_pad.robots.rotation import cross, matrix
from studies.sensing import stability, walks

GO2 = Robot.load('go2')
CALM = walks.Course(noise=walks.Noise(*[0.0] * 8))


@pytest.fixture(scope='module')
def log():
    pytest.importorskip('mujoco')
    return walks.walk(CALM, 1, 6.0)


def centres(log):
    """Return places and velocities of the feet from body and joints, (n, legs, 3)."""
    turns = np.array([matrix(turn) for turn in log.orientation])
    shape = (-1, *GO2.home.shape)
    joints, rates = log.joint_positions.reshape(shape), log.joint_velocities.reshape(shape)
    arms = np.array([GO2.foot_positions(q) for q in joints])
    moving = np.array(
        [GO2.kinematics(q).jacobians @ dq[..., None] for q, dq in zip(joints, rates, strict=True)]
    )[..., 0]
    moving += cross((log.gyro @ GO2.imu[:3, :3].T)[:, None], arms)
    places = log.position[:, None] + np.einsum('nij,nlj->nli', turns, arms)
    return places, log.velocity[:, None] + np.einsum('nij,nlj->nli', turns, moving)


def test_feet_slide_as_they_should_under_the_same_body(log):
    speeds = np.zeros((len(log.time), 4, 2))
    speeds[:, 1] = stability.sliding(log.time, (3.5,), 2.0)[:, None] * (0.1, -0.2)
    slid = stability.slid(GO2, log, speeds)
    places, velocities = centres(slid)
    before, usual = centres(log)
    away = places - before
    np.testing.assert_allclose(away[:, [0, 2, 3]], 0.0, atol=1e-8)
    np.testing.assert_array_equal(away[log.time < 3.5], 0.0)
    np.testing.assert_allclose(slid.feet - log.feet, away, atol=1e-8)
    stands = (log.load[:, 1] > stability.UNLOADED) & (log.time > 3.6) & (log.time < 5.4)
    change = (velocities - usual)[stands, 1]
    np.testing.assert_allclose(change, np.tile((0.1, -0.2, 0.0), (len(change), 1)), atol=1e-3)
    np.testing.assert_allclose(
        np.diff(away[:, 1], axis=0)[stands[1:]] * CALM.rate, change, atol=1e-6
    )
    np.testing.assert_array_equal(slid.accelerometer, log.accelerometer)


def test_the_law_of_low_rates_grows_with_the_step(log, monkeypatch):
    monkeypatch.setattr(stability, 'SETTLED', 3.0)

    def missed(every):
        rows = slice(None, None, every)
        names = [each.name for each in dataclasses.fields(log)]
        return stability.missed(GO2, walks.Log(**{k: getattr(log, k)[rows] for k in names}))

    assert missed(1) < 2e-3 < 5e-3 < missed(10) < 0.05  # m/s


def test_while_all_feet_slip_the_accelerometer_carries_the_velocity_on(monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'BEGINS', (5.0,))
    monkeypatch.setattr(stability, 'DURATION', 10.1)
    case = 'all feet slip apart'
    curves = stability.curves(case, [stability.over_time(case, 1)])
    found = {curve.method: curve for curve in curves}
    best, law = found['estimator'], found['law']
    for index, x in enumerate(law.x):
        if x > 0.1:
            assert best.error[index] < law.error[index]
    assert stability.first(law, law.error, stability.LIMIT) == pytest.approx(1.4, abs=0.3)
    assert stability.first(best, best.doubt, 0.5) == pytest.approx(0.3, abs=0.05)
    doubts = [d for x, d in zip(best.x, best.doubt, strict=True) if 0.5 < x < 2.5]
    assert min(doubts) == 1.0
    assert best.error[-1] < 0.01  # recovered
    assert not any(best.silent)
    assert stability.first(found['odometry'], found['odometry'].error, 0.08) < 0.3
