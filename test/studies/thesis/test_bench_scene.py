# SPDX-License-Identifier: Apache-2.0
import copy
import dataclasses
import pathlib
import re
import shutil

import pytest
import yaml

from ros_pad import configuration
from ros_pad.contact import Foot
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation import Scene
from studies.thesis import bench_scene as bench
from studies.thesis.bench_scene import BENCHES, BenchScene

FOLDER = configuration.shared_folder() / 'scenes'
FILES = {kind: yaml.safe_load((FOLDER / f'bench_{kind}.yaml').read_text()) for kind in BENCHES}


def written(folder, kind, *changes):
    """Write a bench scene with changes (path of keys, value); the value ... removes the key."""
    values = copy.deepcopy(FILES[kind])
    for path, value in changes:
        *parts, last = path.split('.')
        table = values
        for part in parts:
            table = table[part]
        if value is ...:
            del table[last]
        else:
            table[last] = value
    file = folder / 'mine.yaml'
    file.write_text(yaml.safe_dump(values))
    return file


@pytest.mark.parametrize('kind', BENCHES)
def test_shipped_scenes(kind):
    scene = BenchScene.load(f'bench_{kind}')
    assert scene.source == scene.name == f'bench_{kind}'
    assert scene.setup.kind == kind
    assert scene.description
    assert scene.measurements.is_file()
    assert (scene.pad.radius, scene.pad.stiffness) == (1.5e-3, 40.0)


def test_values_come_where_they_belong():
    assert BenchScene.load('bench_inflation').setup.claimed_error == 0.03
    press = BenchScene.load('bench_press').setup
    assert press.pressure == 75e3 and press.text_forces == (0.1, 0.2, 0.3)
    drag = BenchScene.load('bench_tangential').setup
    assert (drag.speed, drag.dwell, drag.highest_load) == (2e-4, 1.0, 0.4)
    assert (drag.film_thickness, drag.viscosity) == (3e-4, 1e-3)
    assert (drag.advancing_angle, drag.receding_angle) == (2.0944, 1.5708)
    assert (drag.claimed_smallest, drag.claimed_largest) == (3e-4, 8e-4)
    foot = BenchScene.load('bench_foot')
    assert (foot.setup.pressure, foot.setup.speed, foot.setup.roughness) == (50e3, 2e-4, 2e-6)
    assert (foot.setup.claimed_lowest, foot.setup.claimed_highest) == (0.15, 0.25)
    assert foot.foot.limit == 'flattening' and foot.foot.pads == 19


def test_the_dragged_foot_has_one_pad_and_all_of_its_sole():
    whole = Foot.load('large19')
    one = BenchScene.load('bench_tangential').foot
    assert one.pads == 1 and one.sole_radius == whole.sole_radius
    assert one.shear_stiffness == pytest.approx(5000.0 / 19.0)
    assert one.friction == whole.friction


def test_a_walk_is_no_bench_and_a_bench_is_no_walk():
    with pytest.raises(ConfigError, match=r'hexapod_patches\.yaml: is no bench'):
        BenchScene.load('hexapod_patches')
    with pytest.raises(ConfigError, match=r'is a bench scene, .*: .*pad run bench_p'):
        Scene.load('bench_press')


@pytest.mark.parametrize('name', configuration.names('scenes'))
def test_every_scene_is_of_one_kind(name):
    scene = bench.load(name)
    assert isinstance(scene, BenchScene if name.startswith('bench_') else Scene)
    assert scene.name == name and scene.description


BAD = [
    ('inflation', 'bench', 'drag', "bench = 'drag' is not allowed: one of inflation, press, tang"),
    ('inflation', 'highest_pressure', 160e3, 'highest_pressure = 160000.0 is not allowed: a numb'),
    ('inflation', 'claimed_error', -0.1, 'claimed_error = -0.1 is not allowed'),
    ('inflation', 'pressure', 75e3, "unknown key 'pressure'"),
    ('inflation', 'measurements', 'thesys', "measurements = 'thesys': there is no file"),
    ('inflation', 'foot', 'large91', "foot: no foot named 'large91'"),
    ('press', 'pressure', 91.4e3, 'pressure = 91400.0 is not allowed: a number from 1000 to 913'),
    ('press', 'highest_force', 0.54, 'highest_force = 0.54 is not allowed'),
    ('press', 'text_forces.second', ..., "text_forces: key 'second' is missing"),
    ('press', 'text_forces.fourth', 0.4, "text_forces: unknown key 'fourth'"),
    ('tangential', 'speed', 0.0, 'speed = 0.0 is not allowed'),
    ('tangential', 'dwell', ..., "key 'dwell' is missing"),
    ('tangential', 'floor.receding_angle', 2.2, 'floor: receding_angle = 2.2 is not allowed'),
    ('tangential', 'floor.kind', 'wet', "floor: unknown key 'kind'"),
    ('tangential', 'design.largest_radius', 1e-4, 'design: largest_radius = 0.0001 is not allo'),
    ('tangential', 'design.claimed_largest', 1e-2, 'design: claimed_largest = 0.01 is not allow'),
    ('foot', 'criterion', 'measured', "criterion = 'measured': domes of 50000 Pa carry nothing"),
    ('foot', 'criterion', 'highest', "criterion = 'highest' is not allowed: one of"),
    ('foot', 'highest_load', 3.4, 'highest_load = 3.4 is not allowed: a number from 0.001 to 3.3'),
    ('foot', 'lowest_load', 1.6, 'lowest_load = 1.6 is not allowed: a number from 0.0001 to 1.5'),
    ('foot', 'pressure', 91e3, 'pressure = 91000.0 is not allowed'),
    ('foot', 'doubt.samples', 3, 'doubt: samples = 3 is not allowed'),
    ('foot', 'doubt.factor', 0.5, 'doubt: factor = 0.5 is not allowed'),
    ('foot', 'floor.roughness', -1e-6, 'floor: roughness = -1e-06 is not allowed'),
    ('foot', 'claimed_highest', 0.1, 'claimed_highest = 0.1 is not allowed'),
]


@pytest.mark.parametrize('kind, path, value, message', BAD, ids=[str(b[1:3]) for b in BAD])
def test_bad_scenes(tmp_path, kind, path, value, message):
    file = written(tmp_path, kind, (path, value))
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        BenchScene.load(file)
    assert str(caught.value).startswith(str(file))


def test_the_pressure_ends_where_the_model_of_the_pad_does(tmp_path):
    """The model ends at 3.426 k/r less adhesion, 91.34 kPa; BAD has a pressure above it."""
    file = written(tmp_path, 'press', ('pressure', 91.3e3))
    assert BenchScene.load(file).setup.pressure == 91.3e3


def test_text_forces_may_be_missing(tmp_path):
    assert (
        BenchScene.load(written(tmp_path, 'press', ('text_forces', ...))).setup.text_forces == ()
    )


def test_files_of_ones_own_lie_beside_the_scene(tmp_path, monkeypatch):
    shared = configuration.shared_folder()
    shutil.copy(shared / 'measurements' / 'thesis.csv', tmp_path / 'mine.csv')
    shutil.copy(shared / 'feet' / 'large37.yaml', tmp_path / 'my_foot.yaml')
    file = written(tmp_path, 'press', ('measurements', 'mine.csv'), ('foot', 'my_foot.yaml'))
    monkeypatch.chdir('/')
    scene = BenchScene.load(file)
    assert scene.name == 'mine'
    assert scene.measurements == tmp_path / 'mine.csv'
    assert pathlib.Path(scene.foot.source) == tmp_path / 'my_foot.yaml'


def test_benches_of_the_thesis_law_refuse_a_material():
    for name in ('inflation', 'press', 'foot'):
        with pytest.raises(InvalidInput, match=f'the bench {name} needs a pad with a measured'):
            BenchScene.load(f'bench_{name}', Foot.load('small217'))


def test_the_bench_of_a_foot_refuses_a_capillary_force():
    foot = dataclasses.replace(Foot.load('large19'), capillary_force=2e-5)
    with pytest.raises(ConfigError, match=r'capillary_force = 2e-05 N is not allowed: 0 is'):
        BenchScene.load('bench_foot', foot)


def test_another_foot_in_place_of_the_scenes_own():
    foot = Foot.load('large37')
    assert BenchScene.load('bench_press', foot).foot == foot
    assert BenchScene.load('bench_tangential', foot).foot.sole_radius == foot.sole_radius
    assert BenchScene.load('bench_tangential', foot).foot.pads == 1
