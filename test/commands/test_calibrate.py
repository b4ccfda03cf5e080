# SPDX-License-Identifier: Apache-2.0
import json

import pytest

from ros_pad import cli, configuration
from ros_pad.contact import Foot

THESIS = str(configuration.shared_folder() / 'measurements' / 'thesis.csv')


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_every_other_command_takes_the_foot(here, capsys):
    assert cli.main(['calibrate', THESIS, '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['foot'] == 'thesis_foot.yaml'
    assert (here / found['figure']).stat().st_size > 20_000
    k = next(each for each in found['constants'] if each['name'] == 'stiffness')
    assert k['value'] == pytest.approx(40.32, abs=0.01)
    assert k['low'] < 40.0 < k['high']
    kept = next(each for each in found['constants'] if each['name'] == 'friction')
    assert (kept['fitted'], kept['low']) == (False, None)
    foot = found['foot']
    assert Foot.load(foot).pad.stiffness == pytest.approx(k['value'])
    assert cli.main(['contact', '--foot', foot, '--pressure', '80e3', '--json']) == 0
    limit = json.loads(capsys.readouterr().out)['force_limit_n']['measured']
    assert limit == pytest.approx(0.28333 + 5e3 * 1.25e-5, abs=1e-4)
    assert cli.main(['design', '--foot', foot, '--load', '5', '--json']) == 0
    capsys.readouterr()
    walk = ['run', 'hexapod_patches', '--no-ros', '--no-compare', '--cycles', '1', '--json']
    assert cli.main([*walk, '--foot', foot]) == 0
    assert json.loads(capsys.readouterr().out)['foot'] == foot


def test_the_table_and_the_residuals_are_printed(here, capsys):
    out = ['--out', 'own.yaml']
    assert cli.main(['calibrate', THESIS, '--foot', 'large19', *out]) == 0
    said = capsys.readouterr().out
    assert '36.89 to 44.07' in said
    assert 'free, 55000 Pa' in said
    assert '+9.2 %' in said
    assert 'note: one stiffness does not fit' in said
    assert (here / 'own.png').read_bytes().startswith(b'\x89PNG')
    # A file is only overwritten with --force.
    assert cli.main(['calibrate', THESIS, *out]) == 2
    assert 'own.yaml: exists already' in capsys.readouterr().err
    assert cli.main(['calibrate', THESIS, *out, '--force']) == 0


def test_a_material_has_a_factor(here, capsys):
    material = ['--material', 'dragon_skin_10', '--thickness', '0.4e-3']
    assert cli.main(['calibrate', THESIS, *material, '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['constants'][0]['name'] == 'factor'
    assert found['constants'][0]['value'] == pytest.approx(1.88, abs=0.005)
    assert Foot.load(found['foot']).pad.material.factor == pytest.approx(1.88, abs=0.005)
    assert (here / found['figure']).stat().st_size > 20_000


def test_no_foot_is_left_behind_when_its_picture_cannot_be_written(here, capsys):
    assert cli.main(['calibrate', THESIS, '--out', 'none/own.yaml']) == 1
    assert 'none' in capsys.readouterr().err
    (here / 'own.png').mkdir()
    assert cli.main(['calibrate', THESIS, '--out', 'own.yaml', '--force']) == 2
    assert [path.name for path in here.iterdir()] == ['own.png']
