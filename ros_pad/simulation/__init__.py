# SPDX-License-Identifier: Apache-2.0
"""Simulated robots on three fidelity levels, floor, sensors, pneumatics, faults, and scenes."""

from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.pneumatics import Hose, PneumaticChannel, RegulatorModel
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor

__all__ = [
    'Floor',
    'Hose',
    'PlanarRobot',
    'PneumaticChannel',
    'RailLeg',
    'RegulatorModel',
    'Scene',
]
