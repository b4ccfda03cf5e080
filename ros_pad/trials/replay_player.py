# SPDX-License-Identifier: Apache-2.0
"""Pass recorded samples and pressures through a fresh pipeline, as the nodes received them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ros_pad.control.stage import DecisionStage
from ros_pad.errors import InvalidInput
from ros_pad.estimation.stage import EstimationStage
from ros_pad.pace import TICK_PERIOD_NS, Pace, Progress
from ros_pad.pipeline import Pipeline
from ros_pad.records import COMMAND, ESTIMATE, PRESSURE, Block, Kind
from ros_pad.trials.comparison import Stream
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay_inputs import Inputs


class Player:
    """Pass the inputs of a robot to the stages of estimation and decision, once.

    Nodes process the samples up to a moment together, and then receive the pressures of this
    moment. Both stages look for missing inputs before that.

    Parameters
    ----------
    settings : NodeSettings
        Settings of both stages.
    inputs : Inputs
        What was recorded.

    Attributes
    ----------
    stages : Pipeline
    refused : dict
        Number of rejected samples and estimates, and the reason of the last one, by leg.
    """

    def __init__(self, settings: NodeSettings, inputs: Inputs) -> None:
        self._inputs, legs = inputs, inputs.legs
        self.refused: dict[int, tuple[int, str]] = {}
        self.stages = Pipeline(
            EstimationStage(
                settings.foot,
                settings.expected_load,
                settings.tuning,
                legs,
                round(1e9 / settings.publish_rate),
                self._reject,
            ),
            DecisionStage(settings.controller(legs), legs, self._reject),
        )
        stamps, rows = inputs.streams[COMMAND.name].block
        self._setpoints = dict(zip(stamps.tolist(), rows['setpoint'], strict=True))  # recorded
        # Whether the set-point of each leg differs from the recorded one.
        self._apart = np.full(len(legs), not self._setpoints)
        self._pace = Pace(TICK_PERIOD_NS)
        self._made: dict[Kind, list[tuple[int, Block]]] = {ESTIMATE: [], COMMAND: []}

    def play(self, progress: Progress | None = None) -> dict[str, Stream]:
        """Play everything; return estimates and commands by name of their kind.

        Parameters
        ----------
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.
        """
        samples, pressures = (self._inputs.streams[name] for name in ('sample', 'pressure'))
        stamps, rows = samples.block
        done = 0
        for start, end, until in _blocks(samples.times, pressures.times):
            self._press(pressures.block, done, until)
            done = until
            block = Block(stamps[start:end], rows[start:end])
            self._sample(int(samples.times[end - 1]), block)
            if progress:
                progress(end / len(stamps))
        legs = self._inputs.legs
        return {kind.name: Stream.of(kind, legs, each) for kind, each in self._made.items()}

    def _sample(self, time_ns: int, block: Block) -> None:
        """Process samples; the log time of the last one is in ns."""
        self._tick(block.last_ns)
        for estimate, command in self.stages.process(block):
            self._made[ESTIMATE].append((time_ns, estimate))
            self._made[COMMAND].append((time_ns, command))
            self._follow(command)

    def _press(self, pressures: Block, start: int, end: int) -> None:
        """Process pressure records."""
        for stamp_ns, rows in zip(*(each[start:end] for each in pressures), strict=True):
            self._tick(int(stamp_ns))
            self.stages.estimation.pressure(rows)
            own = rows.copy()
            own['pressure'][self._apart] = math.nan
            self.stages.decision.pressure(Block.of(int(stamp_ns), own))

    def _tick(self, now_ns: int) -> None:
        if self._pace.due(now_ns):
            self.stages.tick(now_ns)

    def _follow(self, command: Block) -> None:
        """Let the pressure be the set-point while the set-point differs from the recorded one.

        The recorded pressure follows the recorded set-points: with this pressure, the controller
        would report the pad as stuck.
        """
        setpoints = command.rows[-1]['setpoint']
        recorded = self._setpoints.get(command.last_ns)
        if recorded is not None:
            same = (setpoints == recorded) | (np.isnan(setpoints) & np.isnan(recorded))
            self._apart = ~same
        if self._apart.any():
            rows = PRESSURE.rows(len(setpoints))
            rows['pressure'] = np.where(self._apart, setpoints, math.nan)
            self.stages.decision.pressure(Block.of(command.last_ns, rows))

    def _reject(self, leg: int, error: InvalidInput) -> None:
        count, _ = self.refused.get(leg, (0, ''))
        self.refused[leg] = count + 1, str(error)


def _blocks(samples: np.ndarray, pressures: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Yield the samples between two pressures: first, end, and the number of pressures before.

    Pressures count for samples with later log times, ns. Samples of more than a tick are divided.
    """
    if not len(samples):
        return
    # Records are in the order of their stamps, even if their log times are not.
    samples, pressures = np.maximum.accumulate(samples), np.maximum.accumulate(pressures)
    before = np.searchsorted(pressures, samples, side='left')
    ticks = (samples - samples[np.searchsorted(before, before)]) // TICK_PERIOD_NS
    cuts = np.flatnonzero(np.diff(before) | np.diff(ticks)) + 1
    for start, end in pairwise([0, *cuts.tolist(), len(samples)]):
        yield start, end, int(before[start])


__all__ = ['Player']
