# SPDX-License-Identifier: Apache-2.0
"""Collects the series of a trial as it runs."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import numpy as np

from ros_pad.control import MorphologyController
from ros_pad.estimation import DOUBTS
from ros_pad.estimation import Estimate
from ros_pad.simulation.robot import Robot
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials.label import settings
from ros_pad.trials.metrics import summarise
from ros_pad.trials.trial import Trial


class TrialLog:
    """Appends rows while the loop runs; :meth:`finish` makes arrays of them.

    Parameters
    ----------
    scene : Scene
    policy : str
    seed : int
    fidelity : str
        Rung that the trial runs on.
    """

    def __init__(self, scene: Scene, policy: str, seed: int, fidelity: str) -> None:
        self._scene = scene
        self._policy = policy
        self._seed = seed
        self._fidelity = fidelity
        self._time: list[float] = []
        self._body: list[Vector] = []
        self._readings = array('d')
        self._slow_time: list[float] = []
        self._rows: list[list[tuple[float, ...]]] = []

    def sample(self, time: float, body: Vector, readings: Sequence[tuple[Vector, Vector]]) -> None:
        """Add what the sensors said at a time, s."""
        self._time.append(time)
        self._body.append(body)
        for force, position in readings:
            self._readings.extend(force)
            self._readings.extend(position)

    def control(
        self,
        time: float,
        pressures: Sequence[float],
        estimates: Sequence[Estimate],
        controller: MorphologyController,
    ) -> None:
        """Add what was known and commanded at a control step."""
        self._slow_time.append(time)
        self._rows.append([
            (
                pressure,
                controller.setpoint(leg),
                estimate.wet_probability,
                estimate.friction_mean,
                estimate.margin,
                math.hypot(*estimate.slip_velocity),
                estimate.slipping,
                controller.morphology(leg) == 'dome',
                DOUBTS.index(estimate.doubt.partition(':')[0]),
            )
            for leg, pressure, estimate in zip(
                self._scene.legs, pressures, estimates, strict=True
            )
        ])  # fmt: skip

    def finish(
        self,
        robot: Robot,
        controller: MorphologyController,
        floor: Floor,
        real_time_factor: float | None,
    ) -> Trial:
        """Return the trial."""
        readings = np.array(self._readings).reshape(len(self._time), -1, 2, 3)
        slow = np.array(self._rows, dtype=float)
        trial = Trial(
            scene=self._scene.name,
            policy=self._policy,
            fidelity=self._fidelity,
            seed=self._seed,
            legs=self._scene.legs,
            time=np.array(self._time),
            body=np.array(self._body),
            force=readings[:, :, 0],
            position=readings[:, :, 1],
            slow_time=np.array(self._slow_time),
            pressure=slow[:, :, 0],
            setpoint=slow[:, :, 1],
            wet_probability=slow[:, :, 2],
            friction=slow[:, :, 3],
            margin=slow[:, :, 4],
            slip_speed=slow[:, :, 5],
            slipping=slow[:, :, 6].astype(bool),
            dome=slow[:, :, 7].astype(bool),
            doubt=slow[:, :, 8].astype(int),
            floor=floor,
            settings=settings(self._scene, self._policy, self._fidelity),
            real_time_factor=real_time_factor,
        )
        trial.metrics = summarise(self._scene, trial, robot, controller)
        return trial
