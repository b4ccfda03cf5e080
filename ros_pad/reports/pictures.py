# SPDX-License-Identifier: Apache-2.0
"""The figures of a trial's report: policies compared, and the series of each leg over time."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.reports import style
from ros_pad.reports.style import BLACK, BLUE, PALE, STANCE, VERMILION, WET, Drawn
from ros_pad.reports.view import View, spans, window_of

POLICY_NAMES = {
    'flat': 'always flat',
    'dome': 'always dome',
    'adaptive': 'adaptive',
    'oracle': 'oracle',
}


def draw(view: View) -> dict[str, Drawn]:
    """Draw the figures for which a trial has the data; return them by name, in report order.

    The caller must save them under ``rc_context(PAPER_STYLE)``, which sets the fonts.
    """
    found = {}
    with matplotlib.rc_context(style.PAPER_STYLE):
        if len(view.rows) > 1:
            found['comparison'] = _comparison(view)
        if len(view.trial.slow_time) > 1:
            window = window_of(view)
            found |= {'trial': _overview(view, window), 'window': _window(view, window)}
    return found


def draw_comparison(ax: Axes, view: View, size: float) -> None:
    """Draw the distance per gait cycle of each policy as bars; ``size`` is that of the text."""
    rows = view.rows
    values = [1e3 * row['distance_per_cycle_m'] for row in rows]
    colours = [BLUE if row['policy'] == view.trial.policy else '#A9B4BC' for row in rows]
    places = np.arange(len(rows))[::-1]
    bars = ax.barh(places, values, color=colours, height=0.68)
    look: dict[str, Any] = {'fontsize': size, 'bbox': {'color': 'white', 'pad': 0.5}}
    ax.bar_label(bars, [f'{value:.0f}' for value in values], padding=4.0, **look)
    names = POLICY_NAMES | {'oracle': 'oracle\n(sees ahead)'}
    ax.set_yticks(places, [names.get(row['policy'], row['policy']) for row in rows])
    ax.tick_params(axis='y', length=0)
    stride = 1e3 * view.trial.settings.get('stride_m', 0.0)
    if stride:
        ax.axvline(stride, color=BLACK, linestyle='--', linewidth=1.0)
        words = f'no slip: {stride:.0f} '
        ax.text(stride, len(rows) - 0.5, words, ha='right', va='bottom', fontsize=0.9 * size)
    ax.set_xlim(min(0.0, *values), 1.12 * max([*values, stride, 1.0]))
    ax.set_ylim(-0.5, len(rows) - 0.05)
    ax.set_xlabel('advance per gait cycle / mm')


def _comparison(view: View) -> Drawn:
    figure = Figure(figsize=(style.COLUMN, 0.32 * len(view.rows) + 0.6), layout='constrained')
    draw_comparison(figure.subplots(), view, size=8.0)
    bars = ', '.join(
        f'{POLICY_NAMES.get(row["policy"], row["policy"])} '
        f'{1e3 * row["distance_per_cycle_m"]:.0f} mm per cycle'
        for row in view.rows
    )
    return Drawn(
        figure,
        'Advance by policy',
        f'Bars: {bars}',
        'The same robot on the same ground with the same noise, under each policy.',
    )


def _overview(view: View, window: tuple[float, float]) -> Drawn:
    """Draw estimate, truth, morphology and alarms of each leg over the whole trial."""
    trial = view.trial
    figure = Figure(figsize=(style.WIDE, 0.55 * len(view.order) + 0.9), layout='constrained')
    axes = figure.subplots(len(view.order), 1, sharex=True, squeeze=False)[:, 0]
    for ax, column in zip(axes, view.order, strict=True):
        if view.wet is not None:
            wet = spans(trial.slow_time, view.wet[:, column])
            ax.broken_barh(wet, (0.0, 1.0), color=WET, linewidth=0.0)
        ax.step(
            trial.slow_time, trial.slow['wetness'][:, column], where='post', color=BLUE, lw=0.9
        )
        domes = spans(trial.slow_time, trial.slow['pressure'][:, column] > DOME_PRESSURE)
        ax.broken_barh(domes, (1.10, 0.16), color=VERMILION, linewidth=0.0)
        alarms = [start for start, _ in spans(trial.slow_time, trial.slow['slipping'][:, column])]
        at = np.full(len(alarms), -0.2)
        ax.plot(alarms, at, '|', color=BLACK, markersize=3.5, markeredgewidth=0.6)
        ax.axvspan(*window, facecolor='none', edgecolor=PALE, linestyle=':', linewidth=0.9)
        ax.set_ylim(-0.35, 1.32)
        ax.set_yticks([0.0, 1.0])
        ax.set_ylabel(f'leg {trial.legs[column]}\nP(wet)')
    axes[-1].set_xlim(math.floor(trial.slow_time[0]), trial.slow_time[-1])
    axes[-1].set_xlabel('time / s')
    handles = [
        Line2D([], [], color=BLUE, label='P(wet), estimated'),
        *([] if view.wet is None else [Patch(facecolor=WET, label='wet ground, true')]),
        Patch(facecolor=VERMILION, label='dome under pressure'),
        Line2D([], [], linestyle='', marker='|', color=BLACK, markersize=6, label='slip alarm'),
        Patch(facecolor='none', edgecolor=PALE, linestyle=':', label='enlarged below'),
    ]
    style.legend(figure, handles, columns=5)
    return Drawn(
        figure,
        'The whole trial, leg by leg',
        'For each leg over the whole trial: P(wet), true ground, times as a dome, and slip alarms',
        'Wet and dry ground give the same forces on a dome: P(wet) of a domed foot only fades to '
        'its prior, and its morphology follows from the estimates of all feet nearby.'
        + (' Legs that stand together are side by side.' if len(view.order) > 1 else ''),
    )


def _window(view: View, window: tuple[float, float]) -> Drawn:
    """Draw force, pressure, P(wet) and slip of each leg in a part of the trial."""
    trial = view.trial
    fast = (trial.time >= window[0]) & (trial.time <= window[1])
    slow = (trial.slow_time >= window[0]) & (trial.slow_time <= window[1])
    time = trial.slow_time[slow]
    figure = Figure(figsize=(style.WIDE, 0.72 * len(view.order) + 0.9), layout='constrained')
    axes = figure.subplots(len(view.order), 4, sharex=True, sharey='col', squeeze=False)
    titles = ('normal force / N', 'gauge pressure / kPa', 'P(wet)', 'slip speed / (mm/s)')
    for ax, title in zip(axes[0], titles, strict=True):
        ax.set_title(title)
    for (force, pressure, wetness, slip), column in zip(axes, view.order, strict=True):
        for ax in (force, pressure, wetness, slip):
            _shade_stances(ax, view, column, slow)
        force.plot(trial.time[fast], trial.force[fast, column, 2], color=BLUE, linewidth=0.9)
        known = trial.slow[slow, column]
        pressure.plot(time, 1e-3 * known['pressure'], color=BLUE, linewidth=1.1)
        wanted = 1e-3 * known['setpoint']
        pressure.step(time, wanted, where='post', color=BLACK, linewidth=0.8, ls='--')
        wetness.step(time, known['wetness'], where='post', color=BLUE, lw=1.1)
        speed = 1e3 * known['slip_speed']
        slip.plot(time, speed, color=style.GREEN, linewidth=0.9)
        alarm = known['slipping']
        slip.plot(time[alarm], speed[alarm], '.', color=VERMILION, markersize=2.5)
        force.set_ylabel(f'leg {trial.legs[column]}', fontweight='bold')
    # Show at least this range, so that noise alone does not fill the axes.
    for ax, least in zip(axes[0, (0, 1, 3)], (1.0, 20.0, 20.0), strict=True):
        top = max(least, ax.get_ylim()[1])
        ax.set_ylim(min(-0.04 * top, ax.get_ylim()[0]), top)
    axes[0, 2].set_ylim(-0.06, 1.06)
    axes[0, 0].set_xlim(*window)
    for ax in axes[-1]:
        ax.set_xlabel('time / s')
    handles: list[Any] = [Patch(facecolor=STANCE, label='stance')]
    if view.wet is not None:
        handles.append(Patch(facecolor=WET, label='on wet ground'))
    handles += [
        Line2D([], [], color=BLUE, label='measured, estimated'),
        Line2D([], [], color=BLACK, linestyle='--', label='set-point'),
        Line2D([], [], color=style.GREEN, label='slip'),
        Line2D([], [], linestyle='', marker='.', color=VERMILION, markersize=5, label='alarm'),
    ]
    style.legend(figure, handles, columns=6)
    figure.align_ylabels(axes[:, 0])
    return Drawn(
        figure,
        f'From {window[0]:.0f} s to {window[1]:.0f} s',
        'For each leg: normal force, pressure with set-point, probability of wet ground, and slip '
        'speed, with stances shaded',
        'The part around the middle of all steps onto wet ground and of all changes to domes.',
    )


def _shade_stances(ax: Axes, view: View, column: int, rows: np.ndarray) -> None:
    trial = view.trial
    if not len(trial.time):
        return
    time = trial.slow_time[rows]
    near = np.clip(np.searchsorted(trial.time, time + 1e-9) - 1, 0, None)
    standing = trial.standing(view.load_gate)[near, column]
    wet = np.zeros_like(standing) if view.wet is None else view.wet[rows, column]
    for mask, colour in ((standing & ~wet, STANCE), (standing & wet, WET)):
        for start, length in spans(time, mask):
            ax.axvspan(start, start + length, color=colour, linewidth=0.0, zorder=0)
