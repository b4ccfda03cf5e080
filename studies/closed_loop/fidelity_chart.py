# SPDX-License-Identifier: Apache-2.0
"""Draw errors and bounds of the fidelity levels against time, and the scenes within bounds."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.closed_loop.random_scenes import unlisted
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, STYLE, VERMILION

LOOKS = {
    ('ch3r', 'L1'): (BLUE, 'o'),
    ('ch3r', 'L2'): (GREEN, 'D'),
    ('go2', 'L1'): (ORANGE, 's'),
    ('go2', 'L2'): (VERMILION, 'P'),
    ('rail_leg', 'L0'): (BLACK, 'v'),
}
_LEAST, _MOST = 1e-5, 10.0  # errors beyond are drawn here


def figure(document: dict[str, Any]) -> Figure:
    """Return the picture of a document as the study writes it."""
    with matplotlib.rc_context(STYLE):
        drawn = Figure(figsize=(9.0, 4.4), layout='constrained')
        work, kept = drawn.subplots(1, 2, width_ratios=(1.7, 1.0))
        names: list[str] = []
        for (robot, level), look in LOOKS.items():
            part = document['robots'].get(robot)
            if part and f'{level} distance' in part['bounds']:
                _work(work, part, level, f'{robot} {level}', look)
                _kept(kept, part['bounds'], level, len(names), look)
                names.append(f'{robot} {level}')
        work.set(
            xscale='log', yscale='log', xlabel='processor time over simulated time',
            ylabel='error of the distance, relative',
            title='Every scene: dot. Median error: filled. Median bound: hollow',
        )  # fmt: skip
        for end in (_LEAST, _MOST):
            work.axhspan(end / 1.6, end * 1.6, color=PALE, alpha=0.2, lw=0)
        texts = [f'{_LEAST:g} or less', '1e-4', '0.001', '0.01', '0.1', '1', f'{_MOST:g} or more']
        work.set_yticks(np.logspace(-5, 1, len(texts)), texts)
        work.minorticks_off()
        work.legend(loc='upper left', bbox_to_anchor=(0.0, 0.92))
        kept.axvline(document['promise'], color=BLACK, lw=0.9, ls='--', zorder=0)
        kept.set_yticks(range(len(names)), names)
        kept.set(
            xlabel=f'share, 95 % interval (promised: {document["promise"]:g})',
            ylim=(len(names) - 0.5, -0.5),
            title='Held-out scenes within their bound\n(filled: distance; hollow: slip)',
        )  # fmt: skip
    return drawn


def _work(axes: Axes, part: dict[str, Any], level: str, label: str, look: tuple[str, str]) -> None:
    colour, marker = look
    rows = [
        (walk[f'{level} seconds'], max(min(walk[f'{level} distance'], _MOST), _LEAST))
        for walk in unlisted(part['walks'])
        if f'{level} seconds' in walk and f'{level} distance' in walk
    ]
    times, errors = np.array(rows).T
    axes.plot(times, errors, '.', color=colour, alpha=0.5, ms=5, mew=0)
    row, time = part['bounds'][f'{level} distance'], np.median(times)
    ends = max(row['median_error'], _LEAST), min(row['median_bound'], _MOST)
    axes.plot([time, time], ends, color=colour, lw=1)
    axes.plot(time, ends[0], marker, color=colour, ms=8, mec='white', label=label, zorder=3)
    axes.plot(time, ends[1], marker, color=colour, ms=8, mfc='white', zorder=3)


def _kept(
    axes: Axes, bounds: dict[str, Any], level: str, place: int, look: tuple[str, str]
) -> None:
    """Draw the share of scenes within the bound of distance, and of slip below it."""
    colour, marker = look
    for shift, metric, face in ((-0.15, 'distance', colour), (0.15, 'slip', 'white')):
        row = bounds.get(f'{level} {metric}', {})
        if row.get('held_out'):
            at = place + shift
            axes.plot(row['interval'], [at, at], color=colour, lw=1.2)
            axes.plot(row['kept'], at, marker, color=colour, mfc=face, ms=6)
