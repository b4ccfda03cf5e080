# SPDX-License-Identifier: Apache-2.0
"""What a robot is: legs, kinematics, masses, and gaits by phase."""

from ros_pad.robots.chains import Chains, Kinematics
from ros_pad.robots.gait import GAITS, Gait
from ros_pad.robots.robot import Robot

__all__ = ['GAITS', 'Chains', 'Gait', 'Kinematics', 'Robot']
