# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy import stats

from ros_pad.estimation.alarm import FAST_SLIP, SLOW_SLIP, SlipAlarm

NEVER = 1e6  # nats, a threshold that is never reached


class Alarm:
    """An alarm for samples with the same noise, by default for slow slip."""

    def __init__(self, noise, tau, *speeds, threshold=4.0):
        self.noise, self._alarm = noise, SlipAlarm(tau, speeds or (SLOW_SLIP,), threshold)
        self.reset = self._alarm.reset

    def update(self, speed, dt):
        return self._alarm.update(speed, self.noise, dt)

    @property
    def statistic(self):
        return self._alarm.statistics[0]


@pytest.mark.parametrize(('tau', 'dt', 'weight'), [(0.0, 0.004, 1.0), (0.02, 0.004, 5.0)])
def test_the_statistic_is_the_largest_log_likelihood_ratio_of_any_onset(tau, dt, weight):
    """Page's recursion equals the definition: the maximum over all onsets, here by SciPy."""
    noise, v1 = 0.012, 0.03
    speeds = np.random.default_rng(3).normal(0.01, 0.02, size=120)
    wide = noise * math.sqrt(weight)
    ratios = stats.norm.logpdf(speeds, v1, wide) - stats.norm.logpdf(speeds, 0.0, wide)
    alarm = Alarm(noise, tau, v1, threshold=NEVER)
    found, expected = [], []
    for n, speed in enumerate(speeds, start=1):
        assert alarm.update(float(speed), dt) is False
        found.append(alarm.statistic)
        expected.append(max(0.0, *(ratios[onset:n].sum() for onset in range(n))))
    assert max(expected) > 3.0 and min(expected) == 0.0
    assert found == pytest.approx(expected, abs=1e-9)


def run_length(shift, generator):
    """Return the samples until the alarm; v1 is one standard deviation, the threshold is 4."""
    alarm = Alarm(0.03, 0.0, 0.03, threshold=4.0)
    count = 0
    while True:
        for speed in generator.normal(0.03 * shift, 0.03, size=200).tolist():
            count += 1
            if alarm.update(speed, 0.004):
                return count


# Average run lengths of the one-sided CUSUM with reference value 1/2 and decision interval 4, in
# standard deviations (Montgomery, Introduction to Statistical Quality Control: 168 for the
# two-sided chart at no shift, hence 336; 26.6 and 8.38 at shifts of 1/2 and 1).
@pytest.mark.parametrize(('shift', 'expected', 'runs'), [(0.0, 336.0, 1000), (1.0, 8.38, 1500)])
def test_average_run_lengths_are_those_of_the_tables(shift, expected, runs):
    generator = np.random.default_rng(11)
    lengths = [run_length(shift, generator) for _ in range(runs)]
    error = np.std(lengths) / math.sqrt(runs)
    assert error < 0.04 * expected
    assert np.mean(lengths) == pytest.approx(expected, abs=3.0 * error + 0.01 * expected)


def test_slow_and_fast_slips_are_detected_by_their_own_tests():
    """In noise of 7.5 mm/s slips of 12 and 80 mm/s are each found in less than half the time
    that the test for the other speed needs."""

    def delay(alarm, speed):
        random = np.random.default_rng(3)
        delays = []
        for _ in range(200):
            alarm.reset()
            count = 0
            while not alarm.update(speed + random.normal(0.0, 0.0075), 0.004):
                count += 1
                assert count < 2000
            delays.append(count)
        return np.mean(delays)

    slow, fast = (Alarm(0.0075, 0.02, speed) for speed in (SLOW_SLIP, FAST_SLIP))
    both = Alarm(0.0075, 0.02, SLOW_SLIP, FAST_SLIP)
    assert delay(both, 0.012) < 0.5 * delay(fast, 0.012)
    assert delay(both, 0.08) < 0.5 * delay(slow, 0.08)
    for speed in (0.012, 0.03, 0.08):
        assert delay(both, speed) <= min(delay(slow, speed), delay(fast, speed)) + 1e-9
