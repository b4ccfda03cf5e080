# SPDX-License-Identifier: Apache-2.0
"""The estimator node: samples and pressures of all feet in, estimates out.

The reason why the ground is unobservable is in each estimate as a code, and on ``/diagnostics``
as text, with the health of the sensors.
"""

from __future__ import annotations

import os
from typing import Any

from ros_pad.bags import topics
from ros_pad.errors import InvalidInput, PadError
from ros_pad.estimation import SETTINGS, Tuning
from ros_pad.estimation import doubt as doubts
from ros_pad.estimation.stage import PUBLISH_RATE, EstimationStage
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import EXPECTED_LOAD, FOOT, LEGS, Parameter
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


class EstimatorNode(PadNode):
    """Estimate slip, friction and wetness under each foot; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    stage : EstimationStage
    """

    _kept: Any = None  # settings that were learnt and are in the file

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('estimator', PARAMETERS, **kwargs)
        values, self._legs = self.values, self.values['legs']
        self.stage = EstimationStage(
            values['foot'],
            values['expected_load'],
            Tuning.of(values),
            self._legs,
            round(1e9 / values['publish_rate']),
            self._warn,
        )
        self._kept = learnt.settings_of(self.stage.model.shared)
        self._send = self.record_output(topics.ESTIMATE, self._legs)
        self._keep_pace = Pace(KEEP_PERIOD_NS)
        self.receive_record(topics.SAMPLE, self._legs, self._on_samples)
        self.receive_record(topics.PRESSURE, self._legs, self.stage.pressure)
        self.on_tick(self._look)

    def _on_samples(self, block: Block) -> None:
        self.advance(block.last_ns)
        for estimate in self.stage.process(block):
            self._send(estimate)

    def _warn(self, leg: int, error: InvalidInput) -> None:
        self.get_logger().warning(f'leg {leg}: sample ignored: {error}', throttle_duration_sec=1.0)

    def prepare(self) -> None:
        """Begin with what was learnt in earlier trials, if there is a file of it."""
        given = {'learnt': '', 'foot': FOOT.default}
        for name in given:
            if self.has_parameter(name):
                given[name] = str(self.get_parameter(name).value)
        if not given['learnt'] or not os.path.exists(given['learnt']):
            return
        for name, value in learnt.load(given['learnt'], given['foot']).items():
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            self.declare_parameter(name, value, ignore_override=True)

    def keep_learnt(self) -> None:
        """Write what feet have learnt of friction, if it is new and there is a file for it."""
        path, settings = self.values['learnt'], learnt.settings_of(self.stage.model.shared)
        if not path or settings == self._kept:
            return
        try:
            learnt.save(path, settings, self.values['foot'])
            self._kept = settings
        except PadError as error:
            self.get_logger().warning(f'parameter learnt: {error}', throttle_duration_sec=60.0)

    def destroy_node(self) -> None:
        """Write what was learnt, and destroy the node."""
        if self._kept is not None:
            self.keep_learnt()
        super().destroy_node()

    def _look(self, now_ns: int) -> None:
        """Look for silent sensors, and report on all of them."""
        self.stage.tick(now_ns)
        if self._keep_pace.due(now_ns):
            self.keep_learnt()
        estimate = self.stage.estimate(now_ns)
        rows = estimate.rows[0]
        healthy = [not doubts.is_fault(code) for code in rows['doubt'].tolist()]
        if healthy != self.reported and now_ns != self._record_ns:
            self._send(estimate)  # no sample says it, and the controller has to know
        if self.due(now_ns, healthy):
            feet = map(self._foot, range(len(rows)), rows, healthy)
            rate = self.rate(now_ns, self.stage.samples, self.stage.last_ns)
            self.report(now_ns, [*feet, self._learnt_status(), *rate])

    def _foot(self, index: int, row: Any, healthy: bool) -> Any:
        """Return the health of the sensors of a foot, and its estimate, for ``/diagnostics``."""
        leg, noise = self._legs[index], self.stage.tracks[index].watch
        values = {
            'P(wet)': f'{row["wetness"]:.3f}',
            'friction': f'{row["friction"]:.3f}',
            'friction sd': f'{row["friction_sd"]:.3f}',
            'position noise': noise.position.text('m'),
            'force noise': noise.force.text('N'),
            'samples': self.stage.used[index],
        }
        text = doubts.text(row['doubt'], *row['detail']) or 'the ground is observable'
        level = self.OK if healthy else self.ERROR
        return self.status(f'leg {leg} sensing', level, text, values, f'foot {leg}')

    def _learnt_status(self) -> Any:
        """Return the scales of friction with their intervals, for ``/diagnostics``."""
        values = {}
        for name, scale in self.stage.model.shared.scales.items():
            low, high = scale.interval
            values[name] = f'{scale.scale:.2f} ({low:.2f} to {high:.2f})'
        text = 'friction over that of the contact model, with the interval of 95 %'
        return self.status('friction of the floor', self.OK, text, values, 'feet')
