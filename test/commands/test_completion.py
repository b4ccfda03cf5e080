# SPDX-License-Identifier: Apache-2.0
"""Completions that shells receive, by argcomplete's protocol."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import sys

import pytest

from ros_pad import cli

pytest.importorskip('argcomplete')

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def offered(line, folder, module='ros_pad.cli'):
    """Return the completions of a line with the cursor at its end, by argcomplete's protocol."""
    answer = folder / '.answer'
    answer.unlink(missing_ok=True)
    environment = {
        **os.environ,
        'PYTHONPATH': str(ROOT),
        '_ARGCOMPLETE': '3' if line.startswith('python -m') else '1',
        '_ARGCOMPLETE_SHELL': 'bash',
        '_ARGCOMPLETE_IFS': '\n',
        '_ARGCOMPLETE_STDOUT_FILENAME': str(answer),
        'COMP_LINE': line,
        'COMP_POINT': str(len(line.encode())),
        'COMP_TYPE': '9',
        '_ARGCOMPLETE_SUPPRESS_SPACE': '1',
    }
    # argcomplete writes its debug output to descriptor 9.
    words = ['bash', '-c', 'exec "$0" -m "$1" 9>/dev/null', sys.executable, module]
    child = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    assert (child.returncode, child.stdout, child.stderr) == (0, '', '')
    return [word.strip() for word in answer.read_text().split('\n') if word]


def test_commands_options_files_and_shipped_names(tmp_path):
    (tmp_path / 'my_foot.yaml').touch()
    assert set(cli.COMMANDS) <= set(offered('pad ', tmp_path))
    assert offered('python -m ros_pad do', tmp_path, 'ros_pad') == ['doctor']
    assert offered('pad scenes --j', tmp_path) == ['--json']
    assert offered('pad run my_f', tmp_path) == ['my_foot.yaml']
    assert offered('pad contact --foot large1', tmp_path) == ['large19']
    assert offered('pad sweep leg_wet_dome_4', tmp_path) == ['leg_wet_dome_40']


def test_argcomplete_finds_its_mark_where_the_command_begins():
    """If argcomplete completes all commands, it looks for the mark in the program's module."""
    script = re.search(r"'pad = ([\w.]+):", (ROOT / 'setup.py').read_text()).group(1)
    words = [sys.executable, '-m', 'argcomplete._check_module', script]
    assert subprocess.run(words, cwd=ROOT, capture_output=True).returncode == 0
