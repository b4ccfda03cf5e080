# SPDX-License-Identifier: Apache-2.0
"""``pad sweep`` as a user types it, also killed, stopped, and with bad input."""

import contextlib
import csv
import json
import os
import pathlib
import pty
import re
import signal
import subprocess
import sys
import termios
import threading

import pytest
from shared import wait_for

from ros_pad import cli
from ros_pad.commands.sweep import parameters, seeds
from ros_pad.errors import InvalidInput
from ros_pad.signals import INTERRUPTED

CAP = 300.0  # s: no test waits longer for an event, however slow the machine
LEG = ['sweep', 'leg_wet_flat', '--workers', '2', '--set', 'cycles=2']


def table(folder):
    """Return the rows of a sweep without the column that depends on the machine's speed."""
    with (folder / 'trials.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        del row['real_time_factor']
    return rows


def test_seeds_and_values_as_they_are_typed():
    assert seeds('3') == [3]
    assert seeds('0,2,5:7') == [0, 2, 5, 6, 7]
    assert parameters(['a=1,2.5,3e-4', 'b.c=dry,wet']) == {
        'a': [1, 2.5, 3e-4],
        'b.c': ['dry', 'wet'],
    }
    found = parameters(['n=10:40:4', 'x=0.1:0.3:3', 'y=1:0:3'])
    assert found == {'n': [10, 20, 30, 40], 'x': [0.1, 0.2, 0.3], 'y': [1.0, 0.5, 0.0]}
    assert all(isinstance(each, int) for each in found['n'])


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('x', 'NAME=VALUE'),
        ('x=1:2', 'START:STOP:COUNT'),
        ('x=1:2:1', 'COUNT = 1 is not allowed: a whole number from 2 to 100000'),
        ('x=1:1:3', 'STOP other than START'),
    ],
)
def test_ranges_that_make_no_sense_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parameters([text])
    with pytest.raises(InvalidInput, match='x is given twice'):
        parameters(['x=1', 'x=2'])


@pytest.mark.parametrize('text', ['-1', '5:2', '0:100000'])
def test_seeds_that_make_no_sense_are_refused(text):
    with pytest.raises(InvalidInput, match='--seed'):
        seeds(text)


def nothing_to_do(jobs, workers):
    assert not jobs
    yield from ()


def test_a_sweep_leaves_table_picture_and_summary(tmp_path, capsys, monkeypatch):
    out = tmp_path / 'sweep'
    arguments = [
        *LEG,
        '--seed',
        '0,1',
        '--policy',
        'flat,dome',
        '--set',
        'body.rolling_drag=0.5,1',
    ]
    assert cli.main([*arguments, '--out', str(out), '--json']) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary['trials'], summary['failed'], summary['ended_early']) == (8, 0, 0)
    assert summary['picture'] == str(out / 'sweep.png')
    assert (out / 'sweep.png').stat().st_size > 5000
    rows = table(out)
    assert len(rows) == 8
    assert len(summary['points']) == 4
    point = summary['points'][1]
    assert (point['policy'], point['body.rolling_drag'], point['walks']) == ('dome', 0.5, 2)
    ways = [
        float(row['distance_per_cycle_m'])
        for row in rows
        if (row['policy'], row['body.rolling_drag']) == ('dome', '0.5')
    ]
    assert point['distance_per_cycle_m'] == pytest.approx(sum(ways) / 2)
    # The second time no trial is repeated (times differ), and the result is printed again.
    before = (out / 'trials.csv').read_bytes()
    monkeypatch.setattr('ros_pad.trials.sweep.execution._finished', nothing_to_do)
    assert cli.main([*arguments, '--out', str(out)]) == 0
    said = capsys.readouterr().out
    assert 'mm/cycle' in said and str(out / 'trials.csv') in said
    assert (out / 'trials.csv').read_bytes() == before


class Child:
    """A sweep in a process of its own, on a terminal; what it shows goes to a file."""

    def __init__(self, arguments, folder):
        self._said = folder / 'said'
        self._said.unlink(missing_ok=True)
        own, other = pty.openpty()
        termios.tcsetwinsize(other, (24, 120))
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'ros_pad', *arguments], stdout=other, stderr=other
        )
        os.close(other)
        self._reader = threading.Thread(target=self._read, args=[own], daemon=True)
        self._reader.start()
        self.workers: list[int] = []

    def _read(self, terminal):
        # The end of the process is an error of its terminal.
        with self._said.open('wb', buffering=0) as file, contextlib.suppress(OSError):
            while data := os.read(terminal, 4096):
                file.write(data)
        os.close(terminal)

    def until(self, more):
        """Wait until the progress bar shows ``more`` trials above its first count."""
        shown = []

        def reached():
            assert self.process.poll() is None, self.said()
            # The bar shows 0 until the trials that are already done are counted.
            shown.extend(int(each) for each in re.findall(r'(\d+)/\d+ trials', self.said()))
            counted = [each for each in shown if each]
            return counted and counted[-1] >= counted[0] + more

        wait_for(reached, 'trials')
        self.workers = children(self.process.pid)

    def said(self):
        """Return what the sweep has printed so far."""
        if self.process.poll() is not None:
            self._reader.join()
        return self._said.read_text() if self._said.exists() else ''


def children(pid):
    text = pathlib.Path(f'/proc/{pid}/task/{pid}/children').read_text()
    return [int(each) for each in text.split()]


def alive(pid):
    """Return whether a process exists and is no zombie."""
    try:
        return pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return False


def check_they_end(pids):
    """Check that the workers end after the sweep has ended."""
    wait_for(lambda: not any(alive(pid) for pid in pids))


@pytest.mark.slow
def test_ctrl_c_leaves_what_is_done(tmp_path):
    out = tmp_path / 'sweep'
    child = Child([*LEG, '--seed', '0:199', '--out', str(out)], tmp_path)
    try:
        child.until(1)
        os.kill(child.process.pid, signal.SIGINT)
        child.process.wait(CAP)
    finally:
        child.process.kill()
    assert child.process.returncode == INTERRUPTED
    rows = table(out)
    assert 0 < len(rows) < 200
    assert f'stopped: --out {out} continues' in child.said()
    assert len(child.workers) >= 2
    check_they_end(child.workers)
    assert 'Traceback' not in child.said()
