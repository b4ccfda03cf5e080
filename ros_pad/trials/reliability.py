# SPDX-License-Identifier: Apache-2.0
"""How far P(wet) can be trusted: how often the ground was wet where a foot said so."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.trials.metrics import stance_ends
from ros_pad.trials.page import BLUE
from ros_pad.trials.page import COLUMN
from ros_pad.trials.page import PALE
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import legend
from ros_pad.trials.trial import DOME_PRESSURE
from ros_pad.trials.view import View


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


def _figure(believed: np.ndarray, wet: np.ndarray) -> Figure:
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


def picture(believed: np.ndarray, true: np.ndarray) -> Drawn:
    """Draw the reliability diagram of :func:`beliefs`, with its words."""
    return Drawn(
        _figure(believed, true),
        'How far P(wet) can be trusted',
        f'Reliability diagram of {len(believed)} flat stances',
        'Dots on the dashed line would say that the estimator is neither too sure nor too shy. '
        'Bars are 95 % intervals (Wilson).',
    )


__all__ = ['beliefs', 'picture']
