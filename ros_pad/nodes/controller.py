# SPDX-License-Identifier: Apache-2.0
"""The controller node: decides flat or dome for each foot, and publishes set-points."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future

from ros_pad.control import (
    COMMAND_TIMEOUT,
    POLICIES,
    MorphologyController,
    first_morphologies,
    policy_named,
)
from ros_pad.control.morphology import LIFT_OFF, MARGIN
from ros_pad.control.policies import PREFIX, IsWet, Policy
from ros_pad.control.policies import SETTINGS as POLICY_SETTINGS
from ros_pad.control.stage import DecisionStage
from ros_pad.errors import ConfigError, InvalidInput, LimitError
from ros_pad.nodes import topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import EXPECTED_LOAD, FOOT, LEGS, SEED, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.pace import TICK_PERIOD_NS, Pace
from ros_pad.records import Block
from ros_pad.simulation.scene import Scene


def _set(name: str) -> Callable[[ControllerNode, float], None]:
    """Return a function that sets an attribute of the controller to a new value."""
    return lambda node, value: setattr(node.controller, name, value)


PARAMETERS = (
    LEGS,
    FOOT,
    EXPECTED_LOAD,
    Parameter('policy', 'adaptive', 'Policy that decides the morphology.', choices=POLICIES),
    *(
        Parameter(**vars(setting), live=True, change=lambda node, _: node.update_policy())
        for setting in POLICY_SETTINGS
    ),
    Parameter(**vars(MARGIN), live=True, change=_set('margin')),
    Parameter(
        'dome_pressure', 0.0,
        'Gauge pressure of every dome, at least 1000 Pa; 0: it is chosen from the load.',
        'Pa', 0.0, 1e6,
    ),
    Parameter(**vars(LIFT_OFF)),
    Parameter(**vars(COMMAND_TIMEOUT), live=True, change=_set('command_timeout')),
    Parameter(
        'scene', '',
        'Name or path of the scene whose ground policy oracle reads; other policies need none.',
        read=lambda name: Scene.load(name) if name else None,
    ),
    dataclasses.replace(SEED, description='Seed of the floor in parameter scene.'),
)  # fmt: skip


def policy_of(values: Mapping[str, Any], is_wet: IsWet | None = None) -> Policy:
    """Return the policy that the parameters of a node describe; policy oracle needs ``is_wet``.

    Raises
    ------
    InvalidInput
        When parameters of the policy are not allowed together.
    """
    name = values['policy']
    parameters = {each.name.removeprefix(PREFIX): values[each.name] for each in POLICY_SETTINGS}
    return policy_named(name, is_wet, parameters if name == 'adaptive' else None)


def _check_policy(values: Mapping[str, Any]) -> None:
    if values['policy'] == 'adaptive':
        policy_of(values)


class ControllerNode(Node):
    """Choose the morphology of a foot at each lift-off; publish a set-point with every estimate.

    When estimates stop, set-points stop too, and the regulators vent. The state of each leg is
    published on ``/diagnostics`` once a second, and as soon as its faults change. Parameters are
    in :data:`PARAMETERS`.

    Attributes
    ----------
    controller : MorphologyController
        Controller of all legs.
    stage : DecisionStage
    messages : Messages
        Publishers and subscriptions.

    Raises
    ------
    ConfigError
        When a parameter is not allowed, alone or together with others.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'controller', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        self._values = values = declare(self, PARAMETERS, _check_policy)
        legs = values['legs']
        self._is_wet = None
        if values['scene']:
            self._is_wet = values['scene'].floor.build(values['seed']).wet
        elif values['policy'] == 'oracle':
            raise ConfigError(
                f"node {self.get_name()}: parameter scene = '' is not allowed:"
                ' policy oracle needs the name or path of a scene, whose ground it reads'
            )
        try:
            self.controller = MorphologyController(
                values['foot'],
                legs,
                policy_of(values, self._is_wet),
                values['expected_load'],
                start=first_morphologies(values['policy'], legs),
                margin=values['margin'],
                fixed_pressure=values['dome_pressure'] or None,
                lift_off_share=values[LIFT_OFF.name],
                command_timeout=values[COMMAND_TIMEOUT.name],
            )
        except (InvalidInput, LimitError) as error:
            # dome_pressure is in its range, but too low for a dome or above the foot's ceiling.
            raise ConfigError(
                f'node {self.get_name()}: {error} (parameter dome_pressure)'
            ) from error
        self._legs: list[int] = legs
        self.stage = DecisionStage(self.controller, legs, self._warn)
        self.messages = messages = Messages(self)
        self._send = messages.record_output(topics.COMMAND, legs)
        messages.receive_record(topics.ESTIMATE, legs, self._on_estimate)
        messages.receive_record(topics.PRESSURE, legs, self.stage.pressure)
        self._diagnostics = Diagnostics(self, messages)
        self._tick_pace = Pace(TICK_PERIOD_NS)
        regulator = f'{self.get_namespace().rstrip("/")}/regulator'
        self.create_subscription(
            ParameterEvent,
            '/parameter_events',
            partial(self._follow_timeout, regulator),
            qos_profile_parameter_events,
        )
        # Events report only later changes: the present value is requested, if SROS 2 allows it.
        self._regulator = None
        with suppress(RuntimeError):
            self._regulator = self.create_client(GetParameters, f'{regulator}/get_parameters')
        messages.on_tick(TICK_PERIOD_NS * 1e-9, self._tick)

    def update_policy(self) -> None:
        """Decide with the present parameters from the next lift-off on."""
        self.controller.policy = policy_of(self._values, self._is_wet)

    def _follow_timeout(self, regulator: str, event: ParameterEvent) -> None:
        """Take the command timeout from the regulator node of the same namespace."""
        if event.node != regulator:
            return
        for each in (*event.new_parameters, *event.changed_parameters):
            if each.name == COMMAND_TIMEOUT.name:
                self._take_timeout(each.value)

    def _take_timeout(self, value: ParameterValue) -> None:
        # Any node may publish events: values of other types, even unknown ones, are ignored.
        if value.type != ParameterType.PARAMETER_DOUBLE:
            return
        seconds = value.double_value
        if seconds != self.controller.command_timeout:
            self.set_parameters([RosParameter(COMMAND_TIMEOUT.name, value=seconds)])

    def _ask_for_timeout(self) -> None:
        """Ask the regulator for its command timeout as soon as it is there, once."""
        if self._regulator is None or not self._regulator.service_is_ready():
            return
        request = GetParameters.Request(names=[COMMAND_TIMEOUT.name])

        def take(answer: Future) -> None:
            if answer.exception() is None:
                for value in answer.result().values:
                    self._take_timeout(value)

        self._regulator.call_async(request).add_done_callback(take)
        self._regulator = None

    def _on_estimate(self, block: Block) -> None:
        if self.messages.simulated:
            self.messages.advance(block.last_ns)
            self._tick(block.last_ns)
        self._send(self.stage.decide(block))
        for leg, refusal in self.controller.refusals.items():
            self.get_logger().warning(
                f'leg {leg} stays flat: {refusal}', throttle_duration_sec=10.0
            )

    def _warn(self, leg: int, error: InvalidInput) -> None:
        self.get_logger().warning(
            f'leg {leg}: estimate ignored: {error}', throttle_duration_sec=1.0
        )

    def _tick(self, now_ns: int) -> None:
        """Observe legs without estimates, and publish diagnostics."""
        if not self._tick_pace.due(now_ns):
            return
        self._ask_for_timeout()
        command = self.stage.tick(now_ns)
        if command:
            self._send(command)
        faults = [self.controller.fault(leg) for leg in self._legs]
        if self._diagnostics.due(now_ns, faults):
            self._diagnose(now_ns)

    def _diagnose(self, now_ns: int) -> None:
        controller, statuses = self.controller, []
        for leg in self._legs:
            morphology, monitor = controller.morphology(leg), controller.monitor(leg)
            fault, remark = controller.fault(leg), controller.remark(leg)
            level = Diagnostics.ERROR if fault else Diagnostics.WARN if remark else Diagnostics.OK
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
            name, part = f'leg {leg} pad', f'leg {leg}'
            statuses.append(self._diagnostics.status(name, level, text, values, part))
        self._diagnostics.send(now_ns, statuses)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(ControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
