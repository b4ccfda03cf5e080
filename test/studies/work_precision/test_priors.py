# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy import stats

from ros_pad.simulation import Scene
from studies.work_precision.estimator import priors
from studies.work_precision.estimator.priors import End, Floor


class Normal:
    """A posterior that is normal, of friction 0.5 with a deviation of 0.1."""

    wet_probability = 0.2

    def quantile(self, shares):
        return stats.norm.ppf(shares, 0.5, 0.1)


@pytest.mark.parametrize('away', [0.0, 0.1, 0.3])
def test_the_score_is_that_of_a_normal_distribution(away):
    """CRPS of a normal distribution: Gneiting and Raftery (2007), equation 21."""
    z = away / 0.1
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    below = 0.5 * (1.0 + math.erf(z / math.sqrt(2.0)))
    expected = 0.1 * (z * (2.0 * below - 1.0) + 2.0 * density - 1.0 / math.sqrt(math.pi))
    end = priors.scored(Normal(), True, 0.5 + away)
    assert end.crps == pytest.approx(expected, abs=0.02 * 0.1)
    assert end.less == pytest.approx(below, abs=0.011)
    assert (end.wet, end.wet_probability, end.above) == (True, 0.2, False)
    assert priors.scored(Normal(), True, 0.5 - 0.17).above


def test_rows_count_stances():
    walk = [End(False, 0.1 * k, k == 2, 0.1 * k + 0.05, 0.1) for k in range(10)]
    walk += [End(True, 0.95, False, 0.05, 0.6)]
    row = priors.row_of({}, [walk, walk[:1]])
    assert (row['walks'], row['stances'], row['above']) == (2, 12, round(1 / 12, 3))
    assert row['crps'] == pytest.approx((11 * 0.1 + 0.6) / 12, abs=1e-4)
    assert row['pit'] == [3, *[1] * 9]
    assert row['right'] == round((7 + 1) / 12, 3)  # P(wet) is above 0.5 for 0.6 to 0.9, all dry
    assert row['wet'][-1] == [2, 0.925, 0.5]
    least, most = row['interval']
    assert 0.0 <= least < 1 / 12 < most <= 1 / 11 + 1e-3


def test_floors_of_a_kind_are_in_two_rows():
    """That of the robot, policy and floor, and that of all."""
    flat, drawn = Floor('right'), Floor(priors.DRAWN)
    walk = {name: [End(True, 0.9, False, 0.5, 0.1)] for name in priors.FILTERS}
    rows = priors.rows_of([(flat, 'flat', 1), (flat, 'flat', 2), (drawn, 'dome', 1)], 3 * [walk])
    found = [(row['floor'], row['robot'], row['policy'], row['walks']) for row in rows[:3]]
    assert found == [
        (priors.ALL, '', '', 2), ('right', 'hexapod', 'flat', 2), (priors.DRAWN, '', '', 1),
    ]  # fmt: skip
    assert len(rows) == 3 * len(priors.FILTERS)


def test_the_foot_of_a_walk_has_the_friction_of_its_floor():
    """Wet friction halved is half of 0.12, and the friction that is configured is the file's."""
    floor = Floor('', wet=0.5, spread=0.0)
    walk = priors.walked(floor, 'flat', 50, duration=2)
    light = (walk.load > 2.0) & walk.wet
    assert light.sum() > 100
    assert np.median(walk.grip[light] / walk.load[light]) == pytest.approx(0.06, abs=1e-6)
    assert walk.settings[0].friction == Scene.load(floor.scene).foot.friction
    shipped, prior = zip(*priors.ends(walk, True), strict=True)
    assert len(shipped) > 3
    assert {round(end.wet_probability, 9) for end in prior} == {0.5}


def test_floors_are_drawn_from_what_the_estimator_expects_before_a_walk():
    """ln of factors is N(0, 0.4), spreads are 0.08 and 0.16: of 400 floors the mean is within 3.5
    standard errors, and the deviation."""
    floors = [priors.drawn(seed)[0] for seed in range(400)]
    logs = np.log([(each.dry, each.wet, each.dome) for each in floors])
    assert abs(logs.mean(axis=0)).max() < 3.5 * 0.4 / 20.0
    assert abs(logs.std(axis=0) / 0.4 - 1.0).max() < 3.5 / math.sqrt(800.0)
    assert {each.spread for each in floors} == {0.08, 0.16}
    assert {priors.drawn(seed)[1] for seed in range(3)} == {'flat', 'dome', 'adaptive'}
