# SPDX-License-Identifier: Apache-2.0
"""Pictures of a foot and of its moulds: sections with dimensions, and what goes where."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from ros_pad.contact.pad import Array
from ros_pad.making import Part, Plan
from ros_pad.making.solids import Solid
from ros_pad.reports.style import BLACK, PALE, VERMILION, Drawn

_LOOKS = {
    **{'lid': '#C9CED6', 'ring': '#9FB0C3', 'inner mould': '#E8B04B', 'bone': '#F4F1E8'},
    **{'cap': '#B9C2CC', 'retainer': '#9FB0C3', 'spacer': VERMILION, 'sheet': '#56B4E9'},
}
_SILICONE = '#7FC7A6'


def moulded(parts: Mapping[str, Part]) -> list[Part]:
    """Return what is in the closed mould, from the plate up as it is cast: sole up."""
    order = ('inner mould', 'bone', 'silicone', 'body', 'ring', 'spacer', 'sheet', 'lid')
    return [parts[name] for name in order if name in parts]


def assembled(parts: Mapping[str, Part]) -> list[Part]:
    """Return what is in the foot, from the floor up."""
    order = ('retainer', 'sheet', 'body', 'silicone', 'bone', 'cap')
    return [parts[name] for name in order if name in parts]


# --- sections ------------------------------------------------------------------------------------


def drawing(made: Plan, parts: Mapping[str, Part]) -> Figure:
    """Return the drawing with dimensions, mm: mould, foot, one pad, and a view from the floor."""
    figure, z, r = Figure(figsize=(16.0, 10.5)), made.z, made.r
    silicones = ' on '.join(dict.fromkeys((made.sheet.name, made.body.name)))
    title = f'{made.foot.source}, {made.process} process, {made.foot.pads} pads of {silicones}'
    figure.suptitle(f'{title}. Millimetres; sections through the axis, sole down')
    grid = figure.add_gridspec(2, 2, left=0.05, right=0.97, bottom=0.05, top=0.93, wspace=0.12)
    axes = figure.add_subplot(grid[0, 0])
    _cut(axes, moulded(parts), 'In the mould')
    _widths(axes, z['face'] + 9.0, {'mould': 'outer', 'flange': 'flange', 'seal': 'gasket'}, r)
    _widths(axes, -8.5, {'sole': 'sole'}, r)
    _levels(axes, r['outer'] + 4.0, {'ends of pins': 'sheet', 'roots of pins': 'face'}, z)
    axes = figure.add_subplot(grid[0, 1])
    _cut(axes, assembled(parts), 'The foot')
    _widths(axes, z['cap'] + 3.0, {'flange': 'flange', 'screws': 'screws', 'plenum': 'plenum'}, r)
    _widths(axes, -4.0, {'sole': 'sole'}, r)
    names = {'seat of the cap': 'stop', 'roof of the plenum': 'roof', 'top': 'cap'}
    _levels(axes, r['flange'] + 4.0, names, z)
    _pad(figure.add_subplot(grid[1, 0]), made, parts)
    axes = figure.add_subplot(grid[1, 1])
    title = f'From the floor: pads ⌀ {2.0 * r["pad"]:.2f}, pitch {made.pitch:.3f}; {made.screws}'
    _cut(axes, (), f'{title} screws M{made.set["screw"]:g} on ⌀ {2.0 * r["screws"]:.2f}')
    holder = parts['bone'] if 'bone' in parts else parts['retainer']
    body = parts['silicone'] if 'silicone' in parts else parts['body']
    _fill(axes, holder.solid.project(), holder)
    _fill(axes, body.solid.slice(z['sheet'] + 1e-3), body)
    axes.autoscale_view()
    return figure


def _cut(axes: Axes, parts: Sequence[Part], title: str) -> None:
    """Draw the section of parts through the plane y = 0."""
    axes.set_title(title, fontweight='bold')
    axes.set_aspect('equal')
    axes.set_axis_off()
    for part in parts:
        # About x, so that z is drawn upwards.
        _fill(axes, part.solid.rotate((-90.0, 0.0, 0.0)).slice(0.0), part)
    axes.autoscale_view()
    where = {'loc': 'upper center', 'ncols': 6, 'bbox_to_anchor': (0.42, -0.02), 'handlelength': 1}
    if parts:
        axes.legend(**where)


def _fill(axes: Axes, section: Any, part: Part) -> None:
    rings = [Path(np.vstack([each, each[:1]]), closed=True) for each in section.to_polygons()]
    if rings:
        path, colour = Path.make_compound_path(*rings), _LOOKS.get(part.name, _SILICONE)
        axes.add_patch(PathPatch(path, facecolor=colour, edgecolor=BLACK, lw=0.4, label=part.name))


def _widths(axes: Axes, level: float, names: Mapping[str, str], r: Mapping[str, float]) -> None:
    """Draw diameters, one above the other."""
    step = 2.6 if level > 0.0 else -2.6
    ends = axes.get_ylim()
    axes.set_ylim(min(level - 2.0, ends[0]), max(level + step * len(names), ends[1]))
    for row, (words, name) in enumerate(names.items()):
        y = level + row * step
        _arrow(axes, (-r[name], y), (r[name], y), f'{words} ⌀ {2.0 * r[name]:.2f}')


def _levels(axes: Axes, x: float, names: Mapping[str, str], z: Mapping[str, float]) -> None:
    """Draw heights above the floor at the right, apart from one another."""
    names, last = {'floor': '', 'bone': 'bone', 'flange': 'flange', **names}, -math.inf
    known = {words: z.get(name, 0.0) for words, name in names.items() if not name or name in z}
    for words, level in sorted(known.items(), key=lambda item: item[1]):
        last = max(level, last + 1.9)
        look = {'arrowstyle': '-', 'lw': 0.5, 'color': PALE}
        start, end = (x - 2.0, level), (x + 2.0, last)
        axes.annotate(f'{level:.2f} {words}', start, end, va='center', size=8, arrowprops=look)
    axes.set_xlim(-x, x + 22.0)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str) -> None:
    look = {'arrowstyle': '<->', 'lw': 0.7, 'shrinkA': 0.0, 'shrinkB': 0.0}
    axes.annotate('', start, end, arrowprops=look)
    x, y = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    if start[0] == end[0]:
        axes.text(x, y, f'  {words}', size=8, va='center')
    else:
        axes.text(x, y, words, size=8, ha='center', va='bottom')


def _pad(axes: Axes, made: Plan, parts: Mapping[str, Part]) -> None:
    """Draw the outermost pad of the section, and the dimensions that decide about its sheet."""
    z, r, pad = made.z, made.r, made.r['pad']
    row = made.places[np.abs(made.places[:, 1]) < 0.3 * pad]
    x = float((row if len(row) else made.places)[:, 0].max())
    _cut(axes, assembled(parts), 'One pad at the edge')
    left, side, low = x - 2.6 * pad, r['sole'] + 0.3 * pad, -0.3 * pad
    axes.set(xlim=(left, r['sole'] + 1.6 * pad), ylim=(-0.7 * pad, z['sheet'] + 2.2 * pad))
    mid, edge = z['sheet'] + 0.25 * pad, f'edge {r["sole"] - x - pad:.2f}'
    _arrow(axes, (x - pad, mid), (x + pad, mid), f'chamber ⌀ {2.0 * pad:.2f}')
    _arrow(axes, (x + pad, low), (r['sole'], low), edge)
    words = f'sheet {z["sheet"]:.2f} ± {made.set["tolerance"]:g}'
    _arrow(axes, (side, 0.0), (side, z['sheet']), words)
    if 'bone' in z:
        _arrow(axes, (side, z['sheet']), (side, z['bone']), f'under {made.set["under"]:.2f}')
        top, hole = z['bone'] + 0.45 * pad, r['hole']
        _arrow(axes, (x - hole, top), (x + hole, top), f'hole ⌀ {2.0 * hole:.2f}')


# --- what goes where -----------------------------------------------------------------------------


def exploded(made: Plan, parts: Mapping[str, Part]) -> Drawn:
    """Return the mould as it is stacked to cast, and the foot as it is screwed together."""
    mould = [part for part in moulded(parts) if part.name not in _CAST]
    figure = Figure(figsize=(11.0, 8.5))
    for left, title, stack in (
        (
            0.0,
            'The mould, sole up',
            [part._replace(solid=part.solid.rotate(_OVER)) for part in mould],
        ),
        (0.5, 'The foot, sole down', assembled(parts)),
    ):
        axes = figure.add_axes((left, 0.0, 0.5, 0.95))
        _cut(axes, (), title)
        _stack(axes, stack)
    alt = f'Exploded views: from below {", ".join(part.name for part in mould)}; and the foot.'
    caption = 'From below upwards in the order in which they are put together.'
    return Drawn(figure, 'What goes where', alt, caption)


_CAST = {
    'silicone': ',\ncast around the bone',
    'body': ',\ncast on the pins',
    'sheet': ',\ncast on the body',
}
# Parallel projection: right and up in the picture, and towards the eye.
_TURN, _TILT = math.radians(-60.0), math.radians(28.0)
_RIGHT = np.array([-math.sin(_TURN), math.cos(_TURN), 0.0])
_EYE = np.array([math.cos(_TURN), math.sin(_TURN), math.tan(_TILT)]) * math.cos(_TILT)
_UP = np.cross(_EYE, _RIGHT)
_OVER = (180.0, 0.0, 0.0)
_LIGHT = np.array([0.25, -0.45, 0.86])


def _stack(axes: Axes, parts: Sequence[Part]) -> None:
    """Draw parts above one another with room between them, and their names at the right.

    From below: each hides only what is below it.
    """
    level = 0.0
    for part in parts:
        low, wide, high = (part.solid.bounding_box()[k] for k in (2, 3, 5))
        corners, shades = _triangles(part.solid.translate((0.0, 0.0, level - low)), part)
        painted = PolyCollection(list(corners), facecolors=shades, edgecolors=shades, lw=0.8)
        painted.set_rasterized(True)
        axes.add_collection(painted)
        words, middle = part.name + _CAST.get(part.name, ''), (level + 0.5 * (high - low)) * _UP[2]
        axes.text(1.06 * wide, middle, words, va='center')
        level += high - low + 0.42 * wide
    axes.autoscale_view()
    axes.set_xlim(right=1.7 * axes.get_xlim()[1])


def _triangles(solid: Solid, part: Part) -> tuple[Array, Array]:
    """Return the triangles that face the eye, far ones first, and their colours."""
    size = solid.bounding_box()[3]
    mesh = solid.refine_to_length(max(0.06 * size, 0.6)).to_mesh()
    corners = np.asarray(mesh.vert_properties, float)[:, :3][np.asarray(mesh.tri_verts)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    depth = np.where(normals @ _EYE > 0.0, corners.mean(axis=1) @ _EYE, np.nan)
    order = np.argsort(depth)[: np.isfinite(depth).sum()]
    shade = 0.45 + 0.55 * np.clip(normals[order] @ _LIGHT, 0.0, 1.0)
    flat = np.stack([corners[order] @ _RIGHT, corners[order] @ _UP], axis=-1)
    return flat, shade[:, None] * np.array(to_rgb(_LOOKS.get(part.name, _SILICONE)))
