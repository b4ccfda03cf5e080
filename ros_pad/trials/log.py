# SPDX-License-Identifier: Apache-2.0
"""Collect the series of a trial while it runs."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from itertools import chain

import numpy as np

from ros_pad.control import MorphologyController
from ros_pad.estimation import DOUBTS
from ros_pad.estimation import Estimate
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.robot import Vector
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials.label import settings
from ros_pad.trials.metrics import summarise
from ros_pad.trials.trial import Trial


class TrialLog:
    """Collect rows while the loop runs; :meth:`finish` returns them as the arrays of a trial.

    Parameters
    ----------
    scene : Scene
    policy : str
    seed : int
    fidelity : str
        Fidelity level of the trial.
    sensing : str
        ``markers`` or ``joints``.
    """

    def __init__(
        self, scene: Scene, policy: str, seed: int, fidelity: str, sensing: str = 'markers'
    ) -> None:
        self._scene = scene
        self._policy = policy
        self._seed = seed
        self._fidelity = fidelity
        self._sensing = sensing
        self._odom = array('d')
        # Arrays, because many small tuples would occupy memory and the garbage collector.
        self._time, self._body, self._readings = array('d'), array('d'), array('d')
        self._slow_time, self._rows = array('d'), array('d')

    def sample(
        self,
        time: float,
        body: Vector,
        readings: Sequence[tuple[Vector, Vector]],
        odom: Vector | None = None,
    ) -> None:
        """Add a sensor sample: time, s, body, and force, N, and position, m, of each foot.

        ``odom`` is the estimated body, in whose frame the feet are then.
        """
        if odom:
            self._odom.extend(odom)
        self._time.append(time)
        self._body.extend(body)
        self._readings.extend(chain.from_iterable(chain.from_iterable(readings)))

    def control(
        self,
        time: float,
        pressures: Sequence[float],
        estimates: Sequence[Estimate],
        controller: MorphologyController,
    ) -> None:
        """Add a control step: time, s, gauge pressures, Pa, estimates, and set-points."""
        self._slow_time.append(time)
        for leg, pressure, estimate in zip(self._scene.legs, pressures, estimates, strict=True):
            self._rows.extend((
                pressure,
                controller.setpoint(leg),
                estimate.wet_probability,
                estimate.friction_mean,
                estimate.margin,
                math.hypot(*estimate.slip_velocity),
                estimate.slipping,
                controller.morphology(leg) == 'dome',
                DOUBTS.index(estimate.doubt.partition(':')[0]),
            ))  # fmt: skip

    def finish(
        self,
        robot: SimulatedRobot,
        controller: MorphologyController,
        floor: Floor,
        real_time_factor: float | None,
    ) -> Trial:
        """Return the trial with its series, settings and metrics."""
        legs = len(self._scene.legs)
        readings = np.array(self._readings).reshape(len(self._time), legs, 2, 3)
        slow = np.array(self._rows).reshape(len(self._slow_time), legs, 9)
        trial = Trial(
            scene=self._scene.name,
            policy=self._policy,
            fidelity=self._fidelity,
            seed=self._seed,
            legs=self._scene.legs,
            time=np.array(self._time),
            body=np.array(self._body).reshape(-1, 3),
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
            settings=settings(self._scene, self._policy, self._fidelity, self._sensing),
            real_time_factor=real_time_factor,
            odom=np.array(self._odom).reshape(-1, 3),
        )
        if len(trial.odom):
            trial.move_to_world()
        trial.metrics = summarise(self._scene, trial, robot, controller)
        return trial
