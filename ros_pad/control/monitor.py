# SPDX-License-Identifier: Apache-2.0
"""Monitor the air of a pad: compare pressure readings with set-points.

A pad is faulty if its pressure has stopped changing before reaching the set-point. While the
pressure still changes there is no fault, because the hose may be long. The pressure at which the
change stops distinguishes the faults. The duration of a change gives the time to fill or to vent.
"""

from __future__ import annotations

import math
import statistics
from collections import deque

from ros_pad.configuration import number

TOLERANCE = 0.03
"""Share of the ceiling by which a reading may differ from the set-point: 2.7 kPa of 90 kPa. It is
more than dead band and error of a regulator, 1 %, and less than the pressure that the pressure
margin adds to a dome, 5.7 %."""

WINDOW = 0.4
"""Time within which the pressure of a filling or venting pad must move, s."""

PROGRESS = 0.2
"""Share of the distance to the set-point by which the pressure must move within `WINDOW`; a move
by the tolerance is always enough.
"""

CONFIRMED = 0.08
"""Time for which a pad must have stopped before it is faulty, s: one wrong reading is no fault."""

HEALED = 0.2
"""Time for which the pressure must be right before a fault is cleared, s."""

SILENT = 0.5
"""Time without a reading after which the device is silent, s. It is independent of the parameter
`command_timeout`, the time without a set-point after which a regulator vents."""

START = 0.15
"""Assumed time to fill or to vent before it is measured, s: that of the regulator alone."""


class RunningMedian:
    """Median of the last five values: two outliers among them change it little.

    Parameters
    ----------
    start : float
        Median to be returned before there are three values.

    Attributes
    ----------
    value : float
        The median.
    """

    __slots__ = ('_last', 'value')

    def __init__(self, start: float) -> None:
        self._last: deque[float] = deque(maxlen=5)
        self.value = start

    def add(self, value: float) -> None:
        """Add a value and update the median."""
        self._last.append(value)
        if len(self._last) >= 3:
            self.value = statistics.median(self._last)


class PadMonitor:
    """Compare the pressure of one pad with its set-point.

    Parameters
    ----------
    ceiling : float
        Highest gauge pressure that the pad may have, Pa, above 0.

    Attributes
    ----------
    pressure : float
        Last reading, gauge Pa; NaN before the first one.
    fault : str
        Description of the fault, with numbers; empty without a fault. A fault ends when the pad
        has done what it failed to do: a pad that did not fill must fill, and a pad that did not
        vent must vent.
    silence : str
        Message while readings are missing; empty otherwise, and before the first reading.
    stalled : bool
        Whether the pad has stopped outside the tolerance of the present set-point.
    tolerance : float
        Largest allowed difference between reading and set-point, Pa.

    Raises
    ------
    InvalidInput
        When the ceiling is not finite and above 0.

    Notes
    -----
    With the error ``e = p - set-point`` and m the largest size of e in the last 0.4 s, a pad
    outside the tolerance has stopped when ``|e| > m - min(0.2 m, tolerance)`` and the set-point
    has been constant for 0.4 s. So the slowest fill that counts as moving is an exponential one
    with a time constant of 1.8 s (4 s to 90 %), or one at a constant rate of 6.7 kPa/s.

    An update takes 1 to 2 µs.

    Examples
    --------
    A pad that stays flat is faulty some time after the command to fill it:

    >>> from ros_pad.control import PadMonitor
    >>> monitor = PadMonitor(ceiling=90e3)
    >>> for step in range(30):
    ...     monitor.update(0.1 * step, setpoint=75e3, pressure=0.0)
    >>> monitor.reason
    'does not fill: 0.0 kPa 0.5 s after 75.0 kPa was commanded'
    """

    __slots__ = (
        '_arrived',
        '_ceiling',
        '_commanded',
        '_distance',
        '_fill',
        '_filling',
        '_highest',
        '_lowest',
        '_read',
        '_recent',
        '_right',
        '_setpoint',
        '_side',
        '_since',
        '_stopped',
        '_time',
        '_vent',
        'fault',
        'pressure',
        'silence',
        'stalled',
        'tolerance',
    )  # fmt: skip

    def __init__(self, ceiling: float) -> None:
        self._ceiling = number('ceiling', ceiling, 'Pa', above=True)
        self.tolerance = TOLERANCE * ceiling
        self.pressure = math.nan
        self.fault = ''
        self.silence = ''
        self.stalled = False
        self._side = 0  # kind of the fault: -1 pressure too low, 1 too high, 0 sensor faulty
        self._lowest = self._highest = 0.0  # lowest and highest reading since the fault
        self._setpoint: float | None = None
        self._time = -math.inf
        self._read = -math.inf
        self._commanded = 0.0  # time of the last change of the set-point
        self._since = 0.0  # time at which the pad was last at its set-point, or a change began
        self._stopped = math.inf  # time at which the pad stopped short of its set-point
        self._right = math.inf  # time since which a faulty pad has worked again
        self._distance = 0.0  # whole pressure change of the fill or vent being timed; 0 for none
        self._filling = False
        self._arrived = False  # whether the pad has reached the present set-point
        self._recent: deque[tuple[float, float]] = deque()  # times and falling |e| of the window
        self._fill = RunningMedian(START)
        self._vent = RunningMedian(START)

    @property
    def fill_time(self) -> float:
        """Time from a command until the pad is full, s; median of the last five fills."""
        return self._fill.value

    @property
    def vent_time(self) -> float:
        """Time from a command until the pad is flat, s; median of the last five vents."""
        return self._vent.value

    @property
    def reason(self) -> str:
        """Missing readings and the fault as text; empty if there are none."""
        if self.silence and self.fault:
            return f'{self.silence}; {self.fault}'
        return self.silence or self.fault

    def update(self, time: float, setpoint: float | None, pressure: float | None) -> None:
        """Process a reading, or its absence.

        Parameters
        ----------
        time : float
            Time of the reading, s. When the clock goes back, or after a pause longer than
            ``SILENT``, a fill or vent in progress is not timed.
        setpoint : float or None
            Set-point in force until now, gauge Pa; None if none was sent: any pressure is then
            accepted.
        pressure : float or None
            Reading, gauge Pa; None or not finite if there was no reading.
        """
        before, self._time = self._time, time
        if not 0.0 <= time - before <= SILENT:
            before = time
            self._distance = 0.0
            self._read = time
            self._wait(time)
        if setpoint is None:
            self._distance = 0.0
            self._wait(time)
        elif self._setpoint is None:
            self._set_out(before, setpoint, self.pressure)
        elif abs(setpoint - self._setpoint) > self.tolerance:
            self._cut_short(before, abs(self._setpoint - self.pressure))
            self._set_out(before, setpoint, self.pressure)
        self._setpoint = setpoint
        if pressure is None or not math.isfinite(pressure):
            if time - self._read > SILENT and not math.isnan(self.pressure) and not self.silence:
                self.silence = (
                    f'no reading for {time - self._read:.1f} s, the last was'
                    f' {_kilo(self.pressure)}'
                )
            return
        first, before_this, self._read = math.isnan(self.pressure), self._read, time
        self.pressure = pressure
        if self.silence:
            self.silence = ''
            self._distance = 0.0
            self._wait(time)
        if setpoint is not None:
            if first:
                self._set_out(time, setpoint, pressure)
            self._judge(time, setpoint, before_this)

    def _set_out(self, time: float, aim: float, pressure: float) -> None:
        """Begin a pressure change; time the change if it is more than half of a fill or vent."""
        self._commanded = time
        self._arrived = False
        self._filling = aim > pressure
        distance = abs(aim - pressure)
        self._distance = distance if distance > 0.5 * max(aim, pressure) else 0.0
        self._wait(time)

    def _wait(self, time: float) -> None:
        """Restart the comparison of readings with the set-point."""
        self._recent.clear()
        self._since = time
        self._stopped = self._right = math.inf
        self.stalled = False

    def _judge(self, time: float, aim: float, last_read: float) -> None:
        pressure = self.pressure
        size = abs(pressure - aim)
        self._lowest, self._highest = min(self._lowest, pressure), max(self._highest, pressure)
        recent = self._recent
        while recent and recent[-1][1] <= size:
            recent.pop()
        recent.append((time, size))
        # With readings further apart than the window, only the last one is left to compare with.
        while recent[0][0] < min(time - WINDOW, last_read):
            recent.popleft()
        over = pressure > self._ceiling + self.tolerance
        if size <= self.tolerance and not over:
            self._arrive(time, aim)
            return
        self._right = math.inf
        largest = recent[0][1]
        still = size > largest - min(PROGRESS * largest, self.tolerance)
        if not over and not (still and time - self._since >= WINDOW):
            self._stopped = math.inf
            self.stalled = False
            return
        self._stopped = min(self._stopped, time)
        if time - self._stopped >= CONFIRMED and not self.stalled:
            self.stalled = True
            self._find_fault(time, aim, over)

    def _arrive(self, time: float, aim: float) -> None:
        """Handle a pad that is at its set-point."""
        if self._distance > 2.0 * self.tolerance:
            self._learn(time - self._commanded)
        self._distance = 0.0
        self._arrived = True
        self._since = time
        self._stopped = math.inf
        self.stalled = False
        if not self.fault:
            return
        able = {
            -1: aim > self.tolerance and self.pressure - self._lowest > self.tolerance,
            1: self._highest - self.pressure > self.tolerance,
            0: aim == 0.0,
        }  # fmt: skip
        if not able[self._side]:
            self._right = math.inf
            return
        self._right = min(self._right, time)
        if time - self._right >= HEALED:
            self.fault = ''

    def _find_fault(self, time: float, aim: float, over: bool) -> None:
        self._distance = 0.0
        pressure = self.pressure
        side = 1 if pressure > aim or over else -1
        if pressure < -self.tolerance:
            side = 0
        self._lowest = self._highest = pressure
        if self.fault and side == self._side:
            return
        stuck = bool(self.fault) and side * self._side < 0
        self._side = side
        age = f'{time - self._commanded:.1f} s after'
        if side == 0:
            self.fault = (
                f'reads {_kilo(pressure)}, which no pad can have: its pressure sensor is faulty'
            )
        elif over:
            self.fault = f'{_kilo(pressure)} is above the ceiling of {_kilo(self._ceiling)}'
        elif stuck:
            self.fault = f'stuck: {_kilo(pressure)}, neither fills nor vents'
        elif self._arrived:
            self.fault = (
                f'{"rises" if side > 0 else "sags"}: {_kilo(pressure)} at a set-point of'
                f' {_kilo(aim)}'
            )
        elif side > 0:
            self.fault = f'does not vent: {_kilo(pressure)} {age} {_kilo(aim)} was commanded'
        elif pressure < self.tolerance:
            self.fault = f'does not fill: {_kilo(pressure)} {age} {_kilo(aim)} was commanded'
        else:
            missing = _kilo(aim - pressure)
            self.fault = f'leaks or lacks air: {_kilo(pressure)}, {missing} below the set-point'

    def _cut_short(self, time: float, left: float) -> None:
        """Estimate a fill or vent time from an aborted change, assumed to be exponential."""
        if self.tolerance < left < 0.8 * self._distance:
            self._learn(
                (time - self._commanded)
                * math.log(self._distance / self.tolerance)
                / math.log(self._distance / left)
            )

    def _learn(self, duration: float) -> None:
        (self._fill if self._filling else self._vent).add(duration)


def _kilo(pressure: float) -> str:
    return f'{1e-3 * pressure:.1f} kPa'
