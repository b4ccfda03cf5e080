# SPDX-License-Identifier: Apache-2.0
"""Slip alarm: a one-sided CUSUM test on the slip speed (Page 1954)."""

from __future__ import annotations

from ros_pad.contact.pad import number


class SlipAlarm:
    """Raises when the evidence for slip at a given speed has piled up.

    The statistic g ← max(0, g + v1/σ² (v - v1/2)) is the log-likelihood ratio of slip at v1
    against stick, added up since stick last looked likelier.

    Parameters
    ----------
    noise : float
        Standard deviation of the speed while the foot sticks, m/s, above 0.
    correlation_time : float
        Over which the noise of the speed is correlated, s: samples closer than this count less.
    speed : float
        Slip speed v1 worth an alarm, m/s, above 0.
    threshold : float
        Of the statistic, above 0. With independent noise at least e^threshold samples pass between
        false alarms on average, whatever the noise (Lorden 1971); mostly far more.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    """

    __slots__ = ('_correlation_time', '_noise', '_speed', '_threshold', 'statistic')

    def __init__(
        self,
        noise: float,
        correlation_time: float,
        speed: float = 0.01,
        threshold: float = 4.0,
    ) -> None:
        self._noise = number('noise', noise, 'm/s', above=True)
        self._correlation_time = number('correlation_time', correlation_time, 's')
        self._speed = number('speed', speed, 'm/s', above=True)
        self._threshold = number('threshold', threshold, '(nats)', above=True)
        self.statistic = 0.0

    def reset(self) -> None:
        """Forget; call it at touch-down."""
        self.statistic = 0.0

    def update(self, speed: float, dt: float) -> bool:
        """Take one sample of the slip speed, m/s, dt seconds after the last; True is alarm."""
        variance = self._noise**2 * max(1.0, self._correlation_time / dt)
        gain = self._speed / variance * (speed - 0.5 * self._speed)
        # Bounded above so that the alarm ends soon after the slip does.
        self.statistic = min(max(0.0, self.statistic + gain), 1.25 * self._threshold)
        return self.statistic > self._threshold
