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

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.reports.style import BLACK, PALE, VERMILION, WET
from ros_pad.trials import Trial

_ROW_GAP = 0.4  # inches between the rows of a map


def rows_of(trial: Trial) -> int:
    """Return the number of rows, 1 to 4, into which a long path is folded to keep feet visible."""
    left, right, bottom, top = _extent(trial)
    return min(4, max(1, math.ceil((right - left) / (top - bottom) / 8.0)))


def height(trial: Trial, rows: int, width: float) -> float:
    """Return the height of all rows with the gaps between them, inches."""
    return rows * (_size(trial, rows, width)[1] + _ROW_GAP) - _ROW_GAP


def panel(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes to a figure; place and size are in inches from its lower left corner."""
    wide, tall = figure.get_size_inches()
    return figure.add_axes((x / wide, y / tall, width / wide, height / tall))


def handles() -> list[Any]:
    """Return the legend handles of the map."""
    flat: dict[str, Any] = {'markerfacecolor': 'white', 'markeredgecolor': BLACK}
    return [
        Patch(facecolor=WET, edgecolor=PALE, label='wet ground'),
        Line2D([], [], linestyle='', marker='s', markersize=5, label='flat foot', **flat),
        Line2D([], [], linestyle='', marker='o', color=VERMILION, markersize=5, label='dome'),
    ]


def draw(
    figure: Figure,
    trial: Trial,
    load_gate: float,
    rows: int,
    x: float,
    y: float,
    width: float,
    size: float,
) -> None:
    """Draw the map with its lower left corner at x, y, inches, and footprints of ``size`` points.

    A foot stands with more than ``load_gate`` newtons.
    """
    left, right, bottom, top = _extent(trial)
    length = (right - left) / rows
    wide, tall = _size(trial, rows, width)
    for row in range(rows):
        ax = panel(figure, x, y + (rows - 1 - row) * (tall + _ROW_GAP), wide, tall)
        ends = left + row * length, left + (row + 1) * length
        _draw_ground(ax, trial, (*ends, bottom, top))
        _draw_path(ax, trial, load_gate, size)
        ax.set(aspect='equal', xlim=ends, ylim=(bottom, top))
        ax.set_ylabel('y / m', labelpad=1.0)
        if row == rows - 1:
            ax.set_xlabel('x / m', labelpad=1.0)


def _extent(trial: Trial) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the ground that was walked on, m."""
    points = np.concatenate([trial.position[:, :, :2].reshape(-1, 2), trial.body[:, :2]])
    points = points[np.isfinite(points).all(axis=1)]
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    margin = 0.1 + 0.5 * max(0.0, 0.1 - (top - bottom))
    return left - 0.12, right + 0.12, bottom - margin, top + margin


def _size(trial: Trial, rows: int, width: float) -> tuple[float, float]:
    """Return width and height of one row of the map, inches, to scale; at most 7 high."""
    left, right, bottom, top = _extent(trial)
    ratio = (top - bottom) * rows / (right - left)
    return min(width, 7.0 / ratio), min(width * ratio, 7.0)


def _draw_ground(ax: Axes, trial: Trial, extent: tuple[float, float, float, float]) -> None:
    """Draw the wet ground of a part of the map."""
    if trial.floor is None:
        return
    left, right, bottom, top = extent
    cell = min(0.01, trial.floor.cell)
    x = np.arange(left, right, cell) + 0.5 * cell
    y = np.arange(bottom, top, cell) + 0.5 * cell
    wet = trial.floor.wet_along(*np.meshgrid(x, y))
    ax.imshow(
        np.where(wet[:, :, None], matplotlib.colors.to_rgb(WET), 1.0),
        extent=(left, left + len(x) * cell, bottom, bottom + len(y) * cell),
        origin='lower',
        interpolation='nearest',
        zorder=0,
    )


def _draw_path(ax: Axes, trial: Trial, load_gate: float, size: float) -> None:
    """Draw the path of the body, slip paths and footprints of ``size`` points."""
    body = trial.body[:, :2]
    body = body[np.isfinite(body).all(axis=1)]
    ax.plot(*body[:: max(1, len(body) // 2000)].T, color=BLACK, linewidth=0.2 * size, zorder=2)
    for marker, (x, y) in {'>': body[0], 's': body[-1]}.items():
        ax.plot(x, y, marker, color=BLACK, markersize=1.5 * size, zorder=4, clip_on=False)
    look: dict[str, Any] = {'markersize': size, 'markeredgewidth': 0.2 * size, 'zorder': 5}
    for touched, left, dome in _stances(trial, load_gate):
        colour = VERMILION if dome else BLACK
        line = np.array([touched, left]).T
        ax.plot(*line, color=colour, linewidth=0.2 * size, zorder=3)
        face, edge = (VERMILION, '#8A3B00') if dome else ('white', BLACK)
        mark = 'o' if dome else 's'
        ax.plot(*touched, mark, markerfacecolor=face, markeredgecolor=edge, **look)


def _stances(trial: Trial, load_gate: float) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Yield the places of touch-down and lift-off of each stance, and whether it was a dome."""
    standing = trial.standing(load_gate)
    for column in range(len(trial.legs)):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], standing[:, column], [False]])))
        for start, end in edges.reshape(-1, 2):
            places = trial.position[start:end, column, :2]
            places = places[np.isfinite(places).all(axis=1)]
            if len(places):
                tenth = max(1, len(places) // 10)  # average, because the marker is noisy
                row = np.searchsorted(trial.slow_time, trial.time[(start + end) // 2]) - 1
                dome = bool(trial.slow['pressure'][max(row, 0), column] > DOME_PRESSURE)
                yield places[:tenth].mean(axis=0), places[-tenth:].mean(axis=0), dome
