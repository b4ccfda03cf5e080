# SPDX-License-Identifier: Apache-2.0
"""The controller node: decides flat or dome for each foot, and publishes set-points."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from ros_pad.bags import topics
from ros_pad.control import (
    COMMAND_TIMEOUT,
    POLICIES,
    MorphologyController,
    first_morphologies,
    policy_named,
)
from ros_pad.control.morphology import LIFT_OFF, MARGIN
from ros_pad.control.policies import PREFIX, Policy
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import EXPECTED_LOAD, FOOT, LEGS, SEED, Parameter
from ros_pad.nodes.process import run
from ros_pad.pace import TICK_PERIOD_NS, Pace
from ros_pad.records import Block
from ros_pad.simulation.scene import Scene

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    Parameter('policy', 'adaptive', 'Policy that decides the morphology.', choices=POLICIES),
    *(Parameter(**vars(setting), live=True) for setting in (*POLICY_SETTINGS, MARGIN)),
    Parameter(
        'dome_pressure', 0.0,
        'Gauge pressure of every dome, at least 1000 Pa; 0: it is chosen from the load.',
        'Pa', 0.0, 1e6,
    ),
    Parameter(**vars(LIFT_OFF)),
    Parameter(**vars(COMMAND_TIMEOUT), live=True),
    Parameter(
        'scene', '',
        'Name or path of the scene whose ground policy oracle reads; other policies need none.',
        read=lambda name: Scene.load(name) if name else None,
    ),
    dataclasses.replace(SEED, description='Seed of the floor in parameter scene.'),
)  # fmt: skip


class ControllerNode(PadNode):
    """Choose the morphology of a foot at each lift-off; publish a set-point with every estimate.

    When estimates stop, set-points stop too, and the regulators vent. The state of each leg is
    published on ``/diagnostics`` once a second, and as soon as its faults change. Parameters are
    in :data:`PARAMETERS`.

    Attributes
    ----------
    controller : MorphologyController
        Controller of all legs.
    stage : DecisionStage

    Raises
    ------
    ConfigError
        When a parameter is not allowed, alone or together with others.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('controller', PARAMETERS, **kwargs)
        values, self._legs, self._is_wet = self.values, self.values['legs'], None
        if values['scene']:
            self._is_wet = values['scene'].floor.build(values['seed']).wet
        try:
            self.controller = MorphologyController(
                values['foot'],
                self._legs,
                self._policy(values),
                values['expected_load'],
                start=first_morphologies(values['policy'], self._legs),
                margin=values['margin'],
                fixed_pressure=values['dome_pressure'] or None,
                lift_off_share=values[LIFT_OFF.name],
                command_timeout=values[COMMAND_TIMEOUT.name],
            )
        except InvalidInput as error:
            names = 'parameters policy, scene and dome_pressure'
            raise ConfigError(f'node {self.get_name()}: {error} ({names})') from error
        self.stage = DecisionStage(self.controller, self._legs)
        self._send = self.record_output(topics.COMMAND, self._legs)
        self.receive_record(topics.ESTIMATE, self._legs, self._on_estimate)
        self.receive_record(topics.PRESSURE, self._legs, self.stage.pressure)
        self._tick_pace = Pace(TICK_PERIOD_NS)
        self.on_tick(self._tick)

    def _policy(self, values: Mapping[str, Any]) -> Policy:
        name, settings = values['policy'], {}
        if name == 'adaptive':
            settings = {
                each.name.removeprefix(PREFIX): values[each.name] for each in POLICY_SETTINGS
            }
        return policy_named(name, self._is_wet, settings)

    def permit(self, values: Mapping[str, Any]) -> None:
        """Raise `PadError` if no policy has these parameters."""
        self._policy(values)

    def apply(self, values: Mapping[str, Any]) -> None:
        """Decide with changed parameters from the next lift-off on."""
        self.controller.policy = self._policy(values)
        self.controller.margin = values['margin']
        self.controller.command_timeout = values[COMMAND_TIMEOUT.name]

    def _on_estimate(self, block: Block) -> None:
        self.advance(block.last_ns, self._tick)
        self._send(self.stage.decide(block))
        for leg, refusal in self.controller.refusals.items():
            self.get_logger().warning(
                f'leg {leg} stays flat: {refusal}', throttle_duration_sec=10.0
            )

    def _tick(self, now_ns: int) -> None:
        """Observe legs without estimates, and publish diagnostics."""
        if not self._tick_pace.due(now_ns):
            return
        if command := self.stage.tick(now_ns):
            self._send(command)
        if self.due(now_ns, [self.controller.fault(leg) for leg in self._legs]):
            self.report(now_ns, [self._pad(leg) for leg in self._legs])

    def _pad(self, leg: int) -> DiagnosticStatus:
        """Return the state of a leg for ``/diagnostics``."""
        controller, monitor = self.controller, self.controller.monitor(leg)
        morphology = controller.morphology(leg)
        fault, remark = controller.fault(leg), controller.remark(leg)
        level = self.ERROR if fault else self.WARN if remark else self.OK
        text = '; '.join(filter(None, (fault, remark))) or morphology
        values = {
            'pressure (Pa gauge)': f'{monitor.pressure:.0f}',
            'set-point (Pa gauge)': f'{controller.setpoint(leg):.0f}',
            'shape': morphology,
            'time to fill (s)': f'{monitor.fill_time:.2f}',
            'time to vent (s)': f'{monitor.vent_time:.2f}',
            'touch-downs with too little pressure': controller.underpressure[leg],
            'flat feet pay': controller.friction.flat_pays,
        }
        return self.status(f'leg {leg} pad', level, text, values, f'leg {leg}')


if __name__ == '__main__':
    sys.exit(run(ControllerNode))
