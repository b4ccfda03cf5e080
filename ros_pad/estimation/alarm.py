# SPDX-License-Identifier: Apache-2.0
"""Slip speed, and its alarm: one-sided CUSUM tests (Page 1954) for slow and for fast slip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ros_pad.configuration import number
from ros_pad.contact.resistance import Foot
from ros_pad.estimation.tuning import Tuning

if TYPE_CHECKING:
    from ros_pad.estimation.track import Sample

SMOOTHING = 0.02
"""Time constant of the slip speed, s."""

SPEED_NOISE = 2e-3
"""Model error of the slip speed, added to that of the sensors, m/s: feet also roll and bend."""

BODY_CORRELATION = 0.15
"""Time over which errors of a measured velocity of the contact are the same, s: that of the body,
which is common to all feet, lasts for about a stance."""

SLOW_SLIP = 0.01
"""Slip speed for which the test for slow slip is designed, m/s."""

FAST_SLIP = 0.03
"""Slip speed for which the test for fast slip is designed, m/s. Each test alone detects slip at
the speed of the other test late.
"""


class SlipAlarm:
    """Raise an alarm when there is enough evidence for slip at one of several speeds.

    The statistic g ← max(0, g + v1/σ² (v - v1/2)) is the log-likelihood ratio of slip at v1 to
    stick, summed since the time when stick was last more likely than slip.

    Parameters
    ----------
    correlation_time : float
        Correlation time of the noise of the speed, s, from 0: samples closer together have less
        weight.
    speeds : sequence of float
        Slip speeds v1 for which there is a test, m/s, above 0.
    threshold : float
        Threshold of the statistics, nats, above 0. With independent noise of any level, at least
        e^threshold samples lie between false alarms of a test on average (Lorden 1971), mostly
        far more.

    Attributes
    ----------
    statistics : list of float
        The statistics g, nats, from 0 to 1.25 times the threshold.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    def __init__(
        self,
        correlation_time: float,
        speeds: Sequence[float] = (SLOW_SLIP, FAST_SLIP),
        threshold: float = Tuning.alarm_threshold,
    ) -> None:
        self._correlation_time = number('correlation_time', correlation_time, 's')
        self._threshold = number('threshold', threshold, '(nats)', above=True)
        self._highest = 1.25 * self._threshold  # so that the alarm ends soon after the slip
        self._speeds = [number('speed', speed, 'm/s', above=True) for speed in speeds]
        self.reset()

    def reset(self) -> None:
        """Discard all evidence; call it at touch-down."""
        self.statistics = [0.0] * len(self._speeds)

    def update(self, speed: float, noise: float, dt: float) -> bool:
        """Process a slip speed, m/s, with its deviation, m/s, dt seconds after the last one.

        Return whether the alarm is on.
        """
        variance = noise * noise * max(self._correlation_time / dt, 1.0)
        raised = False
        for test, designed in enumerate(self._speeds):
            statistic = self.statistics[test] + designed / variance * (speed - 0.5 * designed)
            raised |= statistic > self._threshold
            self.statistics[test] = min(max(0.0, statistic), self._highest)
        return raised


class Slip:
    """Slip of the contact of a foot.

    Attributes
    ----------
    softness : float
        Motion of the point whose motion is measured against the contact, by force, m/N.
    alarm : SlipAlarm
        Slip alarm.
    sd : float
        Standard deviation of the last slip speed, m/s; infinite while it is not known.
    noise, contact_noise : float
        That of the slip speed without the body's, m/s, and of a coordinate of the contact, m.
    """

    def __init__(self, foot: Foot, tuning: Tuning) -> None:
        self._joints = tuning.source == 'joints'
        self._shear = 1.0 / foot.shear_stiffness
        self.softness = self._shear if tuning.pads_shear or not self._joints else 0.0
        memory = BODY_CORRELATION if self._joints else SMOOTHING
        self.alarm = SlipAlarm(memory, threshold=tuning.alarm_threshold)
        # Smoothed position of the contact, m; with joints smoothed shear of the pads.
        self._x = self._y = self.noise = self.contact_noise = self.sd = 0.0

    def set_noise(self, position: float, force: float) -> None:
        """Use the noise of a coordinate, m, and of a component of the force, N."""
        self.contact_noise = math.hypot(position, force * self.softness)
        self.noise = math.hypot(self.contact_noise / SMOOTHING, SPEED_NOISE)

    def touch_down(self, sample: Sample, fx: float, fy: float) -> tuple[float, float]:
        """Begin a stance; return the contact, m: the pads shear under a force, N."""
        x, y = sample.x + fx * self._shear, sample.y + fy * self._shear
        sheared = fx * self.softness, fy * self.softness
        self._x, self._y = sheared if self._joints else (x, y)
        self.alarm.reset()
        return x, y

    def update(
        self, dt: float, sample: Sample, fx: float, fy: float
    ) -> tuple[float, bool, tuple[float, float]]:
        """Process a sample and its force without offset, N, dt seconds after the last one.

        Return slip speed, m/s, whether the alarm is on, and the place of the contact, m.
        """
        if not 0.0 < dt < math.inf:
            dt = 0.1 * SMOOTHING
        x, y = to_x, to_y = sample.x + fx * self._shear, sample.y + fy * self._shear
        if self._joints:
            to_x, to_y = fx * self.softness, fy * self.softness
        share = dt / (SMOOTHING + dt)
        self._x += share * (to_x - self._x)
        self._y += share * (to_y - self._y)
        self.sd = self.noise
        along_x, along_y = (to_x - self._x) / SMOOTHING, (to_y - self._y) / SMOOTHING
        if self._joints:
            self.sd = math.hypot(self.noise, math.sqrt(sample.variance))
            along_x, along_y = sample.vx + along_x, sample.vy + along_y
        else:
            x, y = self._x, self._y
        along = along_x * fx + along_y * fy
        pull = math.sqrt(fx * fx + fy * fy)
        # A foot gives way against its tangential force; the rest of its speed is only noise.
        speed = -along / pull if pull > 0.0 else 0.0
        return speed, self.alarm.update(speed, self.sd, dt), (x, y)
