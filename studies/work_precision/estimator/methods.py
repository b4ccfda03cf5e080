# SPDX-License-Identifier: Apache-2.0
"""Compare slip alarms: each method with each of its thresholds, on the same readings."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ros_pad.contact.resistance import Foot
from ros_pad.estimation.alarm import SMOOTHING, SPEED_NOISE, SlipAlarm
from ros_pad.estimation.foot import FootEstimator, Tuning
from ros_pad.estimation.track import LOAD_GATE
from ros_pad.pace import Progress
from studies.work_precision.estimator.tally import (
    Row,
    Tally,
    count_alarms,
    count_estimates,
    replay,
    row_of,
)
from studies.work_precision.estimator.walks import Flags, Recording

RATIO, CUSUM, SHIPPED = 'T/N', 'CUSUM', 'FootEstimator, alarm'
RATIOS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.6)
CUSUM_SPEEDS = (0.01, 0.02, 0.04)  # m/s
CUSUM_THRESHOLDS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)

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
        self._x = self._y = 0.0

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float]
    ) -> tuple[float, float] | None:
        """Return slip speed, m/s, and time since the last sample, s.

        None in the air, and for the first sample of a stance.
        """
        push_x, push_y, load = force
        if load < self._gate:
            self._time = None
            return None
        x, y = position[0] + push_x / self._stiffness, position[1] + push_y / self._stiffness
        if self._time is None:
            self._time, self._x, self._y = time, x, y
            return None
        dt, self._time = time - self._time, time
        share = dt / (SMOOTHING + dt)
        self._x += share * (x - self._x)
        self._y += share * (y - self._y)
        along = (x - self._x) * push_x + (y - self._y) * push_y
        return -along / (SMOOTHING * (math.hypot(push_x, push_y) or math.inf)), dt


def cusum_alarm(settings: Settings, speed: float, threshold: float) -> Update:
    """Return the test of :class:`SlipAlarm`, a CUSUM, on the slip speed."""
    foot, _, tuning = settings
    slip = SlipSpeed(settings)
    alarm = SlipAlarm(SMOOTHING, (speed,), threshold)
    noise = math.hypot(tuning.position_noise, tuning.force_noise / foot.shear_stiffness)
    noise = math.hypot(noise / SMOOTHING, SPEED_NOISE)

    def update(
        time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        found = slip.update(time, force, position)
        if found is None:
            alarm.reset()
            return False
        speed, dt = found
        return alarm.update(speed, noise, dt)

    return update


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
    for speed in CUSUM_SPEEDS:
        found += [
            Method(CUSUM, f'{1e3 * speed:g} mm/s', t, '',
                   lambda s, v=speed, t=t: cusum_alarm(s, v, t))  # type: ignore[misc]
            for t in CUSUM_THRESHOLDS
        ]  # fmt: skip
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

    Progress, 0 to 1, is reported to ``progress``.
    """
    every = methods()
    times = {method.name: cost(walks[0], method.make) for method in every}
    rows = []
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
        progress((done + 1) / len(every))
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
