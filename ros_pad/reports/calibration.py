# SPDX-License-Identifier: Apache-2.0
"""The picture of a calibration: what was measured beside the model, and the residuals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact.calibrate import Calibration
from ros_pad.contact.dome import BURST, inflate
from ros_pad.contact.fits import Residual
from ros_pad.contact.pad import Array, Pad, with_constant
from ros_pad.reports.style import BLUE, PALE, STYLE, VERMILION

_MARKS = {'height': 'o', 'depth': 'v', 'contact_radius': 's', 'gap': '^', 'force_limit': 'o'}


def draw(calibration: Calibration) -> Figure:
    """Return the picture: one column for each kind of measurement, fit above, residuals below."""
    rows: dict[str, list[Residual]] = {}
    for row in calibration.residuals:
        kind = {'force_limit': 'force limit', 'tangential_force': 'friction'}.get(row.quantity)
        rows.setdefault(kind or 'shape', []).append(row)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.6 * len(rows), 6.2), layout='constrained')
        panels = figure.subplots(2, len(rows), squeeze=False, height_ratios=[3, 2])
        for (kind, found), above, below in zip(rows.items(), *panels, strict=True):
            above.set_title(kind)
            if kind == 'shape' and len(calibration.measurements.free.pressure):
                _shape(calibration, above)
            elif kind == 'force limit':
                _limit(calibration, above)
            else:
                scale, unit = (1.0, 'N') if kind == 'friction' else (1e3, 'mm')
                _points(above, found, [(scale * r.measured, scale * r.modelled) for r in found])
                end = 1.05 * max(above.get_xlim()[1], above.get_ylim()[1])
                above.plot([0.0, end], [0.0, end], color=PALE, lw=1, zorder=0)
                above.set(xlim=(0.0, end), ylim=(0.0, end))
                above.set(xlabel=f'measured, {unit}', ylabel=f'model, {unit}')
            above.legend(loc='upper left')
            below.axhline(0.0, color=PALE, lw=1, zorder=0)
            friction = kind == 'friction'
            places = [r.measured if friction else r.pressure / 1e3 for r in found]
            errors = [100.0 * r.error for r in found]
            _points(below, found, list(zip(places, errors, strict=True)))
            x = 'measured tangential force, N' if friction else 'gauge pressure, kPa'
            below.set(xlabel=x, ylabel='model over measured − 1, %')
            if kind == 'shape':
                below.legend(title='filled: fitted', title_fontsize=7.5, fontsize=7.5)
    return figure


def _points(panel: Axes, rows: Sequence[Residual], points: Sequence[tuple[float, float]]) -> None:
    """Draw a point for each row, with one entry of the legend for each look."""
    seen = set()
    for row, point in zip(rows, points, strict=True):
        first, *words = row.setting.split(', ')
        if row.quantity == 'tangential_force':
            first, dry = first.split()[0], words[0] == 'dry'
            mark, filled, label = 'o' if dry else 's', not dry, f'{first}, {words[0]}'
        else:
            mark, filled = _MARKS[row.quantity], row.used
            label = row.quantity.replace('_', ' ')
            if words:
                label += ', free' if first == 'free' else ', pressed'
        colour = BLUE if first == 'domes' or 'pressed' in label else VERMILION
        look: dict[str, Any] = {'fillstyle': 'full' if filled else 'none', 'color': colour}
        panel.plot(*point, mark, **look, label='_' if label in seen else label)
        seen.add(label)


def _shape(calibration: Calibration, panel: Axes) -> None:
    """Draw free domes, and the model with the interval of its constant."""
    free, pad = calibration.measurements.free, calibration.foot.pad
    pressure = np.linspace(0.0, 1.05 * float(free.pressure.max()), 300)
    k = calibration.constants[0]
    label = f'model, k = {k.value:.4g} N/m'
    if k.name == 'factor':
        label = f'{k.value:.3g} × the material'
    heights = 1e3 * _heights(pad, k.name, k.value, pressure)
    panel.plot(pressure / 1e3, heights, color=BLUE, label=label)
    if not math.isnan(k.low):
        high, low = (1e3 * _heights(pad, k.name, end, pressure) for end in (k.low, k.high))
        # Where the softest pad has no dome, any height is in the interval.
        high = np.where(np.isnan(high), 1.1e3 * float(free.height.max()), high)
        _band(panel, pressure, high, low)
    panel.plot(free.pressure / 1e3, 1e3 * free.height, 'o', color=VERMILION, label='measured')
    panel.set(xlabel='gauge pressure, kPa', ylabel='height of the free dome, mm')
    panel.set(xlim=(0.0, None), ylim=(0.0, None))


def _limit(calibration: Calibration, panel: Axes) -> None:
    """Draw force limits, and the line through them with its interval."""
    pressure, limit = calibration.measurements.force_limits
    line = calibration.foot.pad.measured_limit
    if line is not None:
        wide = np.linspace(0.9 * pressure.min(), 1.1 * pressure.max(), 100)
        middle = line.force + line.slope * (wide - line.pressure)
        label = 'fitted line (criterion measured)'
        panel.plot(wide / 1e3, np.maximum(0.0, middle), color=BLUE, label=label)
        known = {constant.name: constant for constant in calibration.constants}
        force, slope = known['force_limit'], known['force_limit_slope']
        if not math.isnan(force.low):
            # At the pressure of the line its two constants are uncorrelated.
            rise = (slope.high - slope.value) * (wide - line.pressure)
            band = np.hypot(force.high - force.value, rise)
            _band(panel, wide, middle + band, np.maximum(0.0, middle - band))
    panel.plot(pressure / 1e3, limit, 'o', color=VERMILION, label='measured')
    panel.set(xlabel='gauge pressure, kPa', ylabel='force limit of one pad, N')
    panel.set(ylim=(0.0, 1.6 * float(limit.max())))


def _band(panel: Axes, pressure: Array, high: Array, low: Array) -> None:
    look: dict[str, Any] = {'color': BLUE, 'alpha': 0.15, 'lw': 0}
    panel.fill_between(pressure / 1e3, high, low, **look, label='its 95 % interval')


def _heights(pad: Pad, name: str, value: float, pressure: Array) -> Array:
    changed = with_constant(pad, name, value)
    if changed.material is not None:
        return np.asarray(inflate(changed, pressure).height)
    inside = np.minimum(pressure, 0.9999 * BURST * value / pad.radius)
    heights = inflate(changed, inside).height
    return np.asarray(np.where(inside == pressure, heights, np.nan))
