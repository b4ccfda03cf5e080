# SPDX-License-Identifier: Apache-2.0
"""Robots of three to eight legs on L1 and L2, from YAML and URDF."""

import math
import re

import numpy as np
import pytest
import yaml

from ros_pad import configuration
from ros_pad.errors import ConfigError
from ros_pad.simulation import Scene, fidelity

CH3R = yaml.safe_load((configuration.shared_folder() / 'robots' / 'ch3r.yaml').read_text())
DRY = yaml.safe_load(
    (configuration.shared_folder() / 'scenes' / 'hexapod_smooth_dry_flat.yaml').read_text()
) | {'floor': {'kind': 'dry'}}

LINK = """
<link name="{leg}_{name}"><inertial><origin xyz="{middle}"/><mass value="{mass}"/>
<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
<joint name="{leg}_{name}_joint" type="revolute"><origin xyz="{at}"/>
<parent link="{parent}"/><child link="{leg}_{name}"/><axis xyz="{axis}"/></joint>"""


def round_robot(tmp_path, legs, **gait):
    """Write a robot with the legs of the CH3-R on a circle, and a dry scene of it."""
    places = {}
    for number in range(legs):
        angle = math.pi * (2 * number + 1) / legs
        at = [0.138 * math.cos(angle), 0.138 * math.sin(angle), 0.0]
        places[number + 1] = {'at': at, 'bearing': angle}
    robot = CH3R | {'legs': places, 'gait': {'cycle': 2.0, 'lift': 0.02} | gait}
    del robot['inertia']
    (tmp_path / 'robot.yaml').write_text(yaml.safe_dump(robot))
    scene = DRY | {'robot': 'robot.yaml', 'gait': {'stride': 0.06}}
    del scene['tow']
    (tmp_path / 'scene.yaml').write_text(yaml.safe_dump(scene))
    return Scene.load(tmp_path / 'scene.yaml')


def urdf_scene(tmp_path, **changes):
    """Write a quadruped of 4 kg as URDF, its YAML file and a dry scene."""
    parts = [
        '<robot name="q"><link name="base"><inertial><mass value="3.0"/><inertia ixx="0.01"'
        ' ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial></link><link name="imu"/>'
        '<joint name="imu_joint" type="fixed"><origin xyz="0.02 0 0.03"/><parent link="base"/>'
        '<child link="imu"/></joint>'
    ]
    for leg, x, y in (('LF', 1, 1), ('RF', 1, -1), ('LH', -1, 1), ('RH', -1, -1)):
        at = f'{0.15 * x} {0.06 * y} 0'
        for name, place, axis, parent, mass, middle in (
            ('hip', at, '1 0 0', 'base', 0.1, '0 0 0'),
            ('thigh', f'0 {0.03 * y} 0', '0 1 0', f'{leg}_hip', 0.1, '0 0 -0.08'),
            ('shank', '0 0 -0.16', '0 1 0', f'{leg}_thigh', 0.05, '0 0 -0.08'),
        ):
            parts.append(
                LINK.format(leg=leg, name=name, middle=middle, mass=mass, at=place, axis=axis,
                            parent=parent)
            )  # fmt: skip
        parts.append(
            f'<link name="{leg}_foot"/><joint name="{leg}_tip" type="fixed"><origin xyz="0 0'
            f' -0.16"/><parent link="{leg}_shank"/><child link="{leg}_foot"/></joint>'
        )
    (tmp_path / 'q.urdf').write_text('\n'.join([*parts, '</robot>']))
    robot = {
        'urdf': 'q.urdf',
        'feet': ['LF_foot', 'RF_foot', 'LH_foot', 'RH_foot'],
        'imu': 'imu',
        'home': {'thigh_joint': 0.7, 'shank_joint': -1.4},
        'gait': {'kind': 'trot', 'cycle': 0.5, 'duty': 0.6, 'lift': 0.04},
        'servo': {'torque': 10.0, 'speed': 20.0, 'rotor_inertia': 2e-3},
    }
    (tmp_path / 'robot.yaml').write_text(yaml.safe_dump(robot | changes))
    scene = DRY | {'robot': 'robot.yaml', 'gait': {'stride': 0.05}}
    del scene['tow']
    (tmp_path / 'scene.yaml').write_text(yaml.safe_dump(scene))
    return tmp_path / 'scene.yaml'


def walk(scene, level, cycles=4):
    robot = fidelity.build(scene, scene.floor.build(0), 0.004, level)
    loads = []
    for _ in range(round((scene.settle + cycles * scene.gait.cycle) / robot.period)):
        robot.step([0.0] * len(robot.legs))
        loads.append([foot.force[2] for foot in robot.feet])
    return robot, np.array(loads)


def way(scene, cycles=4):
    """Return the distance without slip, m: the speed rises in the first cycle."""
    return (cycles - (0.0 if scene.gait.pushes else 0.5)) * scene.gait.stride


@pytest.mark.parametrize('legs', range(3, 9))
def test_l1_walks_any_number_of_legs(tmp_path, legs):
    scene = round_robot(tmp_path, legs, kind='wave', duty=max(0.75, 1.04 - 1.0 / legs))
    assert scene.legs == tuple(range(1, legs + 1))
    assert scene.gait.fewest == legs - 1
    assert scene.expected_load == pytest.approx(scene.body.mass * 9.81 / (legs - 1), rel=1e-3)
    robot, loads = walk(scene, 'L1')
    assert robot.verdict is None
    assert robot.body == pytest.approx((way(scene), 0.0, 0.0), abs=6e-3)
    # As many feet as the gait has standing carry the weight.
    assert loads.sum(1) == pytest.approx(scene.body.mass * 9.81, rel=1e-3)
    assert (loads > 0.0).sum(1).max() <= legs


@pytest.mark.parametrize(
    ('legs', 'gait'),
    [(4, {'kind': 'crawl', 'duty': 0.8}), (5, {'kind': 'ripple', 'duty': 0.7}),
     (6, {'kind': 'wave', 'duty': 0.87}), (8, {'kind': 'tripod', 'duty': 0.6}),
     (6, {'kind': 'own', 'duty': 0.6, 'phases': [0.0, 0.5, 0.0, 0.5, 0.0, 0.5]})],
)  # fmt: skip
def test_l2_walks_any_gait(tmp_path, legs, gait):
    pytest.importorskip('mujoco')
    scene = round_robot(tmp_path, legs, **gait)
    robot, loads = walk(scene, 'L2')
    assert robot.verdict is None
    assert robot.body == pytest.approx((way(scene), 0.0, 0.0), abs=0.03)
    assert loads.sum(1)[250:].mean() == pytest.approx(scene.body.mass * 9.81, rel=0.02)


@pytest.mark.parametrize('level', ['L1', 'L2'])
def test_a_scene_with_a_users_urdf(tmp_path, level):
    if level == 'L2':
        pytest.importorskip('mujoco')
    scene = Scene.load(urdf_scene(tmp_path))
    assert scene.body.mass == pytest.approx(4.0)
    # Thigh and shank of 160 mm, each 0.7 rad off the vertical; the legs' weight lowers the centre.
    assert scene.body.ground == pytest.approx(-0.32 * math.cos(0.7), abs=1e-9)
    fallen = 4 * (0.1 * 0.08 * math.cos(0.7) + 0.05 * 0.24 * math.cos(0.7)) / 4.0
    assert scene.body.height == pytest.approx(0.32 * math.cos(0.7) - fallen, abs=1e-9)
    robot, loads = walk(scene, level, cycles=8)
    assert robot.verdict is None
    assert robot.body[0] == pytest.approx(way(scene, 8), rel=0.05)
    assert loads[250:].sum(1).mean() == pytest.approx(4.0 * 9.81, rel=0.02)
    # Diagonals stand in turn.
    stand = loads[250:] > 0.2 * 4.0 * 9.81 / 2
    assert np.corrcoef(stand[:, 0], stand[:, 3])[0, 1] > 0.5
    assert np.corrcoef(stand[:, 0], stand[:, 1])[0, 1] < -0.5


def test_forces_are_in_the_axes_of_links_of_feet_that_are_turned(tmp_path):
    pytest.importorskip('mujoco')
    path = urdf_scene(tmp_path)
    text = (tmp_path / 'q.urdf').read_text()
    old = '<origin xyz="0 0 -0.16"/><parent link="LF_shank"/><child link="LF_foot"/>'
    assert old in text
    new = old.replace('-0.16"', '-0.16" rpy="0.3 1.0 -2.0"')
    (tmp_path / 'q.urdf').write_text(text.replace(old, new))
    scene = Scene.load(path)
    robot, _ = walk(scene, 'L2', cycles=0)  # it stands
    felt = robot.proprioception()
    turn = scene.body.robot.kinematics(felt.positions).rotations[0]
    assert turn @ felt.forces[0] == pytest.approx(robot.feet[0].force, abs=0.05)


def test_links_without_mass_are_refused(tmp_path):
    path = urdf_scene(tmp_path)
    text = (tmp_path / 'q.urdf').read_text()
    for mass in ('3.0', '0.1', '0.05'):
        text = text.replace(f'<mass value="{mass}"/>', '')
    (tmp_path / 'q.urdf').write_text(text)
    path.write_text(path.read_text() + 'body: {mass: 4.0}\n')
    with pytest.raises(ConfigError, match='have 0 of its 0 kg: less than 99%'):
        Scene.load(path)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'feet': ['LF_foot', 'RF_foot']}, '3 to 8 different links are needed'),
        ({'home': {'knee': 1.0}}, "home: no joint ends in 'knee'; there are: LF_hip_joint"),
        ({'gait': {'kind': 'gallop', 'cycle': 1.0, 'duty': 0.5, 'lift': 0.1}}, "kind = 'gallop'"),
    ],
)
def test_robots_from_urdf_that_are_refused(tmp_path, changes, message):
    with pytest.raises(ConfigError) as caught:
        Scene.load(urdf_scene(tmp_path, **changes))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ('upper', 'lift', 'message'),
    [
        (0.71, 0.0, r'gait\.stride = 0\.05 m is not allowed.*thigh_joint would be'),
        (0.71, 0.04, r'gait\.lift = 0\.04 m is not allowed.*thigh_joint would be'),
        (1.5, 0.04, ''),
        (0.0, 0.04, ''),  # as exporters write it that know no limits
    ],
)
def test_a_gait_beyond_the_limits_of_a_urdf(tmp_path, upper, lift, message):
    gait = {'kind': 'trot', 'cycle': 0.5, 'duty': 0.6, 'lift': lift}
    path = urdf_scene(tmp_path, gait=gait)
    text = (tmp_path / 'q.urdf').read_text()
    limit = f'<limit lower="{-1.0 if upper else 0.0}" upper="{upper}" effort="1" velocity="1"/>'
    text = re.sub('(_thigh_joint" type="revolute">)', rf'\1{limit}', text)
    (tmp_path / 'q.urdf').write_text(text)
    scene = Scene.load(path)
    if not message:
        walk(scene, 'L1', cycles=0)
        return
    with pytest.raises(ConfigError, match=message):
        walk(scene, 'L1')


def test_a_robot_that_stands_beyond_its_limits_may_be_estimated_but_not_walk(tmp_path):
    """Without a posture all joints are at zero, which many knees cannot reach."""
    path = urdf_scene(tmp_path, home={'thigh_joint': 0.7})
    text = (tmp_path / 'q.urdf').read_text()
    limit = '<limit lower="-2.7" upper="-0.8" effort="1" velocity="1"/>'
    (tmp_path / 'q.urdf').write_text(
        re.sub('(_shank_joint" type="revolute">)', rf'\1{limit}', text)
    )
    scene = Scene.load(path)
    with pytest.raises(
        ConfigError,
        match=r'gait\.lift = .* of .*robot\.yaml .*shank_joint',
    ):
        walk(scene, 'L1')


def test_a_bare_urdf_and_a_scene_that_names_it_are_enough(tmp_path):
    pytest.importorskip('mujoco')
    path = urdf_scene(tmp_path)
    scene = yaml.safe_load(path.read_text()) | {'robot': 'q.urdf'}
    del scene['gait']
    path.write_text(yaml.safe_dump(scene))
    with pytest.raises(ConfigError, match=r'robot: feet = .* 3 to 8 different links'):
        Scene.load(path)
    scene['feet'] = ['LF_foot', 'RF_foot', 'LH_foot', 'RH_foot']
    path.write_text(yaml.safe_dump(scene))
    loaded = Scene.load(path)
    stands = loaded.body.robot.kinematics(loaded.body.robot.home)
    assert np.ptp(stands.positions[:, 2]) < 1e-9
    assert 0.5 < -loaded.body.ground / 0.32 < 0.9  # bent legs
    robot, _ = walk(loaded, 'L2', cycles=8)
    assert robot.verdict is None
    assert robot.body == pytest.approx((way(loaded, 8), 0.0, 0.0), abs=0.05 * way(loaded, 8))


@pytest.mark.parametrize(
    ('robot', 'scene', 'message'),
    [
        ({'servo': {'torque': 0.5}}, {}, r'_joint has 0\.5 N m: at least 0\.589 N m is needed'),
        ({}, {'tow': {'weight': 70.0, 'friction_dry': 0.5, 'friction_wet': 0.5}},
         r'tow\.weight = 70 N is not allowed: at most \d\d\.?\d* N can be pulled'),
    ],
)  # fmt: skip
def test_what_cannot_walk_is_refused_with_the_number_that_would(tmp_path, robot, scene, message):
    pytest.importorskip('mujoco')
    path = urdf_scene(tmp_path, **robot)
    path.write_text(yaml.safe_dump(yaml.safe_load(path.read_text()) | scene))
    with pytest.raises(ConfigError, match=message):
        walk(Scene.load(path), 'L2')


def test_a_negative_effort_is_refused(tmp_path):
    path = urdf_scene(tmp_path)
    text = (tmp_path / 'q.urdf').read_text()
    limit = '<limit lower="-1" upper="1" effort="-5" velocity="1"/>'
    (tmp_path / 'q.urdf').write_text(
        re.sub('(_thigh_joint" type="revolute">)', rf'\1{limit}', text)
    )
    with pytest.raises(ConfigError, match=r'effort = -5\.0 is not allowed: .* N m'):
        Scene.load(path)
