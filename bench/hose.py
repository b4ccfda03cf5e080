# SPDX-License-Identifier: Apache-2.0
"""How long a pad takes to fill: the regulator alone, the hose alone, and both.

Run ``python bench/hose.py``; writes docs/charts/hose.png, and prints the table behind it. Times
are to 90 % of 75 kPa from a step of the set-point; the hose alone has an outlet that is at 75 kPa
at once.
"""

from __future__ import annotations

import argparse
import functools
import pathlib
import sys
import timeit
from collections.abc import Callable

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from tqdm import tqdm

from ros_pad.contact.resistance import Foot
from ros_pad.simulation import Hose
from ros_pad.simulation import PneumaticChannel
from ros_pad.simulation import RegulatorModel
from ros_pad.trials.report import STYLE

CHART = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'charts' / 'hose.png'
BORES = {1e-3: '#D55E00', 2e-3: '#0072B2', 4e-3: '#009E73'}  # m, and Okabe-Ito colours
LENGTHS = np.geomspace(0.1, 20.0, 24)
PRINTED = (0.5, 1.0, 2.0, 5.0, 10.0)
SWING = 0.4  # s, of the shipped hexapod gaits
GOAL = 75e3
TICK = 5e-4

Volume = float | Callable[[float], float]


def filling_time(hose: Hose, volume: Volume, regulated: bool = True) -> float:
    """Return the time to 90 %, s."""
    model = RegulatorModel() if regulated else RegulatorModel(dead_time=0.0)
    channel = PneumaticChannel(model, hose, volume)
    if not regulated:
        channel.outlet_pressure = GOAL
    before = pressure = time = 0.0
    while pressure < 0.9 * GOAL:
        before, pressure = pressure, channel.step(GOAL, TICK)
        time += TICK
    return time - TICK * (pressure - 0.9 * GOAL) / (pressure - before)


def step_cost() -> float:
    """Return the time that a step of 4 ms takes while the pressure moves, s."""
    times = []
    for _ in range(20):
        channel = PneumaticChannel(RegulatorModel(natural_frequency=1.0), Hose(0.004, 1.0), 5e-6)
        channel.step(GOAL, 0.1)
        step = functools.partial(channel.step, GOAL, 0.004)
        times.append(timeit.timeit(step, number=500) / 500)
        assert not channel.settled
    return min(times)


def main() -> int:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    foot = Foot.load('large37')
    pads: list[tuple[str, Volume]] = [
        (f'foot large37: {1e6 * foot.air_volume(GOAL):.1f} mL at 75 kPa', foot.air_volume),
        ('a large pad: 20 mL', 20e-6),
    ]
    alone = filling_time(Hose(20e-3, 0.0), 1e-9)
    print(f'a step takes {1e6 * step_cost():.1f} us; the regulator alone takes {alone:.3f} s')
    progress = tqdm(total=len(pads) * len(BORES) * len(LENGTHS), file=sys.stderr)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.5), layout='constrained')
        panels = figure.subplots(1, 2, sharey=True)
        for panel, (title, volume) in zip(panels, pads, strict=True):
            panel.axhline(alone, color='#222222', lw=1.2, ls=':', label='regulator alone')
            for bore, colour in BORES.items():
                both, hose = [], []
                for length in LENGTHS:
                    line = Hose(bore, float(length))
                    both.append(filling_time(line, volume))
                    hose.append(filling_time(line, volume, regulated=False))
                    progress.update()
                label = f'{1e3 * bore:.0f} mm'
                panel.plot(LENGTHS, both, color=colour, lw=1.8, label=f'{label}, with regulator')
                panel.plot(LENGTHS, hose, color=colour, lw=1.2, ls='--', label=f'{label}, alone')
                row = [filling_time(Hose(bore, length), volume) for length in PRINTED]
                print(f'{title}, {label}:', ' '.join(f'{time:.3f} s' for time in row))
            panel.set(
                title=title,
                xlabel='length of the hose (m)',
                xscale='log',
                yscale='log',
                xlim=(LENGTHS[0], LENGTHS[-1]),
                ylim=(3e-3, 10.0),
            )
            panel.axhline(SWING, color='#999999', lw=0.8)
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_formatter('{x:g}')
        panels[0].set_ylabel('time to 90 % of 75 kPa (s)')
        panels[1].text(0.11, 1.08 * SWING, 'a swing of the hexapod', color='#777777', fontsize=7)
        panels[0].legend(frameon=False, fontsize=7, loc='upper left')
        figure.savefig(CHART, dpi=200)
    progress.close()
    return 0


if __name__ == '__main__':
    sys.exit(main())
