# SPDX-License-Identifier: Apache-2.0
"""The estimator node: samples and pressures of all feet in, estimates out.

The reason why the ground is unobservable is in each estimate as a code, and on ``/diagnostics``
as text, with the health of the sensors.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput, PadError
from ros_pad.estimation import SETTINGS, Tuning
from ros_pad.estimation import doubt as doubts
from ros_pad.estimation.stage import PUBLISH_RATE, EstimationStage
from ros_pad.estimation.tuning import attribute
from ros_pad.nodes import topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import EXPECTED_LOAD, FOOT, LEGS, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.pace import TICK_PERIOD_NS, Pace
from ros_pad.records import Block
from ros_pad.trials import learnt

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    *(Parameter(**vars(setting)) for setting in SETTINGS),
    Parameter(**vars(PUBLISH_RATE)),
    Parameter(
        'learnt', '',
        'File in which what feet learn of friction is kept; empty: none. If it exists at the'
        ' start, scale and scale_sd follow from it.',
    ),
)  # fmt: skip

KEEP_PERIOD_NS = 10_000_000_000
"""Time between two savings of what was learnt, ns."""


class EstimatorNode(Node):
    """Estimate slip, friction and wetness under each foot; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    stage : EstimationStage
    messages : Messages
        Publishers and subscriptions.
    """

    _learnt = ''  # until the parameters are declared

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'estimator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        self._begin_with_learnt()
        values = declare(self, PARAMETERS)
        self._foot: Foot = values['foot']
        self._learnt = values['learnt']
        tuning = Tuning(**{attribute(each): values[each.name] for each in SETTINGS})
        self._legs: list[int] = values['legs']
        self.messages = messages = Messages(self)
        self.stage = EstimationStage(
            self._foot,
            values['expected_load'],
            tuning,
            self._legs,
            round(1e9 / values['publish_rate']),
            self._warn,
        )
        self._kept = learnt.settings_of(self.stage.estimator.shared)
        self._send = messages.record_output(topics.ESTIMATE, self._legs)
        self._diagnostics = Diagnostics(self, messages)
        self._keep_pace = Pace(KEEP_PERIOD_NS)
        self._health_pace = Pace(TICK_PERIOD_NS)
        messages.receive_record(topics.SAMPLE, self._legs, self._on_samples)
        messages.receive_record(topics.PRESSURE, self._legs, self._on_pressure)
        messages.on_tick(TICK_PERIOD_NS * 1e-9, self._idle)

    def _on_samples(self, block: Block) -> None:
        if self.messages.simulated:
            self.messages.advance(block.last_ns)
            self._tick(block.last_ns)
        for estimate in self.stage.process(block):
            self._send(estimate)

    def _on_pressure(self, block: Block) -> None:
        self.stage.pressure(block.rows[-1])

    def _warn(self, leg: int, error: InvalidInput) -> None:
        self.get_logger().warning(f'leg {leg}: sample ignored: {error}', throttle_duration_sec=1.0)

    def _begin_with_learnt(self) -> None:
        """Declare what was learnt in earlier trials, if there is a file of it."""

        def given(name: str, default: str) -> str:
            return str(self.get_parameter(name).value if self.has_parameter(name) else default)

        path = given('learnt', '')
        if not path or not os.path.exists(path):
            return
        known = learnt.load(path, given('foot', FOOT.default))
        for name, value in known.items():
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            self.declare_parameter(name, value, ignore_override=True)

    def keep_learnt(self) -> None:
        """Write what feet have learnt of friction, if it is new and there is a file for it."""
        if (
            not self._learnt
            or (settings := learnt.settings_of(self.stage.estimator.shared)) == self._kept
        ):
            return
        try:
            learnt.save(self._learnt, settings, self._foot)
            self._kept = settings
        except PadError as error:
            self.get_logger().warning(f'parameter learnt: {error}', throttle_duration_sec=60.0)

    def destroy_node(self) -> None:
        """Write what was learnt, and destroy the node."""
        self.keep_learnt()
        super().destroy_node()

    def _idle(self, now_ns: int) -> None:
        """Tick without samples: the controller has to know of a foot whose sensors are silent."""
        before = self._diagnostics.reported
        self._tick(now_ns)
        if self._diagnostics.reported != before:
            self._send(self.stage.estimate(now_ns))

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        self.stage.tick(now_ns)
        if self._keep_pace.due(now_ns):
            self.keep_learnt()
        rows = self.stage.estimate(now_ns).rows[0]
        sound = [not doubts.is_fault(code) for code in rows['doubt'].tolist()]
        if self._diagnostics.due(now_ns, sound):
            statuses = [*self._statuses(rows, sound), self._learnt_status()]
            if not self.messages.simulated:
                stage = self.stage
                statuses.append(self._diagnostics.rate(now_ns, stage.samples, stage.last_ns))
            self._diagnostics.send(now_ns, statuses)

    def _statuses(self, rows: np.ndarray, sound: list[bool]) -> list[DiagnosticStatus]:
        """Return the health of the sensors of each leg, and its estimate, for ``/diagnostics``."""
        found = []
        for index, (leg, row) in enumerate(zip(self._legs, rows, strict=True)):
            noise = self.stage.estimator.tracks[index].watch.noise
            values = {
                'P(wet)': f'{row["wetness"]:.3f}',
                'friction': f'{row["friction"]:.3f}',
                'friction sd': f'{row["friction_sd"]:.3f}',
                'position noise': noise.position.text('m'),
                'force noise': noise.force.text('N'),
                'samples': self.stage.used[index],
            }
            level = Diagnostics.OK if sound[index] else Diagnostics.ERROR
            text = doubts.text(row['doubt'], *row['detail']) or 'the ground is observable'
            name = f'leg {leg} sensing'
            found.append(self._diagnostics.status(name, level, text, values, f'foot {leg}'))
        return found

    def _learnt_status(self) -> DiagnosticStatus:
        """Return the scales of friction with their intervals, for ``/diagnostics``."""
        values = {}
        for name, scale in self.stage.estimator.shared.scales.items():
            low, high = scale.interval
            values[name] = f'{scale.scale:.2f} ({low:.2f} to {high:.2f})'
        text = 'friction over that of the contact model, with the interval of 95 %'
        return self._diagnostics.status(
            'friction of the floor', Diagnostics.OK, text, values, 'feet'
        )


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
