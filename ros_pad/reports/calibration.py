# SPDX-License-Identifier: Apache-2.0
"""The picture of a calibration: what was measured beside the model, and the residuals."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact.calibrate import Calibration
from ros_pad.contact.dome import BURST, inflate
from ros_pad.contact.pad import Array, Pad, with_constant
from ros_pad.reports.style import BLUE, PALE, STYLE, VERMILION

_MARKS = {'height': 'o', 'depth': 'v', 'contact_radius': 's', 'gap': '^', 'force_limit': 'D'}


def draw(calibration: Calibration) -> Figure:
    """Return the picture: a panel for each kind of measurement, and one of all residuals."""
    measured = {row.quantity for row in calibration.residuals}
    panels = [_shape] if len(calibration.measurements.free.pressure) else []
    panels += [_limit] if 'force_limit' in measured else []
    panels += [_friction] if 'tangential_force' in measured else []
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(4.6 * len(panels) + 4.6, 3.9), layout='constrained')
        for panel, axes in zip(
            (*panels, _residuals),
            figure.subplots(1, len(panels) + 1, squeeze=False)[0],
            strict=True,
        ):
            panel(calibration, axes)
            axes.legend(loc='upper left')
    return figure


def _residuals(calibration: Calibration, panel: Axes) -> None:
    """Draw how far the model is from all that was measured; filled: fitted."""
    seen = set()
    for row in calibration.residuals:
        look: dict[str, Any] = {'fillstyle': 'full' if row.used else 'none'}
        look['color'] = BLUE if row.used else VERMILION
        label = row.quantity.replace('_', ' ') + ('' if row.used else ', not fitted')
        mark = _MARKS.get(row.quantity, 'P')
        own = '_' if label in seen else label
        panel.plot(row.pressure / 1e3, 100.0 * row.error, mark, label=own, **look)
        seen.add(label)
    panel.axhline(0.0, color=PALE, lw=1, zorder=0)
    panel.set(title='residuals', xlabel='gauge pressure, kPa')
    panel.set(ylabel='model over measured − 1, %')


def _friction(calibration: Calibration, panel: Axes) -> None:
    """Draw modelled over measured forces, flat and domed, dry and wet."""
    rows = [row for row in calibration.residuals if row.quantity == 'tangential_force']
    for domed, colour in ((False, VERMILION), (True, BLUE)):
        for surface, mark in (('dry', 'o'), ('wet', 's')):
            some = [r for r in rows if (r.pressure > 0.0, surface in r.setting) == (domed, True)]
            x, y = [r.measured for r in some], [r.modelled for r in some]
            label = f'{"domes" if domed else "flat"}, {surface}'
            panel.plot(x, y, mark, color=colour, label=label if some else '_')
    end = 1.05 * max(panel.get_xlim()[1], panel.get_ylim()[1])
    panel.plot([0.0, end], [0.0, end], color=PALE, lw=1, zorder=0)
    panel.set(title='friction', xlim=(0.0, end), ylim=(0.0, end))
    panel.set(xlabel='measured, N', ylabel='model, N')


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
    panel.set(title='shape', xlabel='gauge pressure, kPa', ylabel='height of the free dome, mm')
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
    panel.set(title='force limit', xlabel='gauge pressure, kPa', ylabel='force limit of a pad, N')
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
