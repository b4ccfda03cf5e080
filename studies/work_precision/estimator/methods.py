# SPDX-License-Identifier: Apache-2.0
"""Compare slip alarms: each method with each of its thresholds, on the same readings."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ros_pad.contact.resistance import Foot
from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.estimation.foot import FootEstimator, Tuning
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

RATIO, SPEED, CUSUM, BAYES, SHIPPED = (
    'T/N',
    'slip speed',
    'CUSUM',
    'Bayes, margin',
    'FootEstimator, alarm',
)
RATIOS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.6)
SPEEDS = (0.006, 0.01, 0.014, 0.02, 0.03, 0.04, 0.06, 0.1)  # m/s
CUSUM_SPEEDS = (0.01, 0.02, 0.04)  # m/s
CUSUM_THRESHOLDS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
MARGINS = (-0.3, -0.2, -0.15, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05)


class Detector(Protocol):
    """Slip alarm that processes the samples of a foot, as :meth:`FootEstimator.update` does."""

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample (s, N, m, Pa gauge); return whether the alarm is on."""


class RatioThreshold:
    """Alarm if T/N is above a threshold."""

    def __init__(self, settings: tuple[Foot, float, Tuning], threshold: float) -> None:
        self._gate, self._threshold = settings[2].load_gate * settings[1], threshold

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample; return whether the alarm is on."""
        x, y, load = force
        return load > self._gate and math.hypot(x, y) > self._threshold * load


class SpeedThreshold:
    """Alarm if the slip speed, computed as in the estimator, is above a threshold."""

    def __init__(self, settings: tuple[Foot, float, Tuning], threshold: float) -> None:
        foot, load, tuning = settings
        self._gate, self._threshold = tuning.load_gate * load, threshold
        self._stiffness, self._smoothing = foot.shear_stiffness, tuning.smoothing
        self._time: float | None = None
        self._x = self._y = 0.0

    def speed(
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
        share = dt / (self._smoothing + dt)
        self._x += share * (x - self._x)
        self._y += share * (y - self._y)
        along = (x - self._x) * push_x + (y - self._y) * push_y
        return -along / (self._smoothing * (math.hypot(push_x, push_y) or math.inf)), dt

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample; return whether the alarm is on."""
        found = self.speed(time, force, position)
        return found is not None and found[0] > self._threshold


class SpeedCusum(SpeedThreshold):
    """The test of :class:`SlipAlarm`, a CUSUM, on the speed of :class:`SpeedThreshold`."""

    def __init__(
        self, settings: tuple[Foot, float, Tuning], speed: float, threshold: float
    ) -> None:
        super().__init__(settings, math.inf)
        self._noise, self._alarm = alarm_of(settings, speed, threshold)

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample; return whether the alarm is on."""
        found = self.speed(time, force, position)
        if found is None:
            self._alarm.reset()
            return False
        speed, dt = found
        return self._alarm.update(speed, self._noise, dt)


class BayesMargin:
    """Alarm if the friction margin of :class:`FootEstimator` is below a threshold."""

    def __init__(self, settings: tuple[Foot, float, Tuning], threshold: float) -> None:
        self._estimator, self._threshold = FootEstimator(*settings), threshold

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample; return whether the alarm is on."""
        now = self._estimator.update(time, force, position, pressure)
        return now.standing and now.margin < self._threshold


class ShippedAlarm:
    """The alarm of :class:`FootEstimator`."""

    def __init__(self, settings: tuple[Foot, float, Tuning]) -> None:
        self._estimator = FootEstimator(*settings)

    def update(
        self, time: float, force: Sequence[float], position: Sequence[float], pressure: float
    ) -> bool:
        """Process one sample; return whether the alarm is on."""
        return self._estimator.update(time, force, position, pressure).slipping


def alarm_of(
    settings: tuple[Foot, float, Tuning], speed: float, threshold: float
) -> tuple[float, SlipAlarm]:
    """Return the noise that the estimator assumes, and the alarm for a slip speed, both in m/s."""
    foot, _, tuning = settings
    noise = math.hypot(tuning.position_noise, tuning.force_noise / foot.shear_stiffness)
    noise = math.hypot(noise / tuning.smoothing, tuning.speed_noise)
    return noise, SlipAlarm(tuning.smoothing, (speed,), threshold)


@dataclass(frozen=True)
class Setting:
    """A method with a threshold.

    Attributes
    ----------
    name, variant : str
    value : float
        Threshold.
    unit : str
    make : callable
        Returns a detector for the arguments of an estimator.
    """

    name: str
    variant: str
    value: float
    unit: str
    make: Callable[[tuple[Foot, float, Tuning]], Detector]


def settings() -> list[Setting]:
    """Return every method with its thresholds."""

    def of(kind: Any, *values: float) -> Callable[[tuple[Foot, float, Tuning]], Detector]:
        return lambda settings: kind(settings, *values)

    found = [Setting(RATIO, '', r, '', of(RatioThreshold, r)) for r in RATIOS]
    found += [Setting(SPEED, '', v, 'm/s', of(SpeedThreshold, v)) for v in SPEEDS]
    found += [
        Setting(CUSUM, f'{1e3 * speed:g} mm/s', threshold, '', of(SpeedCusum, speed, threshold))
        for speed in CUSUM_SPEEDS
        for threshold in CUSUM_THRESHOLDS
    ]
    found += [Setting(BAYES, '', m, '', of(BayesMargin, m)) for m in MARGINS]
    return [*found, Setting(SHIPPED, '', 0.0, '', ShippedAlarm)]


def detect(walk: Recording, make: Callable[[tuple[Foot, float, Tuning]], Detector]) -> Flags:
    """Return whether the alarm of a detector is on, array (samples, legs)."""
    out = np.zeros(walk.load.shape, dtype=bool)
    stamps = walk.stamps.tolist()
    for leg, mine in enumerate(walk.rows):
        update = make(walk.settings).update
        out[:, leg] = [
            update(stamp, row[:3], row[3:6], row[6])
            for stamp, row in zip(stamps, mine, strict=True)
        ]
    return out


def compare(walks: Sequence[Recording], progress: Progress) -> list[Row]:
    """Measure each method with each of its thresholds on the same readings.

    Progress, 0 to 1, is reported to ``progress``.
    """
    every = settings()
    # The margin does not depend on the threshold, so it is estimated once.
    estimates = [replay(walk) for walk in walks]
    times = {setting.name: cost(walks[0], setting.make) for setting in every}
    rows = []
    for done, setting in enumerate(every):
        tally = Tally()
        for walk, mine in zip(walks, estimates, strict=True):
            if setting.name == BAYES:
                alarms = mine.standing & (mine.margin < setting.value)
            elif setting.name == SHIPPED:
                alarms = mine.slipping
                count_estimates(tally, walk, mine)
            else:
                alarms = detect(walk, setting.make)
            count_alarms(tally, walk, alarms)
        rows.append(
            row_of(
                tally, times[setting.name], part='methods', name=setting.name,
                variant=setting.variant, value=setting.value, unit=setting.unit,
                shipped=setting.name == SHIPPED,
            )
        )  # fmt: skip
        progress((done + 1) / len(every))
    return rows


def cost(walk: Recording, make: Callable[[tuple[Foot, float, Tuning]], Detector]) -> float:
    """Return the mean time of an update over a walk of one leg, us, the best of three runs."""
    stamps = walk.stamps.tolist()
    # Indexing is done before timing, because it is not part of the method.
    samples = [(t, r[:3], r[3:6], r[6]) for t, r in zip(stamps, walk.rows[0], strict=True)]
    best = math.inf
    for _ in range(3):
        update = make(walk.settings).update
        start = time.perf_counter()
        for sample in samples:
            update(*sample)
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / len(samples)
