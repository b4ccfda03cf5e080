# SPDX-License-Identifier: Apache-2.0
"""Motion of body and feet from IMU, joints and foot forces, without motion capture."""

from ros_pad.sensing.estimator import BodyEstimate
from ros_pad.sensing.estimator import BodyEstimator
from ros_pad.sensing.estimator import FootMotion

__all__ = ['BodyEstimate', 'BodyEstimator', 'FootMotion']
