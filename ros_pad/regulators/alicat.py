# SPDX-License-Identifier: Apache-2.0
"""Alicat pressure controllers (PC, PCD) on their ASCII protocol."""

from __future__ import annotations

import math
import re

from ros_pad.contact.pad import choice
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.regulators.channel import Frame
from ros_pad.regulators.channel import SerialRegulator
from ros_pad.regulators.channel import unit
from ros_pad.regulators.transport import Ask
from ros_pad.regulators.transport import Line

STATUS = {
    'ADC': 'ADC (analogue converter failed)',
    'EXH': 'EXH (exhausting)',
    'HLD': 'HLD (valves held)',
    'LCK': 'LCK (front panel locked)',
    'MOV': 'MOV (flow out of range)',
    'OPL': 'OPL (over pressure limit)',
    'OVR': 'OVR (totaliser overflowed)',
    'POV': 'POV (pressure out of range)',
    'TMF': 'TMF (totaliser missed flow)',
    'TOV': 'TOV (temperature out of range)',
    'VOV': 'VOV (volume flow out of range)',
}
"""What the letters after a frame mean, from the maker's manuals."""

HARMLESS = ('LCK',)
"""A locked front panel keeps fingers off, and is no fault."""

KNOWS_UNITS = (9, 0)  # firmware from which LS sets and answers with a unit
KNOWS_SOURCE = (10, 5)  # firmware from which LSS exists
_NUMBER = re.compile(r'[+-]?\d+(?:\.(\d*))?')


class AlicatRegulator(SerialRegulator):
    """One Alicat pressure controller; several with other unit IDs may share the port.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyUSB0``.
    unit_id : str
        A to Z.
    units : str
        Engineering units that the device is set to, gauge: a key of ``channel.UNITS``. Where
        its firmware can be asked (9v00 and later), another one is an error.
    baudrate : int
        1/s. 19200 as delivered, 38400 in the BC series.
    set_command : str
        ``'LS'``, ``'S'``, or ``'auto'``: LS where the firmware knows it (9v00 and later).
    ceiling : float
        Highest set-point, gauge Pa.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.channel.SerialRegulator`.

    Notes
    -----
    Frames have a unit ID, the pressure, the set-point and status letters. Other columns are
    refused rather than guessed at: take them out of the data frame on the device.

    ``LS value unit`` sets in the unit that the device was met with, and its answer names value
    and unit: a device that was set to another one meanwhile is told zero, and is lost until it
    is back. ``S``, which every firmware knows, is answered by a frame. Both carry the decimals
    of the live frame. ``LS`` is never sent to a firmware below 9v00: that would take ``L`` for
    the lock of the front panel. Nothing is ever told to save: the device's memory wears. An
    analogue set-point source ignores this line without a word; ``LSS`` tells of it from 10v05
    on, and for all others the echo does.

    A vent is the set-point zero; a device that holds its valves (HLD) is then told to let go.
    The exhaust command is not used: no manual at hand says how it is left again.

    Source: Alicat's manuals (frame, status, ``S``, ``C``) and what two independent drivers say
    of firmware (``LS``, ``LSS``, ``VE``); see docs/regulators.md.
    """

    def __init__(
        self,
        port: str,
        unit_id: str = 'A',
        units: str = 'kPa',
        baudrate: int = 19200,
        set_command: str = 'auto',
        ceiling: float = 90e3,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        if not isinstance(unit_id, str) or not re.fullmatch('[A-Z]', unit_id):
            raise InvalidInput(f'unit_id = {unit_id!r} is not allowed: A to Z is needed')
        self._unit = unit(units)
        self._units = units
        self._set_command = choice('set_command', set_command, ('auto', 'LS', 'S'))
        self._unit_code = ''  # of the device for its units; empty where it is set by S
        self._decimals = 0
        self._held = False
        line = Line(port, baudrate, '\r', reply_timeout)
        super().__init__(line, unit_id, ceiling, poll_period, silence)

    def _meet(self, ask: Ask) -> Frame:
        frame = self._poll(ask)
        command = f'{self.address}VE'
        version = re.search(r'\b(\d+)v(\d+)', ask(command))
        firmware = (int(version[1]), int(version[2])) if version else (0, 0)
        self._unit_code = ''
        if self._set_command == 'LS' or firmware >= KNOWS_UNITS:
            command = f'{self.address}LS'
            _, code = self._set_in(command, self._ask(ask, command))
            if self._set_command != 'S':
                self._unit_code = code
        if firmware >= KNOWS_SOURCE:
            self._check_source(ask)
        return frame

    def _poll(self, ask: Ask) -> Frame:
        return self._frame_in(self.address, ask(self.address))

    def _set(self, ask: Ask, setpoint: float) -> Frame | None:
        release = self._held and setpoint == 0.0
        frame = self._send(ask, f'{setpoint / self._unit:.{self._decimals}f}')
        if release:  # after zero is in force, or what was held would go on at the old set-point
            command = f'{self.address}C'
            frame = self._frame_in(command, self._ask(ask, command))
        return frame

    def _send(self, ask: Ask, value: str) -> Frame | None:
        if not self._unit_code:
            command = f'{self.address}S{value}'
            return self._frame_in(command, self._ask(ask, command))
        command = f'{self.address}LS {value} {self._unit_code}'
        reply = self._ask(ask, command)
        try:
            requested, _ = self._set_in(command, reply)
        except ConfigError:
            self._ask(ask, f'{self.address}S0')  # no pressure whatever the units
            raise
        if requested != float(value):
            raise self._refuses(f'{value} was sent, {requested:g} is in force', command, reply)
        return None

    def _obeys(self, frame: Frame, setpoint: float) -> bool:
        held = self._held and setpoint == 0.0
        return super()._obeys(frame, setpoint) and not held

    def _ask(self, ask: Ask, command: str) -> str:
        reply = ask(command)
        if reply == '?' or reply.split() == [self.address, '?']:
            raise self._refuses('rejected', command, reply)
        return reply

    def _words(self, command: str, reply: str) -> list[str]:
        words = reply.split()
        if words[:1] != [self.address]:
            raise self._fails(f'not a reply of unit {self.address}', command, reply)
        return words[1:]

    def _frame_in(self, command: str, reply: str) -> Frame:
        words = self._words(command, reply)
        numbers = [match for word in words if (match := _NUMBER.fullmatch(word))]
        status = words[len(numbers) :]
        if len(numbers) != 2 or not set(status) <= set(STATUS):
            raise self._fails(
                f'not a frame of pressure, set-point and status: {len(numbers)} numbers',
                command,
                reply,
            )
        pressure, setpoint = (float(each[0]) * self._unit for each in numbers)
        self._decimals = len(numbers[1][1] or '')
        self._held = 'HLD' in status
        resolution = math.pow(10.0, -self._decimals) * self._unit
        faults = tuple(STATUS[each] for each in status if each not in HARMLESS)
        return Frame(pressure, setpoint, resolution, faults)

    def _set_in(self, command: str, reply: str) -> tuple[float, str]:
        """Return the set-point and the code of the units in an answer to ``LS``."""
        words = self._words(command, reply)
        if len(words) != 4 or not all(map(_NUMBER.fullmatch, words[:2])) or not words[2].isdigit():
            raise self._fails('not two numbers, a code and a unit', command, reply)
        _, requested, code, label = words
        # G stands for gauge. Without it a device may mean differential, A or D are no gauge.
        if label.lower() not in (self._units.lower(), f'{self._units}g'.lower()):
            raise ConfigError(
                f'units = {self._units!r} is not allowed: the device is set to {label}: port'
                f' {self._line.port}, command {command!r}, reply {reply!r}'
            )
        return float(requested), code

    def _check_source(self, ask: Ask) -> None:
        command = f'{self.address}LSS'
        reply = self._ask(ask, command)
        if self._words(command, reply)[-1:] == ['A']:
            raise self._refuses(
                'the set-point source is analogue, set-points on this line are ignored; set it'
                ' to serial on the device',
                command,
                reply,
            )
