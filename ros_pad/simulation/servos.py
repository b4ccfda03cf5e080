# SPDX-License-Identifier: Apache-2.0
"""Servos of a robot in MuJoCo: their set-points along the gait."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_pad.records import Array
from ros_pad.robots.inverse import FeetSolver
from ros_pad.simulation.gait import FootPath, Place
from ros_pad.simulation.scene import Scene

LOST = 0.3
"""Angle between a joint and its set-point, rad, at which the walk ends with a verdict."""


class Servos:
    """Set-points of all servos.

    Parameters
    ----------
    scene : Scene
        Scene with a legged robot that has servos.
    solver : FeetSolver
        Solver of its legs.
    period : float
        Time for which a set-point stays, s.
    setpoints : array (joints,)
        Where MuJoCo expects them.

    Attributes
    ----------
    targets : list of float
        Joint positions for these places, rad.
    """

    def __init__(self, scene: Scene, solver: FeetSolver, period: float, setpoints: Array) -> None:
        body, gait = scene.legged
        self._robot = body.robot
        self._solver = solver
        self._period = period
        self._settle = scene.settle
        self._gain = scene.heading_gain
        self._path = FootPath(gait, [(x, y, body.ground) for x, y in body.homes])
        self.targets = solver.angles([(x, y, body.ground) for x, y, _ in self._path.feet])
        self._setpoints = setpoints
        setpoints[:] = self.targets

    @property
    def places(self) -> list[Place]:
        """Where the gait brings the feet, fore, left and up in the body, m."""
        return self._path.feet

    @property
    def swings(self) -> list[bool]:
        """Whether each of them swings."""
        return self._path.swings

    def act(self, time: float, heading: float) -> None:
        """Set all set-points for a time, s, with a heading of the body, rad.

        Raises
        ------
        InvalidInput
            When a foot is out of reach; the set-points stay unchanged.
        """
        # The clock of the gait starts when the robot has settled.
        turn = -self._gain * heading * self._period
        self._path.move(max(0.0, time - self._settle), turn)
        self.targets = self._solver.angles(self._path.feet)
        self._setpoints[:] = self.targets

    def lost(self, joints: Sequence[float]) -> str:
        """Return which of the joints, rad, is far from its set-point, or an empty text."""
        off = np.abs(np.subtract(self.targets, joints))
        worst = int(off.argmax())
        if off[worst] <= LOST:
            return ''
        return f'servo {self._robot.joint_names[worst]} is {off[worst]:.2f} rad off its set-point'
