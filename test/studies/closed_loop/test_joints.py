# SPDX-License-Identifier: Apache-2.0
"""The study joints, on made-up walks and on a short one."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('mujoco')
from studies.closed_loop import joints

SAMPLES = 5000  # 20 s
STAMPS = 0.004 * np.arange(1, SAMPLES + 1)
NOTHING = np.zeros((0, 2))


def made_up(**changes):
    """Return a walk of two legs that stand in turns for 0.4 of 0.5 s, on wet ground, stuck."""
    stands = np.stack([STAMPS % 0.5 < 0.4, (STAMPS + 0.25) % 0.5 < 0.4], axis=1)
    shape = stands.shape
    walk = joints.Walk(
        0.004,
        10.0,
        STAMPS,
        np.where(stands, 10.0, 0.0),
        np.zeros(shape),
        np.zeros((*shape, 2)),
        np.zeros(shape, dtype=bool),
        np.ones(shape, dtype=bool),
        np.ones(shape, dtype=bool),
        np.full(shape, 0.9),
        NOTHING,
        0.0,
        1.0,
        None,
    )
    return replace(walk, **changes)


def test_verdicts_at_ends_of_stances():
    right, total = joints.verdicts(made_up())
    assert right == total
    assert 70 <= total <= 72  # 18 s of two stances in 0.5 s
    assert joints.verdicts(made_up(probability=np.full((SAMPLES, 2), 0.2)))[0] == 0
    half = np.where(np.arange(2) == 0, 0.9, 0.2) * np.ones((SAMPLES, 2))
    right, total = joints.verdicts(made_up(probability=half))
    assert right == pytest.approx(total / 2, abs=1)


def test_stances_in_which_no_foot_sticks_and_domed_ones_do_not_count():
    assert joints.verdicts(made_up(speed=np.full((SAMPLES, 2), 0.05))) == (0, 0)
    assert joints.verdicts(made_up(flat=np.zeros((SAMPLES, 2), dtype=bool))) == (0, 0)


def test_slips_alarms_and_deviations_are_counted():
    speed = np.zeros((SAMPLES, 2))
    slips = (STAMPS > 3.0) & (STAMPS % 2.0 > 0.05) & (STAMPS % 2.0 < 0.25)
    speed[slips, 0] = 0.1
    alarm = np.zeros((SAMPLES, 2), dtype=bool)
    alarm[:, 0] = slips & (STAMPS % 4.0 < 2.0)  # every second slip is missed
    errors = np.array([[0.01, 0.01]] * 3 + [[0.03, 0.01]])
    place = np.cumsum(speed, axis=0)[..., None] * np.array((0.004, 0.0))
    changes = {'speed': speed, 'place': place, 'alarm': alarm, 'body': errors}
    row = joints.summary([made_up(**changes)])
    assert row['slips_5_mm'] == 8
    assert row['missed_5_mm'] == 0.5
    assert row['false_alarms_a_minute'] == 0.0
    assert row['body_coverage'] == 0.75
    assert row['body_rmse_m_s'] == pytest.approx(((3 * 0.01**2 + 0.03**2) / 4) ** 0.5)


def test_a_walk_without_markers_is_measured_against_the_truth():
    walk = joints.walked('hexapod_patches', 4, 12, 'flat', 'joints')
    assert walk.verdict is None
    assert walk.distance > 0.3
    row = joints.summary([walk])
    # The robot moves at up to 0.3 m/s: an estimate of nothing would be off by 0.1 m/s.
    assert row['body_rmse_m_s'] < 0.03
    markers = joints.walked('hexapod_patches', 4, 12, 'flat', 'markers')
    assert not len(markers.body)
    assert markers.distance == pytest.approx(walk.distance, abs=1e-9)  # flat feet decide nothing
    figures = {'flat': {'markers': joints.summary([markers]), 'joints': row}}
    document = {'scenes': {'hexapod_patches': figures}}
    assert 'hexapod_patches' in joints.table(document).splitlines()[1]
