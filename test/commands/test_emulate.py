# SPDX-License-Identifier: Apache-2.0
"""``pad emulate`` as a user types it, in a process of its own."""

import pathlib
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from ros_pad import cli
from ros_pad.regulators import create

LIMIT = 120.0  # s, a cap for events on slow machines


@pytest.fixture
def emulate() -> Iterator:
    """Start the command; return its process and the path it prints."""
    started = []

    def start(*arguments: str) -> tuple[subprocess.Popen, str]:
        command = [sys.executable, '-m', 'ros_pad', 'emulate', *arguments]
        child = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        started.append(child)
        return child, child.stdout.readline().strip()

    yield start
    for child in started:
        child.kill()
        child.communicate()


@pytest.mark.parametrize(
    ('name', 'arguments', 'options'),
    [
        ('alicat', ['--unit-ids', 'AB', '--units', 'psi'], {'unit_id': 'B', 'units': 'psi'}),
        ('smc_itv', ['--full-scale', '200e3'], {'full_scale': 200e3}),
        ('serial_text', ['--channels', '2'], {'channel': 2}),
    ],
)
def test_a_backend_talks_to_its_emulator(
    emulate, tmp_path: pathlib.Path, name, arguments, options
):
    link = tmp_path / 'regulator'
    child, path = emulate(name, '--link', str(link), *arguments)
    assert path == str(link)
    regulator = create(name, port=path, silence=5.0, **options)
    regulator.open()
    regulator.set_pressure(50e3)
    end = time.monotonic() + LIMIT
    while abs(regulator.read().pressure - 50e3) > 500.0:
        assert time.monotonic() < end
        time.sleep(0.005)
    assert regulator.read().faults == ()
    regulator.close()
    child.send_signal(signal.SIGINT)
    assert child.wait(LIMIT) == 130
    assert not link.is_symlink()


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (
            ['smc_itv', '--units', 'kPa'],
            "--units: option of smc_itv = 'units' is not allowed: one of full",
        ),
        (['alicat', '--fault', 'fire'], "fault = 'fire' is not allowed: one of silence"),
        (['alicat', '--unit-ids', 'ab'], "unit_ids = 'ab' is not allowed: [A-Z]+"),
    ],
)
def test_bad_arguments_are_reported(arguments, words, capsys: pytest.CaptureFixture[str]):
    assert cli.main(['emulate', *arguments]) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert said.out == ''


def test_what_is_there_is_not_replaced(tmp_path, capsys: pytest.CaptureFixture[str]):
    link = tmp_path / 'regulator'
    link.write_text('mine')
    assert cli.main(['emulate', 'alicat', '--link', str(link)]) == 2
    assert f"link = '{link}' is not allowed: a new path" in capsys.readouterr().err
    assert link.read_text() == 'mine'
    assert cli.main(['emulate', 'alicat', '--link', str(tmp_path / 'no' / 'regulator')]) == 2
