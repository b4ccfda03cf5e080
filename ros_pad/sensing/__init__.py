# SPDX-License-Identifier: Apache-2.0
"""Motion of body and feet from IMU, joints and foot forces, without motion capture."""

from ros_pad.sensing.estimator import BodyEstimate
from ros_pad.sensing.estimator import BodyEstimator
from ros_pad.sensing.estimator import FootMotion
from ros_pad.sensing.mapping import Mapping
from ros_pad.sensing.mapping import Readings
from ros_pad.sensing.stage import SensingStage

__all__ = [
    'BodyEstimate',
    'BodyEstimator',
    'FootMotion',
    'Mapping',
    'Readings',
    'SensingStage',
]
