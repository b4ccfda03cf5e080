# SPDX-License-Identifier: Apache-2.0
"""Pictures of a foot and of its moulds: sections with dimensions, and what goes where."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
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


def _colour(part: Part) -> str:
    return _LOOKS.get(part.name, _SILICONE)


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
    figure = Figure(figsize=(16.0, 10.5))
    figure.suptitle(
        f'{made.foot.source}, {made.process} process: {made.foot.pads} pads. Millimetres. Sections'
        ' through the axis; sole down, as the foot stands. Sheet: '
        f'{made.sheet.name}, body: {made.body.name}'
    )
    grid = figure.add_gridspec(
        2, 2, left=0.05, right=0.97, bottom=0.05, top=0.93, hspace=0.18, wspace=0.12
    )
    z, r = made.z, made.r
    axes = figure.add_subplot(grid[0, 0])
    _cut(axes, moulded(parts), 'In the mould')
    _widths(
        axes, z['face'] + 9.0, {'mould': r['outer'], 'flange': r['flange'], 'seal': r['gasket']}
    )
    _widths(axes, -8.5, {'sole': r['sole']})
    _levels(
        axes,
        r['outer'] + 4.0,
        {0.0: 'floor', z['sheet']: 'ends of pins'}
        | {z[name]: words for name, words in _LEVELS.items() if name in z and name != 'stop'},
    )
    axes = figure.add_subplot(grid[0, 1])
    _cut(axes, assembled(parts), 'The foot')
    _widths(
        axes, z['cap'] + 3.0, {'flange': r['flange'], 'screws': r['screws'], 'plenum': r['plenum']}
    )
    _widths(axes, -4.0, {'sole': r['sole']})
    levels = {0.0: 'floor', z['stop']: 'seat of the cap', z['roof']: 'roof of the plenum'}
    _levels(axes, r['flange'] + 4.0, levels | {z['cap']: 'top'})
    _pad(figure.add_subplot(grid[1, 0]), made, parts)
    _plan_view(figure.add_subplot(grid[1, 1]), made, parts)
    return figure


_LEVELS = {'bone': 'bone', 'flange': 'flange', 'top': 'plate', 'face': 'roots of pins'}


def _cut(axes: Axes, parts: Sequence[Part], title: str, names: bool = True) -> None:
    """Draw the section of parts through the plane y = 0."""
    axes.set_title(title, fontweight='bold')
    axes.set_aspect('equal')
    axes.set_axis_off()
    for part in parts:
        # About x, so that z is drawn upwards.
        _fill(axes, part.solid.rotate((-90.0, 0.0, 0.0)).slice(0.0), part)
    axes.autoscale_view()
    if not names:
        return
    handles = [
        PathPatch(Path([(0, 0)]), facecolor=_colour(part), edgecolor=BLACK) for part in parts
    ]
    axes.legend(
        handles, [part.name for part in parts], loc='upper center', ncols=len(parts),
        bbox_to_anchor=(0.42, -0.02), handlelength=1.0, columnspacing=1.0,
    )  # fmt: skip


def _fill(axes: Axes, section: Any, part: Part) -> None:
    polygons = [np.asarray(each) for each in section.to_polygons()]
    if not polygons:
        return
    path = Path.make_compound_path(*(Path(np.vstack([p, p[:1]]), closed=True) for p in polygons))
    axes.add_patch(PathPatch(path, facecolor=_colour(part), edgecolor=BLACK, lw=0.4))


def _widths(axes: Axes, level: float, radii: Mapping[str, float]) -> None:
    """Draw diameters, one above the other."""
    step = 2.6 if level > 0.0 else -2.6
    ends = axes.get_ylim()
    axes.set_ylim(min(level - 2.0, ends[0]), max(level + step * len(radii), ends[1]))
    for row, (name, radius) in enumerate(radii.items()):
        y = level + row * step
        _arrow(axes, (-radius, y), (radius, y), f'{name} ⌀ {2.0 * radius:.2f}')


def _levels(axes: Axes, x: float, levels: Mapping[float, str]) -> None:
    """Draw heights above the floor at the right, apart from one another."""
    last = -math.inf
    for level, name in sorted(levels.items()):
        last = max(level, last + 1.9)
        axes.annotate(
            f'{level:.2f} {name}', (x - 2.0, level), (x + 2.0, last), va='center',
            fontsize=8.0, arrowprops={'arrowstyle': '-', 'lw': 0.5, 'color': PALE},
        )  # fmt: skip
    axes.set_xlim(-x, x + 22.0)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str) -> None:
    style = {'arrowstyle': '<->', 'lw': 0.7, 'shrinkA': 0.0, 'shrinkB': 0.0}
    axes.annotate('', start, end, arrowprops=style)
    x, y = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    upright = start[0] == end[0]
    axes.annotate(
        words, (x, y), (4, 0) if upright else (0, 1), textcoords='offset points', fontsize=8.0,
        ha='left' if upright else 'center', va='center' if upright else 'bottom',
    )  # fmt: skip


def _pad(axes: Axes, made: Plan, parts: Mapping[str, Part]) -> None:
    """Draw the outermost pad of the section, and the dimensions that decide about its sheet."""
    z, r, use = made.z, made.r, made.set
    row = made.places[np.abs(made.places[:, 1]) < 0.3 * r['pad']]
    x = float((row if len(row) else made.places)[:, 0].max())
    large = made.process == 'large'
    high = z['sheet'] + (1.9 if large else 1.2) * r['pad'] + (0.8 if large else 0.0)
    _cut(axes, assembled(parts), 'One pad at the edge', names=False)
    left, right = x - 2.6 * r['pad'], r['sole'] + 1.6 * r['pad']
    axes.set(xlim=(left, right), ylim=(-0.7 * r['pad'], high + 0.3 * r['pad']))
    mid = z['sheet'] + 0.25 * r['pad']
    _arrow(axes, (x - r['pad'], mid), (x + r['pad'], mid), f'chamber ⌀ {2.0 * r["pad"]:.2f}')
    side = r['sole'] + 0.3 * r['pad']
    _arrow(axes, (side, 0.0), (side, z['sheet']), f'sheet {z["sheet"]:.2f} ± {use["tolerance"]:g}')
    edge = made.r['sole'] - x - r['pad']
    _arrow(axes, (x + r['pad'], -0.3 * r['pad']), (r['sole'], -0.3 * r['pad']), f'edge {edge:.2f}')
    if math.isfinite(made.pitch):
        low = -0.3 * r['pad']
        _arrow(axes, (left, low), (x, low), f'pitch {made.pitch:.3f} (cut off)')
    if large:
        _arrow(axes, (side, z['sheet']), (side, z['bone']), f'under {use["under"]:.2f}')
        top = z['bone'] + 0.45 * r['pad']
        _arrow(axes, (x - r['hole'], top), (x + r['hole'], top), f'hole ⌀ {2.0 * r["hole"]:.2f}')


def _plan_view(axes: Axes, made: Plan, parts: Mapping[str, Part]) -> None:
    """Draw the pads, the screws and the outlines from the floor."""
    axes.set_title('From the floor', fontweight='bold')
    axes.set_aspect('equal')
    axes.set_axis_off()
    holder = parts['bone'] if 'bone' in parts else parts['retainer']
    _fill(axes, holder.solid.project(), holder)
    body = parts['silicone'] if 'silicone' in parts else parts['body']
    _fill(axes, body.solid.slice(made.z['sheet'] + 1e-3), body)
    axes.autoscale_view()
    r = made.r
    axes.text(
        r['flange'] + 3.0, 0.0,
        f'{made.foot.pads} pads ⌀ {2.0 * r["pad"]:.2f}, pitch {made.pitch:.3f}\n'
        f'{made.screws} screws M{made.set["screw"]:g} on ⌀ {2.0 * r["screws"]:.2f}\n'
        f'draft {made.set["draft"]:g}°: pins ⌀ {2.0 * r["pad"]:.2f} to {2.0 * r["root"]:.2f}',
        va='center',
    )  # fmt: skip
    axes.set_xlim(-r['flange'] - 3.0, r['flange'] + 32.0)


# --- what goes where -----------------------------------------------------------------------------


class _View(NamedTuple):
    """Directions of a parallel projection: right and up in the picture, and towards the eye."""

    right: Array
    up: Array
    eye: Array


def _view(azimuth: float, height: float) -> _View:
    a, h = math.radians(azimuth), math.radians(height)
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    up = np.array([-math.sin(h) * math.cos(a), -math.sin(h) * math.sin(a), math.cos(h)])
    return _View(right, up, np.cross(right, up))


def exploded(made: Plan, parts: Mapping[str, Part]) -> Drawn:
    """Return the mould as it is stacked to cast, and the foot as it is screwed together."""
    mould = [part for part in moulded(parts) if part.name not in ('silicone', 'body', 'sheet')]
    figure = Figure(figsize=(11.0, 8.5))
    for place, title, stack, turn in (
        ((0.0, 0.0, 0.5, 0.95), 'The mould, sole up', mould, True),
        ((0.5, 0.0, 0.5, 0.95), 'The foot, sole down', assembled(parts), False),
    ):
        axes = figure.add_axes(place)
        axes.set_title(title, fontweight='bold')
        axes.set_aspect('equal')
        axes.set_axis_off()
        _stack(axes, stack, turn)
    names = [part.name for part in mould]
    return Drawn(
        figure,
        'What goes where',
        f'Exploded views: from below {", ".join(names)}; and the foot.',
        'From below upwards in the order in which they are put together.',
    )


_CAST = {
    'silicone': ',\ncast around the bone',
    'body': ',\ncast on the pins',
    'sheet': ',\ncast on the body',
}


def _stack(axes: Axes, parts: Sequence[Part], turn: bool) -> None:
    """Draw parts above one another with room between them, and their names at the right."""
    view, level = _view(-60.0, 28.0), 0.0
    corners, colours = [], []
    for part in parts:
        solid = part.solid.rotate((180.0, 0.0, 0.0)) if turn else part.solid
        low, wide, high = (solid.bounding_box()[k] for k in (2, 3, 5))
        solid = solid.translate((0.0, 0.0, level - low))
        points, shades = _triangles(solid, view, _colour(part))
        corners.append(points)
        colours.append(shades)
        middle = (level + 0.5 * (high - low)) * view.up[2]
        words = f'{part.name}{_CAST.get(part.name, "")}'
        axes.text(1.06 * wide, middle, words, va='center', ha='left')
        level += high - low + 0.42 * wide
    _paint(axes, corners, colours)
    axes.autoscale_view()
    low, high = axes.get_xlim()
    axes.set_xlim(low, high + 0.25 * (high - low))


def _triangles(solid: Solid, view: _View, colour: str) -> tuple[Array, Array]:
    """Return the triangles that face the eye, far ones first, and their colours."""
    from matplotlib.colors import to_rgb

    size = solid.bounding_box()[3]
    mesh = solid.refine_to_length(max(0.06 * size, 0.6)).to_mesh()
    corners = np.asarray(mesh.vert_properties, float)[:, :3][np.asarray(mesh.tri_verts)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    seen = normals @ view.eye > 0.0
    corners, normals = corners[seen], normals[seen]
    order = np.argsort(corners.mean(axis=1) @ view.eye)
    light = np.array([0.25, -0.45, 0.86])
    shade = 0.45 + 0.55 * np.clip(normals[order] @ light, 0.0, 1.0)
    flat = np.stack([corners[order] @ view.right, corners[order] @ view.up], axis=-1)
    return flat, shade[:, None] * np.array(to_rgb(colour))


def _paint(axes: Axes, corners: Sequence[Array], colours: Sequence[Array]) -> None:
    """Paint the parts one after the other, from below: each hides only what is below it."""
    for points, shades in zip(corners, colours, strict=True):
        axes.add_collection(
            PolyCollection(
                list(points), facecolors=shades, edgecolors=shades, lw=0.8, rasterized=True
            )
        )
