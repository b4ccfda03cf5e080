# SPDX-License-Identifier: Apache-2.0
"""Boards that drive regulators and receive lines of text, whose format the options set."""

from __future__ import annotations

import math
import re

from ros_pad.configuration import integer, number, text
from ros_pad.errors import DeviceFault, InvalidInput, ProtocolError
from ros_pad.regulators.protocol import CEILING
from ros_pad.regulators.serial_device import Frame, Query, SerialLine, SerialRegulator

FULL_COUNT = 1023
"""Setting of an SMC ITV at full scale: 10 bits."""

_VALUE = r'[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?'
_FIELD = re.compile(r'\{(channel|value(?::(?:\.(\d)f|d))?)\}')


class SerialTextRegulator(SerialRegulator):
    """One channel of a board, for instance one with DACs that drive SMC ITV.

    Several channels of a board share its port.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyACM0``.
    channel : int
        0 to 99.
    set_template : str
        Command that sets a pressure. ``{channel}`` stands for the channel, ``{value:.3f}`` for
        the value with 3 decimals (0 to 9), ``{value:d}`` for a whole number.
    set_reply : str
        Reply to ``set_template``, with the same fields; its ``{value}`` is compared with the value
        that was sent. Empty when the board sends no reply.
    read_template, read_reply : str
        Command that requests the measured value, and the reply to it, in which ``{value}`` is any
        number, and ``{value:d}``, as in ``set_reply``, a whole one without a sign between the
        values at 0 Pa and at ``full_scale``.
    setpoint_template : str
        Command that requests the set-point in force; the reply is as to ``set_template``. Empty
        when the board does not report it.
    rejection : str
        Reply to any command that the board rejects. Empty when it has none.
    terminator : str
        End of a line, in both directions: 1 to 4 ASCII characters.
    command_zero, command_full : float
        Values that set 0 Pa and ``full_scale``, in the unit of the board (V, counts, kPa); they
        must differ.
    monitor_zero, monitor_full : float
        Values that are read at 0 Pa and at ``full_scale``; they must differ.
    full_scale : float
        Pressure at full scale, gauge Pa, 1e3 to 1e7.
    baudrate : int
        1/s, 300 to 4,000,000.
    ceiling : float
        Highest set-point, gauge Pa, 1 to ``full_scale``.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.serial_device.SerialRegulator`.

    Notes
    -----
    Values are linear in the pressure. If the board does not report its set-point, the last one
    that was sent and not refused counts as in force; before the first one it is NaN. A reply other
    than ``set_reply`` is a refusal.

    A board that restarts loses its set-point, which is then not detected while its port stays
    open. If opening the port restarts the board, it receives its first set-point after that.
    """

    def __init__(
        self,
        port: str,
        channel: int = 1,
        set_template: str = 'SET {channel} {value:.3f}',
        set_reply: str = 'OK {channel} {value}',
        read_template: str = 'READ {channel}',
        read_reply: str = '{channel} {value}',
        setpoint_template: str = '',
        rejection: str = '',
        terminator: str = '\n',
        command_zero: float = 0.0,
        command_full: float = 5.0,
        monitor_zero: float = 1.0,
        monitor_full: float = 5.0,
        full_scale: float = 100e3,
        baudrate: int = 115200,
        ceiling: float = CEILING,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        integer('channel', channel, 0, 99)
        if not text('terminator', terminator).isascii() or not 1 <= len(terminator) <= 4:
            raise InvalidInput(
                f'terminator = {terminator!r} is not allowed: 1 to 4 ASCII characters are needed'
            )
        for name, template, values in [
            ('set_template', set_template, (1,)),
            ('set_reply', set_reply, (1,) if setpoint_template else (0, 1)),
            ('read_template', read_template, (0,)),
            ('read_reply', read_reply, (1,)),
            ('setpoint_template', setpoint_template, (0,)),
        ]:
            _check(name, template, values)
        self._full_scale = number('full_scale', full_scale, 'Pa', 1e3, 1e7)
        number('ceiling', ceiling, 'Pa', 1.0, full_scale)
        self._command = _scale('command', command_zero, command_full)
        self._monitor = _scale('monitor', monitor_zero, monitor_full)
        self._decimals = _decimals(set_template, command_zero)
        self._resolution = 10.0**-self._decimals * full_scale / abs(self._command[1])
        if self._resolution > full_scale / 10.0:
            raise InvalidInput(
                f'set_template = {set_template!r} is not allowed: its step is'
                f' {self._resolution:g} Pa, and at most a tenth of full_scale ='
                f' {full_scale:g} Pa is allowed; use more decimals'
            )
        self._set_template = set_template
        self._read_command = _filled(read_template, channel, '')
        self._setpoint_command = _filled(setpoint_template, channel, '')
        self._rejection = text('rejection', rejection)
        self._answers = bool(set_reply)
        self._set_reply = _pattern(set_reply, channel)
        self._read_reply = _pattern(read_reply, channel)
        self._channel = channel
        self._in_force = math.nan
        line = SerialLine(port, baudrate, terminator, reply_timeout)
        super().__init__(line, f'channel {channel}', ceiling, poll_period, silence)

    def identify(self, query: Query) -> Frame:
        """Return a frame without a set-point; the board has no identity to check."""
        self._in_force = math.nan
        return self.poll(query)

    def poll(self, query: Query) -> Frame:
        """Request the measured value, and the set-point if the board reports it."""
        if self._setpoint_command:
            known = (self._setpoint_command, self._set_reply, self._command)
            self._in_force = self._requested_value(query, *known)
        pressure = self._requested_value(
            query, self._read_command, self._read_reply, self._monitor
        )
        return Frame(pressure, self._in_force, self._resolution)

    def _requested_value(
        self, query: Query, command: str, form: re.Pattern[str], scale: tuple[float, float]
    ) -> float:
        """Return the pressure that a board answers to a command, gauge Pa."""
        reply, (zero, span) = query(command), scale
        self._check_rejection(command, reply)
        found = form.fullmatch(reply)
        pressure = (float(found['value']) - zero) / span * self._full_scale if found else math.nan
        # The pattern accepts 1e999, which is infinite.
        if not found or not math.isfinite(pressure):
            what = f'the reply does not match {form.pattern!r} with a finite value'
            raise self.error(ProtocolError, what, command, reply)
        self._check_count(found, scale, command, reply)
        return pressure

    def _check_rejection(self, command: str, reply: str) -> None:
        if self._rejection and reply == self._rejection:
            raise self.error(DeviceFault, 'the device rejected the command', command, reply)

    def _check_count(
        self, found: re.Match[str], scale: tuple[float, float], command: str, reply: str
    ) -> None:
        """Refuse a whole number beyond its scale: it is a garbled reply."""
        low, high = sorted((scale[0], sum(scale)))
        if 'count' in found.groupdict() and not low <= float(found['count']) <= high:
            what = f'the reply is not a whole number from {low:g} to {high:g}'
            raise self.error(ProtocolError, what, command, reply)

    def send(self, query: Query, setpoint: float) -> None:
        """Send a set-point, gauge Pa, and check the reply if there is one."""
        zero, span = self._command
        value = f'{zero + setpoint / self._full_scale * span:.{self._decimals}f}'
        command = _filled(self._set_template, self._channel, value)
        self._in_force = math.nan
        reply = query(command, reply=self._answers)
        if self._answers:
            self._check_rejection(command, reply)
            found = self._set_reply.fullmatch(reply)
            if not found:
                what = 'the reply does not match set_reply'
                raise self.error(DeviceFault, what, command, reply)
            self._check_count(found, self._command, command, reply)
            echo = float(found.groupdict().get('value', value))
            if not abs(echo - float(value)) < 0.5 * 10.0**-self._decimals:
                what = f'value {value} was sent, {echo:g} is in force'
                raise self.error(DeviceFault, what, command, reply)
        self._in_force = setpoint


def smc_itv(
    port: str,
    full_scale: float,
    baudrate: int = 9600,
    ceiling: float = CEILING,
    reply_timeout: float = 0.1,
    poll_period: float = 0.02,
    silence: float = 0.5,
) -> SerialTextRegulator:
    """Return one SMC ITV with RS-232C, on a port of its own.

    ``full_scale`` is the gauge pressure at the setting 1023, Pa, from the type plate: the device
    does not report it. The other options are those of :class:`SerialTextRegulator`.

    The reply to ``SET n`` is n, to ``REQ`` the setting and to ``MON`` the output, all from 0 to
    1023; ``UNKNOWN COMMAND`` is a rejection. The device reports no faults. Source: two independent
    field programs; the maker's manual was not found.
    """
    regulator = SerialTextRegulator(
        port,
        set_template='SET {value:d}',
        set_reply='{value:d}',
        read_template='MON',
        read_reply='{value:d}',
        setpoint_template='REQ',
        rejection='UNKNOWN COMMAND',
        terminator='\r\n',
        command_full=FULL_COUNT,
        monitor_zero=0.0,
        monitor_full=FULL_COUNT,
        full_scale=full_scale,
        baudrate=baudrate,
        ceiling=ceiling,
        reply_timeout=reply_timeout,
        poll_period=poll_period,
        silence=silence,
    )
    regulator.address = 'ITV'  # it has no channels
    return regulator


def _decimals(set_template: str, command_zero: float) -> int:
    """Return the decimals of the value in a template, which must express a vent exactly."""
    values = [each[2] for each in _FIELD.finditer(set_template) if each[1] != 'channel']
    decimals = int(values[0] or 0)
    if round(command_zero, decimals) != command_zero:
        raise InvalidInput(
            f'command_zero = {command_zero!r} is not allowed: set_template has {decimals}'
            ' decimals, which must express the value of a vent exactly'
        )
    return decimals


def _scale(name: str, zero: float, full: float) -> tuple[float, float]:
    """Return the value at 0 Pa, and the value at full scale minus that at 0 Pa."""
    low = number(f'{name}_zero', zero, '', -math.inf)
    high = number(f'{name}_full', full, '', -math.inf)
    if low == high:
        raise InvalidInput(
            f'{name}_full = {full!r} is not allowed: it must differ from {name}_zero'
        )
    return low, high - low


def _check(name: str, template: str, values: tuple[int, ...]) -> None:
    """Refuse a text that is not a template, or has another number of values than allowed."""
    if isinstance(template, str) and template.isascii():
        fields = [each[1] for each in _FIELD.finditer(template)]
        known = not re.search('[{}]', _FIELD.sub('', template))
        if known and len(fields) - fields.count('channel') in values:
            return
    needed = ' or '.join(map(str, values))
    raise InvalidInput(
        f'{name} = {template!r} is not allowed: ASCII text with {needed} {{value}} is needed, and'
        ' with {channel} if the board has several channels'
    )


def _filled(template: str, channel: int, value: str) -> str:
    return _FIELD.sub(lambda each: str(channel) if each[1] == 'channel' else value, template)


def _pattern(template: str, channel: int) -> re.Pattern[str]:
    """Return the pattern of a reply; its group ``value``, or also ``count``, is the value."""
    parts = []
    end = 0
    for each in _FIELD.finditer(template):
        parts.append(re.escape(template[end : each.start()]))
        number = '(?P<count>[0-9]+)' if each[1] == 'value:d' else _VALUE
        parts.append(str(channel) if each[1] == 'channel' else f'(?P<value>{number})')
        end = each.end()
    return re.compile(''.join(parts) + re.escape(template[end:]))
