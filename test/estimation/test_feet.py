# SPDX-License-Identifier: Apache-2.0
"""The estimator of all feet: blocks, numbers and order of feet do not matter."""

import math

import numpy as np
import pytest

from ros_pad.contact import Foot
from ros_pad.estimation import FootEstimator, Tuning
from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import PRESSURE, SAMPLE, Block

FOOT, LOAD, PERIOD_NS = Foot.load('large37'), 6.8, 4_000_000
ALONE = Tuning(learn_friction=False)
JOINTS = Tuning(source='joints', learn_friction=False)


def walk(feet=3, seconds=4.0, seed=1):
    """Return stamps and samples of feet that step, slip now and then, and have moments."""
    random = np.random.default_rng(seed)
    count = round(seconds * 1e9 / PERIOD_NS)
    stamps = PERIOD_NS * np.arange(1, count + 1)
    phase = (stamps[:, None] * 1e-9 / 0.8 + np.arange(feet) * 0.4) % 1.0
    swings = phase > 0.6
    load = np.where(swings, 0.0, LOAD * np.minimum(1.0, np.minimum(phase, 0.6 - phase) / 0.05))
    pull = -load * (0.1 + 0.15 * (np.arange(feet) % 2))
    slip = np.where((phase > 0.3) & (phase < 0.4), 0.08, 0.0)
    speed = np.where(swings, 0.4, slip)
    rows = SAMPLE.rows(count, feet)
    rows['force'] = np.stack([pull, 0.1 * pull, load], axis=2) + random.normal(
        0.0, 0.03, (count, feet, 3)
    )
    height = np.where(swings, 0.03 * np.sin(math.pi * (phase - 0.6) / 0.4), 0.0)
    ahead = np.cumsum(speed, axis=0) * 0.004 - pull / FOOT.shear_stiffness
    place = np.stack([ahead, np.zeros_like(ahead), height], axis=2)
    rows['position'] = place + random.normal(0.0, 1.5e-4, place.shape)
    rows['moment'] = 0.01 * pull + random.normal(0.0, 5e-4, pull.shape)
    rows['velocity'] = np.stack([speed, 0.0 * speed], axis=2)
    rows['variance'] = 1e-4 * random.uniform(0.5, 2.0, rows['variance'].shape)
    return stamps, rows


def disturbed():
    """Return such a walk in which sensors stop, markers are hidden, and clocks are set back."""
    stamps, rows = walk()
    rows['force'][250:450, 0] = rows['force'][250, 0]
    rows['position'][300:360, 1] = math.nan
    rows['position'][500:600:2, 2] = math.nan
    rows['force'][650:655, 1] = math.nan
    rows['force'][700, 2] = math.inf
    rows['position'][720:, 0, 0] += 0.5
    rows['variance'][100:130] = math.inf
    stamps = stamps.copy()
    stamps[800:] -= 2_000_000_000
    return stamps, rows


def estimates(stamps, rows, tuning=ALONE, block=1, period_ms=20, legs=None):
    """Return all estimates of a walk as numbers, by foot."""
    feet = rows.shape[1]
    stage = EstimationStage(
        FOOT, LOAD, tuning, legs or range(1, feet + 1), round(period_ms * 1_000_000)
    )
    pressures = PRESSURE.rows(feet)
    pressures['pressure'] = 80e3 * (np.arange(feet) == 1)
    stage.pressure(Block.of(0, pressures))
    found = []
    for begin in range(0, len(stamps), block):
        part = slice(begin, begin + block)
        found += stage.process(Block(stamps[part], rows[part]))
    return np.concatenate([each.rows.view(float).reshape(1, feet, -1) for each in found])


CASES = [(disturbed, Tuning()), (disturbed, JOINTS), (walk, Tuning(moment_noise=5e-4))]


@pytest.mark.parametrize(('samples', 'tuning'), CASES)
def test_the_size_of_blocks_does_not_matter(samples, tuning):
    stamps, rows = samples()
    single = estimates(stamps, rows, tuning, 1)
    for block in (5, 50):
        blocks = estimates(stamps, rows, tuning, block)
        np.testing.assert_allclose(blocks, single, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize('samples', [walk, disturbed])
def test_feet_that_share_nothing_are_as_alone(samples):
    """They share the friction that they learn, and their evidence of turned axes."""
    stamps, rows = samples()
    together = estimates(stamps, rows, ALONE, 5)
    for place in (0, 2):  # the pads of the other one are under pressure
        alone = estimates(stamps, rows[:, place : place + 1], ALONE, 5)
        times = slice(0, min(len(alone), len(together)))
        assert abs(len(alone) - len(together)) <= 1
        np.testing.assert_allclose(
            alone[times, 0, 3:], together[times, place, 3:], rtol=1e-9, atol=1e-9
        )


@pytest.mark.parametrize('tuning', [Tuning(), Tuning(source='joints')])
def test_the_order_of_feet_does_not_matter(tuning):
    """What feet learn together does not depend on which of them is read first."""
    stamps, rows = walk()
    found = []
    for each in (rows, rows[:, [2, 0, 1]]):
        stage = EstimationStage(FOOT, LOAD, tuning, (1, 2, 3))
        found.append(stage.process(Block(stamps, each))[-1].rows.view(float).reshape(3, -1))
    np.testing.assert_allclose(found[1], found[0][[2, 0, 1]], rtol=1e-9, atol=1e-9)


def test_the_estimator_of_one_foot_is_that_of_all():
    stamps, rows = walk(feet=1)
    rows['position'][300:340:2] = math.nan
    found = estimates(stamps, rows, ALONE, 5, 4)
    single, last, seen = FootEstimator(FOOT, LOAD, ALONE), None, 0.0
    for stamp, row, many in zip((stamps * 1e-9).tolist(), rows[:, 0], found[:, 0], strict=True):
        if np.isfinite(row['position']).all():
            last, seen = row['position'].tolist(), stamp
        now = single.update(stamp, row['force'].tolist(), last, 0.0, position_time=seen)
        assert many[3:12] == pytest.approx([
            *now.slip_velocity, now.slip_speed, now.slip_speed_sd, float(now.slipping),
            now.wet_probability, now.friction_mean, now.friction_sd, now.margin,
        ], rel=1e-9, abs=1e-9, nan_ok=True)  # fmt: skip


def test_feet_learn_together():
    """What one foot shows of friction, the others expect."""
    stamps, rows = walk(feet=2, seconds=8.0)
    learnt = estimates(stamps, rows, Tuning(), 5)[:, :, 9]
    alone = estimates(stamps, rows, ALONE, 5)[:, :, 9]
    assert np.nanmax(abs(learnt - alone)) > 1e-3
