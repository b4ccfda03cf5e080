# SPDX-License-Identifier: Apache-2.0
"""When something that runs slower than its input is due."""

from __future__ import annotations

from ros_pad.errors import InvalidInput


class Pace:
    """Tells at which time stamps a slower task is due: the first stamp in each of its periods.

    Depends on the stamps alone, so that nodes and the loop without ROS agree on it.

    Parameters
    ----------
    period_ns : int
        Period of the task, ns, from 1.

    Raises
    ------
    InvalidInput
        When the period is not a whole number from 1.
    """

    __slots__ = ('_last', '_period')

    def __init__(self, period_ns: int) -> None:
        if not isinstance(period_ns, int) or period_ns < 1:
            raise InvalidInput(f'period = {period_ns!r} ns: a whole number from 1 is needed')
        self._period = period_ns
        self._last: int | None = None

    def due(self, stamp_ns: int) -> bool:
        """Whether the task is due at this stamp, ns; True once in each period."""
        index = stamp_ns // self._period
        if index == self._last:
            return False
        self._last = index
        return True
