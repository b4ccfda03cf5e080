# SPDX-License-Identifier: Apache-2.0
"""Slip alarm: one-sided CUSUM tests on the slip speed (Page 1954), of slow slips and fast ones."""

from __future__ import annotations

from collections.abc import Sequence

from ros_pad.contact.pad import number

SLOW_SLIP = 0.01
"""Slip speed worth an alarm, m/s ..."""

FAST_SLIP = 0.03
"""... and one that noise hides less, m/s: a test for one of them is slow to hear the other."""


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
        speed: float = SLOW_SLIP,
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


class SlipAlarms:
    """Several :class:`SlipAlarm` on one speed; the first to raise is heard.

    Parameters
    ----------
    noise, correlation_time : float
        As of each.
    speeds : sequence of float
        Of each, m/s.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    """

    __slots__ = ('_alarms',)

    def __init__(
        self,
        noise: float,
        correlation_time: float,
        speeds: Sequence[float] = (SLOW_SLIP, FAST_SLIP),
    ) -> None:
        self._alarms = [SlipAlarm(noise, correlation_time, speed) for speed in speeds]

    def reset(self) -> None:
        """Forget; call it at touch-down."""
        for alarm in self._alarms:
            alarm.reset()

    def update(self, speed: float, dt: float) -> bool:
        """Take one sample of the slip speed, m/s, dt seconds after the last; True is alarm."""
        raised = False
        for alarm in self._alarms:
            raised |= alarm.update(speed, dt)
        return raised
