# SPDX-License-Identifier: Apache-2.0
"""Composed nodes without markers: the same walk as the loop without ROS, and its bag."""

import dataclasses

import numpy as np
import pytest

from ros_pad import configuration, trials
from ros_pad.bags import BagReader
from ros_pad.estimation import doubt as doubts
from ros_pad.nodes import composed
from ros_pad.records import ESTIMATE, SAMPLE
from ros_pad.simulation.scene import Scene
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import replay

LEGS = (1, 2, 3, 4, 5, 6)
SAMPLES = 984  # of 1000: the first 16 wait for a calm robot
SERIES = ('time', 'slow_time', 'slow', 'odom')


def scene_of(cycles):
    return dataclasses.replace(Scene.load('hexapod_patches'), cycles=cycles)


@pytest.fixture(scope='module')
def walked(tmp_path_factory):
    """Return a walk on nodes, the same one without ROS, and the bag."""
    bag = tmp_path_factory.mktemp('joints') / 'bag'
    scene = scene_of(3)
    on_nodes = composed.run(scene, 'adaptive', seed=2, bag=bag, sensing='joints')
    return on_nodes, trials.run(scene, 'adaptive', seed=2, sensing='joints'), bag


def test_the_nodes_walk_as_the_loop_without_ros_does(walked):
    on_nodes, without, _ = walked
    assert on_nodes.fidelity == without.fidelity == 'L2'
    assert on_nodes.settings['sensing'] == without.settings['sensing'] == 'joints'
    assert len(on_nodes.time) == SAMPLES
    assert on_nodes.time[-1] == pytest.approx(4.0)
    for series in SERIES:
        one, other = getattr(on_nodes, series), getattr(without, series)
        assert np.array_equal(one, other), series
    # The true heading is sent as a quaternion, which costs 1e-15 rad, and turns feet by it.
    for series in ('body', 'position', 'force'):
        one, other = getattr(on_nodes, series), getattr(without, series)
        assert np.abs(one - other).max() < 1e-13, series
    assert on_nodes.metrics == without.metrics
    assert on_nodes.metrics.distance_m > 0.25


def test_odom_follows_the_true_body(walked):
    _, without, _ = walked
    assert without.odom.shape == without.body.shape
    miss = np.hypot(*(without.odom - without.body)[:, :2].T)
    assert miss.max() < 0.03  # of 0.35 m walked
    assert miss.max() > 1e-4  # it is an estimate
    assert np.abs(without.odom[:, 2] - without.body[:, 2]).max() < 0.02


def test_the_bag_has_the_topics_and_their_truths(walked):
    *_, bag = walked
    counts = BagReader(bag).counts
    assert counts['/imu/data'] == counts['/joint_states'] == counts['/feet/force'] == 1000
    assert counts['/odom'] == SAMPLES and counts['/feet/estimate'] == 201
    _, _, samples = BagReader(bag).records({'/feet/sample': SAMPLE})['/feet/sample']
    for name in ('force', 'position', 'velocity', 'variance'):
        assert np.isfinite(samples.rows[name]).all(axis=(1, 2)).sum() == SAMPLES
    found = {}
    for topic, message, _ in BagReader(bag).messages(['/imu/data', '/odom', '/joint_states']):
        found.setdefault(topic, []).append(message)
    imu, odom, joints = (found[name][-1] for name in ('/imu/data', '/odom', '/joint_states'))
    assert imu.orientation_covariance[0] == -1.0
    pulls = [each.linear_acceleration.z for each in found['/imu/data']]
    assert np.mean(pulls) == pytest.approx(9.81, abs=0.1)
    assert (odom.header.frame_id, odom.child_frame_id) == ('odom', 'base_link')
    assert odom.header.stamp == imu.header.stamp == joints.header.stamp
    for part in (odom.pose.covariance, odom.twist.covariance):
        matrix = np.reshape(part, (6, 6))
        assert np.allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0
    assert len(joints.name) == len(joints.velocity) == len(joints.effort) == 18


def test_a_silent_imu_leaves_a_gap_and_then_a_doubt(tmp_path):
    text = configuration.locate('scenes', 'hexapod_patches').read_text()
    text += """
faults:
  - {kind: imu_silent, start: 1.5, end: 2.3}
  - {kind: joints_silent, start: 2.6, end: 2.65}
"""
    (tmp_path / 'mine.yaml').write_text(text)  # the simulator loads it again
    scene = dataclasses.replace(Scene.load(tmp_path / 'mine.yaml'), cycles=2)
    on_nodes = composed.run(scene, 'flat', seed=1, bag=tmp_path / 'bag', sensing='joints')
    without = trials.run(scene, 'flat', seed=1, sensing='joints')
    assert np.diff(on_nodes.time).max() == pytest.approx(0.804, abs=1e-9)
    assert np.isfinite(on_nodes.odom).all()
    assert np.array_equal(on_nodes.odom, without.odom)
    assert on_nodes.metrics == without.metrics
    said = [
        message.data for _, message, _ in BagReader(tmp_path / 'bag').messages(['/body/doubt'])
    ]
    kinds = [each.partition(':')[0] for each in said]
    assert kinds[0] == ''
    assert 'no IMU' in kinds
    assert kinds[kinds.index('no IMU') + 1] == 'gap'
    assert kinds[kinds.index('gap') + 1] == ''
    bag = BagReader(tmp_path / 'bag')
    _, _, estimates = bag.records({'/feet/estimate': ESTIMATE})['/feet/estimate']
    assert 'no wrench' in {doubts.kind(code) for code in estimates.rows['doubt'][:, 1]}


def of_the_body(found):
    return [each for each in found.comparisons if each.topic in ('/odom', '/feet/sample')]


def test_a_replay_of_the_bag_is_equal_to_the_bit(walked):
    *_, path = walked
    bag = BagReader(path)
    found = replay(bag)
    assert found.settings.tuning.source == 'joints'
    assert not found.settings.tuning.pads_shear
    assert found.verdict == 'equal'
    assert not found.refused
    assert found.samples == dict.fromkeys(LEGS, SAMPLES)
    quantities = {each.quantity for each in found.comparisons}
    assert {'slip', 'wetness', 'doubt', 'setpoint', 'orientation', 'velocity'} <= quantities
    of_body = of_the_body(found)
    assert len(of_body) == 2 + 6 * len(SAMPLE.fields)
    for each in of_body:
        assert (each.equal, each.missing, each.not_recorded) == (SAMPLES, 0, 0)
    # Without the velocities it is another estimate: nothing of markers is in this bag.
    settings = NodeSettings.of(bag).changed({'alarm.threshold': 1.0})
    assert replay(bag, settings).verdict == 'different'
