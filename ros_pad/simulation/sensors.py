# SPDX-License-Identifier: Apache-2.0
"""Force sensors and markers of the feet, with white noise and faults."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.faults import sensor_faults_of
from ros_pad.simulation.robot import Robot
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

    def read(self, robot: Robot) -> list[Reading]:
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

    def read_moments(self, robot: Robot) -> list[float | None]:
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
