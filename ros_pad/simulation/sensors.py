# SPDX-License-Identifier: Apache-2.0
"""Force sensors and markers of the feet, and IMU and joints of the body, with noise and faults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.records import SAMPLE, Array
from ros_pad.simulation.faults import BODY_KINDS, FOOT_KINDS, Fault, faults_of
from ros_pad.simulation.robot import Proprioception, SimulatedRobot
from ros_pad.simulation.scene import Scene

_BLOCK = 1000  # samples drawn at once, because a call of NumPy costs more than the numbers


class Sensors:
    """Force sensors and markers of the feet of a robot.

    Parameters
    ----------
    scene : Scene
        Scene with legs, noise and faults.
    seed : int
        Whole number from 0; the same seed gives the same noise.
    """

    def __init__(self, scene: Scene, seed: int) -> None:
        self._noise = scene.sensors
        self._faults = _of_feet(scene)
        self._generators = [np.random.default_rng([seed, stream]) for stream in (2, 3)]
        self._block = SAMPLE.rows(0, len(scene.legs))  # noise, to which samples are added
        self._contacts = _numbers(self._block)
        self._next = 0
        self._last: Array | None = None

    def sample(self, robot: SimulatedRobot) -> np.ndarray:
        """Return the next sample: rows of ``SAMPLE``, (feet,), with noise and faults.

        Moments are NaN where they are not measured, and velocities and variances always.
        """
        if self._next == len(self._block):
            self._draw()
        rows, contacts = self._block[self._next], self._contacts[self._next]
        np.add(contacts, robot.contacts, contacts)
        self._next += 1
        if self._faults:
            _fail(contacts, self._last, self._faults, robot.time)
            self._last = contacts
        return rows

    def _draw(self) -> None:
        """Draw the noise of the next samples."""
        noise, legs = self._noise, self._block.shape[1]
        self._block, self._next = SAMPLE.rows(_BLOCK, legs), 0
        self._contacts = _numbers(self._block)
        scale = np.array(([noise.force] * 3 + [noise.position] * 3) * legs)
        drawn = self._generators[0].normal(size=(_BLOCK, 6 * legs)) * scale
        self._block['force'], self._block['position'] = np.split(
            drawn.reshape(_BLOCK, legs, 6), 2, axis=2
        )
        if noise.moment:
            self._block['moment'] = (
                self._generators[1].normal(size=(_BLOCK, legs))[::-1] * noise.moment
            )


def _numbers(rows: np.ndarray) -> Array:
    """Return a view of the forces, N, moments, N m, and positions, m, of samples, (..., 7)."""
    return rows[..., None].view('f8')[..., :7]


def _of_feet(scene: Scene) -> list[tuple[int, Fault]]:
    """Return the faults of the sensors of feet, each with the index of its foot."""
    return [
        (index, fault)
        for index, leg in enumerate(scene.legs)
        for fault in faults_of(leg, scene.faults, FOOT_KINDS)
    ]


def _fail(
    contacts: Array, last: Array | None, faults: Sequence[tuple[int, Fault]], time: float
) -> None:
    """Change force, moment and position of feet as faults do; ``last`` are those before."""
    for index, fault in faults:
        row, before = contacts[index], (contacts if last is None else last)[index]
        if not fault.acts_at(time):
            continue
        if fault.kind == 'force_dead':
            row[:4] = 0.0 * abs(row[:4])  # NaN stays
        elif fault.kind == 'force_frozen':
            row[:4] = before[:4]
        elif fault.kind == 'force_offset':
            row[2] += fault.load
        elif fault.kind == 'force_range':
            row[:3].clip(-fault.load, fault.load, row[:3])
        else:
            row[4:] = before[4:]


class BodyReading(NamedTuple):
    """What IMU, joints and feet of a robot measure at one moment, as in `Proprioception`.

    Attributes
    ----------
    imu : array (2, 3)
        Angular velocity, rad/s, and specific force, m/s²; NaN where the IMU is silent.
    joints : array (3, joints)
        Positions, velocities and efforts; NaN where the joints are silent.
    rows : structured array (feet,)
        Rows of ``SAMPLE`` with the force on each foot, N, in the axes of its link.
    """

    imu: Array
    joints: Array
    rows: np.ndarray


class BodySensors:
    """IMU, joints, and force sensors in the feet of a robot with joints.

    Their noise is independent of that of :class:`Sensors`, and each kind has its own.

    Parameters
    ----------
    scene : Scene
        Scene with the noise and the faults.
    seed : int
        Whole number from 0; the same seed gives the same noise.
    joints : int
        Number of joints.
    """

    def __init__(self, scene: Scene, seed: int, joints: int) -> None:
        noise = scene.sensors
        self._noise = noise
        self._imu, self._joints, self._forces = (
            np.random.default_rng([seed, stream]) for stream in (4, 5, 6)
        )
        biases = (noise.gyro_bias, noise.accelerometer_bias)
        self._biases = np.concatenate([_of_length(each, self._imu) for each in biases])
        self._imu_scale = np.repeat((noise.gyro, noise.accelerometer), 3)
        self._joint_scale = np.repeat(
            (noise.encoder, noise.joint_velocity, noise.effort), joints
        ).reshape(3, joints)
        self._faults = [fault for fault in scene.faults if fault.kind in BODY_KINDS]
        self._of_feet = _of_feet(scene)
        self._last: Array | None = None

    def read(self, truth: Proprioception, time: float) -> BodyReading:
        """Return the next reading of the true values at a time, s."""
        values = np.concatenate(truth[:2]) + self._biases
        values += self._imu_scale * self._imu.standard_normal(6)
        joints = np.array(truth[2:5])
        joints += self._joint_scale * self._joints.standard_normal(joints.shape)
        rows = SAMPLE.rows(len(truth.forces))
        rows['force'] = truth.forces
        rows['force'] += self._noise.force * self._forces.standard_normal(rows['force'].shape)
        contacts = _numbers(rows)
        _fail(contacts, self._last, self._of_feet, time)
        self._last = contacts
        for fault in self._faults:
            if fault.acts_at(time):
                (values if fault.kind == 'imu_silent' else joints)[:] = math.nan
        return BodyReading(values.reshape(2, 3), joints, rows)


def _of_length(length: float, generator: np.random.Generator) -> Array:
    """Return a vector of a length and of random direction."""
    vector = generator.standard_normal(3)
    return vector * (length / np.linalg.norm(vector))
