# SPDX-License-Identifier: Apache-2.0
"""Figure of a replay: P(wet) and set-points of every leg, as recorded and as replayed."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.reports.style import VERMILION, WIDE, legend
from ros_pad.trials.comparison import Track
from ros_pad.trials.replay import Replay

RECORDED: dict[str, Any] = {'color': '#C4C4C4', 'lw': 3.0, 'solid_capstyle': 'butt'}
REPLAYED: dict[str, Any] = {'color': VERMILION, 'lw': 1.0}


def draw(replay: Replay) -> Figure:
    """Draw P(wet) and set-points, recorded and replayed, with one row for each leg."""
    figure = Figure(figsize=(WIDE, 0.9 + 0.95 * len(replay.legs)), layout='constrained')
    grid = figure.subplots(len(replay.legs), 2, sharex=True, sharey='col', squeeze=False)
    for (wet, pressure), leg in zip(grid, replay.legs, strict=True):
        for tracks, look in ((replay.recorded, RECORDED), (replay.replayed, REPLAYED)):
            _steps(wet, tracks[leg, 'wetness'], replay.start_ns, look)
            _steps(pressure, tracks[leg, 'setpoint'], replay.start_ns, look, 1e-3)
        wet.set_ylabel(f'leg {leg}', rotation=0, ha='right', va='center')
    grid[0, 0].set_title('P(wet)')
    grid[0, 1].set_title('set-point, kPa gauge')
    grid[0, 0].set_ylim(-0.05, 1.05)
    grid[0, 0].set_yticks([0.0, 0.5, 1.0])
    grid[0, 1].set_ylim(bottom=-3.0)
    for axes in grid[-1]:
        axes.set_xlabel('time, s')
        axes.set_xlim(0.0, max(replay.duration_s, 1e-3))
    anything = any(len(track.times) for track in replay.recorded.values())
    lines = [
        Line2D([], [], label='recorded' if anything else 'recorded (none)', **RECORDED),
        Line2D([], [], label='replayed', **REPLAYED),
    ]
    legend(figure, lines)
    return figure


def _steps(
    axes: Axes, track: Track, start_ns: int, look: dict[str, Any], scale: float = 1.0
) -> None:
    # Ticks may add commands without set-points.
    known = np.isfinite(track.values[:, 0])
    if known.any():
        time, values = (track.times[known] - start_ns) * 1e-9, track.values[known, 0]
        axes.plot(time, scale * values, drawstyle='steps-post', **look)
