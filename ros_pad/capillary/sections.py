# SPDX-License-Identifier: Apache-2.0
"""Sections of a mesh: by half planes from an axis (slices), and by horizontal planes (layers)."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.crossings import Indices, crossed, cut, outlines
from ros_pad.capillary.mesh import Mesh
from ros_pad.contact.pad import Array
from ros_pad.errors import MeshError

_SMOOTH = math.cos(math.radians(40.0))  # of facets that belong to one wall
_INSIDE = 1e-9  # of the height: distance of the lowest and highest cut from floor and top


class Walls(NamedTuple):
    """Sections of the wall by half planes that start at the axis.

    Attributes
    ----------
    azimuths : array, shape (slices,)
        Azimuths of the half planes, rad.
    heights : array, shape (layers + 1,)
        Heights from the floor to the top, m.
    radii : array, shape (slices, layers + 1)
        Distance of the wall from the axis, m.
    inclinations : array, shape (slices, layers + 1)
        Angle between floor and wall, measured through the liquid, rad: pi/2 for a vertical wall,
        less where the wall overhangs the liquid.
    """

    azimuths: Array
    heights: Array
    radii: Array
    inclinations: Array


def _levels(mesh: Mesh, layers: int) -> tuple[Array, Array]:
    """Return heights of equal layers from floor to top, m, and where to cut: just inside."""
    heights = np.linspace(0.0, mesh.height, layers + 1)
    inside = _INSIDE * mesh.height, (1.0 - _INSIDE) * mesh.height
    return heights, heights.clip(*inside)


def walls(mesh: Mesh, layers: int, slices: int, axis: tuple[float, float]) -> Walls:
    """Cut the mesh by half planes that start at a vertical axis.

    Parameters
    ----------
    mesh : Mesh
        One pad.
    layers, slices : int
        Number of layers and of half planes, from 1.
    axis : tuple of float
        x and y of the axis, m.

    Raises
    ------
    MeshError
        Where a half plane does not meet the wall exactly once at some height: the axis is outside
        the pad, or the section is not star-shaped as seen from the axis.
    """
    heights, cuts = _levels(mesh, layers)
    azimuths = 2.0 * math.pi * np.arange(slices) / slices
    outward = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    # From each point to each plane; layers do not cut horizontal triangles.
    offset = (mesh.points[:, :2] - axis) @ np.stack([outward[:, 1], -outward[:, 0]])
    upright = np.flatnonzero(np.ptp(mesh.points[:, 2][mesh.faces], axis=1) > 0.0)
    beyond = (offset > 0.0)[mesh.faces[upright]]
    which, face = np.nonzero((beyond.any(axis=1) & ~beyond.all(axis=1)).T)
    face = upright[face]
    corners = np.concatenate([mesh.points[mesh.faces[face]], _smooth_normals(mesh, face)], axis=2)
    start, end = cut(corners, offset[mesh.faces[face], which[:, None]])

    row, layer = crossed(cuts, start[:, 2], end[:, 2])
    start, end, away = start[row], end[row], outward[which[row]]
    share = (cuts[layer] - start[:, 2]) / (end[:, 2] - start[:, 2])
    found = start + share[:, None] * (end - start)
    radius = np.sum((found[:, :2] - axis) * away, axis=1)
    leaves = np.where(end[:, 2] > start[:, 2], 1, -1)  # 1: leaves the solid, -1: enters it
    right = radius > 0.0
    cell = (which[row] * len(cuts) + layer)[right]
    count = np.bincount(cell, minlength=slices * len(cuts))
    turns = _summed(cell, leaves[right], count.size)
    for wrong, what in (
        (turns < 1, 'the axis is outside the pad'),
        (count > 1, 'a slice meets the wall more than once, so the section is not star-shaped'),
    ):
        if wrong.any():
            j, k = divmod(int(np.argmax(wrong)), heights.size)
            raise MeshError(
                f'{mesh.source}: {what} (z = {heights[k]:.4g} m,'
                f' {math.degrees(azimuths[j]):.3g} degrees from the x axis, axis through'
                f' x = {axis[0]:.4g}, y = {axis[1]:.4g} m); wet_pattern accepts any shape'
            )

    radii, inclinations = np.empty(count.size), np.empty(count.size)
    radii[cell] = radius[right]
    inclinations[cell] = np.arctan2(np.sum(found[:, 3:5] * away, axis=1), -found[:, 5])[right]
    shape = slices, len(cuts)
    return Walls(azimuths, heights, radii.reshape(shape), inclinations.reshape(shape))


def _smooth_normals(mesh: Mesh, face: Indices) -> Array:
    """Return unit normals of the wall at the corners of triangles, shape (n, 3, 3).

    Each is the mean normal of the triangles around the corner that belong to the same smooth wall,
    weighted by their angles at this corner. Triangles on the floor or at the top are not part of
    the wall.
    """
    points, faces = mesh.points, mesh.faces
    a, b, c = points[faces.T]
    flat = np.cross(b - a, c - a)
    size = np.linalg.norm(flat, axis=1)
    flat /= np.where(size > 0.0, size, 1.0)[:, None]
    edges = np.stack([b - a, c - b, a - c], axis=1)
    edges /= np.maximum(np.linalg.norm(edges, axis=2), 1e-300)[..., None]
    between = -np.einsum('ijk,ijk->ij', edges, edges[:, [2, 0, 1]])
    weight = np.arccos(np.clip(between, -1.0, 1.0))
    heights, tiny = points[:, 2][faces], 1e-6 * mesh.height
    level = (heights < tiny).all(axis=1) | (heights > mesh.height - tiny).all(axis=1)
    weight[level | (size == 0.0)] = 0.0

    order = np.argsort(faces.ravel(), kind='stable')  # corners of all triangles, sorted by point
    begin = np.searchsorted(faces.ravel()[order], np.arange(len(points) + 1))
    wanted, back = np.unique(3 * face[:, None] + np.arange(3), return_inverse=True)
    point = faces.ravel()[wanted]
    count = begin[point + 1] - begin[point]
    row = np.repeat(np.arange(wanted.size), count)
    within = np.arange(row.size) - np.repeat(np.cumsum(count) - count, count)
    near = order[begin[point][row] + within]
    alike = np.einsum('ij,ij->i', flat[wanted[row] // 3], flat[near // 3]) > _SMOOTH
    alike &= weight.ravel()[near] > 0.0
    share = np.where(alike, weight.ravel()[near], 0.0)
    mean = _units(
        np.stack(
            [np.bincount(row, share * flat[near // 3, k], wanted.size) for k in range(3)], axis=1
        )
    )
    inner = np.bincount(row, ~alike, wanted.size) == 0.0
    back = back.reshape(-1, 3)
    mean, inner = mean[back], inner[back]

    # At an edge of the wall the mean is one-sided. On an arc, the normal of a chord bisects the
    # normals at both ends of the chord: mirror the normal at the inner end.
    known = _units(np.sum(mean * inner[..., None], axis=1))
    across = flat[face]
    mirrored = 2.0 * np.sum(known * across, axis=1)[:, None] * across - known
    edge = ~inner & inner.any(axis=1)[:, None]
    return np.where(edge[..., None], mirrored[:, None], mean)


def _units(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


# --- Layers -----------------------------------------------------------------------------------


class Layers(NamedTuple):
    """Horizontal sections of a mesh; every array has shape (layers + 1,).

    Attributes
    ----------
    heights : array
        Heights of the sections, m.
    areas : array
        Area of the solid, m².
    wetted : array
        Area of the wall below each height, m².
    outline : array
        Length of the outline, m.
    pull : array
        Integral of sin(θ + a) along the outline, m, with contact angle θ and inclination a.
    gain : array
        Integral of (cos a + cos θ)/sin a along the outline, m: surface energy released per rise,
        over the tension. The energy released by horizontal faces above the floor is added at the
        nearest layer.
    """

    heights: Array
    areas: Array
    wetted: Array
    outline: Array
    pull: Array
    gain: Array


def layered(mesh: Mesh, layers: int, angle: float) -> Layers:
    """Cut the mesh by horizontal planes; the contact angle, rad, is for ``pull`` and ``gain``."""
    heights, cuts = _levels(mesh, layers)
    corners = mesh.points[mesh.faces]
    upright = np.flatnonzero(np.ptp(corners[:, :, 2], axis=1) > 0.0)
    corners = corners[upright]
    wall = np.concatenate([corners, _smooth_normals(mesh, upright)], axis=2)
    pieces = np.array_split(cuts, min(cuts.size, 1 + len(wall) * cuts.size // 2_000_000))
    areas, wetted, outline, pull, gain = np.concatenate(
        [_cut_level(wall, piece, angle) for piece in pieces], axis=1
    )
    gain += _freed_by_level_faces(mesh, heights, angle) / heights[1]
    return Layers(heights, areas, wetted, outline, pull, gain)


def _cut_level(wall: Array, cuts: Array, angle: float) -> Array:
    """Return all arrays of :class:`Layers` but ``heights``, for triangles with normals."""
    start, end, layer = outlines(wall, cuts)
    nx, ny, nz = 0.5 * (start + end)[:, 3:].T
    slope = np.arctan2(np.hypot(nx, ny), -nz)
    length = np.hypot(*(end - start)[:, :2].T)
    gain = (np.cos(slope) + math.cos(angle)) / np.maximum(np.sin(slope), 1e-12)
    return np.stack(
        [
            _summed(layer, 0.5 * _cross(start, end), cuts.size),
            _area_below(wall[:, :, :3], cuts),
            _summed(layer, length, cuts.size),
            _summed(layer, length * np.sin(angle + slope), cuts.size),
            _summed(layer, length * gain, cuts.size),
        ]
    )


def _freed_by_level_faces(mesh: Mesh, heights: Array, angle: float) -> Array:
    """Return the surface energy released at horizontal faces, over the tension, m².

    No layer cuts these faces: tops of lower bodies, over which the liquid spreads, and undersides.
    Floor and top of the mesh are excluded.
    """
    a, b, c = mesh.points[mesh.faces].transpose(1, 0, 2)
    z, tiny = np.stack([a, b, c])[:, :, 2], 1e-6 * mesh.height
    level = (np.ptp(z, axis=0) < tiny) & (z.min(axis=0) > tiny) & (z.max(axis=0) < z.max() - tiny)
    upward = 0.5 * _cross((b - a)[level], (c - a)[level])
    nearest = np.rint(z[0, level] / heights[1]).astype(np.int64).clip(1, heights.size - 2)
    return _summed(nearest, math.cos(angle) * np.abs(upward) - upward, heights.size)


def centre(mesh: Mesh, height: float) -> tuple[float, float]:
    """Return the centroid (x, y) of the section at a height, m."""
    start, end, _ = outlines(mesh.points[mesh.faces], np.array([height]))
    cross = _cross(start, end)
    x, y = ((start + end)[:, :2] * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    return float(x), float(y)


def _area_below(corners: Array, cuts: Array) -> Array:
    """Return the area of triangles below each cut, without horizontal ones, m²."""
    sizes = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    low, middle, high = np.sort(corners[:, :, 2], axis=1).T
    face, layer = crossed(cuts, low, high)
    z = cuts[layer]
    a, b, c = low[face], middle[face], high[face]
    with np.errstate(divide='ignore', invalid='ignore'):
        share = np.where(
            z < b,
            (z - a) ** 2 / ((b - a) * (c - a)),
            1.0 - (c - z) ** 2 / ((c - b) * (c - a)),
        )
    partly = _summed(layer, sizes[face] * share, cuts.size)
    done = np.searchsorted(cuts, high, 'left')
    wall = (high > low) & (done < cuts.size)
    return partly + np.cumsum(_summed(done[wall], sizes[wall], cuts.size))


def _cross(start: Array, end: Array) -> Array:
    cross: Array = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    return cross


def _summed(group: Indices, values: npt.NDArray[Any], count: int) -> Array:
    return np.bincount(group, values, count).astype(np.float64)
