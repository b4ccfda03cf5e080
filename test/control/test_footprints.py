# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact.resistance import Foot, expected_friction
from ros_pad.control.footprints import CERTAIN, Footprints, FrictionFelt


@pytest.mark.parametrize(('distance', 'share'), [(0.0, 1.0), (0.5, 0.606531), (2.0, 0.135335)])
def test_a_footprint_fades_with_distance(distance, share):
    prints = Footprints()
    prints.add(3.0, -1.0, 0.9)
    angle = 0.7
    x, y = 3.0 + distance * math.cos(angle), -1.0 + distance * math.sin(angle)
    assert prints.wet_probability(x, y) == pytest.approx(0.5 + 0.4 * share, abs=1e-6)


def test_the_strongest_wins():
    prints = Footprints()
    prints.add(0.0, 0.0, 0.95)
    prints.add(1.0, 0.0, 0.1)
    # Half-way the wet footprint counts: it differs more from the prior, by 0.45, than the dry one,
    # by 0.4. Near the dry footprint that one counts.
    assert prints.wet_probability(0.5, 0.0) == pytest.approx(0.5 + 0.45 * math.exp(-0.5))
    assert prints.wet_probability(0.9, 0.0) == pytest.approx(0.5 - 0.4 * math.exp(-0.1))


@given(
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0, 1)), max_size=70),
    st.floats(-9, 9),
)
def test_probabilities_stay_probabilities(felt, x):
    prints = Footprints()
    for print_ in felt:
        prints.add(*print_)
    assert -1e-12 <= prints.wet_probability(x, 0.0) <= 1.0 + 1e-12


# --- friction ------------------------------------------------------------------------------------

FOOT, LOAD = Foot.load('large37'), 6.8
"""By the numbers of feet/large37.yaml: 0.80 flat on dry ground, 0.41 as a dome."""


def test_adhesion_that_is_not_there_is_found_within_some_steps():
    """By hand: 0.41 + 0.39 · 0.8^n is below 1.4 · 0.41 after n = 4 steps."""
    felt = FrictionFelt(FOOT, LOAD)
    paid = []
    for _ in range(30):
        felt.add(True, 0.05, 0.41)
        paid.append(felt.flat_pays)
    assert paid == [True] * 3 + [False] * 27


def test_feet_do_not_change_their_mind_between_the_factors():
    felt = FrictionFelt(FOOT, LOAD)
    for friction, pays in ((0.59, True), (0.41, False), (0.63, False), (0.69, True)):
        for _ in range(100):
            felt.add(True, 0.05, friction)
        assert felt.flat_pays is pays


def test_domes_that_do_not_hold_on_wet_ground_are_found():
    """By hand: on dry ground domes lose 0.80 - 0.41, and on wet ground win their friction less
    1.1 · 0.12, at first that after landing."""
    felt = FrictionFelt(FOOT, LOAD)
    landed = expected_friction(FOOT, LOAD).landed
    pinned = expected_friction(dataclasses.replace(FOOT, capillary_force=0.05), LOAD)
    assert pinned.landed == pytest.approx(landed + 37 * 0.05 / LOAD)  # at the whole load
    assert felt.break_even == pytest.approx(0.39 / (0.39 + landed - 0.132), abs=0.01)
    assert 0.6 < felt.break_even < 0.7
    for _ in range(100):
        felt.add(False, 0.5, 0.41)  # this may be dry ground
    assert 0.6 < felt.break_even < 0.7
    for _ in range(100):
        felt.add(False, 0.9, 0.166)
        felt.add(False, 0.1, 0.41)
        felt.add(True, 0.9, 0.12)
    # The mean of all domes is between 0.166 and 0.41.
    assert 0.39 / (0.39 + 0.034) < felt.break_even < 0.63 / (0.63 + 0.034)
    for _ in range(100):
        felt.add(False, 0.9, 0.10)
    assert felt.break_even == CERTAIN
    for _ in range(100):
        felt.add(False, 0.9, 0.40)
    assert felt.break_even < 0.65


@pytest.mark.parametrize('friction', [math.nan, math.inf, -0.1])
def test_friction_that_is_not_known_counts_nothing(friction):
    felt = FrictionFelt(FOOT, LOAD)
    for _ in range(100):
        felt.add(False, 0.05, friction)
        felt.add(True, 0.05, friction)
    assert felt.flat_pays
    felt.add(True, 0.05, 0.8)
    assert felt.flat_pays
