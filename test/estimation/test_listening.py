# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from ros_pad.contact import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator
from ros_pad.estimation.listening import FootListener

MS = 1_000_000


class Ear:
    """A listener, and all that it tells."""

    def __init__(self, moments=False, period_ms=20):
        self.samples, self.told, self.doubts, self.refused = [], [], [], []
        estimator = FootEstimator(Foot.load('large37'), 6.83)
        update = estimator.update

        def watched(*sample):
            estimate = update(*sample)
            self.samples.append(sample)
            return estimate

        estimator.update = watched
        self.listener = FootListener(
            estimator,
            period_ms * MS,
            moments,
            lambda stamp_ns, estimate: self.told.append(stamp_ns // MS),
            self.doubts.append,
            self.refused.append,
        )

    def wrench(self, ms, load=6.0, moment=0.25):
        self.listener.wrench(ms * MS, (0.5, 0.0, load), moment)

    def position(self, ms, x=0.0):
        self.listener.position(ms * MS, (x, 0.0, 0.0))


@pytest.mark.parametrize('first', ['wrench', 'position'])
def test_a_wrench_goes_with_the_position_of_its_stamp(first):
    ear = Ear()
    for ms in (4, 8):
        if first == 'wrench':
            ear.wrench(ms)
            ear.position(ms, x=ms / 1000)
        else:
            ear.position(ms, x=ms / 1000)
            ear.wrench(ms)
    assert [(each[0], each[2][0], each[5]) for each in ear.samples] == [
        (0.004, 0.004, 0.004),
        (0.008, 0.008, 0.008),
    ]


def test_without_a_position_of_its_own_the_last_one_counts():
    ear = Ear()
    ear.wrench(4)
    ear.position(4, x=0.004)
    ear.wrench(8)
    ear.position(7, x=math.nan)  # out of sight
    ear.wrench(12)
    assert [(each[0], each[2][0]) for each in ear.samples] == [(0.004, 0.004), (0.008, 0.004)]
    # How old it is is known.
    assert ear.samples[1][5] == 0.004


def test_pressures_that_are_no_number_leave_the_last_one():
    ear = Ear()
    for ms, gauge in ((4, 60e3), (8, math.nan), (12, 70e3)):
        ear.listener.pressure(gauge)
        ear.wrench(ms)
        ear.position(ms)
    assert [each[3] for each in ear.samples] == [60e3, 60e3, 70e3]


@pytest.mark.parametrize(('moments', 'given'), [(False, None), (True, 0.25)])
def test_moments_count_where_they_are_measured(moments, given):
    ear = Ear(moments)
    ear.wrench(4)
    ear.position(4)
    assert ear.samples[0][4] == given


def test_estimates_are_told_once_a_period():
    ear = Ear()
    for ms in range(4, 60, 4):
        ear.wrench(ms)
        ear.position(ms)
    assert ear.told == [4, 20, 40]
    assert ear.listener.samples == 14


def test_what_is_refused_is_told_and_left_out():
    ear = Ear()
    for ms in (8, 4):
        ear.wrench(ms)
        ear.position(ms)
    assert len(ear.samples) == 1 and isinstance(ear.refused[0], InvalidInput)
    ear.listener.listen(8 * MS)
    ear.listener.listen(500 * MS)
    assert ear.doubts[-1].startswith('sample refused: time')
    assert not ear.listener.sound


def test_silence_is_told_once_and_ends_with_the_next_sample():
    ear = Ear()
    ear.wrench(4)
    for ms in (100, 500, 501, 600):
        ear.listener.listen(ms * MS)
    assert ear.doubts == ['no position: for 0.4 s']
    ear.position(4)
    assert ear.listener.sound and len(ear.doubts) == 2
    for ms in (700, 1200):
        ear.listener.listen(ms * MS)
    assert ear.doubts[-1] == 'no wrench: for 0.5 s'
