# SPDX-License-Identifier: Apache-2.0
"""Trials: run them without ROS, read them from bags, replay and sweep them."""

from ros_pad.trials.loop import run
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import Outcome, Replay, replay
from ros_pad.trials.trial import Metrics, Trial

__all__ = [
    'Metrics',
    'NodeSettings',
    'Outcome',
    'Replay',
    'Trial',
    'replay',
    'run',
]
