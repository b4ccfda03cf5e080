# SPDX-License-Identifier: Apache-2.0
"""Design of a sole by the thesis: 3.87, 3.89, 3.92 and 3.101, as printed and corrected.

The printed cell of 2.78 radius² per pad is smaller than a flat pad needs (3.46).
"""

from __future__ import annotations

import math

import numpy as np

from ros_pad.contact.design import CELL, rise_height
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.contact.pad import Array

CELLS = {'corrected': CELL, 'thesis': math.pi / 3.0 + math.sqrt(3.0)}
"""Floor area per pad over radius² (3.87)."""

TENSION = {'corrected': math.sqrt(18.0 + 6.0 * math.sqrt(5.0)) - 4.0 / 3.0, 'thesis': 4.3}
"""Pressure that inflates a pad to a sphere radius of 1.5 radii, over stiffness/radius (3.89): the
law of the free dome with sin t = height/sqrt(radius² + height²) and sin 2t = 1/1.5."""

FLAT = {name: math.pi / CELLS[name] * TENSION[name] for name in CELLS}
"""Force that presses all pads of a sole flat, over stiffness * area/radius (3.92)."""


def rise(radius: Array, liquid: Liquid, reading: str) -> Array:
    """Return the height of liquid between the domes, m, by 3.101.

    Parameters
    ----------
    radius : array
        Radius of the flat pads, m, above 0.
    liquid : Liquid
        The liquid.
    reading : {'corrected', 'thesis'}
        In ``thesis``, 3.101 as printed, a factor of height is missing in the last term, so the
        result depends on the unit of length: it is evaluated in millimetres, as in figure 10.
        There is no root, and the result is NaN, below a radius of 0.5652 mm.
    """
    if reading == 'corrected':
        return np.asarray(rise_height(radius, liquid))
    r = 1e3 * np.asarray(radius)
    room = CELLS['thesis'] / math.pi * r
    room = np.where(room > 0.5, room, np.nan)
    pull = 2e6 * liquid.surface_tension * math.cos(liquid.angle) / (liquid.density * GRAVITY * r)
    low, high = np.zeros_like(r), (room - 0.5) / pull
    for _ in range(80):
        u = 0.5 * (low + high)
        short = pull * u < room - 1.5 + 1.0 / (1.0 + u * u)
        low, high = np.where(short, u, low), np.where(short, high, u)
    u = 0.5 * (low + high)
    return np.asarray(3e-3 * r / (1.0 + u * u))
