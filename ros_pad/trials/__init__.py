# SPDX-License-Identifier: Apache-2.0
"""Trials: the closed loop without ROS, its metrics, bags and reports."""

from ros_pad.trials.loop import run
from ros_pad.trials.trial import Trial

__all__ = ['Trial', 'run']
