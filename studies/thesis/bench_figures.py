# SPDX-License-Identifier: Apache-2.0
"""Draw figures 14 to 18, 20, 21, 10 and 34 of the thesis by the model, with measured points.

The meaning of solid and dashed lines differs between figures, as in the thesis; captions explain
it.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ros_pad.contact.pad import Array
from ros_pad.reports.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    PALE,
    PAPER_STYLE,
    STANCE,
    VERMILION,
    WIDE,
    Drawn,
    legend,
)
from studies.drawing import ORANGE, PURPLE
from studies.thesis.bench import CODED, TEXT, BenchTrial, Row
from studies.thesis.explained import drawn
from studies.thesis.foot_bench import DOME, FLAT, LINES, NONE, ROUGH, SMOOTH, SUCTION
from studies.thesis.tangential import CAPILLARY, DRY, RISE, WET, shape_name

_COLOURS = (PURPLE, BLUE, GREEN, VERMILION, ORANGE, BLACK)
_DASHED, _DOTTED = (0, (4, 2)), (0, (1, 1.2))


def draw(trial: BenchTrial) -> dict[int, Drawn]:
    """Draw all figures of a bench; return them by number.

    Save them under ``matplotlib.rc_context(PAPER_STYLE)``, which sets fonts and identifiers.
    """
    makers = _FIGURES[trial.scene.kind]
    with matplotlib.rc_context(PAPER_STYLE):
        return {number: make(trial) for number, make in makers.items()}


def _key(label: str, **look: Any) -> Any:
    """Return an entry of a legend: a line, or with a marker alone a point."""
    return Line2D([], [], label=label, **({'ls': ''} if 'marker' in look else {}) | look)


# --- inflation -----------------------------------------------------------------------------------


def figure_14(trial: BenchTrial) -> Drawn:
    """Draw the profiles of free domes by the model, and as measured."""
    radius = trial.scene.pad.radius
    figure = Figure(figsize=(COLUMN, 2.95), layout='constrained')
    ax = figure.subplots()
    ax.plot(1e3 * np.array([-radius, radius]), [0.0, 0.0], color=PALE, lw=2.0)
    rows = trial.pick('height')
    handles: list[Any] = []
    for row, colour in zip(rows, itertools.cycle(_COLOURS)):
        ax.plot(*_cap(radius, row.modelled), color=colour)
        ax.plot(*_cap(radius, row.measured or 0.0), color=colour, ls=_DASHED, lw=1.3)
        handles.insert(0, _key(_kilopascals(row), color=colour))
    handles += [
        _key('0 kPa', color=PALE, lw=2.0),
        _key('model', color=BLACK),
        _key('measured', color=BLACK, ls=_DASHED, lw=1.3),
    ]
    ax.set_aspect('equal')
    ax.set(xlabel='x / mm', ylabel='z / mm', ylim=(-0.05, None))
    legend(figure, handles, columns=3)
    return drawn(14, figure, domes=_listed(rows, lambda row: (
        f'measured {1e3 * (row.measured or 0.0):.2f} mm, model {1e3 * row.modelled:.2f} mm'
    )))  # fmt: skip


def figure_15(trial: BenchTrial) -> Drawn:
    """Draw height and radius of free domes over pressure with their errors, and the stiffness."""
    setup = trial.scene.setup
    figure = Figure(figsize=(WIDE, 2.9), layout='constrained')
    axes = figure.subplots(1, 3)
    heights, stiffness = trial.pick('height'), trial.pick('stiffness')
    low = 0.75 * min(_column(heights, 'pressure', 1e-3))  # kPa; at 0 the sphere radius is infinite
    for ax, letter, quantity in zip(axes, 'ab', ('height', 'sphere radius'), strict=False):
        curve, rows = trial.curves[quantity], trial.pick(quantity)
        shown = curve.x >= 1e3 * low
        ax.plot(1e-3 * curve.x[shown], 1e3 * curve.y[shown], color=BLUE)
        _points(
            ax,
            rows,
            _column(rows, 'pressure', 1e-3),
            _column(rows, 'measured', 1e3),
            [_percent(row) for row in rows],
        )
        ax.set(title=f'({letter}) {quantity}', ylabel=f'{quantity} / mm')
        ax.set_xlim(low, 1e-3 * setup.highest_pressure)
    axes[2].axhline(stiffness[0].modelled, color=BLUE)
    values = _column(stiffness, 'measured')
    _points(
        axes[2],
        stiffness,
        _column(stiffness, 'pressure', 1e-3),
        values,
        [f'{k:.2f}' for k in values],
    )
    axes[2].set(title='(c) stiffness of each height', ylabel='k / (N/m)')
    for ax in axes:
        ax.set_xlabel('gauge pressure / kPa')
        ax.margins(y=0.25)
    model = _key(f'model, k = {stiffness[0].modelled:g} N/m', color=BLUE)
    legend(figure, [model, _key('measured', color=VERMILION, marker='o')])
    return drawn(15, figure, errors=_listed(heights, _percent))


def _points(ax: Axes, rows: Sequence[Row], x: Array, y: Array, texts: Sequence[str]) -> None:
    """Draw measured points with texts beside them."""
    ax.plot(x, y, 'o', color=VERMILION)
    for text, place, value in zip(texts, x, y, strict=True):
        ax.annotate(text, (place, value), (0, 6), textcoords='offset points', ha='center',
                    fontsize=8.0)  # fmt: skip


# --- press ---------------------------------------------------------------------------------------


def figure_16(trial: BenchTrial) -> Drawn:
    """Draw the profiles of pressed domes with the forces of program and text of the thesis."""
    radius = trial.scene.pad.radius
    readings = [name for name in (CODED, TEXT) if trial.pick('gap', 'thesis', name)]
    figure = Figure(figsize=(WIDE if len(readings) > 1 else COLUMN, 2.75), layout='constrained')
    axes = figure.subplots(1, len(readings), sharey=True, squeeze=False)[0]
    free = trial.pick('free height')
    tops = [row.measured or 0.0 for row in (*free, *trial.pick('gap', 'thesis'))]
    for ax, letter, reading in zip(axes, 'ab', readings, strict=False):
        ax.plot(1e3 * np.array([-radius, radius]), [0.0, 0.0], color=PALE, lw=2.0)
        for row in free:
            ax.plot(*_cap(radius, row.modelled), color=BLACK, label='free')
            ax.plot(*_cap(radius, row.measured or 0.0), color=BLACK, ls=_DASHED, lw=1.3)
        parts = [
            trial.pick(quantity, model, reading)
            for model in ('thesis', 'membrane')
            for quantity in ('height', 'contact radius', 'gap')
        ]
        for height, contact, gap, _, wide, lower, colour in zip(
            *parts, _COLOURS[1:], strict=False
        ):
            model = (row.modelled for row in (height, contact, gap))
            measured: Any = (row.measured for row in (height, contact, gap))
            ax.plot(*_cap(radius, *model), color=colour, label=f'{gap.force:g} N')
            ax.plot(*_cap(radius, *measured), color=colour, ls=_DASHED, lw=1.3)
            edge = 1e3 * wide.modelled * np.array([-1.0, 1.0])
            ax.plot(edge, 2 * [1e3 * lower.modelled], color=colour, ls=':', lw=1.6)
        ax.set_aspect('equal')
        ax.set(xlabel='x / mm', title=f'({letter}) {reading}')
        ax.legend(loc='upper left', bbox_to_anchor=(-0.02, 1.0), handlelength=1.2)
        # Room for the legend on the left; a dome bulges out over the rim by less than a tenth.
        ax.set(xlim=(-1.63e3 * radius, 1.17e3 * radius), ylim=(-0.05, 1.2e3 * max(tops)))
    axes[0].set_ylabel('z / mm')
    handles = [
        _key('thesis model', color=BLACK),
        _key('measured', color=BLACK, ls=_DASHED, lw=1.3),
        _key('contact of the exact membrane', color=BLACK, ls=':'),
    ]
    legend(figure, handles)
    gaps = trial.pick('gap', 'thesis', CODED)
    errors = _listed(gaps, _percent, 'force')
    return drawn(16, figure, errors=errors, pressure=_kilopascals(gaps[0]))


def over_force(number: int, quantities: Sequence[str], trial: BenchTrial) -> Drawn:
    """Draw some quantities of pressed domes over force."""
    figure = Figure(figsize=(WIDE, 3.1), layout='constrained')
    axes = figure.subplots(1, len(quantities), sharex=True)
    exact: dict[str, Any] = {'color': GREEN, 'ls': (0, (5, 1.5))}
    for ax, letter, quantity in zip(axes, 'abc', quantities, strict=False):
        for model, look in (('thesis', {'color': BLUE}), ('membrane', exact)):
            curve = trial.curves[f'{quantity}, {model}']
            ax.plot(curve.x, 1e3 * curve.y, **look)
        coded = trial.pick(quantity, 'thesis', CODED)
        text = trial.pick(quantity, 'thesis', TEXT)
        y = _column(coded, 'measured', 1e3)
        if text:
            ax.hlines(y, _column(coded, 'force'), _column(text, 'force'), color=VERMILION, lw=0.9)
            ax.plot(_column(text, 'force'), y, 'o', color=VERMILION, mfc='white')
        _points(ax, coded, _column(coded, 'force'), y, [_percent(row) for row in coded])
        ax.set(title=f'({letter}) {quantity}', xlabel='normal force / N')
        ax.set_ylabel(f'{quantity} / mm')
        ax.margins(y=0.12)
        ax.set(xlim=(0.0, None), ylim=(0.5 if quantity == 'sphere radius' else 0.0, None))
    handles = [
        _key('thesis model', color=BLUE),
        _key('exact membrane', **exact),
        _key('measured, coded force', color=VERMILION, marker='o'),
        _key("measured, the text's force", color=VERMILION, marker='o', mfc='white'),
    ]
    legend(figure, handles[: 4 if trial.pick(quantities[0], 'thesis', TEXT) else 3])
    rows = trial.pick(quantities[0], 'thesis', CODED)
    return drawn(number, figure, errors=_listed(rows, _percent, 'force'))


# --- tangential ----------------------------------------------------------------------------------


def figure_20(trial: BenchTrial) -> Drawn:
    """Draw tangential over normal force of the flat pad and of domes, on dry and wet ground."""
    figure = Figure(figsize=(WIDE, 3.4), layout='constrained')
    force, ratio = figure.subplots(1, 2)
    pressures = sorted({row.pressure or 0.0 for row in trial.pick('tangential force')})
    shapes = dict(zip(pressures, (BLACK, *_COLOURS[1:]), strict=False))
    for (pressure, colour), (ground, style) in itertools.product(
        shapes.items(), ((DRY, _DASHED), (WET, '-'))
    ):
        curve = trial.curves[f'{shape_name(pressure)}, {ground}']
        force.plot(curve.x, curve.y, color=colour, ls=style)
        if pressure:
            ratio.plot(curve.x[1:], curve.y[1:] / curve.x[1:], color=colour, ls=style)
            force.plot(curve.x[-1], curve.y[-1], 'o', color=colour, ms=4.5)
            ratio.plot(curve.x[-1], curve.y[-1] / curve.x[-1], 'o', color=colour, ms=4.5)
    force.set(title='(a) tangential force at the onset of slip', ylabel='tangential force / N')
    ratio.set(title='(b) domes, over the normal force, enlarged')
    ratio.set_ylabel('tangential / normal force')
    ratio.margins(y=0.15)
    for ax in (force, ratio):
        ax.set(xlim=(0.0, None), xlabel='normal force / N')
    force.set_ylim(0.0, None)
    handles = [_key(shape_name(pressure), color=colour) for pressure, colour in shapes.items()]
    handles += [_key('dry', color=BLACK, ls=_DASHED), _key('wet', color=BLACK)]
    legend(figure, [*handles, _key('measured limit', color=BLACK, marker='o', ms=4.5)])
    return drawn(20, figure)


def figure_21(trial: BenchTrial) -> Drawn:
    """Draw the capillary force over pressure by each version of equation 3.82."""
    figure = Figure(figsize=(COLUMN, 3.1), layout='constrained')
    ax = figure.subplots()
    rows = trial.pick('capillary force')
    pressures = sorted({row.pressure for row in rows if row.pressure is not None})
    looks = zip(CAPILLARY, (BLACK, PURPLE, BLUE, GREEN), 'osD^', (-0.9, -0.3, 0.3, 0.9),
                strict=True)  # fmt: skip
    for name, colour, marker, aside in looks:
        own = [
            [1e3 * row.modelled for row in rows if (row.model, row.pressure) == (name, pressure)]
            for pressure in pressures
        ]
        x = 1e-3 * np.array(pressures) + aside
        ax.vlines(x, [each[0] for each in own], [each[-1] for each in own], color=colour, lw=1.2)
        ax.plot(x, [each[-1] for each in own], '_', color=colour, ms=8.0, mew=1.4)
        ax.plot(x, [each[0] for each in own], marker, color=colour, label=name)
    ax.set(yscale='log', xticks=1e-3 * np.array(pressures))
    ax.yaxis.set_major_formatter('{x:g}')
    ax.set(xlabel='gauge pressure / kPa', ylabel='capillary force / mN')
    legend(figure, ax.get_legend_handles_labels()[0], columns=2)
    return drawn(21, figure, load=min(_column(rows, 'force')))


def figure_10(trial: BenchTrial) -> Drawn:
    """Draw the height of rise between domes over the pad radius by each version of 3.101."""
    setup = trial.scene.setup
    figure = Figure(figsize=(COLUMN, 3.1), layout='constrained')
    ax = figure.subplots()
    ax.axvspan(1e3 * setup.claimed_smallest, 1e3 * setup.claimed_largest, color=STANCE, lw=0.0)
    handles: list[Any] = []
    best_rows = trial.pick('radius of greatest rise')
    looks = zip(RISE, (VERMILION, PURPLE, BLUE), (_DASHED, _DOTTED, '-'), strict=True)
    for name, colour, style in looks:
        curve = trial.curves[f'rise, {name}']
        shown = np.where(curve.y > 1e-5, curve.y, np.nan)  # the curve is close to zero there
        ax.plot(1e3 * curve.x, 1e3 * shown, color=colour, ls=style)
        best = next(row.modelled for row in best_rows if row.model == name)
        top = trial.pick('greatest rise', name)[0].modelled
        ax.plot(1e3 * best, 1e3 * top, 'o', color=colour, ms=5.0)
        handles.append(_key(f'{name}: {1e3 * best:.2f} mm', color=colour, ls=style))
    handles.append(Patch(facecolor=STANCE, label='claimed optimum'))
    ax.set(xscale='log', xlabel='pad radius / mm', ylabel='height of rise / mm')
    ax.set_xticks([0.2, 0.5, 1.0, 2.0, 5.0], ['0.2', '0.5', '1', '2', '5'])
    ax.minorticks_off()
    ax.set_xlim(1e3 * setup.smallest_radius, 1e3 * setup.largest_radius)
    ax.set_ylim(0.0, None)
    legend(figure, handles, columns=2)
    tops = ', '.join(f'{1e3 * row.modelled:.2f} mm ({row.model})' for row in best_rows)
    return drawn(10, figure, tops=tops)


# --- foot ----------------------------------------------------------------------------------------


def figure_34(trial: BenchTrial) -> Drawn:
    """Draw tangential over normal force of a foot on four floors, and wet less dry force."""
    figure = Figure(figsize=(WIDE, 3.3), layout='constrained')
    *forces, less = figure.subplots(1, 3)
    shapes, floors = {FLAT: BLACK, DOME: VERMILION}, {SMOOTH: BLUE, ROUGH: GREEN}
    kinds: dict[str, Any] = {NONE: '-', LINES: _DASHED, SUCTION: _DOTTED}
    for ax, floor in zip(forces, floors, strict=True):
        for shape, ground in itertools.product(shapes, (DRY, WET)):
            curve = trial.curves[f'{shape}, {floor}, {ground}']
            style = _DASHED if ground == DRY else '-'
            ax.plot(curve.x, curve.y, color=shapes[shape], ls=style)
        ax.set(title=f'(a) {floor}', ylabel='tangential force / N')
    highest = max(ax.get_ylim()[1] for ax in forces)
    for (floor, colour), (kind, style) in itertools.product(floors.items(), kinds.items()):
        curve = trial.curves[f'{DOME}, {floor}, {kind}']
        less.plot(curve.x, 1e3 * curve.y, color=colour, ls=style)
    curve = trial.curves['3.82, corrected, water']
    one_sided: dict[str, Any] = {'color': PURPLE, 'ls': (0, (4, 1, 1, 1))}
    less.plot(curve.x, 1e3 * curve.y, **one_sided)
    less.axhline(0.0, color=PALE, lw=0.8)
    less.set(title='(b) domes, wet less dry', ylabel='F_wet − F_dry / mN')
    for ax in (*forces, less):
        ax.set(xlim=(0.0, None), xlabel='normal force / N')
    for ax in forces:
        ax.set_ylim(0.0, highest)
    handles = [_key(f'(a) {shape}, wet', color=colour) for shape, colour in shapes.items()]
    handles.append(_key('(a) the same, dry', color=BLACK, ls=_DASHED))
    handles += [_key(f'(b) {floor}', color=colour) for floor, colour in floors.items()]
    handles += [_key(f'(b) {kind}', color=BLACK, ls=style) for kind, style in kinds.items()]
    legend(figure, [*handles, _key('(b) one-sided force', **one_sided)], columns=3)
    return drawn(34, figure)


_FIGURES: dict[str, dict[int, Callable[[BenchTrial], Drawn]]] = {
    'inflation': {14: figure_14, 15: figure_15},
    'press': {
        16: figure_16,
        17: functools.partial(over_force, 17, ('height', 'sphere radius')),
        18: functools.partial(over_force, 18, ('contact radius', 'depth', 'gap')),
    },
    'tangential': {20: figure_20, 21: figure_21, 10: figure_10},
    'foot': {34: figure_34},
}


# --- shapes and numbers --------------------------------------------------------------------------


def _cap(
    radius: float, height: float, contact: float = 0.0, gap: float | None = None
) -> tuple[Array, Array]:
    """Return x and z, mm, of a spherical cap on the rim, cut off at a gap, m, above the rim."""
    sphere = (radius**2 + height**2) / (2.0 * height)
    # Angles from the apex to the rim (above 90 degrees if the dome bulges) and to the floor. The
    # edge of the measured contact is slightly off the measured sphere, so it is added below.
    rim = np.arctan2(radius, sphere - height)
    edge = 0.0 if gap is None else np.arccos(1.0 - (height - gap) / sphere)
    wall = np.linspace(rim, edge, 200)
    x, z = sphere * np.sin(wall), height - sphere + sphere * np.cos(wall)
    if gap is not None:
        x, z = np.append(x, contact), np.append(z, gap)
    return 1e3 * np.concatenate([-x, x[::-1]]), 1e3 * np.concatenate([z, z[::-1]])


def _column(rows: Sequence[Row], name: str, factor: float = 1.0) -> Array:
    """Return pressure, force or measured value of the rows that have one, times a factor."""
    values = [getattr(row, name) for row in rows]
    return np.array([factor * value for value in values if value is not None])


def _percent(row: Row) -> str:
    return f'{100.0 * (row.error or 0.0):+z.1f} %'.replace('-', '−')


def _kilopascals(row: Row) -> str:
    return f'{1e-3 * (row.pressure or 0.0):g} kPa'


def _listed(rows: Sequence[Row], words: Callable[[Row], str], by: str = 'pressure') -> str:
    """Return the rows as text, each with the pressure or force it belongs to."""
    at = {'pressure': _kilopascals, 'force': lambda row: f'{row.force:g} N'}[by]
    return ', '.join(f'{words(row)} at {at(row)}' for row in rows)
