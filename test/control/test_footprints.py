# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.control.footprints import Footprints
from ros_pad.errors import InvalidInput


def test_nothing_felt_is_the_prior():
    assert Footprints(wet_prior=0.3).wet_probability(1.0, 2.0) == 0.3


@pytest.mark.parametrize(('distance', 'share'), [(0.0, 1.0), (0.5, 0.606531), (2.0, 0.135335)])
def test_a_footprint_fades_with_distance(distance, share):
    prints = Footprints(wet_prior=0.4, fading_length=1.0)
    prints.add(3.0, -1.0, 0.9)
    angle = 0.7
    x, y = 3.0 + distance * math.cos(angle), -1.0 + distance * math.sin(angle)
    assert prints.wet_probability(x, y) == pytest.approx(0.4 + 0.5 * share, abs=1e-6)


def test_the_strongest_wins():
    prints = Footprints()
    prints.add(0.0, 0.0, 0.95)
    prints.add(1.0, 0.0, 0.1)
    # Half-way wet, 0.45 off the prior, says more than dry, 0.4 off it; nearer to dry it is dry.
    assert prints.wet_probability(0.5, 0.0) == pytest.approx(0.5 + 0.45 * math.exp(-0.5))
    assert prints.wet_probability(0.9, 0.0) == pytest.approx(0.5 - 0.4 * math.exp(-0.1))


def test_of_equal_ones_the_last_wins():
    prints = Footprints()
    prints.add(0.0, 0.0, 0.9)
    prints.add(0.0, 0.0, 0.1)
    assert prints.wet_probability(0.0, 0.0) == pytest.approx(0.1)


def test_a_footprint_that_says_nothing_hides_none():
    prints = Footprints()
    prints.add(0.0, 0.0, 0.9)
    prints.add(0.0, 0.0, 0.5)
    assert prints.wet_probability(0.0, 0.0) == pytest.approx(0.9)


def test_memory_is_short():
    prints = Footprints(memory=3)
    prints.add(0.0, 0.0, 0.99)
    for step in range(3):
        prints.add(10.0 + step, 0.0, 0.4)
    assert prints.wet_probability(0.0, 0.0) == pytest.approx(0.5, abs=1e-4)


@given(
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0, 1)), max_size=70),
    st.floats(0, 1),
    st.floats(-9, 9),
)
def test_probabilities_stay_probabilities(felt, prior, x):
    prints = Footprints(wet_prior=prior)
    for print_ in felt:
        prints.add(*print_)
    assert -1e-12 <= prints.wet_probability(x, 0.0) <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ('name', 'value'),
    [('wet_prior', 1.5), ('wet_prior', math.nan), ('fading_length', 0.0), ('memory', 0)],
)
def test_bad_values_are_named(name, value):
    with pytest.raises(InvalidInput, match=name):
        Footprints(**{name: value})
