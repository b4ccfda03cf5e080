# SPDX-License-Identifier: Apache-2.0
"""Run one node in this process, and shut it down cleanly after a signal or an error."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _ros
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ros_pad.errors import ConfigError, InvalidInput, PadError
from ros_pad.signals import STOP

REACTION = 0.1
"""Longest time from a signal to the end of the spin of an idle node, s."""


def run(make: Callable[[], Node], args: list[str] | None = None) -> int:
    """Spin a node until SIGINT or SIGTERM, and destroy it, whatever signals follow.

    Parameters
    ----------
    make : callable
        Makes the node, once ROS is initialised. Nothing but the node's own callbacks may publish:
        rclpy's EventsExecutor, which needs a third of the CPU time of the others, hangs when
        another thread does.
    args : list of str or None
        Command line; None takes the command line of the process.

    Returns
    -------
    int
        0 after a signal, 1 after a failure, 2 for an invalid parameter, file or command line.
    """
    # Signals end the spin, not the context: destroy_node, which vents pads or closes a bag, must
    # be able to publish. rclpy's own handlers would shut the context down.
    with STOP.during():
        try:
            rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
            _spin(make)
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
    return 0


def _spin(make: Callable[[], Node]) -> None:
    try:
        node = make()
    except _ros.RCLError as error:  # for instance keys that SROS 2 needs are missing
        raise PadError(
            f'ROS 2 cannot create the node: {error}: pad doctor finds the cause'
        ) from error
    try:
        executor = EventsExecutor()
        executor.add_node(node)
        # A spin runs in C++; without timeout it would not see a signal, and it may loop without
        # calling anything. The signal handler cannot complete the future instead: the code that it
        # interrupts may hold the lock of the future.
        never = Future()
        while not STOP.requested:
            executor.spin_until_future_complete(never, timeout_sec=REACTION)
    finally:
        node.destroy_node()


def _complain(error: Exception, status: int) -> int:
    print(f'ros_pad: {error}', file=sys.stderr)
    return status
