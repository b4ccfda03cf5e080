# SPDX-License-Identifier: Apache-2.0
"""Detection of overlaps in closed triangle meshes: surfaces that cross, and bodies inside bodies.

Where two triangles cross, their common segment ends where an edge of one passes through the other.
So the search is for edges close to a triangle with which they share no corner; then both triangles
at such an edge are tested against this triangle.

Corners in files are rounded, so bodies that only touch can overlap slightly. An overlap is
reported only if no shift of corners by up to ``ROUNDING`` removes it: every deciding quantity must
be larger than the change that such shifts can cause. So contact alone is never reported, even with
very thin triangles, and an overlap of many times ``ROUNDING`` is always reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.contact.pad import Array

Indices: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]

ROUNDING = 5e-7  # of the largest coordinate: more than single precision and welding shift corners
_AT_ONCE = 1 << 18  # pairs of nodes tested together: limits the memory


class Overlap(NamedTuple):
    """An overlap: a triangle of each of the two surfaces, and a point of the overlap, m."""

    faces: tuple[int, int]
    place: Array


def first_overlap(
    points: Array, faces: Indices, edges: Indices, beside: Indices, bodies: Indices
) -> Overlap | None:
    """Return one place where closed bodies overlap or a body cuts itself; None if there is none.

    Surfaces that cross exactly along edges of both count as touching, and are not reported.

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
    third = faces[beside].sum(axis=2) - edges.sum(axis=1, keepdims=True)  # opposite corners
    for edge, face in _near(points, edges, faces, slack):
        met = _meeting(points[edges[edge]], points[faces[face]], slack)
        edge, face = edge[met], face[met]
        found = _passing(points[edges[edge]], points[third[edge]], points[faces[face]], slack)
        if found.any():
            k = int(np.argmax(found))
            start, end = points[edges[edge[k]]]
            where = _piece(start, end, points[faces[face[k]]])[1]
            return Overlap((int(beside[edge[k], 0]), int(face[k])), where)
        one, other = beside[edge].ravel(), np.repeat(face, 2)
        for overlapping, place in ((_crossing, _on_line), (_coinciding, _in_plane)):
            found = overlapping(points, faces[one], faces[other], slack)
            if found.any():
                k = int(np.argmax(found))
                where = place(points[faces[one[k]]], points[faces[other[k]]])
                return Overlap((int(one[k]), int(other[k])), where)
    return _nested(points[faces], bodies, slack)


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
        if a.size > _AT_ONCE:
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


def _meeting(segments: Array, triangles: Array, slack: float) -> Indices:
    """Return the indices of segments that may meet their triangle, including some that do not."""
    a, b, c = (triangles[:, k] - segments[:, 0] for k in range(3))
    along = segments[:, 1] - segments[:, 0]
    normal = np.cross(b - a, c - a)
    start = -_dot(a, normal)
    end = start + _dot(along, normal)
    near = 4.0 * slack * np.linalg.norm(normal, axis=1)
    level = np.flatnonzero((np.minimum(start, end) <= near) & (np.maximum(start, end) >= -near))
    a, b, c, along = a[level], b[level], c[level], along[level]
    turns = np.stack([_dot(along, np.cross(*two)) for two in ((a, b), (b, c), (c, a))])
    reach = np.sqrt(np.max([_dot(each, each) for each in (a, b, c, along)], axis=0))
    near = 4.0 * slack * reach * np.linalg.norm(along, axis=1)
    within = (turns >= -near).all(axis=0) | (turns <= near).all(axis=0)
    return level[within]


# --- Pairs of triangles -----------------------------------------------------------------------


def _crossing(points: Array, one: Indices, other: Indices, slack: float) -> Flags:
    """Return which pairs of triangles, given by their corners, cross for every allowed shift."""
    same = one[:, :, None] == other[:, None]
    shared = same.sum(axis=(1, 2))
    # Put a shared corner first; triangles with two shared corners are neighbours and do not cross.
    first, second = same.any(axis=2).argmax(axis=1), same.any(axis=1).argmax(axis=1)
    a, b = points[_turned(one, first)], points[_turned(other, second)]
    crossing = np.zeros(len(one), dtype=bool)
    rough = _both_sides(_dot(_normals(b)[:, None], a - b[:, :1]))
    rest = np.flatnonzero(rough & (shared < 2))
    over = _sides(a[rest], b[rest], slack)
    rest, over = rest[_both_sides(over)], over[_both_sides(over)]
    under = _sides(b[rest], a[rest], slack)
    rest, over, under = (each[_both_sides(under)] for each in (rest, over, under))
    # From a shared corner each triangle covers a segment of the common line of both planes: the
    # triangles cross if the two segments have the same direction.
    crossing[rest] = over[:, 1] * under[:, 1] < 0
    alone = shared[rest] == 0
    rest, over, under = rest[alone], over[alone], under[alone]
    crossing[rest] = True
    # Where a shift can move a corner to the other side of a plane, try both sides: the triangles
    # must cross in every case.
    for here in (-1, 1):
        for there in (-1, 1):
            sides = np.where(over == 0, here, over), np.where(under == 0, there, under)
            crossing[rest] &= _interlaced(a[rest], b[rest], *sides, slack)
    return crossing


def _interlaced(a: Array, b: Array, over: Indices, under: Indices, slack: float) -> Flags:
    """Return which triangles share a segment of the line in which their planes intersect.

    The corners p, q, r of each triangle are permuted until p is alone on the upper side of the
    other plane. Then the segments end on the edges pq and pr; the signs of volumes between these
    edges give the order of the ends (P. Guigue and O. Devillers, Journal of Graphics Tools 8,
    2003).
    """
    up, down = -over.sum(axis=1, keepdims=True), -under.sum(axis=1, keepdims=True)
    a = _turned(a, np.argmax(over == up, axis=1))
    b = _turned(b, np.argmax(under == down, axis=1))
    a = np.where(down[:, None] < 0, a[:, [0, 2, 1]], a)
    b = np.where(up[:, None] < 0, b[:, [0, 2, 1]], b)
    first = _side(a[:, 0], a[:, 1], b[:, 0], b[:, 1], slack)
    second = _side(a[:, 0], a[:, 2], b[:, 0], b[:, 2], slack)
    return (first < 0) & (second > 0)


def _coinciding(points: Array, one: Indices, other: Indices, slack: float) -> Flags:
    """Return which triangles lie in one plane, overlap, and face the same way."""
    a, b = points[one], points[other]
    normals = _normals(a), _normals(b)
    coinciding = _dot(*normals) > 0.0
    rest = np.flatnonzero(coinciding)
    a, b, up = a[rest], b[rest], _units(normals[0][rest] + normals[1][rest])
    found = _overlaid(up, a, b, slack) & _overlaid(up, b, a, slack)
    coinciding[rest] = found
    rest, a, b = rest[found], a[found], b[found]
    coinciding[rest] = ~(_sides(a, b, slack).any(axis=1) | _sides(b, a, slack).any(axis=1))
    return coinciding


def _passing(edges: Array, third: Array, triangles: Array, slack: float) -> Flags:
    """Return which edges lie in a triangle and have their own two triangles on its two sides."""
    normals = _normals(triangles)
    passing = _both_sides(_dot(normals[:, None], third - triangles[:, :1]))
    rest = np.flatnonzero(passing)
    edges, third, triangles, up = edges[rest], third[rest], triangles[rest], _units(normals[rest])
    left, right = (
        _left(up, edges[:, k], edges[:, 1 - k], triangles, slack).any(axis=1) for k in (0, 1)
    )
    found = left & right & _overlaid(up, edges, triangles, slack)
    passing[rest] = found
    edges, third, triangles = edges[found], third[found], triangles[found]
    within = ~_sides(edges, triangles, slack).any(axis=1)
    passing[rest[found]] = within & _both_sides(_sides(third, triangles, slack))
    return passing


def _overlaid(up: Array, inner: Array, outer: Array, slack: float) -> Flags:
    """Return where an edge or triangle (``inner``) may overlap a triangle, as seen from above.

    True unless all corners of ``inner`` are beyond one side of the triangle.
    """
    overlaid: Flags = np.ones(len(up), dtype=bool)
    for k in range(3):
        overlaid &= _left(up, outer[:, k], outer[:, (k + 1) % 3], inner, slack).any(axis=1)
    return overlaid


def _left(up: Array, start: Array, end: Array, corners: Array, slack: float) -> Flags:
    """Return which corners are left of a line, as seen from above, for every allowed shift."""
    start, end = start[:, None], end[:, None]
    area = _dot(up[:, None], np.cross(end - start, corners - start))
    around = sum(_length(side) for side in (end - start, corners - start, corners - end))
    left: Flags = area > slack * (around + 3.0 * slack)
    return left


def _sides(corners: Array, triangles: Array, slack: float) -> Indices:
    """Return the side of a triangle's plane for each corner, 0 if a shift can change it."""
    a, b, c = (triangles[:, k, None] for k in range(3))
    return _side(a, b, c, corners, slack)


def _side(a: Array, b: Array, c: Array, d: Array, slack: float) -> Indices:
    """Return the sign of the volume (b - a, c - a, d - a), 0 if a shift can change it."""
    u, v, w = np.broadcast_arrays(b - a, c - a, d - a)
    volume = _dot(np.cross(u, v), w)
    # A shift of one corner changes the volume in proportion to the opposite face, a shift of two
    # corners in proportion to the opposite edge.
    faces = sum(_length(np.cross(*two)) for two in ((u, v), (v, w), (w, u), (v - u, w - u)))
    edges = sum(_length(edge) for edge in (u, v, w, v - u, w - v, u - w))
    change = slack * (faces + slack * (edges + 4.0 * slack))
    return np.where(np.abs(volume) > change, np.sign(volume), 0.0).astype(np.int64)


def _both_sides(signs: npt.NDArray[Any]) -> Flags:
    both: Flags = (signs.max(axis=1) > 0) & (signs.min(axis=1) < 0)
    return both


def _turned(corners: npt.NDArray[Any], first: Indices) -> npt.NDArray[Any]:
    """Return triangles with their corners rotated so that the given one is first."""
    turned: npt.NDArray[Any] = corners[
        np.arange(len(corners))[:, None], (first[:, None] + [0, 1, 2]) % 3
    ]
    return turned


def _normals(triangles: Array) -> Array:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.cross(b - a, c - a)


def _units(vectors: Array) -> Array:
    return vectors / np.maximum(_length(vectors), 1e-300)[..., None]


def _length(vectors: Array) -> Array:
    return np.linalg.norm(vectors, axis=-1)


def _dot(a: Array, b: Array) -> Array:
    dot: Array = np.einsum('...i,...i->...', a, b)
    return dot


def _on_line(a: Array, b: Array) -> Array:
    """Return the middle of the common segment of two triangles that cross."""
    normals = np.cross(a[1] - a[0], a[2] - a[0]), np.cross(b[1] - b[0], b[2] - b[0])
    ends = []
    for each, height in ((a, (a - b[0]) @ normals[1]), (b, (b - a[0]) @ normals[0])):
        for k in range(3):
            start, end = height[k - 1], height[k]
            if (start > 0.0) != (end > 0.0):
                ends.append(each[k - 1] + start / (start - end) * (each[k] - each[k - 1]))
    along = np.cross(*normals)
    ends.sort(key=lambda end: float(end @ along))
    place: Array = 0.5 * (ends[1] + ends[2])
    return place


def _in_plane(a: Array, b: Array) -> Array:
    """Return the middle of the longest piece of an edge of one triangle inside the other."""
    pieces = [
        _piece(each[k - 1], each[k], other) for each, other in ((a, b), (b, a)) for k in range(3)
    ]
    return max(pieces, key=lambda piece: piece[0])[1]


def _piece(start: Array, end: Array, triangle: Array) -> tuple[float, Array]:
    """Return length and middle of the part of an edge that a triangle covers."""
    sides = np.roll(triangle, -1, axis=0) - triangle
    inward = np.cross(np.cross(sides[0], sides[1]), sides)
    first, last = 0.0, 1.0
    for here, there in zip(
        _dot(start - triangle, inward), _dot(end - triangle, inward), strict=True
    ):
        if here < 0.0 and there < 0.0:
            last = -1.0
        elif here < 0.0 < there:
            first = max(first, here / (here - there))
        elif there < 0.0 < here:
            last = min(last, here / (here - there))
    length = (last - first) * float(np.linalg.norm(end - start))
    return length, start + 0.5 * (first + last) * (end - start)


# --- Bodies inside bodies ---------------------------------------------------------------------


def _nested(corners: Array, bodies: Indices, slack: float) -> Overlap | None:
    """Return a place where a body is completely inside another, for bodies that do not cross."""
    order = np.argsort(bodies, kind='stable')
    begin = np.searchsorted(bodies[order], np.arange(int(bodies.max()) + 1))
    low = np.minimum.reduceat(corners.min(axis=1)[order], begin)
    high = np.maximum.reduceat(corners.max(axis=1)[order], begin)
    members = np.split(order, begin[1:])
    for body, mine in enumerate(members):
        around = ((low <= low[body] + slack) & (high >= high[body] - slack)).all(axis=1)
        around[body] = False
        if around.any():
            # A point behind the centre of the body's largest triangle is inside the body.
            a, b, c = np.moveaxis(corners[mine], 1, 0)
            normals = np.cross(b - a, c - a)
            areas = np.linalg.norm(normals, axis=1)
            k = int(np.argmax(areas))
            place = (a + b + c)[k] / 3.0 - 4.0 * slack * normals[k] / areas[k]
            for its in (members[other] for other in np.flatnonzero(around)):
                if _turns(corners[its] - place) > 0.5:
                    return Overlap((int(mine[k]), int(its[0])), place)
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
