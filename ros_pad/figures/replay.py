# SPDX-License-Identifier: Apache-2.0
"""Figure of a replay: P(wet) and set-points of every leg, as recorded and as replayed."""

from __future__ import annotations

import os
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.figures.design import _STYLE
from ros_pad.trials.comparison import Track
from ros_pad.trials.page import picture_path
from ros_pad.trials.replay import Replay
from ros_pad.trials.report import VERMILION

RECORDED: dict[str, Any] = {'color': '#C4C4C4', 'lw': 3.0, 'solid_capstyle': 'butt'}
REPLAYED: dict[str, Any] = {'color': VERMILION, 'lw': 1.0}


def draw(path: str | os.PathLike[str], replay: Replay) -> None:
    """Draw a replay: a row for each leg.

    Parameters
    ----------
    path : path
        Ends in .png, .svg or .pdf. An existing file is replaced.
    replay : Replay
        What is drawn.

    Raises
    ------
    InvalidInput
        For another ending.
    """
    text = picture_path(path)
    ambient = replay.settings.ambient_pressure
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(7.2, 0.9 + 0.95 * len(replay.legs)), layout='constrained')
        grid = figure.subplots(len(replay.legs), 2, sharex=True, sharey='col', squeeze=False)
        for (wet, pressure), leg in zip(grid, replay.legs, strict=True):
            for tracks, look in ((replay.recorded, RECORDED), (replay.replayed, REPLAYED)):
                _steps(wet, tracks[leg, 'wetness'], replay.start_ns, look)
                _steps(
                    pressure, tracks[leg, 'pressure_setpoint'], replay.start_ns, look,
                    1e-3, ambient,
                )  # fmt: skip
            wet.set_ylabel(f'leg {leg}', rotation=0, ha='right', va='center')
        grid[0, 0].set_title('P(wet)')
        grid[0, 1].set_title('set-point, kPa gauge')
        grid[0, 0].set_ylim(-0.05, 1.05)
        grid[0, 0].set_yticks([0.0, 0.5, 1.0])
        grid[0, 1].set_ylim(bottom=-3.0)
        for axes in grid[-1]:
            axes.set_xlabel('time, s')
            axes.set_xlim(0.0, max(replay.duration_s, 1e-3))
        heard = any(len(track) for track in replay.recorded.values())
        lines = [
            Line2D([], [], label='recorded' if heard else 'recorded (nothing was)', **RECORDED),
            Line2D([], [], label='replayed', **REPLAYED),
        ]
        figure.legend(handles=lines, loc='outside upper right', ncols=2, fontsize=8)
        figure.savefig(text, dpi=200)


def _steps(
    axes: Axes,
    track: Track,
    start_ns: int,
    look: dict[str, Any],
    scale: float = 1.0,
    zero: float = 0.0,
) -> None:
    if not len(track):
        return
    time = (np.array(track.times, dtype=np.int64) - start_ns) * 1e-9
    axes.plot(time, scale * (track.values[:, 0] - zero), drawstyle='steps-post', **look)
