# SPDX-License-Identifier: Apache-2.0
"""Liquid on pads of any shape, given as meshes or meridians (thesis chapter 4)."""

from ros_pad.capillary.bath import BathMeniscus
from ros_pad.capillary.bath import Wall
from ros_pad.capillary.bath import bath_meniscus
from ros_pad.capillary.coupling import WetPad
from ros_pad.capillary.coupling import press_wet
from ros_pad.capillary.faces import Face
from ros_pad.capillary.layers import Wet
from ros_pad.capillary.layers import WetPattern
from ros_pad.capillary.layers import wet
from ros_pad.capillary.layers import wet_pattern
from ros_pad.capillary.menisci import bath_surface
from ros_pad.capillary.menisci import pattern_surface
from ros_pad.capillary.menisci import spanned
from ros_pad.capillary.mesh import Mesh
from ros_pad.capillary.surface import Line
from ros_pad.capillary.surface import LiquidSurface
from ros_pad.capillary.surface import minimise

__all__ = [
    'BathMeniscus',
    'Face',
    'Line',
    'LiquidSurface',
    'Mesh',
    'Wall',
    'Wet',
    'WetPad',
    'WetPattern',
    'bath_meniscus',
    'bath_surface',
    'minimise',
    'pattern_surface',
    'press_wet',
    'spanned',
    'wet',
    'wet_pattern',
]
