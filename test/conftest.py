# SPDX-License-Identifier: Apache-2.0
"""Settings and fixtures of all tests."""

import functools
import signal
import statistics
import subprocess
import sys

import hypothesis
import pytest

# No test may depend on how busy the machine is.
hypothesis.settings.register_profile('any machine', deadline=None)
hypothesis.settings.load_profile('any machine')

# Background jobs of a shell ignore Ctrl-C, and so do the processes that they start. The commands
# that tests interrupt must not ignore it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

SLOWEST = 0.4
"""Longest time for the work below, s; on slower or busier machines real-time tests are skipped."""

WORK = """
import time
started, total = time.perf_counter(), 0
for number in range(2_000_000):
    total += number
print(time.perf_counter() - started)
"""


def time_of_work():
    """Return the time, s, of WORK in two processes at once: median of three measurements."""
    times = []
    for _ in range(3):
        children = [
            subprocess.Popen([sys.executable, '-c', WORK], stdout=subprocess.PIPE, text=True)
            for _ in range(2)
        ]
        times.append(max(float(child.communicate()[0]) for child in children))
    return statistics.median(times)


first_time_of_work = functools.cache(time_of_work)


def skip_if_slow(time):
    """Skip the test if ``time``, s, of the work is above SLOWEST."""
    if time > SLOWEST:
        pytest.skip(
            f'this machine is too slow for tests in real time: a loop in Python takes {time:.2f} s'
            f' in each of two processes, at most {SLOWEST} s is allowed'
        )


def pytest_runtest_setup(item):
    """Skip a test with the mark ``realtime`` if the machine is too slow."""
    if item.get_closest_marker('realtime'):
        skip_if_slow(first_time_of_work())


@pytest.fixture(scope='session')
def skip_if_slow_now():
    """Return a function that measures the machine again and skips the test if it is too slow."""
    return lambda: skip_if_slow(time_of_work())
