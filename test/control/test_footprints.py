# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact.resistance import Foot
from ros_pad.control.footprints import Footprints, FrictionFelt


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


@pytest.mark.parametrize('friction', [math.nan, math.inf, -0.1])
def test_friction_that_is_not_known_counts_nothing(friction):
    felt = FrictionFelt(FOOT, LOAD)
    for _ in range(100):
        felt.add(False, 0.05, friction)
        felt.add(True, 0.05, friction)
    assert felt.flat_pays
    felt.add(True, 0.05, 0.8)
    assert felt.flat_pays
