# SPDX-License-Identifier: Apache-2.0
"""What a foot feels: slip alarm, wetness, friction and margin, from force and motion."""

from ros_pad.estimation.foot import Estimate
from ros_pad.estimation.foot import FootEstimator
from ros_pad.estimation.foot import Tuning
from ros_pad.estimation.sensing import trouble_in

__all__ = ['Estimate', 'FootEstimator', 'Tuning', 'trouble_in']
