# SPDX-License-Identifier: Apache-2.0
"""The regulator node: takes set-points to pressure regulators, and vents when in doubt."""

from __future__ import annotations

import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle import LifecycleState
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import FluidPressure
from std_srvs.srv import Trigger

from ros_pad.contact.resistance import Foot
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError
from ros_pad.errors import PadError
from ros_pad.nodes import topics
from ros_pad.nodes.parameters import AMBIENT_PRESSURE
from ros_pad.nodes.parameters import BACKEND_OPTIONS
from ros_pad.nodes.parameters import FOOT
from ros_pad.nodes.parameters import LEGS
from ros_pad.nodes.parameters import Parameter
from ros_pad.nodes.parameters import declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import on_tick
from ros_pad.nodes.stamps import set_stamp
from ros_pad.pace import Pace
from ros_pad.regulators import BACKENDS
from ros_pad.regulators import Regulator
from ros_pad.regulators import create
from ros_pad.simulation.faults import faults_of
from ros_pad.simulation.faults import parsed

PARAMETERS = (
    LEGS,
    FOOT,
    AMBIENT_PRESSURE,
    Parameter('backend', 'simulated', 'Kind of regulator.', choices=tuple(BACKENDS)),
    Parameter(
        'ceiling', 90000.0, 'Highest gauge pressure; set-points above it are refused.',
        'Pa', 1000.0, 1e6,
    ),
    Parameter(
        'command_timeout', 0.5, 'Without a set-point for so long, a pad is vented.',
        's', 0.02, 60.0,
    ),
    Parameter('publish_rate', 50.0, 'Pressures a second.', 'Hz', 1.0, 500.0),
    Parameter('autostart', True, 'Configure and activate at the start.'),
)  # fmt: skip


class _Channel:
    """One pad's regulator and what is known of its commands."""

    def __init__(self, leg: int, regulator: Regulator, publisher: Any) -> None:
        self.leg = leg
        self.regulator = regulator
        self.publisher = publisher
        self.commanded_ns: int | None = None  # last set-point that was accepted
        self.commands = 0
        self.refusals = 0
        self.refusal = ''
        self.vented = True
        self.faults: tuple[str, ...] = ()
        self.unread_ns: int | None = None  # when it last failed to answer
        self.pressure = 0.0
        self.setpoint = 0.0


class RegulatorNode(LifecycleNode):
    """A lifecycle node that serves one regulator for each leg; see :data:`PARAMETERS`.

    *configure* opens the devices, *activate* accepts set-points, *deactivate* vents, *cleanup*
    closes. Set-points that are stale, from the future, not finite, or above the ceiling are
    refused and reported on ``/diagnostics``; when none comes for ``command_timeout`` the pad is
    vented. ``~/vent`` deactivates: the pads are vented and stay so until somebody activates the
    node again, whatever the controller sends. Options of the backend are parameters
    ``backend_options.*``.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'regulator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        self._values = declare(self, PARAMETERS)
        self._simulated_time: bool = self.get_parameter('use_sim_time').value
        if self._simulated_time and self._values['backend'] != 'simulated':
            raise ConfigError(
                f'node {self.get_name()}: parameter use_sim_time = True is not allowed with'
                f' backend {self._values["backend"]}: where /clock stopped, its pads would stay'
                ' under pressure'
            )
        self._ambient = self._values['ambient_pressure']
        self._timeout_ns = round(self._values['command_timeout'] * 1e9)
        self._pace = Pace(round(1e9 / self._values['publish_rate']))
        self._diagnostics_pace = Pace(1_000_000_000)
        self.channels: dict[int, _Channel] = {}
        self._active = False
        self._now_ns = 0
        self._starting: bool = self._values['autostart']
        self._problem: Exception | None = None  # why it was not configured
        self._foot: Foot = self._values['foot']
        if self._values['ceiling'] > self._foot.ceiling:
            raise ConfigError(
                f'node {self.get_name()}: parameter ceiling = {self._values["ceiling"]:g} Pa is'
                f' not allowed: foot {self._foot.source} bears up to {self._foot.ceiling:g} Pa'
            )
        self._message = FluidPressure()
        self._diagnostics = topics.DIAGNOSTICS.publisher(self)
        self._pressure_publishers = {
            leg: topics.PRESSURE.publisher(self, leg) for leg in self._values['legs']
        }
        for leg in self._values['legs']:
            self._listen(leg)
        self.create_service(Trigger, '~/vent', self._on_vent)
        on_tick(self, 0.5 / self._values['publish_rate'], self._tick)
        if self._starting:
            self.trigger_configure()
            if self._problem:
                raise self._problem
            self.trigger_activate()
            self._starting = False

    def _last_tick(self) -> float:
        """Time of the last tick, s: the clock of the simulated backend in simulated time."""
        return self._now_ns * 1e-9

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the devices and vent them: nobody knows who left them at what."""
        backend = self._values['backend']
        options: dict[str, Any] = {}
        if backend == 'simulated':
            started = time.monotonic()
            clock = self._last_tick if self._simulated_time else lambda: time.monotonic() - started
            options = {'clock': clock, 'pad_volume': self._foot.air_volume}
        for name, parameter in self.get_parameters_by_prefix(BACKEND_OPTIONS).items():
            options[name] = parameter.value
        self._problem = None
        try:
            if 'ceiling' in options:
                raise ConfigError(
                    f'parameter {BACKEND_OPTIONS}.ceiling = {options["ceiling"]!r} is not'
                    ' allowed: set the parameter ceiling'
                )
            faults = parsed(options.pop('faults', ()))
            for leg in self._values['legs']:
                if faults:
                    options['faults'] = faults_of(leg, faults)
                regulator = create(backend, ceiling=self._values['ceiling'], **options)
                regulator.open()
                self.channels[leg] = _Channel(leg, regulator, self._pressure_publishers[leg])
                regulator.vent()
        except Exception as error:  # rclpy would swallow it without a word
            self._close()
            error.args = (f'node {self.get_name()}: {error}',)
            self._problem = error
            if not self._starting:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept set-points from now on."""
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and accept no more set-points."""
        self._active = False
        self.vent('deactivated')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the devices."""
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices."""
        self._active = False
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices, after what no transition foresaw."""
        self._active = False
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def _close(self) -> None:
        self.vent('closing')
        for channel in self.channels.values():
            try:
                channel.regulator.close()
            except Exception as error:
                self.get_logger().error(f'leg {channel.leg}: cannot close: {error}')
        self.channels.clear()

    @property
    def answered(self) -> int:
        """Number of set-points accepted or refused so far."""
        return sum(each.commands + each.refusals for each in self.channels.values())

    def vent(self, reason: str) -> None:
        """Vent every pad; what fails is logged and does not keep the others from it."""
        for channel in self.channels.values():
            self._vent(channel, reason)

    def _vent(self, channel: _Channel, reason: str) -> None:
        try:
            channel.regulator.vent()
        except Exception as error:  # whatever one device does, the other pads must be vented
            channel.vented = False
            self.get_logger().error(
                f'leg {channel.leg}: cannot vent: {error}', throttle_duration_sec=1.0
            )
            return
        if not channel.vented:
            self.get_logger().info(f'leg {channel.leg}: vented: {reason}')
        channel.vented = True

    def destroy_node(self) -> None:
        """Vent before going: nothing may leave pads under pressure."""
        self._active = False
        self._close()
        super().destroy_node()

    def _on_vent(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # Only to vent would last until the controller's next set-point, a moment later.
        if self._active:
            self.trigger_deactivate()
        else:
            self.vent('asked to on ~/vent')
        held = [str(leg) for leg, channel in self.channels.items() if not channel.vented]
        response.success = not held
        response.message = (
            f'cannot vent leg {", ".join(held)}'
            if held
            else f'{len(self.channels)} pads told to vent; activate to accept set-points again'
        )
        return response

    def _listen(self, leg: int) -> None:
        def on_setpoint(message: FluidPressure) -> None:
            channel = self.channels.get(leg)
            if channel is None or not self._active:
                return
            stamp_ns = nanoseconds(message.header.stamp)
            now_ns = self.get_clock().now().nanoseconds
            age = (now_ns - stamp_ns) * 1e-9
            try:
                if abs(now_ns - stamp_ns) > self._timeout_ns:
                    raise LimitError(
                        f'set-point is {age:.3f} s old: at most'
                        f' {self._values["command_timeout"]:g} s either way is accepted'
                    )
                # Added and subtracted, an ambient pressure leaves rounding errors: below 1 uPa.
                gauge = round(message.fluid_pressure - self._ambient, 6)
                channel.regulator.set_pressure(gauge)
            except PadError as error:
                channel.refusals += 1
                channel.refusal = str(error)
                if not isinstance(error, (InvalidInput, LimitError)):
                    channel.vented = False  # the device may have taken it all the same
                self.get_logger().warning(
                    f'leg {leg}: set-point refused: {error}', throttle_duration_sec=1.0
                )
                return
            channel.commands += 1
            channel.commanded_ns = now_ns
            channel.vented = gauge == 0.0

        topics.PRESSURE_SETPOINT.subscription(self, on_setpoint, leg)

    def _tick(self, now_ns: int) -> None:
        self._now_ns = now_ns
        for channel in self.channels.values():
            # Time may also have been set back, and then nobody knows how old the command is.
            age_ns = abs(now_ns - (channel.commanded_ns or 0))
            if channel.commanded_ns is not None and age_ns > self._timeout_ns:
                channel.commanded_ns = None
            if not channel.vented and channel.commanded_ns is None:
                # Tried again at each tick, until the device obeys.
                self._vent(channel, f'no set-point for {self._values["command_timeout"]:g} s')
        if self._pace.due(now_ns):
            for channel in self.channels.values():
                self._publish(channel, now_ns)
        if self._diagnostics_pace.due(now_ns):
            self._diagnose(now_ns)

    def _publish(self, channel: _Channel, now_ns: int) -> None:
        try:
            reading = channel.regulator.read()
        except PadError as error:
            channel.faults = (str(error),)
            channel.unread_ns = now_ns
            self.get_logger().error(f'leg {channel.leg}: {error}', throttle_duration_sec=1.0)
            return
        channel.faults = reading.faults
        channel.pressure, channel.setpoint = reading.pressure, reading.setpoint
        message = self._message
        set_stamp(message.header.stamp, now_ns)
        message.header.frame_id = f'leg_{channel.leg}_pad'
        message.fluid_pressure = reading.pressure + self._ambient
        channel.publisher.publish(message)

    def _diagnose(self, now_ns: int) -> None:
        array = DiagnosticArray()
        set_stamp(array.header.stamp, now_ns)
        for channel in self.channels.values():
            status = DiagnosticStatus(
                name=f'{self.get_name()}: leg {channel.leg} regulator',
                hardware_id=f'{self._values["backend"]} {channel.leg}',
                level=DiagnosticStatus.OK,
                message='vented' if channel.vented else 'under pressure',
            )
            if channel.commanded_ns is None and self._active:
                status.level, status.message = DiagnosticStatus.STALE, 'no set-points: vented'
            if channel.commanded_ns is None and not channel.vented:
                status.level, status.message = DiagnosticStatus.ERROR, 'cannot be vented'
            if channel.refusal:
                status.level, status.message = DiagnosticStatus.WARN, channel.refusal
                channel.refusal = ''
            if channel.faults:
                status.level = DiagnosticStatus.ERROR
                status.message = '; '.join(channel.faults)
            status.values = [
                KeyValue(key='pressure (Pa gauge)', value=f'{channel.pressure:.0f}'),
                KeyValue(key='set-point (Pa gauge)', value=f'{channel.setpoint:.0f}'),
                KeyValue(key='set-points accepted', value=str(channel.commands)),
                KeyValue(key='set-points refused', value=str(channel.refusals)),
            ]
            array.status.append(status)
        self._diagnostics.publish(array)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; pads are vented then. Return the exit status."""
    # A driver may bring threads of its own, and this node must vent whatever they do: it takes
    # the executor that is slower and has been in use for longer.
    return run(RegulatorNode, args, SingleThreadedExecutor)


if __name__ == '__main__':
    sys.exit(main())
