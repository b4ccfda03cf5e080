# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact import (
    LARGE_PAD,
    Liquid,
    Pad,
    design,
    force_limit,
    pads_in,
    pressure_for,
    rise_height,
)
from ros_pad.errors import InvalidInput

SOLE = math.pi * 0.017**2


@given(
    st.floats(1e-6, 0.1), st.floats(1e-3, 1.0), st.floats(0.0, 1.57), st.floats(500.0, 2e4),
    st.floats(7.8, 1e3),
)  # fmt: skip
def test_rise_balances_the_weight(radius, tension, angle, density, cell):
    liquid = Liquid(tension, tension / 2, density, angle)
    h = rise_height(radius, liquid, cell=cell)
    assert 0 < h <= 3 * radius
    # The liquid between the domes is weighed in slices and hangs from the circle where it ends.
    z, weights = np.polynomial.legendre.leggauss(3)
    z = 0.5 * h * (z + 1.0)
    slices = cell * radius**2 - math.pi * z * (3 * radius - z)
    weight = density * 9.81 * 0.5 * h * np.sum(weights * slices)
    lift = tension * math.cos(angle)
    # Near full gaps the circle's radius is a small difference: allow for rounding of h.
    wet = [math.sqrt(max(3 * radius - each, 0.0) * each) for each in (h * (1 - 1e-14), h)]
    pull = [2 * math.pi * lift * each for each in wet]
    slack = 1e-10 * weight + abs(pull[0] - pull[1])
    assert pull[1] - slack <= weight <= pull[0] + slack


def test_rise_needs_a_liquid_that_wets():
    for angle in (math.pi / 2, 2.0):
        with pytest.raises(InvalidInput, match='contact_angle'):
            rise_height(1e-3, Liquid(0.073, 0.03, contact_angle=angle))
    almost = Liquid(0.073, 0.03, contact_angle=math.pi / 2 - 1e-9)
    # For a small rise h, lift balances weight: L √(3 r h) = (cell/π) r² h, with
    # L = 2 γ cos θ/(ρ g).
    drawn = 2 * 0.073 * math.cos(almost.angle) / (1000 * 9.81)
    expected = 3e-3 * (drawn / (2.480980029398064 * 1e-6)) ** 2
    assert rise_height(1e-3, almost) == pytest.approx(expected, rel=1e-6)
    with pytest.raises(InvalidInput, match='liquid'):
        rise_height(1e-3, 0.073)


@pytest.mark.parametrize('criterion', ['thickness', 'measured'])
def test_a_design_adds_up(criterion):
    sole = design(7.0, SOLE, criterion=criterion, margin=1.5)
    # Within (17 - 1.5 - 2.1)/4.5 = 2.98 steps of a hexagonal lattice: 1 + 6 + 6 + 6 + 12 points.
    assert sole.pads == 31 < pads_in(SOLE, LARGE_PAD.radius)
    assert sole.load_per_pad * sole.pads == pytest.approx(7.0)
    assert force_limit(LARGE_PAD, sole.pressure, criterion) == pytest.approx(
        1.5 * sole.load_per_pad, rel=1e-10
    )
    reach = sole.pads * force_limit(LARGE_PAD, 90e3, criterion) / 1.5
    assert sole.reachable_load == pytest.approx(reach)
    assert sole.pitch == pytest.approx(13.4e-3 / math.sqrt(7.0))
    assert sole.carried
    assert not sole.touching


@given(st.floats(0.1, 60.0), st.floats(0.3e-3, 4e-3), st.floats(30e3, 91e3), st.floats(0.5, 3.0))
def test_carried_means_within_reach(load, radius, ceiling, margin):
    sole = design(load, SOLE, Pad(radius, 40.0), ceiling=ceiling, margin=margin)
    if abs(sole.reachable_load / load - 1) > 1e-9:
        assert sole.carried == (load < sole.reachable_load)
    if math.isfinite(sole.pads_needed):
        assert sole.pads_needed * sole.pad_limit >= load * margin * (1 - 1e-12)
        assert (sole.pads_needed - 1) * sole.pad_limit < load * margin
    else:
        assert sole.reachable_load == 0
    assert sole.ceiling <= ceiling


def test_what_is_asked_beyond_the_model_is_not_carried():
    heavy = design(100.0, SOLE)
    assert not heavy.carried
    assert math.isnan(heavy.pressure)
    # If the needed pressure is above the ceiling, the design still has it.
    low = design(7.0, SOLE, ceiling=50e3)
    assert not low.carried
    assert low.pressure == pressure_for(LARGE_PAD, 7.0 / low.pads, margin=1.2)
    # The model of larger pads ends below the default ceiling.
    large = design(7.0, SOLE, Pad(2.5e-3, 40.0))
    assert large.ceiling == pytest.approx(3.426 * 40.0 / 2.5e-3, rel=1e-3)
    assert not large.carried
    # A higher ceiling does not extend the line through the measurements.
    measured = design(7.0, SOLE, ceiling=200e3, criterion='measured')
    assert measured.ceiling <= 91.36e3
    free = design(7.0, SOLE, Pad(1e-3, 40.0), ceiling=120e3, criterion='flattening')
    assert free.ceiling == 120e3


def test_pads_as_built():
    built = design(7.0, SOLE, pads=37)
    assert built.pads == 37
    assert built.pitch == pytest.approx(13.4e-3 / 3.0)
    assert built.rise_height < rise_height(1.5e-3)
    packed = design(7.0, SOLE, pads=60)
    assert math.isnan(packed.rise_height)  # 60 domes with spheres of 1.5 radii do not fit
    # Four rings, as 61 have: 3.35 mm from one another, wider than flat domes.
    assert packed.pitch == pytest.approx(13.4e-3 / 4.0, rel=0.02)
    assert packed.touching == (packed.dome_width > packed.pitch)
    assert 31 <= packed.pads_without_touching <= 73
    for pads in (0, -3, 129, 2.0, True, '37'):
        with pytest.raises(InvalidInput, match='from 1 to 128'):
            design(7.0, SOLE, pads=pads)


def test_whole_shells_are_all_counted():
    # Points of a hexagonal lattice up to a distance, by its square.
    shells = {1: 7, 3: 13, 4: 19, 7: 31, 9: 37, 12: 43, 13: 55, 16: 61, 64: 241, 100: 367}
    for square, pads in shells.items():
        radius = 4.5e-3 * math.sqrt(square) + 3.6e-3
        assert design(1.0, math.pi * radius**2).pads == pads
        assert design(1.0, math.pi * (radius - 1e-6) ** 2).pads < pads
    with pytest.raises(InvalidInput, match='area'):
        design(1.0, 17e-6)
