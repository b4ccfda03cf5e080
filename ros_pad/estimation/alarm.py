# SPDX-License-Identifier: Apache-2.0
"""Slip alarm: one-sided CUSUM tests (Page 1954) of the slip speed, for slow and for fast slip."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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

    __slots__ = ('_correlation_time', '_highest', '_speeds', '_threshold', 'statistics')

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

    def update(self, samples: Iterable[tuple[float, float, float]]) -> bool:
        """Process slip speeds, m/s, with their deviations, m/s, dt seconds after the last ones.

        Return whether the alarm is on after the last one.
        """
        weighed = []
        for speed, noise, dt in samples:
            stretch = self._correlation_time / dt
            weighed.append((speed, noise * noise * (stretch if stretch > 1.0 else 1.0)))
        threshold, highest, raised = self._threshold, self._highest, False
        for test, designed in enumerate(self._speeds):
            statistic, half, on = self.statistics[test], 0.5 * designed, False
            for speed, variance in weighed:
                statistic += designed / variance * (speed - half)
                on = statistic > threshold
                if not statistic > 0.0:
                    statistic = 0.0
                elif statistic > highest:
                    statistic = highest
            self.statistics[test] = statistic
            raised = raised or on
        return raised
