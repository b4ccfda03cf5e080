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

LATE = 'too slow'
"""First words of a status on ``/diagnostics`` that a computer does not keep up."""

Progress: TypeAlias = Callable[[float], None]
"""Callback of a long task, called with the share that is done, 0 to 1, or with the simulated
time, s.
"""


def part(progress: Progress | None, start: float, end: float) -> Progress:
    """Return the callback of a part of a task, which takes the task from one share to another.

    Parameters
    ----------
    progress : callable or None
        Callback of the whole task.
    start, end : float
        Shares that are done at the beginning and the end of the part, 0 to 1.
    """
    return lambda share: progress(start + (end - start) * share) if progress else None


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
            raise InvalidInput(
                f'period = {period_ns!r} ns is not allowed: a whole number from 1 is needed'
            )
        self._period = period_ns
        self._last: int | None = None

    def due(self, stamp_ns: int) -> bool:
        """Return whether the task is due at this stamp, ns; True once in each period."""
        index = stamp_ns // self._period
        if index == self._last:
            return False
        self._last = index
        return True


class RealTime:
    """Follow a clock in periods, and measure how well that is kept up with.

    Parameters
    ----------
    period_ns : int
        Period of the samples, ns.
    now_ns : int
        Present time, ns.
    """

    LONGEST_NS = 100_000_000
    """Longest time to catch up with at once, ns; more is lost, so that the clock falls behind."""

    def __init__(self, period_ns: int, now_ns: int) -> None:
        self._period = period_ns
        self._next_ns = now_ns + period_ns
        self._since_ns = now_ns
        self._passed = 0

    def due(self, now_ns: int) -> int:
        """Return how many periods to advance at a time, ns: more than 1 when samples are late."""
        due = (now_ns - self._next_ns) // self._period + 1
        if due <= 0:
            return 0
        self._next_ns += due * self._period
        due = min(due, max(1, self.LONGEST_NS // self._period))
        self._passed += due
        return due

    def speed(self, now_ns: int) -> float:
        """Return how many times real time the clock ran since the last call, at a time, ns."""
        speed = self._passed * self._period / max(1, now_ns - self._since_ns)
        self._since_ns, self._passed = now_ns, 0
        return speed
