# SPDX-License-Identifier: Apache-2.0
"""Accuracy of estimators on walks with full dynamics, where feet scuff and turn."""

import dataclasses

import numpy as np
import pytest

from ros_pad.estimation import doubt
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.track import LOAD_GATE
from ros_pad.simulation.scene import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.node_settings import tuning_for
from studies import slips
from studies.closed_loop import loops

PERIOD = 0.004  # s
WALKS = [(policy, seed) for policy in ('flat', 'adaptive') for seed in (10, 11, 12)]


def walked(policy, seed, cycles=12):
    """Return arrays (samples, feet) of true values and estimates."""
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=cycles)
    loop = ClosedLoop(scene, policy, seed, 'L2')
    rows = [
        [(*foot.force, foot.wet, *foot.position[:2]) for foot in loop.robot.feet]
        for _ in loop.walk()
    ]
    assert loop.robot.verdict is None
    tuning, load = tuning_for(scene), scene.expected_load
    stage = EstimationStage(scene.foot, load, tuning, scene.legs, loop.period_ns)
    estimates = loops.estimated(stage, loop.log.records)
    assert 'axes' not in {doubt.kind(each) for each in np.unique(estimates.rows['doubt'])}
    true = np.array(rows, dtype=float)
    place = true[..., 4:] + true[..., :2] / scene.foot.shear_stiffness
    series = {'load': true[..., 2], 'wet': true[..., 3], 'place': place}
    series |= {'alarm': estimates.rows['slipping'], 'wetness': estimates.rows['wetness']}
    series |= {'pressure': loops.pressures(loop.log.records, estimates.stamps)}
    series |= {'standing': loop.log.records.sample.rows['force'][..., 2] > LOAD_GATE * load}
    return {name: each[round(scene.settle / PERIOD) :] for name, each in series.items()}


@pytest.fixture(scope='module')
def walks():
    return [walked(*walk) for walk in WALKS]


def stretches(true):
    """Return (first, last) of each run of True; gaps of up to five samples are bridged."""
    places = np.flatnonzero(true)
    if not len(places):
        return []
    breaks = np.flatnonzero(np.diff(places) > 6)
    return list(zip(places[[0, *breaks + 1]], places[[*breaks, -1]], strict=True))


@pytest.mark.slow
def test_slips_raise_the_alarm_and_sticks_do_not(walks):
    found = [
        slips.judged(
            walk['alarm'] > 0.0, walk['load'] > LOAD_GATE * 6.83, walk['place'], PERIOD, 0.0
        )
        for walk in walks
    ]
    row = slips.row_of(found)
    assert row['slips_5_mm'] > 150 and row['minutes_of_sticking'] > 0.9
    assert row['missed_5_mm'] <= 0.03  # in these the alarm is on already, from an earlier slip
    assert row['false_alarms_a_minute'] <= 1.1  # one


def test_wet_and_dry_are_distinguished_at_the_end_of_a_flat_stance(walks):
    right = []
    for walk in walks:
        for foot in range(6):
            standing = walk['standing'][:, foot] > 0.0
            for first, last in stretches(standing):
                middle = (first + last) // 2
                # A short touch is no stance, and the last stance of a walk has no end.
                if last - first < 25 or last + 1 == len(standing):
                    continue
                if walk['pressure'][middle, foot] < 30e3:
                    wet = walk['wet'][middle, foot] > 0.0
                    right.append((walk['wetness'][last, foot] > 0.5) == wet)
    assert len(right) > 300
    assert np.mean(right) >= 0.97
