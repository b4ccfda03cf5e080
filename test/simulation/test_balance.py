# SPDX-License-Identifier: Apache-2.0
"""Gait with balance: forces beside a general solver, walks, pushes, slopes, wet ground."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import minimize

from ros_pad.simulation import Scene, compiled
from ros_pad.simulation.balance_step import FORCE, GRIP, ROWS, STANDS, Plan, State, share_out
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.terrain import Floor

mujoco = pytest.importorskip('mujoco')

from ros_pad.simulation.full_robot import FullRobot  # noqa: E402

PATCHES = Scene.load('quadruped_patches')
SCENE = dataclasses.replace(
    PATCHES,
    tow=dataclasses.replace(PATCHES.tow, weight=0.0),
    floor=dataclasses.replace(PATCHES.floor, kind='dry'),
    cycles=12,
)


def plan_of(legs, mass):
    values = dict.fromkeys(Plan._fields, 1.0) | {'legs': legs, 'joints': 3, 'mass': mass}
    return Plan(**values)


def walk(scene, seed=0, pushes=0.0, pressure=0.0):
    """Walk with a push for 0.2 s every 3 s; return the robot and a row of its body each sample."""
    robot = FullRobot(scene, scene.floor.build(seed), 0.004)
    random = np.random.default_rng(seed)
    trunk = robot.data.xfrc_applied[robot.model.body('trunk').id]
    rows = []
    for _ in range(round(scene.duration / robot.period)):
        since = (robot.time - scene.settle - 1.0) % 3.0
        if pushes and since < 0.99 * robot.period and robot.time > scene.settle + 0.9:
            angle = random.uniform(0.0, math.tau)
            force = pushes * scene.body.mass * 9.81
            trunk[:2] = force * math.cos(angle), force * math.sin(angle)
        elif since > 0.2:
            trunk[:] = 0.0
        robot.step([pressure] * len(robot.legs))
        rows.append([*robot.data.qpos[:7], (robot.contacts[:, 2] > 1.0).sum()])
        if robot.verdict:
            break
    return robot, np.array(rows)


def commanded(scene):
    return scene.gait.body_advance(scene.cycles * scene.gait.cycle)


def slip_share(robot, rows):
    way = np.hypot(*np.diff(rows[:, :2], axis=0).T) @ rows[1:, 7]
    return sum(foot.slip_path for foot in robot.feet) / way


@pytest.mark.parametrize('legs', [3, 4, 6])
def test_forces_are_those_of_a_general_solver(legs):
    """Their cost is that of SLSQP within 1 %, and no force leaves its cone."""
    random = np.random.default_rng(legs)
    for _ in range(12):
        mass = 10.0
        spread = random.normal(size=(3, 3))
        inertia = np.zeros((6, 6))
        inertia[:3, :3] = mass * np.eye(3)
        inertia[3:, 3:] = 0.1 * np.eye(3) + 0.02 * spread @ spread.T
        places = np.column_stack([random.uniform(-0.3, 0.3, (legs, 2)), np.full(legs, -0.3)])
        wrench = np.array([*random.normal(0.0, 25.0, 2), 98.1, *random.normal(0.0, 6.0, 3)])
        feet = np.zeros((ROWS, legs))
        feet[STANDS], feet[GRIP] = 1.0, random.uniform(0.1, 0.6, legs)
        turn = np.eye(3).ravel()
        table = feet.tolist()
        state = State(np.zeros(3), None, turn, inertia, None, places, *[None] * 4)
        share_out(plan_of(legs, mass), table, state, list(wrench))
        found = np.array(table)[FORCE : FORCE + 3].T
        arms = np.array([np.cross(place, np.eye(3)).T for place in places])
        matrix = np.concatenate([np.hstack([np.eye(3)] * legs), np.hstack(arms)])
        inverse = np.linalg.inv(inertia)

        def cost(forces, matrix=matrix, wrench=wrench, inverse=inverse):
            miss = matrix @ forces - wrench
            return 0.5 * miss @ inverse @ miss + 0.005 / 10.0 * forces @ forces

        cones = {
            'type': 'ineq',
            'fun': lambda f, grip=feet[GRIP]: (grip * f[2::3]) ** 2 - f[::3] ** 2 - f[1::3] ** 2,
        }
        bounds = [(None, None), (None, None), (0.0, None)] * legs
        start = np.tile([0.0, 0.0, 98.1 / legs], legs)
        best = minimize(cost, start, method='SLSQP', bounds=bounds, constraints=cones,
                        options={'maxiter': 500, 'ftol': 1e-12})  # fmt: skip
        side = np.hypot(found[:, 0], found[:, 1])
        assert (side <= feet[GRIP] * found[:, 2] * (1.0 + 1e-9) + 1e-9).all()
        # Beside the cost of no force at all, as the best one may be next to nothing.
        assert cost(found.ravel()) - best.fun < 5e-3 * cost(0.0 * start)


@pytest.mark.slow
def test_compiled_torques_are_the_same_to_the_bit(monkeypatch):
    pytest.importorskip('numba')
    floor = Floor.patches(0.4, 1.0, 3e-4, 0).uneven(0.005, 0)
    walks = []
    for fast in (False, True):
        monkeypatch.setattr(compiled, 'worth_loading', lambda *given, fast=fast: fast)
        robot, rows = FullRobot(SCENE, floor, 0.004), []
        for _ in range(600):
            robot.step([0.0] * 4)
            rows.append(robot.data.qpos.copy())
        walks.append(np.array(rows))
    assert np.array_equal(*walks)


@pytest.mark.parametrize('pushes', [0.0, 0.15])
def test_a_quadruped_walks_and_is_pushed(pushes):
    robot, rows = walk(SCENE, 3, pushes)
    assert robot.verdict is None
    assert rows[-1, 0] == pytest.approx(commanded(SCENE), rel=0.04)
    assert abs(rows[-1, 1]) < 0.06 and abs(robot.body[2]) < 0.05
    assert slip_share(robot, rows) < (0.02 if pushes else 0.01)
    if not pushes:
        walking = rows[250:]
        assert np.abs(walking[:, 4:6]).max() < 0.5 * math.radians(1.5)  # half of roll and pitch
        assert np.ptp(walking[:, 2]) < 5e-3


@pytest.mark.parametrize(
    'floor', [{'slope': 0.1745}, {'slope': -0.1745}, {'unevenness': 0.01}], ids=str
)
def test_slopes_and_uneven_ground(floor):
    scene = dataclasses.replace(SCENE, floor=dataclasses.replace(SCENE.floor, **floor))
    robot, rows = walk(scene, 5)
    assert robot.verdict is None
    # It leans into the slope before it walks.
    assert rows[-1, 0] - rows[249, 0] == pytest.approx(commanded(scene), rel=0.06)


def test_flat_feet_on_wet_ground_slip_but_do_not_fall():
    floor = dataclasses.replace(PATCHES.floor, wet_fraction=0.4, patch_length=1.0)
    robot, rows = walk(dataclasses.replace(SCENE, floor=floor), 1)
    assert robot.verdict is None and np.isfinite(rows).all()
    assert rows[-1, 0] == pytest.approx(commanded(SCENE), rel=0.05)
    assert sum(foot.slip_path for foot in robot.feet) > 0.005


def test_a_walk_that_cannot_go_on_says_so():
    """No friction at all: it falls, with a verdict and finite numbers."""
    foot = dataclasses.replace(SCENE.foot, friction=1e-3, shear_strength=0.0)
    robot, rows = walk(dataclasses.replace(SCENE, foot=foot), pushes=0.3)
    assert np.isfinite(rows).all()
    assert 'tip-over' in robot.verdict


def test_torque_and_speed_limits_hold():
    weak = dataclasses.replace(SCENE, cycles=6)
    robot = FullRobot(weak, weak.floor.build(0), 0.004)
    joints = [joint for leg in weak.body.robot.chains.legs for joint in leg]
    most, fastest = np.array([(joint.torque, joint.speed) for joint in joints]).T
    robot.data.qvel[6 : 6 + len(joints)] = 1.5 * fastest
    robot.step([0.0] * 4)
    assert (robot.data.ctrl <= 0.0).all()  # no motor drives a joint that is too fast
    for _ in range(900):
        robot.step([0.0] * 4)
        assert (np.abs(robot.data.actuator_force) <= most + 1e-9).all()


def test_feet_find_ground_by_load():
    """On uneven ground feet stand for their share of the cycle."""
    lower = dataclasses.replace(SCENE, floor=dataclasses.replace(SCENE.floor, unevenness=0.005))
    robot, rows = walk(lower, 7)
    assert robot.verdict is None
    assert isinstance(lower.gait, WalkingGait)
    assert rows[250:, 7].mean() > 4 * lower.gait.duty * 0.9
