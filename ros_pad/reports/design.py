# SPDX-License-Identifier: Apache-2.0
"""Figures of pad designs: a sole over the radius of its pads, and pads of materials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.contact import Design, rise_height
from ros_pad.contact.design import Candidate, Span
from ros_pad.errors import InvalidInput
from ros_pad.reports.style import BLACK, BLUE, VERMILION, WIDE, legend


def draw(designs: Sequence[Design]) -> Figure:
    """Draw load and rise of designs for one sole and load over the pad radius, which rises.

    Raises InvalidInput without designs.
    """
    if not designs:
        raise InvalidInput('--figure: no pad with a radius from 0.3 to 2.5 mm fits on the sole')
    figure = Figure(figsize=(WIDE, 3.2), layout='constrained')
    loads, heights = figure.subplots(1, 2)
    first, radii = designs[0], np.array([each.pad.radius for each in designs])
    reach = np.array([each.reachable_load for each in designs])
    reach[reach <= 0.0] = np.nan  # a logarithmic axis cannot show a load of zero
    look: dict[str, Any] = {'color': BLUE, 'marker': 'o', 'ms': 3.5}
    loads.plot(1e3 * radii, reach, label=f'force limit {first.criterion}', **look)
    loads.axhline(first.load, color=BLACK, lw=1.0, ls=':', label='load')
    loads.set(yscale='log', ylabel='load of the foot, N', title='(a) what a sole carries')
    # Use ideal cells: the cells of a design vary, because its number of pads is rounded.
    heights.plot(1e3 * radii, 1e3 * rise_height(radii), label='height of rise', **look)
    heights.plot(1e3 * radii, 3e3 * radii, color=BLACK, lw=1.0, ls=':', label='gap full')
    heights.set(ylabel='height of rise, mm', title='(b) liquid between the domes')
    for axes in (loads, heights):
        axes.set(xlim=(0.0, 2.6), xlabel='radius of the pads, mm')
        axes.legend()
    return figure


def draw_candidates(found: Sequence[Candidate], ceiling: float) -> Figure:
    """Draw needed and largest pressures of pads of materials, and heights of their domes.

    ``ceiling`` is that of the supply, Pa gauge.
    """
    figure = Figure(figsize=(WIDE, 1.0 + 0.2 * len(found)), layout='constrained')
    pressures, heights = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    for place, each in enumerate(found):
        _bar(pressures, 1e-3, each.largest_pressure, place + 0.15, VERMILION, 's')
        _bar(pressures, 1e-3, each.pressure, place - 0.15, BLUE, 'o')
        _bar(heights, 1e3, each.height, place, BLUE, 'o')
    supply = pressures.axvline(1e-3 * ceiling, color=BLACK, lw=1.0, ls=':', label='supply')
    needed = Line2D([], [], color=BLUE, marker='o', label='for the load')
    largest = Line2D([], [], color=VERMILION, marker='s', label='largest')
    names = [
        f'{each.material}, {1e3 * (each.pad.thickness or 0.0):g} mm'
        + ('' if each.carried == 'yes' else f' ({each.carried})')
        for each in found
    ]
    pressures.set_yticks(range(len(found)), names)
    pressures.invert_yaxis()
    pressures.set(xscale='log', xlabel='gauge pressure, kPa')
    pressures.xaxis.set_major_formatter('{x:g}')
    heights.set(xlim=(0.0, None), xlabel='height of the free dome, mm')
    legend(figure, [supply, needed, largest])
    return figure


def _bar(axes: Axes, scale: float, span: Span, place: float, colour: str, mark: str) -> None:
    """Draw a value and its interval; the lowest one, hollow, where the value is infinite."""
    finite = [scale * each for each in span if np.isfinite(each)]
    if finite:
        axes.plot([min(finite), max(finite)], [place, place], color=colour, lw=1.4)
        known = np.isfinite(span.value)
        at = scale * span.value if known else min(finite)
        fill = 'full' if known else 'none'
        axes.plot(at, place, mark, color=colour, ms=4.0, fillstyle=fill)
