# SPDX-License-Identifier: Apache-2.0
"""Decide the morphology of each foot and the pressure that a dome needs."""

from ros_pad.control.monitor import PadMonitor
from ros_pad.control.morphology import COMMAND_TIMEOUT, FootFault, MorphologyController
from ros_pad.control.policies import (
    POLICIES,
    Choice,
    LiftOff,
    adaptive,
    dome,
    first_morphologies,
    flat,
    oracle,
    policy_named,
)
from ros_pad.control.pressure import dome_pressure

__all__ = [
    'COMMAND_TIMEOUT',
    'POLICIES',
    'Choice',
    'FootFault',
    'LiftOff',
    'MorphologyController',
    'PadMonitor',
    'adaptive',
    'dome',
    'dome_pressure',
    'first_morphologies',
    'flat',
    'oracle',
    'policy_named',
]
