# SPDX-License-Identifier: Apache-2.0
"""``pad emulate`` as a user types it, in a process of its own."""

import signal
import subprocess
import sys

import pytest
from shared import wait_for

from ros_pad.regulators import create

LIMIT = 120.0  # s, a cap for events on slow machines


@pytest.fixture
def emulate():
    """Start the command; return its process and the path it prints."""
    started = []

    def start(*arguments):
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
def test_a_backend_talks_to_its_emulator(emulate, tmp_path, name, arguments, options):
    link = tmp_path / 'regulator'
    child, path = emulate(name, '--link', str(link), *arguments)
    assert path == str(link)
    regulator = create(name, port=path, silence=5.0, **options)
    regulator.open()
    regulator.set_pressure(50e3)
    wait_for(lambda: abs(regulator.read().pressure - 50e3) <= 500.0)
    assert regulator.read().faults == ()
    regulator.close()
    child.send_signal(signal.SIGINT)
    assert child.wait(LIMIT) == 130
    assert not link.is_symlink()
