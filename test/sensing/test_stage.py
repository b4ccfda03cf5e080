# SPDX-License-Identifier: Apache-2.0
"""Pairing of IMU, joints and forces by their stamps, and what is missing."""

import math

import numpy as np
import pytest

from ros_pad.errors import InvalidInput
from ros_pad.robots import Robot
from ros_pad.sensing import BodyEstimator, SensingStage
from ros_pad.sensing.stage import sample_of

MS = 1_000_000
ROBOT = Robot.load('ch3r')
HOME = ROBOT.home.ravel()
STILL = np.zeros(18)
UP = (0.0, 0.0, 9.81)
SHARE = ROBOT.mass * 9.81 / 6.0


class Watched:
    """A stage whose samples and output are recorded; the robot stands still."""

    def __init__(self, begun=True, **options):
        self.used, self.emitted, self.doubts, self.rejected = [], [], [], []
        estimator = BodyEstimator(ROBOT, force_axes='foot')
        update = estimator.update

        def noting(*readings):
            self.used.append(readings)
            return update(*readings)

        estimator.update = noting
        self.stage = SensingStage(
            ROBOT,
            estimator,
            lambda stamp_ns, estimate: self.emitted.append((stamp_ns, estimate)),
            self.doubts.append,
            self.rejected.append,
            **options,
        )
        if begun:  # the wait for a calm robot is over
            self.stage.samples = 1

    def imu(self, ms, rate=0.0, pull=UP):
        self.stage.imu(round(ms * MS), (rate, 0.0, 0.0), pull)

    def joints(self, ms, positions=HOME, velocities=STILL, efforts=None):
        self.stage.joints(round(ms * MS), positions, velocities, efforts)

    def forces(self, ms, load=SHARE):
        for leg in range(6):
            self.stage.force(leg, round(ms * MS), (0.0, 0.0, load))

    def sample(self, ms):
        self.forces(ms)
        self.imu(ms)
        self.joints(ms)

    @property
    def times(self):
        return [round(each[0] * 1e3, 6) for each in self.used]


@pytest.mark.parametrize('order', ['fij', 'jif'])
def test_readings_of_one_moment_are_one_sample_in_any_order(order):
    watched = Watched()
    for ms in (4, 8, 12):
        for kind in order:
            {'f': watched.forces, 'i': watched.imu, 'j': watched.joints}[kind](ms)
    # Before the first force has come, none is awaited.
    assert watched.times == [4, 8, 12]
    assert all(used[5] is not None for used in watched.used[1:])


def test_between_two_readings_of_the_imu_it_is_interpolated():
    watched = Watched()
    watched.imu(4, 0.1)
    watched.joints(6)
    assert watched.times == []  # it waits
    watched.imu(12, 0.5)
    assert watched.times == [6]
    assert watched.used[0][1][0] == pytest.approx(0.2)


def test_an_imu_too_far_apart_is_not_used():
    watched = Watched()
    for ms in range(0, 1000, 20):  # 50 Hz
        watched.imu(ms)
        watched.joints(ms - 8)
        watched.stage.tick(ms * MS)
    assert watched.times == []
    assert watched.doubts == ['stamps: IMU and joints are 8 ms apart']


@pytest.mark.parametrize('source', ['IMU', 'joints'])
def test_stamps_that_do_not_advance_are_named(source):
    watched = Watched()
    watched.sample(4)
    for ms in range(8, 700, 4):
        watched.imu(8 if source == 'IMU' else ms)
        watched.joints(8 if source == 'joints' else ms)
        watched.stage.tick(ms * MS)
    assert watched.stage.doubt == f'stamps: those of the {source} do not advance'


@pytest.mark.parametrize(
    ('sends', 'doubt'),
    [
        ((), 'no IMU and no joints: for 0.'),
        (('joints',), 'no IMU: for 0.'),
        (('imu',), 'no joints: for 0.'),
    ],
)
def test_silence_is_named(sends, doubt):
    watched = Watched()
    watched.sample(4)
    for ms in range(8, 700, 4):
        for kind in sends:
            getattr(watched, kind)(ms)
        watched.stage.tick(ms * MS)
    assert watched.times == [4]
    assert watched.stage.doubt.startswith(doubt)
    assert watched.doubts[-1].startswith(doubt)


def test_after_a_silence_the_estimate_goes_on_with_its_own_doubt():
    watched = Watched()
    for ms in range(4, 400, 4):
        watched.sample(ms)
    assert watched.stage.doubt == ''
    for ms in range(400, 1000, 100):
        watched.stage.tick(ms * MS)
    assert watched.stage.doubt.startswith('no IMU')
    watched.sample(1000)
    assert watched.stage.doubt.startswith('gap: no readings for 0.6')
    assert np.isinf(sample_of(watched.emitted[-1][1])['variance']).all()
    for ms in range(1004, 1500, 4):
        watched.sample(ms)
    assert watched.stage.doubt == ''


def test_positions_are_differentiated_where_velocities_are_missing():
    watched = Watched()
    for ms in (4, 8):
        watched.imu(ms)
        watched.joints(ms, HOME + 0.001 * ms, None)
    assert watched.times == [8]  # the first has nothing before it
    assert watched.used[0][4] == pytest.approx(np.ones(18))
    assert watched.stage.differentiates
    watched.imu(200)
    watched.joints(200, HOME, None)  # too long ago
    watched.imu(204)
    watched.joints(204)
    assert watched.times == [8, 204]
    assert not watched.stage.differentiates


@pytest.mark.parametrize(
    ('source', 'forces', 'efforts', 'used'),
    [
        ('auto', True, True, 'forces'), ('auto', False, True, 'efforts'),
        ('efforts', True, True, 'efforts'), ('feet', False, True, 'none'),
        ('auto', False, False, 'none'),
    ],
)  # fmt: skip
def test_the_source_of_forces(source, forces, efforts, used):
    watched = Watched(forces=source)
    for ms in (4, 8):
        if forces:
            watched.forces(ms)
        watched.imu(ms)
        watched.joints(ms, efforts=STILL if efforts else None)
    given = watched.used[-1]
    assert (
        'forces' if given[5] is not None else 'efforts' if given[6] is not None else 'none'
    ) == (used)
    if used == 'none':
        assert watched.stage.doubt == 'force: neither foot forces nor efforts'


def test_forces_are_awaited_until_the_next_joints_then_the_last_ones_count():
    watched = Watched()
    watched.sample(4)
    watched.imu(8)
    watched.joints(8)
    assert watched.times == [4]
    watched.imu(12)
    watched.joints(12)
    assert watched.times == [4, 8]
    assert watched.used[-1][5] is not None
    for ms in range(16, 40, 4):
        watched.imu(ms)
        watched.joints(ms)
    assert watched.times[-1] == 36
    assert watched.used[-1][5] is None  # older than 20 ms
    assert watched.stage.doubt.startswith('force: stamps of the feet are -32 ms after')


def test_forces_of_another_clock_are_named():
    watched = Watched()
    for ms in range(4, 400, 4):
        watched.forces(ms + 1000)
        watched.imu(ms)
        watched.joints(ms)
    assert watched.used[-1][5] is None
    assert watched.stage.doubt.startswith('force: stamps of the feet are 1e+03 ms after')


def test_forces_of_a_later_moment_wait_for_it():
    watched = Watched()
    watched.sample(4)
    watched.joints(8)  # the IMU is late
    for ms in (8, 12, 16):
        watched.forces(ms, 100.0 + ms)
    watched.imu(8)
    assert watched.times == [4, 8]
    assert watched.used[-1][5][:, 2] == pytest.approx([108.0] * 6)
    watched.imu(16)
    watched.joints(16)
    assert watched.used[-1][5][:, 2] == pytest.approx([116.0] * 6)


@pytest.mark.parametrize(
    ('spoil', 'named'),
    [
        (lambda each: each.imu(8, math.nan), 'gyro = nan'),
        (lambda each: each.joints(8, HOME + math.inf), 'joint positions = '),
        (lambda each: each.joints(8, HOME[:5]), 'joint positions of shape'),
        (lambda each: each.stage.force(2, 8 * MS, (0.0, 1e9, 0.0)), 'foot force = 1000000000.0'),
    ],
)
def test_bad_readings_are_refused_and_leave_no_trace(spoil, named):
    watched = Watched()
    watched.sample(4)
    spoil(watched)
    (error,) = watched.rejected
    assert isinstance(error, InvalidInput)
    assert named in str(error)
    watched.sample(8)
    assert watched.times == [4, 8]
    assert all(np.isfinite(np.concatenate([np.ravel(x) for x in each[:6]])).all()
               for each in watched.used)  # fmt: skip


def test_readings_that_come_twice_or_late_count_once():
    watched = Watched()
    watched.sample(4)
    watched.sample(8)
    watched.sample(8)
    watched.sample(4)
    watched.sample(12)
    assert watched.times == [4, 8, 12]
    assert not watched.rejected


def test_a_clock_that_is_set_back_begins_anew():
    watched = Watched()
    for ms in range(10_000, 10_400, 4):
        watched.sample(ms)
    for ms in range(4, 200, 4):
        watched.sample(ms)
    assert watched.times[-2:] == [192, 196]
    assert watched.stage.doubt == 'clock: time went back, odom begins anew'
    for ms in range(200, 600, 4):
        watched.sample(ms)
    assert watched.stage.doubt == ''


def test_nothing_that_is_not_finite_is_emitted():
    """Readings are finite, and as wild as the ranges allow."""
    generator = np.random.default_rng(3)
    watched = Watched()
    for ms in range(4, 2000, 4):
        size = 10.0 ** generator.uniform(-2, 6)
        watched.forces(ms, size * generator.standard_normal())
        watched.stage.imu(ms * MS, size * generator.standard_normal(3),
                          size * generator.standard_normal(3))  # fmt: skip
        watched.joints(
            ms, size * generator.standard_normal(18), size * generator.standard_normal(18)
        )
    assert len(watched.emitted) > 100
    for _, estimate in watched.emitted:
        rows = sample_of(estimate)
        for name in ('force', 'position', 'velocity'):
            assert np.isfinite(rows[name]).all()
        assert not np.isnan(rows['variance']).any() and np.isnan(rows['moment']).all()
        assert np.isfinite(estimate.covariance).all()


def test_estimation_begins_when_the_robot_is_calm():
    watched = Watched(begun=False)
    for ms in range(4, 61, 4):
        watched.forces(ms)
        watched.imu(ms, pull=(8.0, 0.0, 9.0) if ms < 30 else UP)
        watched.joints(ms)
    assert watched.times == [48, 52, 56, 60]  # 32, 36, 40, 44 and 48 are five calm readings
