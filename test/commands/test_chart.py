# SPDX-License-Identifier: Apache-2.0
"""``pad chart``, ``pad report --thesis`` and ``pad run bench_*`` run programs in studies/."""

import json
import os
import pathlib
import shutil
import subprocess

import pytest
from shared import python

from ros_pad import cli
from ros_pad.commands import study
from ros_pad.commands.chart import CHARTS
from studies.__main__ import STUDIES

PACKAGE = pathlib.Path(cli.__file__).resolve().parent


@pytest.fixture
def runs(monkeypatch):
    """Collect the arguments of each study instead of running it; each exits with status 0."""
    found = []

    def run(command, **_):
        assert command[1:3] == ['-m', 'studies']
        found.append(command[3:])
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(study.subprocess, 'run', run)
    return found


def test_charts_are_studies(runs, tmp_path):
    assert set(CHARTS) <= set(STUDIES)
    assert cli.main(['chart', 'walk', '--out', str(tmp_path), '--json']) == 0
    assert runs == [['walk', '--out', str(tmp_path), '--json']]


def test_the_page_of_the_thesis_is_a_study(runs):
    assert cli.main(['report', '--thesis', '--out', 'page.html']) == 0
    assert runs == [['thesis', '--out', 'page.html']]


@pytest.mark.parametrize('words', [['--thesis', 'bag'], [], ['nowhere']], ids=' '.join)
def test_a_report_of_nothing_is_refused(words, runs, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(['report', *words]) == 2
    assert all(word in capsys.readouterr().err for word in words[:1])
    assert runs == list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('words', [['--seed', '1'], ['--live']], ids=' '.join)
def test_a_bench_scene_refuses_options_of_a_walk(words, runs, capsys):
    assert cli.main(['run', 'bench_press', *words]) == 2
    assert f'{words[0]} is not allowed: bench_press' in capsys.readouterr().err
    assert runs == []


@pytest.mark.slow
def test_a_bench_scene_runs_in_a_checkout(tmp_path):
    out = tmp_path / 'out'
    words = ['run', 'bench_inflation', '--json', '--out', str(out)]
    found = python('-m', 'ros_pad', *words, cwd=tmp_path)
    assert found.returncode == 0, found.stderr
    assert json.loads(found.stdout)['scene'] == 'bench_inflation'
    assert (out / 'report.html').is_file()


def test_without_a_checkout_it_is_written_where_studies_are(tmp_path):
    """The package is copied to a folder without studies."""
    shutil.copytree(PACKAGE, tmp_path / 'ros_pad', ignore=shutil.ignore_patterns('__pycache__'))
    shutil.copytree(PACKAGE.parent / 'config', tmp_path / 'config')
    alone = os.environ | {'PYTHONPATH': str(tmp_path)}
    found = python('-m', 'ros_pad', 'chart', 'contact', cwd=tmp_path, env=alone)
    assert found.returncode == 1
    assert 'Clone ros_pad' in found.stderr
    assert not (tmp_path / 'runs').exists()
