# SPDX-License-Identifier: Apache-2.0
"""Leg, hexapod, floor, sensors and pneumatics, simulated; and the scenes made of them."""

from ros_pad.simulation.scene import Scene

__all__ = ['Scene']
