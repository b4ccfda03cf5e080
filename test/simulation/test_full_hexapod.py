# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math
import sys

import numpy as np
import pytest
from hypothesis import example
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation.full_hexapod import BEARINGS
from ros_pad.simulation.full_hexapod import DEFAULTS
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.full_hexapod import Leg
from ros_pad.simulation.full_hexapod import Settings
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.scene import Tow
from ros_pad.simulation.terrain import Floor

mujoco = pytest.importorskip('mujoco')

SHIPPED = Scene.load('hexapod_smooth_dry_flat')
BODY, GAIT = SHIPPED.body, SHIPPED.gait
WEIGHT = 2.09 * 9.81
FLAT = [0.0] * 6
DRY, WET = Floor.uniform(False, 3e-4), Floor.uniform(True, 3e-4)


def scene_of(friction=None, **changes):
    """Return a scene; ``friction`` makes dry feet plain Coulomb ones."""
    values = {'settle': 0.5, 'tow': Tow()} | changes
    if friction is not None:
        values['foot'] = dataclasses.replace(SHIPPED.foot, friction=friction, shear_strength=0.0)
    return dataclasses.replace(SHIPPED, **values)


def standing(friction=0.5, floor=DRY, **changes):
    """Return a robot that has come to rest and will not walk."""
    settings = changes.pop('settings', Settings())
    robot = FullHexapod(scene_of(friction, settle=100.0, **changes), floor, 0.004, settings)
    advance(robot, 0.8)
    return robot


def advance(robot, seconds, each=lambda: None, pressures=FLAT):
    for _ in range(round(seconds / robot.period)):
        robot.step(pressures)
        each()
    return robot.body


def push(robot, **wrench):
    """Push at the trunk's centre of mass, which is not that of the robot: for small lean only."""
    places = {'x': 0, 'y': 1, 'z': 2, 'yaw': 5}
    trunk = robot.model.body('trunk').id
    for name, value in wrench.items():
        robot.data.xfrc_applied[trunk, places[name]] = value


def contacts(robot):
    return np.array([robot.data.geom(f'foot_{leg}').xpos[:2] for leg in robot.legs])


# --- geometry ---------------------------------------------------------------------------------


def test_home_of_the_ch3_r():
    """Hips at (119, 69) and (0, 138) mm, links of 29, 57 and 141 mm, femur level."""
    leg = Leg(0.119, 0.069, math.radians(30.0), 0.029, 0.057, 0.141)
    assert leg.foot(0.0, 0.0, 0.0) == pytest.approx((0.1935, 0.112, -0.141), abs=1e-4)
    for home, bearing, hip in zip(
        BODY.homes,
        BEARINGS,
        [(0.119, 0.069), (0, 0.138), (-0.119, 0.069), (-0.119, -0.069), (0, -0.138),
         (0.119, -0.069)],
        strict=True,
    ):  # fmt: skip
        found = Leg.standing_at(home, bearing, BODY)
        assert (found.hip_x, found.hip_y) == pytest.approx(hip, abs=6e-4)


@given(
    st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(-1.5, 1.5), st.integers(0, 5),
    st.floats(0.01, 0.1), st.floats(0.02, 0.2), st.floats(0.02, 0.2),
)  # fmt: skip
@example(0.0, -1.0, -1.5, 0, 0.0625, 0.03125, 0.0625)  # behind the femur's axis and above it
def test_inverse_kinematics_inverts(turn, lift, bend, which, coxa, femur, tibia):
    leg = Leg(0.1, -0.2, BEARINGS[which], coxa, femur, tibia)
    if femur * math.cos(lift) + tibia * math.sin(lift + bend) < -0.9 * coxa:
        return  # the foot is under the hip's axis or beyond: another turn reaches it
    angles = leg.angles(*leg.foot(turn, lift, bend))
    assert leg.foot(*angles) == pytest.approx(leg.foot(turn, lift, bend), abs=1e-9)
    assert angles == pytest.approx((turn, lift, bend), abs=1e-4)


@hypothesis_settings(max_examples=30)
@given(st.lists(st.floats(-1.0, 1.0), min_size=18, max_size=18))
def test_kinematics_against_mujoco(angles):
    robot = KINEMATIC
    robot.data.qpos[:7] = (0.3, -0.2, 0.5, 1.0, 0.0, 0.0, 0.0)
    robot.data.qpos[7:25] = angles
    mujoco.mj_kinematics(robot.model, robot.data)
    assert robot.joint_positions == tuple(angles)
    for index, (home, bearing) in enumerate(zip(BODY.homes, BEARINGS, strict=True)):
        x, y, z = Leg.standing_at(home, bearing, BODY).foot(*angles[3 * index : 3 * index + 3])
        tibia = robot.model.body(f'leg_{index + 1}_tibia').id
        tip = robot.data.xpos[tibia] + robot.data.xmat[tibia].reshape(3, 3) @ [0.0, 0.0, -0.141]
        assert tip == pytest.approx([x + 0.3, y - 0.2, z + 0.5], abs=1e-12)
    names = [robot.model.joint(j).name for j in range(1, 19)]
    assert tuple(names) == robot.joint_names


KINEMATIC = FullHexapod(scene_of(), DRY, 0.004)


def test_out_of_reach():
    leg = Leg(0.0, 0.0, 0.0, 0.03, 0.057, 0.141)
    assert leg.angles(0.03 + 0.198 - 1e-9, 0.0, 0.0)[2] == pytest.approx(math.pi / 2, abs=1e-3)
    for x in (0.03 + 0.199, 0.03 + 0.083):
        with pytest.raises(InvalidInput, match=r'out of reach: 0\.084 to 0\.198 m'):
            leg.angles(x, 0.0, 0.0)


@pytest.mark.parametrize(
    'part, message',
    [
        ({'gait': dataclasses.replace(GAIT, stride=0.6)}, 'leg 1 .*(reach|must turn)'),
        ({'gait': dataclasses.replace(GAIT, lift=0.19)}, 'leg 1 .*(reach|must turn)'),
        ({'body': dataclasses.replace(BODY, femur=0.5)}, 'hip'),
        ({'body': dataclasses.replace(BODY, inertia=0.01)}, 'inertia = 0.01 kg m2'),
    ],
)
def test_scene_that_legs_cannot_walk(part, message):
    with pytest.raises(ConfigError, match=message):
        FullHexapod(scene_of(**part), DRY, 0.004)


def test_missing_mujoco_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(ConfigError, match=r'ros_pad\[mujoco\]'):
        FullHexapod(scene_of(), DRY, 0.004)


@pytest.mark.parametrize(
    'wrong',
    [{'timestep': 0.0}, {'timestep': 0.02}, {'integrator': 'RK4'}, {'cone': 'round'},
     {'impratio': 0.5}, {'impratio': math.nan}, {'noslip_iterations': -1},
     {'noslip_iterations': 1.5}],
)  # fmt: skip
def test_wrong_settings(wrong):
    with pytest.raises(InvalidInput, match=next(iter(wrong))):
        Settings(**wrong)


# --- statics ----------------------------------------------------------------------------------


def test_masses():
    """Mass, height of the centre of mass and inertia about the vertical are those of the scene."""
    robot = FullHexapod(scene_of(), DRY, 0.004)
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
    # The rods are not quite without thickness, which the trunk does not know.
    assert yaw == pytest.approx(0.03, rel=1e-3)
    assert not robot.model.dof_damping[:6].any()
    assert not robot.model.dof_armature[:6].any()


def test_loads_at_rest():
    """Six feet carry the weight, and about its centre no moment is left."""
    robot = standing()
    loads = np.array([foot.force[2] for foot in robot.feet])
    places = contacts(robot)
    assert loads.sum() == pytest.approx(WEIGHT, rel=1e-4)
    centre = robot.data.subtree_com[robot.model.body('trunk').id][:2]
    assert loads @ (places - centre) == pytest.approx([0.0, 0.0], abs=2e-3)
    assert all(foot.standing and foot.slip_speed == 0.0 for foot in robot.feet)
    assert robot.verdict is None


def test_loads_of_three_feet():
    """On a tripod the loads follow from balance alone."""
    robot = FullHexapod(scene_of(0.8, gait=dataclasses.replace(GAIT, cycle=20.0)), DRY, 0.004)
    advance(robot, 0.5 + 5.0)
    places = np.array([foot.position for foot in robot.feet])[[0, 2, 4]]
    centre = robot.data.subtree_com[robot.model.body('trunk').id]
    balance = np.vstack([np.ones(3), places[:, 0], places[:, 1]])
    wanted = np.linalg.solve(balance, WEIGHT * np.array([1.0, centre[0], centre[1]]))
    found = [foot.force[2] for foot in robot.feet]
    assert found[1::2] == [0.0, 0.0, 0.0]
    # Horizontal forces of feet that fight have no moment: they all act on the floor's plane.
    assert found[0::2] == pytest.approx(wanted, abs=0.15)


def test_slope():
    """On a rise of 0.1 rad the feet hold W sin and carry W cos."""
    floor = dataclasses.replace(SHIPPED.floor, slope=0.1)
    robot = FullHexapod(dataclasses.replace(scene_of(0.5, settle=100.0), floor=floor), DRY, 0.004)
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
    """At 0.8 of μ W feet creep by less than 0.1 mm/s; by MuJoCo's defaults over 100 times that."""
    assert creep_of(0.8, axis, Settings()) < 1e-4
    assert creep_of(0.8, axis, DEFAULTS) > 1e-2


def test_creep_goes_with_impratio_not_with_the_step():
    slow = creep_of(0.8, 'y', Settings(timestep=1e-3))
    assert slow == pytest.approx(creep_of(0.8, 'y', Settings(timestep=2e-3)), rel=0.1)
    softer = creep_of(0.8, 'y', Settings(impratio=20.0))
    assert softer == pytest.approx(5.0 * slow, rel=0.3)


def test_friction_limit():
    """Pushed with 0.95 μ W it stays, with 1.05 μ W it goes."""
    assert creep_of(0.95, 'y', Settings()) < 2e-4
    assert creep_of(1.05, 'y', Settings()) > 0.1


def test_torsional_limit():
    """With slippery but for torsion, six soles hold a moment of 2/3 R μ W = 0.116 N m."""
    limit = 2.0 / 3.0 * 0.017 * 0.5 * WEIGHT
    for share in (0.9, 1.1):
        robot = standing(0.5)
        for leg in robot.legs:
            robot.model.pair(f'foot_{leg}').friction[:2] = 1e-5
        # A trunk on slippery feet is held by its servos, a turn of the whole by the soles alone.
        push(robot, yaw=share * limit)
        mujoco.mj_step(robot.model, robot.data, 500)
        assert (abs(robot.data.qvel[5]) > 0.2) == (share > 1.0)


def test_moments_of_the_feet_hold_a_robot_that_is_turned():
    """Soles that are slippery but for torsion hold what turns them, each with its share."""
    torque = 0.5 * 2.0 / 3.0 * 0.017 * 0.5 * WEIGHT
    robot = standing(0.5)
    for leg in robot.legs:
        robot.model.pair(f'foot_{leg}').friction[:2] = 1e-5
    push(robot, yaw=torque)
    moments = []
    for _ in range(200):  # it sways on its servos
        mujoco.mj_step(robot.model, robot.data, 20)
        robot._read_contacts()
        robot._report(FLAT)
        moments.append([foot.moment for foot in robot.feet])
    shares = np.mean(moments, axis=0) / -torque
    assert shares.sum() == pytest.approx(1.0, abs=0.05)
    assert shares.min() > 0.05


def test_sliding_and_turning_feet_are_on_the_ellipsoid():
    """T and M of a foot that slips fill the limit surface, √(T² + (M/(2/3 R))²) = μ N."""
    robot = FullHexapod(scene_of(0.5, cycles=3), DRY, 0.004)
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


def test_light_feet_do_not_slip():
    """Up to 1 N a contact counts as one that has not landed, however far it is dragged."""
    robot = standing()
    for load, way in ((1.0, 0.0), (1.01, 5e-3)):
        before = robot.feet[0].slip_path
        x, y, z = robot._last[0]
        robot._last[0] = [x - 3e-3, y + 4e-3, z]
        robot._loads[0] = load
        robot._report(FLAT)
        assert robot.feet[0].slip_path - before == pytest.approx(way, rel=1e-9)


@pytest.mark.parametrize('axis', ['x', 'y'])
def test_work_lost_is_friction_times_way(axis):
    robot = standing(0.1)
    push(robot, **{axis: 1.3 * 0.1 * WEIGHT})
    advance(robot, 0.3)
    ways = [foot.slip_path for foot in robot.feet]
    assert min(ways) > 5e-3
    # Loads shift as the body leans, their sum does not.
    assert robot.dissipation == pytest.approx(0.1 * WEIGHT * np.mean(ways), rel=0.05)


def test_work_lost_in_turning_is_moment_times_angle():
    """Slippery but for torsion, six soles that turn on the spot lose 2/3 R μ W times the angle."""
    limit = 2.0 / 3.0 * 0.017 * 0.5 * WEIGHT
    robot = standing(0.5)
    for leg in robot.legs:
        robot.model.pair(f'foot_{leg}').friction[:2] = 1e-5
    push(robot, yaw=1.3 * limit)
    before, lost = robot.body[2], robot.dissipation
    for _ in range(200):
        mujoco.mj_step(robot.model, robot.data, 2)  # as in a step, but with friction as it is
        robot._read_contacts()
        robot._report(FLAT)
    turned = robot.body[2] - before
    assert turned > 0.1
    assert robot.dissipation - lost == pytest.approx(limit * turned, rel=0.05)


def test_work_lost_is_what_the_contacts_of_mujoco_lose():
    """On a dry walk, mostly in torsion: feet turn with their legs."""
    robot = FullHexapod(scene_of(0.5), DRY, 0.002)  # one step of MuJoCo in each
    slid = turned = 0.0

    def note():
        nonlocal slid, turned
        data = robot.data
        for geoms, row in zip(data.contact.geom, data.contact.efc_address, strict=True):
            if robot._index.get(geoms[1]) is not None:
                power = data.efc_force[row : row + 4] * data.efc_vel[row : row + 4]
                slid -= power[1:3].sum() * robot.period
                turned -= power[3] * robot.period

    advance(robot, 0.5 + 2.0, note)
    assert turned > slid > 0.05
    # Creep and feet that have not landed do not count: see SLIP_SPEED and SLIP_LOAD.
    assert robot.dissipation == pytest.approx(slid + turned, rel=0.005)


def test_grip_is_the_cone_of_the_step():
    robot = FullHexapod(scene_of(tow=SHIPPED.tow), WET, 0.004)
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
    """On wet ground domes hold and flat feet float; 60 kPa is past the limit of 37 pads."""
    grips, overloads = {}, {}
    for pressure in (0.0, 60e3, 75e3):
        robot = FullHexapod(scene_of(), WET, 0.004)
        advance(robot, 0.5 + 0.3, pressures=[pressure] * 6)
        foot = robot.feet[0]
        grips[pressure] = foot.grip / foot.force[2]
        overloads[pressure] = foot.overload_time
    assert grips[0.0] == pytest.approx(0.12, rel=1e-3)
    assert grips[0.0] < 0.8 * grips[60e3] < 0.8 * grips[75e3]
    assert overloads[0.0] == 0.0 and overloads[60e3] > 0.1 > overloads[75e3]


def test_film_is_whole_again_after_each_swing():
    """A standing foot drains; the friction of a foot that lands on wet ground starts over."""
    robot = FullHexapod(scene_of(), WET, 0.004)
    advance(robot, 0.5 + GAIT.cycle, pressures=[70e3] * 6)
    thickness = []
    advance(robot, GAIT.cycle, lambda: thickness.append(robot._films[0].under_domes), [70e3] * 6)
    thickness = np.array(thickness)
    assert thickness.max() == pytest.approx(3e-4)
    assert thickness.min() < 2e-6
    rises = np.flatnonzero(np.diff(thickness) > 1e-4)
    assert len(rises) == 1


def test_marker_rides_on_sheared_pads():
    robot = standing(0.5)
    push(robot, y=0.5 * WEIGHT * 0.5)
    advance(robot, 0.5)
    for foot, place in zip(robot.feet, contacts(robot), strict=True):
        assert np.array(foot.position[:2]) == pytest.approx(
            place - np.array(foot.force[:2]) / 5000.0, abs=1e-12
        )


# --- walking ----------------------------------------------------------------------------------


def test_dry_walk_against_the_planar_robot():
    """Above 2.5 times the friction that the gait needs, both rungs agree to 2 %."""
    scene = dataclasses.replace(SHIPPED, settle=0.5)
    full, flat = FullHexapod(scene, DRY, 0.004), PlanarHexapod(scene, DRY, 0.004)
    for robot in (full, flat):
        advance(robot, 0.5 + 5.0)
    assert full.body[0] == pytest.approx(flat.body[0], rel=0.02)
    assert abs(full.body[1]) < 5e-3 and abs(full.body[2]) < math.radians(0.3)
    assert full.verdict is None
    # Scuffing at touch-down, which the planar robot has not: a few millimetres a cycle.
    assert all(2e-3 < foot.slip_path / 5.0 < 8e-3 for foot in full.feet)
    left, right = full.feet[:3], full.feet[:2:-1]
    for one, other in zip(left, right, strict=True):
        assert one.slip_path == pytest.approx(other.slip_path, rel=0.1)


def test_convergence_in_the_step():
    """Way and slip of a dry walk at 2 ms are those at 0.25 ms to 1 and 15 per cent."""
    ends = []
    for timestep in (0.002, 0.00025):
        robot = FullHexapod(scene_of(tow=SHIPPED.tow), DRY, 0.004, Settings(timestep=timestep))
        x, _, _ = advance(robot, 0.5 + 2.0)
        ends.append((x, sum(foot.slip_path for foot in robot.feet)))
    assert ends[0][0] == pytest.approx(ends[1][0], rel=0.01)
    assert ends[0][1] == pytest.approx(ends[1][1], rel=0.15)


def test_the_same_twice():
    one, other = (FullHexapod(scene_of(tow=SHIPPED.tow), WET, 0.004) for _ in range(2))
    assert advance(one, 1.5) == advance(other, 1.5)
    assert [foot.force for foot in one.feet] == [foot.force for foot in other.feet]
    assert one.joint_positions == other.joint_positions


def test_tow():
    """What the line gives to the load, its friction takes: ∫ T dx = 12 N · 0.2 · way.

    And the feet push, in the mean over cycles, as hard as the line pulls.
    """
    tow = Tow(weight=12.0, friction_dry=0.2, friction_wet=0.0, distance=0.4, height=0.03)
    robot = FullHexapod(scene_of(0.8, tow=tow), DRY, 0.002)
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


def test_tow_feels_the_ground_below_it():
    floor = Floor(np.array([[True, False]]), 50.0, (0.0, -1.0), 3e-4)  # wet from x = 0 to 50
    tow = Tow(weight=3.0, friction_dry=0.5, friction_wet=0.1, distance=0.1, height=0.03)
    robot = FullHexapod(scene_of(0.8, tow=tow), floor, 0.004)
    seen = set()

    def note():
        x = robot.data.geom('sled').xpos[0]
        if abs(x) > 5e-3:
            ratio = float(robot.model.pair('sled').friction[0])
            seen.add((bool(x > 0.0), ratio))

    advance(robot, 0.5 + 2.0, note)
    assert seen == {(False, 0.5), (True, 0.1)}


def test_line_only_pulls():
    """A body pushed back towards its load does not push it."""
    tow = Tow(weight=3.0, friction_dry=0.5, friction_wet=0.5, distance=0.4, height=0.12)
    robot = standing(0.05, tow=tow)
    rest = robot.data.geom('sled').xpos[0]
    push(robot, x=-4.0)
    advance(robot, 0.3)
    assert robot.body[0] < -0.02
    assert robot.data.geom('sled').xpos[0] == pytest.approx(rest, abs=1e-3)


def test_stiff_lines_take_shorter_steps():
    """At 2 ms a sled of 0.5 N on 1 MN/m throws the robot over; it can only drag."""
    ways = {}
    for stiffness in (2e3, 1e6):
        tow = Tow(0.5, 0.5, 0.5, 0.25, 0.03, stiffness)
        robot = FullHexapod(scene_of(tow=tow), DRY, 0.004)
        ways[stiffness] = advance(robot, 2.5)[0]
        assert robot.verdict is None
        reduced = 1.0 / (9.81 / 0.5 + 1.0 / 2.09)
        assert robot.model.opt.timestep < 2.0 * math.sqrt(reduced / stiffness)
    assert ways[1e6] == pytest.approx(ways[2e3], rel=0.01)
    with pytest.raises(ConfigError, match=r'tow.weight = 1e-09 N on a line of .* 2000 N/m needs'):
        FullHexapod(scene_of(tow=Tow(1e-9, 0.5, 0.5, 0.25, 0.03)), DRY, 0.004)


def test_steering():
    robot = FullHexapod(scene_of(heading_gain=1.0), DRY, 0.004)
    robot.data.qpos[3:7] = (math.cos(0.1), 0.0, 0.0, math.sin(0.1))
    _, _, heading = advance(robot, 0.5 + 2.0)
    # While it settles it steers, too, with its feet on the floor: exp(-gain t), 2.5 s.
    assert heading == pytest.approx(0.2 * math.exp(-2.5), abs=0.02)


def test_uneven_ground():
    floor = DRY.uneven(2e-3, 3)
    robot = FullHexapod(scene_of(), floor, 0.004)
    tops = []

    def note():
        for foot in robot.feet:
            if foot.force[2] > 3.0:
                x, y, z = foot.position
                tops.append((floor.height(x, y), z))

    advance(robot, 0.5 + 3.0, note)
    heights, places = np.array(tops).T
    assert np.ptp(heights) > 2e-3
    # A foot sinks a little, and near the edge of a cell it may stand on the next one's height.
    assert np.median(np.abs(places - heights)) < 6e-4
    assert np.corrcoef(heights, places)[0, 1] > 0.8
    assert robot.verdict is None


# --- verdicts ---------------------------------------------------------------------------------


def test_tip_over():
    robot = standing(2.0)
    trunk = robot.model.body('trunk').id
    robot.data.xfrc_applied[trunk, 3] = 8.0
    advance(robot, 1.0)
    assert 'tip-over' in robot.verdict or 'servo' in robot.verdict
    robot = standing(2.0)
    robot.data.qpos[3:7] = (math.cos(0.3), math.sin(0.3), 0.0, 0.0)
    robot.step(FLAT)
    assert 'tip-over' in robot.verdict and 'at 0.804 s' in robot.verdict


def test_servos_that_are_too_weak():
    """Femurs of 57 mm carry 15 kg on six legs for 1.4 N m each: more than 0.94."""
    robot = FullHexapod(
        scene_of(body=dataclasses.replace(BODY, mass=15.0, inertia=0.3)), DRY, 0.004
    )
    advance(robot, 1.0)
    assert robot.verdict.startswith('servo leg_')


def test_lost_solution(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file where it runs
    robot = standing()
    push(robot, x=1e30)
    advance(robot, 0.1)
    assert 'MuJoCo has lost the solution' in robot.verdict


@pytest.mark.parametrize('pressures', [[0.0] * 5, [0.0] * 7, [math.nan] * 6, [math.inf] * 6])
def test_bad_pressures(pressures):
    robot = FullHexapod(scene_of(), DRY, 0.004)
    with pytest.raises(InvalidInput, match='six finite numbers'):
        robot.step(pressures)
    assert robot.time == 0.0


@pytest.mark.parametrize(('lift', 'unevenness', 'clears'), [
    (0.03, 0.0, True), (0.03, 5e-4, True), (0.006, 0.0, True),
    (0.003, 0.0, False), (0.006, 5e-4, False), (0.015, 5e-3, False),
])  # fmt: skip
def test_a_foot_that_does_not_clear_the_ground_ends_the_walk(lift, unevenness, clears):
    """It would stand on the film and the height of its last step."""
    scene = Scene.load('hexapod_rough_wet_flat')
    scene = dataclasses.replace(
        scene,
        cycles=3,
        gait=dataclasses.replace(scene.gait, lift=lift),
        floor=dataclasses.replace(scene.floor, unevenness=unevenness),
    )
    robot = FullHexapod(scene, scene.floor.build(0), 0.004)
    while robot.verdict is None and robot.time < scene.duration:
        robot.step([0.0] * 6)
    assert (robot.verdict is None) == clears
    assert clears or 'does not clear the ground in its swing' in robot.verdict
