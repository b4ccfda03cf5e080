# SPDX-License-Identifier: Apache-2.0
"""Regulators on a serial line: a thread of the port polls them; only open and close wait."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ros_pad.configuration import choice, integer, number, text
from ros_pad.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    InvalidInput,
    PadError,
    ProtocolError,
    TransportError,
)
from ros_pad.regulators.protocol import Reading, permitted

OPEN_PATIENCE = 1.0
"""Longest time for which ``open`` waits for a device to answer, s."""

RETRY = 0.25
"""Time until a set-point that was refused or ignored is sent again, and a missing port is tried
again, s."""

FIRST_PAUSE, LONGEST_PAUSE = 0.05, 1.0
"""First and longest pause between attempts to reach a lost device, s; each pause is twice as long
as the one before, because the other devices on the bus wait during an attempt."""

LONGEST_REPLY = 256
"""Longest reply, bytes; a longer one without a terminator is an error."""

UNITS = {
    'Pa': 1.0,
    'hPa': 100.0,
    'kPa': 1e3,
    'MPa': 1e6,
    'mbar': 100.0,
    'bar': 1e5,
    'psi': 6894.757293168361,
}
"""Size of each unit of pressure, Pa, by name."""

Query = Callable[..., str]
"""Function that sends a command and returns its reply, both without terminator; with
``reply=False`` it returns '' at once."""


class PortLost(TransportError):
    """The port is missing or cannot be opened; no device on it can be reached."""


@dataclass(frozen=True)
class SerialLine:
    """A port and its settings: 8 data bits, no parity, 1 stop bit, lines of ASCII.

    Parameters
    ----------
    port : str
        Name of the serial port.
    baudrate : int
        1/s.
    terminator : str
        End of a line, in both directions.
    reply_timeout : float
        Longest time from the command to the end of its reply, s.
    """

    port: str
    baudrate: int
    terminator: str
    reply_timeout: float

    def error(self, kind: type[DeviceError], what: str, command: str, reply: Any) -> DeviceError:
        """Return an error that names the problem, the port, the command and the reply."""
        return kind(f'{what}: port {self.port}, command {command!r}, reply {reply!r}')


class Bus:
    """One port and its thread, which gives each device its turn, one command at a time.

    Devices that share a port share its bus, which the first :meth:`join` opens and the last
    :meth:`leave` closes. The next turn goes to the device with the earliest due time; a vent is
    due at once and goes first. A port that is missing or cannot be opened is tried again.
    """

    _all: dict[str, Bus] = {}  # noqa: RUF012 all instances share this registry on purpose
    _registry = threading.Lock()

    def __init__(self, line: SerialLine) -> None:
        self.line = line
        self._changed = threading.Condition()
        self._due: dict[SerialRegulator, float] = {}
        self._closing = False
        self._port: Any = None
        self._thread = threading.Thread(
            target=self._serve, name=f'serial port {line.port}', daemon=True
        )

    @classmethod
    def join(cls, line: SerialLine, device: SerialRegulator) -> Bus:
        """Add a device to the bus of a port, and return the bus.

        Raises
        ------
        ConfigError
            When the port is in use with other settings, or the address is taken.
        TransportError
            When pyserial is not installed.
        """
        try:
            import serial  # noqa: F401 only serial devices need pyserial
        except ModuleNotFoundError as error:
            raise TransportError(
                f'port {line.port} cannot be opened without pyserial: pip install pyserial, or'
                ' apt install python3-serial'
            ) from error
        with cls._registry:
            bus = cls._all.get(line.port)
            if bus is None:
                bus = cls._all[line.port] = cls(line)
                bus._thread.start()
            elif bus.line != line:
                raise ConfigError(
                    f'port {line.port} is open with {bus.line}: a regulator with {line} cannot'
                    ' share it; give both the same settings'
                )
            with bus._changed:
                if any(other.address == device.address for other in bus._due):
                    raise ConfigError(
                        f'port {line.port} has a device {device.address!r} already: each'
                        ' regulator on a bus needs an address of its own'
                    )
                bus._due[device] = -math.inf
                bus._changed.notify_all()
        return bus

    def leave(self, device: SerialRegulator) -> None:
        """Remove a device; close the port after the last one."""
        with self._registry:
            with self._changed:
                self._due.pop(device, None)
                self._closing = not self._due
                self._changed.notify_all()
            if self._closing:
                del self._all[self.line.port]
                # A turn in progress ends at its timeouts at the latest.
                self._thread.join()

    def schedule(self, device: SerialRegulator, at: float) -> None:
        """Schedule the next turn of a device, unless it is due earlier.

        Parameters
        ----------
        device : SerialRegulator
            On this bus; any other one is ignored.
        at : float
            s, monotonic clock; ``-inf`` for a turn before all other devices.
        """
        with self._changed:
            if device in self._due:
                self._due[device] = min(self._due[device], at)
                self._changed.notify_all()

    def query(self, command: str, reply: bool = True) -> str:
        """Send a command and return its reply; only the thread of the bus may call it.

        Raises
        ------
        TransportError
            When there is no reply in time, or only a part of one.
        ProtocolError
            When bytes were received before the command, or the reply is not ASCII or has no
            terminator.
        PortLost
            When the port is missing.
        """
        line, what = self.line, ''
        kind: type[DeviceError] = ProtocolError
        end = line.terminator.encode()
        try:
            answer: bytes = self._port.read(self._port.in_waiting)
            if answer:
                what = 'bytes were received before the command was sent'
            else:
                self._port.write(command.encode() + end)
                answer = self._port.read_until(end, LONGEST_REPLY) if reply else end
                if answer.endswith(end) and answer.isascii():
                    return answer.removesuffix(end).decode().strip()
                if answer.endswith(end):
                    what = 'the reply is not ASCII'
                elif len(answer) >= LONGEST_REPLY:
                    what = 'the reply has no terminator'
                else:
                    kind = TransportError
                    what = f'{"half a line" if answer else "no reply"} within'
                    what += f' {line.reply_timeout:g} s'
            time.sleep(0.02)  # so that a late reply is not read as the next one
            self._port.read(self._port.in_waiting)
        except Exception as error:  # pyserial raises many types when a device disappears
            raise PortLost(
                f'port {line.port} is missing: {error}: command {command!r}, reply none'
            ) from error
        raise line.error(kind, what, command, answer)

    def _open(self) -> None:
        import serial

        line = self.line
        try:
            self._port = serial.Serial(
                line.port,
                line.baudrate,
                timeout=line.reply_timeout,
                write_timeout=line.reply_timeout,
                exclusive=True,  # a second program would take some of the replies
            )
        except Exception as error:  # pyserial raises errors of many types here, too
            raise PortLost(
                f'port {line.port} cannot be opened: {error}: pad doctor lists the ports'
            ) from error

    def _close(self) -> None:
        if self._port is not None:
            with contextlib.suppress(OSError):  # the port may be missing
                self._port.close()
            self._port = None

    def _next(self) -> SerialRegulator | None:
        """Wait until a device is due and return it; None when the bus is closed."""
        with self._changed:
            while not self._closing:
                device = min(self._due, key=self._due.__getitem__, default=None)
                wait = self._due[device] - time.monotonic() if device else math.inf
                if device and wait <= 0.0:
                    self._due[device] = math.inf
                    return device
                self._changed.wait(wait if wait < math.inf else None)
        return None

    def _serve(self) -> None:
        while (device := self._next()) is not None:
            try:
                if self._port is None:
                    self._open()
                due = device.take_turn(self.query)
            except PortLost as error:
                self._close()
                with self._changed:
                    devices = list(self._due)
                for each in devices:
                    each.fail(error)
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, RETRY)
                due = -math.inf
            self.schedule(device, due)
        self._close()


@dataclass(frozen=True)
class Frame:
    """State that a device reports at one moment.

    Parameters
    ----------
    pressure, setpoint : float
        Gauge Pa.
    resolution : float
        Pa, smallest step of a set-point.
    faults : tuple of str
        As the device names them.
    time : float
        s, monotonic clock.
    """

    pressure: float
    setpoint: float
    resolution: float
    faults: tuple[str, ...] = ()
    time: float = field(default_factory=time.monotonic)

    @property
    def age(self) -> float:
        """Time since the frame, s."""
        return time.monotonic() - self.time


class SerialRegulator(ABC):
    """One pressure channel of a device on a serial line, polled by the thread of its bus.

    Only :meth:`open` and :meth:`close` wait for the line:

    - The thread polls the device. :meth:`read` returns the last frame with its time, or raises
      the last error when that frame is older than ``silence``.
    - :meth:`set_pressure` and :meth:`vent` store the requested set-point and return. The latest
      replaces earlier ones. The thread sends it when the device has another set-point, and repeats
      that every ``RETRY`` until the device confirms it; if the first attempt fails, :meth:`read`
      reports a fault until then. A vent is sent before anything else on the bus.
    - After ``silence`` without a frame, or when the port is missing, the device is lost: a vent
      replaces the requested set-point, and :meth:`set_pressure` raises. A device that answers
      again is identified and vented before it accepts set-points.
    - :meth:`close` vents the pad, and waits at most ``silence`` until the device confirms that.

    Errors name port, command and reply. All methods may be called from any thread. A backend
    implements :meth:`identify`, :meth:`poll` and :meth:`send`.

    Parameters
    ----------
    line : SerialLine
        Port and its settings; baudrate 300 to 4,000,000 1/s, reply timeout 0.005 to 5 s.
    address : str
        Name of the device, unique on this port.
    ceiling : float
        Highest set-point, gauge Pa, 1 to 1e7.
    poll_period : float
        Time from the end of one poll to the next one, s, 0 to 1.
    silence : float
        Time without a frame after which a device is lost, s, 0.05 to 10.

    Raises
    ------
    InvalidInput
        When a value is not allowed.
    """

    def __init__(
        self, line: SerialLine, address: str, ceiling: float, poll_period: float, silence: float
    ) -> None:
        if not text('port', line.port):
            raise InvalidInput("port = '' is not allowed: the name of a serial port is needed")
        integer('baudrate', line.baudrate, 300, 4_000_000, '1/s')
        number('reply_timeout', line.reply_timeout, 's', 0.005, 5.0)
        self._ceiling = number('ceiling', ceiling, 'Pa', 1.0, 1e7)
        self._poll_period = number('poll_period', poll_period, 's', 0.0, 1.0)
        self._silence = number('silence', silence, 's', 0.05, 10.0)
        self._line = line
        self.address = address
        self._bus: Bus | None = None
        # This lock guards what _reset() sets, which the thread of the bus uses too.
        self._changed = threading.Condition()
        self._reset()

    # --- what a backend implements, called by the thread of the bus ----------------------------

    @abstractmethod
    def identify(self, query: Query) -> Frame:
        """Check identity, units and source of set-points of the device; return a frame."""

    @abstractmethod
    def poll(self, query: Query) -> Frame:
        """Request a frame and return it."""

    @abstractmethod
    def send(self, query: Query, setpoint: float) -> Frame | None:
        """Send a set-point, gauge Pa, and check the echo; return a frame if the echo is one.

        Raises
        ------
        DeviceFault
            When the device refuses it.
        """

    def error(self, kind: type[DeviceError], what: str, command: str, reply: str) -> DeviceError:
        """Return an error that names the problem, the port, the command and the reply."""
        return self._line.error(kind, what, command, reply)

    # --- the regulator protocol ----------------------------------------------------------------

    @property
    def ceiling(self) -> float:
        """The highest set-point that is accepted, gauge Pa."""
        return self._ceiling

    def open(self) -> None:
        """Identify the device. Its set-point stays as it is.

        Raises
        ------
        ConfigError, DeviceFault
            When the device differs from the options, or ignores set-points on this line.
        TransportError, ProtocolError
            When there is no valid reply within a second.
        """
        if self._bus is not None:
            return
        self._reset()
        self._bus = Bus.join(self._line, self)
        with self._changed:
            self._changed.wait_for(
                lambda: self._frame or isinstance(self._error, (ConfigError, DeviceFault)),
                OPEN_PATIENCE,
            )
            known, error = self._frame, self._error
        if not known:
            self._leave()
            raise error or TransportError(
                f'port {self._line.port}: regulator {self.address!r} did not answer within'
                f' {OPEN_PATIENCE:g} s'
            )

    def _reset(self) -> None:
        """Forget the device."""
        self._requested: float | None = None  # None leaves the set-point of the device as it is
        self._confirmed = False
        self._frame: Frame | None = None  # None while the device is lost or not yet identified
        self._error: PadError | None = None  # error of the last turn
        self._refusal = ''
        self._unconfirmed = False  # whether the last set-point was sent without an answer
        self._retry_at = -math.inf
        self._pause = FIRST_PAUSE  # used by the thread of the bus only

    def set_pressure(self, gauge_pa: float) -> None:
        """Request a pressure in [0, ceiling], gauge Pa; see ``Regulator.set_pressure``.

        Raises
        ------
        InvalidInput, LimitError
            When it is not a number in this range.
        TransportError, ProtocolError, DeviceFault, ConfigError
            The last error of the device, when it is lost. The set-point is refused.
        """
        setpoint = permitted(gauge_pa, self._ceiling)
        with self._changed:
            self._check()
            changed = self._request(setpoint)
        if changed and self._bus:
            self._bus.schedule(self, time.monotonic())

    def read(self) -> Reading:
        """Return the last frame; see ``Regulator.read``. Its time is on the monotonic clock.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            The last error of the device, when it is lost.
        """
        with self._changed:
            frame = self._check()
            faults = (*frame.faults, self._refusal) if self._refusal else frame.faults
        return Reading(frame.pressure, frame.setpoint, faults, frame.time)

    def vent(self) -> None:
        """Request zero gauge pressure, before all other commands, until the device confirms it.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            The last error of the device, when it is lost. It is vented when it answers again.
        """
        with self._changed:
            changed = self._request(0.0)
        if changed and self._bus:
            self._bus.schedule(self, -math.inf)
        with self._changed:
            self._check()

    def close(self) -> None:
        """Vent the pad and close the port, even if the device does not confirm the vent.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device did not confirm the vent.
        """
        if self._bus is None:
            return
        with self._changed:
            self._request(0.0)
        self._bus.schedule(self, -math.inf)
        with self._changed:
            self._changed.wait_for(lambda: self._confirmed, self._silence)
            vented, error, refusal = self._confirmed, self._error, self._refusal
        self._leave()
        if not vented:
            kind = DeviceFault if error is None else type(error)
            why = error or refusal or 'its bus was busy'
            raise kind(f'closed without a confirmed vent: port {self._line.port}: {why}')

    def _leave(self) -> None:
        bus, self._bus = self._bus, None
        if bus:
            bus.leave(self)

    def _request(self, setpoint: float) -> bool:
        """Store the requested set-point; return whether it is a new one. The lock is held."""
        if setpoint == self._requested:
            return False
        self._requested = setpoint
        self._confirmed = False
        self._refusal = ''
        self._retry_at = -math.inf
        return True

    def _check(self) -> Frame:
        """Return the last frame; if it is too old, the device is lost. The lock is held."""
        where = f'regulator {self.address!r} on port {self._line.port}'
        if self._bus is None:
            raise TransportError(f'{where} is not open: call open() first')
        if self._frame and self._frame.age <= self._silence:
            return self._frame
        self._lose()
        error = self._error or TransportError(f'{where}: no frame for {self._silence:g} s')
        raise error.with_traceback(None)  # else each time would extend it

    # --- the thread of the bus -----------------------------------------------------------------

    def take_turn(self, query: Query) -> float:
        """Identify, set or poll the device; return the monotonic time of the next turn, s."""
        try:
            self._exchange(query)
        except PortLost:
            raise
        except Exception as error:  # an error must not end the thread, which also vents
            if not isinstance(error, PadError):
                error = TransportError(f'port {self._line.port}: {error!r}')
            self.fail(error)
            if self._frame is None:
                pause, self._pause = self._pause, min(2.0 * self._pause, LONGEST_PAUSE)
                return time.monotonic() + pause
        else:
            self._pause = FIRST_PAUSE
        return time.monotonic() + self._poll_period

    def fail(self, error: PadError) -> None:
        """Store an error; the device is lost after ``silence``, or at once if that is certain."""
        # One that differs from the options counts as lost, as one whose port is missing.
        certain = isinstance(error, (ConfigError, PortLost))
        with self._changed:
            self._error = error
            self._retry_at = -math.inf
            if certain or self._frame is None or self._frame.age > self._silence:
                self._lose()
            self._changed.notify_all()

    def _exchange(self, query: Query) -> None:
        """Send the requested set-point if it is not in force, and store a new frame."""
        with self._changed:
            known = self._frame
        last = known or self.identify(query)
        frame = None if known else last
        refusal = ''
        with self._changed:
            requested = self._requested
            due = requested is not None and time.monotonic() >= self._retry_at
            setpoint = self.rounded(requested or 0.0, last.resolution)
            due = due and (self._unconfirmed or not self.in_force(last, setpoint))
            if due:
                self._unconfirmed = True
                self._retry_at = time.monotonic() + RETRY
        if due:
            try:
                frame = self.send(query, setpoint) or self.poll(query)
            except DeviceFault as error:
                refusal = str(error)
        frame = frame or self.poll(query)
        confirmed = requested is None or self.in_force(
            frame, self.rounded(requested, frame.resolution)
        )
        if not confirmed and not refusal:
            refusal = self._refusal or (
                f'set-point of {requested:g} Pa is not in force, but {frame.setpoint:g} Pa is:'
                f' port {self._line.port}, regulator {self.address!r}'
            )
        with self._changed:
            if self._frame is not known:
                return  # the device was lost meanwhile: it must be identified again
            self._frame, self._error = frame, None
            self._unconfirmed = False
            if requested == self._requested:
                self._confirmed = confirmed
                self._refusal = '' if confirmed else refusal
            self._changed.notify_all()

    def in_force(self, frame: Frame, setpoint: float) -> bool:
        """Return whether a frame shows a set-point, gauge Pa, within half a step."""
        return abs(frame.setpoint - setpoint) < 0.5 * frame.resolution

    def rounded(self, setpoint: float, resolution: float) -> float:
        """Return the nearest set-point that the device can have, at most the ceiling."""
        steps = round(setpoint / resolution)
        if steps * resolution > self._ceiling * (1.0 + 1e-9):
            steps -= 1
        return steps * resolution

    def _lose(self) -> None:
        """Treat the device as lost and request a vent. The lock is held."""
        self._frame = None
        self._confirmed = False
        self._unconfirmed = True
        if self._requested is not None:
            self._request(0.0)


def unit(name: str) -> float:
    """Return the size of a unit of pressure, Pa; raise `InvalidInput` if it is unknown."""
    return UNITS[choice('units', name, tuple(UNITS))]
