# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the node tests: own context and executor per test, own ROS domain per process.

A node of a test is made with ``context=context`` and added to ``executor``; whatever is in the
executor at the end is destroyed. ``until(predicate)`` spins the executor until the predicate
holds, and fails the test if it does not in time: no test ever sleeps.
"""

from __future__ import annotations

import gc
import os
import tempfile
import time
from collections.abc import Callable
from collections.abc import Iterator

import pytest

# Set before rclpy is loaded, and inherited by the processes that tests start. Workers of
# pytest-xdist, and other runs on this machine, have other process ids and so other domains;
# Linux has ports for 0 to 101.
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_LOG_DIR', tempfile.mkdtemp(prefix='ros_pad_log_'))

rclpy = pytest.importorskip('rclpy', reason='the node tests need ROS 2')

Until = Callable[..., None]


@pytest.fixture
def context() -> Iterator[rclpy.Context]:
    context = rclpy.Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()
    # Lifecycle nodes hold themselves, and with them their place in the domain, until the garbage
    # is collected. There are only so many places: later tests would not find one another.
    gc.collect()


@pytest.fixture
def executor(context: rclpy.Context) -> Iterator[rclpy.executors.Executor]:
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=context)
    yield executor
    for node in executor.get_nodes():
        node.destroy_node()
    executor.shutdown()


@pytest.fixture
def until(executor: rclpy.executors.Executor) -> Until:
    def until(
        predicate: Callable[[], object], timeout: float = 10.0, what: str = 'the condition'
    ) -> None:
        deadline = time.monotonic() + timeout
        while not predicate():
            if time.monotonic() > deadline:
                pytest.fail(f'{what} did not come true within {timeout:g} s')
            executor.spin_once(timeout_sec=0.01)

    return until
