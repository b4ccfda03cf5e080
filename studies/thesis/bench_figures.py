# SPDX-License-Identifier: Apache-2.0
"""Draw figures 14 to 18, 20, 21, 10 and 34 of the thesis by the model, with measured points.

The meaning of solid and dashed lines differs between figures, as in the thesis; captions explain
it.
"""

from __future__ import annotations

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
from studies.thesis.bench import (
    CAPILLARY,
    CODED,
    DRY,
    RISE,
    TEXT,
    WET,
    BenchTrial,
    Row,
    shape_name,
)
from studies.thesis.bench_scene import InflationBench, TangentialBench
from studies.thesis.explained import drawn
from studies.thesis.foot_bench import DOME, FLAT, LINES, NONE, ROUGH, SMOOTH, SUCTION

PURPLE, ORANGE = '#CC79A7', '#E69F00'
_COLOURS = (PURPLE, BLUE, GREEN, VERMILION, ORANGE, BLACK)


def draw(trial: BenchTrial) -> dict[int, Drawn]:
    """Draw all figures of a bench; return them by number.

    Save them under ``matplotlib.rc_context(PAPER_STYLE)``, which sets fonts and identifiers.
    """
    with matplotlib.rc_context(PAPER_STYLE):
        return {
            number: figure(trial) for number, figure in _FIGURES[trial.scene.setup.kind].items()
        }


# --- inflation -----------------------------------------------------------------------------------


def figure_14(trial: BenchTrial) -> Drawn:
    """Draw the profiles of free domes by the model, and as measured."""
    radius = trial.scene.pad.radius
    figure = Figure(figsize=(COLUMN, 2.95), layout='constrained')
    ax = figure.subplots()
    ax.plot(1e3 * np.array([-radius, radius]), [0.0, 0.0], color=PALE, lw=2.0)
    handles: list[Any] = []
    rows = trial.pick('height')
    for row, colour in zip(rows, _colours(rows), strict=True):
        ax.plot(*_cap(radius, row.modelled), color=colour)
        ax.plot(*_cap(radius, row.measured or 0.0), color=colour, ls=(0, (4, 2)), lw=1.3)
        handles.append(Line2D([], [], color=colour, label=_kilopascals(row)))
    handles.reverse()  # in the order of the domes
    handles += [
        Line2D([], [], color=PALE, lw=2.0, label='0 kPa'),
        Line2D([], [], color=BLACK, label='model'),
        Line2D([], [], color=BLACK, ls=(0, (4, 2)), lw=1.3, label='measured'),
    ]
    ax.set_aspect('equal')
    ax.set_xlabel('x / mm')
    ax.set_ylabel('z / mm')
    ax.set_ylim(-0.05, None)
    legend(figure, handles, columns=3)
    return drawn(
        14,
        figure,
        alt='Profiles of free domes: '
        + _listed(rows, 'measured {measured:.2f} mm, model {modelled:.2f} mm'),
    )


def figure_15(trial: BenchTrial) -> Drawn:
    """Draw height and radius of free domes over pressure, their errors, and the stiffness."""
    setup = trial.scene.setup
    assert isinstance(setup, InflationBench)
    figure = Figure(figsize=(WIDE, 4.6), layout='constrained')
    axes = figure.subplots(2, 2, sharex=True)
    heights = trial.pick('height')
    low = 0.75 * min(_pressures(heights))  # kPa; at 0 the sphere radius is infinite
    for ax, letter, quantity in zip(axes[0], 'ab', ('height', 'sphere radius'), strict=True):
        rows = trial.pick(quantity)
        curve = trial.curves[quantity]
        shown = curve.x >= 1e3 * low
        ax.plot(1e-3 * curve.x[shown], 1e3 * curve.y[shown], color=BLUE)
        ax.plot(_pressures(rows), 1e3 * _found(rows), 'o', color=VERMILION)
        _label_errors(ax, rows, _pressures(rows), 1e3 * _found(rows), below=quantity == 'height')
        ax.set_title(f'({letter}) {quantity}')
        ax.set_ylabel(f'{quantity} / mm')
        ax.margins(y=0.15)
    axes[0, 0].set_xlim(low, 1e-3 * setup.highest_pressure)
    _errors_of_15(axes[1, 0], trial, setup.claimed_error, low)
    model = _stiffness_of_15(axes[1, 1], trial.pick('stiffness'))
    for ax in axes[1]:
        ax.set_xlabel('gauge pressure / kPa')
    for column in axes.T:
        figure.align_ylabels(column)
    legend(
        figure,
        [
            Line2D([], [], color=BLUE, label=f'model, k = {model:g} N/m'),
            Line2D([], [], color=VERMILION, marker='o', ls='', label='measured'),
        ],
    )
    return drawn(
        15,
        figure,
        alt='Errors of the height: ' + _listed(heights, '{percent:+.1f} %'),
    )


def _errors_of_15(ax: Axes, trial: BenchTrial, claimed_error: float, low: float) -> None:
    claimed = 100.0 * claimed_error
    ax.axhspan(-claimed, claimed, color=STANCE, lw=0.0)
    ax.axhline(0.0, color=PALE, lw=0.8)
    ax.text(low + 0.5, claimed, f'claimed: ±{claimed:g} %', va='bottom', fontsize=8.0)
    ax.margins(y=0.15)
    for rows, marker, face, label in (
        (trial.pick('height'), 'o', VERMILION, 'height'),
        (trial.pick('sphere radius'), 's', 'white', 'sphere radius'),
    ):
        ax.plot(
            _pressures(rows), 100.0 * _errors(rows), marker, color=VERMILION, mfc=face, label=label
        )
    ax.legend(loc='upper right')
    ax.set_title('(c) error of the model')
    ax.set_ylabel('model over measured − 1 / %')


def _stiffness_of_15(ax: Axes, rows: Sequence[Row]) -> float:
    """Draw the stiffness of each point; return that of the model, N/m."""
    ax.axhline(rows[0].modelled, color=BLUE)
    ax.plot(_pressures(rows), _found(rows), 'o', color=VERMILION)
    for x, y in zip(_pressures(rows), _found(rows), strict=True):
        over = y > rows[0].modelled
        ax.annotate(
            f'{y:.2f}', (x, y), (0, 7 if over else -7), textcoords='offset points', ha='center',
            va='bottom' if over else 'top', fontsize=8.0,
        )  # fmt: skip
    ax.margins(y=0.3)
    ax.set_title('(d) stiffness that gives the measured height')
    ax.set_ylabel('k / (N/m)')
    return rows[0].modelled


# --- press ---------------------------------------------------------------------------------------


def figure_16(trial: BenchTrial) -> Drawn:
    """Draw the profiles of pressed domes with the forces of program and text of the thesis."""
    radius = trial.scene.pad.radius
    readings = [name for name in (CODED, TEXT) if trial.pick('gap', 'thesis', name)]
    figure = Figure(figsize=(WIDE if len(readings) > 1 else COLUMN, 2.75), layout='constrained')
    axes = figure.subplots(1, len(readings), sharey=True, squeeze=False)[0]
    free = trial.pick('free height')
    highest = max(
        max(row.modelled, row.measured or 0.0) for row in [*free, *trial.pick('gap', 'thesis')]
    )
    for ax, letter, reading in zip(axes, 'ab', readings, strict=False):
        ax.plot(1e3 * np.array([-radius, radius]), [0.0, 0.0], color=PALE, lw=2.0)
        for row in free:
            ax.plot(*_cap(radius, row.modelled), color=BLACK, label='free')
            ax.plot(*_cap(radius, row.measured or 0.0), color=BLACK, ls=(0, (4, 2)), lw=1.3)
        rows = {
            quantity: trial.pick(quantity, 'thesis', reading)
            for quantity in ('height', 'contact radius', 'gap')
        }
        exact = trial.pick('gap', 'membrane', reading)
        wide = trial.pick('contact radius', 'membrane', reading)
        for height, contact, gap, lower, edge, colour in zip(
            *rows.values(), exact, wide, _COLOURS[1:], strict=False
        ):
            ax.plot(
                *_cap(radius, height.modelled, contact.modelled, gap.modelled),
                color=colour,
                label=f'{gap.force:g} N',
            )
            ax.plot(
                *_cap(radius, height.measured, contact.measured, gap.measured),
                color=colour, ls=(0, (4, 2)), lw=1.3,
            )  # fmt: skip
            ax.plot(
                1e3 * edge.modelled * np.array([-1.0, 1.0]), 2 * [1e3 * lower.modelled],
                color=colour, ls=':', lw=1.6,
            )  # fmt: skip
        ax.set_aspect('equal')
        ax.set_xlabel('x / mm')
        ax.set_title(f'({letter}) {reading}')
        ax.legend(loc='upper left', bbox_to_anchor=(-0.02, 1.0), handlelength=1.2)
        # Room for the legend on the left; a dome bulges out over the rim by less than a tenth.
        ax.set_xlim(-1.63e3 * radius, 1.17e3 * radius)
        ax.set_ylim(-0.05, 1.13e3 * highest)
    axes[0].set_ylabel('z / mm')
    legend(
        figure,
        [
            Line2D([], [], color=BLACK, label='thesis model'),
            Line2D([], [], color=BLACK, ls=(0, (4, 2)), lw=1.3, label='measured'),
            Line2D([], [], color=BLACK, ls=':', label='contact of the exact membrane'),
        ],
    )
    return drawn(
        16,
        figure,
        alt='Profiles of pressed domes. Errors of the gap: '
        + _listed(trial.pick('gap', 'thesis', CODED), '{percent:+.1f} %', 'force'),
        title=f'Figure 16: domes of {_kilopascals(rows["gap"][0])}, pressed',
    )


def figure_17(trial: BenchTrial) -> Drawn:
    """Draw height and sphere radius of pressed domes over force."""
    figure = Figure(figsize=(WIDE, 3.1), layout='constrained')
    _over_force(trial, figure, ('height', 'sphere radius'))
    return drawn(
        17,
        figure,
        alt='Errors of the height: '
        + _listed(trial.pick('height', 'thesis', CODED), '{percent:+.1f} %', 'force'),
    )


def figure_18(trial: BenchTrial) -> Drawn:
    """Draw contact radius, depth and gap of pressed domes over force."""
    figure = Figure(figsize=(WIDE, 3.1), layout='constrained')
    _over_force(trial, figure, ('contact radius', 'depth', 'gap'))
    return drawn(
        18,
        figure,
        alt='Errors of the contact radius: '
        + _listed(trial.pick('contact radius', 'thesis', CODED), '{percent:+.1f} %', 'force'),
    )


_OVER_FORCE = (
    'Each measured point is drawn at the force of the program (filled) and at the force of the '
    'text (open). Numbers are errors of the thesis model at the force of the program.'
)  # fmt: skip


def _over_force(trial: BenchTrial, figure: Figure, quantities: Sequence[str]) -> None:
    axes = figure.subplots(1, len(quantities), sharex=True)
    for ax, letter, quantity in zip(axes, 'abc', quantities, strict=False):
        for model, colour, style in (('thesis', BLUE, '-'), ('membrane', GREEN, (0, (5, 1.5)))):
            curve = trial.curves[f'{quantity}, {model}']
            ax.plot(curve.x, 1e3 * curve.y, color=colour, ls=style)
        coded = trial.pick(quantity, 'thesis', CODED)
        text = trial.pick(quantity, 'thesis', TEXT)
        y = 1e3 * _found(coded)
        if text:
            for first, second, place in zip(_forces(coded), _forces(text), y, strict=True):
                ax.plot([first, second], [place, place], color=VERMILION, lw=0.9)
            ax.plot(_forces(text), y, 'o', color=VERMILION, mfc='white')
        ax.plot(_forces(coded), y, 'o', color=VERMILION)
        curve = trial.curves[f'{quantity}, thesis']
        falls = np.interp(_forces(coded), curve.x, np.gradient(curve.y, curve.x)) < 0.0
        for row, other, down in zip(coded, text or coded, falls, strict=True):
            # Place the text on the side of the point that is away from the curve.
            above = (row.error or 0.0) < 0.0
            right = above == down
            ax.annotate(
                _percent(row),
                (other.force if right else row.force, 1e3 * (row.measured or 0.0)),
                (5 if right else -5, 3 if above else -3),
                textcoords='offset points', ha='left' if right else 'right',
                va='bottom' if above else 'top', fontsize=8.0,
            )  # fmt: skip
        ax.set_title(f'({letter}) {quantity}')
        ax.set_xlabel('normal force / N')
        ax.set_ylabel(f'{quantity} / mm')
        ax.margins(y=0.12)
        ax.set_ylim(0.5 if quantity == 'sphere radius' else 0.0, None)
        ax.set_xlim(0.0, None)
    handles: list[Any] = [
        Line2D([], [], color=BLUE, label='thesis model'),
        Line2D([], [], color=GREEN, ls=(0, (5, 1.5)), label='exact membrane'),
        Line2D([], [], color=VERMILION, marker='o', ls='', label='measured, coded force'),
    ]
    if trial.pick(quantities[0], 'thesis', TEXT):
        handles.append(
            Line2D(
                [],
                [],
                color=VERMILION,
                marker='o',
                mfc='white',
                ls='',
                label="measured, the text's force",
            )
        )
    legend(figure, handles)


# --- tangential ----------------------------------------------------------------------------------


def figure_20(trial: BenchTrial) -> Drawn:
    """Draw tangential over normal force of the flat pad and of domes, on dry and wet ground."""
    figure = Figure(figsize=(WIDE, 3.4), layout='constrained')
    force, ratio = figure.subplots(1, 2)
    shapes = _shapes(trial)
    for pressure, colour in shapes.items():
        for ground, style in ((DRY, (0, (4, 2))), (WET, '-')):
            curve = trial.curves[f'{shape_name(pressure)}, {ground}']
            lw = 1.3 if ground == DRY else 1.6
            force.plot(curve.x, curve.y, color=colour, ls=style, lw=lw)
            if pressure:
                ratio.plot(curve.x[1:], curve.y[1:] / curve.x[1:], color=colour, ls=style, lw=lw)
                force.plot(curve.x[-1], curve.y[-1], 'o', color=colour, ms=4.5)
                ratio.plot(curve.x[-1], curve.y[-1] / curve.x[-1], 'o', color=colour, ms=4.5)
    for ax in (force, ratio):
        ax.set_xlim(0.0, None)
        ax.set_xlabel('normal force / N')
    force.set_ylim(0.0, None)
    for ground, words, aside in (
        (DRY, 'flat, dry', (-6, 2)), (WET, 'flat, wet', (-6, 4))
    ):  # fmt: skip
        curve = trial.curves[f'{shape_name(0.0)}, {ground}']
        force.annotate(
            words, (0.8 * curve.x[-1], 0.8 * curve.y[-1]), aside, textcoords='offset points',
            ha='right', va='bottom', fontsize=8.0,
        )  # fmt: skip
    highest = trial.curves[f'{shape_name(max(shapes))}, {DRY}']
    force.annotate(
        'domes, dry and wet', (0.62 * highest.x[-1], 0.62 * highest.y[-1]), (5, -3),
        textcoords='offset points', ha='left', va='top', fontsize=8.0,
    )  # fmt: skip
    force.set_title('(a) tangential force at the onset of slip')
    force.set_ylabel('tangential force / N')
    ratio.margins(y=0.15)
    ratio.set_title('(b) domes, over the normal force, enlarged')
    ratio.set_ylabel('tangential / normal force')
    legend(
        figure,
        [
            *(
                Line2D([], [], color=colour, label=shape_name(pressure))
                for pressure, colour in shapes.items()
            ),
            Line2D([], [], color=BLACK, ls=(0, (4, 2)), lw=1.3, label='dry'),
            Line2D([], [], color=BLACK, label='wet'),
            Line2D([], [], color=BLACK, marker='o', ms=4.5, ls='', label='measured limit'),
        ],
    )
    return drawn(
        20,
        figure,
    )


def figure_21(trial: BenchTrial) -> Drawn:
    """Draw the capillary force over pressure by each version of equation 3.82."""
    figure = Figure(figsize=(COLUMN, 3.1), layout='constrained')
    ax = figure.subplots()
    rows = trial.pick('capillary force')
    styles = zip(
        CAPILLARY, (BLACK, PURPLE, BLUE, GREEN), ('o', 's', 'D', '^'), (-0.9, -0.3, 0.3, 0.9),
        strict=True,
    )  # fmt: skip
    for name, colour, marker, aside in styles:
        mine = [row for row in rows if row.model == name]
        pressures = sorted({row.pressure for row in mine if row.pressure is not None})
        shared, ends = [], []
        for pressure in pressures:
            values = [row.modelled for row in mine if row.pressure == pressure]
            shared.append(1e3 * values[0])
            ends.append(1e3 * values[-1])
        x = 1e-3 * np.array(pressures) + aside
        ax.vlines(x, shared, ends, color=colour, lw=1.2)
        ax.plot(x, ends, '_', color=colour, ms=8.0, mew=1.4)
        ax.plot(x, shared, marker, color=colour, label=name)
    ax.set_yscale('log')
    ticks = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
    ax.set_yticks(ticks, [f'{tick:g}' for tick in ticks])
    ax.minorticks_off()
    values = [1e3 * row.modelled for row in rows]
    ax.set_ylim(0.6 * min(values), 1.6 * max(values))
    ax.set_xticks([1e-3 * pressure for pressure in pressures])
    ax.set_xlabel('gauge pressure / kPa')
    ax.set_ylabel('capillary force / mN')
    legend(figure, ax.get_legend_handles_labels()[0], columns=2)
    load = min(row.force for row in rows if row.force is not None)
    return drawn(
        21,
        figure,
        caption=f'Symbols: under {load:g} N, which all domes bear; strokes: under the measured '
        'limit of each. The thesis states errors of 10 to 26 % against measurements whose numbers '
        'it does not give; the versions of its estimate differ by far more. A ring that is the '
        'same all round has no net tangential force: only hysteresis, up to the bound, can '
        'resist.',
    )


def figure_10(trial: BenchTrial) -> Drawn:
    """Draw the height of rise between domes over the pad radius by each version of 3.101."""
    setup = trial.scene.setup
    assert isinstance(setup, TangentialBench)
    figure = Figure(figsize=(COLUMN, 3.1), layout='constrained')
    ax = figure.subplots()
    claimed = (1e3 * setup.claimed_smallest, 1e3 * setup.claimed_largest)
    ax.axvspan(*claimed, color=STANCE, lw=0.0)
    styles = zip(
        RISE, (VERMILION, PURPLE, BLUE), ((0, (4, 2)), (0, (1, 1.2)), '-'),
        ((0, 6), (0, -14), (-8, -26)), strict=True,
    )  # fmt: skip
    handles: list[Any] = []
    highest = 1e3 * max(row.modelled for row in trial.pick('greatest rise'))
    for name, colour, style, aside in styles:
        curve = trial.curves[f'rise, {name}']
        shown = np.where(curve.y > 1e-5, curve.y, np.nan)  # the curve is close to zero there
        ax.plot(1e3 * curve.x, 1e3 * shown, color=colour, ls=style)
        best = trial.pick('radius of greatest rise', name)[0].modelled
        top = trial.pick('greatest rise', name)[0].modelled
        ax.plot(1e3 * best, 1e3 * top, 'o', color=colour, ms=5.0)
        ax.annotate(
            f'{1e3 * best:.2f} mm', (1e3 * best, 1e3 * top), aside, textcoords='offset points',
            ha='center', fontsize=8.0, color=colour,
        )  # fmt: skip
        handles.append(Line2D([], [], color=colour, ls=style, label=name))
    handles.append(Patch(facecolor=STANCE, label='claimed optimum'))
    ax.set_xscale('log')
    ticks = [0.2, 0.3, 0.5, 0.8, 1.0, 2.0, 3.0, 5.0]
    ax.set_xticks(ticks, [f'{tick:g}' for tick in ticks])
    ax.minorticks_off()
    ax.set_xlim(1e3 * setup.smallest_radius, 1e3 * setup.largest_radius)
    ax.set_ylim(0.0, 1.13 * highest)
    ax.set_xlabel('pad radius / mm')
    ax.set_ylabel('height of rise / mm')
    legend(figure, handles, columns=2)
    return drawn(
        10,
        figure,
        alt='Height of rise over pad radius by three versions of 3.101; greatest at '
        + ', '.join(
            f'{1e3 * row.modelled:.2f} mm ({row.model})'
            for row in trial.pick('radius of greatest rise')
        ),
    )


# --- foot ----------------------------------------------------------------------------------------


def figure_34(trial: BenchTrial) -> Drawn:
    """Draw tangential over normal force of a foot on four floors, and wet less dry force."""
    figure = Figure(figsize=(WIDE, 3.3), layout='constrained')
    *forces, less = figure.subplots(1, 3)
    for ax, floor in zip(forces, (SMOOTH, ROUGH), strict=True):
        for shape, ground in itertools.product(_OF_FOOT, (DRY, WET)):
            curve = trial.curves[f'{shape}, {floor}, {ground}']
            style = (0, (4, 2)) if ground == DRY else '-'
            ax.plot(curve.x, curve.y, color=_OF_FOOT[shape], ls=style)
        ax.set_title(f'(a) {floor}')
        ax.set_ylabel('tangential force / N')
    highest = max(ax.get_ylim()[1] for ax in forces)
    for ax in forces:
        ax.set_ylim(0.0, highest)
    for (floor, colour), (kind, style) in itertools.product(_FLOORS.items(), _KINDS.items()):
        curve = trial.curves[f'{DOME}, {floor}, {kind}']
        less.plot(curve.x, 1e3 * curve.y, color=colour, ls=style)
    curve = trial.curves['3.82, corrected, water']
    less.plot(curve.x, 1e3 * curve.y, color=PURPLE, ls=(0, (4, 1, 1, 1)))
    less.axhline(0.0, color=PALE, lw=0.8)
    less.set_title('(b) domes, wet less dry')
    less.set_ylabel('F_wet − F_dry / mN')
    for ax in (*forces, less):
        ax.set_xlim(0.0, None)
        ax.set_xlabel('normal force / N')
    legend(figure, _handles_of_34(), columns=3)
    return drawn(
        34,
        figure,
    )


_OF_FOOT = {FLAT: BLACK, DOME: VERMILION}
_FLOORS = {SMOOTH: BLUE, ROUGH: GREEN}
_KINDS: dict[str, Any] = {NONE: '-', LINES: (0, (4, 2)), SUCTION: (0, (1, 1.2))}


def _handles_of_34() -> list[Any]:
    return [
        *(
            Line2D([], [], color=colour, label=f'(a) {shape}, wet')
            for shape, colour in _OF_FOOT.items()
        ),
        Line2D([], [], color=BLACK, ls=(0, (4, 2)), label='(a) the same, dry'),
        *(Line2D([], [], color=colour, label=f'(b) {floor}') for floor, colour in _FLOORS.items()),
        *(
            Line2D([], [], color=BLACK, ls=style, label=f'(b) {kind}')
            for kind, style in _KINDS.items()
        ),
        Line2D([], [], color=PURPLE, ls=(0, (4, 1, 1, 1)), label='(b) one-sided force'),
    ]


_FIGURES: dict[str, dict[int, Callable[[BenchTrial], Drawn]]] = {
    'inflation': {14: figure_14, 15: figure_15},
    'press': {16: figure_16, 17: figure_17, 18: figure_18},
    'tangential': {20: figure_20, 21: figure_21, 10: figure_10},
    'foot': {34: figure_34},
}


# --- shapes, numbers and labels ------------------------------------------------------------------


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


def _shapes(trial: BenchTrial) -> dict[float, str]:
    """Return the gauge pressures of the dragged pads, from 0, with their colours."""
    rows = trial.pick('tangential force')
    pressures = sorted({row.pressure for row in rows if row.pressure is not None})
    return dict(zip(pressures, (BLACK, *_COLOURS[1:]), strict=False))


def _colours(rows: Sequence[Row]) -> Sequence[str]:
    return [_COLOURS[index % len(_COLOURS)] for index in range(len(rows))]


def _pressures(rows: Sequence[Row]) -> Array:
    return np.array([1e-3 * row.pressure for row in rows if row.pressure is not None])


def _forces(rows: Sequence[Row]) -> Array:
    return np.array([row.force for row in rows if row.force is not None])


def _found(rows: Sequence[Row]) -> Array:
    return np.array([row.measured for row in rows if row.measured is not None])


def _errors(rows: Sequence[Row]) -> Array:
    return np.array([row.error for row in rows if row.error is not None])


def _percent(row: Row) -> str:
    return f'{100.0 * (row.error or 0.0):+z.1f} %'.replace('-', '−')


def _kilopascals(row: Row) -> str:
    return f'{1e-3 * (row.pressure or 0.0):g} kPa'


def _listed(rows: Sequence[Row], form: str, by: str = 'pressure') -> str:
    """Return the rows as text, each with the pressure or force it belongs to."""
    return ', '.join(
        form.format(
            modelled=1e3 * row.modelled,
            measured=1e3 * (row.measured or 0.0),
            percent=100.0 * (row.error or 0.0),
        )
        + (f' at {_kilopascals(row)}' if by == 'pressure' else f' at {row.force:g} N')
        for row in rows
    )


def _label_errors(ax: Axes, rows: Sequence[Row], x: Array, y: Array, below: bool) -> None:
    for row, place, value in zip(rows, x, y, strict=True):
        ax.annotate(
            _percent(row), (place, value), (4, -6) if below else (0, 7),
            textcoords='offset points', ha='left' if below else 'center',
            va='top' if below else 'bottom', fontsize=8.0,
        )  # fmt: skip
