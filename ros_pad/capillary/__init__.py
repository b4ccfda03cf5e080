# SPDX-License-Identifier: Apache-2.0
"""Liquid on pads of any shape, given as meshes or meridians (thesis chapter 4)."""

from ros_pad.capillary.bath import BathMeniscus, Wall, bath_meniscus
from ros_pad.capillary.coupling import WetPad, press_wet
from ros_pad.capillary.faces import Face
from ros_pad.capillary.layers import Wet, WetPattern, wet, wet_pattern
from ros_pad.capillary.menisci import (
    WetSurface,
    bath_surface,
    pattern_surface,
    spanned,
    wet_surface,
)
from ros_pad.capillary.mesh import Mesh
from ros_pad.capillary.rails import Line
from ros_pad.capillary.surface import LiquidSurface, minimise

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
    'WetSurface',
    'bath_meniscus',
    'bath_surface',
    'minimise',
    'pattern_surface',
    'press_wet',
    'spanned',
    'wet',
    'wet_pattern',
    'wet_surface',
]
