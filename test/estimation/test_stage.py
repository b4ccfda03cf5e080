# SPDX-License-Identifier: Apache-2.0
import math
import re

import pytest

from ros_pad.contact import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator
from ros_pad.estimation import Tuning
from ros_pad.estimation.stage import EstimationStage

MS = 1_000_000


class Watched:
    """A stage whose samples and output are recorded."""

    def __init__(self, moments=False, period_ms=20):
        self.samples, self.emitted, self.doubts, self.rejected = [], [], [], []
        estimator = FootEstimator(
            Foot.load('large37'), 6.83, Tuning(moment_noise=5e-4 if moments else 0.0)
        )
        update = estimator.update

        def update_noting(*sample):
            estimate = update(*sample)
            self.samples.append(sample)
            return estimate

        estimator.update = update_noting
        self.stage = EstimationStage(
            estimator,
            period_ms * MS,
            lambda stamp_ns, estimate: self.emitted.append(stamp_ns // MS),
            self.doubts.append,
            self.rejected.append,
        )

    def wrench(self, ms, load=6.0, moment=0.25):
        self.stage.wrench(ms * MS, (0.5, 0.0, load), moment)

    def position(self, ms, x=0.0):
        self.stage.position(ms * MS, (x, 0.0, 0.0))


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
    assert watched.emitted == [4, 20, 40]
    assert watched.stage.samples == 14


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
