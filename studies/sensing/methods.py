# SPDX-License-Identifier: Apache-2.0
"""The body estimator and its rivals, run over logs of walks."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing import BodyEstimator
from studies.samples import Flags
from studies.sensing import rivals
from studies.sensing.walks import Course, Log

METHODS = ('estimator', 'plain', 'invariant, χ²', 'odometry')


class Track(NamedTuple):
    """What a method gives for a log, row by row; deviations are NaN where it has none."""

    position: Array
    velocity: Array
    deviation: Array  # of velocity x and y
    tilt: Array  # deviation of the tilt about x and y
    slip: Array
    slip_deviation: Array
    standing: Flags
    force: Array
    slipping: Flags
    doubt: Flags
    seconds: float  # an update


def estimator_for(robot: Robot, course: Course) -> BodyEstimator:
    """Return an estimator that knows the noise of a course."""
    noise = course.noise
    settings = {
        'gyro_noise': noise.gyro,
        'accelerometer_noise': noise.accelerometer,
        'encoder_noise': noise.encoder,
        'velocity_noise': noise.velocity,
        'force_noise': noise.force,
        'accelerometer_bias': noise.accelerometer_bias,
    }
    return BodyEstimator(robot, **settings)


def readings(log: Log) -> Iterable[tuple[Any, ...]]:
    """Return the readings of a log, sample by sample, as the estimator takes them."""
    columns = (log.gyro, log.accelerometer, log.joint_positions, log.joint_velocities)
    return zip(log.time.tolist(), *columns, log.foot_forces, strict=True)


def estimated(robot: Robot, log: Log, course: Course) -> Track:
    """Run the estimator over a log."""
    estimator = estimator_for(robot, course)
    begin = time.process_time()
    found = [estimator.update(*row) for row in readings(log)]
    seconds = (time.process_time() - begin) / len(found)
    feet = [each.feet for each in found]
    return Track(
        position=np.array([each.position for each in found]),
        velocity=np.array([each.velocity for each in found]),
        deviation=np.sqrt([np.diag(each.covariance)[6:8] for each in found]),
        tilt=np.sqrt([np.diag(each.covariance)[3:5] for each in found]),
        slip=np.array([[foot.slip_velocity for foot in row] for row in feet]),
        slip_deviation=np.array([[foot.slip_velocity_sd for foot in row] for row in feet]),
        standing=np.array([[foot.in_contact for foot in row] for row in feet]),
        force=np.array([[foot.force for foot in row] for row in feet]),
        slipping=np.array([[foot.excluded for foot in row] for row in feet]),
        doubt=np.array([bool(each.doubt) for each in found]),
        seconds=seconds,
    )


def track_of(robot: Robot, log: Log, course: Course, method: str) -> Track:
    """Run a method over a log."""
    if method == 'estimator':
        return estimated(robot, log, course)
    begin = time.process_time()
    if method in rivals.FILTERS:
        rows = rivals.FILTERS[method](robot, course).rows(log)
    else:
        rows = rivals.odometry(robot, log, course)
    seconds = (time.process_time() - begin) / len(rows)
    stands = rivals.loads_of(robot, log)
    none = np.full(stands.shape, math.nan)
    spread = np.array([row[3] for row in rows]) if len(rows[0]) > 3 else none[:, :2]
    return Track(
        position=np.array([row[0] for row in rows]),
        velocity=np.array([row[1] for row in rows]),
        deviation=spread,
        tilt=none[:, :2],
        slip=np.array([row[2][:, :2] for row in rows]),
        slip_deviation=none,
        standing=stands,
        force=log.foot_forces,  # of a body that is nearly level
        slipping=np.zeros_like(stands),
        doubt=np.zeros(len(rows), dtype=bool),
        seconds=seconds,
    )
