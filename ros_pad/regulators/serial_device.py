# SPDX-License-Identifier: Apache-2.0
"""Regulators on a serial line: a thread polls the device; only open and close wait for it."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

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
from ros_pad.regulators.transport import (
    FIRST_PAUSE,
    LONGEST_PAUSE,
    Bus,
    PortLost,
    Query,
    SerialLine,
    failure,
)

OPEN_PATIENCE = 1.0
"""Longest time for which ``open`` waits for a device to answer, s."""

RETRY = 0.25
"""Time until a set-point that was refused or ignored is sent again, s."""

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
        self._address = address
        self._bus: Bus | None = None
        # This lock guards the attributes below, which the thread of the bus uses too.
        self._changed = threading.Condition()
        self._requested: float | None = None  # None leaves the set-point of the device as it is
        self._confirmed = False
        self._frame: Frame | None = None  # None while the device is lost or not yet identified
        self._error: PadError | None = None  # error of the last turn
        self._refusal = ''
        self._unconfirmed = False  # whether the last set-point was sent without an answer
        self._retry_at = -math.inf
        self._pause = FIRST_PAUSE  # used by the thread only

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

    def protocol_error(self, what: str, command: str, reply: str) -> ProtocolError:
        """Return the error for a reply that the protocol does not allow."""
        error = failure(ProtocolError, what, self._line, command, reply)
        assert isinstance(error, ProtocolError)
        return error

    def device_fault(self, what: str, command: str, reply: str) -> DeviceFault:
        """Return the error for a command that the device refuses."""
        error = failure(DeviceFault, what, self._line, command, reply)
        assert isinstance(error, DeviceFault)
        return error

    # --- the regulator protocol ----------------------------------------------------------------

    @property
    def ceiling(self) -> float:
        """The highest set-point that is accepted, gauge Pa."""
        return self._ceiling

    @property
    def address(self) -> str:
        """Name of the device, unique on its port."""
        return self._address

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
        with self._changed:
            self._requested, self._frame, self._error = None, None, None
            self._confirmed = self._unconfirmed = False
            self._refusal = ''
            self._retry_at = -math.inf
            self._pause = FIRST_PAUSE
        self._bus = Bus.join(self._line, self)
        with self._changed:
            self._changed.wait_for(
                lambda: self._frame or (self._error and not temporary(self._error)),
                OPEN_PATIENCE,
            )
            met = self._frame is not None
            error = self._error
        if not met:
            self._leave()
            raise copied(
                error
                or TransportError(
                    f'port {self._line.port}: regulator {self._address!r} did not answer within'
                    f' {OPEN_PATIENCE:g} s'
                )
            )

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
        if self._bus is None:
            raise self._closed()
        with self._changed:
            changed = self._request(0.0)
        if changed:
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
            kind = type(copied(error)) if error else DeviceFault
            why = error or refusal or 'its bus was busy'
            raise kind(f'closed without a confirmed vent: port {self._line.port}: {why}')

    def _leave(self) -> None:
        bus, self._bus = self._bus, None
        if bus:
            bus.leave(self)

    def _closed(self) -> TransportError:
        return TransportError(
            f'the regulator {self._address!r} on port {self._line.port} is not open: call open()'
            ' first'
        )

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
        if self._bus is None:
            raise self._closed()
        age = math.inf if self._frame is None else time.monotonic() - self._frame.time
        if self._frame and age <= self._silence:
            return self._frame
        self._lose()
        if self._error:
            raise copied(self._error)
        raise TransportError(
            f'port {self._line.port}: no frame of regulator {self._address!r} for {age:.3g} s'
        )

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
            if not self._fail(error):
                return time.monotonic() + self._poll_period
            pause, self._pause = self._pause, min(2.0 * self._pause, LONGEST_PAUSE)
            return time.monotonic() + pause
        self._pause = FIRST_PAUSE
        return time.monotonic() + self._poll_period

    def lose_port(self, error: TransportError) -> None:
        """Treat the device as lost because its port is missing."""
        with self._changed:
            self._error = error
            self._lose()
            self._changed.notify_all()

    def _exchange(self, query: Query) -> None:
        """Send the requested set-point if it is not in force, and store a new frame."""
        with self._changed:
            known = self._frame
        frame = None if known else self.identify(query)
        last = known or frame
        assert last is not None
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
                f' port {self._line.port}, regulator {self._address!r}'
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

    def _fail(self, error: PadError) -> bool:
        """Store an error; return whether the device is lost."""
        with self._changed:
            self._error = error
            self._retry_at = -math.inf
            age = math.inf if self._frame is None else time.monotonic() - self._frame.time
            if age > self._silence or isinstance(error, ConfigError):
                self._lose()  # a device that differs from the options counts as lost, too
            self._changed.notify_all()
            return self._frame is None

    def _lose(self) -> None:
        """Treat the device as lost and request a vent. The lock is held."""
        self._frame = None
        self._confirmed = False
        self._unconfirmed = True
        if self._requested is not None:
            self._request(0.0)


def temporary(error: PadError) -> bool:
    """Return whether the next attempt may succeed after an error."""
    return isinstance(error, (TransportError, ProtocolError))


def copied(error: PadError) -> PadError:
    """Return a copy of an error, because raising one object repeatedly extends its traceback."""
    kind = TransportError if isinstance(error, PortLost) else type(error)
    if isinstance(error, DeviceError):
        return kind(str(error), error.port, error.command, error.reply)
    return kind(*error.args)


def unit(name: str) -> float:
    """Return the size of a unit of pressure, Pa; raise `InvalidInput` if it is unknown."""
    return UNITS[choice('units', name, tuple(UNITS))]
