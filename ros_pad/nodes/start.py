# SPDX-License-Identifier: Apache-2.0
"""Start a node from a shell, so that a signal leaves no traceback even during the imports."""

from __future__ import annotations

import importlib
import sys
from functools import partial

from ros_pad.signals import STOP


def _start(name: str, kind: str) -> int:
    STOP.install()
    node = getattr(importlib.import_module(f'ros_pad.nodes.{name}'), kind)
    return int(importlib.import_module('ros_pad.nodes.process').run(node))


body_estimator = partial(_start, 'body_estimator', 'BodyEstimatorNode')
controller = partial(_start, 'controller', 'ControllerNode')
estimator = partial(_start, 'estimator', 'EstimatorNode')
merge = partial(_start, 'merge', 'MergeNode')
recorder = partial(_start, 'recorder', 'RecorderNode')
regulator = partial(_start, 'regulator', 'RegulatorNode')
simulator = partial(_start, 'simulator', 'SimulatorNode')
views = partial(_start, 'views', 'ViewsNode')

if __name__ == '__main__':
    sys.exit(globals()[sys.argv.pop(1)]())
