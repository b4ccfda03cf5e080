# SPDX-License-Identifier: Apache-2.0
"""Regulators that are not there, on pseudo-terminals: the far end of every serial backend."""

from __future__ import annotations

import math
import os
import re
import select
import threading
import time
import tty
from collections.abc import Sequence
from typing import Protocol

from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.errors import TransportError
from ros_pad.regulators.channel import unit

LINE_FAULTS = ('silence', 'half_line', 'garbage', 'unplugged')
"""Faults of any line; each device has more of its own."""


UNIT_CODE = '10'
"""What the emulated Alicat calls its units; every device has codes of its own."""


class Faults:
    """What is wrong now. Kinds as text; ``kind@address`` for one device of several on a bus.

    Parameters
    ----------
    allowed : sequence of str
        Kinds that this emulator knows.
    schedule : sequence of str
        ``kind``, ``kind:start`` or ``kind:start:end``, s from the making of this object.

    Raises
    ------
    InvalidInput
        When a kind is not known, or a time is none.
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
                    f'fault {text!r} is not allowed: KIND, KIND:START or KIND:START:END, s, is'
                    ' needed'
                )
            self.add(kind, start, end)

    def add(self, kind: str, start: float = 0.0, end: float = math.inf) -> None:
        """Let a fault act from one time to another, s."""
        if kind.partition('@')[0] not in self._allowed:
            raise InvalidInput(
                f'fault {kind!r} is not allowed: one of {", ".join(self._allowed)} is needed'
            )
        self._acting[kind] = (start, end)

    def clear(self) -> None:
        """Repair everything."""
        self._acting.clear()

    def act(self, kind: str, address: str = '') -> bool:
        """Return whether a fault acts now on a device."""
        now = time.monotonic() - self._started
        times = [self._acting.get(kind), self._acting.get(f'{kind}@{address}')]
        return any(each and each[0] <= now < each[1] for each in times)


class Pneumatics:
    """Pressure behind a valve that follows its set-point with one time constant.

    Parameters
    ----------
    time_constant : float
        s, above 0.
    """

    def __init__(self, time_constant: float) -> None:
        self._time_constant = number('time_constant', time_constant, 's', above=True)
        self._time = time.monotonic()
        self._pressure = 0.0
        self._setpoint = 0.0
        self.held = False

    @property
    def setpoint(self) -> float:
        """Gauge Pa."""
        return self._setpoint

    @setpoint.setter
    def setpoint(self, value: float) -> None:
        self.pressure  # noqa: B018 brings it to the present with the old set-point
        self._setpoint = value

    @property
    def pressure(self) -> float:
        """Gauge Pa, now."""
        now = time.monotonic()
        elapsed, self._time = now - self._time, now
        if not self.held:
            left = math.exp(-elapsed / self._time_constant)
            self._pressure = self._setpoint + (self._pressure - self._setpoint) * left
        return self._pressure


class Device(Protocol):
    """What answers on an emulated line."""

    terminator: str
    faults: Faults

    def answer(self, command: str) -> tuple[str, str] | None:
        """Return the address that answers, and its reply; None for no reply."""


class Emulator:
    """A device at the far end of a pseudo-terminal, until it is closed.

    Parameters
    ----------
    device : Device
    link : str, optional
        A name that stays when the device is unplugged and comes back, as a port of udev's
        ``/dev/serial/by-id`` does. Nothing may be there yet. What takes its place later stays as
        it is: then the device cannot be plugged in again, and the emulator ends.

    Raises
    ------
    InvalidInput
        When something is where the link is to be, or there is no such folder.
    TransportError
        From :meth:`wait` and :meth:`close`, when the device could not be plugged in again.

    Attributes
    ----------
    path : str
        The port to open.
    commands : list of str
        The last commands that were heard, oldest first, at most 1000.
    """

    def __init__(self, device: Device, link: str | None = None) -> None:
        if link and os.path.lexists(link):
            raise InvalidInput(f'link = {link!r} is not allowed: something is there already')
        if link and not os.path.isdir(os.path.dirname(link) or '.'):
            raise InvalidInput(f'link = {link!r} is not allowed: there is no such folder')
        self._device = device
        self._link = link
        self._closing = threading.Event()
        self._ended = threading.Event()
        self._trouble: Exception | None = None
        self._ends: tuple[int, int] | None = None
        self._buffer = b''
        self.commands: list[str] = []
        self.path = link or ''
        self._plug()
        self._thread = threading.Thread(target=self._run, name='emulator', daemon=True)
        self._thread.start()

    def __enter__(self) -> Emulator:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind:  # which is to be heard, and nothing else
            self._trouble = None
        self.close()

    def wait(self) -> None:
        """Wait until the emulator ends by itself, which it does when something is wrong."""
        self._ended.wait()
        self._tell()

    def close(self) -> None:
        """Take the device and its port away; raise what ended it before, unless it was told."""
        self._closing.set()
        self._thread.join()
        self._unplug()
        self._tell()

    def _tell(self) -> None:
        trouble, self._trouble = self._trouble, None
        if trouble:
            raise trouble

    def _plug(self) -> None:
        near, far = os.openpty()
        # As a real port: no echo, no line editing. The far end stays open here too, so that
        # the near one survives when nobody else has it open.
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
            what = (
                'something else has taken this name, and keeps it'
                if isinstance(error, FileExistsError)
                else str(error.strerror)
            )
            raise TransportError(
                f'link = {self._link!r}: the device cannot be plugged in: {what}', self._link
            ) from error

    def _unplug(self) -> None:
        if self._ends:
            port = os.ttyname(self._ends[1])
            if self._link and os.path.islink(self._link) and os.readlink(self._link) == port:
                os.unlink(self._link)
            for end in self._ends:
                os.close(end)
            self._ends = None

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # a thread has nobody to tell: wait() and close() do
            self._trouble = error
        self._ended.set()

    def _serve(self) -> None:
        while not self._closing.is_set():
            gone = self._device.faults.act('unplugged')
            if gone:
                self._unplug()
                self._closing.wait(0.005)
                continue
            if self._ends is None:
                self._plug()
            assert self._ends
            near = self._ends[0]
            if not select.select([near], [], [], 0.01)[0]:
                continue
            self._buffer += os.read(near, 4096)
            end = self._device.terminator.encode()
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


class AlicatEmulator:
    """Alicat pressure controllers on one bus.

    Parameters
    ----------
    unit_ids : str
        One letter for each, e.g. ``'ABCDEF'``.
    units : str
        Engineering units, a key of ``channel.UNITS``.
    decimals : int
        Of frames.
    firmware : str
        ``'10v20'``: from 9v00 on it knows LS, from 10v05 on LSS. Older ones take everything
        that begins with L for the lock of the front panel.
    full_scale : float
        Highest set-point, gauge Pa; above it ``?``.
    time_constant : float
        s, of the pressure.
    schedule : sequence of str
        See :class:`Faults`.
    """

    STATUS = ('ADC', 'EXH', 'HLD', 'LCK', 'MOV', 'OPL', 'OVR', 'POV', 'TMF', 'TOV', 'VOV')
    FAULTS = (
        *LINE_FAULTS,
        *('wrong_id', 'wrong_unit', 'rejection', 'analog_source', 'echo'),
        *(f'status={each}' for each in STATUS),
    )
    terminator = '\r'

    def __init__(
        self,
        unit_ids: str = 'A',
        units: str = 'kPa',
        decimals: int = 2,
        firmware: str = '10v20',
        full_scale: float = 150e3,
        time_constant: float = 0.1,
        schedule: Sequence[str] = (),
    ) -> None:
        if not unit_ids or not unit_ids.isalpha() or not unit_ids.isupper():
            raise InvalidInput(f'unit_ids = {unit_ids!r} is not allowed: letters A to Z')
        if not re.fullmatch(r'\d+v\d+', firmware):
            raise InvalidInput(f'firmware = {firmware!r} is not allowed: such as 10v20 is needed')
        self._units = units
        self._unit = unit(units)
        self._decimals = decimals
        self._firmware = firmware
        self._version = tuple(int(each) for each in firmware.split('v'))
        self._full_scale = number('full_scale', full_scale, 'Pa', above=True)
        self.valves = {each: Pneumatics(time_constant) for each in unit_ids}
        self._locked: set[str] = set()
        self.faults = Faults(self.FAULTS, schedule)

    def answer(self, command: str) -> tuple[str, str] | None:
        """Answer as one of the units."""
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
        if order.startswith('L') and self._version < (9, 0):
            self._locked.add(address)
            return self._frame(address)
        if order == 'LSS' and self._version >= (10, 5):
            return f'{address} {"A" if has("analog_source", address) else "S"}'
        if order.split()[0] == 'LS':
            _, *words = order.split()
            if words and (words[1:] != [UNIT_CODE] or self._set(address, words[0]) == '?'):
                return '?'
            label = 'PSIG' if has('wrong_unit', address) else f'{self._units}G'
            shown = self._shown(valve.setpoint)
            return f'{address} {shown} {shown} {UNIT_CODE} {label}'
        if order in ('HP', 'C'):
            valve.pressure  # noqa: B018 up to now as before
            valve.held = order == 'HP'
            return self._frame(address)
        if order.startswith('S'):
            return self._set(address, order[1:])
        return '?'

    def _set(self, address: str, text: str) -> str:
        valve = self.valves[address]
        try:
            setpoint = float(text) * self._unit
        except ValueError:
            return '?'
        if self.faults.act('rejection', address) or not 0.0 <= setpoint <= self._full_scale:
            return '?'
        if self.faults.act('echo', address):
            setpoint *= 0.5
        if not self.faults.act('analog_source', address):
            valve.setpoint = setpoint
        return self._frame(address)

    def _frame(self, address: str) -> str:
        valve = self.valves[address]
        status = [each for each in self.STATUS if self.faults.act(f'status={each}', address)]
        status += ['HLD'] * valve.held + ['LCK'] * (address in self._locked)
        numbers = f'{self._shown(valve.pressure)} {self._shown(valve.setpoint)}'
        return ' '.join([address, numbers, *status])

    def _shown(self, pressure: float) -> str:
        return f'{pressure / self._unit:+0{self._decimals + 5}.{self._decimals}f}'


class SmcItvEmulator:
    """An SMC ITV on RS-232C, as field programs know it.

    Parameters
    ----------
    full_scale : float
        Gauge Pa of the setting 1023.
    time_constant : float
        s, of the pressure.
    schedule : sequence of str
        See :class:`Faults`.
    """

    FAULTS = (*LINE_FAULTS, 'rejection', 'analog_source', 'echo')
    terminator = '\r\n'

    def __init__(
        self,
        full_scale: float = 100e3,
        time_constant: float = 0.1,
        schedule: Sequence[str] = (),
    ) -> None:
        self._count = number('full_scale', full_scale, 'Pa', above=True) / 1023.0
        self.valve = Pneumatics(time_constant)
        self.faults = Faults(self.FAULTS, schedule)

    def answer(self, command: str) -> tuple[str, str] | None:
        """Answer one command."""
        order, *words = command.split() or ['']
        setting = round(self.valve.setpoint / self._count)
        rejected = self.faults.act('rejection')
        if order == 'MON':
            return '', str(round(self.valve.pressure / self._count))
        if order == 'REQ':
            return '', str(setting)
        if order == 'SET' and len(words) == 1 and words[0].isdigit() and not rejected:
            setting = min(int(words[0]), 1023)
        elif order in ('INC', 'DEC') and not rejected:
            setting = min(max(setting + (1 if order == 'INC' else -1), 0), 1023)
        else:
            return '', 'UNKNOWN COMMAND'
        if self.faults.act('echo'):
            setting //= 2
        if not self.faults.act('analog_source'):
            self.valve.setpoint = setting * self._count
        return '', str(setting)


class SerialTextEmulator:
    """A microcontroller board whose DACs drive SMC ITV, in the lines that are the default.

    ``SET 1 2.500`` is answered by ``OK 1 2.500``, ``READ 1`` by ``1 3.000``: volts of the
    command, 0 to 5 V, and of the monitor, 1 to 5 V.

    Parameters
    ----------
    channels : int
        Number of regulators, from 1.
    full_scale : float
        Gauge Pa at 5 V.
    time_constant : float
        s, of the pressures.
    schedule : sequence of str
        See :class:`Faults`.
    """

    FAULTS = (*LINE_FAULTS, 'rejection', 'analog_source', 'echo')
    terminator = '\n'

    def __init__(
        self,
        channels: int = 6,
        full_scale: float = 100e3,
        time_constant: float = 0.1,
        schedule: Sequence[str] = (),
    ) -> None:
        if not 1 <= channels <= 99:
            raise InvalidInput(f'channels = {channels!r} is not allowed: 1 to 99 is needed')
        self._full_scale = number('full_scale', full_scale, 'Pa', above=True)
        self.valves = {str(each + 1): Pneumatics(time_constant) for each in range(channels)}
        self.faults = Faults(self.FAULTS, schedule)

    def answer(self, command: str) -> tuple[str, str] | None:
        """Answer one command."""
        words = command.split()
        order, channel = [*words, '', ''][:2]
        valve = self.valves.get(channel)
        if valve and order == 'READ':
            return channel, f'{channel} {1.0 + 4.0 * valve.pressure / self._full_scale:.3f}'
        try:
            volts = float(words[2])
        except (IndexError, ValueError):
            return channel, 'ERROR'
        if not valve or order != 'SET' or self.faults.act('rejection', channel):
            return channel, 'ERROR'
        if self.faults.act('echo', channel):
            volts *= 0.5
        if not self.faults.act('analog_source', channel):
            valve.setpoint = volts / 5.0 * self._full_scale
        return channel, f'OK {channel} {volts:.3f}'


EMULATORS: dict[str, type[AlicatEmulator | SmcItvEmulator | SerialTextEmulator]] = {
    'alicat': AlicatEmulator,
    'smc_itv': SmcItvEmulator,
    'serial_text': SerialTextEmulator,
}
"""The emulator of each backend."""
