# SPDX-License-Identifier: Apache-2.0
"""Supervision of the pressure regulator of one pad: which set-points reach it, and its vents.

A :class:`SupervisedChannel` stands between a controller and the regulator of one pad;
:class:`ros_pad.regulators.supervision.Supervision` gives it commands and times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

from ros_pad.configuration import Setting
from ros_pad.control.faults import Fault, Kind, joined
from ros_pad.control.monitor import PadMonitor
from ros_pad.control.morphology import COMMAND_TIMEOUT
from ros_pad.errors import InvalidInput, LimitError, PadError, ProtocolError
from ros_pad.regulators.protocol import Regulator, permitted

CEILING_TOLERANCE = Setting(
    'ceiling_tolerance', 0.02, 'Share of the ceiling by which the pressure of a pad may exceed the'
    ' ceiling; above that, the pad is vented and held.', '', 0.005, 0.2,
)  # fmt: skip
ON_FAULT = Setting(
    'on_fault', 'report', 'Reaction to a faulty pad: only report it, or vent and hold it.',
    choices=('report', 'vent'),
)  # fmt: skip


@dataclass(frozen=True)
class SupervisorSettings:
    """Settings of the supervision, shared by all channels.

    Parameters
    ----------
    command_timeout : float
        s, 0.02 to 60. A pad without a command for longer is vented. This is also the largest
        accepted age of a command.
    ceiling_tolerance : float
        Share of the ceiling by which the pressure of a pad may exceed the ceiling before the pad
        is held, 0.005 to 0.2.
    on_fault : str
        ``report``: a faulty pad is only reported. ``vent``: it is vented and held.

    Raises
    ------
    InvalidInput
        When a value is outside its range.
    """

    command_timeout: float = COMMAND_TIMEOUT.default
    ceiling_tolerance: float = CEILING_TOLERANCE.default
    on_fault: str = ON_FAULT.default

    def __post_init__(self) -> None:
        for each in (COMMAND_TIMEOUT, CEILING_TOLERANCE, ON_FAULT):
            each.accept(getattr(self, each.name))


DEFAULTS = SupervisorSettings()


class Level(IntEnum):
    """Level of a diagnostic status, with the numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class Health(NamedTuple):
    """Level and message of a diagnostic status, as REP 107 defines them."""

    level: Level
    message: str


class NoLog:
    """Discard all messages."""

    def info(self, message: str, **options: float) -> None:
        """Discard a message."""

    warning = error = info


class Answers:
    """Count the answers to commands, and report refusals.

    Attributes
    ----------
    accepted, refused : int
        Numbers of accepted and of refused commands.
    refusal : str
        Reason of the last refusal that :meth:`report` has not returned yet.
    """

    def __init__(self) -> None:
        self.accepted = self.refused = 0
        self.refusal = ''
        self._reported = False  # whether the last report had a refusal

    @property
    def due(self) -> bool:
        """Whether a refusal should be reported at once, because the last report had none."""
        return bool(self.refusal) and not self._reported

    def refuse(self, reason: str) -> None:
        """Count a refused command."""
        self.refused += 1
        self.refusal = reason

    def report(self, health: Health) -> Health:
        """Add the last refusal to a health; each refusal is reported once."""
        refusal, self.refusal = self.refusal, ''
        self._reported = bool(refusal)
        if refusal and health.level == Level.ERROR:
            return Health(Level.ERROR, f'{health.message}; refused: {refusal}')
        return Health(Level.WARN, refusal) if refusal else health


class SupervisedChannel:
    """Supervise the regulator of one pad.

    A command is refused when it is too old or from the future, not a finite number, negative or
    above the ceiling. The pad is vented when no command is accepted for ``command_timeout``, and
    when the clock is set back; a vent that fails is repeated at each
    tick. A pad whose
    pressure passes the ceiling by more than ``ceiling_tolerance`` is vented and held: its commands
    are refused until :meth:`activate`. With ``on_fault`` = ``vent``, a pad that the device or the
    monitor reports as faulty is also vented and held. The monitor needs ten readings a second.

    Parameters
    ----------
    leg : int
        Number of the leg, for messages.
    regulator : Regulator
        Not yet open. Its ceiling is the limit of commands.
    settings : SupervisorSettings
        May be replaced at any time through the attribute.
    log : logger of an rclpy node, or None
        Receives refusals, faults and vents.

    Attributes
    ----------
    pressure, setpoint : float
        Last values from the device, gauge Pa.
    regulator : Regulator
        As given.
    sent : float or None
        Last set-point that the regulator accepted, gauge Pa; None before the first vent, and after
        an error of the device.
    answers : Answers
        Numbers of accepted and refused commands, and the last refusal.
    monitor : PadMonitor
        Compares readings with set-points, and measures the times to fill and to vent.
    active : bool
        Whether commands are accepted.
    held : str
        Reason why all commands are refused; empty when they are not.
    commanded_ns : int or None
        Time of the last accepted command, ns; None after a vent.
    """

    def __init__(
        self,
        leg: int,
        regulator: Regulator,
        settings: SupervisorSettings = DEFAULTS,
        log: Any = None,
    ) -> None:
        self.leg = leg
        self.settings = settings
        self.regulator = regulator
        self.sent: float | None = None
        self.answers = Answers()
        self.monitor = PadMonitor(regulator.ceiling)
        self.pressure = self.setpoint = 0.0
        self.active = False
        self.held = ''
        self.commanded_ns: int | None = None
        self._hold = Kind.NONE()
        self._log = log or NoLog()
        self._device_faults: tuple[str, ...] = ()

    @property
    def fault(self) -> str:
        """Faults of device and pad, separated by semicolons; empty when there are none."""
        return joined(*self._device_faults, self.monitor.reason)

    @property
    def present(self) -> Fault:
        """The fault for records: of pad or device, or that for which the pad is held."""
        monitor = self.monitor
        device = Kind.DEVICE() if self._device_faults else None
        return monitor.silence or device or monitor.fault or self._hold

    @property
    def vented(self) -> bool:
        """Whether the last set-point is zero and the regulator accepted it."""
        return self.sent == 0.0

    @property
    def sags(self) -> bool:
        """Whether the pad is faulty with a pressure below its set-point."""
        monitor, sent = self.monitor, self.sent
        return bool(monitor.fault and sent and monitor.pressure < sent - monitor.tolerance)

    def open(self) -> None:
        """Open the device and vent it, because its last set-point is unknown.

        Raises
        ------
        PadError
            When the device cannot be opened or vented; it is closed then.
        """
        self.regulator.open()
        try:
            self.regulator.vent()
            self.sent = 0.0
        except BaseException:
            self.close('its first vent failed')
            raise

    def activate(self, elapsed_ns: int) -> None:
        """Accept commands from now on, at a time, ns, also of a pad that was held."""
        self.held, self._hold = '', Kind.NONE()
        self.monitor = PadMonitor(self.regulator.ceiling)
        # The monitor reports a silent device only after a first reading.
        self.monitor.update(elapsed_ns * 1e-9, None, self.pressure)
        self.active = True

    def deactivate(self, reason: str) -> None:
        """Vent the pad and accept no more commands."""
        self.active = False
        self.vent(reason)

    def close(self, reason: str) -> None:
        """Vent the pad and close the device; errors are logged, not raised."""
        self.deactivate(f'closing the device: {reason}')
        try:
            self.regulator.close()
        except Exception as error:
            self._log.error(f'leg {self.leg}: cannot close the device: {error}')

    def command(self, gauge_pa: float, age: float, elapsed_ns: int) -> bool:
        """Send a command to the device, or refuse it.

        Parameters
        ----------
        gauge_pa : float
            Commanded pressure, gauge Pa, 0 to the ceiling.
        age : float
            Time since the command was given, s; negative if its time stamp is in the future.
        elapsed_ns : int
            Present time, ns, on the clock of the ticks.

        Returns
        -------
        bool
            Whether the command was accepted. An inactive channel ignores commands, and does not
            count them as refused.
        """
        if not self.active:
            return False
        try:
            self._set(self._permitted(gauge_pa, age))
        except PadError as error:
            self.refuse(error)
            return False
        self.answers.accepted += 1
        self.commanded_ns = elapsed_ns
        return True

    def refuse(self, error: PadError) -> None:
        """Count and report a refused command, and log the first one since the last report."""
        news = not self.answers.refusal  # rclpy takes 0.3 ms to find that a text comes too soon
        self.answers.refuse(str(error))
        if news:
            self._log.warning(
                f'leg {self.leg}: set-point refused: {error}', throttle_duration_sec=1.0
            )

    def expire(self, elapsed_ns: int) -> None:
        """Vent the pad if its last command is too old at a time, ns."""
        if self.commanded_ns is None:
            return
        timeout = self.settings.command_timeout
        # abs(): the time of a command may be ahead of the tick, because /clock and commands
        # arrive separately.
        if abs(elapsed_ns - self.commanded_ns) > timeout * 1e9:
            self.vent(self.held or f'no set-point for {timeout:g} s')

    def read(self, elapsed_ns: int) -> float | None:
        """Read the device, and check device and pad.

        Parameters
        ----------
        elapsed_ns : int
            Present time, ns, on the clock of the ticks.

        Returns
        -------
        float or None
            Measured pressure, gauge Pa; None when the device gave no valid reading.
        """
        monitor, time = self.monitor, elapsed_ns * 1e-9
        known = monitor.silence, monitor.fault
        pressure = None
        try:
            reading = self.regulator.read()
            if not math.isfinite(reading.pressure):
                raise ProtocolError(
                    f'the device reports a pressure of {reading.pressure!r} Pa: a finite number is'
                    ' needed'
                )
        except PadError as error:
            self._device_faults = (str(error),)
            monitor.update(time, self.sent, None)
            self._log.error(f'leg {self.leg}: {error}', throttle_duration_sec=1.0)
        else:
            self._device_faults = reading.faults
            self.pressure = pressure = reading.pressure
            self.setpoint = reading.setpoint
            monitor.update(time, self.sent, pressure)
            ceiling = self.regulator.ceiling
            if pressure > ceiling * (1.0 + self.settings.ceiling_tolerance):
                fault = Kind.CEILING(pressure, ceiling)
                self.hold(str(fault), fault)
        if known != (monitor.silence, monitor.fault) and monitor.reason:
            self._log.error(f'leg {self.leg}: {monitor.reason}')
        if self.settings.on_fault == 'vent':
            # One lost reading is no reason to vent.
            lasting = monitor.reason if pressure is None else self.fault
            if lasting:
                self.hold(lasting, self.present)
        return pressure

    def row(self, elapsed_ns: int) -> tuple[Any, ...]:
        """Read the device at a time, ns, and return the row of a PRESSURE record."""
        pressure = self.read(elapsed_ns)
        fault = self.present
        try:
            pad = getattr(self.regulator, 'pad_pressure', math.nan)
        except PadError:  # the device is closed
            pad = math.nan
        known = (math.nan, math.nan) if pressure is None else (pressure, self.setpoint)
        return *known, pad, fault.kind.code, fault[1:]

    def vent(self, reason: str) -> None:
        """Vent the pad; a failure is logged, and the next tick tries again."""
        self.commanded_ns = None
        news, self.sent = not self.vented, None
        try:
            self.regulator.vent()
        except Exception as error:  # no error of one device may stop the vents of the others
            self._log.error(f'leg {self.leg}: cannot vent: {error}', throttle_duration_sec=1.0)
            return
        self.sent = 0.0
        if news:
            self._log.info(f'leg {self.leg}: vented: {reason}')

    def hold(self, reason: str, fault: Fault) -> None:
        """Vent the pad for a fault and refuse its commands until the next activation."""
        if not self.held:
            self._hold = Kind.HELD(fault.kind.code)
            self.held = f'{reason}; {self._hold}'
            self._log.error(f'leg {self.leg}: {self.held}')
            self.vent(reason)

    def health(self) -> Health:
        """Return level and message of device and pad, without refusals."""
        timed_out, vented = self.commanded_ns is None, self.vented
        faults = joined(
            self.held,
            self.fault not in self.held and self.fault,
            timed_out and not vented and 'the pad cannot be vented',
        )
        if faults:
            return Health(Level.ERROR, faults)
        if timed_out and self.active:
            return Health(Level.STALE, 'no set-points are received: vented')
        return Health(Level.OK, 'vented' if vented else 'under pressure')

    def figures(self) -> dict[str, str]:
        """Return the values of the diagnostic status, by name with unit."""
        return {
            'pressure (Pa gauge)': f'{self.pressure:.0f}',
            'set-point (Pa gauge)': f'{self.setpoint:.0f}',
            'command (Pa gauge)': f'{self.sent or 0.0:.0f}',
            'set-points accepted': str(self.answers.accepted),
            'set-points refused': str(self.answers.refused),
            'time to fill (s)': f'{self.monitor.fill_time:.2f}',
            'time to vent (s)': f'{self.monitor.vent_time:.2f}',
        }

    def _permitted(self, gauge_pa: float, age: float) -> float:
        """Return a commanded pressure; raise the reason if it must be refused."""
        limit = self.settings.command_timeout
        if not abs(age) <= limit:
            stamped = f'{age:.3f} s old' if age > 0.0 else f'{-age:.3f} s in the future'
            raise LimitError(
                f'stamp of the set-point is {stamped}: at most {limit:g} s is accepted;'
                ' synchronise the clocks'
            )
        gauge = permitted(gauge_pa, self.regulator.ceiling)
        if self.held:
            raise LimitError(f'set-point {gauge:g} Pa is not allowed: {self.held}')
        return gauge

    def _set(self, setpoint: float) -> None:
        """Send a set-point, gauge Pa; raise errors of the device."""
        try:
            self.regulator.set_pressure(setpoint)
        except (InvalidInput, LimitError):
            raise  # the old set-point stays in force
        except PadError:
            self.sent = None  # the device may have received it nevertheless
            raise
        self.sent = setpoint
