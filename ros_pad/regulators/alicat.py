# SPDX-License-Identifier: Apache-2.0
"""Alicat pressure controllers (PC, PCD) with their ASCII protocol."""

from __future__ import annotations

import math
import re

from ros_pad.configuration import choice
from ros_pad.errors import ConfigError, DeviceFault, InvalidInput, ProtocolError
from ros_pad.regulators.protocol import CEILING
from ros_pad.regulators.serial_device import Frame, Query, SerialLine, SerialRegulator, unit

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
"""Status letters after a frame, with their meaning in the maker's manuals."""

UNITS_SINCE = (9, 0)  # first firmware whose LS has a unit in command and answer
SOURCE_SINCE = (10, 5)  # first firmware with LSS
_NUMBER = re.compile(r'[+-]?\d+(?:\.(\d*))?')


class AlicatRegulator(SerialRegulator):
    """One Alicat pressure controller; several with different unit IDs may share a port.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyUSB0``.
    unit_id : str
        One letter from A to Z.
    units : str
        Engineering units of the device, gauge: a key of ``serial_device.UNITS``. With firmware
        9v00 or later they are compared with those of the device; a difference is an error.
    baudrate : int
        1/s, 300 to 4,000,000. Delivered devices have 19200, those of the BC series 38400.
    set_command : str
        ``'auto'``: LS with firmware 9v00 or later, S with an older one; or ``'S'``, for a device
        that rejects LS with a unit.
    ceiling : float
        Highest set-point, gauge Pa, 1 to 1e7.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.serial_device.SerialRegulator`.

    Notes
    -----
    A frame has a unit ID, the pressure, the set-point and status letters. Frames with other
    columns are refused: remove these from the data frame on the device.

    ``LS value unit`` sets a pressure in the units found at identification; the reply contains
    value and units. A device whose units were changed since then is set to zero, and is lost until
    its units are as before. The reply to ``S``, which every firmware has, is a frame. Values sent
    with ``LS`` and ``S`` have the decimals of the last frame. ``LS`` is never sent
    to firmware below 9v00, which reads ``L`` as the lock of the front panel. No command saves
    settings, because that wears the device's memory. A device with an analogue set-point source
    ignores set-points without an error; ``LSS`` detects that from 10v05 on, and the echo of the
    set-point on older firmware.

    A vent is the set-point zero; the valves of a device that holds them (HLD) are then released.
    The exhaust command is not used: no manual at hand describes how to end it.

    Source: Alicat's manuals (frame, status, ``S``, ``C``) and two independent drivers for the
    firmware (``LS``, ``LSS``, ``VE``); see docs/regulators.md.
    """

    def __init__(
        self,
        port: str,
        unit_id: str = 'A',
        units: str = 'kPa',
        baudrate: int = 19200,
        set_command: str = 'auto',
        ceiling: float = CEILING,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        if not isinstance(unit_id, str) or not re.fullmatch('[A-Z]', unit_id):
            raise InvalidInput(
                f'unit_id = {unit_id!r} is not allowed: one letter from A to Z is needed'
            )
        self._unit = unit(units)
        self._units = units
        self._plain = choice('set_command', set_command, ('auto', 'S')) == 'S'
        self._unit_code = ''  # code of the device's units; empty when S sets the pressure
        self._decimals = 0
        self._held = False
        line = SerialLine(port, baudrate, '\r', reply_timeout)
        super().__init__(line, unit_id, ceiling, poll_period, silence)

    def identify(self, query: Query) -> Frame:
        """Check units and set-point source as far as the firmware reports them; return a frame."""
        frame = self.poll(query)
        version = re.search(r'\b(\d+)v(\d+)', query(f'{self.address}VE'))
        firmware = (int(version[1]), int(version[2])) if version else (0, 0)
        self._unit_code = ''
        if firmware >= UNITS_SINCE:
            _, code = self._setpoint_in(*self._sent(query, 'LS'))
            self._unit_code = '' if self._plain else code
        if firmware >= SOURCE_SINCE:
            command, reply = self._sent(query, 'LSS')
            if self._words(command, reply)[-1:] == ['A']:
                what = 'the set-point source of the device is analogue: set it to serial'
                raise self.error(DeviceFault, what, command, reply)
        return frame

    def poll(self, query: Query) -> Frame:
        """Request a frame and return it."""
        return self._frame_in(self.address, query(self.address))

    def send(self, query: Query, setpoint: float) -> Frame | None:
        """Send a set-point, gauge Pa; for a vent, also release valves that are held."""
        release, value = self._releases(setpoint), f'{setpoint / self._unit:.{self._decimals}f}'
        frame = None
        if self._unit_code:
            self._send_with_unit(query, value)
        else:
            frame = self._frame_in(*self._sent(query, f'S{value}'))
        if release:  # after the set-point, because released valves follow the one in force
            frame = self._frame_in(*self._sent(query, 'C'))
        return frame

    def _send_with_unit(self, query: Query, value: str) -> None:
        command, reply = self._sent(query, f'LS {value} {self._unit_code}')
        try:
            requested, _ = self._setpoint_in(command, reply)
        except ConfigError:
            self._sent(query, 'S0')  # zero is the same in all units
            raise
        if requested != float(value):
            what = f'set-point {value} was sent, {requested:g} is in force'
            raise self.error(DeviceFault, what, command, reply)

    def in_force(self, frame: Frame, setpoint: float) -> bool:
        """Return whether a frame shows a set-point; False for a vent while valves are held."""
        return super().in_force(frame, setpoint) and not self._releases(setpoint)

    def _releases(self, setpoint: float) -> bool:
        """Return whether a set-point has to release valves that are held."""
        return self._held and setpoint == 0.0

    def _sent(self, query: Query, order: str) -> tuple[str, str]:
        """Send an order; return command and reply; raise if the device rejects it."""
        command = f'{self.address}{order}'
        reply = query(command)
        if reply == '?' or reply.split() == [self.address, '?']:
            raise self.error(DeviceFault, 'the device rejected the command', command, reply)
        return command, reply

    def _words(self, command: str, reply: str) -> list[str]:
        """Return the words of a reply after the unit ID."""
        words = reply.split()
        if words[:1] != [self.address]:
            what = f'the reply is not of unit {self.address}'
            raise self.error(ProtocolError, what, command, reply)
        return words[1:]

    def _frame_in(self, command: str, reply: str) -> Frame:
        words = self._words(command, reply)
        numbers = [match for word in words if (match := _NUMBER.fullmatch(word))]
        status = words[len(numbers) :]
        if len(numbers) != 2 or not set(status) <= set(STATUS):
            what = (
                'the reply is not a frame of pressure, set-point and known status letters; remove'
                ' other columns from the data frame on the device'
            )
            raise self.error(ProtocolError, what, command, reply)
        pressure, setpoint = (float(each[0]) * self._unit for each in numbers)
        self._decimals = len(numbers[1][1] or '')
        self._held = 'HLD' in status
        resolution = math.pow(10.0, -self._decimals) * self._unit
        # A locked front panel may be intended.
        faults = tuple(STATUS[each] for each in status if each != 'LCK')
        return Frame(pressure, setpoint, resolution, faults)

    def _setpoint_in(self, command: str, reply: str) -> tuple[float, str]:
        """Return set-point and code of the units in an answer to ``LS``."""
        words = self._words(command, reply)
        if len(words) != 4 or not all(map(_NUMBER.fullmatch, words[:2])) or not words[2].isdigit():
            what = 'the reply does not have two numbers, a code and a unit'
            raise self.error(ProtocolError, what, command, reply)
        _, requested, code, label = words
        # G means gauge; a device without a letter may be differential. A and D are never gauge.
        if label.lower() not in (self._units.lower(), f'{self._units}g'.lower()):
            raise ConfigError(
                f'units = {self._units!r} is not allowed: the device is set to {label}; change'
                f' this option or the device: port {self._line.port}, command {command!r},'
                f' reply {reply!r}'
            )
        return float(requested), code
