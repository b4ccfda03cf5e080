# SPDX-License-Identifier: Apache-2.0
"""What a foot does: policies of shape, and the pressure a dome needs."""

from ros_pad.control.morphology import POLICIES
from ros_pad.control.morphology import Choice
from ros_pad.control.morphology import FootFault
from ros_pad.control.morphology import LiftOff
from ros_pad.control.morphology import MorphologyController
from ros_pad.control.morphology import adaptive
from ros_pad.control.morphology import dome
from ros_pad.control.morphology import first_shapes
from ros_pad.control.morphology import flat
from ros_pad.control.morphology import oracle
from ros_pad.control.morphology import policy_named
from ros_pad.control.pressure import dome_pressure
from ros_pad.control.watch import PadWatch

__all__ = [
    'POLICIES',
    'Choice',
    'FootFault',
    'LiftOff',
    'MorphologyController',
    'PadWatch',
    'adaptive',
    'dome',
    'dome_pressure',
    'first_shapes',
    'flat',
    'oracle',
    'policy_named',
]
