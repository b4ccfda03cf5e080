# SPDX-License-Identifier: Apache-2.0
"""Kinematics and masses of robots, against pinocchio and by hand; refusals of their files."""

import json
import pathlib
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots import Gait, Robot
from ros_pad.robots.rotation import from_rpy, quaternion, rotation
from ros_pad.robots.urdf import Urdf
from ros_pad.simulation.scene import Scene

REFERENCE = pathlib.Path(__file__).resolve().parent.parent / 'reference'
URDF = REFERENCE / 'robot.urdf'
FEET = ['a_foot', 'b_foot', 'c_foot']
Q = np.array([[0.3, -0.7, 0.12], [-1.1, 0.4, 0.9], [0.5, 0.2, -1.3]])
GRAVITY = np.array([1.5, -0.8, -9.6])


def odd():
    return Robot.load(URDF, feet=FEET, imu='imu', foot_radius=0.02)


def test_kinematics_are_those_that_pinocchio_gave():
    robot = odd()
    figures = json.loads((REFERENCE / 'robot_pinocchio.json').read_text())
    for leg, foot in enumerate(FEET):
        row = figures[foot]
        assert robot.foot_positions(Q)[leg] == pytest.approx(np.array(row['position']), abs=1e-12)
        assert robot.kinematics(Q).rotations[leg] == pytest.approx(
            np.array(row['rotation']), abs=1e-12
        )
        lines = np.array(row['jacobian'])
        assert robot.kinematics(Q).jacobians[leg] == pytest.approx(lines[:3], abs=1e-12)
        assert robot.kinematics(Q).angular[leg] == pytest.approx(lines[3:], abs=1e-12)
    torques = robot.chains.gravity_torques(robot.kinematics(Q), GRAVITY)
    assert torques == pytest.approx(np.array(figures['torques']), abs=1e-12)
    assert robot.imu == pytest.approx(np.array(figures['imu']), abs=1e-12)


@pytest.mark.parametrize('name', ['go2', 'ch3r'])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_jacobians_are_derivatives_of_places_and_rotations(name, seed):
    robot = Robot.load(name)
    generator = np.random.default_rng(seed)
    q = generator.uniform(-1.5, 1.5, robot.home.shape)
    step = 1e-6
    for joint in range(q.shape[1]):
        ahead, behind = q.copy(), q.copy()
        ahead[:, joint] += step
        behind[:, joint] -= step
        line = (robot.foot_positions(ahead) - robot.foot_positions(behind)) / (2 * step)
        assert robot.kinematics(q).jacobians[:, :, joint] == pytest.approx(line, abs=1e-8)
        turn = robot.kinematics(ahead).rotations @ robot.kinematics(behind).rotations.transpose(
            0, 2, 1
        )
        twice = turn - turn.transpose(0, 2, 1)
        rate = np.stack([twice[:, 2, 1], twice[:, 0, 2], twice[:, 1, 0]], axis=1) / (4 * step)
        assert robot.kinematics(q).angular[:, :, joint] == pytest.approx(rate, abs=1e-8)


def test_the_hexapod_is_that_of_the_scenes():
    robot = Robot.load('ch3r')
    scene = Scene.load('hexapod_patches')
    assert robot.mass == scene.body.mass
    homes = np.array(scene.body.homes)
    assert robot.foot_positions(robot.home)[:, :2] == pytest.approx(homes, abs=1e-9)
    # Hips are at (119, 69) and (0, 138) mm, links 29, 57 and 141 mm long, the femur level.
    hips = [(0.119, 0.069), (0, 0.138), (-0.119, 0.069)]
    assert robot.hips[:3, :2] == pytest.approx(np.array(hips), abs=6e-4)
    assert robot.hips[3:, :2] == pytest.approx(np.array(hips)[::-1] * (1, -1), abs=6e-4)
    assert robot.inertia == 0.03 and robot.height == 0.12
    # Coxa turned by a right angle: the foot moves on a circle of 86 mm about its hip.
    places = robot.foot_positions(np.tile([np.pi / 2, 0.0, 0.0], 6))
    assert places[1] == pytest.approx([-0.086, 0.138, -0.141], abs=1e-9)
    # Femur up by a right angle: the tibia then points outwards.
    places = robot.foot_positions(np.tile([0.0, np.pi / 2, 0.0], 6))
    assert places[4] == pytest.approx([0.0, -0.138 - 0.029 - 0.141, 0.057], abs=1e-9)


def test_a_quadruped_stands_as_its_lengths_say():
    robot = Robot.load('go2')
    places = robot.foot_positions(np.zeros(12))
    # Thigh and calf hang down: 2 x 0.213 m below the hip, 0.0955 m aside of it.
    assert places[0] == pytest.approx([0.1934, 0.0465 + 0.0955, -0.426])
    assert places[3] == pytest.approx([-0.1934, -0.142, -0.426])
    # Thigh forward by a right angle, calf straight down.
    places = robot.foot_positions(np.tile([0.0, -np.pi / 2, np.pi / 2], 4))
    assert places[1] == pytest.approx([0.1934 + 0.213, -0.142, -0.213])


@pytest.mark.parametrize('name', ['go2', 'ch3r'])
def test_joint_positions_bring_the_feet_to_their_places(name):
    robot = Robot.load(name)
    goal = robot.foot_positions(robot.home) + np.array([0.03, -0.02, 0.02])
    q = robot.joint_positions(goal)
    assert robot.foot_positions(q) == pytest.approx(goal, abs=1e-8)
    with pytest.raises(InvalidInput, match='does not reach'):
        robot.joint_positions(goal - 1.0)
    with pytest.raises(InvalidInput, match='feet of shape'):
        robot.joint_positions(goal[:, :1])


def test_gaits_by_phase():
    hexapod, quadruped = Robot.load('ch3r'), Robot.load('go2')
    assert hexapod.gait.phases == (0.0, 0.5, 0.0, 0.5, 0.0, 0.5)
    assert quadruped.gait.phases == (0.0, 0.5, 0.5, 0.0)  # FL FR RL RR: diagonals together
    for name, robot, duty, standing in (
        ('tripod', hexapod, 0.5, 3),
        ('wave', hexapod, 5.0 / 6.0, 5),
        ('ripple', hexapod, 2.0 / 3.0, 4),
        ('crawl', quadruped, 0.75, 3),
        ('trot', quadruped, 0.5, 2),
    ):
        gait = Gait.named(name, robot.hips, 0.8, duty, 0.03)
        for time in np.linspace(0.0013, 5.0, 97):
            assert gait.stands(time).sum() == standing, name
    crawl = Gait.named('crawl', quadruped.hips, 1.0, 0.75, 0.03)
    # Touch-downs: left rear, left front, right rear, right front.
    assert crawl.phases == (0.25, 0.75, 0.0, 0.5)
    assert crawl.phase(0.25) == pytest.approx([0.0, 0.5, 0.25, 0.75])


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('mass: 15.02', 'mass: 3.0', 'mass = 3 kg is not allowed: at least 8.096 kg is needed'),
        ('[0.0, 0.0, -0.213]\n\ngait', '[0.0, -0.213]\n\ngait', 'a list of 3 numbers'),
        ('axis: [1.0, 0.0, 0.0]', 'axis: [0.0, 0.0, 0.0]', 'no direction'),
        ('kind: trot', 'kind: tripod', '6 or 8 legs'),
        ('cycle: 0.555', 'cycle: .nan', 'cycle = nan .* 0.05 to 60 s'),
        ('at: [0.0, 0.0, -0.213]', 'at: [0.0, 0.0, -213.0]', r'-213.0 .* -5 to 5 m \(not mm\)'),
        ('foot: [0.0, 0.0, -0.213]', 'foot: [0.0, 0.0, -4.9]', r'leg FL: length = 5\.2.* 5 m'),
        ('mass: 15.02', 'mass: 15020.0', r'mass = 15020.0 .* 2000 kg \(not g\)'),
        ('foot_radius: 0.022', 'foot_radius: 0.9', 'foot_radius = 0.9 .* 0 to 0.52'),
        ('  torque: 23.7', '  stiffness: 90.0\n  damping: 1.0', "servo: key 'torque' is missing"),
        ('{axis: [1.0', '{kind: prismatic, axis: [1.0', 'servo is not allowed: .* FL_hip_joint'),
    ],
)
def test_yaml_files_that_are_not_valid(old, new, message, tmp_path):
    shipped = pathlib.Path(__file__).resolve().parents[2] / 'config' / 'robots' / 'go2.yaml'
    text = shipped.read_text()
    assert old in text
    path = tmp_path / 'mine.yaml'
    path.write_text(text)
    assert Robot.load(path).name == 'mine'
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError, match=message):
        Robot.load(path)


def test_an_own_gait_and_fewer_legs(tmp_path):
    shipped = pathlib.Path(__file__).resolve().parents[2] / 'config' / 'robots' / 'go2.yaml'
    text = shipped.read_text().replace('kind: trot', 'kind: own\n  phases: [0.0, 0.1, 0.9]')
    path = tmp_path / 'three.yaml'
    path.write_text(text.replace('  RR: {at: [-0.1934, -0.0465, 0.0], side: right}\n', ''))
    robot = Robot.load(path, foot_radius=0.015)
    assert robot.legs == ('FL', 'FR', 'RL')
    assert (robot.gait.phases, robot.foot_radius) == ((0.0, 0.1, 0.9), 0.015)


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('<robot name="odd">', '<robot name="odd"', 'not a readable URDF'),
        ('<axis xyz="1 2 -1"/>', '<axis xyz="0 0 0"/>', 'no direction'),
        ('<axis xyz="1 2 -1"/>', '<axis xyz="1 2 nan"/>', 'finite'),
        ('<child link="a1"/>', '<child link="none"/>', "'none'"),
        ('<child link="a1"/>', '<child link="b1"/>', 'two parents'),
        ('"base"/><child link="a1"/>', '"a2"/><child link="a1"/>', 'loop'),
        ('<mass value="0.7"/>', '<mass value="-1"/>', 'at least 0 kg'),
        ('<joint name="c_j3" type="revolute">', '<joint name="c_j3" type="fixed">', '2 and 3'),
        ('name="imu_joint" type="fixed"', 'name="imu_joint" type="revolute"', 'moves'),
        ('xyz="0.2 0.1 0.01"', 'xyz="200 100 10"', 'leg a_foot: distance of the hip .* 5 m'),
        ('<limit lower="-3" upper="3"', '<limit lower="3" upper="-3"', 'lower = 3.0 .* most -3'),
        ('<axis xyz="1 2 -1"/>', '<axis xyz="1 2 -1"/><mimic joint="b_j1"/>', 'mimic .*b_j1'),
    ],
)  # fmt: skip
def test_urdf_files_that_are_not_valid(old, new, message, tmp_path):
    text = URDF.read_text()
    assert old in text
    path = tmp_path / 'odd.urdf'
    path.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=message):
        Robot.load(path, feet=FEET, imu='imu')


def test_an_empty_base_has_the_inertia_of_what_is_fixed_to_it(tmp_path):
    """As in the URDF of many quadrupeds: base without mass, and the trunk is fixed to it."""
    fixed = (
        '<link name="{0}"><inertial><origin xyz="{2}" rpy="0 1.5707963267948966 0"/><mass'
        ' value="{1}"/><inertia ixx="0.3" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.1"/></inertial>'
        '</link><joint name="{0}_fixed" type="fixed"><origin xyz="0 0 0.1" rpy="0 0'
        ' 0.7853981633974483"/><parent link="base"/><child link="{0}"/></joint>'
    )
    text = URDF.read_text()
    start = text.index('<link name="base">')
    end = text.index('</link>', start) + len('</link>')
    path = tmp_path / 'odd.urdf'
    parts = fixed.format('front', 2.0, '0.5 0 0'), fixed.format('rear', 2.0, '-0.5 0 0')
    path.write_text(text[:start] + '<link name="base"/>' + ''.join(parts) + text[end:])
    centre, inertia = Urdf(path).trunk()
    assert centre == pytest.approx((0.0, 0.0, 0.1))
    # About y by 90 degrees: x of each inertia is upright. Each 2 kg are half a metre off.
    assert inertia == pytest.approx(2.0 * (0.3 + 2.0 * 0.25))


def test_legs_that_share_a_joint_are_refused(tmp_path):
    path = tmp_path / 'odd.urdf'
    path.write_text(URDF.read_text().replace('"b_j1"', '"a_j1"'))
    with pytest.raises(ConfigError, match="'a_j1' is in two legs"):
        Robot.load(path, feet=FEET)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'feet': FEET[:2]}, '3 to 8'),
        ({'feet': [*FEET[:2], FEET[0]]}, 'different'),
        ({'feet': FEET, 'foot_radius': -1.0}, 'foot_radius'),
    ],
)
def test_arguments_that_are_not_allowed(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        Robot.load(URDF, **arguments)


def test_a_posture_beyond_the_limits_of_a_urdf(tmp_path):
    path = tmp_path / 'odd.yaml'
    for home, message in (
        ({'a_j3': 1.1}, r'home: a_j3 \(a_j3\) = 1.1 .* from -1 to 1 m is'),
        ({'b_j2': 3.1}, r'home: b_j2 \(b_j2\) = 3.1 .* from -3 to 3 rad'),
        ({'b_j2': -3.0}, ''),
    ):
        path.write_text(f'urdf: {URDF}\nfeet: {FEET}\nhome: {home}\n')
        if message:
            with pytest.raises(ConfigError, match=message):
                Robot.load(path)
    assert Robot.load(path).home[1, 1] == -3.0


def test_lengths_of_a_urdf_in_millimetres(tmp_path):
    """As exported without a scale: every place is a thousand times as far off."""
    text = re.sub(
        r'(<origin xyz=")([^"]*)',
        lambda found: found[1] + ' '.join(f'{1e3 * float(x)}' for x in found[2].split()),
        URDF.read_text(),
    )
    path = tmp_path / 'odd.urdf'
    path.write_text(text)
    with pytest.raises(ConfigError, match=r'odd\.urdf: leg a_foot: .* 0 to 5 m \(not mm\)'):
        Robot.load(path, feet=FEET)


@pytest.mark.parametrize('q', [np.zeros(11), np.full(12, np.nan), np.zeros((4, 4)), 'zero'])
def test_joint_positions_that_are_not_allowed(q):
    with pytest.raises(InvalidInput, match='q'):
        Robot.load('go2').foot_positions(q)


@settings(deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_rotations_and_quaternions(angles):
    scipy = pytest.importorskip('scipy.spatial.transform').Rotation
    made = rotation(angles)
    assert made == pytest.approx(scipy.from_rotvec(angles).as_matrix(), abs=1e-9)
    assert from_rpy(angles) == pytest.approx(scipy.from_euler('xyz', angles).as_matrix(), abs=1e-9)
    kept = scipy.from_quat(quaternion(made)).as_matrix()
    assert kept == pytest.approx(made, abs=1e-9)


@pytest.mark.parametrize('name', ['go2', 'ch3r'])
def test_many_positions_at_once_are_those_one_by_one(name):
    robot = Robot.load(name)
    noise = np.random.default_rng(0).normal(0.0, 0.3, (5, *robot.home.shape))
    together = robot.chains.solve(robot.home + noise)
    for index, each in enumerate(noise):
        alone = robot.chains.solve(robot.home + each)
        for field in alone._fields:
            assert np.array_equal(getattr(together, field)[index], getattr(alone, field)), field
