# SPDX-License-Identifier: Apache-2.0
"""The interface of all pressure regulators, real or simulated."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from ros_pad.configuration import number
from ros_pad.errors import LimitError

CEILING = 90e3
"""Highest set-point of a regulator unless its options give another one, gauge Pa."""


class Reading(NamedTuple):
    """State of a regulator at one moment.

    Parameters
    ----------
    pressure : float
        Measured pressure, gauge Pa.
    setpoint : float
        Set-point in force, gauge Pa.
    faults : tuple of str
        Faults that the device reports, as the device names them; empty when there are none.
    time : float
        Time of the reading, s, on the clock of the backend.
    """

    pressure: float
    setpoint: float
    faults: tuple[str, ...]
    time: float


@runtime_checkable
class Regulator(Protocol):
    """One channel of a pressure regulator.

    All pressures are gauge Pa. Open a regulator, command and read it, vent it, and close it. While
    it is closed, all methods but ``open`` and ``close`` raise ``TransportError``. To open an open
    regulator or to close a closed one does nothing.
    """

    @property
    def ceiling(self) -> float:
        """Highest accepted set-point, gauge Pa."""

    def open(self) -> None:
        """Connect to the device. Its set-point does not change.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device does not answer, or is not as the options say.
        """

    def set_pressure(self, gauge_pa: float) -> None:
        """Command a pressure.

        Parameters
        ----------
        gauge_pa : float
            Set-point, gauge Pa, 0 to ``ceiling``.

        Raises
        ------
        InvalidInput
            When it is not a finite number, or negative.
        LimitError
            When it is above the ceiling. In both cases the old set-point stays in force.
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device cannot be reached.
        """

    def read(self) -> Reading:
        """Return the present state of the device; raise as :meth:`vent` does."""

    def vent(self) -> None:
        """Command zero gauge pressure at once.

        Raises
        ------
        TransportError, ProtocolError, DeviceFault, ConfigError
            When the device cannot be reached.
        """

    def close(self) -> None:
        """Disconnect from the device.

        Call ``vent`` before. Backends on a serial line vent here too, and raise if that fails; the
        simulated one does not.
        """


def permitted(gauge_pa: float, ceiling: float) -> float:
    """Return a set-point as a float if a regulator with this ceiling accepts it.

    Raises
    ------
    InvalidInput
        When it is not a finite number, or negative.
    LimitError
        When it is above the ceiling.
    """
    setpoint = number('set-point', gauge_pa, f'Pa gauge and at most {ceiling:g} Pa')
    if setpoint > ceiling:
        raise LimitError(
            f'set-point {setpoint:g} Pa is refused: it is above the ceiling of {ceiling:g} Pa'
            ' gauge; the old set-point stays in force'
        )
    return setpoint
