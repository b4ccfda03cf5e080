# SPDX-License-Identifier: Apache-2.0
"""From samples to commands: the stages of estimation and decision, one after the other.

The closed loop without ROS and replay drive this; nodes drive the same stages, one each.
Supervision is a stage, too, but stays where the regulators are, on its own clock:
:class:`ros_pad.regulators.supervision.Supervision`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ros_pad.control.stage import DecisionStage
from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import Block


class Pipeline(NamedTuple):
    """The stages of all legs of a robot.

    Attributes
    ----------
    estimation : EstimationStage
    decision : DecisionStage
    """

    estimation: EstimationStage
    decision: DecisionStage

    def process(self, samples: Block) -> Iterator[tuple[Block, Block]]:
        """Yield each estimate that is due in a block of samples, with the command for it."""
        for estimate in self.estimation.process(samples):
            yield estimate, self.decision.decide(estimate)

    def pressure(self, record: Block) -> None:
        """Process a pressure record: it counts for later samples and decisions."""
        self.estimation.pressure(record)
        self.decision.pressure(record)

    def tick(self, now_ns: int) -> Block | None:
        """Look for missing inputs at a time, ns, every ``pace.TICK_PERIOD_NS``.

        Return a command without set-points if a morphology has changed.
        """
        self.estimation.tick(now_ns)
        return self.decision.tick(now_ns)
