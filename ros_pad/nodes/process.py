# SPDX-License-Identifier: Apache-2.0
"""Runs one node in a process of its own, and ends it well."""

from __future__ import annotations

import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ros_pad.errors import PadError


def run(make: Callable[[], Node], args: list[str] | None = None) -> int:
    """Spin a node until SIGINT or SIGTERM.

    Parameters
    ----------
    make : callable
        Makes the node, once ROS is initialised.
    args : list of str or None
        Command line; None takes the process's.

    Returns
    -------
    int
        0 after an interrupt, 2 when parameters or files are not as they must be.
    """
    # Signals end the spin, not the context: a node that vents in destroy_node can still say so.
    rclpy.init(args=args)
    node = None
    try:
        node = make()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except PadError as error:
        print(f'ros_pad: {error}', file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
