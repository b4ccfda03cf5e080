# SPDX-License-Identifier: Apache-2.0
"""Make the table and the picture of the walks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.pace import Progress
from studies import command
from studies.drawing import BLACK, BLUE, DARK, GREEN, LIGHT, ORANGE, PALE, STYLE, VERMILION
from studies.work_precision.walk.hexapod import DRAKE
from studies.work_precision.walk.results import FAILED, WalkResult
from studies.work_precision.walk.walkers import HEXAPOD, RAIL

# Methods that are shown walk by walk.
SHOWN = ('L1, 4 ms', 'L2, 1 ms', 'L2 without landing, 1 ms', 'MuJoCo defaults, 2 ms')


def table(results: Sequence[WalkResult]) -> str:
    """Return the results as text: errors and times, and then each walk, mm a cycle."""
    lines = [command.listed([{**vars(result), 'walks': ''} for result in results])]
    for robot in dict.fromkeys(result.robot for result in results):
        part = [result for result in results if result.robot == robot]
        rows = [
            {'walk': walk['walk']} | {result.method: _went(result, row) for result in part}
            for row, walk in enumerate(part[0].walks)
        ]
        lines.append(command.listed(rows, f'\n{robot}: distance (slip), mm a cycle'))
    if DRAKE not in {result.family for result in results}:
        lines.append('left out: Drake, the reference of another engine: pip install drake')
    return '\n'.join(lines)


def _went(result: WalkResult, row: int) -> str:
    walk = result.walks[row]
    if walk['verdict']:
        return 'verdict'
    return f'{1e3 * walk["distance"]:.1f} ({1e3 * walk["slip"]:.1f})'


def figures(results: Sequence[WalkResult], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name."""
    return {'walk': draw(results)}


_LOOKS: dict[str, dict[str, Any]] = {
    'L1': {'color': DARK, 'marker': 'o'},
    'L1, compiled': {'color': LIGHT, 'marker': 's'},
    'L2': {'color': GREEN, 'marker': 'D'},
    'L2 without landing': {'color': ORANGE, 'marker': 'D', 'mfc': 'none'},
    'MuJoCo defaults': {'color': VERMILION, 'marker': 'X'},
    DRAKE: {'color': BLACK, 'marker': '^'},
    'RailLeg': {'color': GREEN, 'marker': 'o'},
    'solve_ivp, events, 1e-6': {'color': BLUE, 'marker': 'D'},
}


def draw(results: Sequence[WalkResult]) -> Figure:
    """Return the picture: time against errors, distances walk by walk, and the rail leg."""
    hexapod, rail = (
        [result for result in results if result.robot == robot] for robot in (HEXAPOD, RAIL)
    )
    with matplotlib.rc_context(STYLE | {'lines.markersize': 6.0}):
        figure = Figure(figsize=(10.0, 8.4), layout='constrained')
        panels = figure.subplots(2, 2).ravel()
        _errors(panels[0], hexapod, 'distance', 'a  hexapod: distance')
        _errors(panels[1], hexapod, 'slip', 'b  hexapod: slip path of a foot')
        _strips(panels[2], hexapod)
        _errors(panels[3], rail, 'distance', 'd  rail leg: distance')
        families = {result.family for result in results}
        handles = [
            Line2D([], [], ls='', label=_with_steps(family, results), **look)
            for family, look in _LOOKS.items()
            if family in families
        ]
        handles.append(
            Line2D([], [], color=PALE, alpha=0.5, lw=7.0, label='step error of this reference')
        )
        top, second = hexapod[0].top, hexapod[0].second
        title = f'Mark: median of the walks; whisker: the worst. a to c: errors against {top}'
        title += f';\nlighter: against the mean of it and {second}.' if second != top else '.'
        figure.legend(handles=handles, loc='outside lower center', ncol=4, title=title)
    return figure


def _with_steps(family: str, part: Sequence[WalkResult]) -> str:
    """Return the name of a family with its shortest and longest step, ms."""
    shown = [each for each in part if each.family == family and each.method != each.top]
    steps = [1e3 * each.step_s for each in shown if each.step_s]
    ends = dict.fromkeys(f'{step:g}' for step in (min(steps), max(steps))) if steps else ()
    return f'{family}: {" to ".join(ends)} ms' if ends else family


def _errors(panel: Axes, part: Sequence[WalkResult], name: str, title: str) -> None:
    """Draw time over the error called ``name``: mark at the median, whisker to the worst walk."""
    panel.set(xscale='log', yscale='log', title=title, ylabel='error, %')
    panel.set_xlabel('time for a simulated second, ms')
    shown = [result for result in part if result.method != result.top]
    for family, look in _LOOKS.items():
        mine = [result for result in shown if result.family == family]
        mine.sort(key=lambda result: result.step_s or 0.0)
        x = [result.ms_per_second for result in mine]
        y = [1e2 * result.errors[name] for result in mine]
        panel.plot(x, y, ls='-', lw=1.0, zorder=3, **look)
        panel.plot(x, [1e2 * r.mean_errors[name] for r in mine], ls='', alpha=0.35, **look)
        for result, at, error in zip(mine, x, y, strict=True):
            ends = [error, 1e2 * result.worst[name]]
            panel.plot([at, at], ends, '-_', color=look['color'], lw=1.0, ms=5, alpha=0.5)
    # Of two results of the reference's engine, by the finest steps.
    same = [r for r in shown if r.family == part[0].top.split(',')[0] and r.step_s]
    if same:
        nearest = min(same, key=lambda result: result.step_s)
        panel.axhspan(1e-9, 1e2 * nearest.errors[name], color=PALE, alpha=0.35, lw=0, zorder=0)
        panel.set_ylim(bottom=30.0 * min(nearest.errors[name], nearest.mean_errors[name]))
    panel.margins(0.08)
    panel.xaxis.set_major_formatter('{x:g}')
    panel.yaxis.set_major_formatter('{x:g}')
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


def _strips(panel: Axes, part: Sequence[WalkResult]) -> None:
    """Draw the errors of the distance, a row for each walk."""
    names = [walk['walk'] for walk in part[0].walks]
    shown = [result for result in part if result.method in SHOWN]
    for result, shift in zip(shown, np.linspace(-0.28, 0.28, len(shown)), strict=True):
        off = [1e2 * walk['distance_error'] for walk in result.walks]
        panel.plot(off, shift + np.arange(len(names)), ls='', ms=5, **_LOOKS[result.family])
    for limit in (-1e2 * FAILED, 0.0, 1e2 * FAILED):
        panel.axvline(limit, color=BLACK, lw=0.8, ls=':' if limit else '-', zorder=1)
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set(title='c  hexapod: distance, walk by walk', xlabel='distance off by, %')
    panel.grid(axis='y', color=PALE, alpha=0.25, lw=0.5)
