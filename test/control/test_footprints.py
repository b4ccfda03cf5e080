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
    # Half-way the wet footprint counts: it differs more from the prior, by 0.45, than the dry one,
    # by 0.4. Near the dry footprint that one counts.
    assert prints.wet_probability(0.5, 0.0) == pytest.approx(0.5 + 0.45 * math.exp(-0.5))
    assert prints.wet_probability(0.9, 0.0) == pytest.approx(0.5 - 0.4 * math.exp(-0.1))


def test_of_equal_ones_the_last_wins():
    prints = Footprints()
    prints.add(0.0, 0.0, 0.9)
    prints.add(0.0, 0.0, 0.1)
    assert prints.wet_probability(0.0, 0.0) == pytest.approx(0.1)


def test_an_undecided_footprint_hides_none():
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


def test_the_wet_share_counts_ways_not_feet():
    """By hand: prior Beta(1, 1), three distances of 1 m that count 1 - 1/e each, times 0.9 as
    footprints of 0.95 are 90 % certain."""
    prints = Footprints()
    for step in range(4):
        for foot in range(6):
            # Six feet on one place count as one.
            prints.add(float(step), 0.1 * foot, 0.95, walked=0.0 if foot or not step else 1.0)
    told = 3 * 0.9 * 0.632121
    assert prints.wet_share == pytest.approx((1.0 + 0.95 * told) / (2.0 + told), abs=1e-6)


def test_feet_that_could_not_tell_teach_no_share():
    prints = Footprints(wet_prior=0.3)
    for step in range(50):
        prints.add(float(step), 0.0, 0.5, walked=1.0)
    assert prints.wet_share == pytest.approx(0.3)


@pytest.mark.parametrize(('felt', 'least', 'most'), [(0.97, 0.85, 0.97), (0.03, 0.03, 0.15)])
def test_on_ground_that_is_all_alike_the_share_is_learnt(felt, least, most):
    prints = Footprints()
    for step in range(60):
        prints.add(0.5 * step, 0.0, felt, walked=0.5)
    assert least < prints.wet_share < most
    # Far from every footprint the wet share is expected; the prior does not change.
    assert prints.wet_expected(999.0, 0.0) == pytest.approx(prints.wet_share)
    assert prints.wet_probability(999.0, 0.0) == pytest.approx(0.5)
    assert prints.wet_expected(29.5, 0.0) == pytest.approx(felt)


def test_a_floor_that_has_changed_is_learnt_anew():
    prints = Footprints()
    for step in range(400):
        prints.add(0.5 * step, 0.0, 0.97 if step < 300 else 0.03, walked=0.5)
    assert prints.wet_share < 0.2
