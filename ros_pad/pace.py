# SPDX-License-Identifier: Apache-2.0
"""Pace of tasks that run more slowly than their input, and progress of long tasks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from ros_pad.errors import InvalidInput

CONTROL_PERIOD_NS = 20_000_000
"""Period of estimates, decisions and regulator readings, ns; serial lines are fast enough for it.
"""

TICK_PERIOD_NS = 100_000_000
"""Period at which the stages check whether messages are missing, ns."""

Progress: TypeAlias = Callable[[float], None]
"""Callback of a long task, called with the share that is done, 0 to 1, or with the simulated
time, s.
"""


class Pace:
    """Decide at which time stamps a slower task is due: at the first stamp in each of its periods.

    The result depends on the stamps alone, so that nodes and the loop without ROS agree.

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
        """Return whether the task is due at this stamp, ns; True once in each period."""
        index = stamp_ns // self._period
        if index == self._last:
            return False
        self._last = index
        return True
