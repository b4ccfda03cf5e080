# SPDX-License-Identifier: Apache-2.0
"""Run walks of the closed loop with parts that a study can replace before the first sample."""

from __future__ import annotations

import numpy as np

from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import ESTIMATE, Block
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.series import Records, held


def walk(loop: ClosedLoop) -> None:
    """Walk a scene until it ends or a verdict ends it early."""
    for _ in loop.walk():
        pass


def estimated(stage: EstimationStage, records: Records) -> Block:
    """Return what a stage estimates from the samples and pressures of a walk."""
    sample, pressure = records.sample, records.pressure
    cuts = np.searchsorted(sample.stamps, pressure.stamps, side='right').tolist()
    estimates: list[Block] = []
    for first, end, rows in zip(
        [0, *cuts], [*cuts, len(sample.stamps)], [*pressure.rows, None], strict=True
    ):
        if end > first:
            estimates += stage.process(Block(sample.stamps[first:end], sample.rows[first:end]))
        if rows is not None:
            stage.pressure(Block.of(0, rows))
    return Block.joined(ESTIMATE, estimates, sample.rows.shape[1])


def pressures(records: Records, stamps: np.ndarray) -> np.ndarray:
    """Return the pressures, Pa gauge, that were reported last before each time, ns; at first 0."""
    found = held(records.pressure.stamps + 1, records.pressure.rows['pressure'], stamps)
    return np.nan_to_num(found)
