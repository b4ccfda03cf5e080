# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from ros_pad.contact import Material
from ros_pad.contact.design import candidates

RADIUS, THICKNESS = 1.5e-3, 4e-4
AREA = 20 * 4.5 * math.sqrt(3.0) * RADIUS**2  # 20 cells
FLAT = 20 * math.pi * RADIUS**2
# Reference rows: 0.7968 mm high at 40 kPa and 1.3223 mm at 70 kPa; P = 1.87917 at the maximum,
# where H/a = 1.1739.
NEO = Material('neo_hookean', (150e3,), factor_range=(4.0 / 7.0, 2.0))
AT_40, AT_70 = 0.0007968214022832315, 0.001322336716624393
MAXIMUM = 1.87917 * 150e3 * THICKNESS / RADIUS
# Dragon Skin 10 as given is 1.9065 mm high at 40 kPa.
RAW = Material.load('dragon_skin_10')


def one(load, material=NEO, thickness=THICKNESS, **rules):
    (found,) = candidates(load, AREA, [material], [thickness], RADIUS, pads=20, **rules)
    return found


def test_a_material_by_reference_rows():
    found = one(40e3 * FLAT / 1.2)
    assert found.pads == 20
    assert found.pressure == pytest.approx((40e3, 40e3, 40e3), rel=1e-12)
    assert found.height.value == pytest.approx(AT_40, rel=1e-9)
    # At 4/7 of the stress 40 kPa are like 70 kPa.
    assert found.height.high == pytest.approx(AT_70, rel=1e-9)
    spans = np.array([1.0, 4.0 / 7.0, 2.0])
    np.testing.assert_allclose(found.largest_pressure, MAXIMUM * spans, rtol=1e-5)
    np.testing.assert_allclose(found.ballooning_margin, MAXIMUM * spans / 40e3, rtol=1e-5)
    # All pads flat, at the supply or where they balloon.
    reach = [min(90e3, MAXIMUM * each) * FLAT / 1.2 for each in spans]
    np.testing.assert_allclose(found.load, reach, rtol=1e-5)
    assert (found.balloons, found.carried) == (True, 'yes')


def test_doubt_decides_between_yes_and_no():
    # 4/7 of the stress balloons at 43 kPa; 45 kPa are needed.
    found = one(45e3 * FLAT / 1.2)
    assert found.carried == 'in doubt'
    assert found.pressure == (pytest.approx(45e3), pytest.approx(45e3), math.inf)
    assert found.ballooning_margin.low == 0.0
    # Where no pressure is enough, the highest dome.
    assert found.height.high == pytest.approx(1.1739 * RADIUS, rel=1e-5)
    assert one(45e3 * FLAT / 1.2, ceiling=44e3).carried == 'no'
    assert one(200e3 * FLAT).carried == 'no'
    assert one(200e3 * FLAT, ceiling=300e3, margin=1.0).carried == 'no'


def test_a_factor_inside_the_range_may_decide():
    """0.25 N on a pad: too much for the ends of the range, but not for a factor of 1.29."""
    rules = {'criterion': 'thickness', 'ceiling': 60e3, 'margin': 1.0}
    ends = [one(20 * 0.25, RAW.times(each, (each, each)), **rules) for each in (1.0, 2.1)]
    assert [each.carried for each in ends] == ['no', 'no']
    found = one(20 * 0.25, RAW, **rules)
    assert found.carried == 'in doubt'
    assert found.pressure.low < 60e3 < found.pressure.high
