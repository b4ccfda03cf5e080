# SPDX-License-Identifier: Apache-2.0
"""Force sensors and markers of the feet, and IMU and joints of the body, with noise and faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.records import SAMPLE
from ros_pad.simulation.faults import BODY_KINDS
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.faults import sensor_faults_of
from ros_pad.simulation.robot import Proprioception
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.scene import SensorNoise

_BLOCK = 1000  # samples drawn at once, because a call of NumPy costs more than the numbers


Reading = tuple[Vector, Vector]
"""Force, N, and position, m, of a foot."""


class Sensors:
    """Force sensors and markers of the feet of a robot.

    Parameters
    ----------
    noise : SensorNoise
        Standard deviations of the readings.
    legs : int
        Number of feet.
    seed : int
        Whole number from 0; the same seed gives the same noise.
    faults : sequence of sequences of Fault
        Faults of the sensors of each foot; none by default.
    """

    def __init__(
        self,
        noise: SensorNoise,
        legs: int,
        seed: int,
        faults: Sequence[Sequence[Fault]] = (),
    ) -> None:
        self._faults = [(index, of_foot) for index, of_foot in enumerate(faults) if of_foot]
        self._last: list[Reading] = []
        self._generator = np.random.default_rng([seed, 2])
        self._moment_generator = np.random.default_rng([seed, 3])
        self._moment_noise = noise.moment
        self._moments: list[list[float]] = []
        self._last_moments: list[float | None] = [0.0] * legs
        self._scale = np.array(([noise.force] * 3 + [noise.position] * 3) * legs)
        self._legs = legs
        self._block: list[list[float]] = []
        self._next = 0

    @classmethod
    def of(cls, scene: Scene, seed: int) -> Sensors:
        """Return the sensors of a scene's robot."""
        faults = [sensor_faults_of(leg, scene.faults) for leg in scene.legs]
        return cls(scene.sensors, len(scene.legs), seed, faults)

    def read(self, robot: SimulatedRobot) -> list[Reading]:
        """Return the next reading of each foot: force, N, and position, m, with their noise."""
        if self._next == len(self._block):
            drawn = self._generator.normal(size=(_BLOCK, 6 * self._legs)) * self._scale
            # One list a sample: with one a foot, the garbage collector would run often.
            self._block = drawn.tolist()
            self._next = 0
        row = iter(self._block[self._next])
        self._next += 1
        readings: list[Reading] = []
        sixes = zip(row, row, row, row, row, row, strict=True)
        for foot, (a, b, c, d, e, f) in zip(robot.feet, sixes, strict=True):
            fx, fy, fz = foot.force
            x, y, z = foot.position
            readings.append(((fx + a, fy + b, fz + c), (x + d, y + e, z + f)))
        if self._faults:
            for index, faults in self._faults:
                before = self._last[index] if self._last else readings[index]
                readings[index] = _faulty(readings[index], before, faults, robot.time)
            self._last = readings
        return readings

    def sample(self, robot: SimulatedRobot) -> np.ndarray:
        """Return the next reading of all feet as rows of a sample."""
        rows = SAMPLE.rows(self._legs)
        readings = self.read(robot)
        rows['force'] = [force for force, _ in readings]
        rows['position'] = [position for _, position in readings]
        if self._moment_noise:
            rows['moment'] = self.read_moments(robot)
        return rows

    def read_moments(self, robot: SimulatedRobot) -> list[float | None]:
        """Return the yaw moment of each foot, N m, with noise; None where it is not measured.

        Call it once for each :meth:`read`.
        """
        if not self._moment_noise:
            return [None] * self._legs
        if not self._moments:
            drawn = self._moment_generator.normal(size=(_BLOCK, self._legs)) * self._moment_noise
            self._moments = drawn.tolist()
        row = self._moments.pop()
        moments: list[float | None] = [
            foot.moment + error for foot, error in zip(robot.feet, row, strict=True)
        ]
        for index, faults in self._faults:
            for fault in faults:
                if fault.kind in ('force_dead', 'force_frozen') and fault.acts_at(robot.time):
                    dead = fault.kind == 'force_dead'
                    moments[index] = 0.0 if dead else self._last_moments[index]
        self._last_moments = moments
        return moments


def _faulty(reading: Reading, before: Reading, faults: Sequence[Fault], time: float) -> Reading:
    """Return the reading of sensors with faults; ``before`` is the reading before this one."""
    force, position = reading
    for fault in faults:
        if not fault.acts_at(time):
            continue
        if fault.kind == 'force_dead':
            force = (0.0, 0.0, 0.0)
        elif fault.kind == 'force_frozen':
            force = before[0]
        elif fault.kind == 'force_offset':
            force = (force[0], force[1], force[2] + fault.load)
        elif fault.kind == 'force_range':
            x, y, z = (max(-fault.load, min(fault.load, each)) for each in force)
            force = (x, y, z)
        else:
            position = before[1]
    return force, position


class BodyReading(NamedTuple):
    """What IMU, joints and feet of a robot measure at one moment, as in `Proprioception`.

    Attributes
    ----------
    imu : tuple of list
        Angular velocity, rad/s, and specific force, m/s²; NaN where the IMU is silent.
    joints : tuple of list
        Positions, velocities and efforts; NaN where the joints are silent.
    rows : structured array (feet,)
        Rows of a sample with the force on each foot, N, in the axes of its link.
    """

    imu: tuple[list[float], list[float]]
    joints: tuple[list[float], list[float], list[float]]
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
        self._biases = np.concatenate(
            [
                _of_length(noise.gyro_bias, self._imu),
                _of_length(noise.accelerometer_bias, self._imu),
            ]
        )
        self._imu_scale = np.repeat((noise.gyro, noise.accelerometer), 3)
        self._joint_scale = np.repeat(
            (noise.encoder, noise.joint_velocity, noise.effort), joints
        ).reshape(3, joints)
        self._faults = [fault for fault in scene.faults if fault.kind in BODY_KINDS]
        self._of_feet = [sensor_faults_of(leg, scene.faults) for leg in scene.legs]
        self._last: list[Vector] = []

    def read(self, truth: Proprioception, time: float) -> BodyReading:
        """Return the next reading of the true values at a time, s."""
        values = np.array((*truth.gyro, *truth.accelerometer)) + self._biases
        values += self._imu_scale * self._imu.standard_normal(6)
        gyro, accelerometer = values.reshape(2, 3).tolist()
        given = np.array((truth.positions, truth.velocities, truth.efforts))
        given += self._joint_scale * self._joints.standard_normal(given.shape)
        positions, velocities, efforts = given.tolist()
        felt = np.array(truth.forces)
        felt += self._noise.force * self._forces.standard_normal(felt.shape)
        forces: list[Vector] = [(x, y, z) for x, y, z in felt.tolist()]
        for index, faults in enumerate(self._of_feet):
            before = self._last[index] if self._last else forces[index]
            nowhere = (0.0, 0.0, 0.0)
            forces[index], _ = _faulty((forces[index], nowhere), (before, nowhere), faults, time)
        self._last = forces
        silent = {fault.kind for fault in self._faults if fault.acts_at(time)}
        none = [np.nan] * 3, [np.nan] * len(positions)
        rows = SAMPLE.rows(len(forces))
        rows['force'] = forces
        return BodyReading(
            (none[0], none[0]) if 'imu_silent' in silent else (gyro, accelerometer),
            (none[1],) * 3 if 'joints_silent' in silent else (positions, velocities, efforts),
            rows,
        )


def _of_length(length: float, generator: np.random.Generator) -> npt.NDArray[np.float64]:
    """Return a vector of a length and of random direction."""
    vector = generator.standard_normal(3)
    return vector * (length / np.linalg.norm(vector))
