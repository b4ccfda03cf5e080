# SPDX-License-Identifier: Apache-2.0
"""Trials: run them without ROS, read them from bags, replay and sweep them."""

from ros_pad.trials.loop import run
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial

__all__ = ['Metrics', 'Trial', 'run']
