# SPDX-License-Identifier: Apache-2.0
"""Estimate slip, wetness, friction and friction margin of feet from their forces and motions."""

from ros_pad.estimation import doubt
from ros_pad.estimation.foot import Estimate, FootEstimator
from ros_pad.estimation.tuning import SETTINGS, Tuning

DOUBTS = doubt.DOUBTS
"""Kinds of doubt; the first one, empty, is no doubt."""

SENSOR_FAULTS = doubt.SENSOR_FAULTS
"""Kinds of doubt about sensors, not about the ground."""

__all__ = [
    'DOUBTS',
    'SENSOR_FAULTS',
    'SETTINGS',
    'Estimate',
    'FootEstimator',
    'Tuning',
]
