# SPDX-License-Identifier: Apache-2.0
import dataclasses
import itertools
import math

import numpy as np
import pytest

from ros_pad.simulation import Scene, planar_step
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.scene import Tow
from ros_pad.simulation.terrain import Floor

SHIPPED = Scene.load('hexapod_patches')
BODY, GAIT = SHIPPED.body, SHIPPED.gait
WEIGHT = BODY.mass * 9.81
FLAT = [0.0] * 6
DRY, WET = Floor.uniform(False, 3e-4), Floor.uniform(True, 3e-4)
RIGHT_WET = Floor(np.array([[True], [False]]), 50.0, (0.0, -50.0), 3e-4)


def scene_of(friction=None, **changes):
    """Return the shipped scene with changes; ``friction`` makes dry feet plain Coulomb feet."""
    values = {'settle': 0.0, 'heading_gain': 0.0, 'tow': Tow()} | changes
    if friction is not None:
        values['foot'] = dataclasses.replace(
            SHIPPED.foot, friction=friction, shear_strength=0.0, boundary_friction=0.1
        )
    return dataclasses.replace(SHIPPED, **values)


def robot_of(scene, floor=DRY, period=0.004):
    return PlanarRobot(scene, floor, period)


def walk(robot, cycles, each=lambda: None, pressures=FLAT):
    for _ in range(round(cycles * GAIT.cycle / robot.period)):
        robot.step(pressures)
        each()
    return robot.body


# --- loads ------------------------------------------------------------------------------------


def moments(robot):
    """Return ΣN, N, and ΣN x and ΣN y, N m, about the body's centre in its own axes."""
    x, y, heading = robot.body
    cosine, sine = math.cos(heading), math.sin(heading)
    total = np.zeros(3)
    for foot in robot.feet:
        dx, dy = foot.position[0] - x, foot.position[1] - y
        ahead, left = cosine * dx + sine * dy, cosine * dy - sine * dx
        total += foot.force[2] * np.array([1.0, ahead, left])
    return total


def test_loads_of_a_robot_at_rest():
    robot = robot_of(scene_of(settle=1.0))
    for _ in range(200):
        robot.step(FLAT)
        assert moments(robot) == pytest.approx([WEIGHT, 0.0, 0.0], abs=1e-9)
    # All six feet stand, each with half the share that it has in a tripod.
    assert all(foot.standing for foot in robot.feet)
    assert robot.body == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize('tow', [Tow(), SHIPPED.tow])
def test_loads_balance_weight_and_moments_in_a_walk(tow):
    """ΣN x = -H ΣF + (h - H) D with the tow's force D follows from Newton's law."""
    robot = robot_of(scene_of(tow=tow))
    period, path, forces, loads = robot.period, [robot.body], [], []

    def note():
        path.append(robot.body)
        forces.append(sum(foot.force[0] for foot in robot.feet))
        loads.append(moments(robot))

    walk(robot, 2.0, note)
    assert robot.verdict is None
    loads, forces = np.array(loads), np.array(forces)
    assert loads[:, 0] == pytest.approx(np.full(len(loads), WEIGHT), rel=1e-12)
    speed = np.diff([place[0] for place in path]) / period
    acceleration = np.diff(speed, prepend=0.0) / period
    pull = BODY.mass * acceleration - forces
    expected = -BODY.height * forces + (tow.height - BODY.height) * pull
    # Loads of a step follow from the forces of the step before.
    assert loads[1:, 1] == pytest.approx(expected[:-1], abs=0.02 * np.abs(expected).max())
    assert np.abs(expected).max() > 0.1


@pytest.mark.parametrize('height', [0.12, 1.2])
def test_tip_over(height):
    """At 4π S/T² = 2.0 m/s² and feet 0.1 m behind the centre, bodies tip from 0.5 m height on."""
    body = dataclasses.replace(BODY, height=height)
    robot = robot_of(scene_of(friction=2.0, body=body))
    walk(robot, 1.0)
    if height < 0.5:
        assert robot.verdict is None
    else:
        assert 'tip-over at 0.' in robot.verdict
        assert 'would have to pull' in robot.verdict
    assert all(foot.force[2] >= 0.0 for foot in robot.feet)


# --- walking ----------------------------------------------------------------------------------


@pytest.mark.parametrize('period', [0.001, 0.004])
def test_dry_level_walk_advances_a_stride_a_cycle(period):
    robot = robot_of(scene_of(friction=0.8), period=period)
    x, y, heading = walk(robot, 5.0)
    assert x == pytest.approx(5 * GAIT.stride, rel=5e-3)
    assert abs(y) < 1e-3 and abs(heading) < 2e-3
    assert robot.verdict is None
    assert max(foot.slip_path for foot in robot.feet) < 5 * 2e-3


def test_heading_hold_steers_back():
    tow = Tow(weight=3.0, friction_dry=0.5, friction_wet=0.5, height=0.03)
    free = walk(robot_of(scene_of(tow=tow), RIGHT_WET), 6.0)
    held = walk(robot_of(scene_of(tow=tow, heading_gain=1.0), RIGHT_WET), 6.0)
    assert abs(held[2]) < 0.5 * abs(free[2])
    # Without slip the heading decays as exp(-gain t): 0.2 rad, gain 0.5/s, 4 s.
    robot = robot_of(scene_of(friction=2.0, heading_gain=0.5))
    robot.state[planar_step.HEADING] = 0.2
    _, _, heading = walk(robot, 4.0)
    assert heading == pytest.approx(0.2 * math.exp(-2.0), rel=0.05)


def test_tow_drag():
    """In the mean over cycles the feet push with the drag of the sled, 12 N · 0.3 = 3.6 N."""
    tow = Tow(weight=12.0, friction_dry=0.3, friction_wet=0.1, height=0.03)
    pushes = []
    robot = robot_of(scene_of(friction=0.8, tow=tow))
    walk(robot, 2.0)
    walk(robot, 4.0, lambda: pushes.append(sum(foot.force[0] for foot in robot.feet)))
    # The mean is not exact, because the line is elastic and the body stops between tripods.
    assert np.mean(pushes) == pytest.approx(3.6, rel=0.05)
    reached = [
        walk(robot_of(scene_of(friction=0.25, tow=dataclasses.replace(tow, weight=w))), 4.0)[0]
        for w in (0.0, 6.0, 12.0)
    ]
    assert reached[0] > reached[1] > reached[2]
    # The load needs 12 N · 0.3 = 3.6 N, and the feet hold 0.15 · 20.5 N = 3.1 N only.
    stuck = walk(robot_of(scene_of(friction=0.15, tow=tow)), 4.0)[0]
    assert stuck < 0.1 * 4 * GAIT.stride


def test_tow_feels_the_ground_behind_the_robot():
    floor = Floor(np.array([[True, False]]), 50.0, (0.0, -1.0), 3e-4)  # wet from x = 0 to 50
    tow = Tow(weight=12.0, friction_dry=0.5, friction_wet=0.0, distance=0.3, height=0.03)
    scene = scene_of(tow=tow, friction=0.8)
    foot = dataclasses.replace(scene.foot, boundary_friction=0.8)  # wet feet hold, too
    robot = robot_of(dataclasses.replace(scene, foot=foot), floor)
    caps = []
    walk(robot, 4.0, lambda: caps.append((robot.body[0] - 0.3, robot.state[planar_step.SLED_X])))
    last = 0.0
    for behind, cap in caps:
        if abs(behind) > 1e-2:
            assert abs(cap) <= 3.0001e-3 and (cap == 0.0 or behind < 0.0)
            last = max(last, behind)
    assert last > 0.05 and max(abs(cap) for _, cap in caps) > 2.999e-3


# --- feet -------------------------------------------------------------------------------------


def test_standing_feet_stay_where_they_are():
    """Without slip a marker moves no more than pads shear: 2 N / 5000 N/m."""
    robot = robot_of(scene_of(friction=2.0, heading_gain=1.0))
    robot.state[planar_step.HEADING] = 0.1
    tracks = [[] for _ in range(6)]

    def note():
        for track, foot in zip(tracks, robot.feet, strict=True):
            track.append(foot.position if foot.standing else None)

    walk(robot, 4.0, note)
    stances = [
        np.array(list(group))
        for track in tracks
        for stands, group in itertools.groupby(track, lambda place: place is not None)
        if stands
    ]
    assert len(stances) >= 6 * 4
    for places in stances[6:]:
        assert np.ptp(places[:, :2], axis=0).max() < 1.5e-3
        assert (places[:, 2] == 0.0).all()
    assert max(foot.position[2] for foot in robot.feet) <= GAIT.lift


def test_forces_and_grip():
    robot = robot_of(scene_of(tow=SHIPPED.tow), WET)
    slipped = 0

    def check():
        nonlocal slipped
        for foot in robot.feet:
            # Force and moment share the grip on an ellipsoid with 2/3 of the sole's radius.
            pull = math.hypot(
                *foot.force[:2], foot.moment / (2.0 / 3.0 * SHIPPED.foot.sole_radius)
            )
            assert foot.standing == (foot.force[2] > 0.0)
            assert pull <= foot.grip + 1e-12
            if foot.slip_speed > 0.0:
                slipped += 1
                assert pull == pytest.approx(foot.grip, rel=1e-9)
            if foot.standing:
                assert foot.wet

    walk(robot, 2.0, check)
    assert slipped > 100


def test_pressures_reach_the_feet():
    """On wet ground domes hold and flat feet float; at 60 kPa 37 pads are overloaded."""
    grips, overloads = {}, {}
    for pressure in (0.0, 60e3, 75e3):
        robot = robot_of(scene_of(), WET)
        walk(robot, 0.3, pressures=[pressure] * 6)
        grips[pressure] = robot.feet[0].grip / robot.feet[0].force[2]
        overloads[pressure] = robot.feet[0].overload_time
    assert grips[0.0] == pytest.approx(0.12, rel=1e-3)
    assert grips[0.0] < 0.8 * grips[60e3] < 0.8 * grips[75e3]
    assert overloads[0.0] == overloads[75e3] == 0.0
    assert overloads[60e3] > 0.1


def test_dissipation():
    """Slipping feet lose their grip times the slip path; a walk without slip loses nothing."""
    robot = robot_of(scene_of(tow=SHIPPED.tow), WET)
    lost = [0.0]

    def note():
        lost[0] += sum(foot.grip * foot.slip_speed * robot.period for foot in robot.feet)

    walk(robot, 2.0, note)
    # Soles also turn with the body, which loses a little more.
    assert lost[0] < robot.dissipation < lost[0] * (1.0 + 1e-6)
    assert robot.dissipation > 0.1
    path = sum(foot.slip_path for foot in robot.feet)
    assert robot.dissipation < path * 0.12 * WEIGHT / 2.0
    grip = robot_of(scene_of(friction=2.0))
    walk(grip, 2.0)
    assert grip.dissipation < 1e-3


# --- slopes and uneven ground -------------------------------------------------------------------


def sloping(slope, **changes):
    floor = dataclasses.replace(SHIPPED.floor, slope=slope)
    return scene_of(floor=floor, **changes)


@pytest.mark.parametrize('tow', [Tow(), SHIPPED.tow])
def test_standing_on_a_slope(tow):
    """Feet carry W cos and hold W sin; uphill feet carry less: ΣN x = -H W sin.

    If the sled's friction does not hold it, the line at height h pulls with the rest.
    """
    slope = 0.1
    robot = robot_of(sloping(slope, friction=0.8, settle=10.0, tow=tow))
    for _ in range(2000):
        robot.step(FLAT)
    held = sum(foot.force[0] for foot in robot.feet)
    total, ahead, left = moments(robot)
    downhill = (WEIGHT + tow.weight) * math.sin(slope)
    drag = -robot.state[planar_step.PULL_X] - tow.weight * math.sin(slope)
    assert total == pytest.approx(WEIGHT * math.cos(slope), rel=1e-9)
    assert held - drag == pytest.approx(downhill, rel=1e-3)
    pulled = robot.state[planar_step.PULL_X]
    expected = -BODY.height * held + (tow.height - BODY.height) * pulled
    assert ahead == pytest.approx(expected, rel=1e-3)
    if not tow.weight:
        assert ahead == pytest.approx(-BODY.height * WEIGHT * math.sin(slope), rel=1e-3)
    assert left == pytest.approx(0.0, abs=1e-6)
    assert robot.verdict is None


def test_uneven_ground_moves_loads_between_redundant_feet_only():
    uneven = DRY.uneven(1e-3, 2)
    even, bumpy = robot_of(scene_of(friction=0.8)), robot_of(scene_of(friction=0.8), uneven)
    together = apart = 0.0
    for _ in range(500):
        even.step(FLAT)
        bumpy.step(FLAT)
        assert sum(foot.force[2] for foot in bumpy.feet) == pytest.approx(WEIGHT, rel=1e-9)
        differ = max(
            abs(one.force[2] - other.force[2])
            for one, other in zip(even.feet, bumpy.feet, strict=True)
        )
        if sum(foot.standing for foot in even.feet) == 3:
            together = max(together, differ)
        else:
            apart = max(apart, differ)
    assert apart > 1.0
    assert together < 0.3  # as feet were sheared differently before
    assert bumpy.verdict is None
    assert bumpy.body[0] == pytest.approx(even.body[0], rel=0.02)


# --- soles that turn with their legs ------------------------------------------------------------
