# SPDX-License-Identifier: Apache-2.0
"""Figures of pad designs: a sole over the radius of its pads, and pads of materials."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact import Design, rise_height
from ros_pad.contact.design import Candidate, Span
from ros_pad.errors import InvalidInput
from ros_pad.reports.files import write_picture
from ros_pad.reports.style import BLACK, BLUE, VERMILION, WIDE


def draw(path: str | os.PathLike[str], designs: Sequence[Design]) -> None:
    """Draw the load and the rise of designs for one sole and load over the pad radius.

    ``designs`` are for rising radii, and the path ends in .png, .svg or .pdf. Raises InvalidInput
    without designs.
    """
    if not designs:
        raise InvalidInput('--figure: no pad with a radius from 0.3 to 2.5 mm fits on the sole')

    def figure() -> Figure:
        drawn = Figure(figsize=(WIDE, 3.2), layout='constrained')
        loads, heights = drawn.subplots(1, 2)
        first, r = designs[0], np.array([each.pad.radius for each in designs])
        reach = np.array([each.reachable_load for each in designs])
        reach[reach <= 0.0] = np.nan  # a logarithmic axis cannot show a load of zero
        loads.plot(1e3 * r, reach, color=BLUE, lw=1.8, label=f'force limit {first.criterion}')
        loads.axhline(first.load, color=BLACK, lw=1.0, ls=':', label='load')
        loads.set(yscale='log', ylabel='load of the foot, N', title='(a) what a sole carries')
        # Use ideal cells: the cells of a design vary, because its number of pads is rounded.
        heights.plot(1e3 * r, 1e3 * rise_height(r), color=BLUE, lw=1.8, label='height of rise')
        heights.plot(1e3 * r, 3e3 * r, color=BLACK, lw=1.0, ls=':', label='gap full')
        heights.set(ylabel='height of rise, mm', title='(b) liquid between the domes')
        for axes in (loads, heights):
            axes.set(xlim=(0.0, 2.5), xlabel='radius of the pads, mm')
            axes.legend()
        return drawn

    write_picture(path, figure)


def draw_candidates(
    path: str | os.PathLike[str], found: Sequence[Candidate], ceiling: float
) -> None:
    """Draw needed and largest pressures of pads of materials, and heights of their domes.

    ``ceiling`` is that of the supply, Pa gauge; the path ends in .png, .svg or .pdf.
    """

    def figure() -> Figure:
        drawn = Figure(figsize=(WIDE, 1.0 + 0.2 * len(found)), layout='constrained')
        pressures, heights = drawn.subplots(1, 2, sharey=True, width_ratios=[3, 2])
        for place, each in enumerate(found):
            _bar(pressures, 1e-3, each.largest_pressure, place + 0.15, VERMILION, 's')
            _bar(pressures, 1e-3, each.pressure, place - 0.15, BLUE, 'o')
            _bar(heights, 1e3, each.height, place, BLUE, 'o')
        pressures.axvline(1e-3 * ceiling, color=BLACK, lw=1.0, ls=':', label='supply')
        pressures.plot([], [], 'o-', color=BLUE, label='for the load')
        pressures.plot([], [], 's-', color=VERMILION, label='largest')
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
        drawn.legend(loc='outside upper right', ncols=3)
        return drawn

    write_picture(path, figure)


def _bar(axes: Axes, scale: float, span: Span, place: float, colour: str, mark: str) -> None:
    """Draw a value and its interval; the lowest one, hollow, where the value is infinite."""
    finite = [scale * each for each in span if np.isfinite(each)]
    if finite:
        axes.plot([min(finite), max(finite)], [place, place], color=colour, lw=1.4)
        known = np.isfinite(span.value)
        at = scale * span.value if known else min(finite)
        fill = 'full' if known else 'none'
        axes.plot(at, place, mark, color=colour, ms=4.0, fillstyle=fill)
