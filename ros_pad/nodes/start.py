# SPDX-License-Identifier: Apache-2.0
"""Start a node from a shell, so that a signal leaves no traceback even during the imports."""

from __future__ import annotations

import importlib
from functools import partial

from ros_pad.signals import STOP


def _start(name: str) -> int:
    STOP.install()
    return int(importlib.import_module(f'ros_pad.nodes.{name}').main())


body_estimator = partial(_start, 'body_estimator')
controller = partial(_start, 'controller')
estimator = partial(_start, 'estimator')
merge = partial(_start, 'merge')
recorder = partial(_start, 'recorder')
regulator = partial(_start, 'regulator')
simulator = partial(_start, 'simulator')
views = partial(_start, 'views')
