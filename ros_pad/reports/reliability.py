# SPDX-License-Identifier: Apache-2.0
"""Reliability diagram of P(wet): share of wet ground for each estimated probability."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.reports.style import BLUE, COLUMN, PALE, Drawn, legend
from ros_pad.reports.view import View
from ros_pad.trials.metrics import stance_ends


def outcomes(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Return P(wet) at the end of each flat stance, and whether the ground was wet, all legs."""
    trial = view.trial
    estimated: list[float] = []
    true: list[bool] = []
    if view.wet is not None:
        for column, rows in enumerate(stance_ends(trial, view.load_gate)):
            before = np.maximum(rows - 1, 0)
            flat = trial.pressure[before, column] < DOME_PRESSURE
            flat &= np.isfinite(trial.wet_probability[rows, column])
            estimated += trial.wet_probability[rows[flat], column].tolist()
            true += view.wet[before[flat], column].tolist()
    return np.array(estimated), np.array(true, dtype=bool)


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the ends of the 95 % interval of the share ``hits / count`` (Wilson 1927)."""
    z2 = 1.96**2
    middle = (hits + 0.5 * z2) / (count + z2)
    half = 1.96 * math.sqrt(hits * (count - hits) / count + 0.25 * z2) / (count + z2)
    return middle - half, middle + half


def _figure(estimated: np.ndarray, wet: np.ndarray) -> Figure:
    """Draw the share of stances on wet ground over the estimated probability, in five bins."""
    figure = Figure(figsize=(COLUMN, 1.06 * COLUMN), layout='constrained')
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [0.0, 1.0], color=PALE, linestyle='--', linewidth=0.9)
    edges = np.linspace(0.0, 1.0, 6)
    bins = np.clip(np.digitize(estimated, edges) - 1, 0, 4)
    for number in range(5):
        mine = bins == number
        count, hits = int(mine.sum()), int(wet[mine].sum())
        if not count:
            continue
        x, y = float(estimated[mine].mean()), hits / count
        low, high = wilson(hits, count)
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
        Line2D([], [], color=PALE, linestyle='--', label='as predicted'),
    ]
    legend(figure, handles, columns=2)
    return figure


def picture(estimated: np.ndarray, true: np.ndarray) -> Drawn:
    """Draw the reliability diagram of :func:`outcomes`, with its texts."""
    return Drawn(
        _figure(estimated, true),
        'Reliability of P(wet)',
        f'Reliability diagram of {len(estimated)} flat stances',
        'On the dashed line the ground is wet as often as the estimator predicts. '
        'Bars are 95 % intervals (Wilson).',
    )


__all__ = ['outcomes', 'picture', 'wilson']
