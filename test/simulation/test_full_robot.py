# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
import re
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from ros_pad.contact import Foot
from ros_pad.errors import ConfigError
from ros_pad.simulation import Scene
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.mujoco_model import POINT, SolverSettings
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.scene import Tow
from ros_pad.simulation.terrain import Floor

mujoco = pytest.importorskip('mujoco')

SHIPPED = Scene.load('hexapod_smooth_dry_flat')
BODY, GAIT = SHIPPED.body, SHIPPED.gait
WEIGHT = 2.09 * 9.81
DEFAULTS = SolverSettings(integrator='Euler', cone='pyramidal', impratio=1.0)  # MuJoCo's
FLAT = [0.0] * 6
DRY, WET = Floor.uniform(False, 3e-4), Floor.uniform(True, 3e-4)


def scene_of(friction=None, **changes):
    """Return a scene without tow; ``friction`` gives dry feet plain Coulomb friction."""
    values = {'settle': 0.5, 'tow': Tow()} | changes
    if friction is not None:
        values['foot'] = dataclasses.replace(SHIPPED.foot, friction=friction, shear_strength=0.0)
    return dataclasses.replace(SHIPPED, **values)


def standing(friction=0.5, floor=DRY, **changes):
    """Return a robot that stands still and does not walk."""
    settings = changes.pop('settings', SolverSettings())
    robot = FullRobot(scene_of(friction, settle=100.0, **changes), floor, 0.004, settings)
    advance(robot, 0.8)
    return robot


def advance(robot, seconds, each=lambda: None, pressures=FLAT):
    for _ in range(round(seconds / robot.period)):
        robot.step(pressures)
        each()
    return robot.body


def push(robot, **wrench):
    """Push, N and N m, at the trunk's centre of mass; it is the robot's for small lean only."""
    places = {'x': 0, 'y': 1, 'z': 2, 'yaw': 5}
    trunk = robot.model.body('trunk').id
    for name, value in wrench.items():
        robot.data.xfrc_applied[trunk, places[name]] = value


def contacts(robot):
    return np.array([robot.data.geom(f'foot_{leg}').xpos[:2] for leg in robot.legs])


# --- geometry ---------------------------------------------------------------------------------


@hypothesis_settings(max_examples=30)
@given(st.lists(st.floats(-1.0, 1.0), min_size=18, max_size=18))
def test_kinematics_against_mujoco(angles):
    robot = KINEMATIC
    robot.data.qpos[:7] = (0.3, -0.2, 0.5, 1.0, 0.0, 0.0, 0.0)
    robot.data.qpos[7:25] = angles
    mujoco.mj_kinematics(robot.model, robot.data)
    assert robot.joint_positions == tuple(angles)
    places = BODY.robot.foot_positions(angles) + np.array((0.3, -0.2, 0.5))
    for index, place in enumerate(places):
        tibia = robot.model.body(f'leg_{index + 1}_tibia').id
        tip = robot.data.xpos[tibia] + robot.data.xmat[tibia].reshape(3, 3) @ [0.0, 0.0, -0.141]
        assert tip == pytest.approx(place, abs=1e-12)
    names = [robot.model.joint(j).name for j in range(1, 19)]
    assert tuple(names) == robot.joint_names


KINEMATIC = FullRobot(scene_of(), DRY, 0.004)


@pytest.mark.parametrize('level', [FullRobot, PlanarRobot])
@pytest.mark.parametrize(('name', 'value'), [('stride', 0.6), ('lift', 0.19)])
def test_a_gait_that_no_leg_reaches(level, name, value):
    """The message has the largest value that is walked; legs may bend back when they step up."""

    def built(value):
        return level(scene_of(gait=dataclasses.replace(GAIT, **{name: value})), DRY, 0.004)

    with pytest.raises(ConfigError) as caught:
        built(value)
    text = str(caught.value)
    assert f'gait.{name} = {value} m is not allowed' in text
    assert (
        text.startswith('hexapod_smooth_dry_flat: ')
        and 'legs of ch3r from its home: feet ' in text
    )
    most = float(re.search('at most ([0-9.]+) m', text)[1])
    built(0.99 * most)
    with pytest.raises(ConfigError):
        built(1.03 * most)


def test_missing_mujoco_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(ConfigError, match=r'ros_pad\[mujoco\]'):
        FullRobot(scene_of(), DRY, 0.004)


# --- statics ----------------------------------------------------------------------------------


def test_masses():
    """Mass, height of the centre of mass and inertia about the vertical are those of the scene."""
    robot = FullRobot(scene_of(), DRY, 0.004)
    robot.data.qpos[7:25] = 0.0
    mujoco.mj_forward(robot.model, robot.data)
    assert robot.model.body_subtreemass[1:].max() == pytest.approx(2.09, rel=1e-12)
    assert robot.data.subtree_com[robot.model.body('trunk').id] == pytest.approx(
        [0.0, 0.0, 0.12], abs=1e-9
    )
    yaw = 0.0
    for body in range(1, robot.model.nbody):
        turn = robot.data.ximat[body].reshape(3, 3)
        own = turn @ np.diag(robot.model.body_inertia[body]) @ turn.T
        x, y, _ = robot.data.xipos[body]
        yaw += own[2, 2] + robot.model.body_mass[body] * (x * x + y * y)
    # The links have a small thickness, for which the trunk's inertia is not corrected.
    assert yaw == pytest.approx(0.03, rel=1e-3)
    assert not robot.model.dof_damping[:6].any()
    assert not robot.model.dof_armature[:6].any()


def test_loads_at_rest():
    """Six feet carry the weight, and their moments about the centre of mass are balanced."""
    robot = standing()
    loads = np.array([foot.force[2] for foot in robot.feet])
    places = contacts(robot)
    assert loads.sum() == pytest.approx(WEIGHT, rel=1e-4)
    centre = robot.data.subtree_com[robot.model.body('trunk').id][:2]
    assert loads @ (places - centre) == pytest.approx([0.0, 0.0], abs=2e-3)
    assert all(foot.standing and foot.slip_speed == 0.0 for foot in robot.feet)
    assert robot.verdict is None


def test_slope():
    """On a slope of 0.1 rad tangential forces add up to W sin, normal forces to W cos."""
    floor = dataclasses.replace(SHIPPED.floor, slope=0.1)
    robot = FullRobot(dataclasses.replace(scene_of(0.5, settle=100.0), floor=floor), DRY, 0.004)
    advance(robot, 1.0)
    force = np.sum([foot.force for foot in robot.feet], axis=0)
    assert force == pytest.approx([WEIGHT * math.sin(0.1), 0.0, WEIGHT * math.cos(0.1)], abs=0.01)


# --- friction ---------------------------------------------------------------------------------


def creep_of(share, axis, settings):
    robot = standing(0.5, settings=settings)
    push(robot, **{axis: share * 0.5 * WEIGHT})
    advance(robot, 1.0)
    before = contacts(robot)
    advance(robot, 0.5)
    pull = np.sum([foot.force for foot in robot.feet], axis=0)
    assert pull[0 if axis == 'x' else 1] == pytest.approx(-share * 0.5 * WEIGHT, rel=1e-2) or (
        share > 1.0 or settings == DEFAULTS
    )
    return np.linalg.norm(contacts(robot) - before, axis=1).max() / 0.5


@pytest.mark.parametrize('axis', ['x', 'y'])
def test_creep_at_most_of_the_friction_limit(axis):
    """At 0.8 of μ W feet creep at less than 0.1 mm/s; with MuJoCo's defaults at over 10 mm/s."""
    assert creep_of(0.8, axis, SolverSettings()) < 1e-4
    assert creep_of(0.8, axis, DEFAULTS) > 1e-2


def test_friction_limit():
    """Under a push of 0.95 μ W the robot stays, under 1.05 μ W it slides."""
    assert creep_of(0.95, 'y', SolverSettings()) < 2e-4
    assert creep_of(1.05, 'y', SolverSettings()) > 0.1


def test_sliding_and_turning_feet_are_on_the_ellipsoid():
    """Force and moment of a slipping foot are on the limit surface √(T² + (M/(2/3 R))²) = μ N."""
    robot = FullRobot(scene_of(0.5, cycles=3), DRY, 0.004)
    used = []

    def note():
        for foot in robot.feet:
            if foot.force[2] > 2.0:
                lever = 2.0 / 3.0 * SHIPPED.foot.sole_radius
                combined = math.hypot(*foot.force[:2], foot.moment / lever)
                used.append((combined / foot.grip, foot.slip_speed))

    advance(robot, 3.0, note)
    shares, speeds = np.array(used).T
    assert shares.max() < 1.03
    assert np.median(shares[speeds > 0.02]) == pytest.approx(1.0, abs=0.02)
    assert shares[speeds < 1e-3].min() < 0.5


@pytest.mark.parametrize('axis', ['x', 'y'])
def test_work_lost_is_friction_times_way(axis):
    robot = standing(0.1)
    push(robot, **{axis: 1.3 * 0.1 * WEIGHT})
    advance(robot, 0.3)
    ways = [foot.slip_path for foot in robot.feet]
    assert min(ways) > 5e-3
    # Loads change as the body leans, but not their sum.
    assert robot.dissipation == pytest.approx(0.1 * WEIGHT * np.mean(ways), rel=0.05)


def test_grip_is_the_cone_of_the_step():
    robot = FullRobot(scene_of(tow=SHIPPED.tow), WET, 0.004)
    slipped = 0

    def check():
        nonlocal slipped
        for foot in robot.feet:
            pull = math.hypot(*foot.force[:2])
            assert pull <= foot.grip * (1.0 + 1e-3) + 1e-3
            if foot.slip_speed > 0.05:
                slipped += 1
        for foot in robot.feet:
            assert foot.standing == (foot.force[2] > 0.0)
            assert foot.force[2] >= 0.0

    advance(robot, 2.5, check)
    assert slipped > 50


def test_pressures_reach_the_feet():
    """On wet ground domes hold and flat feet float; at 60 kPa 37 pads are overloaded."""
    grips, overloads = {}, {}
    for pressure in (0.0, 60e3, 75e3):
        robot = FullRobot(scene_of(), WET, 0.004)
        advance(robot, 0.5 + 0.3, pressures=[pressure] * 6)
        foot = robot.feet[0]
        grips[pressure] = foot.grip / foot.force[2]
        overloads[pressure] = foot.overload_time
    assert grips[0.0] == pytest.approx(0.12, rel=1e-3)
    assert grips[0.0] < 0.8 * grips[60e3] < 0.8 * grips[75e3]
    assert overloads[0.0] == 0.0 and overloads[60e3] > 0.1 > overloads[75e3]


def test_film_is_whole_again_after_each_swing():
    """The film drains while a foot stands, and is thick again at the next touch-down."""
    robot = FullRobot(scene_of(), WET, 0.004)
    advance(robot, 0.5 + GAIT.cycle, pressures=[70e3] * 6)
    ratios = []

    def note():
        foot = robot.feet[0]
        if foot.standing:
            ratios.append(foot.grip / foot.force[2])

    advance(robot, GAIT.cycle, note, [70e3] * 6)
    assert min(ratios) < 0.25 < 0.34 < max(ratios)
    assert np.count_nonzero(np.diff(ratios) < -0.1) == 1


# --- walking ----------------------------------------------------------------------------------


def test_dry_walk_against_the_planar_robot():
    """With 2.5 times the friction that the gait needs, both levels agree to 2 %."""
    scene = dataclasses.replace(SHIPPED, settle=0.5)
    full, flat = FullRobot(scene, DRY, 0.004), PlanarRobot(scene, DRY, 0.004)
    for robot in (full, flat):
        advance(robot, 0.5 + 5.0)
    assert full.body[0] == pytest.approx(flat.body[0], rel=0.02)
    assert abs(full.body[1]) < 5e-3 and abs(full.body[2]) < math.radians(0.3)
    assert full.verdict is None
    # Feet scuff a few millimetres a cycle at touch-down; feet of the planar robot do not.
    assert all(1e-3 < foot.slip_path / 5.0 < 8e-3 for foot in full.feet)
    left, right = full.feet[:3], full.feet[:2:-1]
    for one, other in zip(left, right, strict=True):
        assert one.slip_path == pytest.approx(other.slip_path, rel=0.1)


def test_tow():
    """Work of the line on the sled is lost in friction: ∫ T dx = 12 N · 0.2 · distance.

    In the mean over cycles the feet push as hard as the line pulls.
    """
    tow = Tow(weight=12.0, friction_dry=0.2, friction_wet=0.0, distance=0.4, height=0.03)
    robot = FullRobot(scene_of(0.8, tow=tow), DRY, 0.002)
    advance(robot, 0.5 + 1.0)
    rows = []

    def note():
        hook, sled = (robot.data.site(name).xpos[0] for name in ('hook', 'sled'))
        rows.append((hook, sled, sum(foot.force[0] for foot in robot.feet)))

    advance(robot, 4.0, note)
    hook, sled, push = np.array(rows).T
    tension = 2000.0 * np.maximum(0.0, hook - sled - 0.4)
    work = np.sum(0.5 * (tension[1:] + tension[:-1]) * np.diff(sled))
    assert work == pytest.approx(12.0 * 0.2 * (sled[-1] - sled[0]), rel=0.02)
    assert push.mean() == pytest.approx(tension.mean(), rel=0.05)
    assert sled[-1] - sled[0] == pytest.approx(4 * GAIT.stride, rel=0.05)


# --- verdicts ---------------------------------------------------------------------------------


def test_tip_over():
    robot = standing(2.0)
    trunk = robot.model.body('trunk').id
    robot.data.xfrc_applied[trunk, 3] = 8.0
    advance(robot, 1.0)
    assert 'tip-over' in robot.verdict or 'servo' in robot.verdict
    robot = standing(2.0)
    robot.data.qpos[2] += 0.1  # no foot in the ground
    robot.data.qpos[3:7] = (math.cos(0.3), math.sin(0.3), 0.0, 0.0)
    robot.step(FLAT)
    assert 'tip-over' in robot.verdict and 'at 0.804 s' in robot.verdict


def test_servos_that_are_too_weak():
    """With 15 kg on six femurs of 57 mm each servo would need 1.4 N m, more than its 0.94 N m."""
    robot = FullRobot(scene_of(body=dataclasses.replace(BODY, mass=15.0, inertia=0.3)), DRY, 0.004)
    advance(robot, 1.0)
    assert robot.verdict.startswith('servo leg_')


def test_lost_solution(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a file of warnings to the working folder
    robot = standing()
    push(robot, x=1e30)
    advance(robot, 0.1)
    assert 'the solution of MuJoCo has diverged' in robot.verdict


@pytest.mark.parametrize(('lift', 'unevenness', 'clears'), [
    (0.03, 5e-4, True), (0.006, 0.0, True), (0.003, 0.0, False), (0.006, 5e-4, False),
])  # fmt: skip
def test_a_foot_that_does_not_clear_the_ground_ends_the_walk(lift, unevenness, clears):
    """Film and ground height of such a foot would stay those of its last step."""
    scene = Scene.load('hexapod_rough_wet_flat')
    scene = dataclasses.replace(
        scene,
        cycles=3,
        gait=dataclasses.replace(scene.gait, lift=lift),
        floor=dataclasses.replace(scene.floor, unevenness=unevenness),
    )
    robot = FullRobot(scene, scene.floor.build(0), 0.004)
    while robot.verdict is None and robot.time < scene.duration:
        robot.step([0.0] * 6)
    assert (robot.verdict is None) == clears
    assert clears or 'does not clear the ground in its swing' in robot.verdict


# --- sensors on the robot ---------------------------------------------------------------------


def walked(seconds=2.5):
    """Yield the state of a walk after each sample: time, what sensors show, and the robot."""
    robot = FullRobot(scene_of(), DRY, 0.004)
    for _ in range(round(seconds * 250)):
        robot.step(FLAT)
        yield robot.time, robot.proprioception(), robot


def test_gyro_and_accelerometer_integrate_to_the_motion():
    rows = [
        (*felt.gyro, *felt.accelerometer, *robot.data.qvel[:3], *robot.data.qpos[3:7])
        for _, felt, robot in walked()
    ]
    rows = np.array(rows)
    turns = np.empty((len(rows), 9))
    for turn, state in zip(turns, rows, strict=True):
        mujoco.mju_quat2Mat(turn, state[9:])
    turns = turns.reshape(-1, 3, 3)
    pulls = np.einsum('nij,nj->ni', turns, rows[:, 3:6]) - [0.0, 0.0, 9.81]
    change = 0.004 * np.cumsum(pulls[250:], axis=0)
    assert np.abs(change - (rows[250:, 6:9] - rows[249, 6:9])).max() < 1e-9
    assert np.ptp(rows[250:, 6]) > 0.15  # the walk is not trivial
    angles = np.unwrap(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    assert 0.004 * rows[:, 2].sum() == pytest.approx(angles[-1], abs=2e-3)


def rises(scene, timestep):
    """Return the times in which feet on domes take 10 to 90 % of their first peak, s."""
    robot = FullRobot(scene, WET, 0.004, SolverSettings(timestep=timestep))
    loads, rub = [], robot.soles.rub
    robot.soles.rub = lambda: (loads.append(robot.soles._loads.copy()), rub())
    advance(robot, scene.duration, pressures=[75e3] * len(scene.legs))
    found, timestep = [], robot.model.opt.timestep
    for load in np.array(loads).T:
        ends = np.flatnonzero((load[:-1] <= 0.0) & (load[1:] > 0.0))
        for end in ends[np.diff(np.append(-1.0, ends)) * timestep > 0.05]:
            own = load[end : end + round(0.03 / timestep)]
            falls = (own[1:-1] > own[2:]) & (own[1:-1] > 1.0)  # N
            if not falls.any():
                continue
            peak = 1 + int(falls.argmax())
            at = np.interp([0.1 * own[peak], 0.9 * own[peak]], own[: peak + 1],
                           timestep * np.arange(peak + 1))  # fmt: skip
            found.append(at[1] - at[0])
    return found


@pytest.mark.parametrize(
    ('name', 'cycles', 'step', 'off'),
    [('hexapod_smooth_wet_dome', 3, 1e-3, 0.1), ('quadruped_patches', 12, 5e-4, 0.15)],
)
def test_landings_do_not_hang_on_the_step(name, cycles, step, off):
    scene = dataclasses.replace(Scene.load(name), cycles=cycles)
    usual, fine = rises(scene, None), rises(scene, 0.2 * step)
    assert FullRobot(scene, WET, 0.004).model.opt.timestep == step
    assert len(usual) > 10 and len(fine) > 10
    assert np.median(usual) == pytest.approx(np.median(fine), rel=off)
    assert 2e-3 < np.median(fine) < 10e-3


def test_the_step_is_short_enough_for_stiff_soles_of_light_legs():
    """A sole of 51 mm has 350.2 kN/m; in steps much longer than 1/ω feet bounce up."""
    robot = FullRobot(scene_of(foot=Foot.load('large331')), DRY, 0.004)
    leg = robot.model.geom('foot_1').bodyid[0]
    swing = 1.0 / math.sqrt(350.2e3 * robot.model.body_invweight0[leg, 0])
    assert 0.5 * swing < robot.model.opt.timestep <= swing < 0.9e-3


def test_feet_whose_domes_carry_nothing_stand_on_their_soles():
    """By the measured line a dome of 45 kPa carries nothing; a sole of 17 mm has 38.9 kN/m."""
    foot = dataclasses.replace(SHIPPED.foot, ceiling=45e3)
    robot = FullRobot(scene_of(foot=foot), WET, 0.004)
    advance(robot, 0.49, pressures=[45e3] * 6)
    tips = [robot.model.geom(f'foot_{leg}').id for leg in range(1, 7)]
    depths = POINT - robot.data.geom_xpos[tips, 2]
    assert depths * 38.9e3 == pytest.approx(robot.contacts[:, 2], rel=5e-3)


def test_a_foot_is_the_spring_of_its_domes():
    """Standing on domes of 75 kPa it sinks by its load over 7.29 kN/m."""
    robot = FullRobot(scene_of(), DRY, 0.004)
    advance(robot, 0.49, pressures=[75e3] * 6)
    depths = (
        POINT - robot.data.geom_xpos[[robot.model.geom(f'foot_{i}').id for i in range(1, 7)], 2]
    )
    assert depths * 7.29e3 == pytest.approx(robot.contacts[:, 2], rel=5e-3)
    assert robot.contacts[:, 2].sum() == pytest.approx(WEIGHT, rel=0.01)
