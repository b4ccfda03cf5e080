# SPDX-License-Identifier: Apache-2.0
"""Compare slip alarms: each method with each of its thresholds, on the same readings."""

from __future__ import annotations

import functools
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ros_pad.contact.resistance import Foot
from ros_pad.estimation.alarm import SMOOTHING, SPEED_NOISE, SlipAlarm
from ros_pad.estimation.foot import FootEstimator, Tuning
from ros_pad.estimation.track import LOAD_GATE
from ros_pad.pace import Progress
from studies import slips
from studies.work_precision.estimator.tally import (
    Row,
    Tally,
    count_alarms,
    count_estimates,
    replay,
    row_of,
)
from studies.work_precision.estimator.walks import Flags, Recording

RATIO, CUSUM, SHIPPED = 'T/N', 'displacement', 'FootEstimator, alarm'
LIKELIHOOD, GLR, STATES = 'CUSUM of likelihoods', 'GLR', 'two states'
RATIOS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.6)
CUSUM_SPEEDS = (0.01, 0.015, 0.02)  # m/s
DISTANCES = (1e-4, 2e-4, 3.5e-4, 5e-4, 1e-3, 2e-3)  # m
NATS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
ODDS = (0.0, 2.0, 4.0, 8.0, 16.0)  # logarithms
SLIP_SPEED = 0.03  # m/s, of the tests of likelihood
LASTS = 0.3  # s, mean time for which a foot sticks, or slips
WINDOW = 0.3  # s, longest of the GLR

Settings: TypeAlias = tuple[Foot, float, Tuning]
"""Arguments of an estimator."""

Update: TypeAlias = Callable[[float, Sequence[float], Sequence[float], float], bool]
"""Processes time (s), force (N), position (m) and pressure (Pa) of a foot as
:meth:`FootEstimator.update` does; returns whether the alarm is on."""


def ratio_alarm(settings: Settings, threshold: float) -> Update:
    """Return an alarm that is on if T/N is above a threshold."""
    gate = LOAD_GATE * settings[1]

    def update(
        time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        x, y, load = force
        return load > gate and math.hypot(x, y) > threshold * load

    return update


class SlipSpeed:
    """The slip speed, computed as in the estimator."""

    def __init__(self, settings: Settings) -> None:
        foot, load, _ = settings
        self._gate, self._stiffness = LOAD_GATE * load, foot.shear_stiffness
        self._time: float | None = None
        self._touched = self._x = self._y = 0.0

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float]
    ) -> tuple[float, float] | None:
        """Return slip speed, m/s, and time since the last sample, s.

        None in the air, and while the foot lands.
        """
        push_x, push_y, load = force
        if load < self._gate:
            self._time = None
            return None
        x, y = position[0] + push_x / self._stiffness, position[1] + push_y / self._stiffness
        if self._time is None:
            self._touched = time
        if self._time is None or time - self._touched <= SMOOTHING - 1e-9:
            self._time, self._x, self._y = time, x, y
            return None
        dt, self._time = time - self._time, time
        share = dt / (SMOOTHING + dt)
        self._x += share * (x - self._x)
        self._y += share * (y - self._y)
        along = (x - self._x) * push_x + (y - self._y) * push_y
        return -along / (SMOOTHING * (math.hypot(push_x, push_y) or math.inf)), dt


Test: TypeAlias = Callable[[float, float, float], bool]
"""Processes slip speed, m/s, its noise, m/s, and the time since the last, s; returns the alarm."""


def speed_alarm(settings: Settings, test_of: Callable[[], Test]) -> Update:
    """Return an alarm by a test of the slip speed that begins anew with each stance."""
    foot, _, tuning = settings
    slip, test = SlipSpeed(settings), test_of()
    noise = math.hypot(tuning.position_noise, tuning.force_noise / foot.shear_stiffness)
    noise = math.hypot(noise / SMOOTHING, SPEED_NOISE)

    def update(
        time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        nonlocal test
        found = slip.update(time, force, position)
        if found is None:
            test = test_of()
            return False
        return test(found[0], noise, found[1])

    return update


def displacement(allowed: float, distance: float) -> Test:
    """Return the test of :class:`SlipAlarm`."""
    alarm = SlipAlarm()
    return lambda speed, _, dt: alarm.update(speed, allowed, distance, dt)


def likelihoods(threshold: float) -> Test:
    """Return Page's CUSUM of the likelihood ratio of a slip at :data:`SLIP_SPEED`."""
    statistic = 0.0

    def test(speed: float, noise: float, dt: float) -> bool:
        nonlocal statistic
        gain = SLIP_SPEED / (noise * noise * max(SMOOTHING / dt, 1.0))
        statistic = max(0.0, statistic + gain * (speed - 0.5 * SLIP_SPEED))
        raised = statistic > threshold
        statistic = min(statistic, 1.25 * threshold)
        return raised

    return test


def generalised(threshold: float) -> Test:
    """Return a generalised likelihood ratio: the best speed since the best beginning."""
    path: deque[tuple[float, float]] = deque([(0.0, 0.0)])  # time and distance

    def test(speed: float, noise: float, dt: float) -> bool:
        now, place = path[-1][0] + dt, path[-1][1] + speed * dt
        path.append((now, place))
        while now - path[0][0] > WINDOW:
            path.popleft()
        return any(
            place > before
            and (place - before) ** 2 > 4.0 * threshold * noise**2 * SMOOTHING * (now - begin)
            for begin, before in path
            if now - begin > SMOOTHING
        )

    return test


def two_states(threshold: float) -> Test:
    """Return a hidden Markov model of stick and slip; the threshold is that of the log odds."""
    share = 1e-3

    def test(speed: float, noise: float, dt: float) -> bool:
        nonlocal share
        share += dt / LASTS * (1.0 - 2.0 * share)
        wide = math.hypot(noise, 0.5 * SLIP_SPEED)
        ratio = math.log(noise / wide) + 0.5 * (speed / noise) ** 2
        ratio -= 0.5 * ((speed - SLIP_SPEED) / wide) ** 2
        odds = math.log(share / (1.0 - share)) + ratio * min(dt / SMOOTHING, 1.0)
        share = 1.0 / (1.0 + math.exp(-min(max(odds, -30.0), 30.0)))
        return odds > threshold

    return test


def shipped_alarm(settings: Settings) -> Update:
    """Return the alarm of :class:`FootEstimator`."""
    estimator = FootEstimator(*settings)
    return lambda *sample: estimator.update(*sample).slipping


@dataclass(frozen=True)
class Method:
    """A method with a threshold; ``make`` returns an alarm for the arguments of an estimator."""

    name: str
    variant: str
    value: float
    unit: str
    make: Callable[[Settings], Update]


def methods() -> list[Method]:
    """Return every method with its thresholds."""
    found = [Method(RATIO, '', r, '', lambda s, r=r: ratio_alarm(s, r)) for r in RATIOS]  # type: ignore[misc]
    tests: list[tuple[str, str, str, Sequence[float], Callable[[float], Test]]] = [
        (CUSUM, f'{1e3 * speed:g} mm/s', 'm', DISTANCES, functools.partial(displacement, speed))
        for speed in CUSUM_SPEEDS
    ]
    tests += [
        (LIKELIHOOD, '', 'nats', NATS, likelihoods),
        (GLR, '', 'nats', NATS, generalised),
        (STATES, '', 'nats', ODDS, two_states),
    ]
    for name, variant, unit, thresholds, test in tests:
        for value in thresholds:
            made = functools.partial(test, value)
            found.append(
                Method(name, variant, value, unit, lambda s, made=made: speed_alarm(s, made))  # type: ignore[misc]
            )
    return [*found, Method(SHIPPED, '', 0.0, '', shipped_alarm)]


def detect(walk: Recording, make: Callable[[Settings], Update]) -> Flags:
    """Return whether an alarm is on, array (samples, legs)."""
    out = np.zeros(walk.load.shape, dtype=bool)
    stamps = walk.stamps.tolist()
    for leg, mine in enumerate(walk.rows):
        update = make(walk.settings)
        out[:, leg] = [
            update(stamp, row[:3], row[3:6], row[6])
            for stamp, row in zip(stamps, mine, strict=True)
        ]
    return out


def compare(walks: Sequence[Recording], progress: Progress) -> list[Row]:
    """Measure each method with each of its thresholds on the same readings.

    The intervals of rows are of what a method misses more than the shipped one, the last.
    Progress, 0 to 1, is reported to ``progress``.
    """
    every = methods()
    times = {method.name: cost(walks[0], method.make) for method in every}
    rows, alarms = [], []
    for done, method in enumerate(every):
        tally = Tally()
        for walk in walks:
            if method.name == SHIPPED:
                estimates = replay(walk)
                count_alarms(tally, walk, estimates.slipping)
                count_estimates(tally, walk, estimates)
            else:
                count_alarms(tally, walk, detect(walk, method.make))
        rows.append(
            row_of(
                tally, times[method.name], part='methods', name=method.name,
                variant=method.variant, value=method.value, unit=method.unit,
                shipped=method.name == SHIPPED,
            )
        )  # fmt: skip
        alarms.append(tally.alarms)
        progress((done + 1) / len(every))
    for row, mine in zip(rows, alarms, strict=True):
        ends = slips.differences(mine, alarms[-1], slips.SIZES[1]).tolist()
        row.intervals.update(zip(('misses more', 'false more'), ends, strict=True))
    return rows


def cost(walk: Recording, make: Callable[[Settings], Update]) -> float:
    """Return the mean time of an update over a walk of one leg, us, the best of three runs."""
    stamps = walk.stamps.tolist()
    # Indexing is done before timing, because it is not part of the method.
    samples = [(t, r[:3], r[3:6], r[6]) for t, r in zip(stamps, walk.rows[0], strict=True)]
    best = math.inf
    for _ in range(3):
        update = make(walk.settings)
        start = time.perf_counter()
        for sample in samples:
            update(*sample)
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / len(samples)
