# SPDX-License-Identifier: Apache-2.0
"""The regulator node: takes set-points to pressure regulators, and vents when in doubt."""

from __future__ import annotations

import math
import sys
import time
from array import array
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.msg import KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle import LifecycleState
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter as RosParameter
from sensor_msgs.msg import FluidPressure
from std_srvs.srv import Trigger

from ros_pad.contact.resistance import Foot
from ros_pad.control.watch import PadWatch
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError
from ros_pad.errors import PadError
from ros_pad.errors import ProtocolError
from ros_pad.nodes import topics
from ros_pad.nodes.frames import check_frame
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
from ros_pad.regulators.protocol import permitted
from ros_pad.simulation.faults import faults_of
from ros_pad.simulation.faults import parsed
from ros_pad.simulation.scene import Scene

PARAMETERS = (
    LEGS,
    FOOT,
    AMBIENT_PRESSURE,
    Parameter('backend', 'simulated', 'Kind of regulator.', choices=tuple(BACKENDS)),
    Parameter(
        'scene', '',
        'Scene whose hose and faults the simulated backend has where its options do not say.',
        read=lambda name: Scene.load(name) if name else None,
    ),
    Parameter(
        'ceiling', 90000.0, 'Highest gauge pressure; set-points above it are refused.',
        'Pa', 1000.0, 1e6,
    ),
    Parameter(
        'command_timeout', 0.5, 'Without a set-point for so long, a pad is vented.',
        's', 0.02, 60.0, live=True,
    ),
    Parameter(
        'slew_limit', 0.0, 'Fastest change of a set-point on its way to the command; 0: none.',
        'Pa/s', 0.0, 1e7, live=True,
    ),
    Parameter(
        'ceiling_tolerance', 0.02,
        'Share of the ceiling by which a pad may read more; beyond, it is vented and held so.',
        '', 0.005, 0.2,
    ),
    Parameter(
        'on_fault', 'report', 'What is done with a faulty pad: only told, or vented and held so.',
        choices=('report', 'vent'), live=True,
    ),
    Parameter('publish_rate', 50.0, 'Pressures a second.', 'Hz', 1.0, 500.0),
    Parameter('autostart', True, 'Configure and activate at the start.'),
)  # fmt: skip


LONGEST_TICK = 0.01
"""Longest time between two looks at the age of commands, s, whatever the rate of pressures."""

_LOOK_PERIOD_NS = 100_000_000  # of the look for news that /diagnostics must have at once


class _Channel:
    """One pad's regulator and what is known of it."""

    def __init__(self, leg: int, regulator: Regulator, publisher: Any) -> None:
        self.leg = leg
        self.regulator = regulator
        self.publisher = publisher
        self.watch = PadWatch(regulator.ceiling)
        self.commanded_ns: int | None = None  # when the last command was accepted
        self.command = 0.0  # what it was, gauge Pa
        self.sent: float | None = None  # set-point in force; None where no device confirmed it
        self.moved_ns = 0  # when it was last on its way to the command, on the same clock
        self.commands = 0
        self.refusals = 0
        self.refusal = ''  # what /diagnostics has yet to say
        self.refusal_told = False  # whether its last message had one
        self.vented = True
        self.held = ''  # why set-points are refused until the next activation
        self.faults: tuple[str, ...] = ()  # in the words of device and driver
        self.unread_ns: int | None = None  # when it last failed to answer
        self.pressure = 0.0
        self.setpoint = 0.0

    @property
    def trouble(self) -> str:
        """What is wrong with device and pad, in words; empty when nothing is."""
        return '; '.join(filter(None, (*self.faults, self.watch.reason)))

    @property
    def sags(self) -> bool:
        """Whether the pad has been found to hold less than it was told to."""
        watch, sent = self.watch, self.sent
        return bool(watch.fault and sent and watch.pressure < sent - watch.tolerance)


class RegulatorNode(LifecycleNode):
    """A lifecycle node that serves one regulator for each leg; see :data:`PARAMETERS`.

    *configure* opens the devices, *activate* accepts set-points, *deactivate* vents, *cleanup*
    closes. Set-points that are stale, from the future, not finite, above the ceiling, or whose
    frame names another leg, are refused and reported on ``/diagnostics``; when none comes for
    ``command_timeout`` the pad is vented. ``~/vent`` deactivates: the pads are vented and stay so
    until somebody activates the node again, whatever the controller sends. Options of the
    backend are parameters ``backend_options.*``.

    A pad whose pressure passes the ceiling by more than ``ceiling_tolerance`` is vented, and its
    set-points are refused until the next activation: it is held. Each pad is watched: one that
    does not fill or vent, leaks or is silent is an error on ``/diagnostics``, and with
    ``on_fault`` = ``vent`` it is held too. The watch needs ten pressures a second, and waits
    where a ``slew_limit`` has a set-point on its way.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(
            'regulator', automatically_declare_parameters_from_overrides=True, **kwargs
        )
        # From here on it may be destroyed: Kilted's contexts do so, even of a node half made.
        self.channels: dict[int, _Channel] = {}
        self._active = False
        self._values = declare(self, PARAMETERS)
        self._simulated_time: bool = self.get_parameter('use_sim_time').value
        if self._simulated_time and self._values['backend'] != 'simulated':
            raise ConfigError(
                f'node {self.get_name()}: parameter use_sim_time = True is not allowed with'
                f' backend {self._values["backend"]}: where /clock stopped, its pads would stay'
                ' under pressure'
            )
        self._ambient = self._values['ambient_pressure']
        self._pace = Pace(round(1e9 / self._values['publish_rate']))
        self._diagnostics_pace = Pace(1_000_000_000)
        self._look_pace = Pace(_LOOK_PERIOD_NS)
        self._said: list[str] = []
        self._unheard: dict[int, str] = {}  # set-points that QoS keeps from a leg
        self._now_ns = 0  # of the last tick, in the time of the stamps ...
        self._elapsed_ns = 0  # ... and on the clock by which commands grow old
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
        self.add_on_set_parameters_callback(self._judge_options)
        on_tick(self, min(LONGEST_TICK, 0.5 / self._values['publish_rate']), self._tick)
        if self._starting:
            self.trigger_configure()
            if self._problem:
                raise self._problem
            self.trigger_activate()
            self._starting = False

    def _judge_options(self, changes: list[RosParameter]) -> SetParametersResult:
        """Refuse options for devices that are open; before that, *configure* judges them."""
        for each in changes:
            if self.channels and each.name.startswith(f'{BACKEND_OPTIONS}.'):
                return SetParametersResult(
                    reason=f'node {self.get_name()}: parameter {each.name} is read when the'
                    ' devices are opened: clean up first'
                )
        return SetParametersResult(successful=True)

    def _last_tick(self) -> float:
        """Time of the last tick, s: the clock of the simulated backend in simulated time."""
        return self._elapsed_ns * 1e-9

    def _elapsed(self, now_ns: int) -> int:
        """Return the time by which commands grow old, ns: nobody can set that clock back."""
        return now_ns if self._simulated_time else time.monotonic_ns()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the devices and vent them: nobody knows who left them at what."""
        backend = self._values['backend']
        options: dict[str, Any] = {}
        if backend == 'simulated':
            started = time.monotonic()
            clock = self._last_tick if self._simulated_time else lambda: time.monotonic() - started
            options = {'clock': clock, 'pad_volume': self._foot.air_volume}
            if self._values['scene']:
                options |= self._values['scene'].regulator_options
        for name in self.get_parameters_by_prefix(BACKEND_OPTIONS):
            options[name] = self.get_parameter(f'{BACKEND_OPTIONS}.{name}').value
        self._problem = None
        try:
            if 'ceiling' in options:
                raise ConfigError(
                    f'parameter {BACKEND_OPTIONS}.ceiling = {options["ceiling"]!r} is not'
                    ' allowed: set the parameter ceiling'
                )
            faults = parsed(options.pop('faults', ()))
            for place, leg in enumerate(self._values['legs']):
                own = {name: self._of_leg(name, value, place) for name, value in options.items()}
                if faults:
                    own['faults'] = faults_of(leg, faults)
                regulator = create(backend, ceiling=self._values['ceiling'], **own)
                regulator.open()
                channel = _Channel(leg, regulator, self._pressure_publishers[leg])
                self.channels[leg] = channel
                regulator.vent()
                channel.sent = 0.0
        except Exception as error:  # rclpy would swallow it without a word
            self._close('configuring failed')
            error.args = (f'node {self.get_name()}: {error}',)
            self._problem = error
            if not self._starting:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def _of_leg(self, name: str, value: Any, place: int) -> Any:
        """Return an option of the device of a leg: of a list its own, of one value that."""
        if not isinstance(value, (list, tuple, array)):
            return value
        legs = self._values['legs']
        if len(value) != len(legs):
            raise ConfigError(
                f'parameter {BACKEND_OPTIONS}.{name} = {list(value)!r} is not allowed: one value,'
                f' or one for each leg in {list(legs)}'
            )
        return value[place]

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Accept set-points from now on, of pads that were held vented too."""
        for channel in self.channels.values():
            channel.held = ''
            channel.watch = PadWatch(channel.regulator.ceiling)
            # Or a device that falls silent at once would not be missed.
            channel.watch.update(self._elapsed(self._now_ns) * 1e-9, None, channel.pressure)
        self._active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and accept no more set-points."""
        self._active = False
        self.vent('deactivated')
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the devices."""
        self._close('cleaned up')
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices."""
        self._active = False
        self._close('shut down')
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Vent every pad and close the devices, after what no transition foresaw."""
        self._active = False
        self._close('a transition failed')
        return TransitionCallbackReturn.SUCCESS

    def _close(self, reason: str) -> None:
        self.vent(f'closing: {reason}')
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
        channel.commanded_ns = None
        channel.command = 0.0
        try:
            channel.regulator.vent()
        except Exception as error:  # whatever one device does, the other pads must be vented
            channel.vented, channel.sent = False, None
            self.get_logger().error(
                f'leg {channel.leg}: cannot vent: {error}', throttle_duration_sec=1.0
            )
            return
        if not channel.vented:
            self.get_logger().info(f'leg {channel.leg}: vented: {reason}')
        channel.vented, channel.sent = True, 0.0

    def _hold(self, channel: _Channel, reason: str) -> None:
        """Vent a pad and refuse its set-points until somebody activates the node again."""
        if not channel.held:
            channel.held = f'{reason}; vented until the node is activated again'
            self.get_logger().error(f'leg {channel.leg}: {channel.held}')
            self._vent(channel, reason)

    def destroy_node(self) -> None:
        """Vent before going: nothing may leave pads under pressure."""
        self._active = False
        self._close('the node ends')
        super().destroy_node()

    def _on_vent(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # Only to vent would last until the controller's next set-point, a moment later.
        if self._active:
            self.trigger_deactivate()
        else:
            self.vent('asked to on ~/vent')
        if not self.channels:
            response.success = False
            response.message = 'no device is open, and none was told: configure the node first'
            return response
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
            now_ns = self.get_clock().now().nanoseconds
            elapsed_ns = self._elapsed(now_ns)
            # Here too, so that no flood of set-points comes before the end of another's time.
            for each in self.channels.values():
                self._expire(each, elapsed_ns)
            try:
                gauge = self._permitted(channel, message, now_ns)
                self._approach(channel, gauge, elapsed_ns)
            except PadError as error:
                self._refuse(channel, error)
                return
            channel.commands += 1
            channel.commanded_ns = elapsed_ns
            self._unheard.pop(leg, None)

        unheard = partial(self._unheard.__setitem__, leg)
        topics.PRESSURE_SETPOINT.subscription(self, on_setpoint, leg, unheard=unheard)

    def _permitted(self, channel: _Channel, message: FluidPressure, now_ns: int) -> float:
        """Return the gauge pressure that a message commands; raise what is wrong with it."""
        check_frame(message.header.frame_id, channel.leg)
        age = (now_ns - nanoseconds(message.header.stamp)) * 1e-9
        if abs(age) > self._values['command_timeout']:
            stamped = f'{age:.3f} s old' if age > 0.0 else f'{-age:.3f} s ahead of the clock here'
            raise LimitError(
                f'set-point is {stamped}: at most'
                f' {self._values["command_timeout"]:g} s either way is accepted'
            )
        # Added and subtracted, an ambient pressure leaves rounding errors: below 1 uPa.
        gauge = permitted(
            round(message.fluid_pressure - self._ambient, 6), channel.regulator.ceiling
        )
        if channel.held:
            raise LimitError(f'set-point {gauge:g} Pa is not allowed: {channel.held}')
        return gauge

    def _refuse(self, channel: _Channel, error: PadError) -> None:
        channel.refusals += 1
        channel.refusal = str(error)
        self.get_logger().warning(
            f'leg {channel.leg}: set-point refused: {error}', throttle_duration_sec=1.0
        )

    def _approach(self, channel: _Channel, command: float, elapsed_ns: int) -> None:
        """Send a command, or a set-point as near to it as the slew limit allows by now."""
        elapsed = max(0, elapsed_ns - channel.moved_ns) * 1e-9
        slew_limit = self._values['slew_limit']
        step = slew_limit * elapsed if slew_limit else math.inf
        start = channel.setpoint if channel.sent is None else channel.sent
        setpoint = min(max(command, start - step), start + step)
        channel.moved_ns = elapsed_ns  # answered or not: time without an answer is not saved up
        try:
            channel.regulator.set_pressure(setpoint)
        except (InvalidInput, LimitError):
            raise  # the old set-point stays, and so does the old command
        except PadError:
            # The device may have taken it all the same.
            channel.vented, channel.sent = False, None
            raise
        channel.command, channel.sent = command, setpoint
        channel.vented = setpoint == command == 0.0

    def _proceed(self, channel: _Channel, elapsed_ns: int) -> None:
        """Go on towards a command that the slew limit did not let through at once."""
        if channel.sent == channel.command:
            channel.moved_ns = elapsed_ns
        elif channel.sent is not None:
            try:
                self._approach(channel, channel.command, elapsed_ns)
            except PadError as error:
                self.get_logger().error(f'leg {channel.leg}: {error}', throttle_duration_sec=1.0)

    def _expire(self, channel: _Channel, elapsed_ns: int) -> None:
        """Vent a pad whose last command is too old."""
        if channel.commanded_ns is None:
            return
        timeout = self._values['command_timeout']
        # A command may be ahead of the tick: simulated time comes on two ways.
        if abs(elapsed_ns - channel.commanded_ns) > timeout * 1e9:
            self._vent(channel, channel.held or f'no set-point for {timeout:g} s')

    def _tick(self, now_ns: int) -> None:
        elapsed_ns = self._elapsed(now_ns)
        set_back = elapsed_ns < self._elapsed_ns
        self._now_ns, self._elapsed_ns = now_ns, elapsed_ns
        for channel in self.channels.values():
            if set_back and channel.commanded_ns is not None:
                # Simulated time can be: nobody knows then how old the command is.
                channel.commanded_ns = None
                self._vent(channel, 'time was set back')
            self._expire(channel, elapsed_ns)
            if not channel.vented and channel.commanded_ns is None:
                # Tried again at each tick, until the device obeys.
                self._vent(channel, channel.held or 'the device did not obey before')
        if self._pace.due(now_ns):
            for channel in self.channels.values():
                self._publish(channel, now_ns)
                self._proceed(channel, elapsed_ns)
        if self._look_pace.due(now_ns):
            self._look(now_ns)

    def _publish(self, channel: _Channel, now_ns: int) -> None:
        watch, known = channel.watch, channel.watch.reason
        # How far a pad is behind a set-point on its way, nobody has measured.
        aim = channel.sent if channel.sent == channel.command else None
        try:
            reading = channel.regulator.read()
            if not math.isfinite(reading.pressure):
                raise ProtocolError(f'device reads {reading.pressure!r} Pa: a number is needed')
        except PadError as error:
            channel.faults = (str(error),)
            channel.unread_ns = now_ns
            watch.update(self._last_tick(), aim, None)
            lasting = watch.reason  # one answer that is lost is not worth a vent
            self.get_logger().error(f'leg {channel.leg}: {error}', throttle_duration_sec=1.0)
        else:
            channel.faults = reading.faults
            channel.pressure, channel.setpoint = reading.pressure, reading.setpoint
            watch.update(self._last_tick(), aim, reading.pressure)
            lasting = channel.trouble
            message = self._message
            set_stamp(message.header.stamp, now_ns)
            message.header.frame_id = f'leg_{channel.leg}_pad'
            message.fluid_pressure = reading.pressure + self._ambient
            channel.publisher.publish(message)
            ceiling = channel.regulator.ceiling
            if reading.pressure > ceiling * (1.0 + self._values['ceiling_tolerance']):
                self._hold(
                    channel, f'{reading.pressure:.0f} Pa is above the ceiling of {ceiling:.0f} Pa'
                )
        if watch.reason and watch.reason != known:
            self.get_logger().error(f'leg {channel.leg}: {watch.reason}')
        if lasting and self._values['on_fault'] == 'vent':
            self._hold(channel, lasting)

    def _look(self, now_ns: int) -> None:
        """Say how the pads are, once a second, and when there is news."""
        channels = self.channels.values()
        said = [self._health(channel) for channel in channels]
        if channels:
            said.append(self._supply())
        # That a sound pad is filled or vented is no news: it happens with every step.
        news = [words if level != DiagnosticStatus.OK else '' for level, words in said]
        refused = any(each.refusal and not each.refusal_told for each in channels)
        if not (self._diagnostics_pace.due(now_ns) or news != self._said or refused):
            return
        self._said = news
        array = DiagnosticArray()
        set_stamp(array.header.stamp, now_ns)
        for channel, (level, words) in zip(channels, said, strict=False):
            array.status.append(self._status(channel, level, words))
        if channels:
            level, words = said[-1]
            array.status.append(
                DiagnosticStatus(
                    name=f'{self.get_name()}: supply',
                    hardware_id=f'{self._values["backend"]} supply',
                    level=level,
                    message=words,
                )
            )
        self._diagnostics.publish(array)

    def _health(self, channel: _Channel) -> tuple[bytes, str]:
        """Return level and message of a channel, as REP 107 has them; refusals come on top."""
        trouble = [channel.held]
        if channel.trouble not in channel.held:
            trouble.append(channel.trouble)
        if channel.commanded_ns is None and not channel.vented:
            trouble.append('cannot be vented')
        if any(trouble):
            return DiagnosticStatus.ERROR, '; '.join(filter(None, trouble))
        if channel.commanded_ns is None and self._active:
            unheard = self._unheard.get(channel.leg)
            return DiagnosticStatus.STALE, '; '.join(
                filter(None, ('no set-points: vented', unheard))
            )
        return DiagnosticStatus.OK, 'vented' if channel.vented else 'under pressure'

    def _supply(self) -> tuple[bytes, str]:
        """Return level and message of what all channels share."""
        told = [each for each in self.channels.values() if each.sent]
        sagging = [str(each.leg) for each in told if each.sags]
        # One pad that sags has a leak; most of them have no air.
        if len(sagging) > max(1, len(told) // 2):
            return DiagnosticStatus.ERROR, f'supply sags: legs {", ".join(sagging)} lack air'
        return DiagnosticStatus.OK, 'no common sag'

    def _status(self, channel: _Channel, level: bytes, words: str) -> DiagnosticStatus:
        """Return how a channel is doing; its refusal is told once."""
        refusal, channel.refusal = channel.refusal, ''
        channel.refusal_told = bool(refusal)
        if refusal and level != DiagnosticStatus.ERROR:
            level, words = DiagnosticStatus.WARN, refusal
        elif refusal:
            words = f'{words}; refused: {refusal}'
        watch = channel.watch
        figures = {
            'pressure (Pa gauge)': f'{channel.pressure:.0f}',
            'set-point (Pa gauge)': f'{channel.setpoint:.0f}',
            'command (Pa gauge)': f'{channel.command:.0f}',
            'set-points accepted': str(channel.commands),
            'set-points refused': str(channel.refusals),
            'time to fill (s)': f'{watch.fill_time:.2f}',
            'time to vent (s)': f'{watch.vent_time:.2f}',
        }
        return DiagnosticStatus(
            name=f'{self.get_name()}: leg {channel.leg} regulator',
            hardware_id=f'{self._values["backend"]} {channel.leg}',
            level=level,
            message=words,
            values=[KeyValue(key=key, value=value) for key, value in figures.items()],
        )


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; pads are vented then. Return the exit status."""
    # A driver may bring threads of its own, and this node must vent whatever they do: it takes
    # the executor that is slower and has been in use for longer.
    return run(RegulatorNode, args, SingleThreadedExecutor)


if __name__ == '__main__':
    sys.exit(main())
