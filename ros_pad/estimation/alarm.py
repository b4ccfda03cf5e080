# SPDX-License-Identifier: Apache-2.0
"""Slip alarm: one-sided CUSUM tests (Page 1954) of the slip speed, for slow and for fast slip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_pad.configuration import number
from ros_pad.records import Array

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
    feet : int
        Number of feet.

    Attributes
    ----------
    state : array (speeds, feet)
        The statistics g, nats, from 0 to 1.25 times the threshold.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    __slots__ = ('_correlation_time', '_speeds', '_threshold', 'state')

    def __init__(
        self,
        correlation_time: float,
        speeds: Sequence[float] = (SLOW_SLIP, FAST_SLIP),
        threshold: float = THRESHOLD,
        feet: int = 1,
    ) -> None:
        self._correlation_time = number('correlation_time', correlation_time, 's')
        self._threshold = number('threshold', threshold, '(nats)', above=True)
        speeds = [number('speed', speed, 'm/s', above=True) for speed in speeds]
        self._speeds = np.array(speeds)[:, None]
        self.state = np.zeros((len(speeds), feet))

    def update(self, speeds: Array, noises: Array, dt: Array) -> Array:
        """Process slip speeds, m/s, with standard deviations, m/s, dt seconds after the last ones.

        All have rows of samples and columns of feet, or one for all. Return for each foot whether
        the alarm is on after the last sample.
        """
        weights = noises * noises * np.maximum(self._correlation_time / dt, 1.0)
        gains = self._speeds / weights[:, None] * (speeds[:, None] - 0.5 * self._speeds)
        statistic = self.state
        for gain in gains:
            gain += statistic
            statistic = np.minimum(np.maximum(gain, 0.0), 1.25 * self._threshold)
        self.state[:] = statistic  # capped, so that the alarm ends soon after the slip
        raised: Array = (gains[-1] > self._threshold).any(axis=0)
        return raised
