# SPDX-License-Identifier: Apache-2.0
"""Liquid on pads of any shape (thesis chapter 4)."""

from ros_pad.capillary.bath import BathMeniscus
from ros_pad.capillary.bath import Wall
from ros_pad.capillary.bath import bath_meniscus

__all__ = ['BathMeniscus', 'Wall', 'bath_meniscus']
