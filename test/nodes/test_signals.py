# SPDX-License-Identifier: Apache-2.0
"""Two signals at a few fixed moments."""

import itertools
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
from shared import wait_for

from ros_pad.bags import BagReader

NODES = ('recorder', 'regulator', 'estimator', 'controller', 'simulator')
SCRIPTS = pathlib.Path(sys.executable).parent
WALK = ('run', 'hexapod_patches', '--policy', 'dome', '--cycles', '30', '--out', 'out')


def script(name):
    return str(SCRIPTS / f'{name}_node')


def handles_signals(child):
    """Return whether a process has set a handler of SIGTERM, which Python itself does not."""
    status = pathlib.Path(f'/proc/{child.pid}/status').read_text().splitlines()
    (caught,) = (int(line.split()[1], 16) for line in status if line.startswith('SigCgt:'))
    return caught >> (signal.SIGTERM - 1) & 1


@pytest.fixture
def start(tmp_path):
    """Start commands as one process group, and wait until they handle signals."""
    children = []

    def start(*commands):
        for words in commands:
            group = children[0].pid if children else 0
            pipes = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.PIPE, 'text': True}
            children.append(subprocess.Popen(words, cwd=tmp_path, process_group=group, **pipes))
        wait_for(lambda: all(handles_signals(each) for each in children))
        return children

    yield start
    for child in children:
        child.kill()
        child.communicate()


def ends(children):
    """Return the exit statuses; no process may leave a traceback."""
    errors = [child.communicate(timeout=30)[1] for child in children]
    for word in ('Traceback', 'terminate called', 'Exception ignored'):
        assert not any(word in each for each in errors), errors
    return [child.returncode for child in children]


@pytest.mark.parametrize('after', [0.0, 0.2])
def test_two_signals_during_the_imports_of_the_nodes(after, start):
    children = start(*([script(name)] for name in NODES))
    time.sleep(after)
    for child, number in itertools.product(children, (signal.SIGINT, signal.SIGTERM)):
        child.send_signal(number)
    assert set(ends(children)) <= {0, 130}


def test_two_signals_to_a_group_of_nodes_as_from_launch(start, tmp_path):
    """The group gets SIGINT, and then each node another one, as from launch without a terminal."""
    recorder = ['--ros-args', '-p', 'folder:=bag']
    children = start(*([script(name), *recorder * (name == 'recorder')] for name in NODES))
    wait_for((tmp_path / 'bag' / 'metadata.yaml').exists)
    os.killpg(children[0].pid, signal.SIGINT)
    for child in children:
        child.send_signal(signal.SIGINT)
    status, *others = ends(children)
    assert status == 0 and set(others) <= {0, 130}
    assert BagReader(tmp_path / 'bag').problem is None


@pytest.mark.parametrize(('second', 'after'), [(signal.SIGINT, 0.0), (signal.SIGTERM, 1.0)])
def test_two_signals_to_a_run_on_nodes_leave_a_closed_bag(second, after, start, tmp_path):
    (child,) = start([str(SCRIPTS / 'pad'), *WALK])
    bag = tmp_path / 'out' / 'bag'
    wait_for((bag / 'metadata.yaml').exists)
    time.sleep(after)
    child.send_signal(signal.SIGINT)
    time.sleep(0.01)
    child.send_signal(second)
    assert ends([child]) == [130]
    assert BagReader(bag).problem is None
