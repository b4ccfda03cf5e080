# SPDX-License-Identifier: Apache-2.0
"""What counts as a slip, as its detection, and as a false alarm."""

import math

import numpy as np
import pytest
from scipy import stats

from studies import slips

PERIOD, BEGIN = 4e-3, 1.0


def judged(speed, *alarms, load=()):
    """Judge 4 s of a foot; ``speed`` has rows (start, end, m/s), ``load`` spans without load."""
    true, loaded = np.zeros((1000, 1)), np.ones((1000, 1), dtype=bool)
    on = np.zeros((1000, 1), dtype=bool)
    for start, end, value in speed:
        true[round(start / PERIOD) : round(end / PERIOD)] = value
    for start, end in load or ((0.96, 1.0),):
        loaded[round(start / PERIOD) : round(end / PERIOD)] = False
    for start, end in alarms:
        on[round(start / PERIOD) : round(end / PERIOD)] = True
    place = np.cumsum(true, axis=0)[..., None] * np.array([PERIOD, 0.0])
    return slips.judged(on, loaded, place, PERIOD, BEGIN)


def test_a_slip_is_found_by_an_alarm_that_begins_in_it():
    slip = (2.0, 2.16, 0.05)  # 8 mm
    found = judged([slip], (2.1, 2.4))
    assert found.slips == {3e-3: 1, 5e-3: 1, 10e-3: 0}
    assert found.missed == dict.fromkeys(slips.SIZES, 0)
    assert found.delays == pytest.approx([0.1], abs=2.0 * PERIOD)
    assert found.false == 0
    assert judged([slip]).missed == {3e-3: 1, 5e-3: 1, 10e-3: 0}
    # One that is already on finds nothing, and was false.
    found = judged([slip], (1.5, 2.4))
    assert (found.missed[5e-3], found.false, found.delays) == (1, 1, [])


@pytest.mark.parametrize(
    ('speed', 'load', 'count'),
    [
        ([(2.0, 2.1, 0.045)], (), 0),  # 4.5 mm
        ([(2.0, 2.1, 0.045), (2.5, 2.6, 0.045)], (), 1),  # together 9 mm in one stance
        ([(2.0, 2.1, 0.045), (2.5, 2.6, 0.045)], [(0.96, 1.0), (2.3, 2.4)], 0),  # in two
        ([(2.0, 2.1, 0.045), (2.5, 2.6, -0.045)], (), 0),  # there and back
        ([(2.0, 3.0, 0.006)], (), 1),  # slowly
        ([(2.0, 2.5, 0.05)], [(0.96, 1.0), (1.9, 2.6)], 0),  # without load
        ([(0.5, 0.9, 0.05)], (), 0),  # before the walk
        ([(1.0, 1.02, 0.4)], (), 0),  # a skid at touch-down
    ],
)
def test_what_counts_as_a_slip(speed, load, count):
    assert judged(speed, load=load).slips[5e-3] == count


def test_a_foot_that_slides_on_from_touch_down_slips_from_then():
    found = judged([(1.0, 1.3, 0.05)], (1.012, 1.4))
    assert (found.slips[5e-3], found.missed[5e-3]) == (1, 0)
    assert found.delays == pytest.approx([0.012])


def test_false_alarms_and_time_of_sticking():
    slip = (2.0, 2.2, 0.05)
    assert judged([slip], (1.5, 1.6), (3.0, 3.1)).false == 2
    assert judged([slip], (2.25, 2.4)).false == 0  # within 0.1 s after it
    # Of 3 s less the landing, the slip, 0.1 s after it and 60 ms before it are no stick.
    assert 60.0 * judged([slip]).minutes == pytest.approx(3.0 - 0.024 - 0.36, abs=0.03)


def test_intervals_are_exact_for_few_and_by_walks_for_many():
    few = [judged([(2.0, 2.16, 0.05)], (2.1, 2.2)) for _ in range(4)]
    share, low, high = slips.missed(few, 5e-3)
    assert (share, low) == (0.0, 0.0)
    assert high == pytest.approx(stats.beta.ppf(0.975, 1, 4))  # Clopper and Pearson
    rate, low, high = slips.false_alarms(few)
    minutes = sum(each.minutes for each in few)
    assert (rate, low) == (0.0, 0.0)
    assert high * minutes == pytest.approx(-math.log(0.05))  # the rule of three
    many = [
        slips.Alarms(dict.fromkeys(slips.SIZES, 100), dict.fromkeys(slips.SIZES, missed))
        for missed in (0, 10, 20, 30)
    ]
    share, *interval = slips.missed(many, 5e-3)
    # The mean of four draws from four: between its 2.5 and 97.5 % quantile by enumeration.
    means = np.add.outer(np.arange(0, 40, 10), np.arange(0, 40, 10))
    means = np.add.outer(means, means).ravel() / 400
    assert share == 0.15
    assert interval == pytest.approx(np.quantile(means, [0.025, 0.975]), abs=0.02)
    assert slips.row_of([])['missed_5_mm'] is None
