# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy import stats

from ros_pad.simulation import Scene
from studies.work_precision.estimator import priors
from studies.work_precision.estimator.priors import Condition, Sample


class Normal:
    """A posterior that is normal, of friction 0.5 with a deviation of 0.1."""

    friction = 0.5, 0.1
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
    sample = priors._sample(Normal(), 1.0, 1, 0, 0.5 + away)
    assert sample.crps == pytest.approx(expected, abs=0.02 * 0.1)
    assert sample.covered == (away < 0.196)
    assert sample.width == pytest.approx(2.0 * 1.96 * 0.1, rel=1e-3)
    assert not sample.below
    assert priors._sample(Normal(), 1.0, 1, 0, 0.5 - 0.17).below


def test_rows_count_time_and_stances():
    """A stance of one sample counts by stance as much as one of nine."""
    covered = [Sample(130.0 + 0.1 * k, 1, 0, 0.1, True, False, 0.2, 0.01) for k in range(9)]
    missed = [Sample(140.0, 2, 0, 0.9, False, True, 0.2, 0.05)]
    early = [Sample(10.0, 3, 1, 0.9, True, False, 0.4, 0.02)]
    walk = {name: [] for name in priors.FILTERS} | {priors.LEARNS: early + covered + missed}
    first, _, second, both = priors.rows_of(Condition('any'), [walk])
    assert (first['phase'], first['ground'], first['samples']) == ('early', 'wet', 1)
    assert (second['phase'], second['ground'], second['stances']) == ('late', 'dry', 2)
    assert second['coverage'] == 0.9 and second['stance_coverage'] == 0.5
    assert second['right_coverage'] == 1.0
    assert second['below'] == 0.1 and second['wrong_labels'] == 0.5
    assert second['crps'] == pytest.approx((9 * 0.01 + 0.05) / 10, abs=1e-4)
    assert (both['ground'], both['coverage']) == ('all', 0.9)


def test_the_foot_of_a_walk_has_the_friction_of_its_condition():
    """Wet friction halved is half of 0.12, and the friction that is configured is the file's."""
    ground = Condition('', wet=0.5, spread=0.0)
    walk = priors.walked(ground, 'flat', 50, duration=2)
    light = (walk.load > 2.0) & walk.wet
    assert light.sum() > 100
    assert np.median(walk.grip[light] / walk.load[light]) == pytest.approx(0.06, abs=1e-6)
    assert walk.settings[0].friction == Scene.load(ground.scene).foot.friction


def test_floors_are_drawn_from_what_the_estimator_expects_before_a_walk():
    """ln of factors is N(0, 0.4), spreads are 0.08 and 0.16: of 400 floors the mean is within 3.5
    standard errors, and the deviation."""
    floors = [priors.drawn(seed)[0] for seed in range(400)]
    logs = np.log([(each.dry, each.wet, each.dome) for each in floors])
    assert abs(logs.mean(axis=0)).max() < 3.5 * 0.4 / 20.0
    assert abs(logs.std(axis=0) / 0.4 - 1.0).max() < 3.5 / math.sqrt(800.0)
    assert {each.spread for each in floors} == {0.08, 0.16}
    assert {priors.drawn(seed)[1] for seed in range(3)} == {'flat', 'dome', 'adaptive'}
