# SPDX-License-Identifier: Apache-2.0
"""Motion of body and feet from IMU, joints and foot forces, without motion capture."""

from ros_pad.sensing.estimator import BodyEstimate, BodyEstimator, FootMotion
from ros_pad.sensing.mapping import Mapping, Readings
from ros_pad.sensing.stage import SensingStage

__all__ = [
    'BodyEstimate',
    'BodyEstimator',
    'FootMotion',
    'Mapping',
    'Readings',
    'SensingStage',
]
