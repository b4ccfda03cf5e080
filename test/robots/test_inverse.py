# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of single legs and of all of them, against forward kinematics."""

import dataclasses
import math
import pathlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.errors import InvalidInput
from ros_pad.robots import Robot
from ros_pad.robots.chains import Chains, Joint
from ros_pad.robots.inverse import FeetSolver, LegSolver
from ros_pad.robots.rotation import rotation, transform

URDF = pathlib.Path(__file__).resolve().parent.parent / 'reference' / 'robot.urdf'
ANGLES = st.floats(-3.0, 3.0)
VECTORS = st.tuples(ANGLES, ANGLES, ANGLES)
AXES = VECTORS.filter(lambda vector: np.linalg.norm(vector) > 0.1)
LENGTHS = st.floats(0.03, 0.3)


def leg_of(turns, hip, thigh, lengths, side):
    """Return joints and foot of a leg: hip and thigh axes anyhow, the knee parallel to the thigh.

    ``turns`` are rotation vectors between the frames.
    """
    a, b, c = (rotation(turn) for turn in turns)
    hip, thigh = hip / np.linalg.norm(hip), thigh / np.linalg.norm(thigh)
    parallel = c.T @ thigh  # the axis of the thigh in the frame of the knee
    across = np.cross(thigh, [0.3, 0.5, 0.8]) + 1e-3
    end = np.cross(parallel, [0.7, -0.2, 0.4]) + 1e-3
    joints = [
        Joint('hip', transform((0.1, -0.2, 0.05), a), hip, False, 1.0, np.zeros(3)),
        Joint('thigh', transform((0.0, side, 0.02), b), thigh, False, 1.0, np.zeros(3)),
        Joint('knee', transform(lengths[0] * across, c), parallel, False, 1.0, np.zeros(3)),
    ]
    return joints, transform(lengths[1] * end, np.eye(3))


@settings(deadline=None)
@given(
    st.tuples(VECTORS, VECTORS, VECTORS),
    *(AXES, AXES, st.tuples(LENGTHS, LENGTHS), st.floats(-0.1, 0.1)),
    *(VECTORS, st.tuples(*3 * [st.floats(-0.3, 0.3)])),
)
def test_any_leg_with_two_parallel_joints(turns, hip, thigh, lengths, side, home, moved):
    joints, foot = leg_of(turns, np.array(hip), np.array(thigh), lengths, side)
    if not LegSolver.fits(joints, foot):
        return  # the hip is parallel, too, or a link has no length
    chains = Chains([joints], foot[None])
    angles = np.add(home, moved)
    place = chains.solve(angles[None]).positions[0]

    def reached(found):
        return chains.solve(np.array([found])).positions[0]

    there, near = LegSolver(joints, foot, angles), LegSolver(joints, foot, home)
    assert reached(there.angles(*place.tolist())) == pytest.approx(place, abs=1e-6)
    try:
        found = near.angles(*place.tolist())
    except InvalidInput as error:
        assert 'with the hip on the side of home' in str(error)
        assert near._hip != there._hip
    else:
        assert reached(found) == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize('name', ['ch3r', 'go2'])
def test_near_home_the_angles_are_those_that_made_the_place(name):
    robot = Robot.load(name)
    solver, generator = FeetSolver(robot), np.random.default_rng(0)
    for _ in range(200):
        q = robot.home + generator.uniform(-0.25, 0.25, robot.home.shape)
        found = solver.angles(robot.foot_positions(q).tolist())
        assert found == pytest.approx(q.ravel(), abs=1e-12)


@pytest.mark.parametrize('turns', [0.0, 1.0, -2.0])
@pytest.mark.parametrize('moved', [-0.3, 0.3])
def test_angles_do_not_leap_by_a_turn_where_home_is_half_a_turn_off(turns, moved):
    robot = Robot.load('ch3r')
    joints, foot = robot.chains.legs[1], robot.chains.feet[1]
    home = np.array([0.1, 0.2 + math.tau * turns - math.pi, 0.7])
    # The thigh is zero when it points inwards.
    back = transform(
        joints[1].at[:3, 3], joints[1].at[:3, :3] @ rotation(math.pi * joints[1].axis)
    )
    joints = [joints[0], dataclasses.replace(joints[1], at=back), joints[2]]
    leg = LegSolver(joints, foot, home.tolist())
    angles = home + moved
    place = Chains([joints], foot[None]).solve(angles[None]).positions[0]
    assert leg.angles(*place.tolist()) == pytest.approx(angles, abs=1e-9)


def test_out_of_reach():
    """Links of 57 and 141 mm behind a coxa of 29 mm."""
    robot = Robot.load('ch3r')
    leg = LegSolver(robot.chains.legs[1], robot.chains.feet[1], robot.home[1].tolist())
    x, y, z = robot.hips[1].tolist()
    longest = leg.angles(x, y + 0.029 + 0.198 - 1e-9, z)
    assert longest == pytest.approx((0.0, 0.0, math.pi / 2), abs=1e-3)
    for out in (0.029 + 0.199, 0.029 + 0.083):
        with pytest.raises(InvalidInput, match=r'out of reach: 0\.084 to 0\.198 m'):
            leg.angles(x, y + out, z)
    places = robot.foot_positions(robot.home)
    places[4] += 1.0
    with pytest.raises(InvalidInput, match=r'leg 5: .* out of reach'):
        FeetSolver(robot).angles(places.tolist())


def test_other_legs_take_newtons_method():
    robot = Robot.load(URDF, feet=['a_foot', 'b_foot', 'c_foot'])
    legs = zip(robot.chains.legs, robot.chains.feet, strict=True)
    assert not all(LegSolver.fits(*leg) for leg in legs)
    q = robot.home + 0.2
    found = np.array(FeetSolver(robot).angles(robot.foot_positions(q).tolist()))
    assert robot.foot_positions(found) == pytest.approx(robot.foot_positions(q), abs=1e-8)
