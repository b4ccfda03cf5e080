# SPDX-License-Identifier: Apache-2.0
"""A dry walk of a quadruped that was simulated outside ros_pad, see test/reference/README.md."""

import functools

import numpy as np

from ros_pad.contact import Foot
from ros_pad.estimation import FootEstimator, Tuning
from ros_pad.estimation.friction import GroundModel
from studies.sensing import study, walks
from studies.sensing.methods import track_of


@functools.cache
def data():
    return dict(np.load(walks.REFERENCE / 'quad_dry.npz'))


def test_the_body_is_no_worse_than_by_a_plain_filter():
    """Asked: 4.5 mm/s, and at most 1 % of drift."""
    course, log = walks.COURSES[walks.RECORDED], walks.recorded()
    robot = walks.robot_of(course.robot)
    track = track_of(robot, log, course, 'estimator')
    late = log.time > 1.0
    plain = track_of(robot, log, course, 'plain')
    ours, theirs = (
        np.sqrt(((each.velocity - log.velocity)[late, :2] ** 2).sum(1).mean())
        for each in (track, plain)
    )
    assert ours < min(1.05 * theirs, 4.5e-3)
    moved = (track.position - log.position)[[0, -1], :2]
    assert np.linalg.norm(moved[1] - moved[0]) < 0.01 * 5.7
    assert not track.doubt[late].any()
    on = study.alarms_of(track, course.rate)
    assert not (on & study.settled(track.standing, course.rate))[late].any()


def test_feet_that_skid_as_they_land_are_not_on_wet_ground():
    """Friction is 0.6 to 0.8; in the first 16 ms of a stance T/N is 0.6, then below 0.1."""
    walk = data()
    stands, force = walk['truth_stance'], walk['foot_force_world'].astype(float)
    flies = np.gradient(walk['truth_foot_pos'].astype(float), 0.004, axis=0)
    velocity = np.where(stands[..., None], walk['truth_contact_vel'], flies)
    noise = np.random.default_rng(1).normal(0.0, 1e-4, velocity.shape)
    place = np.cumsum(0.004 * velocity, axis=0) + noise
    foot, load = Foot.load('large19'), 0.5 * 15.2 * 9.81
    tuning = Tuning(position_noise=1e-4, force_noise=0.3)
    model = GroundModel.of(foot, load, tuning)
    ends = []
    for leg in range(4):
        estimator = FootEstimator(foot, load, tuning, model)
        for row, time in enumerate(walk['time'].tolist()):
            now = estimator.update(time, force[row, leg], place[row, leg], 0.0)
            if row and stands[row - 1, leg] and not stands[row, leg]:
                ends.append((now.wet_probability, float(estimator.ground.quantile(0.05))))
    wet, least = np.array(ends).T
    assert len(wet) > 250
    assert (wet > 0.5).mean() < 0.1  # 0.39 if landing is taken for evidence
    assert least.max() < 0.6
