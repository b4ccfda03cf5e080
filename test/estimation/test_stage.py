# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from ros_pad.contact import Foot
from ros_pad.estimation import Tuning, doubt
from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import PRESSURE, SAMPLE, Block

MS = 1_000_000
FOOT, LOAD = Foot.load('large37'), 6.83


class Watched:
    """A stage of two feet, of which one is fed; what it makes and refuses is recorded."""

    def __init__(self, moments=False, period_ms=20):
        self.emitted, self.rejected = [], []
        self.stage = EstimationStage(
            FOOT, LOAD, Tuning(moment_noise=5e-4 if moments else 0.0), [3, 5], period_ms * MS,
            lambda leg, error: self.rejected.append((leg, error)),
        )  # fmt: skip

    def sample(self, ms, load=6.0, x=0.0, y=0.0, z=0.0, moment=math.nan):
        rows = SAMPLE.rows(2)
        rows['force'][0] = 0.5 + 1e-3 * ms % 7, 0.0, load
        rows['position'][0], rows['moment'][0] = (x, y, z), moment
        self.emitted += self.stage.process(Block.of(ms * MS, rows))

    def shown(self, field):
        return [(each.last_ns // MS, np.round(each.rows[field][0][0], 9)) for each in self.emitted]

    @property
    def doubts(self):
        rows = self.stage.estimate(0).rows[0]
        return [doubt.Doubt(*each) for each in zip(rows['doubt'], *rows['detail'].T, strict=True)]

    @property
    def track(self):
        return self.stage.tracks[0]


def test_a_hidden_marker_takes_the_last_position_with_its_age():
    watched = Watched()
    watched.sample(4, x=0.1)
    for ms in range(8, 80, 4):
        watched.sample(ms, x=math.nan)
    assert watched.stage.used == [19, 0]
    assert doubt.kind(watched.doubts[0].code) == 'marker lost'
    assert watched.doubts[0].a == pytest.approx(0.072)
    watched.sample(80, x=0.1)
    assert watched.track.sound


def test_pressures_that_are_no_number_or_too_large_leave_the_last_one():
    stage, rows = Watched().stage, PRESSURE.rows(2)
    for gauge in (60e3, math.nan, 2e7):
        rows['pressure'] = gauge, -gauge
        stage.pressure(Block.of(0, rows))
    assert stage._pressures == [60e3, -60e3]


@pytest.mark.parametrize('moments', [False, True])
def test_moments_count_where_they_are_measured(moments):
    watched = Watched(moments)
    for ms in (4, 14, 26):
        watched.sample(ms, moment=0.25)
    assert (watched.track.last.turning > 0.0) == moments
    watched.sample(30, moment=1e6)
    assert len(watched.rejected) == moments


def test_a_moment_read_in_the_air_is_taken_off():
    watched = Watched(moments=True)
    for ms in range(4, 2000, 4):
        load, z = (0.0, 0.015) if 400 < ms < 1600 else (6.0, 0.0)
        watched.sample(ms, load + 1e-3 * ms % 0.1, z=z + 1e-9 * ms, moment=0.25)
    assert watched.track.stands and watched.track.last.turning == pytest.approx(0.0, abs=0.1)


def test_estimates_are_made_once_a_period_whatever_the_blocks():
    stamps = np.arange(4, 60, 4) * MS
    rows = SAMPLE.rows(len(stamps), 2)
    rows['force'], rows['position'] = (0.5, 0.0, 6.0), 0.0
    rows['force'][..., 0] += 1e-3 * np.arange(len(stamps))[:, None]
    stage = Watched().stage
    found = stage.process(Block(stamps, rows))
    assert [each.last_ns for each in found] == [4 * MS, 20 * MS, 40 * MS]
    assert stage.samples == 14 and stage.used == [14, 14]
    assert stage.last_ns == 56 * MS


def test_a_stamp_that_does_not_advance_is_refused_and_becomes_a_doubt():
    watched = Watched()
    for ms in (8, 4):
        watched.sample(ms)
    assert watched.stage.samples == 1
    assert 'must be later than that of the last sample' in str(watched.rejected[0][1])
    watched.stage.tick(8 * MS)
    watched.stage.tick(500 * MS)
    assert [each.code for each in watched.doubts] == [doubt.REFUSED, doubt.NO_WRENCH]


def test_a_clock_that_is_set_back_is_followed():
    watched = Watched()
    for ms in (1000, 1004, 4, 8):
        watched.sample(ms)
    assert watched.stage.samples == 4 and not watched.rejected


def test_silence_is_a_doubt_that_ends_with_the_next_sample():
    watched = Watched()
    watched.sample(4, x=math.nan)
    for ms in (100, 500, 501):
        watched.stage.tick(ms * MS)
        kinds = [doubt.kind(each.code) for each in watched.doubts]
        assert kinds == (['no position', 'no wrench'] if ms > 500 else ['not yet'] * 2)
    watched.sample(504)
    assert doubt.kind(watched.doubts[0].code) == 'not yet'
    for ms in (700, 1200):
        watched.stage.tick(ms * MS)
    assert doubt.text(*watched.doubts[0]) == 'no wrench: for 0.5 s'
