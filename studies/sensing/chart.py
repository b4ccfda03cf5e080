# SPDX-License-Identifier: Apache-2.0
"""Pictures of the study of sensing: time against error, and where methods diverge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from studies.drawing import BLACK, BLUE, ORANGE, PURPLE, STYLE, VERMILION
from studies.sensing.stability import AFTER, LIMIT, LONGEST, RATES, TIMED, Curve
from studies.sensing.walks import RECORDED

COLOURS = {
    'estimator': BLUE,
    'plain': VERMILION,
    'invariant, χ²': PURPLE,
    'odometry': ORANGE,
}
FLIGHTS = 0.05, 0.4  # s, times in which a gait may have no foot on the ground
OTHERS = 'model of others, '
MARKERS = {
    **{'dry': 'o', 'patches': 's', 'ice': '^', 'hexapod': 'D'},
    RECORDED: 'P',
    **{OTHERS + 'dry': 'v', OTHERS + 'patches': '<', OTHERS + 'ice': '>'},
}


def picture(rows: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Figure:
    """Return time an update against errors of velocity and drift."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 4.2), layout='constrained')
        axes = figure.subplots(1, 2)
        columns = (
            ('velocity_error', 1e3, 'error of velocity x y, mm/s'),
            ('drift', 1e2, 'drift, %'),
        )
        for axis, (key, factor, label) in zip(axes, columns, strict=True):
            for method in methods:
                for walk, marker in MARKERS.items():
                    some = [r for r in rows if (r['method'], r['course']) == (method, walk)]
                    if some:
                        x = 1e6 * np.mean([row['seconds'] for row in some])
                        y = factor * np.mean([row[key] for row in some])
                        axis.loglog(x, y, marker, color=COLOURS[method], markersize=6)
            axis.set_xlabel('time an update, µs')
            axis.set_ylabel(label)
            for along in (axis.xaxis, axis.yaxis):
                along.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                along.set_major_formatter('{x:g}')
            axis.minorticks_off()
            axis.grid(True, alpha=0.3)
        for method in methods:
            axes[0].plot([], [], 'o', color=COLOURS[method], label=method)
        for walk, marker in MARKERS.items():
            axes[1].plot([], [], marker, color='grey', label=walk)
        for axis in axes:
            axis.legend(fontsize=8)
        return figure


def stability(curves: Sequence[Curve]) -> Figure:
    """Return the error of the velocity over what makes it grow, a panel for each case."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 6.0), layout='constrained')
        panels = figure.subplots(2, 3, sharey=True)
        cases = list(dict.fromkeys(curve.case for curve in curves))
        for axis, case in zip(panels.flat, cases, strict=False):
            for curve in curves:
                if curve.case == case:
                    _line(axis, curve)
            axis.axhline(1e3 * LIMIT, color='grey', linewidth=0.8)
            axis.set_title(case)
            axis.grid(True, alpha=0.3)
            _along(axis, case)
        panels[0, 0].set_yscale('log')
        panels[0, 0].set_ylim(1.0, 6000.0)
        panels[0, 0].yaxis.set_major_formatter('{x:g}')
        for axis in panels[:, 0]:
            axis.set_ylabel('error of velocity x y, mm/s')
        last = panels.flat[-1]
        last.axis('off')
        for name in dict.fromkeys(curve.method for curve in curves if curve.method != 'law'):
            last.plot([], [], color=COLOURS[name], label=name)
        last.plot([], [], '--', color=BLACK, label='law')
        last.plot([], [], ':', color=BLUE, linewidth=2.5, label='estimator, in doubt')
        last.plot([], [], color='grey', linewidth=0.8, label='diverged above')
        last.legend(loc='center', fontsize=9)
        return figure


def _line(axis: Any, curve: Curve) -> None:
    x, y = np.array(curve.x), 1e3 * np.array(curve.error)
    mark = '' if curve.case in TIMED else 'o'
    if curve.method == 'law':
        y = np.where(y > 0.0, y, np.nan)
        axis.plot(x, y, '--', color=BLACK, linewidth=1.2, marker=mark, markersize=3, zorder=5)
        return
    colour = COLOURS[curve.method]
    if curve.method != 'estimator':
        axis.plot(x, y, color=colour, linewidth=1.0, marker=mark, markersize=3)
        return
    doubted = np.array(curve.doubt) > 0.5
    axis.plot(x, np.where(doubted, np.nan, y), color=colour, linewidth=2.0, marker=mark, zorder=6)
    axis.plot(x, np.where(doubted, y, np.nan), ':', color=colour, linewidth=2.5, zorder=6)
    if mark:
        axis.plot(x[doubted], y[doubted], 'o', color=colour, fillstyle='none', zorder=6)


def _along(axis: Any, case: str) -> None:
    """Label what an axis has along it."""
    if case in TIMED:
        axis.set_xscale('log')
        axis.xaxis.set_major_formatter('{x:g}')
        axis.set_xlim(0.02, AFTER)
        axis.axvline(LONGEST, color='grey', linewidth=0.8, linestyle='-.')
        axis.set_xlabel(f'time since it begins, s; it ends after {LONGEST:g} s')
        if case == 'no foot stands':
            axis.axvspan(*FLIGHTS, color='grey', alpha=0.15)
    elif case == 'low rates':
        axis.set_xscale('log')
        axis.set_xticks(RATES, [str(rate) for rate in RATES])
        axis.minorticks_off()
        axis.set_xlabel('samples a second, Hz')
    else:
        axis.set_xticks(range(6), ['0', '1', '2', '3', '4', '4, since\nbefore'])
        axis.set_xlabel('feet that slide, of 4')
