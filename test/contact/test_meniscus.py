# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json
import math
import pathlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact import (
    LARGE_PAD,
    THESIS_LIQUID,
    WATER,
    Liquid,
    Pressed,
    bridge,
    capillary_pull,
    contact_angle,
    hysteresis_force,
    meniscus,
    press,
)
from ros_pad.errors import InvalidInput

REFERENCES = pathlib.Path(__file__).parent.parent / 'reference'
REFERENCE = REFERENCES / 'meniscus_thesis.json'


def test_reference_table():
    tensions = {'appendix': (0.0073, 0.0027), 'water': (0.073, 0.027), 'mixed': (0.073, 0.0027)}
    table = json.loads(REFERENCE.read_text())['rows']
    assert len(table) == 117
    for row in table:
        b = float(row['b_m'])
        sphere = b / math.sin(float(row['alpha']))
        dome = Pressed(math.nan, math.nan, b, sphere, math.nan, 'ok')
        surface, solid = tensions[row['gammas'].split()[0]]
        theta = float(row['theta'])
        ring = meniscus(dome, Liquid(surface, solid, contact_angle=theta), 'thesis')
        assert ring.height == pytest.approx(float(row['h']), rel=1e-12)
        assert ring.ring_radius == pytest.approx(float(row['r_i']), rel=1e-12)
        assert ring.tangential_force == pytest.approx(float(row['F_cap']), rel=1e-12)
        # In h_exact the tension of the solid carries the weight: here the liquid has that tension.
        exact = meniscus(dome, Liquid(solid, solid, contact_angle=theta))
        assert exact.height == pytest.approx(float(row['h_exact']), rel=1e-12)
        # F_cap_exact_h = 2 γ (2 r_i + h) of the exact ring, with the printed sign.
        printed = 2 * surface * (2 * exact.ring_radius + exact.height)
        assert printed == pytest.approx(float(row['F_cap_exact_h']), rel=1e-12)
        # F_cap_sign_fixed = 2 γ (2 r_i - h) of the printed ring.
        fixed = 2 * surface * (2 * ring.ring_radius - ring.height)
        assert fixed == pytest.approx(float(row['F_cap_sign_fixed']), rel=1e-12)
        assert exact.tangential_force == pytest.approx(
            2 * solid * (2 * exact.ring_radius - exact.height), rel=1e-14
        )


@given(st.floats(5e3, 90e3), st.floats(1e-6, 0.9), st.floats(0.0, 2.0))
def test_corrected_height_carries_its_weight(pressure, share, theta):
    force = share * math.pi * 1.5e-3 * (pressure * 1.5e-3 - math.sqrt(2 * 0.006 * 40))
    dome = press(LARGE_PAD, pressure, force)
    ring = meniscus(dome, Liquid(0.05, 0.03, 900.0, theta))
    alpha = math.asin(dome.contact_radius / dome.sphere_radius)
    cot = 1 / math.tan(alpha)
    b, h = dome.contact_radius, ring.height
    weight = 900.0 * 9.81 * cot * h * h * (3 * b + 2 * h * cot)
    assert weight == pytest.approx(6 * 0.05 * math.sin(theta + alpha) * (b + h * cot), rel=1e-11)
    assert ring.ring_radius == pytest.approx(b + h * cot, rel=1e-11)
    # If both tensions are equal, the printed height is up to 22 % too high and never too low.
    printed = meniscus(dome, Liquid(0.05, 0.05, 900.0, theta), 'thesis').height
    assert 1.0 <= printed / h < math.sqrt(1.5) + 1e-9


def test_no_contact_has_no_ring():
    dome = press(LARGE_PAD, 75e3, 0.0, adhesion='none')
    for reading in ('corrected', 'thesis'):
        ring = meniscus(dome, WATER, reading)
        assert dataclasses.astuple(ring) == (0.0, 0.0, 0.0, 'no_contact')


def test_arrays_carry_their_statuses():
    dome = press(LARGE_PAD, [75e3, 75e3, 75e3, 120e3], [0.0, 0.1, 0.6, 0.1], adhesion='none')
    ring = meniscus(dome, WATER)
    assert ring.status.tolist() == ['no_contact', 'ok', 'flattened', 'fold_zone']
    assert ring.height[0] == 0
    single = meniscus(press(LARGE_PAD, 75e3, 0.1, adhesion='none'), WATER)
    assert isinstance(single.height, float)
    assert ring.height[1] == pytest.approx(single.height, rel=1e-13)
    assert np.isnan(ring.tangential_force).tolist() == [False, False, True, True]


def test_contact_angle():
    # The appendix' theta follows from its ratio of tensions, here with the digits of the table.
    assert contact_angle(0.0027, 0.0073) == pytest.approx(1.352745229033721205, rel=1e-14)
    assert WATER.angle == pytest.approx(1.352745229033721205, rel=1e-14)
    assert THESIS_LIQUID.angle == 1.35
    for ratio in (0.24, 1.01):
        with pytest.raises(InvalidInput, match='tension'):
            contact_angle(ratio, 1.0)
        with pytest.raises(InvalidInput, match='tension'):
            Liquid(0.073, 0.073 * ratio)
    assert contact_angle(1.0, 1.0) == 0.0
    assert contact_angle(0.25, 1.0) == pytest.approx(math.pi / 2, rel=1e-15)
    angles = contact_angle([0.3, 0.5, 0.9], 1.0)
    np.testing.assert_allclose(np.cos(angles), 2 * np.sqrt([0.3, 0.5, 0.9]) - 1, rtol=1e-13)


def test_hysteresis_force():
    # Water on a disc of 0.8 mm, with cosines that differ by 0.5: 0.06 mN.
    force = hysteresis_force(0.8e-3, 0.073, 2 * math.pi / 3, math.pi / 2)
    assert force == pytest.approx(0.073 * 1.6e-3 * 0.5, rel=1e-14)
    assert type(force) is float


def test_no_bridge_pulls_more_than_the_bound_and_some_nearly_as_much():
    rows = json.loads((REFERENCES / 'sphere_plane_bridge.json').read_text())['rows']
    liquid = Liquid(1.0, 1.0, contact_angle=0.0)
    shares = [
        4.0
        * math.pi
        * row['F_quad']
        / capillary_pull(math.sin(math.radians(row['beta'])), row['h'], liquid, 0.0)
        for row in rows
    ]
    assert len(shares) == 12 and 0.97 < max(shares) < 1.0
    # A bridge from plate to plate, height 1 and radius 200: 2γ/h on its area, to 1/200.
    wide = bridge(1e6, 1.0, 0.0, filling_angle=2e-4, separation=1.0)
    most = capillary_pull(1e6 * math.sin(2e-4), wide.height, liquid, 0.0)
    assert 0.98 * most < wide.force < most
