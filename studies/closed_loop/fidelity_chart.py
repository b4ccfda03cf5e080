# SPDX-License-Identifier: Apache-2.0
"""Draw bounds and errors of the fidelity levels against time, and the shares that bounds keep."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.closed_loop.random_scenes import unlisted
from studies.drawing import BLACK
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import ORANGE
from studies.drawing import PALE
from studies.drawing import STYLE
from studies.drawing import VERMILION

LOOKS = {
    ('ch3r', 'L1'): (BLUE, 'o'),
    ('ch3r', 'L2'): (GREEN, 'D'),
    ('go2', 'L1'): (ORANGE, 's'),
    ('go2', 'L2'): (VERMILION, 'P'),
    ('rail_leg', 'L0'): (BLACK, 'v'),
}
_LEAST = 1e-5  # error at which smaller ones are drawn


def figure(document: dict[str, Any]) -> Figure:
    """Return the picture of a document as the study writes it."""
    with matplotlib.rc_context(STYLE):
        drawn = Figure(figsize=(10.0, 4.4), layout='constrained')
        work, kept = drawn.subplots(1, 2, width_ratios=(1.5, 1.0))
        for (robot, level), look in LOOKS.items():
            part = document['robots'].get(robot)
            if part and f'{level} distance' in part['bounds']:
                _work(work, part, level, f'{robot} {level}', look)
                _kept(kept, part['bounds'][f'{level} distance'], f'{robot} {level}', look)
        work.set(
            xscale='log', yscale='log', xlabel='processor time over simulated time',
            ylabel='error of the distance, relative',
            title='Error (dots, median filled) and median promised bound (hollow)',
        )  # fmt: skip
        work.legend(loc='upper left', fontsize=8, ncols=2)
        kept.plot([0.5, 1.0], [0.5, 1.0], color=PALE, lw=1, zorder=0)
        kept.set(
            xlabel='promised share of scenes', ylabel='share that kept its bound',
            title='Held-out scenes within their bound (95 % intervals)',
        )  # fmt: skip
    return drawn


def _work(axes: Axes, part: dict[str, Any], level: str, label: str, look: tuple[str, str]) -> None:
    colour, marker = look
    rows = [
        (walk[f'{level} seconds'], max(min(walk[f'{level} distance'], 10.0), _LEAST))
        for walk in unlisted(part['walks'])
        if f'{level} seconds' in walk and f'{level} distance' in walk
    ]
    times, errors = np.array(rows).T
    axes.plot(times, errors, '.', color=colour, alpha=0.5, ms=5, mew=0)
    row, time = part['bounds'][f'{level} distance'], np.median(times)
    ends = max(row['median_error'], _LEAST), row['median_bound']
    axes.plot([time, time], ends, color=colour, lw=1)
    axes.plot(time, ends[0], marker, color=colour, ms=8, mec='white', label=label, zorder=3)
    axes.plot(time, ends[1], marker, color=colour, ms=8, mfc='white', zorder=3)


def _kept(axes: Axes, row: dict[str, Any], label: str, look: tuple[str, str]) -> None:
    colour, marker = look
    promised = np.array([float(share) for share in row['shares']])
    found = np.array([each['kept'] for each in row['shares'].values()])
    ends = np.array([each['interval'] for each in row['shares'].values()])
    spread = np.abs(ends.T - found)
    axes.errorbar(
        promised,
        found,
        spread,
        color=colour,
        marker=marker,
        ms=4,
        lw=1,
        elinewidth=0.6,
        label=label,
    )
