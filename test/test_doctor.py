# SPDX-License-Identifier: Apache-2.0
"""Each fault that the doctor knows is made, and must be found with what to do."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import pathlib
import shutil
import subprocess
import sys
from typing import Any
from typing import NamedTuple

import pytest

from ros_pad import cli
from ros_pad import doctor
from ros_pad.doctor import Finding

ROOT = pathlib.Path(__file__).resolve().parent.parent


class Usage(NamedTuple):
    """As shutil.disk_usage has it, bytes."""

    total: float
    used: float
    free: float


def one(findings: Any) -> Finding:
    (finding,) = findings
    return finding


@pytest.mark.parametrize(
    ('version', 'status'),
    [((3, 10, 4), 'problem'), ((3, 11, 0), 'ok'), ((3, 13, 9), 'ok'), ((3, 14, 0), 'warning')],
)
def test_python(version: tuple[int, ...], status: str):
    assert one(doctor.python(version)).status == status


# A child without some modules, as on a machine where they are not installed.
WITHOUT = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {missing}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Missing())
from ros_pad import cli
sys.exit(cli.main(['doctor', '--json']))
"""


def findings_of(code: str, **environment: str) -> tuple[int, dict[str, dict[str, str]]]:
    child = subprocess.run(
        [sys.executable, '-c', code],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    said = json.loads(child.stdout)
    found = {each['what']: each for each in said['findings']}
    assert said['problems'] == sum(each['status'] == 'problem' for each in found.values())
    return child.returncode, found


@pytest.mark.parametrize('missing', ['numpy', 'yaml', 'tqdm'])
def test_a_missing_package_is_named_and_the_doctor_goes_on(missing: str, tmp_path: pathlib.Path):
    # No ROS beside it: that is looked for in a child, which would find it.
    status, found = findings_of(
        WITHOUT.format(missing={missing}), RMW_IMPLEMENTATION='rmw_of_no_one'
    )
    assert status == 1
    assert found['packages']['status'] == 'problem'
    said = found['packages']['found']
    assert said.startswith(f'not installed: {missing}') or f', {missing}' in said
    assert 'pip install' in found['packages']['advice']
    assert found['terminal']['status'] == 'ok'  # the last one


def test_a_broken_package_is_told_from_a_missing_one(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / 'broken_pad.py').write_text('raise OSError("libgfortran.so.5")')
    (tmp_path / 'half_pad.py').write_text('import not_there_pad')
    monkeypatch.syspath_prepend(str(tmp_path))
    finding = one(doctor.packages(['json', 'nowhere_pad', 'half_pad', 'broken_pad']))
    assert finding.status == 'problem'
    assert finding.found == (
        'not installed: nowhere_pad, half_pad (for want of not_there_pad);'
        ' broken_pad: OSError: libgfortran.so.5'
    )


def test_missing_extras_say_how_to_install_them(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr('importlib.util.find_spec', lambda name: None)
    found = list(doctor.extras())
    assert {each.status for each in found} == {'warning'}
    pip = {each.what: each.advice for each in found}
    for name, extra in (('mujoco', 'mujoco'), ('numba', 'fast'), ('pyarrow', 'sweep')):
        assert f'pip install "ros_pad[{extra}]"' in pip[name]


def test_extras_that_cannot_be_imported_say_why(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    modules = {
        'broken_pad': 'raise OSError("libGL.so.1: cannot open")',
        'half_pad': 'import not_there_pad',
        'crashing_pad': 'import os; os.abort()',
        'whole_pad': '',
    }
    for name, code in modules.items():
        (tmp_path / f'{name}.py').write_text(code)
        monkeypatch.setitem(doctor.EXTRAS, name, ('mesh', 'nothing'))
    monkeypatch.syspath_prepend(str(tmp_path))
    broken, half, crashing, whole = doctor.extras(list(modules))
    assert (broken.status, half.status, crashing.status) == ('warning',) * 3
    assert broken.found == (
        'import broken_pad ends with status 1: OSError: libGL.so.1: cannot open; nothing'
    )
    assert "ModuleNotFoundError: No module named 'not_there_pad'" in half.found
    assert 'ends with status -6' in crashing.found
    assert 'pip install --force-reinstall half_pad' in half.advice
    assert (whole.status, whole.found) == ('ok', 'nothing')


def test_an_extra_that_hangs_is_not_waited_for(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / 'slow_pad.py').write_text('import time; time.sleep(3600)')
    monkeypatch.setitem(doctor.EXTRAS, 'slow_pad', ('mesh', 'nothing'))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(doctor, 'STARTING', 0.5)
    finding = one(doctor.extras(['slow_pad']))
    assert finding.status == 'warning'
    assert finding.found.startswith('import slow_pad did not end within 0.5 s')


def test_extras_are_imported_side_by_side(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch):
    # Each ends when the other one has begun.
    code = """
import pathlib, time
(pathlib.Path(__file__).parent / {own!r}).touch()
while not (pathlib.Path(__file__).parent / {other!r}).exists():
    time.sleep(0.005)
"""
    for own, other in (('left_pad', 'right_pad'), ('right_pad', 'left_pad')):
        (tmp_path / f'{own}.py').write_text(code.format(own=own, other=other))
        monkeypatch.setitem(doctor.EXTRAS, own, ('mesh', 'nothing'))
    monkeypatch.syspath_prepend(str(tmp_path))
    assert [each.status for each in doctor.extras(['left_pad', 'right_pad'])] == ['ok', 'ok']


def test_the_extras_are_those_of_setup():
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    for name, (extra, _) in doctor.EXTRAS.items():
        assert f"'{extra}': [" in text and f"'{name}>=" in text


def test_config_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: pathlib.Path):
    assert '15 scenes' in one(doctor.configuration()).found
    monkeypatch.setattr('ros_pad.configuration.__file__', str(tmp_path / 'a' / 'b.py'))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path))
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    finding = one(doctor.configuration())
    assert (finding.status, str(tmp_path) in finding.found) == ('problem', True)
    assert 'setup.bash' in finding.advice


def test_without_ros_it_says_what_still_works(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / 'rclpy.py').write_text('raise ModuleNotFoundError("No module named \'rclpy\'")')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    monkeypatch.setattr(doctor, '_wheels', lambda: None)
    finding = one(doctor.ros())
    assert finding.status == 'warning'
    assert '--no-ros' in finding.found
    assert 'ros_pad[ros]' in finding.advice or '/opt/ros' in finding.advice


def test_wheels_that_cannot_be_loaded_are_a_problem(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / 'rclpy.py').write_text('raise ImportError("librcl.so: cannot open")')
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    finding = one(doctor.ros())
    assert finding.status == 'problem'
    assert 'librcl.so' in finding.found and 'one ROS 2 at a time' in finding.advice
    (tmp_path / 'rclpy.py').write_text('import os; os.abort()')
    assert one(doctor.ros()).status == 'problem'


def test_missing_messages_are_named(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / 'rclpy.py').write_text('def get_rmw_implementation_identifier(): return "rmw"')
    for name in doctor.MESSAGES:
        (tmp_path / name).mkdir()
        for part in ('__init__', 'msg', 'srv'):
            (tmp_path / name / f'{part}.py').touch()
    shutil.rmtree(tmp_path / 'std_srvs')
    (tmp_path / 'std_srvs.py').touch()
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    found = list(doctor.ros())
    assert (found[-1].what, found[-1].status) == ('messages', 'problem')
    assert 'std_srvs' in found[-1].found and 'std_msgs' not in found[-1].found


VENV = '/home/somebody/.venv'
WHEEL = f'{VENV}/lib/python3.12/site-packages/rclpy/__init__.py'
APT = '/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/__init__.py'


@pytest.mark.parametrize(
    ('path', 'wheels', 'environment', 'status'),
    [
        (WHEEL, 'jazzy', {}, 'ok'),
        (WHEEL, 'kilted', {}, 'warning'),
        (WHEEL, 'jazzy', {'AMENT_PREFIX_PATH': '/opt/ros/jazzy'}, 'problem'),
        (WHEEL, 'jazzy', {'LD_LIBRARY_PATH': '/x:/opt/ros/jazzy/lib'}, 'problem'),
        (WHEEL, 'jazzy', {'ROS_DISTRO': 'humble'}, 'problem'),
        (APT, None, {'ROS_DISTRO': 'jazzy', 'AMENT_PREFIX_PATH': '/opt/ros/jazzy'}, 'ok'),
        (APT, None, {'ROS_DISTRO': 'rolling'}, 'warning'),
        (APT, 'jazzy', {'ROS_DISTRO': 'jazzy'}, 'problem'),
    ],
)
def test_which_ros_it_is(
    path: str,
    wheels: str | None,
    environment: dict[str, str],
    status: str,
    monkeypatch: pytest.MonkeyPatch,
):
    for name in ('AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH', 'ROS_DISTRO'):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, 'prefix', VENV)
    finding = doctor._origin(path, wheels)
    assert finding.status == status
    assert ('one ROS 2 at a time' in finding.advice) == (status == 'problem')


def test_a_middleware_that_is_not_installed_is_a_problem(monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip('rclpy')
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_of_no_one')
    *_, finding = doctor.ros()
    assert finding.status == 'problem'
    assert 'unset RMW_IMPLEMENTATION' in finding.advice


def test_segments_of_dead_processes_are_told_from_those_in_use(tmp_path: pathlib.Path):
    assert one(doctor.shared_memory(tmp_path)).status == 'ok'
    for name in ('fastrtps_0123456789abcdef', 'fastdds_fedcba9876543210'):
        (tmp_path / name).touch()
        (tmp_path / f'{name}_el').touch()
    (tmp_path / 'fastrtps_port7411_el').touch()  # ports are locked in another way
    with (tmp_path / 'fastdds_fedcba9876543210_el').open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        finding = one(doctor.shared_memory(tmp_path))
        assert doctor.stale_segments(tmp_path) == ['fastrtps_0123456789abcdef']
    assert finding.status == 'warning'
    assert ', 1 segments of dead' in finding.found and 'shm clean' in finding.advice


def test_full_shared_memory_is_a_problem(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: Usage(64e6, 60e6, 4e6))
    finding = one(doctor.shared_memory(tmp_path))
    assert (finding.status, '--shm-size' in finding.advice) == ('problem', True)


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Return an environment in which nobody else is heard."""
    pytest.importorskip('rclpy')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    for name in ('ROS_LOCALHOST_ONLY', 'RMW_IMPLEMENTATION'):
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


def test_a_message_goes_round(alone: pytest.MonkeyPatch):
    finding = doctor.loopback(30.0)  # a machine under test may be slow
    assert finding.status == 'ok', finding
    assert 's, at most 30 s' in finding.found


def test_processes_that_are_kept_apart_are_a_problem(alone: pytest.MonkeyPatch):
    alone.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    finding = doctor.loopback(1.0)
    assert finding.status == 'problem' and 'within 1 s' in finding.found
    assert finding.advice.startswith('ROS_AUTOMATIC_DISCOVERY_RANGE=OFF keeps')


def test_nodes_that_hang_are_not_waited_for(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / 'rclpy.py').write_text('import time; time.sleep(3600)')
    monkeypatch.setattr(doctor, 'STARTING', 0.5)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    monkeypatch.syspath_prepend(str(tmp_path))
    imported = one(doctor.ros())
    assert imported.status == 'problem' and 'within 0.5 s' in imported.found
    started = doctor.loopback(0.5)
    assert started.status == 'problem' and 'does not start' in started.found
    assert 'shm clean' in started.advice


@pytest.mark.parametrize('number', ['blue', '400'])
def test_a_domain_that_is_none_is_a_problem(alone: pytest.MonkeyPatch, number: str):
    alone.setenv('ROS_DOMAIN_ID', number)
    finding = doctor.loopback(1.0)
    assert finding.status == 'problem'
    # First what is seen to be wrong, and no firewall of ports that there are not.
    assert finding.advice.startswith(f'ROS_DOMAIN_ID={number}: a number from 0 to 101 is needed;')
    assert 'UDP' not in finding.advice


@pytest.mark.parametrize(
    ('name', 'value', 'hint'),
    [
        ('ROS_LOCALHOST_ONLY', '1', 'unset ROS_LOCALHOST_ONLY'),
        ('ROS_DISCOVERY_SERVER', 'host:11811', 'unset ROS_DISCOVERY_SERVER'),
        ('FASTRTPS_DEFAULT_PROFILES_FILE', 'x.xml', 'unset FASTRTPS_DEFAULT'),
        ('ROS_DOMAIN_ID', '102', 'from 0 to 101'),
        ('ROS_DOMAIN_ID', '2', 'UDP 7900 to 8149'),
        ('ROS_AUTOMATIC_DISCOVERY_RANGE', '', 'no multicast'),
        ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF', 'LOCALHOST'),
    ],
)
def test_hints_come_from_the_settings(
    name: str, value: str, hint: str, monkeypatch: pytest.MonkeyPatch
):
    for each in ('ROS_LOCALHOST_ONLY', 'ROS_DISCOVERY_SERVER', 'FASTRTPS_DEFAULT_PROFILES_FILE'):
        monkeypatch.delenv(each, raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setenv('ROS_DOMAIN_ID', '7')
    assert hint not in doctor._silence()
    monkeypatch.setenv(name, value)
    assert hint in doctor._silence()


def test_a_small_receive_buffer_is_hinted_at(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(pathlib.Path, 'read_text', lambda self: '65536\n')
    assert 'net.core.rmem_max=212992: it is 65536' in doctor._silence()


def test_serial_ports(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch):
    port = tmp_path / 'ttyUSB0'
    port.touch()
    assert one(doctor.serial_ports([])).found == 'none is plugged in'
    assert one(doctor.serial_ports([str(port)])).status == 'ok'
    assert 'gone' in one(doctor.serial_ports([str(tmp_path / 'ttyUSB1')])).found
    monkeypatch.setattr(os, 'access', lambda *_: False)
    monkeypatch.setattr(doctor, '_group', lambda _: 'dialout')
    finding = one(doctor.serial_ports([str(port)]))
    assert finding.status == 'warning'
    assert finding.advice.startswith('sudo usermod -aG dialout $USER')


@pytest.mark.parametrize(
    ('free', 'status'), [(5e9, 'ok'), (0.5e9, 'warning'), (0.05e9, 'problem')]
)
def test_room_for_bags(
    free: float, status: str, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: Usage(1e12, 1e12 - free, free))
    runs, _ = doctor.folders(tmp_path)
    assert (runs.what, runs.status) == ('runs/', status)
    assert list(tmp_path.iterdir()) == []  # nothing is left behind


def test_folders_that_cannot_be_written(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / 'file').touch()
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'file' / 'log'))
    runs, logs = doctor.folders(tmp_path)
    assert (runs.status, logs.status) == ('ok', 'problem')
    assert 'export ROS_LOG_DIR' in logs.advice

    def full(**_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr('tempfile.TemporaryFile', full)
    runs, _ = doctor.folders(tmp_path)
    assert runs.status == 'problem' and 'Read-only file system' in runs.found


def test_a_terminal_without_unicode(monkeypatch: pytest.MonkeyPatch):
    class Terminal:
        encoding = 'ascii'

        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, 'stderr', Terminal())
    assert one(doctor.terminal()).status == 'warning'
    Terminal.encoding = 'UTF-8'
    assert one(doctor.terminal()).status == 'ok'


def test_the_command_prints_all_and_fails_on_a_problem_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setenv('COLUMNS', '70')
    found = [
        Finding('Python', 'ok', '3.12'),
        Finding('mujoco', 'warning', 'not here: ' + 'word ' * 30, 'pip install "ros_pad[mujoco]"'),
    ]
    monkeypatch.setattr('ros_pad.commands.doctor.examine', lambda *_: iter(found))
    assert cli.main(['doctor']) == 0
    said = capsys.readouterr().out
    assert said.startswith('ok       Python: 3.12\nwarning  mujoco: not here: word')
    assert '-> pip install "ros_pad[mujoco]"' in said
    assert said.endswith('problems: 0, warnings: 1\n')
    assert max(map(len, said.splitlines())) <= 70
    found.append(Finding('logs', 'problem', 'full', 'make room'))
    assert cli.main(['doctor', '--json']) == 1
    values = json.loads(capsys.readouterr().out)
    assert (values['problems'], values['warnings'], len(values['findings'])) == (1, 1, 3)
