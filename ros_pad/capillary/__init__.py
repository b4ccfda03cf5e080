# SPDX-License-Identifier: Apache-2.0
"""Liquid round pads of any shape (thesis chapter 4)."""

from ros_pad.capillary.layers import Wet
from ros_pad.capillary.layers import WetPattern
from ros_pad.capillary.layers import wet
from ros_pad.capillary.layers import wet_pattern
from ros_pad.capillary.mesh import Mesh

__all__ = ['Mesh', 'Wet', 'WetPattern', 'wet', 'wet_pattern']
