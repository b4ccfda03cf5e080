# SPDX-License-Identifier: Apache-2.0
"""Does the air of a foot do what it is told? One watch for each pad, from readings alone.

A pad that is on its way is not accused, however long its hose: only one that has stopped short of
its set-point. What stops, and on which side, tells the faults apart; what keeps going tells how
long a fill and a vent take here.
"""

from __future__ import annotations

import math
import statistics
from collections import deque

from ros_pad.contact.pad import number

TOLERANCE = 0.03
"""Share of the ceiling by which a reading may differ from the set-point: 2.7 kPa of 90. The dead
bands and errors of regulators are within 1 %, and the margin of a dome's load is worth 5.7 %."""

WINDOW = 0.4
"""Time over which a pad that is on its way must be seen to move, s."""

PROGRESS = 0.2
"""How much of its distance to the set-point it must lose in that time, or one tolerance."""

CONFIRMED = 0.08
"""How long a pad must have stopped before that is said, s: one odd reading is no fault."""

HEALED = 0.2
"""How long it must be right before a fault is taken back, s."""

SILENT = 0.5
"""Time without a reading before that is said, s."""

START = 0.15
"""What a fill and a vent are taken to last before one was seen, s: the regulator's own time."""


class RunningMedian:
    """Median of the last five values: two odd ones of them change little.

    Parameters
    ----------
    start : float
        What it is before there are three values.
    """

    __slots__ = ('_last', 'value')

    def __init__(self, start: float) -> None:
        self._last: deque[float] = deque(maxlen=5)
        self.value = start

    def add(self, value: float) -> None:
        """Take a value."""
        self._last.append(value)
        if len(self._last) >= 3:
            self.value = statistics.median(self._last)


class PadWatch:
    """Compares the pressure of one pad with what was asked of it.

    Parameters
    ----------
    ceiling : float
        Highest gauge pressure that the pad may see, Pa, above 0.

    Attributes
    ----------
    pressure : float
        Last reading, gauge Pa; NaN before the first one.
    fault : str
        What is wrong with the pad, with numbers; empty while it follows. It stays until the pad
        was seen to do what it could not: a pad that did not fill must fill, one that did not vent
        must vent.
    silence : str
        Said while readings are missing; empty otherwise, and before the first reading.
    stalled : bool
        Whether the pad has stopped short of the present set-point.

    Raises
    ------
    InvalidInput
        When the ceiling is outside its range.

    Notes
    -----
    With the error e = p - set-point, a pad outside the tolerance has stopped when |e| is above
    m - min(0.2 m, tolerance), m being the largest |e| of the last 0.4 s, and the set-point is as
    old. An exponential fill may thus have a time constant of 1.8 s (4 s to 90 %), and one at a
    constant rate 6.7 kPa/s, before it passes for none.

    An update takes 1 to 2 µs.
    """

    __slots__ = (
        '_arrived', '_ceiling', '_commanded', '_distance', '_fill', '_filling', '_heard',
        '_highest', '_lowest', '_recent', '_right', '_setpoint', '_side', '_since', '_stopped',
        '_time', '_vent', 'fault', 'pressure', 'silence', 'stalled', 'tolerance',
    )  # fmt: skip

    def __init__(self, ceiling: float) -> None:
        self._ceiling = number('ceiling', ceiling, 'Pa', above=True)
        self.tolerance = TOLERANCE * ceiling
        self.pressure = math.nan
        self.fault = ''
        self.silence = ''
        self.stalled = False
        self._side = 0  # of the fault: -1 too low, 1 too high, 0 the sensor
        self._lowest = self._highest = 0.0  # readings since the fault
        self._setpoint: float | None = None
        self._time = -math.inf
        self._heard = -math.inf
        self._commanded = 0.0  # when the set-point last moved
        self._since = 0.0  # when the pad was last where it should be
        self._stopped = math.inf  # since when it moves no more
        self._right = math.inf  # since when a faulty pad does what it could not
        self._distance = 0.0  # of the way that is being timed, from its start; 0 for none
        self._filling = False
        self._arrived = False  # at the present set-point
        self._recent: deque[tuple[float, float]] = deque()  # falling |e| of the last window
        self._fill = RunningMedian(START)
        self._vent = RunningMedian(START)

    @property
    def fill_time(self) -> float:
        """Time from a command until the pad is full, s; median of the last five."""
        return self._fill.value

    @property
    def vent_time(self) -> float:
        """Time from a command until the pad is flat, s; median of the last five."""
        return self._vent.value

    @property
    def reason(self) -> str:
        """What is wrong, in words; empty when nothing is."""
        return '; '.join(filter(None, (self.silence, self.fault)))

    def update(self, time: float, setpoint: float | None, pressure: float | None) -> None:
        """Take a reading.

        Parameters
        ----------
        time : float
            s. Where it went back, or nobody looked for longer than ``SILENT``, what was begun is
            dropped, and nobody is accused of it.
        setpoint : float or None
            That was in force up to now, gauge Pa; None where none was sent, so that a pad may do
            as it likes.
        pressure : float or None
            Gauge Pa; None, or what is not finite, where there was no reading.
        """
        before, self._time = self._time, time
        if not 0.0 <= time - before <= SILENT:
            before = time
            self._distance = 0.0
            self._heard = time
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
            if time - self._heard > SILENT and not math.isnan(self.pressure) and not self.silence:
                self.silence = (
                    f'no reading for {time - self._heard:.1f} s, the last was'
                    f' {_kilo(self.pressure)}'
                )
            return
        first, heard, self._heard = math.isnan(self.pressure), self._heard, time
        self.pressure = pressure
        if self.silence:
            self.silence = ''
            self._distance = 0.0
            self._wait(time)
        if setpoint is not None:
            if first:
                self._set_out(time, setpoint, pressure)
            self._judge(time, setpoint, heard)

    def _set_out(self, time: float, aim: float, pressure: float) -> None:
        """Begin a new way, and time it if it leads from flat to dome or back."""
        self._commanded = time
        self._arrived = False
        self._filling = aim > pressure
        way = abs(aim - pressure)
        self._distance = way if way > 0.5 * max(aim, pressure) else 0.0
        self._wait(time)

    def _wait(self, time: float) -> None:
        """Begin to watch anew."""
        self._recent.clear()
        self._since = time
        self._stopped = self._right = math.inf
        self.stalled = False

    def _judge(self, time: float, aim: float, heard: float) -> None:
        pressure = self.pressure
        size = abs(pressure - aim)
        self._lowest, self._highest = min(self._lowest, pressure), max(self._highest, pressure)
        recent = self._recent
        while recent and recent[-1][1] <= size:
            recent.pop()
        recent.append((time, size))
        # Where readings are further apart than that, the one before is all there is to compare.
        while recent[0][0] < min(time - WINDOW, heard):
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
            self._accuse(time, aim, over)

    def _arrive(self, time: float, aim: float) -> None:
        """Deal with a pad that is where it should be."""
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

    def _accuse(self, time: float, aim: float, over: bool) -> None:
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
            self.fault = f'reads {_kilo(pressure)}, which no pad has: its sensor is off'
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
            self.fault = f'does not vent: {_kilo(pressure)} {age} {_kilo(aim)} was asked for'
        elif pressure < self.tolerance:
            self.fault = f'does not fill: {_kilo(pressure)} {age} {_kilo(aim)} was asked for'
        else:
            missing = _kilo(aim - pressure)
            self.fault = f'leaks or lacks air: {_kilo(pressure)}, {missing} below the set-point'

    def _cut_short(self, time: float, left: float) -> None:
        """Learn from a way that was called off: the rest of it would have been exponential."""
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
