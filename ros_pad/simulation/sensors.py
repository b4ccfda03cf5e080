# SPDX-License-Identifier: Apache-2.0
"""Force sensors and markers of the feet, with white noise."""

from __future__ import annotations

import numpy as np

from ros_pad.simulation.robot import Robot
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import SensorNoise

_BLOCK = 1000  # samples drawn at once: NumPy is slow to ask for a few numbers


class Sensors:
    """Reads the feet of a robot as its sensors would.

    Parameters
    ----------
    noise : SensorNoise
        Standard deviations.
    legs : int
        Number of feet.
    seed : int
        The same seed gives the same noise.
    """

    def __init__(self, noise: SensorNoise, legs: int, seed: int) -> None:
        self._generator = np.random.default_rng([seed, 2])
        self._moment_generator = np.random.default_rng([seed, 3])
        self._moment_noise = noise.moment
        self._moments: list[list[float]] = []
        self._scale = np.array([noise.force] * 3 + [noise.position] * 3)
        self._legs = legs
        self._block: list[list[list[float]]] = []
        self._next = 0

    def read(self, robot: Robot) -> list[tuple[Vector, Vector]]:
        """Return (force, position) of each foot, N and m."""
        if self._next == len(self._block):
            drawn = self._generator.normal(size=(_BLOCK, self._legs, 6)) * self._scale
            self._block = drawn.tolist()
            self._next = 0
        row = self._block[self._next]
        self._next += 1
        readings = []
        for foot, (a, b, c, d, e, f) in zip(robot.feet, row, strict=True):
            fx, fy, fz = foot.force
            x, y, z = foot.position
            readings.append(((fx + a, fy + b, fz + c), (x + d, y + e, z + f)))
        return readings

    def read_moments(self, robot: Robot) -> list[float | None]:
        """Return the moment about the vertical of each foot, N m; None where it is not measured.

        Call it once for each :meth:`read`.
        """
        if not self._moment_noise:
            return [None] * self._legs
        if not self._moments:
            drawn = self._moment_generator.normal(size=(_BLOCK, self._legs)) * self._moment_noise
            self._moments = drawn.tolist()
        row = self._moments.pop()
        return [foot.moment + error for foot, error in zip(robot.feet, row, strict=True)]
