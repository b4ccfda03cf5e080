# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes: each passes parameters and messages to the core, and publishes the results."""

import sys

from ros_pad.signals import STOP

# So Python calls a program that it searches: python -m ros_pad.nodes.NAME, whose imports follow.
if sys.argv[:1] == ['-m']:
    STOP.install()
