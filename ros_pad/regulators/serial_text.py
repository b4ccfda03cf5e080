# SPDX-License-Identifier: Apache-2.0
"""Boards that drive regulators and speak in lines of text: what they say is set by options."""

from __future__ import annotations

import math
import re

from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.regulators.channel import Frame
from ros_pad.regulators.channel import SerialRegulator
from ros_pad.regulators.transport import Ask
from ros_pad.regulators.transport import Line

_VALUE = r'[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?'
_FIELD = re.compile(r'\{(channel|value(?::(?:\.(\d)f|d))?)\}')


class SerialTextRegulator(SerialRegulator):
    """One channel of a board, for instance of DACs that drive SMC ITV; others may share its port.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyACM0``.
    channel : int
        0 to 99.
    set_template : str
        Line that sets; ``{channel}`` stands for the channel, ``{value:.3f}`` for the value with 3
        decimals (0 to 9), ``{value:d}`` for a whole number.
    set_reply : str
        What the board answers then, with the same fields; ``{value}`` is compared with what
        was sent. Empty when it answers nothing.
    read_template, read_reply : str
        Line that asks for the measured value, and its answer; ``{value}`` is any number.
    terminator : str
        What ends a line, both ways: 1 to 4 ASCII characters.
    command_zero, command_full : float
        Value that sets 0 Pa, and the one that sets ``full_scale``: volts, counts, kPa, whatever
        the board speaks. Different ones.
    monitor_zero, monitor_full : float
        Value that is read at 0 Pa, and the one at ``full_scale``. Different ones.
    full_scale : float
        Gauge Pa, 1e3 to 1e7.
    baudrate : int
        1/s.
    ceiling : float
        Highest set-point, gauge Pa, up to ``full_scale``.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.channel.SerialRegulator`.

    Notes
    -----
    Between the two points of a calibration values are linear in the pressure. The board is not
    asked for its set-point: what is in force is what was last sent and not refused, and NaN
    before. A reply other than ``set_reply`` is a refusal.

    A board that restarts has forgotten its set-point, and nobody is told while the line stays
    up; one that restarts because its port is opened is told at the first set-point.
    """

    def __init__(
        self,
        port: str,
        channel: int = 1,
        set_template: str = 'SET {channel} {value:.3f}',
        set_reply: str = 'OK {channel} {value}',
        read_template: str = 'READ {channel}',
        read_reply: str = '{channel} {value}',
        terminator: str = '\n',
        command_zero: float = 0.0,
        command_full: float = 5.0,
        monitor_zero: float = 1.0,
        monitor_full: float = 5.0,
        full_scale: float = 100e3,
        baudrate: int = 115200,
        ceiling: float = 90e3,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        if not isinstance(channel, int) or isinstance(channel, bool) or not 0 <= channel <= 99:
            raise InvalidInput(f'channel = {channel!r} is not allowed: 0 to 99 is needed')
        text = isinstance(terminator, str) and terminator.isascii()
        if not text or not 1 <= len(terminator) <= 4:
            raise InvalidInput(
                f'terminator = {terminator!r} is not allowed: 1 to 4 ASCII characters are needed'
            )
        self._full_scale = number('full_scale', full_scale, 'Pa', 1e3, 1e7)
        number('ceiling', ceiling, 'Pa', 1.0, full_scale)
        self._command = _scale('command', command_zero, command_full)
        self._monitor = _scale('monitor', monitor_zero, monitor_full)
        for name, template, values in [
            ('set_template', set_template, (1,)),
            ('set_reply', set_reply, (0, 1)),
            ('read_template', read_template, (0,)),
            ('read_reply', read_reply, (1,)),
        ]:
            _check(name, template, values)
        found = [each for each in _FIELD.finditer(set_template) if each[1] != 'channel']
        if found[0][1] == 'value':
            raise InvalidInput(
                f'set_template = {set_template!r} is not allowed: how many decimals? {{value:.3f}}'
                ' or {value:d} is needed'
            )
        self._decimals = int(found[0][2] or 0)
        if round(self._command[0], self._decimals) != self._command[0]:
            raise InvalidInput(
                f'command_zero = {command_zero!r} is not allowed: set_template has'
                f' {self._decimals} decimals, and a vent must be exact'
            )
        self._set_template = set_template
        self._read_command = _filled(read_template, channel, '')
        self._set_reply = _pattern(set_reply, channel) if set_reply else None
        self._read_reply = _pattern(read_reply, channel)
        self._channel = channel
        self._in_force = math.nan
        step = 10.0**-self._decimals * full_scale / abs(self._command[1])
        if step > full_scale / 10.0:
            raise InvalidInput(
                f'set_template = {set_template!r} is not allowed: its step is {step:g} Pa, too'
                f' coarse for a full_scale of {full_scale:g} Pa'
            )
        self._resolution = step
        line = Line(port, baudrate, terminator, reply_timeout)
        super().__init__(line, f'channel {channel}', ceiling, poll_period, silence)

    def _meet(self, ask: Ask) -> Frame:
        self._in_force = math.nan
        return self._poll(ask)

    def _poll(self, ask: Ask) -> Frame:
        reply = ask(self._read_command)
        found = self._read_reply.fullmatch(reply)
        if not found:
            raise self._fails('not a reply as read_reply has it', self._read_command, reply)
        zero, span = self._monitor
        pressure = (float(found['value']) - zero) / span * self._full_scale
        if not math.isfinite(pressure):  # 1e999 is a number to the pattern, and infinite here
            raise self._fails('not a pressure', self._read_command, reply)
        return Frame(pressure, self._in_force, self._resolution)

    def _set(self, ask: Ask, setpoint: float) -> None:
        zero, span = self._command
        value = f'{zero + setpoint / self._full_scale * span:.{self._decimals}f}'
        command = _filled(self._set_template, self._channel, value)
        self._in_force = math.nan
        reply = ask(command, reply=self._set_reply is not None)
        if self._set_reply:
            found = self._set_reply.fullmatch(reply)
            if not found:
                raise self._refuses('not a reply as set_reply has it', command, reply)
            echo = float(found.groupdict().get('value', value))
            if not abs(echo - float(value)) < 0.5 * 10.0**-self._decimals:
                raise self._refuses(f'{value} was sent, {echo:g} is in force', command, reply)
        self._in_force = setpoint


def _scale(name: str, zero: float, full: float) -> tuple[float, float]:
    """Return the value at 0 Pa and the span to the one at full scale."""
    low = number(f'{name}_zero', zero, '', -math.inf)
    high = number(f'{name}_full', full, '', -math.inf)
    if low == high:
        raise InvalidInput(
            f'{name}_full = {full!r} is not allowed: another value than {name}_zero is needed'
        )
    return low, high - low


def _check(name: str, template: str, values: tuple[int, ...]) -> None:
    """Refuse what is no template, or has not as many values as it may."""
    if isinstance(template, str) and template.isascii():
        fields = [each[1] for each in _FIELD.finditer(template)]
        known = not re.search('[{}]', _FIELD.sub('', template))
        if known and len(fields) - fields.count('channel') in values:
            return
    needed = ' or '.join(map(str, values))
    raise InvalidInput(
        f'{name} = {template!r} is not allowed: ASCII text with {needed} {{value}} is needed, and'
        ' {channel} where the board has several'
    )


def _filled(template: str, channel: int, value: str) -> str:
    return _FIELD.sub(lambda each: str(channel) if each[1] == 'channel' else value, template)


def _pattern(template: str, channel: int) -> re.Pattern[str]:
    """Return what matches a reply; group ``value`` is the value."""
    parts = []
    end = 0
    for each in _FIELD.finditer(template):
        parts.append(re.escape(template[end : each.start()]))
        parts.append(str(channel) if each[1] == 'channel' else f'(?P<value>{_VALUE})')
        end = each.end()
    return re.compile(''.join(parts) + re.escape(template[end:]))
