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
from ros_pad.control.faults import Fault, Kind, joined

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


Times = deque[float]
"""Last times of a kind, s."""


def typical(times: Times, start: float) -> float:
    """Return the median of the last five times, s: two outliers among them change it little.

    ``start`` is returned before there are three times.
    """
    return statistics.median(times) if len(times) >= 3 else start


class _Changes:
    """Times that fills and vents take, from the command to the set-point."""

    def __init__(self) -> None:
        self.commanded = 0.0  # time of the last change of the set-point
        self.distance = 0.0  # whole pressure change of the fill or vent being timed; 0 for none
        self._filling = False
        self.fills, self.vents = Times(maxlen=5), Times(maxlen=5)

    def begin(self, time: float, aim: float, pressure: float) -> None:
        """Time the change from a pressure to a set-point if it is more than half of a fill."""
        self.commanded, self._filling = time, aim > pressure
        distance = abs(aim - pressure)
        self.distance = distance if distance > 0.5 * max(aim, pressure) else 0.0

    def learn(self, time: float, left: float, tolerance: float) -> None:
        """Learn from a change of which a pressure is left; it is assumed to be exponential."""
        if left > tolerance and left < 0.8 * self.distance:
            share = math.log(self.distance / tolerance) / math.log(self.distance / left)
        elif left <= tolerance and self.distance > 2.0 * tolerance:
            share = 1.0
        else:
            return
        (self.fills if self._filling else self.vents).append((time - self.commanded) * share)


class _Motion:
    """Whether a pad that is not at its set-point still moves towards it."""

    def __init__(self) -> None:
        self._recent: deque[tuple[float, float]] = deque()  # times and falling |e| of the window
        self.restart(0.0)

    def restart(self, time: float) -> None:
        """Begin anew: the pad is at its set-point, or the set-point has changed."""
        self._recent.clear()
        self._since = time
        self._stopped = math.inf  # time at which the pad stopped short of its set-point
        self.stalled = False

    def stalls(
        self, time: float, size: float, tolerance: float, last_read: float, over: bool
    ) -> bool:
        """Process |e|, Pa, outside the tolerance; return whether the pad is faulty from now on."""
        recent = self._recent
        while recent and recent[-1][1] <= size:
            recent.pop()
        recent.append((time, size))
        # With readings further apart than the window, only the last one is left to compare with.
        while recent[0][0] < min(time - WINDOW, last_read):
            recent.popleft()
        largest = recent[0][1]
        still = size > largest - min(PROGRESS * largest, tolerance)
        if not over and not (still and time - self._since >= WINDOW):
            self._stopped = math.inf
            self.stalled = False
            return False
        self._stopped = min(self._stopped, time)
        if self.stalled or time - self._stopped < CONFIRMED:
            return False
        self.stalled = True
        return True


class _Repair:
    """Whether a faulty pad has done what it failed to do."""

    def __init__(self) -> None:
        self.side = 0  # kind of the fault: -1 pressure too low, 1 too high, 0 sensor faulty
        self.lowest = self.highest = 0.0  # lowest and highest reading since the fault
        self.right = math.inf  # time since which the pad has worked again

    def done(self, time: float, aim: float, pressure: float, tolerance: float) -> bool:
        """Return whether a pad at its set-point has been right for long enough."""
        able = (
            aim == 0.0,
            self.highest - pressure > tolerance,
            aim > tolerance and pressure - self.lowest > tolerance,
        )[self.side]
        self.right = min(self.right, time) if able else math.inf
        return time - self.right >= HEALED


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
    fault : Fault or None
        The fault. A fault ends when the pad has done what it failed to do: a pad that
        did not fill must fill, and a pad that did not vent must vent.
    silence : Fault or None
        The fault while readings are missing; None also before the first reading.
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

    Examples
    --------
    A pad that stays flat is faulty some time after the command to fill it:

    >>> from ros_pad.control import PadMonitor
    >>> monitor = PadMonitor(ceiling=90e3)
    >>> for step in range(30):
    ...     monitor.update(0.1 * step, setpoint=75e3, pressure=0.0)
    >>> monitor.reason
    'does not fill: 0.0 kPa 0.5 s after the command'
    """

    def __init__(self, ceiling: float) -> None:
        self._ceiling = number('ceiling', ceiling, 'Pa', above=True)
        self.tolerance = TOLERANCE * ceiling
        self.pressure = math.nan
        self.fault: Fault | None = None
        self.silence: Fault | None = None
        self._setpoint = math.nan  # NaN: none
        self._time = self._read = -math.inf
        self._arrived = False  # whether the pad has reached the present set-point
        self._changes, self._motion, self._repair = _Changes(), _Motion(), _Repair()

    @property
    def fill_time(self) -> float:
        """Time from a command until the pad is full, s; median of the last five fills."""
        return typical(self._changes.fills, START)

    @property
    def vent_time(self) -> float:
        """Time from a command until the pad is flat, s; median of the last five vents."""
        return typical(self._changes.vents, START)

    @property
    def stalled(self) -> bool:
        """Whether the pad has stopped outside the tolerance of the present set-point."""
        return self._motion.stalled

    @property
    def reason(self) -> str:
        """Missing readings and the fault as text; empty if there are none."""
        return joined(self.silence, self.fault)

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
        aim = math.nan if setpoint is None else setpoint
        reading = math.nan if pressure is None else pressure
        before, self._time = self._time, time
        if not 0.0 <= time - before <= SILENT:
            before = self._read = time
            self._wait(time)
        last, self._setpoint = self._setpoint, aim
        if setpoint is None:
            self._wait(time)
        elif not abs(aim - last) <= self.tolerance:  # also the first one
            self._changes.learn(before, abs(last - self.pressure), self.tolerance)
            self._set_out(before, aim, self.pressure)
        if not math.isfinite(reading):
            silent = time - self._read
            if silent > SILENT and not math.isnan(self.pressure) and not self.silence:
                self.silence = Kind.SILENCE(silent, self.pressure)
            return
        first, last_read, self._read = math.isnan(self.pressure), self._read, time
        self.pressure = reading
        if self.silence:
            self.silence = None
            self._wait(time)
        if setpoint is not None:
            if first:
                self._set_out(time, aim, reading)
            self._judge(time, aim, last_read)

    def _set_out(self, time: float, aim: float, pressure: float) -> None:
        """Begin a pressure change."""
        self._arrived = False
        self._wait(time)
        self._changes.begin(time, aim, pressure)

    def _wait(self, time: float) -> None:
        """Restart the comparison of readings with the set-point."""
        self._changes.distance, self._repair.right = 0.0, math.inf
        self._motion.restart(time)

    def _judge(self, time: float, aim: float, last_read: float) -> None:
        pressure, tolerance, repair = self.pressure, self.tolerance, self._repair
        repair.lowest = min(repair.lowest, pressure)
        repair.highest = max(repair.highest, pressure)
        over = pressure > self._ceiling + tolerance
        if abs(pressure - aim) <= tolerance and not over:
            self._changes.learn(time, 0.0, tolerance)
            self._changes.distance, self._arrived = 0.0, True
            self._motion.restart(time)
            if self.fault and repair.done(time, aim, pressure, tolerance):
                self.fault = None
            return
        repair.right = math.inf
        if self._motion.stalls(time, abs(pressure - aim), tolerance, last_read, over):
            self._find_fault(time, aim, over)

    def _find_fault(self, time: float, aim: float, over: bool) -> None:
        self._changes.distance = 0.0
        pressure, repair = self.pressure, self._repair
        side = 1 if pressure > aim or over else -1
        if pressure < -self.tolerance:
            side = 0
        repair.lowest = repair.highest = pressure
        if self.fault and side == repair.side:
            return
        stuck = bool(self.fault) and side * repair.side < 0
        repair.side = side
        late = time - self._changes.commanded
        if side == 0:
            self.fault = Kind.SENSOR(pressure)
        elif over:
            self.fault = Kind.CEILING(pressure, self._ceiling)
        elif stuck:
            self.fault = Kind.STUCK(pressure)
        elif self._arrived:
            self.fault = (Kind.RISES if side > 0 else Kind.SAGS)(pressure, aim)
        elif side > 0:
            self.fault = Kind.NO_VENT(pressure, late)
        elif pressure < self.tolerance:
            self.fault = Kind.NO_FILL(pressure, late)
        else:
            self.fault = Kind.LEAK(pressure, aim - pressure)
