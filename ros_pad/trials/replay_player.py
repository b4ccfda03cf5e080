# SPDX-License-Identifier: Apache-2.0
"""Pass recorded samples and pressures through a fresh pipeline, as the nodes received them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ros_pad.control.stage import DecisionStage
from ros_pad.errors import InvalidInput
from ros_pad.estimation.stage import EstimationStage
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace
from ros_pad.pace import Progress
from ros_pad.pipeline import Pipeline
from ros_pad.records import COMMAND
from ros_pad.records import ESTIMATE
from ros_pad.records import PRESSURE
from ros_pad.records import Block
from ros_pad.records import Kind
from ros_pad.trials.comparison import Stream
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay_inputs import Inputs

LONGEST_SILENCE_NS = 10_000_000_000
"""The stages tick only in the last part of a pause; this is its length, ns."""


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
    rejected : Counter of int
        Number of rejected samples and estimates, by leg.
    rejection : dict of str
        Reason of the last one, by leg.
    """

    def __init__(self, settings: NodeSettings, inputs: Inputs) -> None:
        self._inputs, legs = inputs, inputs.legs
        self.rejected: Counter[int] = Counter()
        self.rejection: dict[int, str] = {}
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
        self._log_ns = self._sampled_ns = self._offset_ns = 0
        self._made: dict[Kind, list[tuple[int, Block]]] = {ESTIMATE: [], COMMAND: []}

    def play(self, progress: Progress | None = None) -> dict[str, Stream]:
        """Play everything; return estimates and commands by name of their kind.

        Parameters
        ----------
        progress : callable or None
            Called now and then with the share that is done, 0 to 1.
        """
        samples, pressures = (self._inputs.streams[name] for name in ('sample', 'pressure'))
        done = 0
        for start, end, until in _blocks(samples.times, pressures.times):
            self._press(pressures, done, until)
            done = until
            stamps, rows = samples.block
            self._sample(samples.times[start:end], Block(stamps[start:end], rows[start:end]))
            if progress:
                progress(end / len(samples.times))
        self._press(pressures, done, len(pressures.times))
        legs = self._inputs.legs
        return {kind.name: Stream.of(kind, legs, each) for kind, each in self._made.items()}

    def _sample(self, times: np.ndarray, block: Block) -> None:
        """Process samples that came one after the other, with their log times, ns."""
        self._pass_time(int(times[0]))
        self._log_ns = self._sampled_ns = int(times[-1])
        self._offset_ns = block.last_ns - self._log_ns
        self._tick(self._log_ns)
        for estimate, command in self.stages.process(block):
            self._made[ESTIMATE].append((self._log_ns, estimate))
            self._made[COMMAND].append((self._log_ns, command))
            self._follow(command)

    def _press(self, pressures: Stream, start: int, end: int) -> None:
        """Process pressure records."""
        stamps, rows = pressures.block
        for row, time_ns in enumerate(pressures.times[start:end].tolist(), start):
            self._pass_time(time_ns)
            if time_ns - self._sampled_ns > TICK_PERIOD_NS:
                self._tick(time_ns)
            self.stages.estimation.pressure(rows[row])
            own = rows[row].copy()
            own['pressure'][self._apart] = math.nan
            self.stages.decision.pressure(Block.of(int(stamps[row]), own))

    def _pass_time(self, until_ns: int) -> None:
        """Tick in a silence until a log time, ns, as the timers of the nodes do."""
        first = max(self._log_ns + TICK_PERIOD_NS, until_ns - LONGEST_SILENCE_NS)
        for time_ns in range(first, until_ns, TICK_PERIOD_NS):
            self._tick(time_ns)
        self._log_ns = until_ns

    def _tick(self, log_ns: int) -> None:
        now_ns = log_ns + self._offset_ns  # on the clock of the stamps
        if not self._sampled_ns or not self._pace.due(now_ns):
            return
        if command := self.stages.tick(now_ns):
            self._made[COMMAND].append((log_ns, command))

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
        self.rejected[leg] += 1
        self.rejection[leg] = str(error)


def _blocks(samples: np.ndarray, pressures: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """Yield the samples between two pressures: first, end, and the number of pressures before.

    Pressures count for samples with later log times, ns. Samples of more than a tick are divided.
    """
    if not len(samples):
        return
    # Where the computer's clock was set back, the order of the records still is that of the file.
    samples, pressures = np.maximum.accumulate(samples), np.maximum.accumulate(pressures)
    before = np.searchsorted(pressures, samples, side='left')
    ticks = (samples - samples[np.searchsorted(before, before)]) // TICK_PERIOD_NS
    cuts = np.flatnonzero(np.diff(before) | np.diff(ticks)) + 1
    for start, end in pairwise([0, *cuts.tolist(), len(samples)]):
        yield start, end, int(before[start])


__all__ = ['Player']
