# SPDX-License-Identifier: Apache-2.0
"""What every pressure regulator does, real or simulated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real
from typing import Protocol
from typing import runtime_checkable

from ros_pad.errors import InvalidInput
from ros_pad.errors import LimitError


@dataclass(frozen=True)
class Reading:
    """What a regulator says about itself at one moment.

    Parameters
    ----------
    pressure : float
        Measured, gauge Pa.
    setpoint : float
        The command in force, gauge Pa.
    faults : tuple of str
        Faults that the device reports, in its own words; empty when all is well.
    time : float
        s, on the clock of the backend.
    """

    pressure: float
    setpoint: float
    faults: tuple[str, ...]
    time: float


@runtime_checkable
class Regulator(Protocol):
    """One channel of a pressure regulator.

    All pressures are gauge Pa. A regulator is opened, commanded and read, vented, and closed;
    between ``close`` and ``open`` only ``open`` and ``close`` are allowed, everything else
    raises ``TransportError``. Both may be repeated.
    """

    @property
    def ceiling(self) -> float:
        """The highest set-point that is accepted, gauge Pa."""

    def open(self) -> None:
        """Start the conversation with the device. The set-point stays what the device has."""

    def set_pressure(self, gauge_pa: float) -> None:
        """Command a pressure.

        Parameters
        ----------
        gauge_pa : float
            0 to ``ceiling``.

        Raises
        ------
        InvalidInput
            When it is not a finite number, or negative.
        LimitError
            When it is above the ceiling. In both cases the old set-point stays.
        """

    def read(self) -> Reading:
        """Return the present state of the device."""

    def vent(self) -> None:
        """Command zero gauge pressure at once, whatever the set-point was."""

    def close(self) -> None:
        """End the conversation.

        Call ``vent`` first: a backend may vent here too, as those on a serial line do, which
        raise where they cannot; the simulated one does not.
        """


def permitted(gauge_pa: float, ceiling: float) -> float:
    """Return a set-point as a float if a regulator with this ceiling may take it.

    Raises
    ------
    InvalidInput
        When it is not a finite number, or negative.
    LimitError
        When it is above the ceiling.
    """
    number = isinstance(gauge_pa, Real) and not isinstance(gauge_pa, bool)
    if not number or not math.isfinite(gauge_pa) or gauge_pa < 0.0:
        raise InvalidInput(
            f'set-point {gauge_pa!r} Pa is not allowed: 0 to {ceiling:g} Pa gauge is needed'
        )
    if gauge_pa > ceiling:
        raise LimitError(
            f'set-point {gauge_pa:g} Pa is above the ceiling of {ceiling:g} Pa gauge: refused, '
            'the old set-point stays'
        )
    return float(gauge_pa)
