# SPDX-License-Identifier: Apache-2.0
"""A serial port with its own thread, shared by the devices on one bus."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from dataclasses import dataclass
from typing import Any
from typing import Protocol

from ros_pad.errors import ConfigError
from ros_pad.errors import DeviceError
from ros_pad.errors import PadError
from ros_pad.errors import ProtocolError
from ros_pad.errors import TransportError

LONGEST_REPLY = 256
"""Bytes after which a reply without an end is given up."""

FIRST_PAUSE = 0.05
LONGEST_PAUSE = 1.0
"""s between two attempts to open a port that is gone; each pause is twice the one before."""

QUIET = 0.02
"""s that the line is left alone after a failure, so that a late reply answers nothing else."""


@dataclass(frozen=True)
class Line:
    """How one talks on a port: 8 data bits, no parity, 1 stop bit, lines of ASCII.

    Parameters
    ----------
    port : str
        Name of the serial port.
    baudrate : int
        1/s.
    terminator : str
        What ends a line, both ways.
    reply_timeout : float
        s from the command to the end of its reply.
    """

    port: str
    baudrate: int
    terminator: str
    reply_timeout: float


class Unplugged(TransportError):
    """The port itself is gone or cannot be opened, and with it every device on it."""


class Ask(Protocol):
    """Sends one command and returns its reply, both without terminator."""

    def __call__(self, command: str, reply: bool = True) -> str:
        """Send a command; with ``reply=False`` nothing is waited for, and '' returned."""


class Device(Protocol):
    """What a :class:`Bus` serves. Both methods are called by the thread of the bus."""

    @property
    def address(self) -> str:
        """What tells this device from the others on the bus."""

    def turn(self, ask: Ask) -> float:
        """Say what there is to say; return when the next turn is due, s, monotonic clock.

        It may raise :class:`Unplugged` and nothing else.
        """

    def unplugged(self, error: TransportError) -> None:
        """Note that the port is gone."""


def failure(
    kind: type[DeviceError], what: str, line: Line, command: str, reply: str | bytes
) -> DeviceError:
    """Return an error that says what went wrong on which port after which command."""
    words = f'{what}: port {line.port}, command {command!r}, reply {reply!r}'
    return kind(words, line.port, command, reply)


class Bus:
    """One open port. Its thread gives each device its turn, one command in flight.

    Devices that share a port share its bus: :meth:`join` and :meth:`leave` open and close it.
    Turns go to the device that has been due for longest, so that no device starves another.
    A port that cannot be opened, or goes away, is tried again with growing pauses.
    """

    _all: dict[str, Bus] = {}  # noqa: RUF012 one registry for the process, on purpose
    _registry = threading.Lock()

    def __init__(self, line: Line) -> None:
        self.line = line
        self._changed = threading.Condition()
        self._due: dict[Device, float] = {}
        self._closing = False
        self._port: Any = None
        self._thread = threading.Thread(
            target=self._serve, name=f'serial port {line.port}', daemon=True
        )

    @classmethod
    def join(cls, line: Line, device: Device) -> Bus:
        """Return the bus of a port, with one more device on it.

        Raises
        ------
        ConfigError
            When the port is in use with other settings, or the address is taken.
        TransportError
            When pyserial is not installed.
        """
        try:
            import serial  # noqa: F401 only here is it known that a port is needed
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
                    f'port {line.port} is open with {bus.line}: {line} is not allowed beside it'
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

    def leave(self, device: Device) -> None:
        """Take a device off; with the last one the port is closed."""
        with self._registry:
            with self._changed:
                self._due.pop(device, None)
                self._closing = not self._due
                self._changed.notify_all()
            if self._closing:
                del self._all[self.line.port]
                # A turn under way ends by its timeouts.
                self._thread.join()

    def call(self, device: Device, at: float) -> None:
        """Give a device its next turn at a time, if it is not due earlier; -inf jumps the queue.

        The time is that of the monotonic clock, s.
        """
        with self._changed:
            if device in self._due:
                self._due[device] = min(self._due[device], at)
                self._changed.notify_all()

    def ask(self, command: str, reply: bool = True) -> str:
        """Send a command and return its reply; see :class:`Ask`. For the bus' thread alone.

        Raises
        ------
        TransportError
            When no reply came in time, or only a part of one.
        ProtocolError
            When it is no ASCII, or has no end.
        Unplugged
            When the port is gone.
        """
        line = self.line
        end = line.terminator.encode()
        try:
            unasked: bytes = self._port.read(self._port.in_waiting)
            if unasked:
                what = 'something nobody asked for, before the command'
                raise failure(ProtocolError, what, line, command, unasked)
            self._port.write(command.encode() + end)
            answer: bytes = self._port.read_until(end, LONGEST_REPLY) if reply else end
            if answer.endswith(end) and answer.isascii():
                return answer.removesuffix(end).decode().strip()
            if answer.endswith(end):
                raise failure(ProtocolError, 'garbage', line, command, answer)
            if len(answer) >= LONGEST_REPLY:
                raise failure(ProtocolError, 'a reply without an end', line, command, answer)
            what = f'{"half a line" if answer else "no reply"} in {line.reply_timeout:g} s'
            raise failure(TransportError, what, line, command, answer)
        except PadError:
            time.sleep(QUIET)
            self._port.read(self._port.in_waiting)
            raise
        except Exception as error:
            # With the device also goes what pyserial expects of it: termios.error, TypeError.
            raise Unplugged(
                f'port {line.port} is gone: {error}: command {command!r}, reply none'
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
                exclusive=True,  # a second program on the line would take half of the replies
            )
        except Exception as error:  # as above: a device that goes while it is opened
            raise Unplugged(f'port {line.port} cannot be opened: {error}') from error

    def _close(self) -> None:
        if self._port is not None:
            with contextlib.suppress(OSError):  # it may be gone
                self._port.close()
            self._port = None

    def _next(self) -> Device | None:
        """Wait for the device that is due next; None ends the thread."""
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
                due = device.turn(self.ask)
                pause = FIRST_PAUSE
            except Unplugged as error:
                self._close()
                with self._changed:
                    devices = list(self._due)
                for each in devices:
                    each.unplugged(error)
                with self._changed:
                    self._changed.wait_for(lambda: self._closing, pause)
                pause = min(2.0 * pause, LONGEST_PAUSE)
                due = -math.inf
            self.call(device, due)
        self._close()
