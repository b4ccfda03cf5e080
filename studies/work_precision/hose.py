# SPDX-License-Identifier: Apache-2.0
"""Measure the time to fill a pad: with the regulator alone, the hose alone, and both.

Writes hose.png and .json, and prints a table. Times, s, are from a step of the set-point until the
pad has 90 % of 75 kPa. For the hose alone, the outlet of the regulator has 75 kPa at once.
"""

from __future__ import annotations

import functools
import timeit
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ros_pad.contact.resistance import Foot
from ros_pad.simulation import Hose, PneumaticChannel, RegulatorModel
from ros_pad.simulation.pneumatics import time_to
from studies import command
from studies.drawing import BLACK, BLUE, GREEN, PALE, STYLE, VERMILION

BORES = {1e-3: VERMILION, 2e-3: BLUE, 4e-3: GREEN}  # m
LENGTHS = tuple(np.geomspace(0.1, 20.0, 24).tolist())
PRINTED = (0.5, 1.0, 2.0, 5.0, 10.0)
SWING = 0.4  # s, of the shipped hexapod gaits
GOAL = 75e3  # Pa gauge

Volume = float | Callable[[float], float]


def filling_time(hose: Hose, volume: Volume, regulated: bool = True) -> float:
    """Return the time until the pad has 90 % of 75 kPa, s; if not ``regulated``, hose alone."""
    model = RegulatorModel() if regulated else RegulatorModel(dead_time=0.0)
    channel = PneumaticChannel(model, hose, volume)
    if not regulated:
        channel.outlet = GOAL
    return time_to(channel, GOAL, 0.9 * GOAL)


def step_cost() -> float:
    """Return the computing time of a step of 4 ms while the pressure changes, s."""
    times = []
    for _ in range(20):
        channel = PneumaticChannel(RegulatorModel(natural_frequency=1.0), Hose(0.004, 1.0), 5e-6)
        channel.step(GOAL, 0.1)
        step = functools.partial(channel.step, GOAL, 0.004)
        times.append(timeit.timeit(step, number=500) / 500)
        assert not channel.settled
    return min(times)


def measure(lengths: Sequence[float]) -> list[dict[str, Any]]:
    """Return the filling times of foot and large pad by bore and length, m, of the hose, s."""
    foot = Foot.load('large37')
    pads: list[tuple[str, Volume]] = [
        (f'foot large37: {1e6 * foot.air_volume(GOAL):.1f} mL at 75 kPa', foot.air_volume),
        ('a large pad: 20 mL', 20e-6),
    ]
    cases = [(pad, volume, bore) for pad, volume in pads for bore in BORES]
    rows = []
    for pad, volume, bore in command.each(cases, 'hose', 'bore'):
        hoses = [Hose(bore, length) for length in lengths]
        rows.append(
            {
                'pad': pad,
                'bore_m': bore,
                'lengths_m': list(lengths),
                'with_regulator_s': [filling_time(hose, volume) for hose in hoses],
                'alone_s': [filling_time(hose, volume, regulated=False) for hose in hoses],
                'printed_s': [filling_time(Hose(bore, each), volume) for each in PRINTED],
            }
        )
    return rows


def draw(rows: Sequence[dict[str, Any]], alone: float) -> Figure:
    """Return the picture: filling time over length, a panel for each pad, a colour for a bore."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.5), layout='constrained')
        panels = figure.subplots(1, 2, sharey=True)
        for panel, pad in zip(panels, dict.fromkeys(row['pad'] for row in rows), strict=True):
            panel.axhline(alone, color=BLACK, lw=1.2, ls=':', label='regulator alone')
            for row in (row for row in rows if row['pad'] == pad):
                x, colour = row['lengths_m'], BORES[row['bore_m']]
                label = f'{1e3 * row["bore_m"]:.0f} mm'
                both, hose = row['with_regulator_s'], row['alone_s']
                panel.plot(x, both, color=colour, lw=1.8, label=f'{label}, with regulator')
                panel.plot(x, hose, color=colour, lw=1.2, ls='--', label=f'{label}, alone')
            panel.set(title=pad, xlabel='length of the hose (m)', xscale='log', yscale='log')
            panel.set(xlim=(LENGTHS[0], LENGTHS[-1]), ylim=(3e-3, 10.0))
            panel.axhline(SWING, color=PALE, lw=0.8)
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_formatter('{x:g}')
        panels[0].set_ylabel('time to 90 % of 75 kPa (s)')
        panels[1].text(0.11, 1.08 * SWING, 'a swing of the hexapod', color='#777777', fontsize=7)
        panels[0].legend(frameon=False, fontsize=7, loc='upper left')
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, print and draw."""
    parser = command.parser('hose', __doc__)
    command.add_count(parser, '--every', 1, 'take every N-th length only')
    command.add_out(parser)
    options = parser.parse_args(words)
    alone = filling_time(Hose(20e-3, 0.0), 1e-9)
    rows = measure(LENGTHS[:: options.every])
    cost = step_cost()
    document = {'step_s': cost, 'regulator_s': alone, 'rows': rows}
    kept = command.write(options.out, 'hose', document, {'hose': draw(rows, alone)})
    title = f'a step takes {1e6 * cost:.1f} us; the regulator alone takes {alone:.3f} s'
    command.show(options, kept, command.listed(rows, title))
    return 0
