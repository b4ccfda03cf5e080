# SPDX-License-Identifier: Apache-2.0
"""The report of a trial: one HTML file with pictures, and the picture that leads the README.

Colours are those of Okabe and Ito (2008), which people with any colour vision tell apart; shapes
and strokes say the same once more, so that a grey print can be read too.
"""

from __future__ import annotations

import base64
import html
import io
import math
import os
import pathlib
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ros_pad.control import POLICIES
from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.estimation import DOUBTS
from ros_pad.trials.label import promise
from ros_pad.trials.metrics import LOAD_GATE
from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.trial import Trial
from ros_pad.trials.trial import told

Progress = Callable[[float], None]

BLUE, VERMILION, GREEN, BLACK = '#0072B2', '#D55E00', '#009E73', '#222222'
WET, STANCE, PALE = '#B5DCF5', '#E4E4E4', '#9A9A9A'
WINDOW = 8.0  # s of the trial that are drawn large
DOME_PRESSURE = 1000.0  # Pa gauge above which a pad is no longer flat
_WIDTH = 11.0  # inches of a figure
_ROW_GAP = 0.4  # inches between the rows of a map
STYLE: dict[Any, Any] = {
    'font.family': 'DejaVu Sans',  # comes with matplotlib
    'font.size': 10.0,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.titlesize': 10.0,
    'axes.titlelocation': 'left',
    'legend.frameon': False,
    'svg.fonttype': 'path',
    'svg.hashsalt': 'ros_pad',  # the same trial gives the same file
    'path.simplify': True,
}
PAPER_STYLE: dict[Any, Any] = STYLE | {
    'font.size': 9.0,
    'axes.titlesize': 9.0,
    'legend.fontsize': 8.5,
    'lines.linewidth': 1.6,
    'lines.markersize': 6.0,
    'pdf.fonttype': 42,  # text that an editor can change
}
# What a file says of its making, by kind: left out.
_MARKS = {
    'svg': ('Date', 'Creator'),
    'png': ('Software',),
    'pdf': ('CreationDate', 'Creator', 'Producer'),
}


# --- what is drawn -------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Stance:
    """One step of one foot: when it stood, where it touched down and lifted off, in what shape."""

    leg: int
    start: float
    end: float
    touched: tuple[float, float]
    left: tuple[float, float]
    dome: bool


@dataclass(frozen=True)
class _View:
    """A trial with what the pictures need besides its series.

    Attributes
    ----------
    order : list of int
        Columns of the legs, tripod by tripod.
    load_gate : float
        Normal force above which a foot stands, N.
    wet : ndarray of bool (m, legs) or None
        The true ground at each control step, where it is known.
    stances : list of _Stance
    rows : list of dict
        Metrics of this trial and of those it is compared with, each with its ``policy``.
    settings : dict
        See :func:`ros_pad.trials.label.settings`; empty where nothing is known.
    """

    trial: Trial
    order: list[int]
    load_gate: float
    wet: np.ndarray | None
    stances: list[_Stance]
    rows: list[dict[str, Any]]
    settings: dict[str, Any]


def _view(trial: Trial, others: Iterable[Trial]) -> _View:
    settings = dict(trial.settings)
    gate = _load_gate(trial, settings)
    own = [(trial.policy, trial.metrics.as_dict())] if trial.metrics else []
    compared = [(row['policy'], row) for row in settings.get('comparison', [])]
    rest = [(other.policy, other.metrics.as_dict()) for other in others if other.metrics]
    rows: dict[str, dict[str, Any]] = {}
    for policy, metrics in own + compared + rest:
        rows.setdefault(policy, metrics | {'policy': policy})
    known = [policy for policy in POLICIES if policy in rows]
    return _View(
        trial=trial,
        order=sorted(
            range(len(trial.legs)), key=lambda k: (trial.legs[k] % 2 == 0, trial.legs[k])
        ),
        load_gate=gate,
        wet=trial.wet() if trial.floor is not None else None,
        stances=_stances(trial, gate),
        rows=[rows.pop(policy) for policy in known] + list(rows.values()),
        settings=settings,
    )


def _load_gate(trial: Trial, settings: dict[str, Any]) -> float:
    if 'expected_load' in settings:
        return float(LOAD_GATE * settings['expected_load'])
    loads = trial.force[:, :, 2]
    # Nobody said what a foot carries: take what it carries at its heavier moments.
    return float(LOAD_GATE * np.nanpercentile(loads, 90.0)) if np.isfinite(loads).any() else 0.0


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return first index and length of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [(int(a), int(b - a)) for a, b in edges.reshape(-1, 2)]


def _spans(time: np.ndarray, mask: np.ndarray) -> list[tuple[float, float]]:
    """Return start and duration, s, of each run of True; a row lasts until the next one."""
    if len(time) < 2:
        return []
    ends = np.append(time[1:], time[-1] + (time[-1] - time[-2]))
    return [(float(time[a]), float(ends[a + n - 1] - time[a])) for a, n in _runs(mask)]


def _stances(trial: Trial, load_gate: float) -> list[_Stance]:
    standing = trial.standing(load_gate)
    found = []
    for column, leg in enumerate(trial.legs):
        for start, length in _runs(standing[:, column]):
            rows = slice(start, start + length)
            places = trial.position[rows, column, :2]
            places = places[np.isfinite(places).all(axis=1)]
            if not len(places):
                continue
            tenth = max(1, len(places) // 10)  # a mean of a few, for the noise of the marker
            first, last = places[:tenth].mean(axis=0), places[-tenth:].mean(axis=0)
            found.append(
                _Stance(
                    leg=leg,
                    start=float(trial.time[start]),
                    end=float(trial.time[start + length - 1]),
                    touched=(float(first[0]), float(first[1])),
                    left=(float(last[0]), float(last[1])),
                    dome=_is_dome(trial, column, float(trial.time[start + length // 2])),
                )
            )
    return found


def _is_dome(trial: Trial, column: int, time: float) -> bool:
    """Whether a foot is domed: by its pressure or, where none was measured, by what was chosen."""
    row = int(np.searchsorted(trial.slow_time, time, side='right')) - 1
    if row < 0:
        return False
    pressure = trial.pressure[row, column]
    return bool(trial.dome[row, column] if math.isnan(pressure) else pressure > DOME_PRESSURE)


# --- pictures ------------------------------------------------------------------------------------


def _map_extent(view: _View) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the ground that was walked on, m."""
    places = [np.array([s.touched for s in view.stances]).reshape(-1, 2), view.trial.body[:, :2]]
    points = np.concatenate(places)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return (-0.5, 0.5, -0.5, 0.5)
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    margin = 0.1 + 0.5 * max(0.0, 0.1 - (top - bottom))
    return left - 0.12, right + 0.12, bottom - margin, top + margin


def _map_rows(extent: tuple[float, float, float, float]) -> int:
    """Return in how many rows a long path is folded so that feet can be seen."""
    left, right, bottom, top = extent
    return min(4, max(1, math.ceil((right - left) / (top - bottom) / 8.0)))


def _draw_ground(ax: Axes, view: _View, left: float, right: float) -> None:
    """Draw the wet ground of a part of the map."""
    _, _, bottom, top = _map_extent(view)
    ax.set_aspect('equal')
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    floor = view.trial.floor
    if floor is None:
        return
    # A walk that got lost may have ended anywhere.
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


def _draw_path(ax: Axes, view: _View, size: float) -> None:
    """Draw body and footprints; ``size`` is that of a footprint, points."""
    body = view.trial.body[:, :2]
    body = body[np.isfinite(body).all(axis=1)]
    if len(body):
        ax.plot(*body[:: max(1, len(body) // 2000)].T, color=BLACK, linewidth=1.2, zorder=2)
        ends = {'>': body[0], 's': body[-1]}
        for marker, (x, y) in ends.items():
            ax.plot(x, y, marker, color=BLACK, markersize=size + 3.0, zorder=4, clip_on=False)
    for stance in view.stances:
        (x0, y0), (x1, y1) = stance.touched, stance.left
        colour = VERMILION if stance.dome else BLACK
        ax.plot([x0, x1], [y0, y1], color=colour, linewidth=1.2, zorder=3)
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
                markeredgewidth=1.0,
                zorder=5,
            )


def _map_legend(view: _View, slide: bool = True) -> list[Any]:
    handles: list[Any] = []
    if view.trial.floor is not None:
        handles.append(Patch(facecolor=WET, edgecolor=PALE, label='wet ground'))
    handles += [
        Line2D(
            [], [], linestyle='', marker='s', markersize=7, markerfacecolor='white',
            markeredgecolor=BLACK, label='flat foot',
        ),
        Line2D([], [], linestyle='', marker='o', color=VERMILION, markersize=7, label='dome'),
    ]  # fmt: skip
    if slide:
        handles.append(
            Line2D([], [], color=BLACK, linewidth=1.2, label='body, and way a foot slid')
        )
        handles += [
            Line2D([], [], linestyle='', marker='>', color=BLACK, markersize=8, label='start'),
            Line2D([], [], linestyle='', marker='s', color=BLACK, markersize=8, label='end'),
        ]
    return handles


def _panel(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes at a place given in inches from the lower left corner."""
    wide, tall = figure.get_size_inches()
    return figure.add_axes((x / wide, y / tall, width / wide, height / tall))


def _map_size(view: _View, rows: int, width: float) -> tuple[float, float]:
    """Return width and height of one row of the map, inches: to scale, and no taller than 7."""
    left, right, bottom, top = _map_extent(view)
    ratio = (top - bottom) * rows / (right - left)
    return min(width, 7.0 / ratio), min(width * ratio, 7.0)


def _draw_map(
    figure: Figure, view: _View, rows: int, x: float, y: float, width: float, size: float
) -> None:
    """Draw the map in rows at a place in inches, upwards from ``y`` to :func:`_map_tall`."""
    left, right, _, _ = _map_extent(view)
    length = (right - left) / rows
    wide, tall = _map_size(view, rows, width)
    for row in range(rows):
        ax = _panel(figure, x, y + (rows - 1 - row) * (tall + _ROW_GAP), wide, tall)
        _draw_ground(ax, view, left + row * length, left + (row + 1) * length)
        _draw_path(ax, view, size)
        ax.set_ylabel('y / m', labelpad=1.0)
        if row == rows - 1:
            ax.set_xlabel('x / m', labelpad=1.0)


def _map_tall(view: _View, rows: int, width: float) -> float:
    """Return the height of all rows, inches."""
    return rows * (_map_size(view, rows, width)[1] + _ROW_GAP) - _ROW_GAP


def _path_figure(view: _View) -> Figure:
    """Draw the body's path over the map of wet ground, to scale."""
    rows = _map_rows(_map_extent(view))
    width = _WIDTH - 0.9
    tall = _map_tall(view, rows, width) + 0.95
    figure = Figure(figsize=(_WIDTH, tall))
    _draw_map(figure, view, rows, 0.75, 0.5, width, size=5.5)
    figure.legend(handles=_map_legend(view), loc='upper left', ncols=6)
    return figure


def _draw_comparison(ax: Axes, view: _View, size: float) -> None:
    """Draw the advance per cycle of each policy as bars."""
    rows = view.rows
    values = [1e3 * row['distance_per_cycle_m'] for row in rows]
    colours = [BLUE if row['policy'] == view.trial.policy else '#A9B4BC' for row in rows]
    places = np.arange(len(rows))[::-1]
    ax.barh(places, values, color=colours, height=0.68)
    ax.set_yticks(places, [_BAR_NAMES.get(row['policy'], row['policy']) for row in rows])
    ax.tick_params(axis='y', length=0)
    stride = 1e3 * view.settings.get('stride_m', 0.0)
    reach = max([*values, stride, 1.0])
    for place, value, row in zip(places, values, rows, strict=True):
        inside = value > 0.15 * reach
        own = row['policy'] == view.trial.policy
        ax.text(
            max(value, 0.0),
            place,
            f'{value:.0f} ' if inside else f' {value:.0f}',
            color='white' if own and inside else BLACK,
            ha='right' if inside else 'left',
            va='center',
            fontsize=size,
            fontweight='bold' if own else 'normal',
        )
    if stride:
        ax.axvline(stride, color=BLACK, linestyle='--', linewidth=1.0)
        ax.text(
            stride,
            len(rows) - 0.5,
            f'no slip: {stride:.0f} ',
            ha='right',
            va='bottom',
            fontsize=0.9 * size,
        )
    ax.set_xlim(min(0.0, *values), 1.04 * reach)
    ax.set_ylim(-0.5, len(rows) - 0.05)
    ax.set_xlabel('advance per gait cycle / mm')


def _comparison_figure(view: _View) -> Figure:
    figure = Figure(figsize=(_WIDTH, 0.45 * len(view.rows) + 1.1), layout='constrained')
    _draw_comparison(figure.subplots(), view, size=11.0)
    return figure


def legend(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """Add a legend above all axes, where it hides no data."""
    figure.legend(handles=handles, loc='upper left', ncols=columns)
    layout = figure.get_layout_engine()
    assert isinstance(layout, ConstrainedLayoutEngine)
    # In inches, because matplotlib before 3.7 cannot place a legend outside by itself.
    layout.set(rect=(0.0, 0.0, 1.0, 1.0 - 0.36 / figure.get_figheight()))


def _overview_figure(view: _View, window: tuple[float, float]) -> Figure:
    """Draw belief, truth, shape and alarms of each leg over the whole trial."""
    trial = view.trial
    figure = Figure(figsize=(_WIDTH, 0.95 * len(view.order) + 1.2), layout='constrained')
    axes = figure.subplots(len(view.order), 1, sharex=True, squeeze=False)[:, 0]
    for ax, column in zip(axes, view.order, strict=True):
        if view.wet is not None:
            spans = _spans(trial.slow_time, view.wet[:, column])
            ax.broken_barh(spans, (0.0, 1.0), color=WET, linewidth=0.0)
        ax.step(
            trial.slow_time, trial.wet_probability[:, column], where='post', color=BLUE, lw=1.2
        )
        domes = _spans(trial.slow_time, trial.pressure[:, column] > DOME_PRESSURE)
        ax.broken_barh(domes, (1.10, 0.16), color=VERMILION, linewidth=0.0)
        alarms = [start for start, _ in _spans(trial.slow_time, trial.slipping[:, column])]
        ax.plot(alarms, np.full(len(alarms), -0.2), '|', color=BLACK, markersize=6)
        ax.axvspan(*window, facecolor='none', edgecolor=PALE, linestyle=':', linewidth=1.2)
        ax.set_ylim(-0.35, 1.32)
        ax.set_yticks([0.0, 1.0])
        ax.set_ylabel(f'leg {trial.legs[column]}\nP(wet)')
    if len(trial.slow_time):
        axes[-1].set_xlim(math.floor(trial.slow_time[0]), trial.slow_time[-1])
    axes[-1].set_xlabel('time / s')
    handles: list[Any] = [Line2D([], [], color=BLUE, label='P(wet), believed')]
    if view.wet is not None:
        handles.append(Patch(facecolor=WET, label='wet ground below the foot, true'))
    handles += [
        Patch(facecolor=VERMILION, label='dome under pressure'),
        Line2D([], [], linestyle='', marker='|', color=BLACK, markersize=8, label='slip alarm'),
        Patch(facecolor='none', edgecolor=PALE, linestyle=':', label='drawn large below'),
    ]
    legend(figure, handles, columns=5)
    return figure


def _window(view: _View) -> tuple[float, float]:
    """Return start and end, s, of the time in which most feet came onto wet ground or rose."""
    trial = view.trial
    if not len(trial.slow_time):
        return (0.0, WINDOW)
    first, last = float(trial.slow_time[0]), float(trial.slow_time[-1])
    if last - first <= WINDOW:
        return (first, last)
    changed = [trial.dome] if view.wet is None else [trial.dome, view.wet]
    changes = np.concatenate([~each[:-1] & each[1:] for each in changed], axis=1)
    times = trial.slow_time[1:]

    def inside(start: float) -> np.ndarray:
        return changes[(times >= start) & (times < start + WINDOW)]

    starts = np.arange(first, last - WINDOW + 0.25, 0.5)
    best = max(starts, key=lambda start: np.count_nonzero(inside(start).any(axis=0)))
    # Then let the changes come in the middle.
    moments = times[(times >= best) & (times < best + WINDOW)][inside(best).any(axis=1)]
    middle = float(moments.mean()) if len(moments) else best + 0.5 * WINDOW
    start = min(max(first, middle - 0.5 * WINDOW), last - WINDOW)
    return (start, start + WINDOW)


def _window_figure(view: _View, window: tuple[float, float]) -> Figure:
    """Draw pressure, belief and slip of each leg in a part of the trial."""
    trial = view.trial
    rows = (trial.slow_time >= window[0]) & (trial.slow_time <= window[1])
    time = trial.slow_time[rows]
    figure = Figure(figsize=(_WIDTH, 1.35 * len(view.order) + 1.3), layout='constrained')
    axes = figure.subplots(len(view.order), 3, sharex=True, sharey='col', squeeze=False)
    titles = ('gauge pressure / kPa', 'P(wet)', 'slip speed / (mm/s)')
    for ax, title in zip(axes[0], titles, strict=True):
        ax.set_title(title)
    for (pressure, belief, slip), column in zip(axes, view.order, strict=True):
        for ax in (pressure, belief, slip):
            _shade_stances(ax, view, trial.legs[column], window)
        measured, wanted = trial.pressure[rows, column], trial.setpoint[rows, column]
        pressure.plot(time, 1e-3 * measured, color=BLUE, linewidth=1.5)
        pressure.step(time, 1e-3 * wanted, where='post', color=BLACK, linewidth=1.1, ls='--')
        belief.step(time, trial.wet_probability[rows, column], where='post', color=BLUE, lw=1.5)
        belief.set_ylim(-0.06, 1.06)
        belief.set_yticks([0.0, 0.5, 1.0])
        speed = 1e3 * trial.slip_speed[rows, column]
        slip.plot(time, speed, color=GREEN, linewidth=1.2)
        alarm = trial.slipping[rows, column]
        slip.plot(time[alarm], speed[alarm], '.', color=VERMILION, markersize=5)
        pressure.set_ylabel(f'leg {trial.legs[column]}', fontweight='bold')
    # Where nothing happens, noise shall not look like something.
    for ax, least in ((axes[0, 0], 20.0), (axes[0, 2], 20.0)):
        top = max(least, ax.get_ylim()[1])
        ax.set_ylim(min(-0.04 * top, ax.get_ylim()[0]), top)
    axes[0, 0].set_xlim(*window)
    for ax in axes[-1]:
        ax.set_xlabel('time / s')
    handles: list[Any] = [Patch(facecolor=STANCE, label='stance')]
    if view.wet is not None:
        handles = [
            Patch(facecolor=STANCE, label='stance on dry ground'),
            Patch(facecolor=WET, label='on wet ground'),
        ]
    handles += [
        Line2D([], [], color=BLUE, label='measured, believed'),
        Line2D([], [], color=BLACK, linestyle='--', label='set-point'),
        Line2D([], [], color=GREEN, label='slip'),
        Line2D([], [], linestyle='', marker='.', color=VERMILION, markersize=9, label='alarm'),
    ]
    legend(figure, handles, columns=6)
    figure.align_ylabels(axes[:, 0])
    return figure


def _shade_stances(ax: Axes, view: _View, leg: int, window: tuple[float, float]) -> None:
    floor = view.trial.floor
    for stance in view.stances:
        if stance.leg == leg and stance.end > window[0] and stance.start < window[1]:
            wet = floor is not None and floor.wet(*stance.touched)
            ax.axvspan(
                stance.start, stance.end, color=WET if wet else STANCE, linewidth=0.0, zorder=0
            )


def _beliefs(view: _View) -> tuple[np.ndarray, np.ndarray]:
    """Return P(wet) at the end of each flat stance, and whether the ground was wet."""
    trial = view.trial
    believed: list[float] = []
    true: list[bool] = []
    if view.wet is not None:
        for column, rows in enumerate(stance_ends(trial, view.load_gate)):
            before = np.maximum(rows - 1, 0)
            flat = trial.pressure[before, column] < DOME_PRESSURE
            flat &= np.isfinite(trial.wet_probability[rows, column])
            believed += trial.wet_probability[rows[flat], column].tolist()
            true += view.wet[before[flat], column].tolist()
    return np.array(believed), np.array(true, dtype=bool)


def _doubts(trial: Trial, load_gate: float) -> str:
    """Return in words at how many stance ends feet knew the ground, and why others did not."""
    if not len(trial.doubt):
        return ''
    ends = [
        trial.doubt[np.maximum(rows - 1, 0), column]
        for column, rows in enumerate(stance_ends(trial, load_gate))
    ]
    places, counts = np.unique(np.concatenate(ends), return_counts=True)
    stances = dict(zip(places.tolist(), counts.tolist(), strict=True))
    total = sum(stances.values())
    if not total or set(stances) == {-1}:
        return ''
    others = sorted(((count, place) for place, count in stances.items() if place), reverse=True)
    why = ', '.join(
        f'{DOUBTS[place] if place > 0 else "not told"} {100.0 * count / total:.0f} %'
        for count, place in others
    )
    known = (
        f'At the end of {stances.get(0, 0)} of {total} stances a foot knew the ground below it.'
    )
    return known + (f' The others could not know: {why}.' if why else '')


def _wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    z2 = 1.96**2
    middle = (hits + 0.5 * z2) / (count + z2)
    half = 1.96 * math.sqrt(hits * (count - hits) / count + 0.25 * z2) / (count + z2)
    return middle - half, middle + half


def _reliability_figure(believed: np.ndarray, wet: np.ndarray) -> Figure:
    """Draw how often the ground was wet where the estimator said so."""
    figure = Figure(figsize=(0.5 * _WIDTH, 0.53 * _WIDTH), layout='constrained')
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [0.0, 1.0], color=PALE, linestyle='--', linewidth=1.2)
    edges = np.linspace(0.0, 1.0, 6)
    bins = np.clip(np.digitize(believed, edges) - 1, 0, 4)
    for number in range(5):
        mine = bins == number
        count, hits = int(mine.sum()), int(wet[mine].sum())
        if not count:
            continue
        x, y = float(believed[mine].mean()), hits / count
        low, high = _wilson(hits, count)
        ax.plot([x, x], [low, high], color=BLUE, linewidth=2.0)
        ax.plot(x, y, 'o', color=BLUE, markersize=8)
        ax.annotate(
            str(count), (x, high), (0, 4), textcoords='offset points', ha='center', va='bottom'
        )
    ax.set_xlim(-0.04, 1.04)
    ax.set_ylim(-0.04, 1.1)
    ax.set_aspect('equal')
    ax.set_xlabel('P(wet) at the end of a flat stance')
    ax.set_ylabel('share of them on wet ground')
    handles = [
        Line2D([], [], color=BLUE, marker='o', label='stances, with their number'),
        Line2D([], [], color=PALE, linestyle='--', label='belief as it should be'),
    ]
    legend(figure, handles, columns=2)
    return figure


def lead_picture(
    trials: Sequence[Trial], path: str | os.PathLike[str], force: bool = False
) -> None:
    """Draw the idea at a glance: where feet turned into domes, and what that is worth.

    Parameters
    ----------
    trials : sequence of Trial
        One for each policy, on the same ground; the adaptive one, or else the first, is drawn.
    path : path
        PNG file to write, 1600 pixels wide.
    force : bool
        Replace a file that is there.

    Raises
    ------
    InvalidInput
        Without trials, or when they are of different scenes or seeds.
    PadError
        When the file exists or cannot be written.
    """
    if len({(trial.scene, trial.seed) for trial in trials}) != 1:
        raise InvalidInput('trials: some are needed, and all of one scene and seed')
    _refuse(path, force)
    drawn = next((trial for trial in trials if trial.policy == 'adaptive'), trials[0])
    view = _view(drawn, [trial for trial in trials if trial is not drawn])
    rows = max(2, _map_rows(_map_extent(view)))
    wide, map_width = 16.0, 9.7
    tall = _map_tall(view, rows, map_width) + 1.55
    with matplotlib.rc_context(STYLE | {'font.size': 13.0}):
        figure = Figure(figsize=(wide, tall), dpi=100)
        _draw_map(figure, view, rows, 0.95, 0.6, map_width, size=8.0)
        bars = _panel(figure, 12.35, 0.6, 3.45, tall - 1.15)
        _draw_comparison(bars, view, size=14.0)
        bars.tick_params(axis='y', labelsize=14.0)
        for x, title in (
            (0.95, 'Feet feel the ground and turn into domes where it is wet'),
            (11.1, 'What that is worth'),
        ):
            figure.text(
                x / wide, 1.0 - 0.12 / tall, title, va='top', fontsize=16.0, fontweight='bold'
            )
        figure.legend(
            handles=_map_legend(view, slide=False),
            loc='upper left',
            bbox_to_anchor=(0.85 / wide, 1.0 - 0.4 / tall),
            ncols=3,
        )
        save(path, rendered(figure, 'png', dpi=100))


def rendered(figure: Figure, kind: str, **options: Any) -> bytes:
    """Return a figure as a file that does not depend on when or where it was drawn."""
    stream = io.BytesIO()
    metadata = dict.fromkeys(_MARKS[kind])
    figure.savefig(stream, format=kind, metadata=metadata, **options)
    return stream.getvalue()


# --- words ---------------------------------------------------------------------------------------

_POLICY_NAMES = {
    'flat': 'always flat',
    'dome': 'always dome',
    'adaptive': 'adaptive',
    'oracle': 'oracle',
}
_BAR_NAMES = _POLICY_NAMES | {'oracle': 'oracle\n(sees ahead)'}
_POLICY_TEXTS = (
    'Always flat and always dome never change shape; adaptive feet decide at each lift-off by '
    'what they have felt; the oracle sees the ground where each foot will stand next.'
)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


_GOAL = 'time to the goal'


def _number_or_dash(value: float | None) -> str:
    return '–' if value is None else f'{value:.1f}'


# Of each metric: name, unit, what it means, and its number as text.
_METRICS: tuple[tuple[str, str, str, Callable[[dict[str, Any]], str]], ...] = (
    ('advance per cycle', 'mm', 'Way of the body along x in a gait cycle.',
     lambda m: f'{1e3 * m["distance_per_cycle_m"]:.1f}'),
    ('distance', 'm', 'Way of the body along x.', lambda m: f'{m["distance_m"]:.2f}'),
    ('duration', 's', 'Time of the trial.', lambda m: f'{m["duration_s"]:.1f}'),
    (_GOAL, 's', 'From the first step until the body was there.',
     lambda m: _number_or_dash(m.get('time_to_goal_s'))),
    ('gait cycles', '', 'Cycles walked.', lambda m: f'{m["cycles"]:.1f}'),
    ('slip path', 'm', 'Way that a foot slid under load, mean of the feet.',
     lambda m: f'{_mean(m["slip_path_m"]):.2f}'),
    ('work lost in slip', 'J', 'Friction times way, all feet together.',
     lambda m: f'{m["dissipation_j"]:.2f}'),
    ('sideways drift', 'mm', 'Place of the body along y at the end.',
     lambda m: f'{1e3 * m["lateral_drift_m"]:z.1f}'),
    ('heading drift', '°', 'Heading of the body at the end, positive to the left.',
     lambda m: f'{math.degrees(m["yaw_drift_rad"]):z.2f}'),
    ('changes of shape', '', 'Between flat and dome, all feet together.',
     lambda m: f'{sum(m["switches"])}'),
    ('overload', 's', 'Time that domes were pressed past their force limit, mean of the feet.',
     lambda m: f'{_mean(m["overload_s"]):.2f}'),
    ('ground judged right', '%',
     'Flat stances at whose end P(wet) was on the right side of one half; domes do not count, '
     'because wet and dry ground feel alike to them.',
     lambda m: '–' if m['wet_accuracy'] is None else f'{100.0 * m["wet_accuracy"]:.1f}'),
)  # fmt: skip


def _result(view: _View) -> str:
    """Return the outcome in a sentence or two."""
    trial = view.trial
    if trial.metrics is None:
        body = trial.body[np.isfinite(trial.body).all(axis=1), :2]
        if not len(body):
            return 'The bag has neither metrics nor poses of the body.'
        way = float(np.hypot(*(body[-1] - body[0])))
        lasted = trial.time[-1] - trial.time[0]
        return f'From start to end the body moved by {way:.2f} m in {lasted:.1f} s.'
    own = trial.metrics
    name = _POLICY_NAMES.get(trial.policy, trial.policy)
    text = (
        f'{name[:1].upper()}{name[1:]} feet: the robot walked {own.distance_m:.2f} m in '
        f'{own.cycles:.0f} gait cycles, {1e3 * own.distance_per_cycle_m:.0f} mm a cycle'
    )
    for row in view.rows:
        advance = row['distance_per_cycle_m']
        if row['policy'] == trial.policy or not advance > 0.0:
            continue
        gain = 100.0 * (own.distance_per_cycle_m / advance - 1.0)
        other = _POLICY_NAMES.get(row['policy'], row['policy'])
        other = f'the {other}' if other == 'oracle' else other
        if abs(gain) < 0.5:
            text += f'; as far as {other}'
        else:
            text += f'; {abs(gain):.0f} % {"further" if gain > 0.0 else "less far"} than {other}'
        text += f' ({1e3 * advance:.0f} mm)'
    text += '.'
    if own.time_to_goal_s is not None:
        text += f' It was at the goal of {own.goal_m:g} m after {own.time_to_goal_s:.1f} s.'
    elif own.goal_m is not None:
        text += f' It did not get to the goal of {own.goal_m:g} m.'
    if own.verdict:
        text += f' The walk is not valid: {own.verdict}.'
    return text


def table(head: Sequence[str], body: Iterable[Sequence[str]], numbers: range) -> str:
    """Return an HTML table of escaped cells; ``numbers`` are the columns set to the right."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return ''.join(
            f'<{tag}{" class=number" if column in numbers else ""}>{cell}</{tag}>'
            for column, cell in enumerate(row)
        )

    rows = ''.join(f'<tr>{cells("td", row)}</tr>\n' for row in body)
    return f'<table>\n<thead><tr>{cells("th", head)}</tr></thead>\n<tbody>\n{rows}</tbody></table>'


def _metrics_tables(view: _View) -> str:
    if not view.rows:
        return '<p>This bag has no metrics: they need a simulated floor, or one that is known.</p>'
    names = [_POLICY_NAMES.get(row['policy'], row['policy']) for row in view.rows]
    head = ['', 'unit', *(html.escape(name) for name in names), 'meaning']
    body = []
    for name, unit, meaning, number in _METRICS:
        if name == _GOAL and view.trial.metrics and view.trial.metrics.goal_m is None:
            continue
        values = [
            f'<b>{text}</b>' if row['policy'] == view.trial.policy else text
            for row in view.rows
            for text in [number(row).replace('-', '\N{MINUS SIGN}')]
        ]
        body.append([name, unit, *values, meaning])
    text = table(head, body, range(2, 2 + len(names)))
    if len(names) > 1:
        text += f'<p class="note">{_POLICY_TEXTS}</p>'
    own = view.trial.metrics
    if own is None or len(view.order) == 1:
        return text
    legs = [view.trial.legs[column] for column in view.order]
    per_leg = [
        ('slip path', 'mm', [f'{1e3 * own.slip_path_m[k]:.0f}' for k in view.order]),
        ('changes of shape', '', [str(own.switches[k]) for k in view.order]),
        ('overload', 's', [f'{own.overload_s[k]:.2f}' for k in view.order]),
    ]
    text += '<h3>Leg by leg</h3>' + table(
        ['', 'unit', *(f'leg {leg}' for leg in legs)],
        [[name, unit, *values] for name, unit, values in per_leg],
        range(2, 2 + len(legs)),
    )
    return text


def _omitted_table(omitted: Sequence[dict[str, Any]]) -> str:
    if not omitted:
        return '<p>No simulation is on record for this trial.</p>'
    rows = [
        [
            html.escape(str(each['term'])),
            'not known' if each['bound'] is None else f'≤ {100.0 * each["bound"]:.1f} %',
            html.escape(str(each['reason'])),
        ]
        for each in omitted
    ]
    head = ['left out', 'bound on its effect', 'of what, and where it comes from']
    return table(head, rows, range(1, 2))


def _facts(trial: Trial) -> str:
    """Return the line below the title."""
    facts = [
        f'policy {_POLICY_NAMES.get(trial.policy, trial.policy)}' if trial.policy else '',
        f'seed {trial.seed}' if trial.scene else '',
        f'simulation {trial.fidelity}' if trial.fidelity else '',
        f'recorded {trial.settings["recorded"]}' if 'recorded' in trial.settings else '',
        f'{trial.real_time_factor:.1f} times real time' if trial.real_time_factor else '',
        f'ros_pad {trial.settings["version"]}' if 'version' in trial.settings else '',
    ]
    return html.escape(' · '.join(fact for fact in facts if fact))


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, "DejaVu Sans", Arial, sans-serif; color: #222;
       background: #fff; max-width: 1100px; margin: 2em auto; padding: 0 1em; }}
h1 {{ font-size: 1.7em; margin-bottom: 0; }}
h2 {{ font-size: 1.25em; margin: 2em 0 0.3em; border-bottom: 1px solid #ccc; }}
h3 {{ font-size: 1.05em; margin: 1.4em 0 0.3em; }}
.facts, .note, figcaption {{ color: #555; font-size: 0.92em; }}
.facts {{ margin-top: 0.2em; }}
.result {{ font-size: 1.15em; }}
.warning {{ border-left: 4px solid #D55E00; padding: 0.2em 0.8em; background: #fdf1e8; }}
figure {{ margin: 0.8em 0; break-inside: avoid; }}
figure img {{ width: 100%; height: auto; }}
figure.half img {{ width: 50%; min-width: 22em; max-width: 100%; }}
table {{ border-collapse: collapse; font-size: 0.92em; break-inside: avoid; }}
th, td {{ text-align: left; vertical-align: top; padding: 0.2em 0.8em 0.2em 0;
         border-bottom: 1px solid #e2e2e2; }}
tbody td:first-child {{ white-space: nowrap; }}
.number {{ text-align: right; font-variant-numeric: tabular-nums; }}
td.number {{ white-space: nowrap; }}
@media print {{
  body {{ font-size: 10pt; margin: 0; max-width: none; }}
  h2, h3 {{ break-after: avoid; }}
}}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def page(title: str, parts: Sequence[str]) -> str:
    """Return an HTML page of its title and its parts, which are HTML."""
    return _PAGE.format(title=html.escape(title), body='\n'.join(parts))


def embedded(figure: Figure, alt: str, caption: str, kind: str = '') -> str:
    """Return a figure as HTML that needs no other file.

    ``alt`` is plain text, ``caption`` HTML, ``kind`` attributes of the ``figure`` element.
    """
    data = base64.b64encode(rendered(figure, 'svg')).decode()
    return (
        f'<figure{kind}><img alt="{html.escape(alt, quote=True)}" '
        f'src="data:image/svg+xml;base64,{data}">'
        f'<figcaption>{caption}</figcaption></figure>'
    )


def write(
    trial: Trial,
    path: str | os.PathLike[str],
    others: Iterable[Trial] = (),
    progress: Progress | None = None,
    force: bool = False,
) -> None:
    """Write the report of a trial: one HTML file that needs no other file, and no script.

    Parameters
    ----------
    trial : Trial
        From the loop or from a bag; what it does not know is left out of the report.
    path : path
        HTML file to write.
    others : iterable of Trial
        To compare with, besides those in ``trial.settings['comparison']``: other policies on
        the same ground.
    progress : callable or None
        Called with the share that is done, 0 to 1.
    force : bool
        Replace a file that is there.

    Raises
    ------
    PadError
        When the file exists or cannot be written.
    """
    _refuse(path, force)
    view = _view(trial, others)
    window = _window(view)
    believed, true = _beliefs(view)
    parts: list[str] = []

    def figure(number: int, drawn: Figure, alt: str, caption: str, kind: str = '') -> None:
        parts.append(embedded(drawn, alt, caption, kind))
        if progress:
            progress(number / 5.0)

    name = trial.scene or 'Recorded trial'
    parts.append(f'<h1>{html.escape(name)}</h1><p class="facts">{_facts(trial)}</p>')
    parts.append(f'<p class="result">{html.escape(_result(view))}</p>')
    for warning in _warnings(trial):
        parts.append(f'<p class="warning">{html.escape(warning)}</p>')
    with matplotlib.rc_context(STYLE):
        if len(view.rows) > 1:
            parts.append('<h2>What the shapes are worth</h2>')
            figure(
                1,
                _comparison_figure(view),
                'Bars: ' + ', '.join(
                    f'{_POLICY_NAMES.get(row["policy"], row["policy"])} '
                    f'{1e3 * row["distance_per_cycle_m"]:.0f} mm per cycle' for row in view.rows
                ),
                'The same robot on the same ground with the same noise, under each policy.',
            )  # fmt: skip
        parts.append('<h2>Metrics</h2>' + _metrics_tables(view))
        if view.stances or np.isfinite(trial.body).any():
            parts.append('<h2>Path</h2>')
            domes = sum(stance.dome for stance in view.stances)
            figure(
                2,
                _path_figure(view),
                f"Map of the body's path with {len(view.stances)} footprints, {domes} of them "
                'of domes, over wet and dry ground',
                'To scale; a long path is folded into rows. A footprint is where a foot touched '
                'down; the line from it is the way the foot slid before it lifted off.'
                + ('' if trial.floor is not None else ' Where the ground was wet is not known.'),
            )
        if len(trial.slow_time) > 1:
            parts.append('<h2>The whole trial, leg by leg</h2>')
            figure(
                3,
                _overview_figure(view, window),
                'For each leg over the whole trial: believed and true wetness, times as a dome, '
                'and slip alarms',
                'A dome feels wet and dry ground alike: the belief of a domed foot only fades, '
                'and its shape is chosen by what all feet have felt nearby.'
                + (' Legs stand in the order of the tripods.' if len(view.order) > 1 else ''),
            )
            parts.append(f'<h2>From {window[0]:.0f} s to {window[1]:.0f} s</h2>')
            figure(
                4,
                _window_figure(view, window),
                'For each leg: pressure with set-point, probability of wet ground, and slip '
                'speed, with stances shaded',
                'The part of the trial in which most feet came onto wet ground or became domes.',
            )
        if len(believed):
            parts.append('<h2>How far P(wet) can be trusted</h2>')
            figure(
                5,
                _reliability_figure(believed, true),
                f'Reliability diagram of {len(believed)} flat stances',
                'Dots on the dashed line would say that the estimator is neither too sure nor '
                'too shy. Bars are 95 % intervals (Wilson).',
                ' class="half"',
            )
    if words := _doubts(trial, view.load_gate):
        parts.append(f'<h2>What the feet knew</h2><p>{html.escape(words)}</p>')
    parts.append('<h2>What the model leaves out</h2>')
    if 'fidelity_note' in view.settings:
        note = html.escape(promise(view.trial))
        parts.append(
            f'<p>{note[:1].upper()}{note[1:]}. What is promised is the largest error against the '
            'top rung with short steps, on random scenes with such a reserve of grip, and a '
            'margin.</p>'
        )
    parts.append(_omitted_table(view.settings.get('omitted', [])))
    save(path, page(f'{name}: ros_pad', parts).encode())
    if progress:
        progress(1.0)


def _warnings(trial: Trial) -> list[str]:
    found = []
    if trial.settings.get('interrupted'):
        found.append('The trial was cut short: its metrics are of what was walked until then.')
    found += [f'Fault on the schedule: {fault}' for fault in trial.settings.get('faults', ())]
    if trial.metrics is not None:
        found += [f'Meant to be a dome but stayed flat, {why}' for why in trial.metrics.refusals]
        found += told(trial.metrics.faults)
    if trial.settings.get('problem'):
        found.append(str(trial.settings['problem']))
    return found


def _refuse(path: str | os.PathLike[str], force: bool) -> None:
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise PadError(f'{path}: is no regular file, and is never replaced')
    if not force and path.exists():
        raise PadError(f'{os.fspath(path)}: exists, and is only replaced when that is forced')


def save(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file as a whole, so that no half of one is ever left."""
    path = pathlib.Path(path)
    new = path.with_name(path.name + '.new')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_bytes(data)
        new.replace(path)
    except OSError as error:
        raise PadError(f'{path}: cannot be written: {error.strerror}') from error


__all__ = ['embedded', 'lead_picture', 'legend', 'page', 'rendered', 'save', 'table', 'write']
