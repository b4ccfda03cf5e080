# SPDX-License-Identifier: Apache-2.0
"""SMC ITV electro-pneumatic regulators with RS-232C, as field programs talk to them."""

from __future__ import annotations

from ros_pad.contact.pad import number
from ros_pad.regulators.channel import Frame
from ros_pad.regulators.channel import SerialRegulator
from ros_pad.regulators.transport import Ask
from ros_pad.regulators.transport import Line

FULL_COUNT = 1023
"""The setting that is the full scale: 10 bit."""


class SmcItvRegulator(SerialRegulator):
    """One SMC ITV on a port of its own.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyUSB0``.
    full_scale : float
        Gauge Pa of the setting 1023, from the type plate, 1e3 to 1e7. The device cannot be
        asked.
    baudrate : int
        1/s.
    ceiling : float
        Highest set-point, gauge Pa, up to ``full_scale``.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.channel.SerialRegulator`.

    Notes
    -----
    ``SET n`` is echoed by n, ``REQ`` answers the setting and ``MON`` the output, all from 0 to
    1023, and ``UNKNOWN COMMAND`` is a rejection. All this is taken from two independent field
    programs; the maker's manual was not found. The device reports no faults.
    """

    def __init__(
        self,
        port: str,
        full_scale: float,
        baudrate: int = 9600,
        ceiling: float = 90e3,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        full_scale = number('full_scale', full_scale, 'Pa', 1e3, 1e7)
        number('ceiling', ceiling, 'Pa', 1.0, full_scale)
        self._count = full_scale / FULL_COUNT
        line = Line(port, baudrate, '\r\n', reply_timeout)
        super().__init__(line, 'ITV', ceiling, poll_period, silence)

    def _meet(self, ask: Ask) -> Frame:
        return self._poll(ask)

    def _poll(self, ask: Ask) -> Frame:
        setting, output = (self._asked(ask, command) for command in ('REQ', 'MON'))
        return Frame(output * self._count, setting * self._count, self._count)

    def _set(self, ask: Ask, setpoint: float) -> None:
        setting = round(setpoint / self._count)
        command = f'SET {setting}'
        echo = self._asked(ask, command)
        if echo != setting:
            raise self._refuses(f'{setting} was sent, {echo} is in force', command, str(echo))

    def _asked(self, ask: Ask, command: str) -> int:
        reply = ask(command)
        if reply == 'UNKNOWN COMMAND':
            raise self._refuses('rejected', command, reply)
        if not reply.isdecimal() or int(reply) > FULL_COUNT:
            raise self._fails(f'not a number from 0 to {FULL_COUNT}', command, reply)
        return int(reply)
