# SPDX-License-Identifier: Apache-2.0
import json
import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from ros_pad.estimation import FootEstimator
from ros_pad.simulation import Scene
from ros_pad.trials.node_settings import tuning_for
from studies.slips import SIZES, Alarms
from studies.work_precision.estimator import conditions, methods, tally, walks
from studies.work_precision.estimator.conditions import Change
from studies.work_precision.estimator.tally import Tally
from studies.work_precision.estimator.walks import Recording

pytestmark = pytest.mark.slow

SCENE = Scene.load('hexapod_smooth_dry_flat')
PERIOD = 4e-3
BLANK = tally.row_of(
    Tally(), part='methods', name='', variant='', value=0.0, unit='', shipped=False
)


def walk(speed, load=None, **values):
    """Return a recording of 4 s of a foot under 10 N; ``speed`` has rows (start, end, m/s)."""
    count = 1000
    true = np.zeros((count, 1))
    for start, end, value in speed:
        true[round(start / PERIOD) : round(end / PERIOD), 0] = value
    loads = np.full((count, 1), 10.0)
    for start, end, value in load or ():
        loads[round(start / PERIOD) : round(end / PERIOD), 0] = value
    zeros = np.zeros((count, 1, 3))
    given = {
        'name': 'made up',
        'period': PERIOD,
        'foot': SCENE.foot,
        'expected_load': 10.0,
        'settings': (SCENE.foot, 10.0, tuning_for(SCENE)),
        'stamps': PERIOD * np.arange(1, count + 1),
        'force': np.concatenate([zeros[..., :2], loads[..., None]], axis=2),
        'position': zeros,
        'noise': zeros,
        'pressure': np.zeros((count, 1)),
        'arrived': np.ones((count, 1), dtype=bool),
        'load': loads,
        'tangential': np.zeros((count, 1)),
        'grip': 0.5 * loads,
        'place': np.cumsum(true, axis=0)[..., None] * np.array([PERIOD, 0.0]),
        'wet': np.zeros((count, 1), dtype=bool),
    }
    return Recording(**given | values)


def counted(case, *spans):
    alarms = np.zeros((len(case.stamps), 1), dtype=bool)
    for start, end in spans:
        alarms[round(start / PERIOD) : round(end / PERIOD)] = True
    counts = Tally()
    tally.count_alarms(counts, case, alarms)
    return counts


# --- the counts ---------------------------------------------------------------------------------


def test_alarms_are_judged_by_place_and_load():
    case = walk([(2.0, 2.2, 0.05)])
    (found,) = counted(case, (1.5, 1.6), (2.1, 2.3)).alarms
    assert (found.slips[5e-3], found.missed[5e-3], found.false) == (1, 0, 1)
    (only,) = counted(replace(case, sticks_only=True), (1.5, 1.6)).alarms
    assert (only.slips[5e-3], only.false) == (0, 1)


def test_estimates_are_compared_with_the_truth():
    """Of a dry and a wet stance both are estimated as dry at their ends."""
    case = walk([], [(1.0, 1.2, 0.0), (2.0, 2.2, 0.0), (3.0, 4.0, 0.0)])
    wet = np.zeros((1000, 1), dtype=bool)
    wet[525:] = True
    case = replace(case, wet=wet, tangential=0.2 * case.load)
    ones = np.ones((1000, 1))
    found = tally.Estimates(
        slipping=ones < 0, standing=ones > 0, fresh=ones > 0, wet=0.2 * ones, mean=0.4 * ones,
        sd=np.where(wet, 0.04, 0.06), margin=np.where(wet, 0.31, 0.29),
    )  # fmt: skip
    counts = Tally()
    tally.count_estimates(counts, case, found)
    assert counts.wet_ends == [(False, 0.2), (True, 0.2)]
    row = tally.row_of(
        counts, part='robustness', name='x', variant='', value=0.0, unit='', shipped=True
    )
    assert row.brier == pytest.approx((0.2**2 + 0.8**2) / 2.0)
    assert row.wet_right == 0.5
    # True friction is 0.5, and the true friction margin 0.3.
    assert row.coverages == {'dry': 1.0, 'wet': 0.0}
    assert row.belows == {'dry': 0.0, 'wet': 1.0}
    assert row.delay is row.misses is row.false_per_minute is None
    json.dumps(asdict(row), allow_nan=False)


# --- methods ------------------------------------------------------------------------------------


def test_methods_get_the_same_speed_as_the_estimator():
    """The foot is pulled, then slides at 40 mm/s, and is lifted for a while."""
    generator = np.random.default_rng(1)
    settings = (SCENE.foot, 7.0, tuning_for(SCENE))
    plain = methods.SlipSpeed(settings)
    alarm = methods.speed_alarm(settings, lambda: methods.displacement(0.015, 5e-4))
    shipped = FootEstimator(*settings)
    compared = 0
    for sample in range(1, 500):
        way = 0.04 * PERIOD * max(0, sample - 250)
        force = np.array([3.0, 1.0, 7.0]) + generator.normal(scale=0.03, size=3)
        if 400 < sample < 420:
            force[2] = 0.1
        x, y = (-way * np.array([3.0, 1.0]) / math.sqrt(10.0)).tolist()
        noise = generator.normal(scale=1.5e-4, size=3)
        sheared = force * (1.0, 1.0, 0.0) / SCENE.foot.shear_stiffness
        position = np.array([x, y, 0.0]) - sheared + noise
        row = (PERIOD * sample, force.tolist(), position.tolist(), 0.0)
        found = plain.update(*row[:3])
        now = shipped.update(*row)
        assert alarm(*row) is now.slipping
        if found is not None:
            compared += 1
            assert found[0] == pytest.approx(now.slip_speed, abs=1e-12)
    assert compared > 400


# --- changes ------------------------------------------------------------------------------------


# --- the study ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def rows():
    change = Change(
        'position noise', 'm', (1.5e-4, 6e-4), 1.5e-4, conditions.NOT_CONFIGURED,
        conditions.position_noise,
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walks, 'CYCLES', 2)
        patch.setattr(walks, 'FEW_CYCLES', 2)
        patch.setattr(conditions, 'WALK_CYCLES', 2)
        patch.setattr(walks, 'SEEDS', (5, 6))
        patch.setattr(walks, '_ordinary_walks', walks._ordinary_walks.__wrapped__)
        patch.setattr(conditions, 'NOISE_CASES', conditions.NOISE_CASES[:1])
        patch.setattr(methods, 'DISTANCES', (5e-4,))
        found = methods.compare(walks.recordings(1)[:2], lambda _: None)
        found += conditions.stress(change, 1)
        cases = [(robot, 5, 'flat') for robot in ('hexapod', conditions.STICKS)]
        counts = {robot: conditions.tallies(robot, 5, 'flat') for robot, *_ in cases}
        return found + conditions.rows_by_walk(cases, [counts[case[0]] for case in cases])


def test_methods_are_judged_on_the_same_slips(rows):
    mine = [row for row in rows if row.part == 'methods']
    assert {row.slips for row in mine} == {mine[0].slips}
    assert mine[0].slips > 10
    misses = [row.misses for row in mine if row.name == methods.RATIO]
    assert misses[0] > 0.3  # it is on already
    assert misses[-1] > 0.5  # it is hardly ever on
    shipped = mine[-1]
    assert shipped.shipped
    same = [row for row in mine if row.variant == '15 mm/s']
    assert same[0].misses == pytest.approx(shipped.misses, abs=0.05)


def test_noise_that_is_not_configured_is_measured(rows):
    quiet, loud = [row for row in rows if row.part == 'robustness']
    assert quiet.shipped and not loud.shipped
    assert quiet.stick_minutes > 0.1
    assert quiet.false_per_minute == loud.false_per_minute == 0.0
    assert loud.delay > quiet.delay


def test_walks_have_a_row_of_the_table(rows):
    found = [row for row in rows if row.part == 'walks']
    assert {(row.name, row.variant) for row in found} == {
        (robot, conditions.HELD_OUT) for robot in ('hexapod', conditions.STICKS)
    }
    for row in found:
        for name, (low, high) in row.intervals.items():
            assert low <= getattr(row, name) <= high, name


def test_intervals_are_those_of_walks_drawn_anew():
    counts = dict.fromkeys(SIZES, 100)
    tallies = [
        Tally([Alarms(counts, dict.fromkeys(SIZES, missed), minutes=1.0)])
        for missed in (0, 10, 20, 30)
    ]
    row = tally.row_of_walks(
        tallies, part='walks', name='', variant='', value=0.0, unit='', shipped=False
    )
    assert (row.slips, row.misses, row.walks) == (400, 0.15, 4)
    assert row.intervals['misses'][0] < 0.1 < 0.2 < row.intervals['misses'][1]
    assert 'coverage' not in row.intervals
