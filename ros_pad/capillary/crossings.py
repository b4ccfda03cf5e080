# SPDX-License-Identifier: Apache-2.0
"""Detection of overlaps in closed triangle meshes: surfaces that cross, and bodies inside bodies.

Where two surfaces cross, an edge of one passes through a triangle of the other. Where they only
coincide, a point just inside one body is inside the other. Corners in files are rounded, so bodies
that only touch can overlap slightly: what a shift of corners by ``ROUNDING`` removes is contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array

Indices: TypeAlias = npt.NDArray[np.int64]

ROUNDING = 5e-7  # of the largest coordinate: more than single precision and welding shift corners


class Overlap(NamedTuple):
    """An overlap: a triangle of each of the two surfaces, and a point of the overlap, m."""

    faces: tuple[int, int]
    place: Array


def first_overlap(
    points: Array, faces: Indices, edges: Indices, beside: Indices, bodies: Indices
) -> Overlap | None:
    """Return one place where closed bodies overlap or a body cuts itself; None if there is none.

    Parameters
    ----------
    points : array, shape (n, 3)
        Corners, m.
    faces : array of int, shape (m, 3)
        Corners of each triangle, anticlockwise as seen from outside.
    edges, beside : array of int, shape (3 m/2, 2)
        Both corners and both triangles of each edge.
    bodies : array of int, shape (m,)
        Number of the body of each triangle, from 0.
    """
    slack = ROUNDING * float(np.abs(points).max())
    for edge, face in _near(points, edges, faces, slack):
        found = _piercing(points[edges[edge]], points[faces[face]], slack)
        if found.size:
            one, other = int(edge[found[0]]), int(face[found[0]])
            (start, end), (a, b, c) = points[edges[one]], points[faces[other]]
            above, below = ((each - a) @ np.cross(b - a, c - a) for each in (start, end))
            place = start + above / (above - below) * (end - start)
            return Overlap((int(beside[one, 0]), other), place)
    return _nested(points[faces], bodies, slack)


def _piercing(segments: Array, triangles: Array, slack: float) -> Indices:
    """Return the indices of segments that pass through their triangle for every allowed shift."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    start, end = np.moveaxis(segments, 1, 0)
    heights = _dot(np.cross(b - a, c - a), start - a), _dot(np.cross(b - a, c - a), end - a)
    rest = np.flatnonzero(heights[0] * heights[1] < 0.0)
    a, b, c, start, end = (each[rest] for each in (a, b, c, start, end))
    turns = sum(_side(start, end, *side, slack) for side in ((a, b), (b, c), (c, a)))
    ends = _side(a, b, c, start, slack) * _side(a, b, c, end, slack)
    return rest[(np.abs(turns) == 3) & (ends < 0)]


def _side(a: Array, b: Array, c: Array, d: Array, slack: float) -> Indices:
    """Return the sign of the volume (b - a, c - a, d - a), 0 if a shift can change it."""
    u, v, w = b - a, c - a, d - a
    volume = _dot(np.cross(u, v), w)
    # A shift of one corner changes the volume in proportion to the opposite face, a shift of two
    # corners in proportion to the opposite edge.
    faces = sum(_length(np.cross(*two)) for two in ((u, v), (v, w), (w, u), (v - u, w - u)))
    edges = sum(_length(edge) for edge in (u, v, w, v - u, w - v, u - w))
    change = slack * (faces + slack * (edges + 4.0 * slack))
    return np.where(np.abs(volume) > change, np.sign(volume), 0.0).astype(np.int64)


def _nested(corners: Array, bodies: Indices, slack: float) -> Overlap | None:
    """Return a place where points just inside a body are inside another one."""
    members = [np.flatnonzero(bodies == body) for body in range(int(bodies.max()) + 1)]
    low = np.array([corners[mine].min(axis=(0, 1)) for mine in members])
    high = np.array([corners[mine].max(axis=(0, 1)) for mine in members])
    for body, mine in enumerate(members):
        meets = ((low < high[body] - slack) & (high > low[body] + slack)).all(axis=1)
        meets[body] = False
        if not meets.any():
            continue
        mine = mine[:: max(1, len(mine) // 200)]
        a, b, c = np.moveaxis(corners[mine], 1, 0)
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1)
        inside = (a + b + c) / 3.0 - 4.0 * slack * normal / np.maximum(size, 1e-300)[:, None]
        for other in np.flatnonzero(meets):
            for k in np.flatnonzero(((inside > low[other]) & (inside < high[other])).all(axis=1)):
                if size[k] > slack * slack and _turns(corners[members[other]] - inside[k]) > 0.5:
                    return Overlap((int(mine[k]), int(members[other][0])), inside[k])
    return None


def _turns(corners: Array) -> float:
    """Return the winding number of a surface around the origin: 1 inside a body, 0 outside.

    This is the sum of the solid angles of its triangles over 4 pi (A. van Oosterom and J.
    Strackee, IEEE Transactions on Biomedical Engineering 30, 1983).
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    p, q, r = np.linalg.norm(corners, axis=2).T
    beside = p * q * r + _dot(a, b) * r + _dot(b, c) * p + _dot(c, a) * q
    return float(np.arctan2(_dot(a, np.cross(b, c)), beside).sum()) / (2.0 * math.pi)


def _length(vectors: Array) -> Array:
    return np.linalg.norm(vectors, axis=-1)


def _dot(a: Array, b: Array) -> Array:
    dot: Array = np.einsum('...i,...i->...', a, b)
    return dot


# --- Pairs of boxes ---------------------------------------------------------------------------


class _Tree:
    """Boxes around edges or triangles in a binary tree: node k has the children 2k and 2k + 1.

    Each level, from the two children of the root, has ``low`` and ``high`` of the boxes, shape
    (3, nodes), and ``shared``: corners common to all members of a node, or ``none``.
    """

    def __init__(self, points: Array, members: Indices, depth: int, slack: float, none: int):
        corners = points[members]
        low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
        self.order = _along_curve(0.5 * (low + high))
        # Single precision is enough: the boxes are enlarged by more than its rounding.
        level = (
            _leaves(low[self.order], depth, np.float32, np.inf),
            _leaves(high[self.order], depth, np.float32, -np.inf),
            _leaves(members[self.order], depth, np.int64, none),
        )
        self.levels = [level]
        for _ in range(depth - 1):
            low, high, shared = level
            first, second = shared[:, ::2], shared[:, 1::2]
            both = (first[:, None] == second).any(axis=1)
            level = (
                np.minimum(low[:, ::2], low[:, 1::2]),
                np.maximum(high[:, ::2], high[:, 1::2]),
                np.where(both, first, none),
            )
            self.levels.append(level)
        self.levels.reverse()


def _along_curve(places: Array) -> Indices:
    """Return the order of places along Morton's curve, in which neighbours stay close."""
    low, size = places.min(axis=0), float(np.ptp(places, axis=0).max())
    cell = (1023.0 / size * (places - low)).astype(np.int64)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):
        cell = (cell | cell << shift) & mask  # leaves two zeros between bits
    return np.argsort(cell @ np.array([1, 2, 4]), kind='stable')


def _leaves(values: npt.NDArray[Any], depth: int, kind: type, rest: float) -> npt.NDArray[Any]:
    filled: npt.NDArray[Any] = np.full((values.shape[1], 1 << depth), rest, dtype=kind)
    filled[:, : len(values)] = values.T
    return filled


def _near(
    points: Array, edges: Indices, faces: Indices, slack: float
) -> Iterator[tuple[Indices, Indices]]:
    """Yield batches of edges and triangles whose boxes intersect and that share no corner.

    SciPy's trees are not used, because they search points with one radius for all: a single large
    triangle would make all small ones neighbours.
    """
    depth = (len(edges) - 1).bit_length()
    one = _Tree(points, edges, depth, slack, -1)
    other = _Tree(points, faces, depth, slack, -2)
    a: Indices = np.zeros(1, dtype=np.int64)
    b = a  # the roots
    waiting = [(0, a, b)]
    while waiting:
        level, a, b = waiting.pop()
        if a.size > 1 << 18:  # limits the memory
            half = a.size // 2
            waiting += [(level, a[:half], b[:half]), (level, a[half:], b[half:])]
        elif level == depth:
            yield one.order[a], other.order[b]
        else:
            a = (2 * a[:, None] + np.array([0, 0, 1, 1])).ravel()
            b = (2 * b[:, None] + np.array([0, 1, 0, 1])).ravel()
            low, high, corners = one.levels[level]
            lowest, highest, others = other.levels[level]
            for axis in range(3):
                meet = low[axis].take(a) <= highest[axis].take(b)
                meet &= lowest[axis].take(b) <= high[axis].take(a)
                a, b = a[meet], b[meet]
            # Drop pairs that share a corner; otherwise fans of many thin triangles would be
            # compared with all their own edges.
            apart = np.ones(a.size, dtype=bool)
            for mine in corners:
                for its in others:
                    apart &= mine.take(a) != its.take(b)
            waiting.append((level + 1, a[apart], b[apart]))
