# SPDX-License-Identifier: Apache-2.0
import copy
import json
import pathlib
import re
import shutil

import pytest
import yaml

from ros_pad import configuration
from ros_pad.errors import ConfigError
from ros_pad.simulation import Scene
from ros_pad.simulation.gait import WalkingGait

FOLDER = configuration.shared_folder() / 'scenes'
HEXAPOD = yaml.safe_load((FOLDER / 'hexapod_patches.yaml').read_text())
LEG = yaml.safe_load((FOLDER / 'leg_wet_dome_60.yaml').read_text())


def written(tmp_path, source, *changes):
    """Write a scene with changes (path of keys, value); the value ... removes the key."""
    values = copy.deepcopy(source)
    for path, value in changes:
        *parts, last = path.split('.')
        table = values
        for part in parts:
            table = table[part]
        if value is ...:
            del table[last]
        else:
            table[last] = value
    file = tmp_path / 'mine.yaml'
    file.write_text(yaml.safe_dump(values))
    return file


@pytest.mark.parametrize(
    'name', [name for name in configuration.names('scenes') if not name.startswith('bench_')]
)
def test_shipped_scenes(name):
    scene = Scene.load(name)
    assert scene.source == scene.name == name
    assert scene.description
    legs = {'ch3r': 6, 'go2': 4, 'rail_leg': 1}[scene.robot]
    assert scene.legs == tuple(range(1, legs + 1))
    assert scene.duration == scene.settle + scene.cycles * scene.gait.cycle
    assert scene.expected_load > 0.0
    assert scene.dome_pressure is None or scene.dome_pressure <= scene.foot.ceiling
    floor = scene.floor.build(0)
    assert floor.wet_map.any() == (scene.floor.kind != 'dry')
    assert floor.wet_map.all() == (scene.floor.kind == 'wet')
    # The reach of the gait keeps the feet of one side apart.
    if isinstance(scene.gait, WalkingGait):
        assert 2.0 * scene.gait.reach() < 1.3 * scene.body.homes[0][0]


def test_options_of_the_regulator(tmp_path):
    """Options have line and faults of the regulator, as ROS parameters, but no sensor faults."""
    assert Scene.load('hexapod_patches').regulator_options == HEXAPOD['regulator']
    faults = [
        {'kind': 'leak', 'legs': [2], 'start': 1.5, 'conductance': 1e-9},
        {'kind': 'force_dead', 'legs': [2]},
        {'kind': 'marker_frozen'},
    ]
    line = {'hose_diameter': 0.003, 'hose_length': 2.0, 'hose_conductance': 1e-8}
    scene = Scene.load(written(tmp_path, HEXAPOD, ('regulator', line), ('faults', faults)))
    options = scene.regulator_options
    (fault,) = options.pop('faults')
    assert json.loads(fault) == faults[0]
    assert options == line


def test_values_come_where_they_belong():
    scene = Scene.load('hexapod_patches')
    assert scene.body.mass == 2.09
    assert scene.expected_load == pytest.approx(scene.body.mass * 9.81 / 3.0)
    assert scene.gait.stride == HEXAPOD['gait']['stride']
    assert scene.tow.friction_dry == HEXAPOD['tow']['friction_dry']
    assert scene.tow.friction_wet == HEXAPOD['tow']['friction_wet']
    assert scene.sensors.rate == HEXAPOD['sensors']['rate']
    assert scene.sensors.position == HEXAPOD['sensors']['position_noise']
    leg = Scene.load('leg_wet_dome_60')
    assert leg.dome_pressure == LEG['dome_pressure']
    assert leg.gait.stride == LEG['gait']['stroke'] and leg.expected_load == LEG['body']['load']
    assert leg.heading_gain == 0.0 and leg.tow.weight == 0.0


BAD = [
    (HEXAPOD, 'foot', 'large73', "foot: no foot named 'large73'. Did you mean 'large37'?"),
    (HEXAPOD, 'cycles', 0, 'cycles = 0 is not allowed: a whole number from 1 to 100000'),
    (HEXAPOD, 'accuracy', 0, 'accuracy = 0 is not allowed: a number from 0.0001 to 1'),
    (HEXAPOD, 'dome_pressure', 95e3, 'dome_pressure = 95000.0 is not allowed: a number from 1'),
    (HEXAPOD, 'body', {'mass': '2 kg'}, "body: mass = '2 kg' is not allowed: a number from 0.05"),
    (HEXAPOD, 'gait.duty', 0.5, 'gait: pushes = True is not allowed: two groups of legs'),
    (HEXAPOD, 'gait.stride', 3.0, 'gait: stride = 3.0 is not allowed: a number from 0.001 to 2'),
    (HEXAPOD, 'floor.patch_length', 6.0, 'floor: patch_length = 6.0 is not allowed: a number'),
    (HEXAPOD, 'floor.drawing', '#', "floor: unknown key 'drawing'"),
    (HEXAPOD, 'tow.friction_dry', ..., "tow: key 'friction_dry' is missing"),
    (HEXAPOD, 'colour', 'red', "unknown key 'colour'"),
    (LEG, 'gait.swing', 0.0, 'gait: swing = 0.0 is not allowed: a number from 0.05 to 60 s'),
    (LEG, 'floor.wet_fraction', 0.4, "floor: unknown key 'wet_fraction'"),
]


@pytest.mark.parametrize('source, path, value, message', BAD, ids=[str(b[1:3]) for b in BAD])
def test_bad_scenes(tmp_path, source, path, value, message):
    file = written(tmp_path, source, (path, value))
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        Scene.load(file)
    assert str(caught.value).startswith(str(file))


def test_scene_by_path(tmp_path, monkeypatch):
    """A scene has the name of its file; a foot's path is relative to the scene's folder."""
    shutil.copy(configuration.shared_folder() / 'feet/large37.yaml', tmp_path / 'my_foot.yaml')
    file = written(tmp_path, HEXAPOD, ('foot', 'my_foot.yaml'))
    monkeypatch.chdir('/')
    scene = Scene.load(file)
    assert scene.name == 'mine' and scene.source == str(file)
    assert scene.foot.pads == 37
    assert pathlib.Path(scene.foot.source) == tmp_path / 'my_foot.yaml'


def test_bad_foot_by_path_names_both_files(tmp_path):
    (tmp_path / 'my_foot.yaml').write_text('pads: 3\n')
    file = written(tmp_path, HEXAPOD, ('foot', 'my_foot.yaml'))
    with pytest.raises(ConfigError, match=r"mine\.yaml: foot: .*my_foot\.yaml: key 'pad' is miss"):
        Scene.load(file)


def test_a_floor_can_be_drawn(tmp_path):
    floor = {'kind': 'drawn', 'cell': 0.5, 'drawing': '..##\n.#..\n', 'slope': 0.05}
    plan = Scene.load(written(tmp_path, HEXAPOD, ('floor', floor))).floor
    assert plan.drawing == ('..##', '.#..')
    assert plan.slope == 0.05
    built = plan.build(0)
    assert built.wet(1.0, 0.25) and built.wet(0.5, -0.25)
    assert not built.wet(0.5, 0.25) and not built.wet(1.0, -0.25)
