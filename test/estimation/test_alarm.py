# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from ros_pad.estimation.alarm import SlipAlarm

DT, NOISE = 0.004, 0.03


def test_the_displacement_is_the_largest_since_any_onset():
    """Page's recursion equals the definition: the maximum over all onsets."""
    speeds = np.random.default_rng(3).normal(0.01, 0.02, size=120)
    alarm, found, expected = SlipAlarm(), [], []
    for n, speed in enumerate(speeds, start=1):
        assert alarm.update(float(speed), 0.01, math.inf, DT) is False
        found.append(alarm.displacement)
        sums = [(speeds[onset:n] - 0.01).sum() * DT for onset in range(n)]
        expected.append(max(0.0, *sums))
    assert max(expected) > 3e-4 and min(expected) == 0.0
    assert found == pytest.approx(expected, abs=1e-12)


def run_length(shift, generator):
    """Return the samples until the alarm; the allowed speed is half a standard deviation."""
    alarm, count = SlipAlarm(), 0
    while True:
        for speed in generator.normal(NOISE * shift, NOISE, size=200).tolist():
            count += 1
            if alarm.update(speed, 0.5 * NOISE, 4.0 * NOISE * DT, DT):
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


def test_a_slip_raises_it_after_the_distance_and_it_ends_soon_after():
    """At 60 mm/s, 10 allowed, 0.51 mm take 10.2 ms; a quarter of it goes at 10 mm/s in 12.8."""
    alarm = SlipAlarm()
    on = [alarm.update(0.06, 0.01, 5.1e-4, 1e-3) for _ in range(50)]
    assert on.index(True) == 10 and all(on[10:])
    off = [alarm.update(0.0, 0.01, 5.1e-4, 1e-3) for _ in range(20)]
    assert off.index(False) == 12 and not any(off[12:])
