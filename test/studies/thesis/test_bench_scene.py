# SPDX-License-Identifier: Apache-2.0
import copy
import dataclasses
import pathlib
import shutil

import pytest
import yaml

from ros_pad import configuration
from ros_pad.contact import Foot
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation import Scene
from studies.thesis.bench_scene import BenchScene

BENCHES = ('inflation', 'press', 'tangential', 'foot')

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
