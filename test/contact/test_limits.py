# SPDX-License-Identifier: Apache-2.0
import json
import pathlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ros_pad.contact import (
    LARGE_PAD,
    SMALL_PAD,
    Material,
    MeasuredLimit,
    Pad,
    design,
    force_limit,
    inflate,
    press,
    pressure_for,
)
from ros_pad.contact.limits import criteria, largest_pressure, resized
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.errors import InvalidInput, NoEquilibrium

CRITERIA = ('thickness', 'flattening', 'measured')
OF_ANY_CAP = CRITERIA[:2]
KILOPASCALS = np.array([65.0, 75.0, 85.0])
REFERENCE = json.loads(
    (pathlib.Path(__file__).parents[1] / 'reference' / 'force_limits.json').read_text('utf-8')
)


def rubber(times: float = 1.0) -> Pad:
    parameters = tuple(times * REFERENCE['factor'] * each for each in REFERENCE['yeoh'])
    material = Material('yeoh', parameters, 4.5)
    return Pad.of(material, REFERENCE['radius'], REFERENCE['thickness'])


RUBBER = rubber()


def test_measured_is_the_fit_to_three_measurements():
    limit = force_limit(LARGE_PAD, KILOPASCALS * 1e3, 'measured')
    np.testing.assert_allclose(limit, [0.1583, 0.2833, 0.4083], rtol=1e-14)
    np.testing.assert_allclose(limit, [0.15, 0.30, 0.40], atol=0.017)  # the measurements


@pytest.mark.parametrize('pad', [Pad(1.5e-3, 80.0), resized(LARGE_PAD, 1e-3), RUBBER])
def test_measured_holds_for_no_other_pad(pad):
    assert 'measured' not in criteria(pad)
    for function in (force_limit, pressure_for):
        with pytest.raises(InvalidInput, match='no force limit was measured on it; a measured_li'):
            function(pad, 0.1, 'measured')


@pytest.mark.parametrize('criterion', OF_ANY_CAP)
def test_limits_of_the_membrane_are_those_of_the_reference(criterion):
    pressures, limits = REFERENCE['pressures'], REFERENCE['limits'][criterion]
    np.testing.assert_allclose(force_limit(RUBBER, pressures, criterion), limits, rtol=2e-3)
    np.testing.assert_allclose(pressure_for(RUBBER, limits, criterion), pressures, rtol=3e-3)


@pytest.mark.parametrize(
    'pad',
    [LARGE_PAD, SMALL_PAD, Pad.of(Material('neo_hookean', (1.5e5,)), 1.5e-3, 0.4e-3)],
)
def test_the_default_is_never_zero_where_a_dome_stands(pad):
    pressures = np.linspace(DOME_PRESSURE, largest_pressure(pad), 300)
    limits = force_limit(pad, pressures)
    assert limits[0] > 0.0
    assert (np.diff(limits) > 0.0).all()
    assert (limits < force_limit(pad, pressures, 'flattening')).all()
    np.testing.assert_array_equal(limits, force_limit(pad, pressures, 'thickness'))


@pytest.mark.parametrize('pad', [LARGE_PAD, RUBBER])
def test_at_the_thickness_the_gap_is_that_of_the_sheet(pad):
    limits = force_limit(pad, KILOPASCALS * 1e3)
    gap = press(pad, KILOPASCALS * 1e3, limits).gap
    np.testing.assert_allclose(gap, 0.4e-3, rtol=1e-9)
    # Domes lower than two sheets, and those of an unknown sheet, may go down by half.
    low = np.array([5e3, 20e3])
    for each, p in ((pad, low), (Pad(1.5e-3, 40.0), KILOPASCALS * 1e3)):
        gap = press(each, p, force_limit(each, p)).gap
        np.testing.assert_allclose(gap, 0.5 * inflate(each, p).height, rtol=1e-9)


@given(st.floats(600.0, 91e3))
def test_flattening_is_where_press_ends(pressure):
    limit = force_limit(LARGE_PAD, pressure, 'flattening')
    assert press(LARGE_PAD, pressure, limit * (1 - 1e-9)).status == 'ok'
    with pytest.raises(NoEquilibrium) as caught:
        press(LARGE_PAD, pressure, limit * (1 + 1e-9))
    assert caught.value.status == 'flattened'


@pytest.mark.parametrize(
    ('criterion', 'pad'),
    [(each, LARGE_PAD) for each in CRITERIA]
    + [(each, pad) for each in OF_ANY_CAP for pad in (Pad(1.5e-3, 40.0, 0.0), RUBBER)],
)
def test_pressure_for_inverts_the_limit(criterion, pad):
    pressure = np.linspace(0.67, 0.98, 15) * largest_pressure(pad)
    limit = force_limit(pad, pressure, criterion)
    assert (np.diff(limit) > 0).all()
    np.testing.assert_allclose(pressure_for(pad, limit, criterion), pressure, rtol=1e-12)
    half = pressure_for(pad, limit / 2, criterion, margin=2.0)
    np.testing.assert_allclose(half, pressure, rtol=1e-12)
    single = pressure_for(pad, float(limit[3]), criterion)
    assert isinstance(single, float)
    assert single == pytest.approx(pressure[3], rel=1e-12)
    assert isinstance(force_limit(pad, float(pressure[0]), criterion), float)


@pytest.mark.parametrize('criterion', CRITERIA)
def test_ends_of_the_domain(criterion):
    assert force_limit(LARGE_PAD, 0.0, criterion) == 0.0
    for pressure, status in [(91.5e3, 'fold_zone'), (159e3, 'fold_zone'), (160e3, 'no_inflation')]:
        with pytest.raises(NoEquilibrium, match='Pa') as caught:
            force_limit(LARGE_PAD, pressure, criterion)
        assert caught.value.status == status
    limits = force_limit(LARGE_PAD, [75e3, 91.5e3], criterion)
    assert np.isnan(limits).tolist() == [False, True]
    for force, margin in [(0.7, 1.0), (0.1, 7.0)]:
        with pytest.raises(NoEquilibrium, match='at most') as caught:
            pressure_for(LARGE_PAD, force, criterion, margin)
        assert caught.value.status == 'fold_zone'
    pressures = pressure_for(LARGE_PAD, [0.1, 0.7], criterion)
    assert np.isnan(pressures).tolist() == [False, True]
    # Adhesion flattens this pad at any pressure of the model: its limit is zero, not an error.
    assert force_limit(Pad(1.5e-3, 40.0, 0.4), 1e3, 'flattening') == 0.0


def test_a_line_that_starts_above_zero_asks_for_no_negative_pressure():
    own = Pad(1.5e-3, 40.0, measured_limit=MeasuredLimit(force=0.2, pressure=50e3, slope=2e-6))
    assert force_limit(own, 0.0, 'measured') == pytest.approx(0.1)
    assert pressure_for(own, 0.05, 'measured') == 0.0
    pressures = pressure_for(own, [0.0, 0.1, 0.2], 'measured')
    np.testing.assert_allclose(pressures, [0.0, 0.0, 50e3], atol=1e-9)
    assert design(1.0, 1e-3, own, criterion='measured').carried


def test_a_pad_with_measurements_of_its_own():
    own = Pad(2e-3, 60.0, measured_limit=MeasuredLimit(force=0.5, pressure=60e3, slope=2e-5))
    assert force_limit(own, 70e3, 'measured') == pytest.approx(0.7)
    assert force_limit(own, 10e3, 'measured') == 0.0
    assert pressure_for(own, 0.6, 'measured', margin=1.5) == pytest.approx(80e3)
    # Model and limits of this pad end just below 3.426 k/r, wherever the thesis' measurements end.
    end = largest_pressure(own)
    assert 102.6e3 < end < 102.78e3
    assert force_limit(own, 0.999 * end, 'measured') == pytest.approx(
        0.5 + 2e-5 * (0.999 * end - 60e3)
    )
    # The other criteria do not depend on the measured limit.
    plain = Pad(2e-3, 60.0)
    for criterion in OF_ANY_CAP:
        assert force_limit(own, 70e3, criterion) == force_limit(plain, 70e3, criterion)


def test_no_limit_was_measured_on_rubber_as_stiff_as_the_large_pad():
    rubber = Pad.of(Material('neo_hookean', (100e3,)), LARGE_PAD.radius, 0.4e-3)
    assert rubber.stiffness == pytest.approx(LARGE_PAD.stiffness, rel=1e-12)
    assert 'measured' in criteria(LARGE_PAD) and 'measured' not in criteria(rubber)
