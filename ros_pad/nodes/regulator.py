# SPDX-License-Identifier: Apache-2.0
"""The regulator node: topics, parameters and life cycle of supervised pressure regulators."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import Trigger

from ros_pad.bags import topics
from ros_pad.control import COMMAND_TIMEOUT
from ros_pad.errors import ConfigError
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import BACKEND_OPTIONS, FOOT, LEGS, Parameter, plain
from ros_pad.pace import TICK_PERIOD_NS, Pace
from ros_pad.records import Block
from ros_pad.regulators import BACKENDS, create
from ros_pad.regulators.channel import (
    CEILING_TOLERANCE,
    ON_FAULT,
    SupervisedChannel,
    SupervisorSettings,
)
from ros_pad.regulators.protocol import CEILING
from ros_pad.regulators.supervision import Supervision, supply_health
from ros_pad.simulation.faults import faults_of, parsed
from ros_pad.simulation.scene import Scene

PARAMETERS = (
    LEGS,
    FOOT,
    Parameter('backend', 'simulated', 'Kind of regulator.', choices=tuple(BACKENDS)),
    Parameter(
        'scene', '',
        'Name or path of the scene whose hose and faults the backend simulated uses, unless'
        ' backend_options gives others.',
        read=lambda name: Scene.load(name) if name else None,
    ),
    Parameter(
        'ceiling', CEILING, 'Highest gauge pressure; set-points above it are refused.',
        'Pa', 1000.0, 1e6,
    ),
    Parameter(**vars(COMMAND_TIMEOUT), live=True),
    Parameter(**vars(CEILING_TOLERANCE)),
    Parameter(**vars(ON_FAULT), live=True),
    Parameter(
        'publish_rate', PUBLISH_RATE.default, 'Pressure messages a second, for each leg.',
        'Hz', 1.0, 500.0,
    ),
    Parameter('autostart', True, 'Configure and activate the node when it starts.'),
)  # fmt: skip

LONGEST_TICK = 0.01
"""Longest time between two checks of the age of commands, s, for any ``publish_rate``."""


class RegulatorNode(PadNode, LifecycleNode):
    """Serve one regulator for each leg, as a lifecycle node; see :data:`PARAMETERS`.

    *configure* opens the devices and vents them, *activate* accepts set-points, *deactivate*
    vents the pads, *cleanup* closes the devices. Set-points that
    :class:`~ros_pad.regulators.channel.SupervisedChannel` refuses are reported on
    ``/diagnostics``. The service ``~/vent`` deactivates the node: the pads stay vented until the
    node is activated again. Options of the backend are parameters ``backend_options.*``.

    Attributes
    ----------
    supervision : Supervision
        The channels of all legs; none while the devices are closed.
    tick_ns : int
        Time of the last tick, ns, on the clock of the stamps.

    Raises
    ------
    ConfigError
        When a parameter is not allowed.
    PadError
        With ``autostart``, when a device cannot be opened.
    """

    supervision = Supervision(())

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('regulator', PARAMETERS, **kwargs)
        values, legs = self.values, self.values['legs']
        backend, foot = values['backend'], values['foot']
        if self.simulated and backend != 'simulated':
            raise ConfigError(
                f'node {self.get_name()}: parameter use_sim_time = True is not allowed with'
                f' backend {backend}: if /clock stops, its pads stay under pressure'
            )
        if values['ceiling'] > foot.ceiling:
            raise ConfigError(
                f'node {self.get_name()}: parameter ceiling = {values["ceiling"]:g} Pa is'
                f' not allowed: the ceiling of foot {foot.source} is {foot.ceiling:g} Pa'
            )
        self._read_pace = Pace(round(1e9 / values['publish_rate']))
        self._check_pace = Pace(TICK_PERIOD_NS)
        self.tick_ns = 0
        self._problem: Exception | None = None  # why the last configuration failed
        self._send = self.record_output(topics.PRESSURE, legs)
        self.receive_record(topics.COMMAND, legs, self._on_command)
        self.create_service(Trigger, '~/vent', self._on_vent)
        self.add_on_set_parameters_callback(self._check_options)
        self.on_tick(
            self._on_time, min(LONGEST_TICK, 0.5 / values['publish_rate']), all_steps=True
        )
        self._starting: bool = values['autostart']
        if self._starting:
            self.trigger_configure()
            if self._problem:
                raise self._problem
            self.trigger_activate()
            self._starting = False

    def _check_options(self, changes: list[RosParameter]) -> SetParametersResult:
        """Refuse changes of backend options while devices are open; *configure* reads them."""
        if self.supervision.channels and any(BACKEND_OPTIONS in each.name for each in changes):
            return SetParametersResult(reason='the devices are open: clean up the node first')
        return SetParametersResult(successful=True)

    def apply(self, values: Mapping[str, Any]) -> None:
        """Supervise with changed settings."""
        for channel in self.supervision.channels:
            channel.settings = _settings(values)

    @property
    def active(self) -> bool:
        """Whether set-points are accepted."""
        return any(each.active for each in self.supervision.channels)

    # --- life cycle ----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the devices and vent their pads."""
        values, opened = self.values, []
        self._problem = None
        try:
            options = self._backend_options()
            faults = parsed(options.pop('faults', ()))
            for place, leg in enumerate(values['legs']):
                own = {name: self._of_leg(name, value, place) for name, value in options.items()}
                if faults:
                    own['faults'] = faults_of(leg, faults)
                regulator = create(values['backend'], ceiling=values['ceiling'], **own)
                channel = SupervisedChannel(leg, regulator, _settings(values), self.get_logger())
                channel.open()
                opened.append(channel)
        except Exception as error:  # rclpy would discard it without a message
            Supervision(opened).close('the configuration failed')
            error.args = (f'node {self.get_name()}: {error}',)
            self._problem = error
            if not self._starting:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self.supervision = Supervision(opened)
        return TransitionCallbackReturn.SUCCESS

    def _backend_options(self) -> dict[str, Any]:
        """Return the options of the backend: one value for all legs, or a list with one a leg."""
        values, options = self.values, {}
        if values['backend'] == 'simulated':
            begun_ns = self._elapsed(0)
            options = {
                'clock': lambda: 1e-9 * (self._elapsed(self.tick_ns) - begun_ns),
                'pad_volume': values['foot'].air_volume,
            }
            if values['scene']:
                options |= values['scene'].regulator_options
        for name in self.get_parameters_by_prefix(BACKEND_OPTIONS):
            options[name] = plain(self.get_parameter(f'{BACKEND_OPTIONS}.{name}').value)
        if 'ceiling' in options:
            raise ConfigError(
                f'parameter {BACKEND_OPTIONS}.ceiling = {options["ceiling"]!r} is not'
                ' allowed: set the parameter ceiling instead'
            )
        return options

    def _of_leg(self, name: str, value: Any, place: int) -> Any:
        """Return an option for the device of one leg: the value for all, or an item of a list."""
        if not isinstance(value, (list, tuple)):
            return value
        if len(value) != len(self.values['legs']):
            raise ConfigError(
                f'parameter {BACKEND_OPTIONS}.{name} = {list(value)!r} is not allowed: one value,'
                f' or a list of one for each leg in {list(self.values["legs"])}, is needed'
            )
        return value[place]

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept set-points from now on, also for pads that were held."""
        self.supervision.activate(self._elapsed(self.tick_ns))
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and accept no more set-points."""
        self.supervision.deactivate('the node was deactivated')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the devices."""
        return self._close('the node was cleaned up')

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices."""
        return self._close('the node was shut down')

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices after an unexpected error in a transition."""
        return self._close('a transition failed')

    def destroy_node(self) -> None:
        """Vent every pad and close the devices before the node ends."""
        self._close('the node ends')
        super().destroy_node()

    def _close(self, reason: str) -> TransitionCallbackReturn:
        self.supervision.close(reason)
        self.supervision = Supervision(())
        return TransitionCallbackReturn.SUCCESS

    # --- messages and time ---------------------------------------------------------------------

    def _on_vent(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # A vent alone would last only until the next set-point of the controller.
        if self.active:
            self.trigger_deactivate()
        else:
            self.supervision.vent('~/vent was called')
        channels = self.supervision.channels
        failed = [str(each.leg) for each in channels if not each.vented]
        response.success = bool(channels) and not failed
        response.message = 'the pads stay vented until the node is activated again'
        if not channels:
            response.message = 'no device is open: configure the node first'
        elif failed:
            response.message = f'cannot vent leg {", ".join(failed)}'
        return response

    def _on_command(self, block: Block) -> None:
        if not self.supervision.channels:  # the devices are closed
            return
        clock_ns = self.now_ns()
        if not (self.simulated and self.active):
            self.supervision.command(block, clock_ns, self._elapsed(clock_ns))
            return
        now_ns = self.tick_ns if self._ahead_of(clock_ns) else clock_ns
        if abs(block.last_ns - clock_ns) <= TICK_PERIOD_NS:
            # The record may come before the message of /clock of its moment.
            now_ns = max(now_ns, block.last_ns)
            self._record_ns = block.last_ns
        self._supervise(now_ns)
        answer = self.supervision.read(block.last_ns, now_ns)
        self.supervision.command(block, now_ns, now_ns)
        self._send(answer)  # who waits for it finds the command carried out

    def _elapsed(self, now_ns: int) -> int:
        """Return the time for the age of commands, ns: simulated, or of the monotonic clock."""
        return now_ns if self.simulated else time.monotonic_ns()

    def _ahead_of(self, clock_ns: int) -> bool:
        """Return whether a record was ahead of a simulated time, ns, which does not go back."""
        return self.simulated and 0 <= self.tick_ns - clock_ns <= TICK_PERIOD_NS

    def _on_time(self, now_ns: int) -> None:
        if self.active and self._ahead_of(now_ns):
            return
        self._supervise(now_ns)
        # In simulated time commands are answered at once: no readings come between them.
        answers = self.simulated and self.active
        if answers and abs(now_ns - self._record_ns) <= TICK_PERIOD_NS:
            return
        if self._read_pace.due(now_ns) and self.supervision.channels:
            self._send(self.supervision.read(now_ns, self._elapsed(now_ns)))

    def _supervise(self, now_ns: int) -> None:
        """Vent pads without commands, and report on ``/diagnostics``."""
        self.tick_ns = now_ns
        self.supervision.tick(self._elapsed(now_ns))
        if self._check_pace.due(now_ns):
            self._diagnose(now_ns)

    def _diagnose(self, now_ns: int) -> None:
        """Publish the health of the pads once a second, and at once when a problem changes."""
        channels = self.supervision.channels
        found = [each.health() for each in channels]
        supply = supply_health(channels)
        # Filled and vented are both healthy, so a change between them is not reported at once.
        problems = [health.message if health.level else '' for health in (*found, supply)]
        refused = any(each.answers.due for each in channels)
        if not (self.due(now_ns, problems) or refused):
            return
        backend = self.values['backend']
        statuses = [
            self.status(
                f'leg {each.leg} regulator',
                *each.answers.report(health),
                each.figures(),
                f'{backend} {each.leg}',
            )
            for each, health in zip(channels, found, strict=True)
        ]
        if channels:
            statuses.append(self.status('supply', *supply, part=f'{backend} supply'))
        self.report(now_ns, statuses)


def _settings(values: Mapping[str, Any]) -> SupervisorSettings:
    own = {each.name: values[each.name] for each in fields(SupervisorSettings)}
    return SupervisorSettings(**own)
