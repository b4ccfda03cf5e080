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
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from rclpy.node import Node

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.estimation import SETTINGS
from ros_pad.estimation import Tuning
from ros_pad.estimation import doubt as doubts
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.tuning import attribute
from ros_pad.nodes import topics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import EXPECTED_LOAD
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.refusals import rate_status
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import TICK_PERIOD_NS
from ros_pad.pace import Pace
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

OLDEST = 0.1
"""Age of the last sample, s, from which the estimator counts as late."""

_LEVELS = {True: DiagnosticStatus.OK, False: DiagnosticStatus.ERROR}


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
        self._diagnostics = messages.output(topics.DIAGNOSTICS)
        self._diagnostics_pace = Pace(1_000_000_000)
        self._keep_pace = Pace(KEEP_PERIOD_NS)
        self._reported: list[bool] = []
        self._since_ns, self._counted = messages.now_ns(), 0
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
        before = self._reported
        self._tick(now_ns)
        if self._reported != before:
            self._send(self.stage.estimate(now_ns))

    def _tick(self, now_ns: int) -> None:
        if not self._health_pace.due(now_ns):
            return
        self.stage.tick(now_ns)
        if self._keep_pace.due(now_ns):
            self.keep_learnt()
        rows = self.stage.estimate(now_ns).rows[0]
        sound = [not doubts.is_fault(code) for code in rows['doubt'].tolist()]
        if self._diagnostics_pace.due(now_ns) or sound != self._reported:
            self._reported = sound
            array = DiagnosticArray(status=self._statuses(rows, sound))
            array.status.append(self._learnt_status())
            array.status.extend(self.messages.refusals.statuses())
            if not self.messages.simulated:
                array.status.append(self._rate(now_ns))
            set_stamp(array.header.stamp, now_ns)
            self._diagnostics(array)

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
                'samples': str(self.stage.used[index]),
            }
            found.append(
                DiagnosticStatus(
                    name=f'{self.get_name()}: leg {leg} sensing',
                    hardware_id=f'foot {leg}',
                    level=_LEVELS[sound[index]],
                    message=doubts.text(row['doubt'], *row['detail'])
                    or 'the ground is observable',
                    values=[KeyValue(key=key, value=value) for key, value in values.items()],
                )
            )
        return found

    def _learnt_status(self) -> DiagnosticStatus:
        """Return the scales of friction with their intervals, for ``/diagnostics``."""
        values = []
        for name, scale in self.stage.estimator.shared.scales.items():
            low, high = scale.interval
            text = f'{scale.scale:.2f} ({low:.2f} to {high:.2f})'
            values.append(KeyValue(key=name, value=text))
        return DiagnosticStatus(
            name=f'{self.get_name()}: friction of the floor',
            hardware_id='feet',
            level=DiagnosticStatus.OK,
            message='friction over that of the contact model, with the interval of 95 %',
            values=values,
        )

    def _rate(self, now_ns: int) -> DiagnosticStatus:
        """Return rate and age of the samples, for ``/diagnostics``."""
        elapsed = max(1, now_ns - self._since_ns) * 1e-9
        rate = (self.stage.samples - self._counted) / elapsed
        self._since_ns, self._counted = now_ns, self.stage.samples
        age = (now_ns - self.stage.last_ns) * 1e-9
        return rate_status(self.get_name(), rate, age, OLDEST)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
