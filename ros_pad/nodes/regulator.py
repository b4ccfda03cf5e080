# SPDX-License-Identifier: Apache-2.0
"""The regulator node: topics, parameters and life cycle of supervised pressure regulators."""

from __future__ import annotations

import sys
import time
from array import array
from dataclasses import fields
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from std_srvs.srv import Trigger

from ros_pad.configuration import Setting
from ros_pad.contact.resistance import Foot
from ros_pad.control import COMMAND_TIMEOUT
from ros_pad.errors import ConfigError
from ros_pad.estimation.stage import PUBLISH_RATE
from ros_pad.nodes import topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import BACKEND_OPTIONS, FOOT, LEGS, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.pace import TICK_PERIOD_NS, Pace
from ros_pad.records import Block
from ros_pad.regulators import BACKENDS, create
from ros_pad.regulators.channel import (
    CEILING_TOLERANCE,
    ON_FAULT,
    SLEW_LIMIT,
    Health,
    Level,
    SupervisedChannel,
    SupervisorSettings,
)
from ros_pad.regulators.protocol import CEILING
from ros_pad.regulators.supervision import Supervision, supply_health
from ros_pad.simulation.faults import faults_of, parsed
from ros_pad.simulation.scene import Scene


def _supervision(setting: Setting) -> Parameter:
    """Return the live parameter of a setting of the supervision."""
    return Parameter(**vars(setting), live=True, change=lambda node, _: node.update_settings())


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
    _supervision(COMMAND_TIMEOUT),
    _supervision(SLEW_LIMIT),
    Parameter(**vars(CEILING_TOLERANCE)),
    _supervision(ON_FAULT),
    Parameter(
        'publish_rate', PUBLISH_RATE.default, 'Pressure messages a second, for each leg.',
        'Hz', 1.0, 500.0,
    ),
    Parameter('autostart', True, 'Configure and activate the node when it starts.'),
)  # fmt: skip

LONGEST_TICK = 0.01
"""Longest time between two checks of the age of commands, s, for any ``publish_rate``."""

_CHECK_PERIOD_NS = 100_000_000  # period of checks for faults that are reported at once


class RegulatorNode(LifecycleNode):
    """Serve one regulator for each leg, as a lifecycle node; see :data:`PARAMETERS`.

    *configure* opens the devices and vents them, *activate* accepts set-points, *deactivate*
    vents the pads, *cleanup* closes the devices. Set-points that
    :class:`~ros_pad.regulators.channel.SupervisedChannel` refuses are reported on
    ``/diagnostics``. The service ``~/vent`` deactivates the node: the pads stay vented until the
    node is activated again. Options of the backend are parameters ``backend_options.*``.

    Attributes
    ----------
    channels : dict
        The :class:`SupervisedChannel` of each leg; empty while the devices are closed.
    supervision : Supervision
        All of them.
    tick_ns : int
        Time of the last tick, ns, on the clock of the stamps.
    messages : Messages
        Publishers and subscriptions.

    Raises
    ------
    ConfigError
        When a parameter is not allowed.
    PadError
        With ``autostart``, when a device cannot be opened.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'regulator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        # From here on the context of ROS 2 Kilted may destroy the node before it is complete.
        self.channels: dict[int, SupervisedChannel] = {}
        self._values = declare(self, PARAMETERS)
        self._foot: Foot = self._values['foot']
        self._check_parameters()
        self.supervision = Supervision(())
        self._pace = Pace(round(1e9 / self._values['publish_rate']))
        self._check_pace = Pace(_CHECK_PERIOD_NS)
        self._mismatch = ''  # warning of a mismatch of QoS
        self.tick_ns = 0
        self._record_ns = 0  # stamp of the last command that was answered
        self._elapsed_ns = 0  # the same on the clock that measures the age of commands
        self._starting: bool = self._values['autostart']
        self._problem: Exception | None = None  # why the last configuration failed
        self.messages = Messages(self)
        self._diagnostics = Diagnostics(self, self.messages)
        legs = self._values['legs']
        self._send = self.messages.record_output(topics.PRESSURE, legs)
        self.messages.receive_record(topics.COMMAND, legs, self._on_command, self._mismatched)
        self.create_service(Trigger, '~/vent', self._on_vent)
        self.add_on_set_parameters_callback(self._check_options)
        period = min(LONGEST_TICK, 0.5 / self._values['publish_rate'])
        self.messages.on_tick(period, self._tick, every=True)
        if self._starting:
            self.trigger_configure()
            if self._problem:
                raise self._problem
            self.trigger_activate()
            self._starting = False

    def _check_parameters(self) -> None:
        """Refuse values that are not allowed together."""
        simulated_time = self.get_parameter('use_sim_time').value
        if simulated_time and self._values['backend'] != 'simulated':
            raise ConfigError(
                f'node {self.get_name()}: parameter use_sim_time = True is not allowed with'
                f' backend {self._values["backend"]}: if /clock stops, its pads stay under'
                ' pressure; set use_sim_time to false'
            )
        if self._values['ceiling'] > self._foot.ceiling:
            raise ConfigError(
                f'node {self.get_name()}: parameter ceiling = {self._values["ceiling"]:g} Pa is'
                f' not allowed: the ceiling of foot {self._foot.source} is'
                f' {self._foot.ceiling:g} Pa'
            )

    def _check_options(self, changes: list[RosParameter]) -> SetParametersResult:
        """Refuse changes of backend options while devices are open; *configure* reads them."""
        for each in changes:
            if self.channels and each.name.startswith(f'{BACKEND_OPTIONS}.'):
                return SetParametersResult(
                    reason=f'node {self.get_name()}: parameter {each.name} cannot change while the'
                    ' devices are open: clean up the node first'
                )
        return SetParametersResult(successful=True)

    def _settings(self) -> SupervisorSettings:
        names = [each.name for each in fields(SupervisorSettings)]
        return SupervisorSettings(**{name: self._values[name] for name in names})

    def update_settings(self) -> None:
        """Apply the present values of the parameters to all channels."""
        settings = self._settings()
        for channel in self.channels.values():
            channel.settings = settings

    @property
    def active(self) -> bool:
        """Whether set-points are accepted."""
        return any(each.active for each in self.channels.values())

    # --- life cycle ----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the devices and vent their pads."""
        settings = self._settings()
        self._problem = None
        try:
            options = self._backend_options()
            faults = parsed(options.pop('faults', ()))
            for place, leg in enumerate(self._values['legs']):
                own = {name: self._of_leg(name, value, place) for name, value in options.items()}
                if faults:
                    own['faults'] = faults_of(leg, faults)
                regulator = create(self._values['backend'], ceiling=self._values['ceiling'], **own)
                channel = SupervisedChannel(leg, regulator, settings, self.get_logger())
                channel.open()
                self.channels[leg] = channel
            self.supervision = Supervision(tuple(self.channels.values()))
        except Exception as error:  # rclpy would discard it without a message
            self._close('the configuration failed')
            error.args = (f'node {self.get_name()}: {error}',)
            self._problem = error
            if not self._starting:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def _backend_options(self) -> dict[str, Any]:
        """Return the options of the backend: one value for all legs, or a list with one a leg."""
        options: dict[str, Any] = {}
        if self._values['backend'] == 'simulated':
            begun = 0.0 if self.messages.simulated else time.monotonic()
            now = self._last_tick if self.messages.simulated else time.monotonic
            options = {'clock': lambda: now() - begun, 'pad_volume': self._foot.air_volume}
            if self._values['scene']:
                options |= self._values['scene'].regulator_options
        for name in self.get_parameters_by_prefix(BACKEND_OPTIONS):
            options[name] = self.get_parameter(f'{BACKEND_OPTIONS}.{name}').value
        if 'ceiling' in options:
            raise ConfigError(
                f'parameter {BACKEND_OPTIONS}.ceiling = {options["ceiling"]!r} is not'
                ' allowed: set the parameter ceiling instead'
            )
        return options

    def _of_leg(self, name: str, value: Any, place: int) -> Any:
        """Return an option for the device of one leg: the value for all, or an item of a list."""
        if not isinstance(value, (list, tuple, array)):
            return value
        legs = self._values['legs']
        if len(value) != len(legs):
            raise ConfigError(
                f'parameter {BACKEND_OPTIONS}.{name} = {list(value)!r} is not allowed: one value,'
                f' or a list of one for each leg in {list(legs)}, is needed'
            )
        return value[place]

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept set-points from now on, also for pads that were held."""
        for channel in self.channels.values():
            channel.activate(self._elapsed(self.tick_ns))
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and accept no more set-points."""
        for channel in self.channels.values():
            channel.deactivate('the node was deactivated')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the devices."""
        self._close('the node was cleaned up')
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices."""
        self._close('the node was shut down')
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices after an unexpected error in a transition."""
        self._close('a transition failed')
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """Vent every pad and close the devices before the node ends."""
        self._close('the node ends')
        super().destroy_node()

    def vent(self, reason: str) -> None:
        """Vent every pad; a vent that fails is logged and does not stop the others."""
        for channel in self.channels.values():
            channel.vent(reason)

    def _close(self, reason: str) -> None:
        # Vent all pads first, because closing a device may take time.
        self.vent(f'closing the device: {reason}')
        for channel in self.channels.values():
            channel.close(reason)
        self.channels.clear()
        self.supervision = Supervision(())

    # --- messages and time ---------------------------------------------------------------------

    def _on_vent(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # A vent alone would last only until the next set-point of the controller.
        if self.active:
            self.trigger_deactivate()
        else:
            self.vent('~/vent was called')
        failed = [str(leg) for leg, channel in self.channels.items() if not channel.outlet.vented]
        response.success = bool(self.channels) and not failed
        if not self.channels:
            response.message = 'no device is open: configure the node first'
        elif failed:
            response.message = f'cannot vent leg {", ".join(failed)}'
        else:
            response.message = (
                f'{len(self.channels)} pads were commanded to vent; activate the node to accept'
                ' set-points again'
            )
        return response

    def _mismatched(self, warning: str) -> None:
        self._mismatch = warning

    def _on_command(self, block: Block) -> None:
        self._mismatch = ''
        if not self.channels:  # the devices are closed
            return
        clock_ns = self.messages.now_ns()
        if not (self.messages.simulated and self.active):
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

    def _last_tick(self) -> float:
        """Return the time of the last tick, s; this is the clock of simulated regulators."""
        return self._elapsed_ns * 1e-9

    def _elapsed(self, now_ns: int) -> int:
        """Return the time for the age of commands, ns: simulated, or of the monotonic clock."""
        return now_ns if self.messages.simulated else time.monotonic_ns()

    def _ahead_of(self, clock_ns: int) -> bool:
        """Return whether a record was ahead of a simulated time, ns, which does not go back."""
        return self.messages.simulated and 0 <= self.tick_ns - clock_ns <= TICK_PERIOD_NS

    def _tick(self, now_ns: int) -> None:
        if self.active and self._ahead_of(now_ns):
            return
        self._supervise(now_ns)
        # In simulated time commands are answered at once: no readings come between them.
        answers = self.messages.simulated and self.active
        if answers and abs(now_ns - self._record_ns) <= TICK_PERIOD_NS:
            return
        if self._pace.due(now_ns) and self.channels:
            self._send(self.supervision.read(now_ns, self._elapsed_ns))

    def _supervise(self, now_ns: int) -> None:
        """Vent pads without commands, and report on ``/diagnostics``."""
        self.tick_ns, self._elapsed_ns = now_ns, self._elapsed(now_ns)
        self.supervision.tick(self._elapsed_ns)
        if self._check_pace.due(now_ns):
            self._diagnose(now_ns)

    def _diagnose(self, now_ns: int) -> None:
        """Publish the health of the pads once a second, and at once when a problem changes."""
        channels = list(self.channels.values())
        found = [self._health(each) for each in channels]
        supply = supply_health(channels)
        # Filled and vented are both healthy, so a change between them is not reported at once.
        problems = [health.message if health.level else '' for health in (*found, supply)]
        refused = any(each.answers.due for each in channels)
        if not (self._diagnostics.due(now_ns, problems) or refused):
            return
        statuses = [
            self._status(f'leg {leg} regulator', str(leg), channel.answers.report(health), channel)
            for (leg, channel), health in zip(self.channels.items(), found, strict=True)
        ]
        if channels:
            statuses.append(self._status('supply', 'supply', supply))
        self._diagnostics.send(now_ns, statuses)

    def _health(self, channel: SupervisedChannel) -> Health:
        """Return the health of a channel; without set-points it names a mismatch of QoS."""
        health = channel.health()
        if self._mismatch and health.level == Level.STALE:
            return health._replace(message=f'{health.message}; {self._mismatch}')
        return health

    def _status(
        self, name: str, part: str, health: Health, channel: SupervisedChannel | None = None
    ) -> DiagnosticStatus:
        return self._diagnostics.status(
            name,
            bytes([health.level]),
            health.message,
            channel.figures() if channel else None,
            f'{self._values["backend"]} {part}',
        )


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted, then vent the pads. Return the exit status."""
    return run(RegulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
