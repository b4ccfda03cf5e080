# SPDX-License-Identifier: Apache-2.0
"""What all regulators on a serial line have in common: who waits for whom, and what is a fault."""

from __future__ import annotations

import math
import threading
import time
from abc import ABC
from abc import abstractmethod
from dataclasses import dataclass
from dataclasses import field

from ros_pad.contact.pad import choice
from ros_pad.contact.pad import number
from ros_pad.errors import ConfigError
from ros_pad.errors import DeviceError
from ros_pad.errors import DeviceFault
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.errors import ProtocolError
from ros_pad.errors import TransportError
from ros_pad.regulators.protocol import Reading
from ros_pad.regulators.protocol import permitted
from ros_pad.regulators.transport import FIRST_PAUSE
from ros_pad.regulators.transport import LONGEST_PAUSE
from ros_pad.regulators.transport import Ask
from ros_pad.regulators.transport import Bus
from ros_pad.regulators.transport import Line
from ros_pad.regulators.transport import Unplugged
from ros_pad.regulators.transport import failure

OPEN_PATIENCE = 1.0
"""s for which ``open`` waits for a device that does not answer."""

RETRY = 0.25
"""s until a set-point that was refused or ignored is sent again."""

UNITS = {
    'Pa': 1.0,
    'hPa': 100.0,
    'kPa': 1e3,
    'MPa': 1e6,
    'mbar': 100.0,
    'bar': 1e5,
    'psi': 6894.757293168361,
}
"""Pa in one unit of pressure."""


@dataclass(frozen=True)
class Frame:
    """What a device says at one moment.

    Parameters
    ----------
    pressure, setpoint : float
        Gauge Pa.
    resolution : float
        Pa, the step in which set-points can be told to the device.
    faults : tuple of str
        In the device's words.
    time : float
        s, monotonic clock.
    """

    pressure: float
    setpoint: float
    resolution: float
    faults: tuple[str, ...] = ()
    time: float = field(default_factory=time.monotonic)


class SerialRegulator(ABC):
    """One channel of a regulator on a serial line, polled by the thread of its bus.

    Nobody waits for the line but :meth:`open` and :meth:`close`:

    - The bus' thread polls the device. :meth:`read` returns the last frame, with its time, and
      raises what went wrong last when that frame is older than ``silence``.
    - :meth:`set_pressure` and :meth:`vent` leave the set-point that is wanted and return. The
      latest wins: nothing is queued. The thread sends it when the device's own set-point is
      another one, and again until the device obeys, so that a device that lost it gets it back.
      Until then :meth:`read` has a fault that says so. A vent goes before all else on the bus.
    - After ``silence`` without a frame, or when the port is gone, the device is lost: what was
      wanted is forgotten, a vent takes its place, and :meth:`set_pressure` raises. When the
      device is back it is met anew, vented, and only then takes set-points.
    - :meth:`close` vents, and waits for that at most ``silence``.

    Errors name port, command and reply. All methods may be called from any thread.

    Parameters
    ----------
    line : Line
        Port and how to talk on it.
    address : str
        What tells the device from others on this port.
    ceiling : float
        Highest set-point, gauge Pa, 1 to 1e7.
    poll_period : float
        s from the end of one poll to the next one, 0 to 1.
    silence : float
        s without a frame after which a device is lost, 0.05 to 10.

    Raises
    ------
    InvalidInput
        When a value is not allowed.
    """

    def __init__(
        self, line: Line, address: str, ceiling: float, poll_period: float, silence: float
    ) -> None:
        if not isinstance(line.port, str) or not line.port:
            raise InvalidInput(f'port = {line.port!r} is not allowed: the name of a serial port')
        whole = isinstance(line.baudrate, int) and not isinstance(line.baudrate, bool)
        if not whole or not 300 <= line.baudrate <= 4_000_000:
            raise InvalidInput(
                f'baudrate = {line.baudrate!r} is not allowed: a whole number from 300 to'
                ' 4000000 1/s is needed'
            )
        number('reply_timeout', line.reply_timeout, 's', 0.005, 5.0)
        self._ceiling = number('ceiling', ceiling, 'Pa', 1.0, 1e7)
        self._poll_period = number('poll_period', poll_period, 's', 0.0, 1.0)
        self._silence = number('silence', silence, 's', 0.05, 10.0)
        self._line = line
        self._address = address
        self._bus: Bus | None = None
        # What follows is shared with the bus' thread, under this lock.
        self._changed = threading.Condition()
        self._wanted: float | None = None  # None leaves the device as it was found
        self._obeyed = False
        self._frame: Frame | None = None  # None when the device is lost, or not yet met
        self._error: PadError | None = None  # of the last turn, None when it went well
        self._refusal = ''
        self._unsure = False  # a set-point was sent and nobody knows what became of it
        self._retry_at = -math.inf
        self._pause = FIRST_PAUSE  # for the thread alone

    # --- what a backend says on the line -------------------------------------------------------

    @abstractmethod
    def _meet(self, ask: Ask) -> Frame:
        """Check who answers, in which units, and that it obeys this line; return a frame."""

    @abstractmethod
    def _poll(self, ask: Ask) -> Frame:
        """Ask for a frame."""

    @abstractmethod
    def _set(self, ask: Ask, setpoint: float) -> Frame | None:
        """Send a set-point, gauge Pa, and check the echo; return a frame if the echo is one.

        Raises
        ------
        DeviceFault
            When the device refuses it.
        """

    def _fails(self, what: str, command: str, reply: str) -> ProtocolError:
        error = failure(ProtocolError, what, self._line, command, reply)
        assert isinstance(error, ProtocolError)
        return error

    def _refuses(self, what: str, command: str, reply: str) -> DeviceFault:
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
        """What tells the device from others on its port."""
        return self._address

    def open(self) -> None:
        """Meet the device. Its set-point stays as it is.

        Raises
        ------
        ConfigError, DeviceFault
            When the device is not as the options say, or does not obey this line.
        TransportError, ProtocolError
            When it does not answer in a second, or not as it must.
        """
        if self._bus is not None:
            return
        with self._changed:
            self._wanted, self._frame, self._error = None, None, None
            self._obeyed = self._unsure = False
            self._refusal = ''
            self._retry_at = -math.inf
            self._pause = FIRST_PAUSE
        self._bus = Bus.join(self._line, self)
        with self._changed:
            self._changed.wait_for(
                lambda: self._frame or (self._error and not _passing(self._error)),
                OPEN_PATIENCE,
            )
            met = self._frame is not None
            error = self._error
        if not met:
            self._leave()
            raise _again(
                error
                or TransportError(
                    f'port {self._line.port}: regulator {self._address!r} did not answer in'
                    f' {OPEN_PATIENCE:g} s'
                )
            )

    def set_pressure(self, gauge_pa: float) -> None:
        """Want a pressure in [0, ceiling], gauge Pa; see ``Regulator.set_pressure``.

        Raises
        ------
        InvalidInput, LimitError
            When it is not allowed.
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device is lost, with what was last wrong. The set-point is not taken.
        """
        setpoint = permitted(gauge_pa, self._ceiling)
        with self._changed:
            self._check()
            news = self._want(setpoint)
        if news and self._bus:
            self._bus.call(self, time.monotonic())

    def read(self) -> Reading:
        """Return the last frame; see ``Regulator.read``. Its time is on the monotonic clock."""
        with self._changed:
            frame = self._check()
            faults = (*frame.faults, self._refusal) if self._refusal else frame.faults
        return Reading(frame.pressure, frame.setpoint, faults, frame.time)

    def vent(self) -> None:
        """Want zero gauge pressure before all else, until the device obeys.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device is lost. It is vented all the same once it is back.
        """
        if self._bus is None:
            raise self._closed()
        with self._changed:
            news = self._want(0.0)
        if news:
            self._bus.call(self, -math.inf)
        with self._changed:
            self._check()

    def close(self) -> None:
        """Vent, and end the conversation, whether or not the device obeyed.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device did not vent.
        """
        if self._bus is None:
            return
        with self._changed:
            self._want(0.0)
        self._bus.call(self, -math.inf)
        with self._changed:
            self._changed.wait_for(lambda: self._obeyed, self._silence)
            vented, error, refusal = self._obeyed, self._error, self._refusal
        self._leave()
        if not vented:
            kind = type(_again(error)) if error else DeviceFault
            why = error or refusal or 'it had no turn in time'
            raise kind(f'closed, and not known to be vented: port {self._line.port}: {why}')

    def _leave(self) -> None:
        bus, self._bus = self._bus, None
        if bus:
            bus.leave(self)

    def _closed(self) -> TransportError:
        return TransportError(
            f'the regulator {self._address!r} on port {self._line.port} is not open: call open()'
            ' first'
        )

    def _want(self, setpoint: float) -> bool:
        """Note what is wanted; return whether that is news. The lock is held."""
        if setpoint == self._wanted:
            return False
        self._wanted = setpoint
        self._obeyed = False
        self._refusal = ''
        self._retry_at = -math.inf
        return True

    def _check(self) -> Frame:
        """Return the last frame; lose the device if it is too old. The lock is held."""
        if self._bus is None:
            raise self._closed()
        age = math.inf if self._frame is None else time.monotonic() - self._frame.time
        if self._frame and age <= self._silence:
            return self._frame
        self._lose()
        if self._error:
            raise _again(self._error)
        raise TransportError(
            f'port {self._line.port}: no frame of regulator {self._address!r} for {age:.3g} s'
        )

    # --- the thread of the bus -----------------------------------------------------------------

    def turn(self, ask: Ask) -> float:
        """Meet, set or poll the device; see :class:`~ros_pad.regulators.transport.Device`."""
        try:
            self._talk(ask)
        except Unplugged:
            raise
        except Exception as error:  # a thread that dies would take every vent with it
            if not isinstance(error, PadError):
                error = TransportError(f'port {self._line.port}: {error!r}')
            if not self._fail(error):
                return time.monotonic() + self._poll_period
            pause, self._pause = self._pause, min(2.0 * self._pause, LONGEST_PAUSE)
            return time.monotonic() + pause
        self._pause = FIRST_PAUSE
        return time.monotonic() + self._poll_period

    def unplugged(self, error: TransportError) -> None:
        """Lose the device."""
        with self._changed:
            self._error = error
            self._lose()
            self._changed.notify_all()

    def _talk(self, ask: Ask) -> None:
        with self._changed:
            known = self._frame
        frame = None if known else self._meet(ask)
        last = known or frame
        assert last is not None
        refusal = ''
        with self._changed:
            wanted = self._wanted
            due = wanted is not None and time.monotonic() >= self._retry_at
            setpoint = self._rounded(wanted or 0.0, last.resolution)
            due = due and (self._unsure or not self._obeys(last, setpoint))
            if due:
                self._unsure = True
                self._retry_at = time.monotonic() + RETRY
        if due:
            try:
                frame = self._set(ask, setpoint) or self._poll(ask)
            except DeviceFault as error:
                refusal = str(error)
        frame = frame or self._poll(ask)
        obeyed = wanted is None or self._obeys(frame, self._rounded(wanted, frame.resolution))
        if not obeyed and not refusal:
            refusal = self._refusal or (
                f'set-point of {wanted:g} Pa is not obeyed: {frame.setpoint:g} Pa is in force:'
                f' port {self._line.port}, regulator {self._address!r}'
            )
        with self._changed:
            if self._frame is not known:
                return  # lost meanwhile: it must be met anew
            self._frame, self._error = frame, None
            self._unsure = False
            if wanted == self._wanted:
                self._obeyed = obeyed
                self._refusal = '' if obeyed else refusal
            self._changed.notify_all()

    def _obeys(self, frame: Frame, setpoint: float) -> bool:
        return abs(frame.setpoint - setpoint) < 0.5 * frame.resolution

    def _rounded(self, setpoint: float, resolution: float) -> float:
        """Return the nearest set-point that the device can be told, never above the ceiling."""
        steps = round(setpoint / resolution)
        if steps * resolution > self._ceiling * (1.0 + 1e-9):
            steps -= 1
        return steps * resolution

    def _fail(self, error: PadError) -> bool:
        """Note what went wrong; return whether the device is lost."""
        with self._changed:
            self._error = error
            self._retry_at = -math.inf
            age = math.inf if self._frame is None else time.monotonic() - self._frame.time
            if age > self._silence or isinstance(error, ConfigError):
                self._lose()  # a device that is not what the options say is not asked further
            self._changed.notify_all()
            return self._frame is None

    def _lose(self) -> None:
        """Forget the device and what it was to do, but for a vent. The lock is held."""
        self._frame = None
        self._obeyed = False
        self._unsure = True
        if self._wanted is not None:
            self._want(0.0)


def _passing(error: PadError) -> bool:
    """Return whether an error may be gone at the next attempt."""
    return isinstance(error, (TransportError, ProtocolError))


def _again(error: PadError) -> PadError:
    """Return an error like this one: raised again, one object would pile up tracebacks."""
    kind = TransportError if isinstance(error, Unplugged) else type(error)
    if isinstance(error, DeviceError):
        return kind(str(error), error.port, error.command, error.reply)
    return kind(*error.args)


def unit(name: str) -> float:
    """Return how many Pa a unit of pressure is."""
    return UNITS[choice('units', name, tuple(UNITS))]
