# SPDX-License-Identifier: Apache-2.0
"""The rclpy nodes: each passes parameters and messages to the core, and publishes the results."""

import sys

from ros_pad.signals import STOP

# While python -m ros_pad.nodes.NAME looks for its module, before that module's imports, argv[0] is
# '-m'.
if sys.argv[:1] == ['-m']:
    STOP.install()
