# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes cut by planes, and overlaps found in the cuts.

Corners have x, y, z and whatever else is to be interpolated. Both triangles at an edge get exactly
the same point of a cut, so that outlines are closed.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array

Indices: TypeAlias = npt.NDArray[np.int64]

LAYERS, LINES = 128, 256
"""Number of horizontal planes, and of lines in each of them, on which overlaps are looked for.

A body that is flatter than the distance of two planes, 0.8 % of the height, may lie between them
unseen.
"""
ROUNDING = 1e-4
"""Share of the volume that may be counted twice, as where bodies touch and a file has rounded."""


def crossed(cuts: Array, start: Array, end: Array) -> tuple[Indices, Indices]:
    """Return all pairs (span, cut) with the cut, one of rising numbers, inside the span."""
    first = np.searchsorted(cuts, np.minimum(start, end), 'left')
    last = np.searchsorted(cuts, np.maximum(start, end), 'left')
    count = last - first
    row = np.repeat(np.arange(count.size), count)
    within = np.arange(row.size) - np.repeat(np.cumsum(count) - count, count)
    return row, first[row] + within


def cut(corners: Array, offsets: Array) -> tuple[Array, Array]:
    """Cut triangles by planes: return start and end of each cut, with the solid on the left.

    Parameters
    ----------
    corners : array, shape (n, 3, k)
        Values at the corners of each triangle.
    offsets : array, shape (n, 3)
        Distance of each corner from the plane that cuts its triangle, above 0 on the side from
        which the cut is seen.
    """
    rows = np.arange(len(corners))
    above = offsets > 0.0
    ahead = above.sum(axis=1) == 1
    lone = np.argmax(above == ahead[:, None], axis=1)
    ends = []
    for step in (1, 2):
        other = (lone + step) % 3
        low, high = np.where(ahead, other, lone), np.where(ahead, lone, other)
        below = offsets[rows, low]
        share = (below / (below - offsets[rows, high]))[:, None]
        ends.append(corners[rows, low] + share * (corners[rows, high] - corners[rows, low]))
    ahead = ahead[:, None]
    return np.where(ahead, ends[0], ends[1]), np.where(ahead, ends[1], ends[0])


def outlines(corners: Array, cuts: Array) -> tuple[Array, Array, Indices]:
    """Cut triangles at heights: return start and end of each cut, and the number of its height."""
    z = corners[:, :, 2]
    face, layer = crossed(cuts, z.min(axis=1), z.max(axis=1))
    return *cut(corners[face], z[face] - cuts[layer][:, None]), layer


def overlap(corners: Array) -> Array | None:
    """Return a place where closed bodies overlap or a body cuts itself, m; None without any.

    Along a line through closed bodies one is alternately outside and inside. A line that enters
    again before it has left counts the solid there twice, as any section would.

    Parameters
    ----------
    corners : array, shape (n, 3, 3)
        Corners of each triangle, m, anticlockwise as seen from outside.
    """
    low, size = corners.min(axis=(0, 1)), np.ptp(corners, axis=(0, 1))
    # No multiple of 1/2, at which made-up meshes have their corners.
    heights = low[2] + size[2] * (np.arange(LAYERS) + 0.618) / LAYERS
    lines = low[1] + size[1] * (np.arange(LINES) + 0.382) / LINES
    start, end, layer = outlines(corners, heights)
    row, line = crossed(lines, start[:, 1], end[:, 1])
    start, end = start[row], end[row]
    x = start[:, 0] + (lines[line] - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end - start)[:, 0]
    order = np.lexsort((x, LINES * layer[row] + line))
    depth = np.cumsum(np.where(end[:, 1] < start[:, 1], 1, -1)[order])[:-1]
    length = np.diff(x[order])
    twice = np.where((depth < 0) | (depth > 1), length, 0.0)
    if twice.sum() <= ROUNDING * length[depth > 0].sum():
        return None
    longest = order[np.argmax(twice)]
    middle = x[longest] + 0.5 * twice.max()
    return np.array([middle, lines[line[longest]], heights[layer[row[longest]]]])
