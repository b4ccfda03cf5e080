# SPDX-License-Identifier: Apache-2.0
"""Estimate slip, wetness, friction and friction margin of feet from their forces and motions."""

from ros_pad.estimation.doubt import FAULTS, KINDS
from ros_pad.estimation.foot import ContactMotion, Estimate, FootEstimator
from ros_pad.estimation.tuning import SETTINGS, Tuning

DOUBTS = KINDS
"""Kinds of doubt, which are the texts before the colon; the first one, empty, is no doubt."""

SENSOR_FAULTS = FAULTS
"""Kinds of doubt about sensors, not about the ground."""

__all__ = [
    'DOUBTS',
    'SENSOR_FAULTS',
    'SETTINGS',
    'ContactMotion',
    'Estimate',
    'FootEstimator',
    'Tuning',
]
