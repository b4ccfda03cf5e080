# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.pace import Pace, RealTime


@given(st.integers(1, 10**9), st.lists(st.integers(0, 10**6), min_size=1, max_size=50), st.data())
def test_once_in_each_period_whatever_the_start(period, gaps, data):
    stamp = data.draw(st.integers(0, 10**18))
    pace = Pace(period)
    dues = []
    stamps = []
    for gap in gaps:
        stamp += gap
        stamps.append(stamp)
        if pace.due(stamp):
            dues.append(stamp)
    assert dues[0] == stamps[0]
    assert [due // period for due in dues] == sorted({stamp // period for stamp in stamps})


# --- real time ----------------------------------------------------------------------------------

MS = 1_000_000


def test_each_period_is_due_once_and_late_ones_together():
    clock = RealTime(4 * MS, 1000 * MS)
    times = {1003: 0, 1004: 1, 1005: 0, 1007: 0, 1009: 1, 1012: 1, 1020: 2, 1035: 3, 1036: 1}
    assert {ms: clock.due(ms * MS) for ms in times} == times


@given(
    st.integers(1, 30 * MS), st.integers(0, 10**18),
    st.lists(st.integers(0, 50 * MS), max_size=50),
)  # fmt: skip
def test_short_delays_lose_no_time(period, start, gaps):
    clock, now, passed = RealTime(period, start), start, 0
    for gap in gaps:
        now += gap
        passed += clock.due(now)
        # Samples that were due, but have not passed, have less than a period left to wait.
        assert passed == (now - start) // period


def test_more_than_a_tenth_of_a_second_is_lost():
    clock = RealTime(4 * MS, 0)
    assert clock.due(100 * MS) == 25
    assert clock.due(1100 * MS) == 25  # of 250
    assert clock.due(1103 * MS) == 0
    assert clock.due(1104 * MS) == 1  # it does not run after the lost time


def test_a_period_longer_than_the_limit_passes_once():
    clock = RealTime(300 * MS, 0)
    assert [clock.due(ms * MS) for ms in (299, 300, 599, 1500)] == [0, 1, 0, 1]


def test_the_speed_is_that_since_the_last_call():
    clock = RealTime(4 * MS, 0)
    assert clock.speed(0) == 0.0
    for ms in range(20, 1001, 20):  # late, but within the limit: time is kept
        assert clock.due(ms * MS) == 5
    assert clock.speed(1000 * MS) == pytest.approx(1.0)
    for ms in range(1200, 2001, 200):  # later than the limit: time is lost
        assert clock.due(ms * MS) == 25
    assert clock.speed(2000 * MS) == pytest.approx(0.5)
