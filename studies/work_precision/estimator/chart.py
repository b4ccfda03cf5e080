# SPDX-License-Identifier: Apache-2.0
"""Draw the pictures of the study: comparison of slip alarms, and robustness of the estimator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy import stats

from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PURPLE, SKY, STYLE, VERMILION
from studies.samples import share_interval
from studies.work_precision.estimator.conditions import CONFIGURED, NOT_CONFIGURED
from studies.work_precision.estimator.methods import CUSUM, GLR, LIKELIHOOD, RATIO, SHIPPED, STATES
from studies.work_precision.estimator.tally import TARGETS, Row

_TARGET: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'ls': '--', 'zorder': 1.5}

# --- methods -------------------------------------------------------------------------------------

_LOOKS: dict[tuple[str, str], dict[str, Any]] = {
    (RATIO, ''): {'color': VERMILION, 'marker': 'X'},
    (CUSUM, '15 mm/s'): {'color': SKY, 'marker': 'o'},
    (CUSUM, '10 mm/s'): {'color': BLUE, 'marker': 'o'},
    (CUSUM, '20 mm/s'): {'color': BLUE, 'marker': 'o', 'mfc': 'white', 'ls': ':'},
    (LIKELIHOOD, ''): {'color': ORANGE, 'marker': 's'},
    (GLR, ''): {'color': PURPLE, 'marker': 'D'},
    (STATES, ''): {'color': BLACK, 'marker': 'v'},
    (SHIPPED, ''): {'color': GREEN, 'marker': '*', 'ms': 13.0, 'ls': ''},
}
_LABELS = {
    RATIO: 'T/N above 0.05 to 0.6',
    CUSUM: 'displacement beyond {}, over 0.1 to 2 mm',
    LIKELIHOOD: 'CUSUM of likelihoods, 30 mm/s, over 1 to 32',
    GLR: 'generalised likelihood ratio, over 1 to 32',
    STATES: 'two states, odds over 1 to e¹⁶',
    SHIPPED: 'FootEstimator, alarm as shipped',
}
_NONE = 0.1  # zero false alarms a minute are drawn here, methods side by side
_ASIDE = {look: 1.1 ** (place - 4) for place, look in enumerate(_LOOKS)}


def draw_methods(rows: Sequence[Row]) -> Figure:
    """Return the picture of the methods, each a curve over its thresholds."""
    rows = [row for row in rows if row.part == 'methods']
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 4.8))
        figure.set_layout_engine('constrained', w_pad=0.08, h_pad=0.08)
        a, b, c = figure.subplots(1, 3).ravel()
        _against_false(a, rows, 'delay', 1e3, 'a  delay of the alarm', 'median, ms')
        _against_false(b, rows, 'misses', 1e2, 'b  slips missed', '% of slips of 5 mm')
        b.axhline(1e2 * TARGETS['misses'], **_TARGET)
        b.set_yscale('symlog', linthresh=0.3, linscale=0.4)
        b.set_ylim(-0.05, 130.0)
        b.set_yticks(
            [0.0, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0], ['0', '0.3', '1', '3', '10', '30', '100']
        )
        _costs(c, rows)
        handles = [
            Line2D([], [], **{'lw': 1.2, 'ms': 5.0, **look}, label=_LABELS[name].format(variant))
            for (name, variant), look in _LOOKS.items()
        ]
        handles.append(Line2D([], [], **_TARGET, label='target, at most'))
        figure.legend(handles=handles, loc='outside lower center', ncol=3)
    return figure


def _against_false(
    panel: Axes, rows: Sequence[Row], name: str, scale: float, title: str, label: str
) -> None:
    for (method, variant), look in _LOOKS.items():
        mine = [
            row
            for row in rows
            if (row.name, row.variant) == (method, variant)
            and getattr(row, name) is not None
            and row.false_per_minute is not None
        ]
        if not mine:
            continue  # a line without points would spoil the layout
        x = [row.false_per_minute or _NONE * _ASIDE[method, variant] for row in mine]
        y = [scale * getattr(row, name) for row in mine]
        style = {'lw': 1.2, 'ms': 5.0, 'clip_on': False, 'zorder': 3, **look}
        if method == SHIPPED:
            style |= {'zorder': 5, 'mec': 'white', 'mew': 0.7}
        panel.plot(x, y, **style)
    panel.axvline(TARGETS['false_per_minute'], **_TARGET)
    panel.set(xscale='log', title=title, ylabel=label, xlabel='false alarms in a minute of stick')
    panel.axvspan(0.6 * _NONE, 1.7 * _NONE, color=PALE, alpha=0.15, lw=0.0)
    panel.set_xlim(0.6 * _NONE, 3e3)
    panel.minorticks_off()
    panel.set_xticks([_NONE, 1.0, 10.0, 100.0, 1000.0], ['none', '1', '10', '100', '1000'])
    panel.set_ylim(bottom=0.0)
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


def best(rows: Sequence[Row]) -> list[Row]:
    """Return for each method the row of its best threshold.

    This is the threshold with the fewest misses of those that meet the target of false alarms; if
    none meets the target, the one with the fewest false alarms. Of equal ones, it is the one with
    the shortest delay.
    """
    found = []
    for method, variant in _LOOKS:
        mine = [row for row in rows if (row.name, row.variant) == (method, variant)]
        if mine:
            found.append(min(mine, key=_badness))
    return found


def _badness(row: Row) -> tuple[float, ...]:
    false = math.inf if row.false_per_minute is None else row.false_per_minute
    misses = 1.0 if row.misses is None else row.misses
    return (
        max(TARGETS['false_per_minute'], false),
        misses,
        math.inf if row.delay is None else row.delay,
    )


def _costs(panel: Axes, rows: Sequence[Row]) -> None:
    """Draw misses over the time of an update, each method at its best threshold."""
    for row in best(rows):
        look = _LOOKS[row.name, row.variant]
        missed = 1e2 * (row.misses or 0.0)
        panel.plot(
            row.us_per_update or math.nan, missed, **{'ms': 7.0, **look, 'ls': ''}, clip_on=False
        )
    panel.axvline(TARGETS['us_per_update'], **_TARGET)
    panel.set(
        xscale='log', xlim=(0.08, 300.0), xlabel='time of an update, µs',
        ylabel='% of slips missed', title='c  time, each at its best threshold',
    )  # fmt: skip
    panel.set_ylim(bottom=0.0)
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


# --- robustness ----------------------------------------------------------------------------------

# Changes: name in the table and on the axis, and scale.
_CHANGES: dict[str, tuple[str, float]] = {
    'position noise': ('marker noise, mm', 1e3),
    'position steps': ('steps of the position, mm', 1e3),
    'sample rate': ('samples a second', 1.0),
    'shear stiffness': ('shear stiffness in the file, times', 1.0),
    'wet friction': ('friction on wet ground (dry: 0.8)', 1.0),
    'position late': ('position late by, ms', 1e3),
}
# Measures: label, scale, and the ends of what is wanted.
_MEASURES: dict[str, tuple[str, float, float, float]] = {
    'misses': ('slips missed, %', 1e2, 0.0, TARGETS['misses']),
    'false_per_minute': ('false alarms a minute', 1.0, 0.0, TARGETS['false_per_minute']),
    'wet_right': ('wet or dry right, %', 1e2, TARGETS['wet_right'], 1.0),
}
_VARIANTS: dict[str, dict[str, Any]] = {
    '': {'color': BLACK, 'marker': 'D'},
    CONFIGURED: {'color': GREEN, 'marker': 'o'},
    NOT_CONFIGURED: {'color': VERMILION, 'marker': 's'},
}
_DRAWN = (
    ('position noise', 'misses'),
    ('sample rate', 'misses'),
    ('wet friction', 'wet_right'),
    ('position steps', 'false_per_minute'),
    ('shear stiffness', 'false_per_minute'),
    ('position late', 'false_per_minute'),
)


def draw_robustness(rows: Sequence[Row]) -> Figure:
    """Return the picture of six changes, with targets, and intervals of the counts."""
    rows = [row for row in rows if row.part == 'robustness']
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 5.2))
        figure.set_layout_engine('constrained', w_pad=0.08, h_pad=0.08)
        for panel, (change, measure) in zip(figure.subplots(2, 3).ravel(), _DRAWN, strict=True):
            _panel(panel, [row for row in rows if row.name == change], measure)
            panel.set_xlabel(_CHANGES[change][0])
        labels = ('cannot be configured', 'configured with it', 'not configured with it')
        handles: list[Artist] = [
            Line2D([], [], ms=5.0, lw=1.2, **look, label=f'estimator {label}')
            for look, label in zip(_VARIANTS.values(), labels, strict=True)
        ]
        handles += [
            Line2D([], [], **_TARGET, label='target'),
            Patch(color=PALE, alpha=0.25, lw=0.0, label='as shipped'),
        ]
        title = 'Bars: 95 %, as if slips, alarms and stances were independent'
        figure.legend(handles=handles, loc='outside lower center', ncol=3, title=title)
    return figure


def _panel(panel: Axes, rows: Sequence[Row], measure: str) -> None:
    label, scale, low, high = _MEASURES[measure]
    panel.axhline(scale * (low or high), **_TARGET)
    values = sorted({row.value for row in rows})
    variants = list(dict.fromkeys(row.variant for row in rows))
    for place in {values.index(row.value) for row in rows if row.shipped}:
        panel.axvspan(place - 0.4, place + 0.4, color=PALE, alpha=0.25, lw=0.0, zorder=0)
    for row in rows:
        at = float(values.index(row.value))
        value = getattr(row, measure)
        if value is not None:
            at += 0.24 * (variants.index(row.variant) - 0.5 * (len(variants) - 1))
            look = _VARIANTS[row.variant]
            ends = [scale * end for end in _ends(row, measure)]
            panel.plot([at, at], ends, color=look['color'], lw=1.2)
            panel.plot(at, scale * value, ls='', ms=5.0, zorder=3, clip_on=False, **look)
    across = _CHANGES[rows[0].name][1] if rows else 1.0
    panel.set_xticks(range(len(values)), [f'{across * value:g}' for value in values])
    panel.set_xlim(-0.6, max(1, len(values)) - 0.4)
    if low == 0.0:
        panel.set_ylim(bottom=0.0)
    panel.set_ylabel(label)
    panel.grid(axis='y', color=PALE, alpha=0.25, lw=0.5)


def _ends(row: Row, measure: str) -> tuple[float, float]:
    """Return the 95 % interval of a share (Clopper and Pearson) or of a rate (Poisson)."""
    if measure == 'false_per_minute':
        count = round((row.false_per_minute or 0.0) * row.stick_minutes)
        low, high = stats.chi2.ppf((0.025, 0.975), (2 * count, 2 * count + 2)) / 2.0
        return (float(low) if count else 0.0) / row.stick_minutes, float(high) / row.stick_minutes
    of = row.slips if measure == 'misses' else row.stances
    return share_interval(round(getattr(row, measure) * of), of)
