# SPDX-License-Identifier: Apache-2.0
"""Collect the records of a trial while it runs."""

from __future__ import annotations

import numpy as np

from ros_pad.records import COMMAND, ESTIMATE, KINDS, PRESSURE, SAMPLE, Block, Kind
from ros_pad.simulation.robot import Vector
from ros_pad.trials.series import Poses, Records


class TrialLog:
    """Collect the records of a robot, and the poses of its body.

    Parameters
    ----------
    feet : int
        Number of its feet.
    """

    def __init__(self, feet: int) -> None:
        self._feet = feet
        self._blocks: dict[Kind, list[Block]] = {kind: [] for kind in KINDS}
        self._new: list[tuple[int, np.ndarray]] = []  # samples that nobody has taken
        self._poses: list[tuple[int, Vector, Vector]] = []

    def sample(self, stamp_ns: int, rows: np.ndarray | None, body: Vector, odom: Vector) -> None:
        """Add a sample, unless it is None, and the true and the estimated pose of the body."""
        self._poses.append((stamp_ns, body, odom))
        if rows is not None:
            self._new.append((stamp_ns, rows))

    def take(self, now_ns: int) -> Block:
        """Return the new samples; if there is none of this moment, ns, its values are missing."""
        if not self._new or self._new[-1][0] < now_ns:
            self._new.append((now_ns, SAMPLE.rows(self._feet)))
        block = Block.joined(SAMPLE, [Block.of(*each) for each in self._new], self._feet)
        self._blocks[SAMPLE].append(block)
        self._new = []
        return block

    def control(self, estimate: Block, command: Block, pressure: Block) -> None:
        """Add the records of a control moment."""
        self._blocks[ESTIMATE].append(estimate)
        self._blocks[COMMAND].append(command)
        self._blocks[PRESSURE].append(pressure)

    @property
    def records(self) -> Records:
        """All records until now."""
        if self._new:
            self.take(self._new[-1][0])
        return Records(
            *(Block.joined(kind, own, self._feet) for kind, own in self._blocks.items())
        )

    @property
    def poses(self) -> tuple[Poses, Poses]:
        """True and estimated poses of the body until now."""
        stamps, body, odom = (np.array(each) for each in zip(*self._poses, strict=True))
        return (stamps, body), (stamps, odom)
