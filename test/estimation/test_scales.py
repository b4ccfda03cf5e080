# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy import stats

from ros_pad.contact.resistance import ExpectedFriction
from ros_pad.estimation.scales import CLASSES, GRID, Felt, FrictionScales, Scale

PRIOR = ExpectedFriction(flat_dry=0.8, flat_wet=0.12, dome=0.41, landed=0.32)
NOTHING = np.zeros(len(GRID))


def felt(on_dry=NOTHING, on_wet=NOTHING, time=0.0, foot=0, dome=False, wet=0.5, weight=1.0):
    return Felt(time, foot, dome, wet, np.array([on_dry, on_wet]), weight)


def slip_at(friction, error=0.05):
    return -0.5 * (np.log(GRID / friction) / error) ** 2


def shared_by(feet):
    shared = FrictionScales(PRIOR)
    for _ in range(feet):
        shared.join()
    return shared


def learnt(shared, stances):
    for stance in stances:
        shared.add(stance)
    shared.expected(1e3)
    return shared.scales


@pytest.mark.parametrize(('scale', 'sd'), [(1.0, 0.4), (0.7, 0.1)])
def test_friction_is_expected_log_normally_about_the_contact_model(scale, sd):
    """Mean and deviation of ln μ; two equally likely spreads, 8 and 16 %, widen the latter."""
    given = {name: Scale(scale, sd) for name in CLASSES}
    rows = FrictionScales(PRIOR, given).expected(0.0).rows
    spread = np.mean(np.square([0.08, 0.16]))
    for row, mean in zip(rows, (0.8, 0.12, 0.41), strict=False):
        core = row - row.min()  # without the tail
        core /= core.sum()
        center = core @ np.log(GRID)
        assert center == pytest.approx(math.log(scale * mean), abs=0.05)
        deviation = math.sqrt(core @ (np.log(GRID) - center) ** 2)
        # The grid cuts the tail off where both are wide.
        assert deviation == pytest.approx(math.hypot(sd, math.sqrt(spread)), rel=0.1)


def test_domes_on_wet_ground_hold_what_the_contact_model_has_after_landing_or_more():
    """0.78 to 1 times their dry friction, and 5 % of the time anything between flat and dome."""
    *_, on_dry, on_wet = FrictionScales(PRIOR).expected(0.0).rows @ np.log(GRID)
    mean = 0.95 * (on_dry - 0.119) + 0.05 * math.log(math.sqrt(0.12 * 0.41))
    assert on_wet == pytest.approx(mean, abs=0.02)  # 0.119: mean of -ln over 0.78 to 1
    same = PRIOR._replace(landed=PRIOR.dome)
    *_, on_dry, on_wet = FrictionScales(same).expected(0.0).rows @ np.log(GRID)
    assert on_wet == pytest.approx(
        0.95 * on_dry + 0.05 * math.log(math.sqrt(0.12 * 0.41)), abs=1e-4
    )


def test_what_a_foot_said_is_taken_back():
    """Two feet disagree; without the first, only the second remains."""
    first = [felt(slip_at(0.4), slip_at(0.4), 0.1 * k, wet=1e-6) for k in range(5)]
    second = [each._replace(foot=1, likelihood=np.array([slip_at(0.9)] * 2)) for each in first]
    both, alone = shared_by(2), shared_by(2)
    learnt(both, first + second)
    both.forget(0)
    learnt(alone, second)
    assert alone.scales['flat_dry'].sd < 0.1
    both.add(first[0])
    both.forget(0)
    learnt(both, [])
    for name in CLASSES:
        assert both.scales[name] == pytest.approx(alone.scales[name], rel=1e-3)


def test_slips_at_known_ground_show_the_scale():
    """With a normal prior and slips that differ by a spread, mean and deviation are those of
    Bayes' rule for a normal distribution with a known spread, one of the grid."""
    logs = np.random.default_rng(1).normal(math.log(0.5), 0.08, 40)
    stances = [felt(slip_at(math.exp(each)), slip_at(math.exp(each)), wet=1e-6) for each in logs]
    found = learnt(shared_by(1), stances)
    scale, sd = found['flat_dry']
    precision = len(logs) / (0.08**2 + 0.05**2)
    mean = (logs.mean() - math.log(0.8)) * precision / (precision + 1.0 / 0.4**2)
    assert math.log(scale) == pytest.approx(mean, abs=0.02)
    assert sd == pytest.approx(1.0 / math.sqrt(precision), rel=0.5)
    assert found['flat_wet'] == pytest.approx(Scale(), rel=0.02)
    assert found['dome'] == pytest.approx(Scale(), rel=0.02)


def test_sticking_shows_only_that_friction_is_larger():
    """T/N of 0.6 excludes less; how much more it is remains open."""
    holds = stats.norm.logcdf(GRID, 0.6, 0.02)
    stances = [felt(holds, NOTHING - 40.0, wet=0.01)] * 60
    found = learnt(shared_by(1), stances)['flat_dry']
    assert found.scale > 1.0 and found.sd > 0.15
    low, high = found.interval
    assert low > 0.6 / 0.8 and high > 1.5


def test_under_domes_only_the_friction_of_domes_is_learnt():
    stances = [felt(slip_at(0.3), slip_at(0.3), dome=True)] * 20
    found = learnt(shared_by(1), stances)
    assert found['dome'].scale == pytest.approx(0.3 / 0.41, rel=0.06)
    assert found['flat_dry'] == found['flat_wet'] == pytest.approx(Scale(), rel=0.02)


def test_the_order_in_which_feet_are_heard_does_not_matter():
    stances = [
        felt(slip_at(0.4 + 0.1 * foot), slip_at(0.12), 0.1 * step, foot, wet=0.3)
        for step in range(8) for foot in range(3)
    ]  # fmt: skip
    first, second = shared_by(3), shared_by(3)
    assert learnt(first, stances) == learnt(second, stances[::-1])
    assert np.array_equal(first.expected(1e3).rows, second.expected(1e3).rows)


def test_a_period_has_one_expectation():
    shared = shared_by(1)
    before = shared.expected(9.9).rows
    shared.add(felt(slip_at(0.4), slip_at(0.4), 9.2, wet=1e-6))
    assert np.array_equal(shared.expected(9.95).rows, before)
    after = shared.expected(10.01).rows
    assert not np.array_equal(after, before)
    # After the clock was set back, nothing that was learnt is lost.
    assert np.array_equal(shared.expected(1.0).rows, after)
