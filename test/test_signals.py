# SPDX-License-Identifier: Apache-2.0
import os
import signal

import pytest
from shared import python

from ros_pad.signals import STOP, interrupt

BEGIN = """
import atexit, os, signal, sys, time
from ros_pad.signals import STOP, interrupt

def send(*numbers):
    for number in numbers:
        os.kill(os.getpid(), number)
        time.sleep(0.01)

INT, TERM = signal.SIGINT, signal.SIGTERM
STOP.install('stopped\\n')
"""


def run(script):
    """Run a script after ``STOP.install``; return its exit status, output and standard error."""
    child = python('-c', BEGIN + script)
    return child.returncode, child.stdout, child.stderr


@pytest.mark.parametrize('number', ['INT', 'TERM'])
def test_before_the_work_the_first_signal_ends_the_process(number):
    assert run(f'send({number})') == (130, '', 'stopped\n')


@pytest.mark.parametrize('pair', ['INT, INT', 'INT, TERM', 'TERM, INT'])
def test_during_the_work_the_second_signal_changes_nothing(pair):
    script = f"""
with STOP.during(lambda: print('first')):
    send({pair})
    print(STOP.requested)
"""
    assert run(script) == (0, 'first\nTrue\n', '')


@pytest.mark.parametrize('number', ['INT', 'TERM'])
def test_the_third_signal_kills(number):
    script = f'with STOP.during():\n    send(INT, INT, {number})'
    assert run(script) == (-getattr(signal, f'SIG{number}'), '', '')


def test_an_interrupt_is_raised_once_and_what_follows_is_not_disturbed():
    script = """
try:
    with STOP.during(interrupt):
        try:
            send(INT)
        finally:
            send(TERM)
            print('closed')
except KeyboardInterrupt:
    print('interrupted')
"""
    assert run(script) == (0, 'closed\ninterrupted\n', '')


@pytest.mark.parametrize('numbers', ['INT, INT', 'TERM, TERM, TERM'])
def test_signals_while_python_ends_leave_no_traceback(numbers):
    script = f"""
class Late:
    def __del__(self, send=send):
        send({numbers})

sys.late = Late()  # destroyed when modules are
with STOP.during():
    pass
"""
    assert run(script) == (0, '', '')


def test_a_deferred_signal_acts_after_the_block():
    script = """
try:
    with STOP.during(interrupt):
        with STOP.deferred():
            send(INT)
            print('done')
        print('not reached')
except KeyboardInterrupt:
    print('interrupted')
"""
    assert run(script) == (0, 'done\ninterrupted\n', '')


def test_handlers_are_those_of_before_after_the_block():
    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    for _ in range(2):  # the second block has not seen the signal of the first
        with pytest.raises(KeyboardInterrupt), STOP.during(interrupt):
            assert not STOP.requested
            os.kill(os.getpid(), signal.SIGTERM)
    assert [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)] == before


def test_the_module_imports_nothing_heavy():
    script = (
        'import sys, ros_pad.signals; print(*{"numpy", "rclpy", "argparse"} & set(sys.modules))'
    )
    child = python('-c', script)
    assert (child.returncode, child.stdout) == (0, '\n')


def test_an_interrupt_that_python_drops_is_raised_again():
    script = """
class Closing:
    def __del__(self):
        send(INT)

try:
    with STOP.during(interrupt):
        closing = Closing()
        del closing
        send(TERM)
        time.sleep(60.0)
except KeyboardInterrupt:
    print('interrupted')
"""
    assert run(script) == (0, 'interrupted\n', '')


def test_processes_that_start_here_get_no_sigint():
    script = """
import subprocess
from ros_pad.signals import children_spared
with STOP.during(lambda: print('first')):
    with children_spared():
        script = 'import os; os.kill(os.getpid(), 2); print("child", flush=True)'
        os.kill(os.getpid(), INT)
        subprocess.run([sys.executable, '-c', script])
        print('after', flush=True)
"""
    assert run(script) == (0, 'child\nafter\nfirst\n', '')
