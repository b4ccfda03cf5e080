# SPDX-License-Identifier: Apache-2.0
"""Readers of recordings of real robots made by others: an iCub and a Unitree Go1.

Nothing of them is stored here; each reader takes the folder into which its files were put.
"""

from __future__ import annotations

import importlib
import pathlib
from typing import Any, NamedTuple

import numpy as np

from ros_pad.errors import InvalidInput
from ros_pad.robots import Chains, Gait, Robot, urdf
from ros_pad.robots.rotation import Array, from_rpy, matrix
from studies.sensing.walks import Noise

ICUB = 'https://github.com/ami-iit/paper_ramadoss-2022-iros-humanoid-base-estimation'
GO1 = 'https://github.com/mrsp/serow'
SOURCES = {
    'icub': f'{ICUB} (BSD-3-Clause), folder src/resources/iCubGenova04: walking.mat, model.urdf',
    'go1': f'{GO1} (GPL-3.0): evaluation/unit_tests/data/go1.csv, urdf/go1.urdf, and'
    ' test/data/go1_odom.csv of commit 9201120',
}
"""Where the files of each robot are."""

GO1_OFFSET = 6.0
"""Counts that a foot of the Go1 shows below zero in the air, as its authors take off."""

GO1_RADIUS = 0.02  # m, radius of the sphere of a foot in the Go1's URDF

_LEG = ('hip_pitch', 'hip_roll', 'hip_yaw', 'knee', 'ankle_pitch', 'ankle_roll')
_ICUB_JOINTS = slice(14, 26)  # the legs among the 26 joints, left leg first
_GO1_FEET = ('FR', 'FL', 'RR', 'RL')


class Recording(NamedTuple):
    """Readings of a robot, one row each, and the poses of its base that cameras saw.

    Attributes
    ----------
    name : str
    robot : Robot
    noise : Noise
        Standard deviations of its sensors, as taken for the estimators.
    rate : float
        Readings a second, Hz.
    gyro, accelerometer : array (n, 3)
        IMU axes, rad/s, m/s².
    joint_positions, joint_velocities : array (n, joints)
        In the order of the robot, rad, rad/s.
    foot_forces : array (n, legs, 3)
        Axes of the base, N.
    seen_position : array (m, 3)
        Of the base in axes of the cameras, z up, m.
    seen_turn : array (m, 3, 3)
        Rotation matrices from the base to these axes.
    seen_rate : float
        Poses a second, Hz; 0 where it is not known.
    """

    name: str
    robot: Robot
    noise: Noise
    rate: float
    gyro: Array
    accelerometer: Array
    joint_positions: Array
    joint_velocities: Array
    foot_forces: Array
    seen_position: Array
    seen_turn: Array
    seen_rate: float


def icub(folder: pathlib.Path) -> Recording:
    """Read ``walking.mat`` and ``model.urdf`` of :data:`ICUB`.

    The stamps of the file are those of messages and jitter by up to 17 ms around a period of
    10 ms; readings are taken to be evenly spaced, because the joint velocities then agree with the
    joint positions. Of the force only the component along the normal of each sole is known.

    Raises
    ------
    InvalidInput
        When h5py is not installed, a file is absent or lacks a field, or values are not finite.
    """
    path = _found(folder, 'walking.mat', 'icub')
    try:
        h5py: Any = importlib.import_module('h5py')
    except ImportError:
        raise InvalidInput(f'{path} is an HDF5 file: run `pip install h5py`') from None
    columns = {
        'estimatorJointsTime': 1, 'estimatorJointsPos': 26, 'estimatorJointsVel': 26,
        'imuOmega': 3, 'imuAcc': 3, 'lfForceZ': 1, 'rfForceZ': 1,
        'linkBasePos': 3, 'linkBaseRot': 3,
    }  # fmt: skip
    try:
        with h5py.File(path, 'r') as file:
            fields = {key: np.array(file[key], dtype=float).T for key in columns if key in file}
    except OSError as error:
        raise InvalidInput(f'{path}: {error}') from None
    for key, count in columns.items():
        _check(path, key, fields.get(key), len(fields.get('estimatorJointsTime', ())), count)
    time, q, dq, gyro, force, left, right, position, angles = fields.values()
    robot = two_legs(_found(folder, 'model.urdf', 'icub'))
    q, dq = q[:, _ICUB_JOINTS], dq[:, _ICUB_JOINTS]
    normals = np.array([robot.kinematics(row).rotations[:, :, 2] for row in q])
    rate = (len(time) - 1) / float(time[-1, 0] - time[0, 0])
    # Deviations of gyro, accelerometer and encoders are those of the authors' filters.
    noise = Noise(0.01, 0.09, np.deg2rad(0.1), 0.1, 2.0, accelerometer_bias=0.05)
    return Recording(
        *('icub', robot, noise, rate, gyro, force, q, dq),
        foot_forces=np.concatenate([left, right], axis=1)[..., None] * normals,
        seen_position=position,
        seen_turn=np.array([from_rpy(row) for row in angles]),
        seen_rate=rate,
    )


def two_legs(path: pathlib.Path) -> Robot:
    """Return the legs of an iCub; :meth:`Robot.load` refuses a robot with two legs."""
    file, legs, feet = urdf.read(path, ('l_sole', 'r_sole'))
    names = tuple(joint.name for joints in legs for joint in joints)
    if names != tuple(f'{side}_{name}' for side in 'lr' for name in _LEG):
        raise InvalidInput(f'{path}: joints of the legs are {names}: those of an iCub are needed')
    return Robot(
        *('icub', str(path), ('left', 'right'), names, file.mass),
        foot_radius=0.0,  # soles on ankles
        imu=file.pose('root_link_imu_frame'),
        chains=Chains(legs, feet),
        home=np.zeros((2, len(_LEG))),
        gait=Gait(1.0, 0.6, (0.0, 0.5), 0.05),
        servo=None,
        centre=np.zeros(2),
        height=0.6,
        inertia=1.0,
        leg_stiffness=1e5,
    )


def go1(folder: pathlib.Path) -> Recording:
    """Read ``go1.csv``, ``go1.urdf`` and ``go1_odom.csv`` of :data:`GO1`.

    Feet give counts of a pressure, which are scaled so that their sum is the weight in the median;
    the file has no joint velocities: they are central differences. The poses have no times.

    Raises
    ------
    InvalidInput
        When a file is absent or has other columns, or values are not finite.
    """
    path = _found(folder, 'go1.csv', 'go1')
    rows = _table(path, 23)
    robot = Robot.load(
        _found(folder, 'go1.urdf', 'go1'),
        feet=[f'{name}_foot' for name in _GO1_FEET],
        imu='imu_link',
        foot_radius=GO1_RADIUS,
    )
    time, q = rows[:, 0], rows[:, 11:]
    if not (np.diff(time) > 0.0).all():
        raise InvalidInput(f'{path}: the first column must be times that rise')
    counts = np.maximum(rows[:, 1:5] + GO1_OFFSET, 0.0)
    forces = np.zeros((len(rows), 4, 3))
    forces[..., 2] = counts * robot.mass * 9.81 / max(float(np.median(counts.sum(1))), 1e-9)
    poses = _table(_found(folder, 'go1_odom.csv', 'go1'), 7)
    # Diagonal feet that both stand move against each other by 0.1 m/s in the middle of a stance,
    # which 0.3 rad/s explain; vibration of the accelerometer is 1 to 2 m/s² as the robot trots.
    noise = Noise(0.03, 1.0, 3e-3, 0.3, 2.0, accelerometer_bias=0.2)
    return Recording(
        *('go1', robot, noise),
        rate=(len(time) - 1) / float(time[-1] - time[0]),
        gyro=rows[:, 8:11],
        accelerometer=rows[:, 5:8],
        joint_positions=q,
        joint_velocities=np.gradient(q, time, axis=0),
        foot_forces=forces,
        seen_position=poses[:, :3],
        seen_turn=np.array([matrix(row) for row in poses[:, 3:]]),
        seen_rate=0.0,
    )


def _found(folder: pathlib.Path, name: str, robot: str) -> pathlib.Path:
    path = folder / name
    if not path.is_file():
        raise InvalidInput(f'{path} is not there; fetch it from {SOURCES[robot]}')
    return path


def _check(path: pathlib.Path, key: str, values: Array | None, rows: int, columns: int) -> None:
    if values is None:
        raise InvalidInput(f'{path} has no {key}')
    if values.shape != (rows, columns) or rows < 2:
        raise InvalidInput(f'{path}: {key} has shape {values.shape}, not ({rows}, {columns})')
    if not np.isfinite(values).all():
        raise InvalidInput(f'{path}: {key} has values that are not finite')


def _table(path: pathlib.Path, columns: int) -> Array:
    """Return the last columns of a CSV file with a header (one version begins with an index)."""
    try:
        values = np.genfromtxt(path, delimiter=',', skip_header=1, ndmin=2)
    except ValueError as error:
        raise InvalidInput(f'{path}: {error}') from None
    found = values[:, -columns:]
    _check(path, f'the table of {columns} columns', found, len(values), columns)
    return np.asarray(found, dtype=np.float64)
