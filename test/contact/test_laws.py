# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import numpy as np
import pytest
from scipy.stats import f as fisher

from ros_pad.contact import Material, Pad
from ros_pad.contact.laws import (
    compare,
    pressure_for_height,
    rubber_laws,
    stiffness_law,
    two_constants_law,
)
from ros_pad.errors import InvalidInput

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
RADIUS, THICKNESS = 1.5e-3, 4e-4
RAW = Pad.of(Material.load('dragon_skin_10'), RADIUS, THICKNESS)
THESIS = json.loads((REFERENCE / 'hyper_thesis.json').read_text())['thesis']
PRESSURE, HEIGHT = np.array(THESIS['pressure_Pa']), np.array(THESIS['height_m'])


def reference(law):
    rows = json.loads((REFERENCE / 'hyper_free.json').read_text())['rows']
    kept = [row for row in rows if row['law'] == law and row['radius_m'] == RADIUS]
    return [np.array([row[key] for row in kept]) for key in ('pressure_Pa', 'height_m')]


def laws_of(pressure, height):
    return (
        stiffness_law(RADIUS, pressure, height),
        two_constants_law(RADIUS, pressure, height),
        *rubber_laws(RAW, pressure, height),
    )


def test_pressures_for_heights_are_those_of_the_reference_rows():
    pressure, height = reference('DS10_raw_l4.5')
    assert len(pressure) == 3
    np.testing.assert_allclose(pressure_for_height(RAW, height), pressure, rtol=1e-9)
    known = pressure_for_height(RAW, HEIGHT)
    np.testing.assert_allclose(known, THESIS['computed_Pa'], atol=5.0)


def test_the_reference_rows_of_a_law_times_a_factor_give_the_factor():
    pressure, height = reference('DS10_raw_l4.5 x1.88')
    factor, thickness = rubber_laws(RAW, pressure, height)
    assert factor.values[0] == pytest.approx(1.88, rel=1e-9)
    assert thickness.values[0] == pytest.approx(1.88 * THICKNESS, rel=1e-9)
    assert factor.high[0] - factor.low[0] < 1e-6


def test_the_factor_of_the_thesis_pad():
    """By hand: shares x = 1/ratio, factor Σx/Σx², Student's t = 3.182 on 3 degrees of freedom."""
    factor = laws_of(PRESSURE, HEIGHT)[2]
    x = 1.0 / np.array(THESIS['ratio'])
    value = x.sum() / (x @ x)
    assert value == pytest.approx(THESIS['factor'], abs=0.005)
    assert factor.values[0] == pytest.approx(value, rel=5e-4)
    missed = value * x - 1.0
    width = 3.182446 * math.sqrt(missed @ missed / 3 / (x @ x)) / value
    assert math.log(factor.high[0] / value) == pytest.approx(width, rel=0.02)
    assert math.log(value / factor.low[0]) == pytest.approx(width, rel=0.02)
    assert factor.error == pytest.approx(math.sqrt(missed @ missed / 4), rel=0.02)


def test_intervals_hold_the_truth_as_often_as_they_say():
    height = np.linspace(0.8e-3, 2.4e-3, 6)
    true = 1.88 * pressure_for_height(RAW, height)
    inside = 0
    for seed in range(200):
        noisy = true * (1 + 0.03 * np.random.default_rng(seed).standard_normal(6))
        factor = rubber_laws(RAW, noisy, height)[0]
        inside += factor.low[0] <= 1.88 <= factor.high[0]
    assert 0.90 <= inside / 200 <= 0.99


def test_one_law_within_the_other_is_an_f_test():
    one, two, *_ = laws_of(PRESSURE, HEIGHT)
    found = compare([one, two], PRESSURE)[0]
    drop = (one.error / two.error) ** 2 - 1.0
    assert found.first_chance == pytest.approx(fisher.sf(2 * drop, 1, 2), abs=0.006)
    assert found.second_chance == 1.0
    assert 'two constants: a better fit than stiffness, beyond chance (4 domes' in str(found)


def test_thickness_and_factor_are_one_law_and_compared_once():
    found = compare(laws_of(PRESSURE, HEIGHT), PRESSURE)
    pairs = [(each.first, each.second) for each in found]
    assert pairs == [
        ('stiffness', 'two constants'),
        ('stiffness', 'factor'),
        ('two constants', 'factor'),
        ('factor', 'thickness'),
    ]
    assert 'no measured dome distinguishes them' in str(found[-1])
    assert 'stiffness or factor: the domes do not distinguish them' in str(found[1])
    assert compare(laws_of(PRESSURE[:2], HEIGHT[:2]), PRESSURE[:2]) == ()


def noisy(size, seed):
    """Return domes of Dragon Skin 10 with errors of pressure."""
    height = np.linspace(0.8e-3, 2.4e-3, 8)
    pressure = 1.88 * pressure_for_height(RAW, height)
    return pressure * (1 + size * np.random.default_rng(seed).standard_normal(8)), height


def test_a_right_law_is_rejected_as_seldom_as_the_chance_says():
    rejected = {'factor': 0, 'stiffness': 0}
    for seed in range(60):
        pressure, height = noisy(0.05, seed)
        pair = stiffness_law(RADIUS, pressure, height), rubber_laws(RAW, pressure, height)[0]
        found = compare(pair, pressure)[0]
        rejected['stiffness'] += found.first_chance < 0.05
        rejected['factor'] += found.second_chance < 0.05
    # 3 ± 1.7 of 60 are by chance; the wrong law must fail more often.
    assert rejected['factor'] <= 8
    assert rejected['stiffness'] > 2 * rejected['factor']


def test_exact_domes_distinguish_all_that_can_be():
    pressure, height = noisy(1e-4, 1)
    one, two, factor, _ = laws_of(pressure, height)
    for wrong in (one, two):
        found = compare([wrong, factor], pressure)[0]
        assert found.first_chance < 1e-3
        assert found.second_chance > 0.05


@pytest.mark.parametrize(
    ('name', 'thickness', 'why'),
    [
        ('ecoflex_00_30', 4e-4, 'at most .* m, at .* Pa, is allowed; there it balloons'),
        ('dragon_skin_10', 4e-4, 'its range ends, a uniaxial stretch of 4.5'),
    ],
)
def test_heights_that_no_dome_has_are_refused(name, thickness, why):
    pad = Pad.of(Material.load(name), RADIUS, thickness)
    with pytest.raises(InvalidInput, match=f'height = 0.0035 m of a free dome .*{why}'):
        pressure_for_height(pad, np.array([1e-3, 3.5e-3]))
