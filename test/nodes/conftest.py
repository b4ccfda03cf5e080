# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the node tests: a context and an executor per test, a ROS domain per process.

A test creates its nodes with ``context=context`` and adds them to ``executor``, which destroys
them at the end. ``until(predicate)`` spins the executor until the predicate holds, and fails the
test after a timeout. ``bench`` hands messages to nodes without DDS: see helpers.py.
"""

import gc
import os
import tempfile
from collections.abc import Callable

import pytest

# These are set before rclpy is loaded, and processes that tests start inherit them. Workers of
# pytest-xdist and other runs on this machine have other process ids and so other domains. On Linux
# domains 0 to 101 have ports.
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_LOG_DIR', tempfile.mkdtemp(prefix='ros_pad_log_'))

rclpy = pytest.importorskip('rclpy', reason='the node tests need ROS 2')

from helpers import Bench  # noqa: E402
from shared import wait_for  # noqa: E402

Until = Callable[..., None]


@pytest.fixture
def context():
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()
    # Lifecycle nodes are in reference cycles: until they are collected, they stay participants of
    # the domain. Participants are limited, so later nodes could not find one another.
    gc.collect()


@pytest.fixture
def executor(context):
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=context)
    yield executor
    for node in executor.get_nodes():
        node.destroy_node()
    executor.shutdown()


@pytest.fixture
def until(executor):
    def until(predicate, timeout=60.0, what='the condition'):
        wait_for(predicate, what, lambda: executor.spin_once(timeout_sec=0.01), timeout)

    return until


@pytest.fixture
def bench(context, executor, until, monkeypatch):
    return Bench(context, executor, until, monkeypatch)
