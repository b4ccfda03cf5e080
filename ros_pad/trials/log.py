# SPDX-License-Identifier: Apache-2.0
"""Collect the series of a trial while it runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.control import MorphologyController
from ros_pad.records import COMMAND, ESTIMATE, KINDS, PRESSURE, SAMPLE, Block, Kind
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
        self._scene, self._sensing = scene, sensing
        self._about: dict[str, Any] = {'policy': policy, 'seed': seed, 'fidelity': fidelity}
        self._blocks: dict[Kind, list[Block]] = {kind: [] for kind in KINDS}
        self._body: list[Vector] = []
        self._odom: list[Vector] = []

    def samples(
        self, block: Block, body: Sequence[Vector], odom: Sequence[Vector] | None = None
    ) -> None:
        """Add samples, with the true body at each of them.

        ``odom`` is the estimated body, in whose frame the feet are then.
        """
        self._blocks[SAMPLE].append(block)
        self._body += body
        self._odom += odom or ()

    def control(self, estimate: Block, command: Block, pressure: Block) -> None:
        """Add the records of a control moment."""
        self._blocks[ESTIMATE].append(estimate)
        self._blocks[COMMAND].append(command)
        self._blocks[PRESSURE].append(pressure)

    @property
    def records(self) -> Records:
        """All records until now."""
        legs = len(self._scene.legs)
        return Records(*(Block.joined(kind, own, legs) for kind, own in self._blocks.items()))

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
        about = self._about
        trial = Trial(
            scene=self._scene.name,
            **about,
            legs=self._scene.legs,
            body=np.array(self._body).reshape(-1, 3)[rows],
            **found,
            floor=floor,
            settings=settings(self._scene, about['policy'], about['fidelity'], self._sensing),
            real_time_factor=real_time_factor,
            odom=np.array(self._odom).reshape(-1, 3)[rows[: len(self._odom)]],
        )
        if len(trial.odom):
            trial.move_to_world()
        trial.metrics = summarise(self._scene, trial, robot, controller)
        return trial
