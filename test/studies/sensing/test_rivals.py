# SPDX-License-Identifier: Apache-2.0
"""The invariant filter, a rival of the body estimator, has the properties that papers prove."""

import numpy as np
import pytest

from ros_pad.robots import Robot
from studies.sensing import rivals, study, walks

GO2 = Robot.load('go2')
COURSE = walks.Course()
STILL = np.zeros((4, 3))
YAW, PLACE = 2, 6  # rows of the errors of heading and of the first coordinate of position


@pytest.fixture(scope='module')
def log():
    pytest.importorskip('mujoco')
    return walks.walk(COURSE, 1, 6.0)


def run(found, log, rows):
    stands = rivals.loads_of(GO2, log)
    for row in rows:
        found.update(
            *(log.gyro[row], log.accelerometer[row]),
            *(log.joint_positions[row], log.joint_velocities[row], stands[row]),
        )
    return found


def test_nothing_is_learnt_about_heading_and_place(log):
    found = rivals.InvariantFilter(GO2, COURSE)
    found.begin(log)
    unknown = [YAW, PLACE, PLACE + 1, PLACE + 2]
    wide = np.zeros(27)
    wide[[0, 1, 3, 4, 5]] = 1.0
    found.covariance += np.diag(wide)
    for index in unknown:
        alike = np.zeros(27)
        alike[index::3][: 5 if index >= PLACE else 1] = 1.0  # footholds are as far off as the body
        found.covariance += np.outer(alike, alike)
    run(found, log, range(len(log.time)))
    kept = found.covariance[np.ix_(unknown, unknown)]
    assert np.linalg.eigvalsh(kept).min() > 1.0 - 1e-6
    learnt = np.diag(found.covariance)[[0, 1, 3, 4, 5]]
    assert learnt.max() < 0.01


def test_rejection_helps_where_feet_slip(log):
    slid = walks.walk(walks.COURSES['ice'], 1, 8.0)
    walking = slid.time > walks.REST + walks.RAMP

    def error(method):
        track = study.track_of(GO2, slid, walks.COURSES['ice'], method)
        miss = (track.velocity - slid.velocity)[walking, :2]
        return np.sqrt((miss**2).sum(1).mean())

    assert error('plain') < error('invariant, χ²') < 0.5 * error('odometry')
