# SPDX-License-Identifier: Apache-2.0
"""Trials: run them without ROS, read them from bags, replay and sweep them."""

from ros_pad.trials.loop import run
from ros_pad.trials.node_settings import NodeSettings
from ros_pad.trials.replay import Outcome
from ros_pad.trials.replay import Replay
from ros_pad.trials.replay import open_bag
from ros_pad.trials.replay import replay
from ros_pad.trials.trial import Metrics
from ros_pad.trials.trial import Trial

__all__ = [
    'Metrics',
    'NodeSettings',
    'Outcome',
    'Replay',
    'Trial',
    'open_bag',
    'replay',
    'run',
]
