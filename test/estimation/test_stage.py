# SPDX-License-Identifier: Apache-2.0
import math
import re

import pytest

from ros_pad.contact import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation.stage import LARGEST_FORCE
from ros_pad.estimation.stage import EstimationStage

MS = 1_000_000


class Watched:
    """A stage whose samples and output are recorded."""

    def __init__(self, moments=False, period_ms=20):
        self.samples, self.emitted, self.doubts, self.rejected = [], [], [], []
        self.estimates = []
        estimator = FootEstimator(
            Foot.load('large37'), 6.83, Tuning(moment_noise=5e-4 if moments else 0.0)
        )
        update = estimator.update

        def update_noting(*sample):
            estimate = update(*sample)
            self.samples.append(sample)
            self.estimates.append(estimate)
            return estimate

        estimator.update = update_noting
        self.stage = EstimationStage(
            estimator,
            period_ms * MS,
            self.emitted.append,
            self.doubts.append,
            self.rejected.append,
        )

    def wrench(self, ms, load=6.0, moment=0.25):
        self.stage.wrench(ms * MS, (0.5, 0.0, load), moment)

    def position(self, ms, x=0.0, y=0.0):
        self.stage.position(ms * MS, (x, y, 0.0))

    def sample(self, ms, load=6.0):
        self.wrench(ms, load)
        self.position(ms)

    def loads(self):
        return [(each.stamp_ns // MS, each.load) for each in self.emitted]

    def positions(self):
        return [(each.stamp_ns // MS, each.position) for each in self.emitted]


@pytest.mark.parametrize('first', ['wrench', 'position'])
def test_a_wrench_goes_with_the_position_of_its_stamp(first):
    watched = Watched()
    for ms in (4, 8):
        if first == 'wrench':
            watched.wrench(ms)
            watched.position(ms, x=ms / 1000)
        else:
            watched.position(ms, x=ms / 1000)
            watched.wrench(ms)
    assert [(each[0], each[2][0], each[5]) for each in watched.samples] == [
        (0.004, 0.004, 0.004),
        (0.008, 0.008, 0.008),
    ]


def test_without_a_position_of_its_own_the_last_one_counts():
    watched = Watched()
    watched.wrench(4)
    watched.position(4, x=0.004)
    watched.wrench(8)
    watched.position(7, x=math.nan)  # out of sight
    watched.wrench(12)
    assert [(each[0], each[2][0]) for each in watched.samples] == [(0.004, 0.004), (0.008, 0.004)]
    # The sample has the time of this position.
    assert watched.samples[1][5] == 0.004


def test_a_hidden_marker_takes_the_last_position_at_once():
    watched = Watched()
    watched.sample(4)
    watched.wrench(8)
    watched.position(8, x=math.nan)
    assert [(each[0], each[2][0], each[5]) for each in watched.samples] == [
        (0.004, 0.0, 0.004), (0.008, 0.0, 0.004),
    ]  # fmt: skip


def test_pressures_that_are_no_number_leave_the_last_one():
    watched = Watched()
    for ms, gauge in ((4, 60e3), (8, math.nan), (12, 70e3)):
        watched.stage.pressure(gauge)
        watched.wrench(ms)
        watched.position(ms)
    assert [each[3] for each in watched.samples] == [60e3, 60e3, 70e3]


@pytest.mark.parametrize(('moments', 'given'), [(False, None), (True, 0.25)])
def test_moments_count_where_they_are_measured(moments, given):
    watched = Watched(moments)
    watched.wrench(4)
    watched.position(4)
    assert watched.samples[0][4] == given


def test_estimates_are_emitted_once_a_period():
    watched = Watched()
    for ms in range(4, 60, 4):
        watched.wrench(ms)
        watched.position(ms)
    assert [each.stamp_ns for each in watched.emitted] == [4 * MS, 20 * MS, 40 * MS]
    assert watched.stage.samples == 14
    for emission, sample in zip(watched.emitted, (0, 4, 9), strict=True):
        assert emission.estimate is watched.estimates[sample]


def test_the_largest_normal_force_since_the_last_emission_counts():
    watched = Watched()
    for ms, load in ((4, 9.0), (8, 6.5), (12, 8.0), (16, 7.0), (20, 6.0), (24, 5.0), (40, 5.5)):
        watched.sample(ms, load)
    assert watched.loads() == [(4, 9.0), (20, 8.0), (40, 5.5)]


def test_the_force_of_the_next_wrench_does_not_count_yet():
    watched = Watched()
    watched.sample(4)
    watched.wrench(20, 6.0)
    watched.wrench(24, 9.0)  # this ends the wait for a position of the sample before
    assert watched.loads() == [(4, 6.0), (20, 6.0)]
    watched.position(24)
    watched.sample(40, 6.0)
    assert watched.loads()[2:] == [(40, 9.0)]


def test_forces_of_rejected_samples_count():
    watched = Watched()
    watched.sample(4)
    watched.sample(8)
    watched.sample(8, 9.0)  # a time stamp twice
    watched.sample(12, math.inf)
    watched.sample(16, math.nan)
    watched.sample(18, 2 * LARGEST_FORCE)  # is no load of a foot
    assert len(watched.rejected) == 4
    watched.sample(20, 6.0)
    watched.sample(40, 6.0)
    assert watched.loads() == [(4, 6.0), (20, 9.0), (40, 6.0)]


@pytest.mark.parametrize('last', [math.nan, math.inf, -math.inf])
def test_no_estimate_is_emitted_of_a_force_that_is_not_finite(last):
    watched = Watched()
    watched.sample(4)
    watched.sample(20, last)
    assert watched.loads() == [(4, 6.0)]
    watched.sample(24)
    assert watched.loads() == [(4, 6.0), (24, 6.0)]


def test_the_last_position_since_the_last_emission_is_emitted():
    watched = Watched()
    watched.wrench(4)
    watched.position(4, 0.1, 0.2)
    for ms in (8, 12, 16, 20):
        watched.wrench(ms)
        watched.position(ms, ms / 1000, -ms / 1000)
    assert watched.positions() == [(4, (0.1, 0.2)), (20, (0.02, -0.02))]


def test_without_a_new_position_none_is_emitted():
    watched = Watched()
    watched.sample(4)
    for ms in (8, 20, 24):
        watched.wrench(ms)
    assert watched.positions() == [(4, (0.0, 0.0)), (20, None)]
    watched.position(24, 0.3, 0.4)
    watched.wrench(40)
    watched.wrench(44)
    watched.wrench(60)
    watched.wrench(64)
    assert watched.positions()[2:] == [(40, (0.3, 0.4)), (60, None)]


def test_no_place_is_emitted_while_the_marker_is_hidden():
    watched = Watched()
    watched.sample(4)
    watched.wrench(8)
    watched.position(8, 0.3)
    watched.wrench(20)
    watched.position(20, math.nan, math.nan)
    watched.wrench(24)
    stamp_ms, place = watched.positions()[1]
    assert stamp_ms == 20 and all(map(math.isnan, place))
    watched.position(28, math.nan, math.nan)
    watched.position(32, 0.5, 0.6)  # in sight again
    watched.wrench(40)
    watched.wrench(44)
    assert watched.positions()[2:] == [(40, (0.5, 0.6))]


def test_a_rejected_sample_is_reported_and_left_out():
    watched = Watched()
    for ms in (8, 4):
        watched.wrench(ms)
        watched.position(ms)
    assert len(watched.samples) == 1 and isinstance(watched.rejected[0], InvalidInput)
    watched.stage.tick(8 * MS)
    watched.stage.tick(500 * MS)
    assert watched.doubts[-1].startswith('sample refused: time')
    assert not watched.stage.sound


def test_silence_is_reported_once_and_ends_with_the_next_sample():
    watched = Watched()
    watched.wrench(4)
    for ms in (100, 500, 501, 600):
        watched.stage.tick(ms * MS)
    assert watched.doubts == ['no position: for 0.4 s']
    watched.position(4)
    assert watched.stage.sound and len(watched.doubts) == 2
    for ms in (700, 1200):
        watched.stage.tick(ms * MS)
    assert re.fullmatch('no wrench: .*0.5 s', watched.doubts[-1])
