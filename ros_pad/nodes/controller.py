# SPDX-License-Identifier: Apache-2.0
"""The controller node: decides flat or dome for each foot, and publishes set-points."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ros_pad.bags import topics
from ros_pad.control import COMMAND_TIMEOUT, POLICIES, MorphologyController
from ros_pad.control.morphology import LIFT_OFF, MARGIN
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import EXPECTED_LOAD, FOOT, LEGS, SEED, Parameter
from ros_pad.records import Block
from ros_pad.simulation.scene import Scene
from ros_pad.trials.node_settings import FIXED_PRESSURE, NodeSettings

PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    Parameter('policy', 'adaptive', 'Policy that decides the morphology.', choices=POLICIES),
    *(Parameter(**vars(setting), live=True) for setting in (*POLICY_SETTINGS, MARGIN)),
    Parameter(**vars(FIXED_PRESSURE)),
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
        values, self._legs = self.values, self.values['legs']
        self._floor = values['scene'].floor.build(values['seed']) if values['scene'] else None
        try:
            self.controller = self._made(values)
        except InvalidInput as error:
            names = 'parameters policy, scene and dome_pressure'
            raise ConfigError(f'node {self.get_name()}: {error} ({names})') from error
        self.stage = DecisionStage(self.controller, self._legs)
        self._send = self.record_output(topics.COMMAND, self._legs)
        self.receive_record(topics.ESTIMATE, self._legs, self._on_estimate)
        self.receive_record(topics.PRESSURE, self._legs, self.stage.pressure)
        self.on_tick(self._observe)

    def _made(self, values: Mapping[str, Any]) -> MorphologyController:
        """Return a new controller with these parameters."""
        settings = NodeSettings(values['foot'], values['policy'], dict(values), self._floor)
        return settings.controller(values['legs'])

    def permit(self, values: Mapping[str, Any]) -> None:
        """Raise `PadError` if no controller has these parameters."""
        self._made(values)

    def apply(self, values: Mapping[str, Any]) -> None:
        """Decide with changed parameters from the next lift-off on."""
        self.controller.policy = self._made(values).policy
        self.controller.margin = values['margin']
        self.controller.command_timeout = values[COMMAND_TIMEOUT.name]

    def _on_estimate(self, block: Block) -> None:
        self.advance(block.last_ns)
        self._send(self.stage.decide(block))
        for leg, refusal in self.controller.refusals.items():
            self.get_logger().warning(
                f'leg {leg} stays flat: {refusal}', throttle_duration_sec=10.0
            )

    def _observe(self, now_ns: int) -> None:
        """Observe legs without estimates, and publish diagnostics."""
        if command := self.stage.tick(now_ns):
            self._send(command)
        if self.due(now_ns, [self.controller.fault(leg) for leg in self._legs]):
            self.report(now_ns, [self._pad(leg) for leg in self._legs])

    def _pad(self, leg: int) -> Any:
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
