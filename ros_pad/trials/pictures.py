# SPDX-License-Identifier: Apache-2.0
"""The pictures of a trial: where it walked, what feet believed, what they had in reserve."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ros_pad.contact import Foot
from ros_pad.contact import force_limit
from ros_pad.control import POLICIES
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.trials.metrics import LOAD_GATE
from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.page import BLACK
from ros_pad.trials.page import BLUE
from ros_pad.trials.page import COLUMN
from ros_pad.trials.page import GREEN
from ros_pad.trials.page import PALE
from ros_pad.trials.page import PAPER_STYLE
from ros_pad.trials.page import STANCE
from ros_pad.trials.page import STYLE
from ros_pad.trials.page import VERMILION
from ros_pad.trials.page import WET
from ros_pad.trials.page import WIDE
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import legend
from ros_pad.trials.page import refuse
from ros_pad.trials.page import rendered
from ros_pad.trials.page import save
from ros_pad.trials.trial import DOME_PRESSURE
from ros_pad.trials.trial import Trial

Progress = Callable[[float], None]

WINDOW = 8.0  # s of the trial that are drawn large
_ROW_GAP = 0.4  # inches between the rows of a map
POLICY_NAMES = {
    'flat': 'always flat',
    'dome': 'always dome',
    'adaptive': 'adaptive',
    'oracle': 'oracle',
}
_BAR_NAMES = POLICY_NAMES | {'oracle': 'oracle\n(sees ahead)'}


# --- what is drawn -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stance:
    """One step of one foot: when it stood, where it touched down and lifted off, in what shape."""

    leg: int
    start: float
    end: float
    touched: tuple[float, float]
    left: tuple[float, float]
    dome: bool


@dataclass(frozen=True)
class View:
    """A trial with what the pictures need besides its series.

    Attributes
    ----------
    order : list of int
        Columns of the legs, tripod by tripod.
    load_gate : float
        Normal force above which a foot stands, N.
    wet : ndarray of bool (m, legs) or None
        The true ground at each control step, where it is known.
    stances : list of Stance
    rows : list of dict
        Metrics of this trial and of those it is compared with, each with its ``policy``.
    settings : dict
        See :func:`ros_pad.trials.label.settings`; empty where nothing is known.
    foot : Foot or None
        The foot that was walked on, where a file describes it.
    """

    trial: Trial
    order: list[int]
    load_gate: float
    wet: np.ndarray | None
    stances: list[Stance]
    rows: list[dict[str, Any]]
    settings: dict[str, Any]
    foot: Foot | None


def view_of(trial: Trial, others: Iterable[Trial] = ()) -> View:
    """Return a trial with what its pictures need, and the metrics of others to compare with."""
    settings = dict(trial.settings)
    gate = _load_gate(trial, settings)
    own = [(trial.policy, trial.metrics.as_dict())] if trial.metrics else []
    compared = [(row['policy'], row) for row in settings.get('comparison', [])]
    rest = [(other.policy, other.metrics.as_dict()) for other in others if other.metrics]
    rows: dict[str, dict[str, Any]] = {}
    for policy, metrics in own + compared + rest:
        rows.setdefault(policy, metrics | {'policy': policy})
    known = [policy for policy in POLICIES if policy in rows]
    return View(
        trial=trial,
        order=sorted(
            range(len(trial.legs)), key=lambda k: (trial.legs[k] % 2 == 0, trial.legs[k])
        ),
        load_gate=gate,
        wet=trial.wet() if trial.floor is not None else None,
        stances=_stances(trial, gate),
        rows=[rows.pop(policy) for policy in known] + list(rows.values()),
        settings=settings,
        foot=_foot(settings),
    )


def _foot(settings: dict[str, Any]) -> Foot | None:
    try:
        return Foot.load(str(settings.get('foot') or ''))
    except ConfigError:  # a file of somebody else's
        return None


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


def _stances(trial: Trial, load_gate: float) -> list[Stance]:
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
                Stance(
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


def _map_extent(view: View) -> tuple[float, float, float, float]:
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


def _draw_ground(ax: Axes, view: View, left: float, right: float) -> None:
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


def _draw_path(ax: Axes, view: View, size: float) -> None:
    """Draw body and footprints; ``size`` is that of a footprint, points."""
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


def _map_legend(view: View, slide: bool = True) -> list[Any]:
    handles: list[Any] = []
    if view.trial.floor is not None:
        handles.append(Patch(facecolor=WET, edgecolor=PALE, label='wet ground'))
    handles += [
        Line2D(
            [], [], linestyle='', marker='s', markersize=5, markerfacecolor='white',
            markeredgecolor=BLACK, label='flat foot',
        ),
        Line2D([], [], linestyle='', marker='o', color=VERMILION, markersize=5, label='dome'),
    ]  # fmt: skip
    if slide:
        handles.append(Line2D([], [], color=BLACK, linewidth=1.0, label='body; way a foot slid'))
        handles += [
            Line2D([], [], linestyle='', marker='>', color=BLACK, markersize=6, label='start'),
            Line2D([], [], linestyle='', marker='s', color=BLACK, markersize=6, label='end'),
        ]
    return handles


def _panel(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    """Add axes at a place given in inches from the lower left corner."""
    wide, tall = figure.get_size_inches()
    return figure.add_axes((x / wide, y / tall, width / wide, height / tall))


def _map_size(view: View, rows: int, width: float) -> tuple[float, float]:
    """Return width and height of one row of the map, inches: to scale, and no taller than 7."""
    left, right, bottom, top = _map_extent(view)
    ratio = (top - bottom) * rows / (right - left)
    return min(width, 7.0 / ratio), min(width * ratio, 7.0)


def _draw_map(
    figure: Figure, view: View, rows: int, x: float, y: float, width: float, size: float
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


def _map_tall(view: View, rows: int, width: float) -> float:
    """Return the height of all rows, inches."""
    return rows * (_map_size(view, rows, width)[1] + _ROW_GAP) - _ROW_GAP


def _path_figure(view: View) -> Figure:
    """Draw the body's path over the map of wet ground, to scale."""
    rows = _map_rows(_map_extent(view))
    width = WIDE - 0.74
    tall = _map_tall(view, rows, width) + 0.66
    figure = Figure(figsize=(WIDE, tall))
    _draw_map(figure, view, rows, 0.62, 0.36, width, size=3.6)
    figure.legend(handles=_map_legend(view), loc='upper left', ncols=6)
    return figure


def _draw_comparison(ax: Axes, view: View, size: float) -> None:
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


def _comparison_figure(view: View) -> Figure:
    figure = Figure(figsize=(COLUMN, 0.32 * len(view.rows) + 0.6), layout='constrained')
    _draw_comparison(figure.subplots(), view, size=8.0)
    return figure


def _overview_figure(view: View, window: tuple[float, float]) -> Figure:
    """Draw belief, truth, shape and alarms of each leg over the whole trial."""
    trial = view.trial
    figure = Figure(figsize=(WIDE, 0.55 * len(view.order) + 0.9), layout='constrained')
    axes = figure.subplots(len(view.order), 1, sharex=True, squeeze=False)[:, 0]
    for ax, column in zip(axes, view.order, strict=True):
        if view.wet is not None:
            spans = _spans(trial.slow_time, view.wet[:, column])
            ax.broken_barh(spans, (0.0, 1.0), color=WET, linewidth=0.0)
        ax.step(
            trial.slow_time, trial.wet_probability[:, column], where='post', color=BLUE, lw=0.9
        )
        domes = _spans(trial.slow_time, trial.pressure[:, column] > DOME_PRESSURE)
        ax.broken_barh(domes, (1.10, 0.16), color=VERMILION, linewidth=0.0)
        alarms = [start for start, _ in _spans(trial.slow_time, trial.slipping[:, column])]
        at = np.full(len(alarms), -0.2)
        ax.plot(alarms, at, '|', color=BLACK, markersize=3.5, markeredgewidth=0.6)
        ax.axvspan(*window, facecolor='none', edgecolor=PALE, linestyle=':', linewidth=0.9)
        ax.set_ylim(-0.35, 1.32)
        ax.set_yticks([0.0, 1.0])
        ax.set_ylabel(f'leg {trial.legs[column]}\nP(wet)')
    if len(trial.slow_time):
        axes[-1].set_xlim(math.floor(trial.slow_time[0]), trial.slow_time[-1])
    axes[-1].set_xlabel('time / s')
    handles: list[Any] = [Line2D([], [], color=BLUE, label='P(wet), believed')]
    if view.wet is not None:
        handles.append(Patch(facecolor=WET, label='wet ground, true'))
    handles += [
        Patch(facecolor=VERMILION, label='dome under pressure'),
        Line2D([], [], linestyle='', marker='|', color=BLACK, markersize=6, label='slip alarm'),
        Patch(facecolor='none', edgecolor=PALE, linestyle=':', label='drawn large below'),
    ]
    legend(figure, handles, columns=5)
    return figure


def window_of(view: View) -> tuple[float, float]:
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


def _window_figure(view: View, window: tuple[float, float]) -> Figure:
    """Draw pressure, belief and slip of each leg in a part of the trial."""
    trial = view.trial
    rows = (trial.slow_time >= window[0]) & (trial.slow_time <= window[1])
    time = trial.slow_time[rows]
    figure = Figure(figsize=(WIDE, 0.72 * len(view.order) + 0.9), layout='constrained')
    axes = figure.subplots(len(view.order), 3, sharex=True, sharey='col', squeeze=False)
    titles = ('gauge pressure / kPa', 'P(wet)', 'slip speed / (mm/s)')
    for ax, title in zip(axes[0], titles, strict=True):
        ax.set_title(title)
    for (pressure, belief, slip), column in zip(axes, view.order, strict=True):
        for ax in (pressure, belief, slip):
            _shade_stances(ax, view, trial.legs[column], window)
        measured, wanted = trial.pressure[rows, column], trial.setpoint[rows, column]
        pressure.plot(time, 1e-3 * measured, color=BLUE, linewidth=1.1)
        pressure.step(time, 1e-3 * wanted, where='post', color=BLACK, linewidth=0.8, ls='--')
        belief.step(time, trial.wet_probability[rows, column], where='post', color=BLUE, lw=1.1)
        belief.set_ylim(-0.06, 1.06)
        belief.set_yticks([0.0, 0.5, 1.0])
        speed = 1e3 * trial.slip_speed[rows, column]
        slip.plot(time, speed, color=GREEN, linewidth=0.9)
        alarm = trial.slipping[rows, column]
        slip.plot(time[alarm], speed[alarm], '.', color=VERMILION, markersize=2.5)
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
        Line2D([], [], linestyle='', marker='.', color=VERMILION, markersize=5, label='alarm'),
    ]
    legend(figure, handles, columns=6)
    figure.align_ylabels(axes[:, 0])
    return figure


def _shade_stances(ax: Axes, view: View, leg: int, window: tuple[float, float]) -> None:
    floor = view.trial.floor
    for stance in view.stances:
        if stance.leg == leg and stance.end > window[0] and stance.start < window[1]:
            wet = floor is not None and floor.wet(*stance.touched)
            ax.axvspan(
                stance.start, stance.end, color=WET if wet else STANCE, linewidth=0.0, zorder=0
            )


def beliefs(view: View) -> tuple[np.ndarray, np.ndarray]:
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


def _wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927)."""
    z2 = 1.96**2
    middle = (hits + 0.5 * z2) / (count + z2)
    half = 1.96 * math.sqrt(hits * (count - hits) / count + 0.25 * z2) / (count + z2)
    return middle - half, middle + half


def _reliability_figure(believed: np.ndarray, wet: np.ndarray) -> Figure:
    """Draw how often the ground was wet where the estimator said so."""
    figure = Figure(figsize=(COLUMN, 1.06 * COLUMN), layout='constrained')
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [0.0, 1.0], color=PALE, linestyle='--', linewidth=0.9)
    edges = np.linspace(0.0, 1.0, 6)
    bins = np.clip(np.digitize(believed, edges) - 1, 0, 4)
    for number in range(5):
        mine = bins == number
        count, hits = int(mine.sum()), int(wet[mine].sum())
        if not count:
            continue
        x, y = float(believed[mine].mean()), hits / count
        low, high = _wilson(hits, count)
        ax.plot([x, x], [low, high], color=BLUE, linewidth=1.3)
        ax.plot(x, y, 'o', color=BLUE, markersize=5)
        ax.annotate(
            str(count), (x, high), (0, 4), textcoords='offset points', ha='center', va='bottom'
        )
    ax.set_xlim(-0.04, 1.04)
    ax.set_ylim(-0.04, 1.1)
    ax.set_aspect('equal')
    ax.set_xlabel('P(wet) at the end of a flat stance')
    ax.set_ylabel('share of them on wet ground')
    handles = [
        Line2D([], [], color=BLUE, marker='o', label='stances (number)'),
        Line2D([], [], color=PALE, linestyle='--', label='as it should be'),
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
    refuse(path, force)
    drawn = next((trial for trial in trials if trial.policy == 'adaptive'), trials[0])
    view = view_of(drawn, [trial for trial in trials if trial is not drawn])
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


# --- what was in reserve -------------------------------------------------------------------------


def limit_use(view: View) -> np.ndarray | None:
    """Return the load of each standing dome over what its pads carry at their pressure.

    Returns
    -------
    ndarray (m, legs) or None
        At each control step; above 1 a dome is pressed past its force limit. NaN where no dome
        stands, or where load or pressure is not known. None where the foot is not known.
    """
    trial = view.trial
    if view.foot is None or not len(trial.time):
        return None
    rows = np.clip(np.searchsorted(trial.time, trial.slow_time + 1e-9) - 1, 0, None)
    load = trial.force[rows, :, 2]
    standing = trial.standing(view.load_gate)[rows]
    domed = standing & (trial.pressure > DOME_PRESSURE)
    pressure = np.where(domed, np.minimum(trial.pressure, view.foot.ceiling), view.foot.ceiling)
    limit = view.foot.pads * np.asarray(force_limit(view.foot.pad, pressure, view.foot.limit))
    with np.errstate(divide='ignore'):  # below some pressure a dome carries nothing
        return np.where(domed, load / limit, np.nan)


def standing_margins(view: View) -> np.ndarray:
    """Return the margin of friction of each standing foot at each control step: (m, legs)."""
    trial = view.trial
    if not len(trial.time):
        return np.full_like(trial.margin, np.nan)
    rows = np.clip(np.searchsorted(trial.time, trial.slow_time + 1e-9) - 1, 0, None)
    return np.where(trial.standing(view.load_gate)[rows], trial.margin, np.nan)


def _reserves_figure(view: View, margins: np.ndarray, used: np.ndarray | None) -> Figure:
    """Draw for each leg how its margin of friction and its share of the force limit spread."""
    panels = [(margins, 0.0, 'below', 'margin of friction, 5 % quantile', GREEN)]
    if used is not None and np.isfinite(used).any():
        panels.append((used, 1.0, 'above', 'load of a dome over its force limit', VERMILION))
    figure = Figure(figsize=(WIDE, 0.42 * len(view.order) + 0.75), layout='constrained')
    axes = figure.subplots(len(view.order), len(panels), sharex='col', squeeze=False)
    for panel, (values, edge, side, title, colour) in enumerate(panels):
        known = values[np.isfinite(values)]
        low, high = np.percentile(known, [0.5, 99.5]) if len(known) else (0.0, 1.0)
        low, high = min(low, edge - 0.1), max(high, edge + 0.1)
        edges = np.linspace(low, high, 61)
        for row, column in enumerate(view.order):
            ax = axes[row, panel]
            own = values[:, column]
            own = own[~np.isnan(own)]
            if len(own):
                counts, _ = np.histogram(np.clip(own, low, high), edges)
                ax.stairs(counts / counts.max(), edges, fill=True, color=colour, alpha=0.55)
                ax.plot(np.median(own), 1.12, 'v', color=BLACK, markersize=3.0)
                beyond = np.mean(own < edge if side == 'below' else own > edge)
                # On the side where fewer values are.
                left = np.median(own) > 0.5 * (low + high)
                ax.annotate(
                    f'{100.0 * beyond:.1f} % {side} {edge:g}', (0.0 if left else 1.0, 0.98),
                    xycoords='axes fraction', ha='left' if left else 'right', va='top',
                    bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.8}, fontsize=7.0,
                    zorder=4,
                )  # fmt: skip
            else:
                ax.annotate(
                    'no sample', (0.5, 0.4), xycoords='axes fraction', ha='center', color=PALE
                )
            ax.axvline(edge, color=BLACK, linestyle='--', linewidth=0.8)
            ax.set_ylim(0.0, 1.35)
            ax.set_yticks([])
            ax.spines['left'].set_visible(False)
            if panel == 0:
                ax.set_ylabel(f'leg {view.trial.legs[column]}')
        axes[-1, panel].set_xlabel(title)
        axes[-1, panel].set_xlim(low, high)
    return figure


# --- all of them ---------------------------------------------------------------------------------


def draw(view: View, progress: Progress | None = None) -> dict[str, Drawn]:
    """Draw all figures that a trial has what it takes for, by name, in the order of the report.

    Save them under ``matplotlib.rc_context(PAPER_STYLE)``, which fonts and identifiers come from.
    """
    trial = view.trial
    window = window_of(view)
    believed, true = beliefs(view)
    margins, used = standing_margins(view), limit_use(view)
    found: dict[str, Drawn] = {}
    makers: dict[str, tuple[bool, Callable[[], Drawn]]] = {
        'comparison': (len(view.rows) > 1, lambda: _compared(view)),
        'path': (bool(view.stances) or bool(np.isfinite(trial.body).any()), lambda: _path(view)),
        'trial': (len(trial.slow_time) > 1, lambda: _overview(view, window)),
        'window': (len(trial.slow_time) > 1, lambda: _large(view, window)),
        'reserves': (
            any(each is not None and bool(np.isfinite(each).any()) for each in (margins, used)),
            lambda: _reserves(view, margins, used),
        ),
        'reliability': (len(believed) > 0, lambda: _reliability(believed, true)),
    }  # fmt: skip
    with matplotlib.rc_context(PAPER_STYLE):
        for number, (name, (possible, make)) in enumerate(makers.items(), 1):
            if possible:
                found[name] = make()
            if progress:
                progress(number / len(makers))
    return found


def _compared(view: View) -> Drawn:
    return Drawn(
        _comparison_figure(view),
        'What the shapes are worth',
        'Bars: '
        + ', '.join(
            f'{POLICY_NAMES.get(row["policy"], row["policy"])} '
            f'{1e3 * row["distance_per_cycle_m"]:.0f} mm per cycle'
            for row in view.rows
        ),
        'The same robot on the same ground with the same noise, under each policy.',
    )


def _path(view: View) -> Drawn:
    domes = sum(stance.dome for stance in view.stances)
    return Drawn(
        _path_figure(view),
        'Path',
        f"Map of the body's path with {len(view.stances)} footprints, {domes} of them of domes, "
        'over wet and dry ground',
        'To scale; a long path is folded into rows. A footprint is where a foot touched down; the '
        'line from it is the way the foot slid before it lifted off.'
        + ('' if view.trial.floor is not None else ' Where the ground was wet is not known.'),
    )


def _overview(view: View, window: tuple[float, float]) -> Drawn:
    return Drawn(
        _overview_figure(view, window),
        'The whole trial, leg by leg',
        'For each leg over the whole trial: believed and true wetness, times as a dome, and slip '
        'alarms',
        'A dome feels wet and dry ground alike: the belief of a domed foot only fades, and its '
        'shape is chosen by what all feet have felt nearby.'
        + (' Legs stand in the order of the tripods.' if len(view.order) > 1 else ''),
    )


def _large(view: View, window: tuple[float, float]) -> Drawn:
    return Drawn(
        _window_figure(view, window),
        f'From {window[0]:.0f} s to {window[1]:.0f} s',
        'For each leg: pressure with set-point, probability of wet ground, and slip speed, with '
        'stances shaded',
        'The part of the trial in which most feet came onto wet ground or became domes.',
    )


def _reserves(view: View, margins: np.ndarray, used: np.ndarray | None) -> Drawn:
    caption = (
        'How often each value came, leg by leg, while the foot stood; triangles are medians, the '
        'last bars hold what is beyond. Margin: 5 % quantile of friction less the ratio of '
        'tangential to normal force; below 0 slip is not ruled out.'
    )
    if used is None:
        caption += ' The foot is not on record, so its force limit is not known.'
    elif np.isfinite(used).any():
        caption += (
            ' Force limit: what all pads of the foot carry at the pressure measured; past 1 the '
            'sole carries the rest.'
        )
    else:
        caption += ' No dome stood, so no force limit was used.'
    return Drawn(
        _reserves_figure(view, margins, used),
        'What was in reserve',
        'Histograms for each leg of the margin of friction and of the share of the force limit',
        caption,
    )


def _reliability(believed: np.ndarray, true: np.ndarray) -> Drawn:
    return Drawn(
        _reliability_figure(believed, true),
        'How far P(wet) can be trusted',
        f'Reliability diagram of {len(believed)} flat stances',
        'Dots on the dashed line would say that the estimator is neither too sure nor too shy. '
        'Bars are 95 % intervals (Wilson).',
    )
