# SPDX-License-Identifier: Apache-2.0
"""Collect the series of a trial while it runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_pad.control import MorphologyController
from ros_pad.records import COMMAND, ESTIMATE, PRESSURE, SAMPLE, Block
from ros_pad.simulation.robot import SimulatedRobot, Vector
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials.label import settings
from ros_pad.trials.metrics import summarise
from ros_pad.trials.series import Records, series
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
        self._samples: list[Block] = []
        self._body: list[Vector] = []
        self._odom: list[Vector] = []
        self._estimates: list[Block] = []
        self._commands: list[Block] = []
        self._pressures: list[Block] = []

    def samples(
        self, block: Block, body: Sequence[Vector], odom: Sequence[Vector] | None = None
    ) -> None:
        """Add samples, with the true body at each of them.

        ``odom`` is the estimated body, in whose frame the feet are then.
        """
        self._samples.append(block)
        self._body += body
        self._odom += odom or ()

    def control(self, estimate: Block, command: Block, pressure: Block) -> None:
        """Add the records of a control moment."""
        self._estimates.append(estimate)
        self._commands.append(command)
        self._pressures.append(pressure)

    @property
    def records(self) -> Records:
        """All records until now."""
        legs = len(self._scene.legs)
        return Records(
            Block.joined(SAMPLE, self._samples, legs),
            Block.joined(ESTIMATE, self._estimates, legs),
            Block.joined(COMMAND, self._commands, legs),
            Block.joined(PRESSURE, self._pressures, legs),
        )

    def finish(
        self,
        robot: SimulatedRobot,
        controller: MorphologyController,
        floor: Floor,
        real_time_factor: float | None,
    ) -> Trial:
        """Return the trial with its series, settings and metrics."""
        records = self.records
        found = series(*records)
        rows = np.isin(records.sample.stamps, found['time'])
        found |= {name: found[name] * 1e-9 for name in ('time', 'slow_time')}
        trial = Trial(
            scene=self._scene.name,
            policy=self._policy,
            fidelity=self._fidelity,
            seed=self._seed,
            legs=self._scene.legs,
            body=np.array(self._body).reshape(-1, 3)[rows],
            **found,
            floor=floor,
            settings=settings(self._scene, self._policy, self._fidelity, self._sensing),
            real_time_factor=real_time_factor,
            odom=np.array(self._odom).reshape(-1, 3)[rows[: len(self._odom)]],
        )
        if len(trial.odom):
            trial.move_to_world()
        trial.metrics = summarise(self._scene, trial, robot, controller)
        return trial
