# SPDX-License-Identifier: Apache-2.0
"""Each fault that ``pad doctor`` checks for is produced, and must be found with its remedy."""

from __future__ import annotations

import errno
import json
import os
import pathlib
import re
import shutil
import sys
from types import SimpleNamespace
from typing import NamedTuple

import pytest

from ros_pad import cli, configuration
from ros_pad.commands import doctor
from ros_pad.commands.doctor import Finding

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


class Usage(NamedTuple):
    """Result of shutil.disk_usage, bytes."""

    total: float
    used: float
    free: float


def one(findings):
    (finding,) = findings
    return finding


def test_a_missing_package_is_named_and_the_doctor_goes_on(tmp_path, monkeypatch, capsys):
    (tmp_path / 'numpy.py').write_text('raise ModuleNotFoundError("No module named \'numpy\'")')
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ('extras', 'ros', 'config_folder'):
        monkeypatch.setattr(doctor, name, lambda: iter(()))
    assert cli.main(['doctor', '--json']) == 1
    found = {each['what']: each for each in json.loads(capsys.readouterr().out)['findings']}
    assert (found['Python']['status'], found['packages']['status']) == ('ok', 'problem')
    assert 'numpy (ModuleNotFoundError' in found['packages']['found']
    assert 'pip install' in found['packages']['advice']
    assert found['logs']['status'] == 'ok'  # the last check still runs


def test_extras_that_cannot_be_imported_say_why(tmp_path, monkeypatch):
    modules = {
        'broken_pad': 'raise OSError("libGL.so.1: cannot open")',
        'crashing_pad': 'import os; os.abort()',
        'whole_pad': '',
    }
    for name, code in modules.items():
        (tmp_path / f'{name}.py').write_text(code)
        monkeypatch.setitem(doctor.EXTRAS, name, ('mesh', 'nothing'))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(doctor.EXTRAS, 'absent_pad', ('mesh', 'nothing'))
    broken, crashing, whole, absent = doctor.extras([*modules, 'absent_pad'])
    assert (broken.status, crashing.status, absent.status) == ('warning',) * 3
    assert 'OSError: libGL.so.1: cannot open' in broken.found
    assert 'ends with status -6' in crashing.found
    assert "No module named 'absent_pad'" in absent.found and 'ros_pad[mesh]' in absent.advice
    assert (whole.status, whole.found) == ('ok', 'nothing')


def test_the_extras_are_those_of_setup():
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    for name, (extra, _) in doctor.EXTRAS.items():
        assert re.search(rf"'{extra}': (\[|DOCS,)", text) and f"'{name}>=" in text


def test_config_folder(monkeypatch, tmp_path):
    assert f'{len(configuration.names("scenes"))} scenes' in one(doctor.config_folder()).found
    monkeypatch.setattr('ros_pad.configuration.__file__', str(tmp_path / 'a' / 'b.py'))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    finding = one(doctor.tried(doctor.config_folder))
    assert (finding.what, finding.status) == ('config folder', 'problem')
    assert str(tmp_path) in finding.found


def test_without_ros_it_lists_what_still_works(tmp_path, monkeypatch):
    (tmp_path / 'rclpy.py').write_text('raise ModuleNotFoundError("No module named \'rclpy\'")')
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(doctor, 'ros_sources', dict)
    finding = one(doctor.ros())
    assert finding.status == 'warning'
    assert '--no-ros' in finding.found
    assert 'ros_pad[ros]' in finding.advice or '/opt/ros' in finding.advice


def test_wheels_that_cannot_be_loaded_are_a_problem(tmp_path, monkeypatch):
    (tmp_path / 'rclpy.py').write_text('raise ImportError("librcl.so: cannot open")')
    monkeypatch.syspath_prepend(str(tmp_path))
    finding = one(doctor.ros())
    assert finding.status == 'problem'
    assert 'librcl.so' in finding.found and 'one ROS 2 at a time' in finding.advice
    (tmp_path / 'rclpy.py').write_text('import os; os.abort()')
    assert one(doctor.ros()).status == 'problem'


PREFIX = {'AMENT_PREFIX_PATH': '/opt/ros/jazzy'}


@pytest.mark.parametrize(
    ('wheels', 'environment', 'status'),
    [
        ('jazzy', {}, 'ok'),
        ('kilted', {}, 'warning'),
        ('jazzy', PREFIX, 'problem'),
        (None, {'ROS_DISTRO': 'jazzy', **PREFIX}, 'ok'),
        (None, {'ROS_DISTRO': 'rolling'}, 'warning'),
    ],
)
def test_which_ros_it_is(wheels, environment, status, monkeypatch):
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH', 'ROS_DISTRO'):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    names = ['numpy', *([f'ros-{wheels}-rclpy'] if wheels else [])]
    installed = [SimpleNamespace(metadata={'Name': name}) for name in names]
    monkeypatch.setattr('importlib.metadata.distributions', lambda: installed)
    finding = doctor.which_ros('/somewhere/rclpy/__init__.py', doctor.ros_sources())
    assert finding.status == status
    assert ('one ROS 2 at a time' in finding.advice) == (status == 'problem')


def test_a_middleware_that_is_not_installed_is_a_problem(monkeypatch):
    pytest.importorskip('rclpy')
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_of_no_one')
    *_, finding = doctor.ros()
    assert finding.status == 'problem'
    assert 'unset RMW_IMPLEMENTATION' in finding.advice


@pytest.fixture
def alone(monkeypatch):
    """Let no messages from other processes in, and return ``monkeypatch``."""
    pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    for name in ('ROS_LOCALHOST_ONLY', 'RMW_IMPLEMENTATION'):
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


def test_a_message_goes_round(alone):
    finding = doctor.loopback(30.0)  # a machine under test may be slow
    assert finding.status == 'ok', finding


def test_processes_that_are_kept_apart_are_a_problem(alone):
    alone.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    finding = doctor.loopback(1.0)
    assert finding.status == 'problem' and 'within 1 s' in finding.found
    assert 'ROS_AUTOMATIC_DISCOVERY_RANGE' in finding.advice


def test_serial_ports(tmp_path, monkeypatch):
    port = tmp_path / 'ttyUSB0'
    port.touch()
    assert one(doctor.serial_ports([])).found == 'none is plugged in'
    assert one(doctor.serial_ports([str(port)])).status == 'ok'
    monkeypatch.setattr(os, 'access', lambda *_: False)
    finding = one(doctor.serial_ports([str(port)]))
    assert finding.status == 'warning'
    assert finding.advice.startswith('sudo usermod -aG dialout $USER')


@pytest.mark.parametrize(
    ('free', 'status'), [(5e9, 'ok'), (0.5e9, 'warning'), (0.05e9, 'problem')]
)
def test_room_for_bags(free, status, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: Usage(1e12, 1e12 - free, free))
    runs, _ = doctor.folders(tmp_path)
    assert (runs.what, runs.status) == ('runs/', status)
    assert list(tmp_path.iterdir()) == []  # nothing is left behind


def test_folders_that_cannot_be_written(tmp_path, monkeypatch):
    (tmp_path / 'file').touch()
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'file' / 'log'))
    runs, logs = doctor.folders(tmp_path)
    assert (runs.status, logs.status) == ('ok', 'problem')
    assert 'export ROS_LOG_DIR' in logs.advice

    def full(**_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr('tempfile.TemporaryFile', full)
    runs, _ = doctor.folders(tmp_path)
    assert runs.status == 'problem' and 'Read-only file system' in runs.found


def test_the_command_prints_all_and_fails_on_a_problem_alone(monkeypatch, capsys):
    found = [
        Finding('Python', 'ok', '3.12'),
        Finding('mujoco', 'warning', 'not here', 'pip install "ros_pad[mujoco]"'),
    ]
    monkeypatch.setattr(doctor, 'examine', lambda *_: iter(found))
    assert cli.main(['doctor']) == 0
    shown = capsys.readouterr().out
    assert re.match(r'ok +Python: 3.12\nwarning +mujoco: not here\n', shown)
    assert '-> pip install "ros_pad[mujoco]"' in shown
    assert 'problems: 0, warnings: 1' in shown
    found.append(Finding('logs', 'problem', 'full', 'make room'))
    assert cli.main(['doctor', '--json']) == 1
    values = json.loads(capsys.readouterr().out)
    assert (values['problems'], values['warnings'], len(values['findings'])) == (1, 1, 3)
