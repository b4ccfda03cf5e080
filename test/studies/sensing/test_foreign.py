# SPDX-License-Identifier: Apache-2.0
"""The study foreign: readers and figures, on made-up files of the layout of the recordings.

The legs of the robots in these files are three sliding joints, so that the joint positions of a
body that sways and turns over feet that stand still follow from its pose without a model.
"""

import json

import numpy as np
import pytest

from studies.__main__ import main
from studies.sensing import foreign, recordings

MASS, GRAVITY = 12.0, 9.81
HEIGHT, START, LAST = 0.4, 2.0, 6.0  # m, s, s
LEFT, RIGHT = 0.1, -0.1  # m, of the hips

GO1_FEET = ('FR', 'FL', 'RR', 'RL')
GO1_HIPS = np.array([(0.2, RIGHT, 0.0), (0.2, LEFT, 0.0), (-0.2, RIGHT, 0.0), (-0.2, LEFT, 0.0)])
GO1_JOINTS = [tuple(f'{foot}_{part}_joint' for part in ('x', 'y', 'z')) for foot in GO1_FEET]
ICUB_HIPS = np.array([(0.0, LEFT, 0.0), (0.0, RIGHT, 0.0)])
ICUB_PARTS = ('hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll')
ICUB_JOINTS = [tuple(f'{side}_{part}' for part in ICUB_PARTS) for side in 'lr']
AXES = ('1 0 0', '0 1 0', '0 0 1')

SLIP_BEGIN, SLIP_END, SLIP_SPEED = 4.0, 4.2, 0.6  # s, s, m/s


def urdf(imu, feet, hips, joints):
    """Return a robot whose legs slide along x, y, z, and then turn in further joints."""
    parts = [f'<link name="base"><inertial><mass value="{MASS}"/></inertial></link>']
    fixed = '<joint name="{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    parts += [f'<link name="{imu}"/>', fixed.format('base', imu)]
    for foot, hip, names in zip(feet, hips, joints, strict=True):
        parent = 'base'
        for number, name in enumerate(names):
            kind = 'prismatic' if number < 3 else 'continuous'
            place = ' '.join(map(str, hip)) if number == 0 else '0 0 0'
            parts.append(
                f'<link name="{name}_link"/><joint name="{name}" type="{kind}">'
                f'<parent link="{parent}"/><child link="{name}_link"/>'
                f'<origin xyz="{place}"/><axis xyz="{AXES[number % 3]}"/>'
                '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            )
            parent = f'{name}_link'
        parts += [f'<link name="{foot}"/>', fixed.format(parent, foot)]
    return f'<robot name="made_up">{"".join(parts)}</robot>'


class Sway:
    """Pose of a body that rests at first and then sways and turns, in axes of the ground."""

    def __init__(self, time):
        self.since = np.maximum(time - START, 0.0)
        zero = 0.0 * time
        self.position = np.stack([self._wave(0.04, 3.0), self._wave(0.02, 5.0), zero + HEIGHT], 1)
        self.heading = self._wave(0.15, 2.0)
        curve = np.stack([self._curve(0.04, 3.0), self._curve(0.02, 5.0), zero + GRAVITY], 1)
        self.force = self.in_base(curve)
        self.gyro = np.stack([zero, zero, 0.15 * 2.0 * np.sin(2.0 * self.since)], 1)

    def _wave(self, size, rate):
        return size * (1.0 - np.cos(rate * self.since))

    def _curve(self, size, rate):
        return np.where(self.since > 0.0, size * rate**2 * np.cos(rate * self.since), 0.0)

    def in_base(self, vectors):
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        x, y, z = vectors.T
        return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], 1)

    def joints(self, hips, slips):
        """Return lengths of the sliding joints, (n, legs, 3); ``slips`` moves the last foot."""
        found = []
        for leg, hip in enumerate(hips):
            away = np.broadcast_to(hip, self.position.shape) - self.position
            if leg == len(hips) - 1:
                away = away + slips[:, None] * np.array((1.0, 0.0, 0.0))
            found.append(self.in_base(away) - hip)
        return np.stack(found, 1)


def slipped(time, slips):
    """Return how far the last foot has slipped along x, m."""
    return SLIP_SPEED * np.clip(time - SLIP_BEGIN, 0.0, SLIP_END - SLIP_BEGIN) * slips


def write_go1(folder, slips=False, start=0.3):
    """Write a Go1 at 400 Hz and poses at 50 Hz, from ``start`` on."""
    time, seen = np.arange(0.0, LAST, 1.0 / 400.0), np.arange(start, LAST - 0.5, 0.02)
    body, poses = Sway(time), Sway(seen)
    rows = np.zeros((len(time), 23))
    rows[:, 0], rows[:, 1:5] = 40.0 + time, 250.0
    rows[:, 5:8], rows[:, 8:11] = body.force, body.gyro
    rows[:, 11:] = body.joints(GO1_HIPS, slipped(time, slips)).reshape(len(time), 12)
    table = np.zeros((len(seen), 8))  # begins with an index
    table[:, 1:4], table[:, 6] = poses.position, np.sin(0.5 * poses.heading)
    table[:, 7] = np.cos(0.5 * poses.heading)
    feet = [f'{foot}_foot' for foot in GO1_FEET]
    (folder / 'go1.urdf').write_text(urdf('imu_link', feet, GO1_HIPS, GO1_JOINTS))
    for name, values in (('go1.csv', rows), ('go1_odom.csv', table)):
        np.savetxt(folder / name, values, delimiter=',', header='columns', comments='')


def write_icub(folder, slips=False, **replaced):
    """Write an iCub at 100 Hz, with stamps that jitter."""
    h5py = pytest.importorskip('h5py')
    time = np.arange(0.0, LAST, 0.01)
    body = Sway(time)
    q = np.zeros((len(time), 26))
    for leg, lengths in enumerate(np.moveaxis(body.joints(ICUB_HIPS, slipped(time, slips)), 1, 0)):
        q[:, 14 + 6 * leg : 17 + 6 * leg] = lengths
    late = np.random.default_rng(1).uniform(0.0, 0.008, len(time))
    late[[0, -1]] = 0.0
    fields = {
        'estimatorJointsTime': 1.6e9 + time + late,
        'estimatorJointsPos': q,
        'estimatorJointsVel': np.gradient(q, time, axis=0),
        'imuOmega': body.gyro,
        'imuAcc': body.force,
        'lfForceZ': np.full(len(time), 0.5 * MASS * GRAVITY),
        'rfForceZ': np.full(len(time), 0.5 * MASS * GRAVITY),
        'linkBasePos': body.position,
        'linkBaseRot': np.stack([0.0 * time, 0.0 * time, body.heading], 1),
    } | replaced
    with h5py.File(folder / 'walking.mat', 'w') as file:
        for name, values in fields.items():
            if values is not None:
                file[name] = np.reshape(values, (len(values), -1)).T
    soles = ('l_sole', 'r_sole')
    text = urdf('root_link_imu_frame', soles, ICUB_HIPS, ICUB_JOINTS)
    (folder / 'model.urdf').write_text(text)


def rows_of(capsys, *words):
    assert main(['foreign', *map(str, words), '--json']) == 0
    return {row['method']: row for row in json.loads(capsys.readouterr().out)}


WRITERS = {'go1': write_go1, 'icub': write_icub}


@pytest.mark.parametrize('robot', WRITERS)
def test_a_body_that_sways_over_feet_that_stick(robot, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(foreign, 'METHODS', ('estimator', 'odometry'))
    WRITERS[robot](tmp_path)
    row = rows_of(capsys, f'--{robot}', tmp_path)['estimator']
    assert row['recording'] == robot
    assert row['position_error'] < 2e-3  # of 80 mm
    assert row['velocity_error'] < 5e-3  # of 0.12 m/s
    assert row['slip_most'] < 0.02
    assert row['flagged'] == row['alarms'] == row['doubt'] == 0


@pytest.mark.parametrize('robot', ['go1'])
def test_a_foot_that_slips_is_reported(robot, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(foreign, 'METHODS', ('estimator',))
    WRITERS[robot](tmp_path, slips=True)
    row = rows_of(capsys, f'--{robot}', tmp_path)['estimator']
    # One foot slips for 0.2 s.
    feet = {'go1': 4, 'icub': 2}[robot]
    share = (SLIP_END - SLIP_BEGIN) / (LAST - START) / feet
    assert row['flagged'] == pytest.approx(share, rel=0.5)
    assert row['alarms'] > 0


def test_the_clock_of_the_cameras_is_found(tmp_path):
    write_go1(tmp_path, start=0.3)
    start, rate = foreign.clock(recordings.go1(tmp_path))
    assert start == pytest.approx(0.3, abs=0.01)
    assert rate == pytest.approx(50.0, abs=0.1)


def test_readings_are_those_of_the_file(tmp_path):
    write_go1(tmp_path)
    found = recordings.go1(tmp_path)
    rows = np.genfromtxt(tmp_path / 'go1.csv', delimiter=',', skip_header=1)
    assert found.rate == pytest.approx(400.0)
    np.testing.assert_array_equal(found.gyro, rows[:, 8:11])
    np.testing.assert_allclose(found.foot_forces[..., 2], 0.25 * MASS * GRAVITY)
    assert not found.foot_forces[..., :2].any()
    write_icub(tmp_path)
    found = recordings.icub(tmp_path)
    assert found.rate == pytest.approx(100.0)
    np.testing.assert_allclose(found.foot_forces[:, :, 2], 0.5 * MASS * GRAVITY)
    feet = found.robot.foot_positions(found.joint_positions[0])
    np.testing.assert_allclose(feet, ICUB_HIPS - (0.0, 0.0, HEIGHT), atol=1e-12)
