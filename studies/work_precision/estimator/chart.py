# SPDX-License-Identifier: Apache-2.0
"""Draw the pictures of the study: comparison of slip alarms, and robustness of the estimator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.drawing import BLACK
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import ORANGE
from studies.drawing import PALE
from studies.drawing import PURPLE
from studies.drawing import SKY
from studies.drawing import STYLE
from studies.drawing import VERMILION
from studies.work_precision.estimator.methods import BAYES
from studies.work_precision.estimator.methods import CUSUM
from studies.work_precision.estimator.methods import RATIO
from studies.work_precision.estimator.methods import SHIPPED
from studies.work_precision.estimator.methods import SPEED
from studies.work_precision.estimator.tally import TARGETS
from studies.work_precision.estimator.tally import Row

_TARGET: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'ls': '--', 'zorder': 1.5}

# --- methods -------------------------------------------------------------------------------------

_LOOKS: dict[tuple[str, str], dict[str, Any]] = {
    (RATIO, ''): {'color': VERMILION, 'marker': 'X'},
    (SPEED, ''): {'color': ORANGE, 'marker': 's'},
    (CUSUM, '10 mm/s'): {'color': SKY, 'marker': 'o'},
    (CUSUM, '20 mm/s'): {'color': BLUE, 'marker': 'o'},
    (CUSUM, '40 mm/s'): {'color': BLUE, 'marker': 'o', 'mfc': 'white', 'ls': ':'},
    (BAYES, ''): {'color': PURPLE, 'marker': 'D'},
    (SHIPPED, ''): {'color': GREEN, 'marker': '*', 'ms': 13.0, 'ls': ''},
}
_LABELS = {
    RATIO: 'T/N above 0.05 to 0.6',
    SPEED: 'slip speed above 6 to 100 mm/s',
    CUSUM: 'CUSUM for {}, above 0.5 to 16',
    BAYES: 'Bayes filter, margin below -0.3 to 0.05',
    SHIPPED: 'FootEstimator, alarm as shipped',
}
_NONE = 0.1  # zero false alarms a minute are drawn here, methods side by side
_ASIDE = {look: 1.14 ** (place - 3) for place, look in enumerate(_LOOKS)}


def draw_methods(rows: Sequence[Row]) -> Figure:
    """Return the picture of the methods, each a curve over its thresholds."""
    rows = [row for row in rows if row.part == 'methods']
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 6.6))
        figure.set_layout_engine('constrained', w_pad=0.08, h_pad=0.08)
        a, b, c, d = figure.subplots(2, 2).ravel()
        _against_false(a, rows, 'delay', 1e3, 'a  delay of the alarm', 'median, ms')
        _against_false(
            b, rows, 'slip_distance', 1e3, 'b  distance slipped before it', 'median, mm'
        )
        _against_false(c, rows, 'misses', 1e2, 'c  slips missed', '% of slips longer than 3 mm')
        c.axhline(1e2 * TARGETS['misses'], **_TARGET)
        c.set_yscale('symlog', linthresh=0.3, linscale=0.4)
        c.set_ylim(-0.05, 130.0)
        c.set_yticks(
            [0.0, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0],
            ['0', '0.3', '1', '3', '10', '30', '100'],
        )
        _costs(d, rows)
        text = 'No median where most slips are missed,\nor begin in an alarm: T/N, most margins.'
        a.text(
            0.98,
            0.8,
            text,
            transform=a.transAxes,
            in_layout=False,
            ha='right',
            va='top',
            fontsize=8,
        )
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
    the shortest slip before the alarm.
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
        math.inf if row.slip_distance is None else row.slip_distance,
    )


def _costs(panel: Axes, rows: Sequence[Row]) -> None:
    """Draw the time per update at the best threshold of each method, and write its results."""
    chosen = best(rows)
    across = panel.get_yaxis_transform()
    heads = {0.6: 'missed', 0.78: 'false a min.', 0.98: 'slipped, median'}
    for place, head in heads.items():
        panel.text(
            place,
            -0.75,
            head,
            transform=across,
            in_layout=False,
            ha='right',
            fontsize=8,
            color='#666666',
        )
    for place, row in enumerate(chosen):
        look = _LOOKS[row.name, row.variant]
        cost = math.nan if row.us_per_update is None else row.us_per_update
        panel.plot(cost, place, **{'ms': 7.0, **look, 'ls': ''})
        false = row.false_per_minute or 0.0
        texts = (
            f'{1e2 * (row.misses or 0.0):.1f} %',
            f'{false:.1f}' if false else 'none',
            '-' if row.slip_distance is None else f'{1e3 * row.slip_distance:.1f} mm',
        )
        for at, text in zip(heads, texts, strict=True):
            panel.text(
                at,
                place,
                text,
                transform=across,
                in_layout=False,
                ha='right',
                va='center',
                fontsize=8.5,
            )
    panel.axvline(TARGETS['us_per_update'], ymax=0.92, **_TARGET)
    panel.set(
        xscale='log',
        title='d  cost, and the best with at most 1 false alarm a minute',
        xlabel='time for an update of a foot, µs',
    )
    names = [f'{row.name}, {row.variant}' if row.variant else row.name for row in chosen]
    panel.set_yticks(range(len(names)), names)
    panel.tick_params(axis='y', length=0)
    # The right half is for the text.
    panel.set_xlim(0.08, 1e4)
    panel.set_xticks([0.1, 1.0, 10.0], ['0.1', '1', '10'])
    panel.minorticks_off()
    panel.set_ylim(len(names) - 0.5, -1.2)
    panel.grid(axis='y', color=PALE, alpha=0.25, lw=0.5)


# --- robustness ----------------------------------------------------------------------------------

# Changes: unit and scale of the axis, and whether it is logarithmic.
_CHANGES: dict[str, tuple[str, float, bool]] = {
    'force bias': ('N', 1.0, False),
    'position noise': ('mm', 1e3, True),
    'configured noise': ('times the true noise', 1.0, True),
    'correlated noise': ('correlation time, ms', 1e3, False),
    'position steps': ('mm', 1e3, False),
    'force turned': ('°', 1.0, False),
    'sample rate': ('Hz', 1.0, True),
    'shear stiffness': ('configured / true', 1.0, True),
    'patch length': ('m', 1.0, True),
    'wet friction': ('dry: 0.8', 1.0, False),
    'impacts': ('peak, loads', 1.0, False),
    'messages dropped': ('% of samples', 1e2, False),
    'position late': ('ms', 1e3, False),
    'clock jumps': ('s', 1.0, False),
    'mass': ('times', 1.0, True),
}
# Measures: label, scale, targets, and the change from which on a measure moves.
_MEASURES: dict[str, tuple[str, float, tuple[float, ...], float]] = {
    'misses': ('slips missed, %', 1e2, (1.0,), 1.0),
    'false_per_minute': ('false alarms a minute', 1.0, (1.0,), 1.0),
    'slip_distance': ('slip before alarm, mm', 1e3, (), 0.5),
    'wet_right': ('wet or dry right, %', 1e2, (97.0,), 2.0),
    'coverage': ('friction within 2σ, %', 1e2, (90.0, 99.0), 3.0),
    'below': ('margin below 5 %, %', 1e2, (5.0,), 2.0),
    'axes': ('axes in doubt, % of time', 1e2, (), 1.0),
}
_VARIANTS: dict[str, dict[str, Any]] = {
    '': {'color': GREEN, 'marker': 'o', 'ls': '-'},
    'configured': {'color': GREEN, 'marker': 'o', 'ls': '-'},
    'L2': {'color': GREEN, 'marker': 'o', 'ls': '-'},
    'not configured': {'color': VERMILION, 'marker': 's', 'ls': '--'},
    'L1': {'color': BLUE, 'marker': 'D', 'ls': ':'},
}
_ACROSS = 4  # panels


def _points(rows: Sequence[Row], change: str, measure: str, variant: str) -> list[list[float]]:
    """Return value of the change and measure, as drawn."""
    across, scale = _CHANGES[change][1], _MEASURES[measure][1]
    return [
        [across * row.value, scale * getattr(row, measure)]
        for row in rows
        if (row.name, row.variant) == (change, variant) and getattr(row, measure) is not None
    ]


def _variants(rows: Sequence[Row], change: str) -> list[str]:
    return list(dict.fromkeys(row.variant for row in rows if row.name == change))


def _moves(rows: Sequence[Row], change: str, measure: str) -> bool:
    """Return whether a measure moves with a change, in any variant."""
    spans = [_span(rows, change, measure, variant) for variant in _variants(rows, change)]
    return any(high - low > _MEASURES[measure][3] for low, high in spans if high >= low)


def _span(rows: Sequence[Row], change: str, measure: str, variant: str) -> tuple[float, float]:
    """Return the least and the largest value of a measure; the larger one first if none."""
    values = [value for _, value in _points(rows, change, measure, variant)]
    return min(values, default=math.inf), max(values, default=-math.inf)


def _changes(rows: Sequence[Row]) -> list[str]:
    return [name for name in _CHANGES if any(row.name == name for row in rows)]


def unmoved(rows: Sequence[Row]) -> str:
    """Return a table of what is not drawn, because it does not move: for the docs."""
    rows = [row for row in rows if row.part == 'robustness']
    lines = ['| changed | from, to | does not move |', '|---|---|---|']
    for change in _changes(rows):
        unit, across, _ = _CHANGES[change]
        values = [across * row.value for row in rows if row.name == change]
        parts = []
        for measure, (label, *_) in _MEASURES.items():
            spans = [_span(rows, change, measure, each) for each in _variants(rows, change)]
            spans = [span for span in spans if span[1] >= span[0]]
            if not spans or _moves(rows, change, measure):
                continue
            low, high = min(span[0] for span in spans), max(span[1] for span in spans)
            ends = f'{low:.3g}' if f'{low:.3g}' == f'{high:.3g}' else f'{low:.3g} to {high:.3g}'
            parts.append(f'{label}: {ends}')
        if parts:
            ends = f'{min(values):g} to {max(values):g}, {unit}'
            lines.append(f'| {change} | {ends} | {"; ".join(parts)} |')
    return '\n'.join(lines)


def walks(rows: Sequence[Row]) -> str:
    """Return a table of noise, right and wrong, with intervals over walks: for the docs."""
    rows = [row for row in rows if row.part == 'walks']
    robots = [name for name in dict.fromkeys(row.name for row in rows) if name != 'sticks']
    heads = [
        f'{name}: slips missed, % | those that displaced the foot, % | μ within 2σ, %'
        for name in robots
    ]
    lines = [
        f'| noise | floors | {" | ".join(heads)} | false alarms a minute |',
        '|---' * (3 * len(robots) + 3) + '|',
    ]
    for note, part in dict.fromkeys((row.note, row.variant) for row in rows):
        mine = {row.name: row for row in rows if (row.note, row.variant) == (note, part)}
        cells = []
        for name in robots:
            row = mine[name]
            cells.append(f'{_with_ends(row, "misses", 1e2)} of {row.slips}')
            cells.append(f'{_with_ends(row, "displaced_misses", 1e2)} of {row.displaced}')
            cells.append(_with_ends(row, 'coverage', 1e2))
        if 'sticks' in mine:
            row = mine['sticks']
            alarms = f'{_with_ends(row, "false_per_minute", 1.0)} in {row.stick_minutes:.1f} min'
            cells.append(alarms)
        lines.append(f'| {note} | {part} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _with_ends(row: Row, name: str, scale: float) -> str:
    value = getattr(row, name)
    if value is None:
        return '-'
    ends = [f'{scale * end:.3g}' for end in row.intervals.get(name, ())]
    return f'{scale * value:.3g}' + (f' ({" to ".join(ends)})' if ends else '')


def draw_robustness(rows: Sequence[Row]) -> Figure:
    """Return the picture of the estimator: a panel for each measure that a change moves."""
    rows = [row for row in rows if row.part == 'robustness']
    cells = [
        (change, measure)
        for change in _changes(rows)
        for measure in _MEASURES
        if _moves(rows, change, measure)
    ]
    height = max(1, math.ceil(len(cells) / _ACROSS))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 2.2 * height + 0.7))
        figure.set_layout_engine('constrained', w_pad=0.06, h_pad=0.06)
        panels = figure.subplots(height, _ACROSS, squeeze=False).ravel()
        for panel in panels[len(cells) :]:
            panel.set_axis_off()
        for panel, (change, measure) in zip(panels, cells, strict=False):
            _cell(panel, rows, change, measure)
        handles = [
            Line2D([], [], ms=4.0, lw=1.2, **_VARIANTS[name], label=label)
            for name, label in (
                ('configured', 'estimator configured with it'),
                ('not configured', 'estimator not configured with it'),
                ('L1', 'walks in the plane'),
            )
        ]
        handles += [
            Line2D([], [], **_TARGET, label='target; of the margin, nominal'),
            Line2D([], [], color=PALE, lw=5.0, alpha=0.35, label='ordinary value'),
        ]
        figure.legend(handles=handles, loc='outside lower center', ncol=5)
    return figure


def _cell(panel: Axes, rows: Sequence[Row], change: str, measure: str) -> None:
    unit, across, logarithmic = _CHANGES[change]
    label, _, targets, _ = _MEASURES[measure]
    mine = [row for row in rows if row.name == change]
    for row in mine:
        if row.shipped:
            panel.axvline(across * row.value, color=PALE, lw=5.0, alpha=0.2, zorder=0)
    for target in targets:
        panel.axhline(target, **_TARGET)
    for variant in _variants(rows, change):
        points = _points(rows, change, measure, variant)
        if points:
            x, y = zip(*points, strict=True)
            panel.plot(x, y, ms=4.0, lw=1.2, zorder=3, clip_on=False, **_VARIANTS[variant])
    if logarithmic:
        panel.set_xscale('log')
    values = sorted({across * row.value for row in mine})
    panel.minorticks_off()
    panel.set_xticks(values, [f'{value:g}' for value in values], fontsize=7.5)
    if measure == 'false_per_minute':
        panel.set_yscale('symlog', linthresh=1.0)
        panel.set_yticks([0.0, 1.0, 10.0, 100.0], ['0', '1', '10', '100'])
        panel.minorticks_off()
        panel.set_ylim(bottom=0.0)
    elif measure in {'misses', 'slip_distance', 'below', 'axes'}:
        panel.set_ylim(bottom=0.0)
    panel.set(title=change, xlabel=unit)
    panel.set_ylabel(label, fontsize=8.0)
    panel.grid(color=PALE, alpha=0.25, lw=0.5)
