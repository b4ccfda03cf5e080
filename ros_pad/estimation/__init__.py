# SPDX-License-Identifier: Apache-2.0
"""What a foot feels: slip alarm, wetness, friction and margin, from force and motion."""

from ros_pad.estimation.doubt import OF_THE_GROUND
from ros_pad.estimation.foot import Estimate
from ros_pad.estimation.foot import FootEstimator
from ros_pad.estimation.foot import Tuning
from ros_pad.estimation.sensing import TROUBLES
from ros_pad.estimation.sensing import trouble_in

DOUBTS = ('', *OF_THE_GROUND, *TROUBLES)
"""How doubts begin, before the colon; the first is none."""

__all__ = ['DOUBTS', 'Estimate', 'FootEstimator', 'Tuning', 'trouble_in']
