# SPDX-License-Identifier: Apache-2.0
"""Body and feet against motions whose truth is known by construction, and bad input."""

import dataclasses
import math

import numpy as np
import pytest

from ros_pad.errors import InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.rotation import from_rpy, transform
from ros_pad.sensing import BodyEstimator

DT = 0.004
UP = np.array((0.0, 0.0, 9.81))
POINTED = dataclasses.replace(Robot.load('go2', foot_radius=0.0), imu=np.eye(4))
HOME = POINTED.foot_positions(POINTED.home)
STANDING = np.tile((0.0, 0.0, POINTED.mass * 9.81 / 4.0), (4, 1))


class Motion:
    """Readings of a robot whose body and feet move as given, with its axes along the world's."""

    def __init__(self, robot=POINTED, noise=0.0, seed=0, **arguments):
        self.robot = robot
        self.estimator = BodyEstimator(robot, **arguments)
        self.noise = noise
        self.generator = np.random.default_rng(seed)
        self.time, self.q = 0.0, robot.home.copy()
        self.feet = robot.foot_positions(robot.home)
        self.velocity, self.place = np.zeros(3), np.zeros(3)
        self.gyro_bias = np.zeros(3)

    def step(self, velocity=(0.0, 0.0, 0.0), slips=0.0, forces=STANDING):
        """Move for one sample: velocity of the body, velocities of the feet over the ground."""
        velocity = np.asarray(velocity, dtype=float)
        acceleration = (velocity - self.velocity) / DT
        mean = 0.5 * (velocity + self.velocity)
        self.velocity, self.place = velocity, self.place + mean * DT
        self.feet = self.feet + (slips - mean) * DT
        self.q = self.robot.joint_positions(self.feet, near=self.q)
        lines = self.robot.kinematics(self.q).jacobians
        dq = np.linalg.solve(lines, np.broadcast_to(slips - velocity, (4, 3))[..., None])
        self.time += DT
        return self.read(acceleration, self.q, dq[..., 0], forces)

    def read(self, acceleration, q, dq, forces):
        def noisy(values, deviation):
            size = self.noise * deviation
            return values + size * self.generator.standard_normal(np.shape(values))

        return self.estimator.update(
            self.time,
            noisy(self.gyro_bias, 0.005),
            noisy(acceleration + UP, 0.05),
            noisy(q.ravel(), 5e-4),
            noisy(dq.ravel(), 0.03),
            noisy(forces, 0.3),
        )


def speed_at(time):
    """Return a velocity that rises to 0.2 m/s along x within 0.2 s."""
    return (0.1 - 0.1 * math.cos(math.pi * min(time / 0.2, 1.0)), 0.0, 0.0)


def test_a_robot_at_rest_stays_where_it_is_and_learns_the_bias_of_its_gyro():
    motion = Motion(noise=1.0)
    motion.gyro_bias = np.array((0.01, -0.02, 0.015))
    found = [motion.step() for _ in range(1000)]
    last = found[-1]
    assert last.position == pytest.approx(np.zeros(3), abs=2e-3)
    assert np.mean([foot.excluded for each in found[50:] for foot in each.feet]) < 0.005
    assert all(foot.in_contact for foot in last.feet)
    assert {each.doubt for each in found} == {''}
    # Without the bias it would turn by 0.015 rad/s x 4 s = 60 mrad.
    assert abs(2.0 * last.orientation[2]) < 0.01
    assert np.linalg.norm(last.orientation) == pytest.approx(1.0)
    heights = [foot.position[2] for foot in last.feet]
    assert heights == pytest.approx(HOME[:, 2].tolist(), abs=3e-3)


@pytest.mark.parametrize('noise', [0.0, 1.0])
def test_velocity_and_path_of_a_body_over_feet_that_stick(noise):
    motion = Motion(noise=noise)
    for _ in range(250):
        motion.step()
    for tick in range(150):
        found = motion.step(speed_at(tick * DT))
        assert found.velocity == pytest.approx(motion.velocity, abs=0.008)
    assert found.position == pytest.approx(motion.place, abs=3e-3)
    for foot in found.feet:
        assert np.linalg.norm(foot.slip_velocity) < 5.0 * foot.slip_velocity_sd
        assert not foot.excluded
    assert found.covariance == pytest.approx(found.covariance.T, abs=1e-12)
    assert np.linalg.eigvalsh(found.covariance).min() > -1e-12


@pytest.mark.parametrize('feet', [[0], [1, 2, 3]])
def test_slips_are_found_and_do_not_drag_the_body_along(feet):
    motion = Motion(noise=1.0)
    for _ in range(250):
        motion.step()
    slips = np.zeros((4, 3))
    slips[feet, 1] = 0.1
    found = [motion.step((0.0, 0.0, 0.0), slips) for _ in range(50)]
    for leg, foot in enumerate(found[-1].feet):
        expected = [0.0, 0.1 if leg in feet else 0.0]
        assert foot.slip_velocity == pytest.approx(expected, abs=0.025)
        assert foot.excluded == (leg in feet)
    assert max(np.abs(each.velocity).max() for each in found) < 0.012
    after = [motion.step() for _ in range(50)]
    assert not any(foot.excluded for foot in after[-1].feet)


def test_when_all_feet_slip_the_imu_tells_and_there_is_a_doubt():
    motion = Motion(noise=1.0)
    for _ in range(250):
        motion.step()
    slips = np.tile((0.1, 0.0, 0.0), (4, 1))
    found = [motion.step((0.0, 0.0, 0.0), slips) for _ in range(110)]
    assert all(foot.excluded for foot in found[30].feet)
    assert found[60].velocity == pytest.approx(np.zeros(3), abs=0.02)
    assert found[-1].doubt.startswith('slipping: ')
    assert found[30].doubt == ''


def test_rolling_feet_take_the_body_along():
    """Feet that roll move their centres by r w x n; an estimator without that is too slow."""
    errors = []
    for radius in (0.022, 0.0):
        robot = dataclasses.replace(POINTED, foot_radius=radius)
        motion = Motion(robot)
        velocity = np.zeros(3)
        for tick in range(300):
            ahead = np.array(speed_at((tick - 200) * DT)) if tick > 200 else np.zeros(3)
            mean = 0.5 * (velocity + ahead)

            def rates(q, speed):
                # J q' = r (w x n) - v with w = Jw q' and n = z, of a ball of 0.022 m.
                turn = np.array(((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
                lines = (
                    POINTED.kinematics(q).jacobians - 0.022 * turn @ POINTED.kinematics(q).angular
                )
                return np.linalg.solve(lines, np.tile(-speed, (4, 1))[..., None])[..., 0]

            half = motion.q + 0.5 * DT * rates(motion.q, mean)
            motion.q = motion.q + DT * rates(half, mean)
            motion.time += DT
            found = motion.read(
                (ahead - velocity) / DT, motion.q, rates(motion.q, ahead), STANDING
            )
            velocity = ahead
        errors.append(abs(found.velocity[0] - 0.2))
    assert errors[0] < 0.003
    assert errors[1] > 0.008


def test_a_lifted_body_is_in_doubt_and_its_deviation_grows():
    motion = Motion(noise=1.0)
    for _ in range(250):
        stood = motion.step()
    for _ in range(250):
        found = motion.step(forces=np.zeros((4, 3)))
        assert np.isfinite(found.velocity).all()
    assert found.doubt == 'no contact: no foot stands'
    assert found.covariance[6, 6] > 4.0 * stood.covariance[6, 6]
    assert not any(foot.in_contact or foot.excluded for foot in found.feet)
    for _ in range(50):
        found = motion.step()
    assert found.doubt == ''


def test_a_robot_on_a_slope_knows_it():
    tilt = from_rpy((0.1, -0.2, 0.0))
    estimator = BodyEstimator(POINTED)
    q = POINTED.home.ravel()
    for tick in range(250):
        found = estimator.update(tick * DT, np.zeros(3), UP @ tilt, q, 0.0 * q, STANDING @ tilt)
    x, y, z, w = found.orientation
    up = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    assert up == pytest.approx(tilt[2].tolist(), abs=2e-3)
    assert found.position == pytest.approx(np.zeros(3), abs=2e-3)


def test_the_place_of_the_imu_does_not_matter():
    pose = transform((0.1, -0.05, 0.08), from_rpy((0.3, -0.2, 2.0)))
    other = dataclasses.replace(POINTED, imu=pose)
    plain, moved = Motion(), Motion(other)
    moved.estimator.update, inner = None, moved.estimator.update

    def turned(time, gyro, force, *rest):
        return inner(time, gyro @ pose[:3, :3], force @ pose[:3, :3], *rest)

    moved.estimator.update = turned
    for tick in range(150):
        velocity = speed_at((tick - 100) * DT) if tick > 100 else (0.0, 0.0, 0.0)
        first, second = plain.step(velocity), moved.step(velocity)
    assert second.velocity == pytest.approx(first.velocity, abs=2e-3)
    assert second.position == pytest.approx(first.position, abs=2e-3)
    assert second.orientation == pytest.approx(first.orientation, abs=2e-3)
    for one, two in zip(first.feet, second.feet, strict=True):
        assert two.position == pytest.approx(one.position, abs=2e-3)
        assert two.force == pytest.approx(one.force, abs=0.5)


def test_forces_from_torques_and_in_the_axes_of_the_feet():
    q = POINTED.home.ravel()
    # Static balance of each leg: torques carry the leg and press the foot on the ground.
    torques = POINTED.chains.gravity_torques(POINTED.kinematics(q), -UP)
    torques = torques - (POINTED.kinematics(q).jacobians[:, 2] * STANDING[0, 2])
    readings = (np.zeros(3), UP, q, 0.0 * q)
    found = BodyEstimator(POINTED).update(0.0, *readings, efforts=torques.ravel())
    turned = (POINTED.kinematics(q).rotations.transpose(0, 2, 1) @ STANDING[..., None])[..., 0]
    other = BodyEstimator(POINTED, force_axes='foot').update(0.0, *readings, turned)
    for estimate, near in ((found, 1.0), (other, 1e-6)):
        for foot, force in zip(estimate.feet, STANDING, strict=True):
            assert foot.force == pytest.approx(force, abs=near)
            assert foot.in_contact


def test_without_forces_there_is_a_doubt():
    q = POINTED.home.ravel()
    found = BodyEstimator(POINTED).update(0.0, np.zeros(3), UP, q, 0.0 * q)
    assert found.doubt.startswith('force: ')
    assert not any(foot.in_contact or foot.excluded for foot in found.feet)


def test_gaps_and_clocks_that_go_back():
    motion = Motion()
    for _ in range(100):
        motion.step()
    motion.time += 0.1
    found = motion.step()
    assert found.doubt == ''
    assert all(foot.excluded for foot in found.feet)  # they have just landed
    motion.time += 1.0
    assert motion.step().doubt.startswith('gap: ')
    for _ in range(100):
        found = motion.step()
    assert found.doubt == ''
    assert found.velocity == pytest.approx(np.zeros(3), abs=5e-3)
    motion.time = -50.0
    found = motion.step()
    assert found.doubt.startswith('clock: ')
    assert found.position == pytest.approx(np.zeros(3), abs=1e-9)
    for _ in range(100):
        found = motion.step()
    assert found.doubt == ''


@pytest.mark.parametrize(
    ('index', 'value', 'message'),
    [
        (0, math.nan, 'time'),
        (1, [0.0, math.nan, 0.0], 'gyro = nan'),
        (2, [0.0, 0.0], 'accelerometer of shape'),
        (3, np.zeros(11), 'joint_positions of shape'),
        (4, np.full(12, math.nan), 'joint_velocities = nan'),
        (5, np.zeros((3, 3)), 'foot_forces of shape'),
    ],
)
def test_bad_readings_are_refused_and_change_nothing(index, value, message):
    motion, other = Motion(noise=1.0), Motion(noise=1.0)
    for _ in range(20):
        motion.step()
        other.step()
    q = POINTED.home.ravel()
    readings = [motion.time + DT / 2, np.zeros(3), UP, q, 0.0 * q, STANDING, 0.0 * q]
    readings[index] = value
    with pytest.raises(InvalidInput, match=message):
        motion.estimator.update(*readings)
    one, two = motion.step(), other.step()
    assert np.array_equal(one.velocity, two.velocity)
    assert np.array_equal(one.covariance, two.covariance)
    with pytest.raises(InvalidInput, match=r'time = .* s is not allowed: another time'):
        motion.estimator.update(motion.time, *readings[1:5])


def test_wild_readings_never_give_nan():
    generator = np.random.default_rng(3)
    estimator = BodyEstimator(POINTED)
    time = 0.0
    for _ in range(400):
        time += float(generator.choice((1e-4, 0.004, 0.05, 0.5)))
        size = 10.0 ** generator.uniform(-2.0, 2.3)
        found = estimator.update(
            time,
            *(size * generator.standard_normal((2, 3))),
            *generator.uniform(-3.0, 3.0, (2, 12)),
            size * generator.standard_normal((4, 3)),
        )
        assert np.isfinite(found.covariance).all()
        assert np.isfinite([*found.position, *found.velocity, *found.orientation]).all()
        for foot in found.feet:
            assert np.isfinite([*foot.slip_velocity, foot.slip_velocity_sd, *foot.force]).all()


def test_joints_whose_velocity_is_not_theirs_are_named():
    estimator = BodyEstimator(POINTED)
    q = POINTED.home.ravel()
    for tick in range(400):
        rates = np.full(12, 0.4)
        found = estimator.update(
            tick * DT,
            np.zeros(3),
            UP,
            q + tick * DT * rates * (np.arange(12) != 7),
            rates,
            STANDING,
        )
    assert found.doubt == 'joints: the position of RL_thigh_joint does not follow its velocity'


@pytest.mark.parametrize(('rate', 'kind'), [(50.0, ''), (25.0, 'rate')])
def test_a_rate_at_which_no_foothold_is_kept_is_named(rate, kind):
    estimator = BodyEstimator(POINTED)
    still = np.zeros(POINTED.home.size)
    for step in range(50):
        found = estimator.update(
            step / rate, np.zeros(3), (0.0, 0.0, 9.81), POINTED.home.ravel(), still, STANDING
        )
    assert found.doubt.partition(':')[0] == kind
    if kind:
        assert '0.04 s apart' in found.doubt
