# SPDX-License-Identifier: Apache-2.0
"""Serial ports, each with one thread that serves the devices on its bus."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from dataclasses import dataclass
from typing import Any, Protocol

from ros_pad.errors import ConfigError, DeviceError, PadError, ProtocolError, TransportError

LONGEST_REPLY = 256
"""Longest reply, bytes; a longer one without a terminator is an error."""

FIRST_PAUSE = 0.05
LONGEST_PAUSE = 1.0
"""First and longest pause between attempts to reach a missing port or a lost device, s; each
pause is twice as long as the one before."""

QUIET = 0.02
"""Pause after a failure, s, so that a late reply is not read as the next one."""


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


class PortLost(TransportError):
    """The port is missing or cannot be opened; no device on it can be reached."""


class Query(Protocol):
    """Function that sends one command and returns its reply, both without terminator."""

    def __call__(self, command: str, reply: bool = True) -> str:
        """Send a command; with ``reply=False`` return '' at once."""


class BusDevice(Protocol):
    """A device on a :class:`Bus`. The thread of the bus calls both methods."""

    @property
    def address(self) -> str:
        """Name of the device, unique on its bus."""

    def take_turn(self, query: Query) -> float:
        """Exchange commands and replies; return the time of the next turn, s, monotonic clock.

        Raises
        ------
        PortLost
            When the port is missing; no other error is allowed.
        """

    def lose_port(self, error: TransportError) -> None:
        """Receive the notice that the port is missing."""


def failure(
    kind: type[DeviceError], what: str, line: SerialLine, command: str, reply: str | bytes
) -> DeviceError:
    """Return an error that names the problem, the port, the command and the reply."""
    words = f'{what}: port {line.port}, command {command!r}, reply {reply!r}'
    return kind(words, line.port, command, reply)


class Bus:
    """One port and its thread, which gives each device its turn, one command at a time.

    Devices that share a port share its bus, which the first :meth:`join` opens and the last
    :meth:`leave` closes. The next turn goes to the device with the earliest due time; a vent is
    due at once and goes first. A port that is missing or cannot be opened is tried again, with
    growing pauses.
    """

    _all: dict[str, Bus] = {}  # noqa: RUF012 all instances share this registry on purpose
    _registry = threading.Lock()

    def __init__(self, line: SerialLine) -> None:
        self.line = line
        self._changed = threading.Condition()
        self._due: dict[BusDevice, float] = {}
        self._closing = False
        self._port: Any = None
        self._thread = threading.Thread(
            target=self._serve, name=f'serial port {line.port}', daemon=True
        )

    @classmethod
    def join(cls, line: SerialLine, device: BusDevice) -> Bus:
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
                bus = cls(line)
            elif bus.line != line:
                raise ConfigError(
                    f'port {line.port} is open with {bus.line}: a regulator with {line} cannot'
                    ' share it; give both the same settings'
                )
            with bus._changed:
                for other in bus._due:
                    if other.address == device.address:
                        raise ConfigError(
                            f'port {line.port} has a device {device.address!r} already: each'
                            ' regulator on a bus needs an address of its own'
                        )
                bus._due[device] = -math.inf
                bus._changed.notify_all()
            if line.port not in cls._all:
                cls._all[line.port] = bus
                bus._thread.start()
        return bus

    def leave(self, device: BusDevice) -> None:
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

    def schedule(self, device: BusDevice, at: float) -> None:
        """Schedule the next turn of a device, unless it is due earlier.

        Parameters
        ----------
        device : BusDevice
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
        line = self.line
        end = line.terminator.encode()
        try:
            unexpected: bytes = self._port.read(self._port.in_waiting)
            if unexpected:
                what = 'bytes were received before the command was sent'
                raise failure(ProtocolError, what, line, command, unexpected)
            self._port.write(command.encode() + end)
            answer: bytes = self._port.read_until(end, LONGEST_REPLY) if reply else end
            if answer.endswith(end) and answer.isascii():
                return answer.removesuffix(end).decode().strip()
            if answer.endswith(end):
                raise failure(ProtocolError, 'the reply is not ASCII', line, command, answer)
            if len(answer) >= LONGEST_REPLY:
                raise failure(ProtocolError, 'the reply has no terminator', line, command, answer)
            what = f'{"half a line" if answer else "no reply"} within {line.reply_timeout:g} s'
            raise failure(TransportError, what, line, command, answer)
        except PadError:
            time.sleep(QUIET)
            self._port.read(self._port.in_waiting)
            raise
        except Exception as error:
            # pyserial raises errors of many types when a device disappears.
            raise PortLost(
                f'port {line.port} is missing: {error}: command {command!r}, reply none'
            ) from error

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

    def _next(self) -> BusDevice | None:
        """Wait until a device is due and return it; None when the bus is closed."""
        with self._changed:
            while not self._closing:
                device, due = min(
                    self._due.items(), key=lambda each: each[1], default=(None, math.inf)
                )
                wait = due - time.monotonic()
                if wait <= 0.0:
                    assert device is not None
                    self._due[device] = math.inf
                    return device
                self._changed.wait(wait if wait < math.inf else None)
        return None

    def _serve(self) -> None:
        pause = FIRST_PAUSE
        while (device := self._next()) is not None:
            try:
                if self._port is None:
                    self._open()
                due = device.take_turn(self.query)
                pause = FIRST_PAUSE
            except PortLost as error:
                self._close()
                with self._changed:
                    devices = list(self._due)
                for each in devices:
                    each.lose_port(error)
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
                due = -math.inf
            self.schedule(device, due)
        self._close()
