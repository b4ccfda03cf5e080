# SPDX-License-Identifier: Apache-2.0
"""Emulated regulators on pseudo-terminals, one for every serial backend."""

from __future__ import annotations

import math
import os
import re
import select
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from ros_pad.configuration import choice, integer, number
from ros_pad.errors import InvalidInput, TransportError
from ros_pad.regulators.alicat import SOURCE_SINCE, STATUS, UNITS_SINCE
from ros_pad.regulators.serial_device import unit
from ros_pad.regulators.serial_text import FULL_COUNT

UNIT_CODE = '10'
"""Code by which the emulated Alicat names its units."""


class FaultSchedule:
    """Faults, and the times at which they are active.

    A kind of fault applies to all devices, or to one device if it is written ``kind@address``.

    Parameters
    ----------
    allowed : sequence of str
        Kinds of faults that this emulator has.
    schedule : sequence of str
        ``kind``, ``kind:start`` or ``kind:start:end``; times are s since this object was made.

    Raises
    ------
    InvalidInput
        When a kind is unknown, or a time is not valid.
    """

    def __init__(self, allowed: Sequence[str], schedule: Sequence[str] = ()) -> None:
        self._allowed = tuple(allowed)
        self._started = time.monotonic()
        self._acting: dict[str, tuple[float, float]] = {}
        for text in schedule:
            kind, *times = text.split(':')
            try:
                start, end = [float(each) for each in times] + [0.0, math.inf][len(times) :]
            except ValueError:
                start, end = math.nan, math.nan
            if not 0.0 <= start < end:
                raise InvalidInput(
                    f'fault {text!r} is not allowed: KIND[:START[:END]] is needed, with 0 <= START'
                    ' < END in s'
                )
            self.add(kind, start, end)

    def add(self, kind: str, start: float = 0.0, end: float = math.inf) -> None:
        """Add a fault that is active from one time to another, s."""
        choice('fault', kind.partition('@')[0], self._allowed)
        self._acting[kind] = (start, end)

    def clear(self) -> None:
        """Remove all faults."""
        self._acting.clear()

    def act(self, kind: str, address: str = '') -> bool:
        """Return whether a fault is active now on a device."""
        now = time.monotonic() - self._started
        times = [self._acting.get(kind), self._acting.get(f'{kind}@{address}')]
        return any(each and each[0] <= now < each[1] for each in times)


class Valve:
    """A valve whose outlet pressure follows its set-point with one time constant.

    Attributes
    ----------
    setpoint : float
        Set-point, gauge Pa.
    held : bool
        Whether the pressure stays as it is, whatever the set-point.
    """

    TIME_CONSTANT = 0.1
    """Time constant, s."""

    def __init__(self) -> None:
        self._start, self._time = 0.0, time.monotonic()
        self.setpoint, self.held = 0.0, False

    def follow(self, setpoint: float, held: bool = False) -> None:
        """Follow a set-point, gauge Pa, from now on, or hold the pressure."""
        self._start, self._time = self.pressure, time.monotonic()
        self.setpoint, self.held = setpoint, held

    @property
    def pressure(self) -> float:
        """Present pressure, gauge Pa."""
        if self.held:
            return self._start
        left = math.exp((self._time - time.monotonic()) / self.TIME_CONSTANT)
        return self.setpoint + (self._start - self.setpoint) * left


class EmulatedDevice(ABC):
    """A device, or several on one bus, that answers commands.

    Parameters
    ----------
    addresses : sequence of str
        Names of the devices on the bus.
    full_scale : float
        Highest pressure, gauge Pa, above 0.
    schedule : sequence of str
        See :class:`FaultSchedule`.
    """

    FAULTS: tuple[str, ...] = (
        *('silence', 'half_line', 'garbage', 'unplugged'),  # of the line
        *('rejection', 'analog_source', 'echo'),
    )
    terminator = '\n'

    def __init__(
        self, addresses: Sequence[str], full_scale: float, schedule: Sequence[str]
    ) -> None:
        self.full_scale = number('full_scale', full_scale, 'Pa', above=True)
        self.valves = {each: Valve() for each in addresses}
        self.faults = FaultSchedule(self.FAULTS, schedule)

    @abstractmethod
    def answer(self, command: str) -> tuple[str, str] | None:
        """Return the answering address and its reply; None for no reply."""

    def follow(self, address: str, setpoint: float) -> float:
        """Set a valve as far as faults allow; return the set-point that the reply shows, Pa."""
        if self.faults.act('echo', address):
            setpoint *= 0.5
        if not self.faults.act('analog_source', address):
            valve = self.valves[address]
            valve.follow(setpoint, valve.held)
        return setpoint


class Emulator:
    """Connect an emulated device to a pseudo-terminal until it is closed.

    Parameters
    ----------
    device : EmulatedDevice
    link : str, optional
        Path of a symbolic link to the port. It stays the same when the device is plugged in again,
        as in udev's ``/dev/serial/by-id``. Nothing may exist there. A file that takes this path
        while the device is unplugged is not replaced; the emulator then ends.

    Raises
    ------
    InvalidInput
        When the path of the link exists, or its folder does not.
    TransportError
        When the link cannot be made. If the device cannot be plugged in again later,
        :meth:`wait` and :meth:`close` raise it.

    Attributes
    ----------
    path : str
        Port to open.
    commands : list of str
        Last received commands, oldest first, at most 1000.
    """

    def __init__(self, device: EmulatedDevice, link: str | None = None) -> None:
        if link and (os.path.lexists(link) or not os.path.isdir(os.path.dirname(link) or '.')):
            raise InvalidInput(
                f'link = {link!r} is not allowed: a new path in a folder that exists is needed'
            )
        self._device = device
        self._link = link
        self._closing = threading.Event()
        self._error: Exception | None = None
        self._ends: tuple[int, int] | None = None
        self._buffer = b''
        self.commands: list[str] = []
        self.path = link or ''
        self._plug()
        self._thread = threading.Thread(target=self._serve, name='emulator', daemon=True)
        self._thread.start()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self) -> None:
        """Wait until the emulator ends because of an error, and raise it."""
        self._closing.wait()
        self.close()

    def close(self) -> None:
        """Remove the device and its port; raise the error that ended it, if not raised before."""
        self._closing.set()
        self._thread.join()
        self._unplug()
        error, self._error = self._error, None
        if error:
            raise error

    def _plug(self) -> None:
        near, far = os.openpty()
        # A real port has no echo and no line editing. The far end stays open here; otherwise the
        # near end would be closed with the last program that uses the port.
        tty.setraw(far)
        self._ends = near, far
        self._buffer = b''
        if not self._link:
            self.path = os.ttyname(far)
            return
        try:
            os.symlink(os.ttyname(far), self._link)
        except OSError as error:
            self._unplug()
            raise TransportError(
                f'link = {self._link!r}: the device cannot be plugged in: {error.strerror}'
            ) from error

    def _unplug(self) -> None:
        if self._ends:
            port = os.ttyname(self._ends[1])
            if self._link and os.path.islink(self._link) and os.readlink(self._link) == port:
                os.unlink(self._link)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def _serve(self) -> None:
        try:
            while not self._closing.is_set():
                self._turn()
        except Exception as error:  # raised by wait() and close()
            self._error = error
            self._closing.set()

    def _turn(self) -> None:
        if self._device.faults.act('unplugged'):
            self._unplug()
            self._closing.wait(0.005)
            return
        if self._ends is None:
            self._plug()
        assert self._ends
        near, end = self._ends[0], self._device.terminator.encode()
        if select.select([near], [], [], 0.01)[0]:
            self._buffer += os.read(near, 4096)
            while end in self._buffer:
                line, _, self._buffer = self._buffer.partition(end)
                self._reply(near, line.decode('ascii', 'replace'))

    def _reply(self, near: int, command: str) -> None:
        self.commands = [*self.commands[-999:], command]
        device = self._device
        answer = device.answer(command)
        if answer is None:
            return
        address, text = answer
        if device.faults.act('silence', address):
            return
        reply = (text + device.terminator).encode()
        if device.faults.act('half_line', address):
            reply = reply[: len(reply) // 2]
        if device.faults.act('garbage', address):
            reply = b'\xfe\x91' + reply[::-1] + device.terminator.encode()
        os.write(near, reply)


class AlicatEmulator(EmulatedDevice):
    """Alicat pressure controllers on one bus.

    Parameters
    ----------
    unit_ids : str
        Unit ID of each device, one letter from A to Z, e.g. ``'ABCDEF'``.
    units : str
        Engineering units, a key of ``serial_device.UNITS``.
    firmware : str
        Version, such as ``'10v20'``. Firmware has LS from 9v00 on and LSS from 10v05 on. Before
        9v00 it reads every command that begins with L as the lock of the front panel.
    full_scale : float
        Highest set-point, gauge Pa, above 0; the reply to a higher one is ``?``.
    schedule : sequence of str
        See :class:`FaultSchedule`.
    """

    FAULTS = (
        *EmulatedDevice.FAULTS,
        *('wrong_id', 'wrong_unit'),
        *(f'status={each}' for each in STATUS),
    )
    terminator = '\r'

    def __init__(
        self,
        unit_ids: str = 'A',
        units: str = 'kPa',
        firmware: str = '10v20',
        full_scale: float = 150e3,
        schedule: Sequence[str] = (),
    ) -> None:
        for name, value, pattern in (
            ('unit_ids', unit_ids, '[A-Z]+'),
            ('firmware', firmware, r'\d+v\d+'),
        ):
            if not re.fullmatch(pattern, value):
                raise InvalidInput(f'{name} = {value!r} is not allowed: {pattern} is needed')
        self._units = units
        self._unit = unit(units)
        self._firmware = firmware
        self._version = tuple(int(each) for each in firmware.split('v'))
        self.locked: set[str] = set()
        super().__init__(unit_ids, full_scale, schedule)

    def answer(self, command: str) -> tuple[str, str] | None:
        """Return the ID of the unit that answers and its reply; None if there is no such unit."""
        address, order = command[:1].upper(), command[1:].strip().upper()
        if address not in self.valves:
            return None
        reply = self._obey(address, order)
        if self.faults.act('wrong_id', address):
            reply = chr(ord(address) + 1) + reply[1:]
        return address, reply

    def _obey(self, address: str, order: str) -> str:
        valve = self.valves[address]
        has = self.faults.act
        if order == '':
            return self._frame(address)
        if order == 'VE':
            return f'{address}   {self._firmware}.0-R24 Jan  2 2024,10:20:30'
        if order.startswith('L') and self._version < UNITS_SINCE:
            self.locked.add(address)
            return self._frame(address)
        if order == 'LSS' and self._version >= SOURCE_SINCE:
            return f'{address} {"A" if has("analog_source", address) else "S"}'
        if order.split()[0] == 'LS':
            _, *words = order.split()
            if words and (words[1:] != [UNIT_CODE] or self._set(address, words[0]) == '?'):
                return '?'
            label = 'PSIG' if has('wrong_unit', address) else f'{self._units}G'
            shown = self._shown(valve.setpoint)
            return f'{address} {shown} {shown} {UNIT_CODE} {label}'
        if order in ('HP', 'C'):
            valve.follow(valve.setpoint, held=order == 'HP')
            return self._frame(address)
        if order.startswith('S'):
            return self._set(address, order[1:])
        return '?'

    def _set(self, address: str, text: str) -> str:
        try:
            setpoint = float(text) * self._unit
        except ValueError:
            return '?'
        if self.faults.act('rejection', address) or not 0.0 <= setpoint <= self.full_scale:
            return '?'
        self.follow(address, setpoint)
        return self._frame(address)

    def _frame(self, address: str) -> str:
        valve = self.valves[address]
        status = [each for each in STATUS if self.faults.act(f'status={each}', address)]
        status += ['HLD'] * valve.held + ['LCK'] * (address in self.locked)
        numbers = f'{self._shown(valve.pressure)} {self._shown(valve.setpoint)}'
        return ' '.join([address, numbers, *status])

    def _shown(self, pressure: float) -> str:
        return f'{pressure / self._unit:+07.2f}'


class SmcItvEmulator(EmulatedDevice):
    """An SMC ITV on RS-232C, with the commands that two field programs use.

    Parameters
    ----------
    full_scale : float
        Gauge Pa at the setting 1023, above 0.
    schedule : sequence of str
        See :class:`FaultSchedule`.
    """

    terminator = '\r\n'

    def __init__(self, full_scale: float = 100e3, schedule: Sequence[str] = ()) -> None:
        super().__init__([''], full_scale, schedule)
        self._count = full_scale / FULL_COUNT

    def answer(self, command: str) -> tuple[str, str] | None:
        """Return an empty address and the reply to one command."""
        order, *words = command.split() or ['']
        value = self.valves[''].pressure if order == 'MON' else self.valves[''].setpoint
        if order == 'SET':
            if len(words) != 1 or not words[0].isdigit() or self.faults.act('rejection'):
                return '', 'UNKNOWN COMMAND'
            value = self.follow('', min(int(words[0]), FULL_COUNT) * self._count)
        elif order not in ('MON', 'REQ'):
            return '', 'UNKNOWN COMMAND'
        return '', str(round(value / self._count))


class SerialTextEmulator(EmulatedDevice):
    """A microcontroller board whose DACs drive SMC ITV, with the default lines of text.

    The reply to ``SET 1 2.500`` is ``OK 1 2.500``; the last number is the command voltage, 0 to
    5 V. The reply to ``READ 1`` is such as ``1 3.000``; the last number is the monitor voltage, 1
    to 5 V.

    Parameters
    ----------
    channels : int
        Number of regulators, 1 to 99.
    full_scale : float
        Gauge Pa at 5 V, above 0.
    schedule : sequence of str
        See :class:`FaultSchedule`.
    """

    def __init__(
        self, channels: int = 6, full_scale: float = 100e3, schedule: Sequence[str] = ()
    ) -> None:
        names = [str(each + 1) for each in range(integer('channels', channels, 1, 99))]
        super().__init__(names, full_scale, schedule)

    def answer(self, command: str) -> tuple[str, str] | None:
        """Return the channel that a command names, and the reply to it."""
        order, channel, *values = [*command.split(), '', '']
        valve = self.valves.get(channel)
        if valve and order == 'READ':
            return channel, f'{channel} {1.0 + 4.0 * valve.pressure / self.full_scale:.3f}'
        try:
            volts = float(values[0])
        except (IndexError, ValueError):
            return channel, 'ERROR'
        if not valve or order != 'SET' or self.faults.act('rejection', channel):
            return channel, 'ERROR'
        shown = self.follow(channel, volts / 5.0 * self.full_scale) / self.full_scale
        return channel, f'OK {channel} {5.0 * shown:.3f}'


EMULATORS: dict[str, Any] = {
    'alicat': AlicatEmulator,
    'smc_itv': SmcItvEmulator,
    'serial_text': SerialTextEmulator,
}
"""Emulated devices by backend."""
