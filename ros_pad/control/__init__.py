# SPDX-License-Identifier: Apache-2.0
"""Decide the morphology of each foot and the pressure that a dome needs."""

from ros_pad.control.monitor import PadMonitor
from ros_pad.control.morphology import COMMAND_TIMEOUT
from ros_pad.control.morphology import FootFault
from ros_pad.control.morphology import MorphologyController
from ros_pad.control.policies import POLICIES
from ros_pad.control.policies import POLICY_PARAMETERS
from ros_pad.control.policies import Choice
from ros_pad.control.policies import LiftOff
from ros_pad.control.policies import adaptive
from ros_pad.control.policies import dome
from ros_pad.control.policies import first_morphologies
from ros_pad.control.policies import flat
from ros_pad.control.policies import oracle
from ros_pad.control.policies import policy_named
from ros_pad.control.pressure import dome_pressure

__all__ = [
    'COMMAND_TIMEOUT',
    'POLICIES',
    'POLICY_PARAMETERS',
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
