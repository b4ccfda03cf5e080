# SPDX-License-Identifier: Apache-2.0
"""Quick commands of the tutorials print what the pages show; test_docs.py checks links."""

import json
import os
import pathlib
import re
import shlex
import subprocess

import pytest
import yaml
from shared import python

from ros_pad import cli, configuration
from ros_pad.regulators import emulate
from ros_pad.robots import Robot
from ros_pad.sensing import Mapping

ROOT = pathlib.Path(__file__).resolve().parent.parent
TUTORIALS = ROOT / 'docs' / 'tutorials'


def blocks(page, kind=''):
    """Return the fenced blocks of a kind on a page."""
    text = page.read_text(encoding='utf-8')
    fenced = re.findall(r'^```(\w*)\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    return [block for each, block in fenced if each == kind]


def commands(page):
    """Return the words of every ``pad`` command on a page."""
    lines = '\n'.join(blocks(page)).replace('\\\n', ' ').splitlines()
    # `pad of my_foot.yaml, ...` is output of a command.
    return [shlex.split(line, comments=True) for line in lines if re.match('pad (?!of )', line)]


def shown(said, page, first):
    """Assert that lines of the block that starts with ``first`` are in the output; lines may end
    in dots."""
    (block,) = (each for each in blocks(page) if each.startswith(first))
    lines = [line.rstrip() for line in said.splitlines()]
    for line in block.splitlines():
        beginning = line.removesuffix('...').rstrip()
        assert any(each.startswith(beginning) for each in lines), line


def test_first_walk(tmp_path, monkeypatch, capsys):
    page = TUTORIALS / 'first_walk.md'
    monkeypatch.chdir(tmp_path)
    words = next(words for words in commands(page) if words[1] == 'run')
    assert '--no-ros' in words
    assert cli.main(words[1:]) == 0
    shown(capsys.readouterr().out, page, 'leg_wet_dome_75')


def test_replay(monkeypatch, capsys):
    page = TUTORIALS / 'replay.md'
    monkeypatch.chdir(ROOT)
    assert cli.main(commands(page)[0][1:]) == 0
    said = capsys.readouterr().out.splitlines()
    (block,) = (each for each in blocks(page) if each.startswith('bags/hexapod_patches/bag: '))
    # Numbers that other processors do not round otherwise.
    exact = [line for line in block.splitlines() if re.match(r'\d|bags|leg_.*doubt', line)]
    assert len(exact) == 4 and set(exact) <= set(said)


def test_own_foot(tmp_path, monkeypatch, capsys):
    page = TUTORIALS / 'own_foot.md'
    monkeypatch.chdir(tmp_path)
    (table,) = (each for each in blocks(page) if 'pressure [kPa]' in each)
    (tmp_path / 'my_pads.csv').write_text(table, encoding='utf-8')
    by_name = {words[1]: words[1:] for words in commands(page)}
    firsts = {'mould': 'part', 'calibrate': 'constant', 'contact': 'pad of', 'design': '6.8 N'}
    for name, first in firsts.items():
        assert cli.main(by_name[name]) == 0
        shown(capsys.readouterr().out, page, first)
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {'my_pads.csv', 'my_foot.yaml', 'my_foot.png', 'design.png', 'my_moulds'}


def test_own_robot(tmp_path, monkeypatch, capsys):
    pytest.importorskip('mujoco')
    page = TUTORIALS / 'own_robot.md'
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('COLUMNS', '98')
    (tmp_path / 'bags').symlink_to(ROOT / 'bags')
    loading, estimating = blocks(page, 'python')
    scene, mapping = blocks(page, 'yaml')
    (tmp_path / 'my_scene.yaml').write_text(scene, encoding='utf-8')
    (tmp_path / 'my_mapping.yaml').write_text(mapping, encoding='utf-8')
    names = {}
    exec(compile(loading, str(page), 'exec'), names)
    shown(capsys.readouterr().out, page, '15.02 kg')
    (words,) = (words[1:] for words in commands(page) if words[1] == 'run')
    assert cli.main([*words, '--no-ros']) == 0
    shown(capsys.readouterr().out, page, 'my_scene, seed 0')
    assert 'pad run my_scene.yaml' in next(tmp_path.glob('runs/*/report.html')).read_text('utf-8')
    (words,) = (words[1:] for words in commands(page) if words[1] == 'doctor')
    assert cli.main(words) == 1
    shown(capsys.readouterr().out, page, 'ok       robot')
    assert cli.main([*words, '--mapping', 'my_mapping.yaml']) == 0
    shown(capsys.readouterr().out, page, 'ok       sensors')
    exec(compile(estimating, str(page), 'exec'), names)
    distance, doubts = capsys.readouterr().out.strip().split(' m ')
    # The simulation's true distance, from the log of which the bag was made.
    assert float(distance) == pytest.approx(1.564, rel=0.03)
    assert doubts == "['']"


def test_refusals_of_own_robots(tmp_path, capsys):
    """What the table on the page says; its third row changes the URDF."""
    pytest.importorskip('mujoco')
    page = TUTORIALS / 'own_robot.md'
    scene = yaml.safe_load(blocks(page, 'yaml')[0]) | {'robot': 'robot.urdf'}
    urdf = (ROOT / 'bags' / 'quadruped' / 'robot.urdf').read_text('utf-8')
    rows = re.findall(r'^\| `(.*?)`.* \| `(.*)` \|$', page.read_text('utf-8'), re.MULTILINE)
    assert len(rows) == 4
    for written, read in rows:
        changes = {} if '=' in written else yaml.safe_load(written)
        odd = re.sub('effort="40"', written, urdf) if '=' in written else urdf
        (tmp_path / 'robot.urdf').write_text(odd)
        (tmp_path / 'mine.yaml').write_text(yaml.safe_dump(scene | changes))
        assert cli.main(['run', str(tmp_path / 'mine.yaml'), '--no-ros']) != 0
        assert read in capsys.readouterr().err


def test_the_example_of_a_mapping(tmp_path):
    page = ROOT / 'docs' / 'mappings.md'
    (text,) = blocks(page, 'yaml')
    (tmp_path / 'my.yaml').write_text(text, encoding='utf-8')
    robot = Robot.load('go2')
    mapping = Mapping.load(tmp_path / 'my.yaml', robot)
    assert [source.topic for source in mapping.sources][2:] == [
        f'leg_{leg}/foot_wrench' for leg in (1, 2, 3, 4)
    ]
    assert (mapping.force_axes, mapping.missing[0][:15]) == ('foot', 'force: sensors ')
    table = page.read_text(encoding='utf-8')
    for name in configuration.names('mappings'):
        assert f'| `{name}` |' in table


def test_own_regulator(tmp_path):
    page = TUTORIALS / 'own_regulator.md'
    (program,) = blocks(page, 'python')
    (settings,) = blocks(page, 'yaml')
    port = tmp_path / 'regulators'
    words = next(words for words in commands(page) if words[1] == 'emulate')
    options = cli.parser('emulate').parse_args(words[1:])
    device = emulate.EMULATORS[options.device](unit_ids=options.unit_ids, schedule=options.fault)
    script = tmp_path / 'try_it.py'
    script.write_text(program.replace(options.link, str(port)))
    with emulate.Emulator(device, str(port)):
        child = python(script, env=os.environ | {'PYTHONPATH': str(ROOT)})
    assert child.returncode == 0, child.stderr
    (expected,) = (each for each in blocks(page) if each.startswith('Reading('))
    assert child.stdout.partition(', time=')[0] == expected.partition(', time=')[0]
    given = yaml.safe_load(settings)['/**/regulator']['ros__parameters']
    assert given['backend_options']['port'] == options.link
    assert ''.join(given['backend_options']['unit_id']) == options.unit_ids


def test_a_layout_for_a_namespace():
    page = ROOT / 'docs' / 'foxglove.md'
    (line,) = (each for each in '\n'.join(blocks(page)).splitlines() if each.startswith('sed '))
    words = ['sh', '-c', line.partition('>')[0]]
    made = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    layout = json.loads(made)['configById']
    paths = [path['value'] for each in layout.values() for path in each.get('paths', [])]
    paths += layout['3D!walk']['topics']
    assert len(paths) > 40
    assert all(path.startswith('/robot_1/') for path in paths)
