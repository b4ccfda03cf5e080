# SPDX-License-Identifier: Apache-2.0
"""How much the liquid round an inflated pad changes its shape, over pressure, load and tension.

Run ``python bench/coupling.py [--json FILE] [--figure FILE]``; prints a table: changes in per cent
against the same pad whose shape the liquid leaves alone, and how many times as long the coupled
case takes. The large pad stands in a wide bath; loads are shares of p π r², its pressure on its
whole area. The last rows make the pad's material stiffer at the same shape, pressure and
load growing with it: what the liquid does must vanish as its inverse.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import statistics
import sys
import time
from collections.abc import Iterator
from typing import Any

from matplotlib.figure import Figure
from tqdm import tqdm

from ros_pad.capillary import press_wet
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import Pad
from ros_pad.errors import PadError

PRESSURES = (50e3, 55e3, 60e3, 65e3, 70e3, 75e3, 80e3, 85e3)  # Pa gauge
SHARES = (0.03, 0.1, 0.3)  # of p π r²
TENSIONS = {'water, 73 mN/m': (0.073, math.radians(77.5)), '30 mN/m': (0.030, math.radians(26.0))}
STIFFENING = (1.0, 2.0, 4.0, 8.0)
QUANTITIES = ('gap', 'contact_radius', 'height', 'force')
COLOURS = ('#0072B2', '#D55E00', '#009E73')


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--json', type=pathlib.Path, metavar='FILE', help='save what was found')
    parser.add_argument('--figure', type=pathlib.Path, metavar='FILE', help='draw it (.png)')
    options = parser.parse_args()
    rows = [case(*each) for each in tqdm(list(cases()), unit='case')]
    print(
        'liquid          stiffer  pressure kPa  load N    gap %  contact radius %  height %'
        '  force %  times as long'
    )
    for row in rows:
        head = f'{row["liquid"]:16}{row["stiffer"]:7.0f}{row["pressure"] / 1e3:14.0f}'
        head += f'{row["load"]:8.3f}'
        if row['status'] != 'ok':
            print(f'{head}  {row["status"]}')
            continue
        print(
            f'{head}{row["gap"]:9.3f}{row["contact_radius"]:18.3f}{row["height"]:10.3f}'
            f'{row["force"]:9.3f}{row["ratio"]:15.0f}'
        )
    found = [row for row in rows if row['status'] == 'ok']
    print(f'median case: {statistics.median(row["time"] for row in found):.2f} s')
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding='utf-8')
    if options.figure:
        picture(found).savefig(options.figure, dpi=200)
    return 0


def cases() -> Iterator[tuple[str, float, float, float]]:
    """Yield liquid, stiffening, pressure (of the plain pad) and share of the load."""
    for name in TENSIONS:
        for pressure in PRESSURES:
            for share in SHARES:
                yield name, 1.0, pressure, share
    for factor in STIFFENING[1:]:
        yield next(iter(TENSIONS)), factor, 65e3, 0.3


def case(name: str, factor: float, pressure: float, share: float) -> dict[str, Any]:
    """Return what the liquid changes, %, of one pad."""
    pad = Pad(LARGE_PAD.radius, factor * LARGE_PAD.stiffness)
    tension, angle = TENSIONS[name]
    liquid = Liquid(tension, solid_tension=tension, contact_angle=angle)
    load = share * math.pi * pad.radius**2 * factor * pressure
    row = {
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


def picture(rows: list[dict[str, Any]]) -> Figure:
    """Draw the changes over pressure: a panel a quantity, a colour a load, a dash a liquid."""
    figure = Figure(figsize=(7.0, 4.6), layout='constrained')
    names = {'gap': 'gap', 'contact_radius': 'contact radius', 'height': 'height of the liquid',
             'force': 'capillary force'}  # fmt: skip
    for axes, (quantity, words) in zip(
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
        axes.set_ylabel(f'{words}, %')
        axes.spines[['top', 'right']].set_visible(False)
    for axes in figure.axes[2:]:
        axes.set_xlabel('gauge pressure, kPa')
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc='outside upper center', ncols=2, frameon=False, fontsize=8)
    return figure


if __name__ == '__main__':
    sys.exit(main())
