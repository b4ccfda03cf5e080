# SPDX-License-Identifier: Apache-2.0
"""The map of a walk, to scale: wet ground, path of the body, and where feet stood and slid."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ros_pad.reports.style import BLACK, PALE, VERMILION, WET, WIDE, Drawn
from ros_pad.reports.view import View

_ROW_GAP = 0.4  # inches between the rows of a map


def _extent(view: View) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the ground that was walked on, m."""
    places = [np.array([s.touched for s in view.stances]).reshape(-1, 2), view.trial.body[:, :2]]
    points = np.concatenate(places)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return (-0.5, 0.5, -0.5, 0.5)
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    margin = 0.1 + 0.5 * max(0.0, 0.1 - (top - bottom))
    return left - 0.12, right + 0.12, bottom - margin, top + margin


def rows_of(view: View) -> int:
    """Return the number of rows, 1 to 4, into which a long path is folded to keep feet visible."""
    left, right, bottom, top = _extent(view)
    return min(4, max(1, math.ceil((right - left) / (top - bottom) / 8.0)))


def _draw_ground(ax: Axes, view: View, left: float, right: float) -> None:
    """Draw the wet ground of a part of the map."""
    _, _, bottom, top = _extent(view)
    ax.set_aspect('equal')
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    floor = view.trial.floor
    if floor is None:
        return
    # Limit the number of pixels for a very long walk.
    cell = max(min(0.01, floor.cell), (right - left) / 4000.0, (top - bottom) / 4000.0)
    x = np.arange(left, right, cell) + 0.5 * cell
    y = np.arange(bottom, top, cell) + 0.5 * cell
    wet = floor.wet_along(*np.meshgrid(x, y))
    ax.imshow(
        np.where(wet[:, :, None], matplotlib.colors.to_rgb(WET), 1.0),
        extent=(left, left + len(x) * cell, bottom, bottom + len(y) * cell),
        origin='lower',
        interpolation='nearest',
        zorder=0,
    )
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)


def _draw_path(ax: Axes, view: View, size: float) -> None:
    """Draw the path of the body, slip paths and footprints of ``size`` points."""
    body = view.trial.body[:, :2]
    body = body[np.isfinite(body).all(axis=1)]
    if len(body):
        ax.plot(*body[:: max(1, len(body) // 2000)].T, color=BLACK, linewidth=0.2 * size, zorder=2)
        ends = {'>': body[0], 's': body[-1]}
        for marker, (x, y) in ends.items():
            ax.plot(x, y, marker, color=BLACK, markersize=1.5 * size, zorder=4, clip_on=False)
    for stance in view.stances:
        (x0, y0), (x1, y1) = stance.touched, stance.left
        colour = VERMILION if stance.dome else BLACK
        ax.plot([x0, x1], [y0, y1], color=colour, linewidth=0.2 * size, zorder=3)
    for dome, marker, face, edge in (
        (False, 's', 'white', BLACK),
        (True, 'o', VERMILION, '#8A3B00'),
    ):
        places = [s.touched for s in view.stances if s.dome == dome]
        if places:
            ax.plot(
                *np.array(places).T,
                marker,
                markersize=size,
                markerfacecolor=face,
                markeredgecolor=edge,
                markeredgewidth=0.2 * size,
                zorder=5,
            )


def handles(view: View, slide: bool = True) -> list[Any]:
    """Return the legend handles of the map, with those of body and slip paths if ``slide``."""
    found: list[Any] = []
    if view.trial.floor is not None:
        found.append(Patch(facecolor=WET, edgecolor=PALE, label='wet ground'))
    found += [
        Line2D(
            [], [], linestyle='', marker='s', markersize=5, markerfacecolor='white',
            markeredgecolor=BLACK, label='flat foot',
        ),
        Line2D([], [], linestyle='', marker='o', color=VERMILION, markersize=5, label='dome'),
    ]  # fmt: skip
    if slide:
        found.append(Line2D([], [], color=BLACK, linewidth=1.0, label='body; slip of a foot'))
        found += [
            Line2D([], [], linestyle='', marker='>', color=BLACK, markersize=6, label='start'),
            Line2D([], [], linestyle='', marker='s', color=BLACK, markersize=6, label='end'),
        ]
    return found


def panel(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes to a figure; place and size are in inches from its lower left corner."""
    wide, tall = figure.get_size_inches()
    return figure.add_axes((x / wide, y / tall, width / wide, height / tall))


def _size(view: View, rows: int, width: float) -> tuple[float, float]:
    """Return width and height of one row of the map, inches, to scale; at most 7 high."""
    left, right, bottom, top = _extent(view)
    ratio = (top - bottom) * rows / (right - left)
    return min(width, 7.0 / ratio), min(width * ratio, 7.0)


def draw(
    figure: Figure, view: View, rows: int, x: float, y: float, width: float, size: float
) -> None:
    """Draw the map at a place in a figure.

    Parameters
    ----------
    figure : Figure
        Figure to draw on.
    view : View
        View of the walk.
    rows : int
        Number of rows of the map, see :func:`rows_of`.
    x, y, width : float
        Lower left corner and width of the map, inches; :func:`height` returns its height.
    size : float
        Size of a footprint, points.
    """
    left, right, _, _ = _extent(view)
    length = (right - left) / rows
    wide, tall = _size(view, rows, width)
    for row in range(rows):
        ax = panel(figure, x, y + (rows - 1 - row) * (tall + _ROW_GAP), wide, tall)
        _draw_ground(ax, view, left + row * length, left + (row + 1) * length)
        _draw_path(ax, view, size)
        ax.set_ylabel('y / m', labelpad=1.0)
        if row == rows - 1:
            ax.set_xlabel('x / m', labelpad=1.0)


def height(view: View, rows: int, width: float) -> float:
    """Return the height of all rows with the gaps between them, inches."""
    return rows * (_size(view, rows, width)[1] + _ROW_GAP) - _ROW_GAP


def _figure(view: View) -> Figure:
    """Draw the body's path over the map of wet ground, to scale."""
    rows = rows_of(view)
    width = WIDE - 0.74
    tall = height(view, rows, width) + 0.66
    figure = Figure(figsize=(WIDE, tall))
    draw(figure, view, rows, 0.62, 0.36, width, size=3.6)
    figure.legend(handles=handles(view), loc='upper left', ncols=6)
    return figure


def picture(view: View) -> Drawn:
    """Draw the map as a separate figure, with its texts."""
    domes = sum(stance.dome for stance in view.stances)
    return Drawn(
        _figure(view),
        'Path',
        f"Map of the body's path with {len(view.stances)} footprints, {domes} of them of domes, "
        'over wet and dry ground',
        'To scale; a long path is folded into rows. A footprint is where a foot touched down; the '
        'line from it is its slip path until it lifted off.' + ''.join(_missing(view)),
    )


def _missing(view: View) -> Iterator[str]:
    """Yield sentences on what the map cannot show, each after a space."""
    trial = view.trial
    if trial.floor is None:
        yield ' The true wet ground is unknown.'
    if not np.isfinite(trial.body).all(axis=1).any():
        yield ' The pose of the body is not on record.'
    if not np.isfinite(trial.force[:, :, 2]).any():
        yield ' No forces are on record: whether a foot stands is unknown.'
    unplaced = ~np.isfinite(trial.position[:, :, :2]).any(axis=(0, 2))
    if unplaced.any():
        legs = ', '.join(str(leg) for leg, gone in zip(trial.legs, unplaced, strict=True) if gone)
        yield f' Leg {legs}: no position is on record.'


__all__ = ['draw', 'handles', 'height', 'panel', 'picture', 'rows_of']
