# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.errors import InvalidInput
from ros_pad.pace import Pace


def test_first_stamp_of_each_period():
    pace = Pace(20)
    stamps = [4, 8, 12, 16, 20, 24, 39, 40, 41, 99, 100]
    assert [stamp for stamp in stamps if pace.due(stamp)] == [4, 20, 40, 99, 100]


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


def test_depends_on_the_stamps_alone():
    one, other = Pace(7), Pace(7)
    assert one.due(15)
    # Two paces that start at different stamps of a period agree from the next period on.
    assert other.due(20)
    for stamp in range(21, 100):
        assert one.due(stamp) == other.due(stamp)


def test_slower_input_is_always_due():
    pace = Pace(10)
    assert all(pace.due(stamp) for stamp in range(3, 1000, 11))


@pytest.mark.parametrize('period', [0, -1, 0.5, 1e9, None])
def test_bad_period(period):
    with pytest.raises(InvalidInput, match=r'period = .* ns: a whole number from 1'):
        Pace(period)
