# SPDX-License-Identifier: Apache-2.0
"""Slip alarm: one-sided CUSUM tests (Page 1954) of the slip speed, for slow and for fast slip."""

from __future__ import annotations

from collections.abc import Sequence

from ros_pad.configuration import number

SLOW_SLIP = 0.01
"""Slip speed for which the test for slow slip is designed, m/s."""

FAST_SLIP = 0.03
"""Slip speed for which the test for fast slip is designed, m/s. Each test alone detects slip at
the speed of the other test late.
"""

THRESHOLD = 4.0
"""Threshold of the statistic, nats."""


class SlipAlarm:
    """Raise an alarm when there is enough evidence for slip at a given speed.

    The statistic g ← max(0, g + v1/σ² (v - v1/2)) is the log-likelihood ratio of slip at v1 to
    stick, summed since the time when stick was last more likely than slip.

    Parameters
    ----------
    noise : float
        Standard deviation of the speed while the foot sticks, m/s, above 0.
    correlation_time : float
        Correlation time of the noise of the speed, s, from 0: samples closer together have less
        weight.
    speed : float
        Slip speed v1 for which the test is designed, m/s, above 0.
    threshold : float
        Threshold of the statistic, nats, above 0. With independent noise of any level, at least
        e^threshold samples lie between false alarms on average (Lorden 1971), mostly far more.

    Attributes
    ----------
    statistic : float
        The statistic g, nats, from 0 to 1.25 times the threshold.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    __slots__ = (
        '_correlation_time', '_half', '_highest', '_speed', '_threshold', '_variance', 'statistic',
    )  # fmt: skip

    def __init__(
        self,
        noise: float,
        correlation_time: float,
        speed: float = SLOW_SLIP,
        threshold: float = THRESHOLD,
    ) -> None:
        self._variance = number('noise', noise, 'm/s', above=True) ** 2
        self._correlation_time = number('correlation_time', correlation_time, 's')
        self._speed = number('speed', speed, 'm/s', above=True)
        self._threshold = number('threshold', threshold, '(nats)', above=True)
        self._half = 0.5 * self._speed
        self._highest = 1.25 * self._threshold  # so that the alarm ends soon after the slip
        self.statistic = 0.0

    def set_noise(self, noise: float) -> None:
        """Change the standard deviation of the speed, m/s, above 0, for the next samples."""
        self._variance = noise * noise

    def reset(self) -> None:
        """Discard all evidence; call it at touch-down."""
        self.statistic = 0.0

    def update(self, speed: float, dt: float) -> bool:
        """Process a slip speed, m/s, measured dt seconds after the previous one.

        Return whether the alarm is on.
        """
        stretch = self._correlation_time / dt
        variance = self._variance * stretch if stretch > 1.0 else self._variance
        statistic = self.statistic + self._speed / variance * (speed - self._half)
        if not statistic > 0.0:
            self.statistic = 0.0
            return False
        self.statistic = statistic if statistic < self._highest else self._highest
        return statistic > self._threshold


class SlipAlarms:
    """Run several :class:`SlipAlarm` on one slip speed; the alarm is on when any of them is on.

    Parameters
    ----------
    noise, correlation_time : float
        As for :class:`SlipAlarm`, the same for all.
    speeds : sequence of float
        Slip speed for which each alarm is designed, m/s.
    threshold : float
        Threshold of each alarm, nats.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    __slots__ = ('_alarms',)

    def __init__(
        self,
        noise: float,
        correlation_time: float,
        speeds: Sequence[float] = (SLOW_SLIP, FAST_SLIP),
        threshold: float = THRESHOLD,
    ) -> None:
        self._alarms = [SlipAlarm(noise, correlation_time, speed, threshold) for speed in speeds]

    def reset(self) -> None:
        """Discard all evidence; call it at touch-down."""
        for alarm in self._alarms:
            alarm.reset()

    def set_noise(self, noise: float) -> None:
        """Change the standard deviation of the speed, m/s, above 0, for the next samples."""
        for alarm in self._alarms:
            alarm.set_noise(noise)

    def update(self, speed: float, dt: float) -> bool:
        """Process a slip speed, m/s, measured dt seconds after the previous one.

        Return whether the alarm is on.
        """
        raised = False
        for alarm in self._alarms:
            if alarm.update(speed, dt):
                raised = True
        return raised
