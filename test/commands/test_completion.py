# SPDX-License-Identifier: Apache-2.0
"""Completions that shells receive, by argcomplete's protocol."""

from __future__ import annotations

import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

from ros_pad import cli

pytest.importorskip('argcomplete')

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def offered(
    line: str,
    folder: pathlib.Path,
    shell: str = 'bash',
    module: str = 'ros_pad.cli',
    words: int = 1,
) -> list[str]:
    """Return the completions of a line with the cursor at its end, by argcomplete's protocol.

    ``words`` is how many words of the line start the program, and ``module`` is that program.
    """
    answer = folder / '.answer'
    answer.unlink(missing_ok=True)
    environment = {
        **os.environ,
        'PYTHONPATH': str(ROOT),
        '_ARGCOMPLETE': str(words),
        '_ARGCOMPLETE_SHELL': shell,
        '_ARGCOMPLETE_IFS': '\n',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(answer),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line.encode())),
        'COMP_TYPE': '9',
        '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
    }
    # argcomplete writes its debug output to descriptor 9.
    child = subprocess.run(
        ['bash', '-c', 'exec "$0" -m "$1" 9>/dev/null', sys.executable, module],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (child.returncode, child.stdout, child.stderr) == (0, '', '')
    return [word.strip() for word in answer.read_text().split('\n') if word]


@pytest.fixture
def here(tmp_path: pathlib.Path) -> pathlib.Path:
    """Return a folder with two bags, an MCAP file, a foot, a robot, and an empty folder."""
    for name in ('runs/walk/bag', 'runs/walk_2/bag'):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / 'metadata.yaml').touch()
        (tmp_path / name / 'bag_0.mcap').touch()
    (tmp_path / 'runs' / 'lone.mcap').touch()
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'my_foot.yaml').touch()
    (tmp_path / 'my_robot.urdf').touch()
    return tmp_path


def test_commands(here: pathlib.Path):
    assert {'run', 'report', 'replay'} <= set(offered('pad r', here))
    assert set(cli.COMMANDS) <= set(offered('pad ', here))
    assert offered('pad doc', here) == ['doctor']
    assert f'doctor:{cli.COMMANDS["doctor"]}' in offered('pad doc', here, 'zsh')


@pytest.mark.slow
@pytest.mark.parametrize(
    ('line', 'expected'),
    [
        ('pad scenes --j', ['--json']),
        ('pad contact --pad ', ['large', 'small']),
        ('pad run my_f', ['my_foot.yaml']),
        ('pad doctor --robot my_r', ['my_robot.urdf']),
        ('pad contact --foot large1', ['large19']),
        ('pad design --material dragon_skin_3', ['dragon_skin_30']),
        ('pad sweep leg_wet_dome_4', ['leg_wet_dome_40']),
        ('pad bag ', ['info', 'repair']),
        ('pad bag info runs/walk_', ['runs/walk_2/']),
    ],
)
def test_arguments(line: str, expected: list[str], here: pathlib.Path):
    found = offered(line, here)
    if line.endswith(' '):  # options are offered, too
        found = [word for word in found if not word.startswith('--')]
    assert sorted(found) == expected


def test_argcomplete_finds_its_mark_where_the_command_begins():
    """If argcomplete completes all commands, it looks for the mark in the program's module."""
    script = re.search(r"'pad = ([\w.]+):", (ROOT / 'setup.py').read_text()).group(1)
    for module in (script, 'ros_pad'):
        child = subprocess.run(
            [sys.executable, '-m', 'argcomplete._check_module', module],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert child.returncode == 0, child.stderr


def test_python_m_is_completed(tmp_path: pathlib.Path):
    line = {'folder': tmp_path, 'module': 'ros_pad', 'words': 3}
    assert offered('python -m ros_pad do', **line) == ['doctor']
    assert '--json' in offered('python -m ros_pad doctor --', **line)


def test_what_no_shell_asks_for_does_not_import_argcomplete():
    code = 'import sys; from ros_pad import cli; cli.parser(); print(sorted(sys.modules))'
    child = subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    modules = json.loads(child.stdout.replace("'", '"'))
    # Importing these takes time: a second, with all of the commands.
    assert not {'argcomplete', 'numpy', 'scipy', 'matplotlib', 'mcap'} & set(modules)
    assert 'ros_pad.commands.command' in modules
