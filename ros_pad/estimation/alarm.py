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
        threshold: float = THRESHOLD,
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
