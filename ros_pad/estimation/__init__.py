# SPDX-License-Identifier: Apache-2.0
"""Estimate slip, wetness, friction and friction margin of one foot from its force and motion."""

from ros_pad.estimation.doubt import MOTION
from ros_pad.estimation.doubt import OF_THE_GROUND
from ros_pad.estimation.foot import ContactMotion
from ros_pad.estimation.foot import Estimate
from ros_pad.estimation.foot import FootEstimator
from ros_pad.estimation.foot import estimators_of
from ros_pad.estimation.sensing import SENSOR_FAULTS
from ros_pad.estimation.sensing import sensor_fault
from ros_pad.estimation.tuning import SETTINGS
from ros_pad.estimation.tuning import Tuning

DOUBTS = ('', *OF_THE_GROUND, *SENSOR_FAULTS, MOTION)
"""Kinds of doubt, which are the texts before the colon; the first one, empty, is no doubt."""

__all__ = [
    'DOUBTS',
    'SETTINGS',
    'ContactMotion',
    'Estimate',
    'FootEstimator',
    'Tuning',
    'estimators_of',
    'sensor_fault',
]
