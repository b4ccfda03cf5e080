# SPDX-License-Identifier: Apache-2.0
"""Run one node in this process, and shut it down cleanly after a signal or an error."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _ros
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError


def run(
    make: Callable[[], Node],
    args: list[str] | None = None,
    executor_type: Callable[[], Executor] = EventsExecutor,
) -> int:
    """Spin a node until SIGINT or SIGTERM.

    Parameters
    ----------
    make : callable
        Makes the node, once ROS is initialised.
    args : list of str or None
        Command line; None takes the command line of the process.
    executor_type : callable
        Makes the executor. The default one needs a third of the CPU time of the others, and is
        safe where nothing in the process publishes from another thread.

    Returns
    -------
    int
        0 after a signal, 1 after a failure, 2 for an invalid parameter, file or command line.
    """
    stopped = False

    def stop(number: int, frame: Any) -> None:
        nonlocal stopped
        stopped = True
        signal.signal(number, before[signal.Signals(number)])  # a second signal ends at once

    # Signals end the spin, not the context: destroy_node, which vents pads or closes a bag, must
    # be able to publish. rclpy's own handlers would shut the context down.
    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        try:
            node = make()
        except _ros.RCLError as error:  # for instance keys that SROS 2 needs are missing
            raise PadError(f'ROS 2 cannot create the node: {error}') from error
        try:
            executor = executor_type()
            executor.add_node(node)
            while not stopped:
                executor.spin_once(timeout_sec=0.1)
        finally:
            node.destroy_node()
    except (ConfigError, InvalidInput) as error:
        return _complain(error, 2)
    except PadError as error:
        return _complain(error, 1)
    except RuntimeError as error:
        if rclpy.ok():
            raise
        return _complain(error, 2)  # rclpy cannot read its arguments or their file
    finally:
        rclpy.try_shutdown()
        for number, handler in before.items():
            signal.signal(number, handler)
    return 0


def _complain(error: Exception, status: int) -> int:
    print(f'ros_pad: {error}', file=sys.stderr)
    return status
