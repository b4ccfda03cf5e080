# SPDX-License-Identifier: Apache-2.0
"""The study of sensing on one short walk."""

import json

import numpy as np
import pytest

from studies.sensing import study, walks


def test_the_estimator_beats_its_rivals_on_a_short_walk(monkeypatch, capsys):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(study, 'CASES', ('patches',))
    assert study.main(['--seeds', '1', '--duration', '10', '--json']) == 0
    rows = {row['method']: row for row in json.loads(capsys.readouterr().out)}
    assert set(rows) == set(study.METHODS)
    best = rows['estimator']
    assert best['velocity_error'] < 0.012  # m/s, "must" of issue 16 on patches
    assert best['coverage'] > 0.95
    assert best['velocity_error'] < rows['plain']['velocity_error']
    assert best['velocity_error'] < 0.7 * rows['odometry']['velocity_error']


def test_logs_agree_with_themselves():
    pytest.importorskip('mujoco')
    log = walks.walk(walks.Course('ch3r', noise=walks.Noise(*[0.0] * 8)), 1, 4.0)
    moved = np.diff(log.position, axis=0) * walks.RATE
    mean = 0.5 * (log.velocity[1:] + log.velocity[:-1])
    assert np.abs(moved - mean).max() < 0.02
    turned = np.diff(log.joint_positions, axis=0) * walks.RATE
    assert (
        np.abs(turned - 0.5 * (log.joint_velocities[1:] + log.joint_velocities[:-1])).std() < 0.1
    )
    assert log.accelerometer[:400].mean(0) == pytest.approx([0.0, 0.0, 9.81], abs=0.05)
    assert log.load.sum(1)[:400].mean() == pytest.approx(2.09 * 9.81, rel=0.02)
    assert log.position[-1, 0] > 0.1
