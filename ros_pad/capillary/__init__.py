# SPDX-License-Identifier: Apache-2.0
"""Liquid on pads of any shape, given as meshes or meridians (thesis chapter 4)."""

from ros_pad.capillary.bath import BathMeniscus, Wall, bath_meniscus
from ros_pad.capillary.coupling import WetPad, press_wet
from ros_pad.capillary.layers import Wet, WetPattern, wet, wet_pattern
from ros_pad.capillary.mesh import Mesh
from ros_pad.capillary.surface import WetSurface, wet_surface

__all__ = [
    'BathMeniscus',
    'Mesh',
    'Wall',
    'Wet',
    'WetPad',
    'WetPattern',
    'WetSurface',
    'bath_meniscus',
    'press_wet',
    'wet',
    'wet_pattern',
    'wet_surface',
]
