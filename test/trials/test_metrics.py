# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.trials import Trial, run
from ros_pad.trials.metrics import stance_ends, time_to, wet_accuracy
from ros_pad.trials.trial import SLOW

SCENE = Scene.load('hexapod_patches')
GATE = 2.0  # N


def written(load, x, wet_probability, pressure=None, floor=None):
    """Return a trial made of given series, with a control step at every second sample.

    ``load``, N, and ``x``, m, have a row for each sample, the others one for each control step;
    columns are legs.
    """
    load, x = np.array(load, dtype=float), np.array(x, dtype=float)
    samples, legs = load.shape
    belief = np.array(wet_probability, dtype=float)
    steps = len(belief)
    assert steps == (samples + 1) // 2
    force, position = np.zeros((samples, legs, 3)), np.zeros((samples, legs, 3))
    force[:, :, 2], position[:, :, 0] = load, x
    slow = np.zeros((steps, legs), SLOW)
    slow['wetness'] = belief
    if pressure is not None:
        slow['pressure'] = pressure
    return Trial(
        scene='written', policy='flat', fidelity='L1', seed=0, legs=tuple(range(1, legs + 1)),
        time=0.1 * np.arange(1, samples + 1), body=np.zeros((samples, 3)), force=force,
        position=position, slow_time=0.1 * np.arange(1, samples + 1, 2), slow=slow, floor=floor,
    )  # fmt: skip


# Wet for x from 0 to 1 m, dry from 1 to 2 m, and so on.
STRIPES = Floor(np.array([[True, False]]), 1.0, (0.0, 0.0), 3e-4)
#        sample 1  2  3  4  5  6  7  8  9 10
LOADS = [[9, 9, 9, 9, 0, 0, 9, 9, 9, 0]]
WAY = [[0.5] * 5 + [1.5] * 5]


def one_leg(belief, pressure=None, floor=STRIPES):
    return written(
        np.transpose(LOADS), np.transpose(WAY), np.transpose([belief]),
        None if pressure is None else np.transpose([pressure]), floor,
    )  # fmt: skip


def test_stances_end_at_the_first_control_step_after_the_last_loaded_sample():
    trial = one_leg([0.5] * 5)
    # Control steps are at samples 1, 3, 5, 7 and 9. The first stance ends with sample 4, so that
    # its row is 2. The second ends with sample 9, after which there is no control step.
    assert [rows.tolist() for rows in stance_ends(trial, GATE)] == [[2]]


@pytest.mark.parametrize(('at_end', 'expected'), [(0.9, 1.0), (0.1, 0.0), (0.5, 0.0)])
def test_belief_at_the_end_of_a_stance_against_the_ground_it_stood_on(at_end, expected):
    """The foot stands at 0.5 m, on wet ground; estimates before and after do not matter."""
    assert wet_accuracy(one_leg([0.0, 0.0, at_end, 0.0, 0.0]), GATE) == expected


def test_accuracy_is_over_all_legs_and_stances():
    load = [[9, 9, 0], [9, 9, 9], [0, 9, 9], [9, 0, 9], [9, 9, 9], [9, 9, 0], [0, 9, 0]]
    x = [[0.5, 1.5, 0.5]] * 7
    belief = [[0.9, 0.9, 0.5]] * 4
    # Leg 1: two wet stances, right. Leg 2: a dry one, estimated wet. Leg 3: a wet one at 0.3.
    trial = written(load, x, np.array(belief) - [[0.0, 0.0, 0.2]], floor=STRIPES)
    assert [len(rows) for rows in stance_ends(trial, GATE)] == [2, 1, 1]
    assert wet_accuracy(trial, GATE) == 2 / 4


def test_metrics_agree_with_the_series():
    scene = dataclasses.replace(SCENE, cycles=8)
    trial = run(scene, 'adaptive', seed=1)
    metrics = trial.metrics
    assert metrics.distance_m == trial.body[-1, 0]
    assert metrics.lateral_drift_m == trial.body[-1, 1]
    assert metrics.yaw_drift_rad == trial.body[-1, 2]
    assert metrics.duration_s == pytest.approx(scene.duration)
    assert metrics.cycles == pytest.approx(8.0)
    changes = np.sum(trial.slow['dome'][1:] != trial.slow['dome'][:-1], axis=0)
    assert metrics.switches == changes.tolist()
    assert sum(metrics.switches) > 0
    # Slip paths are at least the advance of loaded markers, except for the shear of pads.
    loaded = trial.force[:, :, 2] > 0.5 * scene.expected_load
    moved = np.where(loaded[1:] & loaded[:-1], np.diff(trial.position[:, :, 0], axis=0), 0.0)
    assert all(
        path > abs(way) - 0.02
        for path, way in zip(metrics.slip_path_m, moved.sum(axis=0), strict=True)
    )
    assert sum(metrics.slip_path_m) > 0.01
    assert metrics.dissipation_j > 0.0
    assert 0.9 <= metrics.wet_accuracy <= 1.0


def test_time_to_a_goal_is_counted_from_the_first_step_and_between_samples():
    trial = one_leg([0.9] * 5)
    trial.time = np.array([0.0, 1.0, 2.0, 3.0])
    trial.body = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.5, 0, 0], [0.4, 0, 0]])
    assert time_to(trial, 0.2, 0.5) == pytest.approx(1.25 - 0.5)
    assert time_to(trial, 0.5, 0.5) == pytest.approx(1.5)
    assert time_to(trial, 0.6, 0.5) is None
