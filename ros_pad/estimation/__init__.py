# SPDX-License-Identifier: Apache-2.0
"""Estimate slip, wetness, friction and friction margin of feet from their forces and motions."""

from ros_pad.estimation.doubt import DOUBTS, SENSOR_FAULTS
from ros_pad.estimation.foot import Estimate, FootEstimator
from ros_pad.estimation.tuning import SETTINGS, Tuning

__all__ = [
    'DOUBTS',
    'SENSOR_FAULTS',
    'SETTINGS',
    'Estimate',
    'FootEstimator',
    'Tuning',
]
