# SPDX-License-Identifier: Apache-2.0
"""Walks without markers in the loop without ROS: settings, refusals, and where feet are."""

import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip('mujoco')
from ros_pad import trials
from ros_pad.estimation import doubt
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.series import in_world

PATCHES = Scene.load('hexapod_patches')
SHORT = dataclasses.replace(PATCHES, cycles=2)


def test_the_same_seed_gives_the_same_walk_and_another_one_other_noise():
    one, same, other = (trials.run(SHORT, 'flat', seed, sensing='joints') for seed in (3, 3, 4))
    for series in ('odom', 'position', 'force', 'slow'):
        assert getattr(one, series).tobytes() == getattr(same, series).tobytes(), series
    assert not np.array_equal(one.odom, other.odom)
    assert one.settings['sensing'] == 'joints'


def test_a_quadruped_is_sensed_by_its_joints():
    scene = dataclasses.replace(Scene.load('quadruped_patches'), cycles=6)
    trial = trials.run(scene, 'dome', seed=1, sensing='joints')
    assert trial.metrics.verdict is None
    # The estimated path is the true one, less what starts before the estimate.
    way = trial.body[-1, 0] - trial.body[0, 0]
    assert trial.odom[-1, 0] - trial.odom[0, 0] == pytest.approx(way, abs=0.02)
    assert way > 0.6


@pytest.mark.parametrize('kind', ['imu_silent', 'joints_silent'])
def test_a_walk_without_any_sample_has_its_true_distance(kind):
    scene = dataclasses.replace(SHORT, faults=(Fault(kind, 0.0, 100.0),))
    trial = trials.run(scene, 'flat', 1, sensing='joints')
    assert trial.force.shape == (0, 6, 3)
    assert trial.metrics.distance_m > 0.0


def test_drop_outs_are_survived():
    faults = (Fault('imu_silent', 1.2, 1.9), Fault('joints_silent', 2.2, 2.25))
    scene = dataclasses.replace(SHORT, faults=faults)
    loop = ClosedLoop(scene, 'adaptive', 1, sensing='joints')
    doubts = set()
    for _ in range(750):
        loop.tick()
        doubts.add(loop.body.stage.doubt)
    loop.close()
    rows = loop.log.records.estimate.rows
    assert np.isfinite(rows['wetness']).all() and np.isfinite(rows['slip']).all()
    kinds = {each.partition(':')[0] for each in doubts if each}
    assert {'no IMU', 'gap'} <= kinds
    assert loop.body.stage.doubt == ''
    assert not any(doubt.is_fault(code) for code in rows['doubt'][-1])


def test_feet_in_odom_move_to_the_world():
    """Odom is turned by 90 degrees, and begins at (2, 3) m."""
    force, position = in_world(
        np.array([[[1.0, 0.0, 5.0]]]),
        np.array([[[1.2, 0.1, -0.14]]]),
        np.array([[1.0, 0.0, 0.0]]),
        np.array([[2.0, 4.0, 0.5 * math.pi]]),  # 1 m ahead of where odom begins
    )
    # 0.2 m ahead of the body and 0.1 m to its left, where ahead is y.
    assert position[0, 0] == pytest.approx([1.9, 4.2, -0.14])
    assert force[0, 0] == pytest.approx([0.0, 1.0, 5.0])
