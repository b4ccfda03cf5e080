# SPDX-License-Identifier: Apache-2.0
"""The picture of a calibration: measurements, the model, and the residuals."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact.calibrate import Calibration, Constant
from ros_pad.contact.dome import BURST, inflate
from ros_pad.contact.pad import Array, Pad, with_constant
from ros_pad.reports.style import BLUE, PALE, STYLE, VERMILION

_SHAPE = ('height', 'depth', 'contact_radius', 'gap')
_MARKS = {'height': 'o', 'depth': 'v', 'contact_radius': 's', 'gap': '^'}


def draw(calibration: Calibration) -> Figure:
    """Return the picture: one column for each kind of measurement, fit above, residuals below."""
    columns = [
        draw_column
        for draw_column, there in (
            (_shape, len(calibration.measurements.free.pressure) > 0),
            (_limit, len(calibration.measurements.force_limits.pressure) > 0),
            (_friction, len(calibration.measurements.friction.load) > 0),
        )
        if there
    ] or [_pressed_only]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.6 * len(columns), 6.2), layout='constrained')
        panels = figure.subplots(2, len(columns), squeeze=False, height_ratios=[3, 2])
        for number, draw_column in enumerate(columns):
            draw_column(calibration, panels[0, number], panels[1, number])
    return figure


def _shape(calibration: Calibration, above: Axes, below: Axes) -> None:
    free, pad = calibration.measurements.free, calibration.foot.pad
    known = {constant.name: constant for constant in calibration.constants}
    pressure = np.linspace(0.0, 1.05 * float(free.pressure.max()), 300)
    k = next(known[name] for name in ('stiffness', 'factor', 'thickness') if name in known)
    label = {
        'stiffness': f'model, k = {k.value:.4g} N/m',
        'factor': f'{k.value:.3g} × the material',
        'thickness': f'the material, {1e3 * k.value:.3g} mm thick',
    }[k.name]
    above.plot(
        pressure / 1e3, 1e3 * _heights(pad, k.name, k.value, pressure), color=BLUE, label=label
    )
    if not math.isnan(k.low):
        high, low = (1e3 * _heights(pad, k.name, end, pressure) for end in (k.low, k.high))
        above.fill_between(
            pressure / 1e3,
            # Where the softest pad has no dome, any height is in the interval.
            np.where(np.isnan(high), 1.1e3 * float(free.height.max()), high),
            low,
            color=BLUE,
            alpha=0.15,
            lw=0,
            label='its 95 % interval',
        )
    above.plot(free.pressure / 1e3, 1e3 * free.height, 'o', color=VERMILION, label='measured')
    above.set(xlabel='gauge pressure, kPa', ylabel='height of the free dome, mm', title='shape')
    above.set(xlim=(0.0, None), ylim=(0.0, None))
    above.legend(loc='upper left')
    _shape_residuals(calibration, below)


def _pressed_only(calibration: Calibration, above: Axes, below: Axes) -> None:
    for quantity, mark in _MARKS.items():
        rows = [row for row in calibration.residuals if row.quantity == quantity]
        if rows:
            measured, modelled = (
                [1e3 * r.measured for r in rows],
                [1e3 * r.modelled for r in rows],
            )
            above.plot(measured, modelled, mark, color=BLUE, label=quantity.replace('_', ' '))
    _equal(above, 'mm')
    above.set_title('shape of pressed domes')
    above.legend(loc='upper left')
    _shape_residuals(calibration, below)


def _shape_residuals(calibration: Calibration, panel: Axes) -> None:
    rows = [row for row in calibration.residuals if row.quantity in _SHAPE]
    seen = set()
    for row in rows:
        free = row.setting.startswith('free')
        label = f'{row.quantity.replace("_", " ")}, {"free" if free else "pressed"}'
        panel.plot(
            row.pressure / 1e3,
            100.0 * row.error,
            _MARKS[row.quantity],
            color=VERMILION if free else BLUE,
            fillstyle='full' if row.used else 'none',
            label=None if label in seen else label,
        )
        seen.add(label)
    _residual_axes(panel, 'gauge pressure, kPa')
    panel.legend(loc='best', fontsize=7.5, title='filled: fitted', title_fontsize=7.5)


def _limit(calibration: Calibration, above: Axes, below: Axes) -> None:
    pressure, limit = calibration.measurements.force_limits
    line = calibration.foot.pad.measured_limit
    rows = [row for row in calibration.residuals if row.quantity == 'force_limit']
    if line is not None:
        wide = np.linspace(0.9 * pressure.min(), 1.1 * pressure.max(), 100)
        above.plot(
            wide / 1e3,
            np.maximum(0.0, line.force + line.slope * (wide - line.pressure)),
            color=BLUE,
            label='fitted line (criterion measured)',
        )
        constants = {constant.name: constant for constant in calibration.constants}
        band = _band(constants['force_limit'], constants['force_limit_slope'], wide, line.pressure)
        if band is not None:
            middle = line.force + line.slope * (wide - line.pressure)
            above.fill_between(
                wide / 1e3,
                np.maximum(0.0, middle - band),
                middle + band,
                color=BLUE,
                alpha=0.15,
                lw=0,
                label='its 95 % interval',
            )
    above.plot(pressure / 1e3, limit, 'o', color=VERMILION, label='measured')
    above.set(
        xlabel='gauge pressure, kPa', ylabel='force limit of one pad, N', title='force limit'
    )
    above.set(ylim=(0.0, 1.6 * float(limit.max())))
    above.legend(loc='upper left')
    below.plot(
        [row.pressure / 1e3 for row in rows],
        [100.0 * row.error for row in rows],
        'o',
        color=VERMILION,
    )
    _residual_axes(below, 'gauge pressure, kPa')


def _band(force: Constant, slope: Constant, pressure: Array, middle: float) -> Array | None:
    """Return the half-width, N, of the 95 % interval of the line; None without an interval.

    At the pressure ``middle``, Pa, the two constants of the line are uncorrelated.
    """
    if math.isnan(force.low):
        return None
    return np.hypot(force.high - force.value, (slope.high - slope.value) * (pressure - middle))


def _friction(calibration: Calibration, above: Axes, below: Axes) -> None:
    rows = [row for row in calibration.residuals if row.quantity == 'tangential_force']
    for words, colour, mark in (
        ('flat, dry', VERMILION, 'o'),
        ('flat, wet', VERMILION, 's'),
        ('domes, dry', BLUE, 'o'),
        ('domes, wet', BLUE, 's'),
    ):
        shape, floor = words.split(', ')
        part = [r for r in rows if r.setting.startswith(shape) and f', {floor},' in r.setting]
        if part:
            fill = 'none' if floor == 'dry' else 'full'
            look: dict[str, Any] = {'color': colour, 'marker': mark, 'ls': '', 'fillstyle': fill}
            above.plot([r.measured for r in part], [r.modelled for r in part], **look, label=words)
            below.plot([r.measured for r in part], [100.0 * r.error for r in part], **look)
    _equal(above, 'N')
    above.set_title('friction')
    above.legend(loc='upper left')
    _residual_axes(below, 'measured tangential force, N')


def _equal(panel: Axes, unit: str) -> None:
    end = 1.05 * max(panel.get_xlim()[1], panel.get_ylim()[1])
    panel.plot([0.0, end], [0.0, end], color=PALE, lw=1, zorder=0)
    panel.set(xlim=(0.0, end), ylim=(0.0, end))
    panel.set(xlabel=f'measured, {unit}', ylabel=f'model, {unit}')


def _residual_axes(panel: Axes, where: str) -> None:
    panel.axhline(0.0, color=PALE, lw=1, zorder=0)
    panel.set(xlabel=where, ylabel='model over measured − 1, %')


def _heights(pad: Pad, name: str, value: float, pressure: Array) -> Array:
    changed = with_constant(pad, name, value)
    if changed.material is not None:
        return np.asarray(inflate(changed, pressure).height)
    inside = np.minimum(pressure, 0.9999 * BURST * value / pad.radius)
    heights = inflate(changed, inside).height
    return np.asarray(np.where(inside == pressure, heights, np.nan))
