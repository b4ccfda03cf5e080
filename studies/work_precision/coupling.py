# SPDX-License-Identifier: Apache-2.0
"""Measure how much liquid changes the shape of a pad, over pressure, load and tension.

Prints changes in per cent relative to the same pad with a shape that the liquid does not change,
and the computing time over that of the dry pad. Writes coupling.json and .png. The large pad is in
a wide bath; loads are shares of p π r², the pressure times the whole area. In the last rows the
material is stiffer, with pressure and load scaled so that the dry shape is the same: the effect of
the liquid must then be inversely proportional to the stiffness.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from ros_pad.capillary import press_wet
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import LARGE_PAD, Pad
from ros_pad.errors import PadError
from studies import command
from studies.drawing import BLUE, GREEN, STYLE, VERMILION

PRESSURES = (50e3, 55e3, 60e3, 65e3, 70e3, 75e3, 80e3, 85e3)  # Pa gauge
SHARES = (0.03, 0.1, 0.3)  # of p π r²
TENSIONS = {'water, 73 mN/m': (0.073, math.radians(77.5)), '30 mN/m': (0.030, math.radians(26.0))}
STIFFENING = (1.0, 2.0, 4.0, 8.0)
QUANTITIES = ('gap', 'contact_radius', 'height', 'force')
COLOURS = (BLUE, VERMILION, GREEN)


def cases() -> Iterator[tuple[str, float, float, float]]:
    """Yield liquid, factor on the stiffness, pressure for factor 1, Pa, and load over p π r²."""
    for name in TENSIONS:
        for pressure in PRESSURES:
            for share in SHARES:
                yield name, 1.0, pressure, share
    for factor in STIFFENING[1:]:
        yield next(iter(TENSIONS)), factor, 65e3, 0.3


def case(name: str, factor: float, pressure: float, share: float) -> dict[str, Any]:
    """Return the changes of one pad by the liquid, %; only ``status`` if there is no result."""
    pad = Pad(LARGE_PAD.radius, factor * LARGE_PAD.stiffness)
    tension, angle = TENSIONS[name]
    liquid = Liquid(tension, solid_tension=tension, contact_angle=angle)
    load = share * math.pi * pad.radius**2 * factor * pressure
    row: dict[str, Any] = {
        'liquid': name,
        'stiffer': factor,
        'pressure': factor * pressure,
        'load': load,
        'share': share,
        'status': 'ok',
    }
    started = time.perf_counter()
    try:
        wet = press_wet(pad, factor * pressure, load, liquid)
    except PadError as error:
        return row | {'status': getattr(error, 'status', '') or str(error)}
    row['time'] = time.perf_counter() - started
    started = time.perf_counter()
    press(pad, factor * pressure, load, model='membrane')
    row['ratio'] = row['time'] / (time.perf_counter() - started)
    assert wet.rigid is not None
    for quantity in QUANTITIES:
        row[quantity] = 100.0 * (getattr(wet, quantity) / getattr(wet.rigid, quantity) - 1.0)
    return row


def draw(rows: Sequence[dict[str, Any]]) -> Figure:
    """Draw changes over pressure: one panel for each quantity.

    The colour is that of the load, the line style that of the liquid.
    """
    with matplotlib.rc_context(STYLE):
        return _draw([row for row in rows if row['status'] == 'ok'])


def _draw(rows: Sequence[dict[str, Any]]) -> Figure:
    figure = Figure(figsize=(7.0, 4.6), layout='constrained')
    names = {'gap': 'gap', 'contact_radius': 'contact radius', 'height': 'height of the liquid',
             'force': 'capillary force'}  # fmt: skip
    for axes, (quantity, label) in zip(
        figure.subplots(2, 2, sharex=True).flat, names.items(), strict=True
    ):
        for name, dash in zip(TENSIONS, ('-', '--'), strict=True):
            for share, colour in zip(SHARES, COLOURS, strict=True):
                own = [
                    row
                    for row in rows
                    if (row['liquid'], row['share'], row['stiffer']) == (name, share, 1.0)
                ]
                axes.plot(
                    [row['pressure'] / 1e3 for row in own],
                    [row[quantity] for row in own],
                    dash,
                    marker='o',
                    markersize=3.0,
                    color=colour,
                    label=f'{name}, load {share:g} p π r²',
                )
        axes.axhline(0.0, color='0.7', linewidth=0.8, zorder=0)
        axes.set_ylabel(f'{label}, %')
    for axes in figure.axes[2:]:
        axes.set_xlabel('gauge pressure, kPa')
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside upper center', ncols=2, frameon=False, fontsize=8)
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, print and draw."""
    parser = command.parser('coupling', __doc__)
    command.add_count(parser, '--every', 1, 'take every N-th case only')
    command.add_out(parser)
    options = parser.parse_args(words)
    chosen = list(cases())[:: options.every]
    rows = [case(*each) for each in command.each(chosen, 'coupling', 'case')]
    kept = command.write(options.out, 'coupling', {'rows': rows}, {'coupling': draw(rows)})
    command.show(options, kept, command.listed(rows))
    return 0
