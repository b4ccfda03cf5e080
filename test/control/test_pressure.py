# SPDX-License-Identifier: Apache-2.0

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ros_pad.contact import force_limit
from ros_pad.contact.resistance import Foot
from ros_pad.control import dome_pressure
from ros_pad.errors import LimitError

FOOT = Foot.load('large37')


@given(load=st.floats(0.0, 12.0), margin=st.floats(1.0, 1.4))
def test_there_and_back_with_the_margin(load, margin):
    """At the chosen pressure pads carry the load times the margin; at 10 Pa less they do not."""
    assume(load * margin < 17.4)  # 37 pads carry 17.42 N at the ceiling of 90 kPa
    pressure = dome_pressure(FOOT, load, margin)
    assert pressure <= FOOT.ceiling
    assert FOOT.pads * force_limit(FOOT.pad, pressure, 'measured') >= load * margin - 1e-6
    if load > 0.0:
        assert FOOT.pads * force_limit(FOOT.pad, pressure - 10.1, 'measured') < load * margin


# By hand: 75 kPa + (1.2 · load / 37 - 0.2833 N) / (0.0125 N/kPa).
@pytest.mark.parametrize(('load', 'kilopascals'), [(4.0, 62.714), (6.8, 69.979), (10.0, 78.282)])
def test_the_line_of_the_measurements(load, kilopascals):
    assert dome_pressure(FOOT, load, 1.2) == pytest.approx(1000.0 * kilopascals, abs=10.0)


def test_more_load_than_the_ceiling_allows():
    with pytest.raises(LimitError) as caught:
        dome_pressure(FOOT, 14.6, 1.2)
    message = str(caught.value)
    for part in ('14.6 N', 'margin 1.2', '37 pads', 'large37', 'Pa', '90000 Pa'):
        assert part in message


def test_more_load_than_any_pressure_carries():
    with pytest.raises(
        LimitError, match=r'70 N with margin 1\.2 on 37 pads of large37 is more than domes carry'
    ):
        dome_pressure(FOOT, 70.0, 1.2)
