# SPDX-License-Identifier: Apache-2.0
"""Where the pads of a round sole are: a hexagonal pattern with room at the edge for wall and skin.

Design, explorer, moulds and their checks have their places from here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ros_pad.contact.pad import Array

LARGE = 1e-3
"""Pads of this radius, m, or more are made by the large process (a bone in the sole)."""

LINING, WALL, SKIN, RIM = 0.3e-3, 0.8e-3, 1.0e-3, 1.0e-3
"""Room beside the outermost pad, m: in a sole with a bone the lining of its hole, the wall of the
bone and the skin around it; in a sole without one a rim of silicone."""


def edge_of(radius: float) -> float:
    """Return the room between the rim of the outermost pad of a radius and the sole's edge, m."""
    return LINING + WALL + SKIN if radius >= LARGE else RIM


def hexagonal(count: int) -> Array:
    """Return the places of so many points of a hexagonal lattice of distance 1, nearest first.

    Full rings (1, 7, 19, 37, ..., 217, 331) are whole hexagons. Otherwise they are the points
    nearest to the origin; where only some at the same distance are left, they are spread evenly
    around it.
    """
    reach = int(math.sqrt(count)) + 2
    i, j = (each.ravel() for each in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    places = np.column_stack([i + 0.5 * j, math.sqrt(0.75) * j])
    turn = np.round(np.arctan2(places[:, 1], places[:, 0]), 9)
    square = (i * i + i * j + j * j).astype(float)
    rings = round((math.sqrt(12.0 * count - 3.0) - 3.0) / 6.0)
    if 3 * rings * (rings + 1) + 1 == count:
        square[np.abs([i, j, i + j]).max(axis=0) > rings] = math.inf
    order = np.lexsort((turn, square))
    last = np.sort(square)[count - 1]
    inner, shell = order[square[order] < last], order[square[order] == last]
    left = count - len(inner)
    spread = shell[np.arange(left) * len(shell) // left]
    chosen: Array = places[np.concatenate([inner, spread])]
    return chosen


class Layout(NamedTuple):
    """The pads on a round sole.

    Attributes
    ----------
    places : array, (pads, 2)
        Centres of the pads about that of the sole, m.
    pitch : float
        Distance of neighbours, m; infinite for one pad, 0 or below if there is no room.
    """

    places: Array
    pitch: float

    @classmethod
    def of(cls, pads: int, radius: float, sole_radius: float, edge: float | None = None) -> Layout:
        """Spread pads over a sole.

        Parameters
        ----------
        pads : int
            Number of pads, from 1.
        radius, sole_radius : float
            Radius of a pad and of the sole, m.
        edge : float, optional
            Room between the outermost pad and the edge of the sole, m; by default :func:`edge_of`.
        """
        places = hexagonal(pads)
        places = places - places.mean(axis=0)
        room = sole_radius - radius - (edge_of(radius) if edge is None else edge)
        if pads == 1:
            return cls(places, math.inf)
        pitch = room / reach_of(places)
        return cls(pitch * places, pitch)


def reach_of(places: Array) -> float:
    """Return the distance of the outermost place."""
    return float(np.hypot(*places.T).max())


def pads_at(pitch: float, radius: float, sole_radius: float) -> int:
    """Return how many pads of a radius fit on a sole at a pitch, m, around one in the middle."""
    room = (sole_radius - radius - edge_of(radius)) / pitch * (1.0 + 1e-12)
    if room < 0.0:
        return 0
    rows = np.arange(-math.floor(room / math.sqrt(0.75)), math.floor(room / math.sqrt(0.75)) + 1)
    half, shift = np.sqrt(room * room - 0.75 * rows * rows), 0.5 * (rows % 2)
    return int((np.floor(half - shift) + np.floor(half + shift) + 1.0).sum())
