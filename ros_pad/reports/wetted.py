# SPDX-License-Identifier: Apache-2.0
"""Figure of a wetted mesh: its wet part, the liquid around it, and a section through them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform

from ros_pad.capillary import Mesh, Wet, WetPattern, WetSurface
from ros_pad.capillary.sections import layered, walls
from ros_pad.reports.style import BLACK, BLUE, WET

Array = npt.NDArray[Any]

DRY = '#D9D4CC'  # silicone
WETTED = '#56B4E9'
_LIGHT = np.array([0.35, -0.65, 0.67])
_AZIMUTH = -62.0  # degrees, direction of view
_SURROUNDINGS = 3.0  # radii of the pad up to which a bath is drawn
_TALLEST = 0.84  # largest share of the height of the picture that the pad takes


@dataclass(frozen=True)
class Picture:
    """Corners of what to draw, mm.

    ``dry`` and ``wet`` are the triangles of the pad, shape (n, 3, 3); ``surface`` has the
    quadrangles of the liquid's surface, shape (n, 4, 3); ``line`` is the closed line where liquid,
    wall and air meet, shape (n, 3), empty for a pattern.
    """

    dry: Array
    wet: Array
    surface: Array
    line: Array


def picture(mesh: Mesh, found: Wet | WetPattern | WetSurface) -> Picture:
    """Return the picture of a wetted mesh."""
    triangles = 1e3 * mesh.points[mesh.faces]
    if isinstance(found, WetPattern):
        level = 1e3 * found.height
        # Without a solution, draw nothing wet, as for a single pad.
        dry, wetted = split(triangles, triangles[:, :, 2] - np.nan_to_num(level))
        return Picture(dry, wetted, _disc(mesh, found, level), np.empty((0, 3)))
    if isinstance(found, WetSurface):
        turns = np.arctan2(*(found.line[:, :2] - found.axis).T[::-1])
        heights, surface = found.line[:, 2], _near(mesh, found)[:, [0, 1, 2, 2]]
        line = 1e3 * np.concatenate([found.line, found.line[:1]])
    else:
        turns, heights = found.azimuths, np.nan_to_num(found.heights)
        grid = 1e3 * found.surface(9)
        grid = np.concatenate([grid, grid[:1]])
        surface, line = _quads(grid), grid[:, -1]
        surface = surface[np.isfinite(surface).all(axis=(1, 2))]
    x, y, z = np.moveaxis(triangles, 2, 0)
    around = np.arctan2(y - 1e3 * found.axis[1], x - 1e3 * found.axis[0])
    level = 1e3 * np.interp(around, turns, heights, period=2.0 * math.pi)
    return Picture(*split(triangles, z - level), surface, line)


def _near(mesh: Mesh, found: WetSurface) -> Array:
    """Return the triangles of a surface that are near the pad, mm."""
    corners = found.vertices[found.triangles]
    far = np.hypot(*np.moveaxis(corners[:, :, :2] - found.axis, 2, 0)).max(axis=1)
    wide = float(np.hypot(*(mesh.points[:, :2] - found.axis).T).max())
    return 1e3 * corners[far < _SURROUNDINGS * wide]


def split(triangles: Array, field: Array) -> tuple[Array, Array]:
    """Cut triangles where a field is 0; return the parts where it is positive, and the others.

    Parameters
    ----------
    triangles : array
        Corners, shape (n, 3, 3).
    field : array
        Value of the field at each corner, shape (n, 3); it is linear between the corners.
    """
    above = field > 0.0
    count = above.sum(axis=1)
    mixed = (count == 1) | (count == 2)
    ahead = count[mixed] == 1
    lone = np.argmax(above[mixed] == ahead[:, None], axis=1)
    rows = np.arange(lone.size)
    order = [(lone + step) % 3 for step in range(3)]
    a, b, c = (triangles[mixed][rows, each] for each in order)
    u, v, w = (field[mixed][rows, each][:, None] for each in order)
    ab, ac = a + u / (u - v) * (b - a), a + u / (u - w) * (c - a)
    tip = np.stack([a, ab, ac], axis=1)
    rest = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    twice = np.concatenate([ahead, ahead])
    return (
        np.concatenate([triangles[count == 3], tip[ahead], rest[~twice]]),
        np.concatenate([triangles[count == 0], tip[~ahead], rest[twice]]),
    )


def _disc(mesh: Mesh, found: WetPattern, level: float) -> Array:
    """Return the level surface of the liquid between pads, drawn as a disc."""
    if not math.isfinite(level):
        return np.empty((0, 4, 3))
    middle = 500.0 * (mesh.points.min(axis=0) + mesh.points.max(axis=0))[:2]
    reach = 1e3 * float(np.hypot(*(mesh.points[:, :2] - 1e-3 * middle).T).max())
    radii = np.linspace(0.0, max(1e3 * math.sqrt(found.area / math.pi), reach), 25)[:, None]
    turns = np.linspace(0.0, 2.0 * math.pi, 73)
    x, y = middle[0] + radii * np.cos(turns), middle[1] + radii * np.sin(turns)
    grid = np.stack([x, y, np.full(x.shape, level)], axis=2)
    return _quads(grid)


def _quads(grid: Array) -> Array:
    """Return the corners of the cells of a grid of points, shape (n, 4, 3)."""
    corners = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def draw(mesh: Mesh, found: Wet | WetPattern | WetSurface, direction: float = 0.0) -> Figure:
    """Draw the wetted mesh beside a section (single pad) or the free area by height (pattern).

    ``direction`` is the azimuth of the section, rad.
    """
    figure = Figure(figsize=(7.0, 2.7 if isinstance(found, WetPattern) else 2.2))
    body: Any = figure.add_axes((-0.12, -0.25, 0.80, 1.45), projection='3d', computed_zorder=False)
    plane = figure.add_axes((0.645, 0.17, 0.33, 0.70))
    _body(body, picture(mesh, found), 1.0 if isinstance(found, WetPattern) else 1.2)
    if isinstance(found, WetPattern):
        title = '(b) room between pads'
        _void(plane, mesh, found)
    else:
        title = f'(b) section at {math.degrees(direction):g}°'
        _section(plane, mesh, found, direction)
    for place, words in ((0.015, '(a) pad and liquid'), (0.60, title)):
        figure.text(place, 0.94, words, fontsize=8.0)
    figure.legend(
        *plane.get_legend_handles_labels(),
        loc='upper right',
        bbox_to_anchor=(0.99, 1.0),
        ncols=2,
        handlelength=1.2,
    )
    return figure


def _body(axes: Axes3D, drawn: Picture, zoom: float) -> None:
    parts = [(drawn.dry, DRY, 1.0), (drawn.wet, WETTED, 1.0), (drawn.surface, WET, 0.55)]
    colours = [shaded(triangles, colour, alpha) for triangles, colour, alpha in parts]
    axes.set_autoscale_on(False)
    fills = np.concatenate(colours)
    # Thin edges hide the seams between triangles of the pad, and show the grid of the surface.
    edges = fills.copy()
    edges[len(drawn.dry) + len(drawn.wet) :] = (*to_rgb(BLUE), 0.18)
    shapes = [each for part, _, _ in parts for each in part]
    faces = Poly3DCollection(shapes, facecolors=fills, edgecolors=edges, linewidths=0.25)
    axes.add_collection3d(faces)
    points = np.concatenate([part.reshape(-1, 3) for part, _, _ in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    span = float((high - low)[:2].max())
    middle = 0.5 * (low + high)
    axes.set_xlim(middle[0] - 0.5 * span, middle[0] + 0.5 * span)
    axes.set_ylim(middle[1] - 0.5 * span, middle[1] + 0.5 * span)
    axes.set_zlim(0.0, high[2])
    box = (1.0, 1.0, float(high[2]) / span)
    axes.set_box_aspect(box, zoom=0.95 * zoom)
    axes.view_init(10.0 if len(drawn.line) else 24.0, _AZIMUTH)
    axes.set_proj_type('persp')
    # Without a smaller zoom, a tall pad would be cut off.
    seen = np.column_stack(proj_transform(*points.T, axes.get_proj())[:2])
    tall = float(np.ptp(axes.transData.transform(seen)[:, 1])) / axes.figure.bbox.height
    axes.set_box_aspect(box, zoom=0.95 * zoom * min(1.0, _TALLEST / tall))
    if len(drawn.line):
        # Draw only the half of the line that is towards the viewer.
        turn = math.radians(_AZIMUTH)
        pieces = np.stack([drawn.line[:-1], drawn.line[1:]], axis=1)
        front = (pieces.mean(axis=1) - middle)[:, :2] @ (math.cos(turn), math.sin(turn)) > 0.0
        pieces = pieces[front & np.isfinite(pieces).all(axis=(1, 2))]
        if len(pieces):
            axes.add_collection3d(
                Line3DCollection(pieces, colors=BLUE, linewidths=1.4, capstyle='round', zorder=10)
            )
    axes.set_axis_off()


def shaded(triangles: Array, colour: str, alpha: float) -> Array:
    """Return the colour of each face under one light, shape (n, 4)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(length > 0.0, length, 1.0)
    bright = 0.68 + 0.32 * np.clip(normals @ (_LIGHT / np.linalg.norm(_LIGHT)), -0.6, 1.0)
    rgb = np.clip(bright[:, None] * to_rgb(colour), 0.0, 1.0)
    return np.column_stack([rgb, np.full(len(rgb), alpha)])


def _section(axes: Axes, mesh: Mesh, found: Wet | WetSurface, direction: float) -> None:
    slices = len(found.azimuths) if isinstance(found, Wet) else 360
    cut = walls(mesh, 200, slices, found.axis)
    step = 2.0 * math.pi / slices
    z, middle = 1e3 * cut.heights, 1e3 * np.array(found.axis)
    if isinstance(found, Wet):
        curve = 1e3 * found.surface(65)
    rows = [round((direction + turn) / step) % slices for turn in (math.pi, 0.0)]
    left, right = (1e3 * cut.radii[j] for j in rows)
    axes.fill_betweenx(z, -left, right, color=DRY, lw=0.0, label='pad')
    for j, side, r in zip(rows, (-1.0, 1.0), (left, right), strict=True):
        axes.plot(side * r, z, color=BLACK, lw=0.9)
        if isinstance(found, WetSurface):
            _cut_surface(axes, _near(mesh, found) - [*middle, 0.0], step * j, side)
            continue
        arc = np.hypot(*(curve[j, :, :2] - middle).T)
        if np.isfinite(arc).all():
            height = curve[j, :, 2]
            wall = np.interp(height, z, r)
            label = 'liquid' if side > 0.0 else None
            axes.fill_betweenx(height, side * wall, side * arc, color=WET, lw=0.0, label=label)
            axes.plot(side * arc, height, color=BLUE, lw=1.4)
            axes.plot(side * arc[-1:], height[-1:], 'o', color=BLUE, ms=3.5)
    axes.axhline(0.0, color=BLACK, lw=0.9)
    axes.set_ylim(-0.04 * z[-1], 1.05 * z[-1])
    axes.set_aspect('equal', adjustable='box')
    axes.set_xlabel('distance from the axis, mm')
    axes.set_ylabel('height, mm')


def _cut_surface(axes: Axes, triangles: Array, azimuth: float, side: float) -> None:
    """Draw the section of a surface round the axis by the half plane of an azimuth."""
    along = np.array([math.cos(azimuth), math.sin(azimuth)])
    places = np.stack([triangles[..., :2] @ along, triangles[..., 2]], axis=-1)
    off = triangles[..., :2] @ (-along[1], along[0]) + 1e-9  # through no corner
    ends = []
    for k in range(3):
        a, b = off[:, k], off[:, k - 2]
        share = np.where(a * b < 0.0, a / np.where(a == b, 1.0, a - b), np.nan)[:, None]
        ends.append(places[:, k] + share * (places[:, k - 2] - places[:, k]))
    segments = np.stack(ends, axis=1)
    crossed = np.isfinite(segments[..., 0]).sum(axis=1) == 2
    segments = segments[crossed][np.isfinite(segments[crossed][..., 0])].reshape(-1, 2, 2)
    segments = segments[segments[:, 0, 0] > 0.0] * (side, 1.0)
    label = 'liquid' if side > 0.0 else None
    axes.add_collection(LineCollection(list(segments), colors=BLUE, linewidths=1.4, label=label))
    axes.autoscale_view()


def _void(axes: Axes, mesh: Mesh, found: WetPattern) -> None:
    cut = layered(mesh, 200, 0.0)
    share = 1.0 - found.pads * cut.areas / found.area
    axes.plot(share, 1e3 * cut.heights, color=BLACK, lw=1.4)
    axes.fill_betweenx(1e3 * cut.heights, share, 1.0, color=DRY, lw=0.0, label='pads')
    if math.isfinite(found.height):
        below = cut.heights <= found.height
        axes.fill_betweenx(
            1e3 * cut.heights[below], 0.0, share[below], color=WET, lw=0.0, label='liquid'
        )
        axes.axhline(1e3 * found.height, color=BLUE, lw=1.4)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1e3 * mesh.height)
    axes.set_xlabel('share of the area')
    axes.set_ylabel('height, mm')
