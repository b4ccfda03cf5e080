# SPDX-License-Identifier: Apache-2.0
"""SMC ITV electro-pneumatic regulators on RS-232C, with the commands of two field programs."""

from __future__ import annotations

from ros_pad.configuration import number
from ros_pad.errors import DeviceFault, ProtocolError
from ros_pad.regulators.protocol import CEILING
from ros_pad.regulators.serial_device import Frame, Query, SerialLine, SerialRegulator

FULL_COUNT = 1023
"""Setting at full scale: 10 bits."""


class SmcItvRegulator(SerialRegulator):
    """One SMC ITV on a port of its own.

    Parameters
    ----------
    port : str
        Serial port, e.g. ``/dev/ttyUSB0``.
    full_scale : float
        Gauge Pa at the setting 1023, from the type plate, 1e3 to 1e7. The device does not
        report it.
    baudrate : int
        1/s, 300 to 4,000,000.
    ceiling : float
        Highest set-point, gauge Pa, 1 to ``full_scale``.
    reply_timeout, poll_period, silence : float
        s; see :class:`~ros_pad.regulators.serial_device.SerialRegulator`.

    Notes
    -----
    The reply to ``SET n`` is n, to ``REQ`` the setting and to ``MON`` the output, all from 0 to
    1023; ``UNKNOWN COMMAND`` is a rejection. The device reports no faults.

    Source: two independent field programs; the maker's manual was not found.
    """

    def __init__(
        self,
        port: str,
        full_scale: float,
        baudrate: int = 9600,
        ceiling: float = CEILING,
        reply_timeout: float = 0.1,
        poll_period: float = 0.02,
        silence: float = 0.5,
    ) -> None:
        full_scale = number('full_scale', full_scale, 'Pa', 1e3, 1e7)
        number('ceiling', ceiling, 'Pa', 1.0, full_scale)
        self._count = full_scale / FULL_COUNT
        line = SerialLine(port, baudrate, '\r\n', reply_timeout)
        super().__init__(line, 'ITV', ceiling, poll_period, silence)

    def identify(self, query: Query) -> Frame:
        """Return a frame; the device has no identity to check."""
        return self.poll(query)

    def poll(self, query: Query) -> Frame:
        """Request setting and output; return a frame."""
        setting, output = (self._query_count(query, command) for command in ('REQ', 'MON'))
        return Frame(output * self._count, setting * self._count, self._count)

    def send(self, query: Query, setpoint: float) -> None:
        """Send a set-point, gauge Pa, and check the echo."""
        setting = round(setpoint / self._count)
        command = f'SET {setting}'
        echo = self._query_count(query, command)
        if echo != setting:
            what = f'setting {setting} was sent, {echo} is in force'
            raise self.error(DeviceFault, what, command, str(echo))

    def _query_count(self, query: Query, command: str) -> int:
        reply = query(command)
        if reply == 'UNKNOWN COMMAND':
            raise self.error(DeviceFault, 'the device rejected the command', command, reply)
        if not reply.isdecimal() or int(reply) > FULL_COUNT:
            what = f'the reply is not a whole number from 0 to {FULL_COUNT}'
            raise self.error(ProtocolError, what, command, reply)
        return int(reply)
