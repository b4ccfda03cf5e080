# SPDX-License-Identifier: Apache-2.0
"""The picture of the ladder of liquid round a pad: time and error, and error over tensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.trials.page import BLACK
from ros_pad.trials.page import BLUE
from ros_pad.trials.page import GREEN
from ros_pad.trials.page import PALE
from ros_pad.trials.page import PAPER_STYLE
from ros_pad.trials.page import VERMILION
from ros_pad.trials.page import legend

if TYPE_CHECKING:
    from ros_pad.ladders.capillary import Rung

PURPLE = '#CC79A7'
_LOWEST = 1e-4  # errors below are written, not drawn to scale
_BESIDE: dict[str, Any] = {'textcoords': 'offset points', 'fontsize': 7.0}
# Colour, mark and words of each family of methods.
LOOKS = {
    'thesis': (VERMILION, 'o', "layers, thesis' balance"),
    'force': (BLUE, 's', 'layers, force'),
    'energy': (GREEN, '^', 'layers, energy'),
    'minimised': (PURPLE, 'D', 'surface of least energy'),
    'exact meniscus': (BLACK, '*', 'exact meniscus'),
}


def draw(rungs: Sequence[Rung]) -> Figure:
    """Return the picture: a column for each shape; time against errors, errors over tensions."""
    shapes = list(dict.fromkeys(rung.shape for rung in rungs))
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(8.4, 7.2), layout='constrained')
        panels = figure.subplots(3, len(shapes), sharey='row', squeeze=False)
        for column, shape in enumerate(shapes):
            part = [rung for rung in rungs if rung.shape == shape]
            climbed, forced, spread = panels[:, column]
            climbed.set_title(f'{"abc"[column]}  {shape}: height')
            forced.set_title(f'{"def"[column]}  {shape}: force')
            spread.set_title(f'{"ghi"[column]}  {shape}: height')
            _ladder(climbed, part, 'height')
            _ladder(forced, part, 'force')
            _spread(spread, part)
        for panel, words in zip(
            panels[:, 0],
            ('relative error of height', 'relative error of force', 'height / exact height'),
            strict=True,
        ):
            panel.set_ylabel(words)
        handles = [
            Line2D([], [], color=colour, marker=mark, ls='', label=words)
            for colour, mark, words in LOOKS.values()
        ]
        handles += [
            Line2D([], [], color=BLACK, lw=1.0, label='water, 73 mN/m'),
            Line2D([], [], color=BLACK, lw=1.0, ls=(0, (4, 2)), label='4 mN/m'),
        ]
        legend(figure, handles, 4)
        figure.supxlabel(
            'a to f: median of the cases with an answer, whisker to the worst; larger marks are'
            ' finer.  g to i: finest layers; a curve ends where there is no answer.\n'
            'Heights that are refused as far off are drawn.',
            fontsize=7.0,
        )
    return figure


def _ladder(panel: Axes, rungs: Sequence[Rung], quantity: str) -> None:
    for family, (colour, mark, _) in LOOKS.items():
        part = [rung for rung in rungs if rung.family == family]
        times = [rung.ms_per_solve for rung in part]
        medians = [getattr(rung, f'{quantity}_error') for rung in part]
        if len(part) > 1:
            panel.plot(times, medians, color=colour, lw=0.7, alpha=0.6)
        for k, (rung, x, y) in enumerate(zip(part, times, medians, strict=True)):
            if math.isnan(y):
                continue
            worst = getattr(rung, f'worst_{quantity}_error')
            if y < _LOWEST:
                panel.plot(x, 2.5 * _LOWEST, mark, color=colour, ms=9.0, mec='white', mew=0.5)
                panel.plot(x, 1.25 * _LOWEST, 'v', color=colour, ms=3.5, clip_on=False)
                said = f'{y:.0e} '.replace('e-0', 'e-')
                panel.annotate(
                    said, (x, 2.5 * _LOWEST), (-4, 0), ha='right', va='center', **_BESIDE
                )
                continue
            panel.plot([x, x], [y, worst], '-_', color=colour, lw=0.8, ms=4, alpha=0.6)
            panel.plot(x, y, mark, color=colour, ms=4.0 + 1.2 * k, mec='white', mew=0.5, zorder=3)
    panel.set(xscale='log', yscale='log', xlabel='time of one case / ms', ylim=(_LOWEST, 20.0))
    panel.grid(color=PALE, alpha=0.3, lw=0.5)


def _spread(panel: Axes, rungs: Sequence[Rung]) -> None:
    panel.axhline(1.0, color=PALE, lw=0.7)
    for family in ('thesis', 'force', 'energy'):
        colour, mark, _ = LOOKS[family]
        rung = [rung for rung in rungs if rung.family == family][-1]
        for tension in dict.fromkeys(case.tension for case in rung.cases):
            cases = [c for c in rung.cases if c.tension == tension and c.exact_height > 0.0]
            x = [case.ratio for case in cases]
            y = [(case.height or math.nan) / case.exact_height for case in cases]
            dashed = (0, (4, 2)) if tension < 0.01 else '-'
            panel.plot(x, y, color=colour, marker=mark, ms=3.5, lw=1.0, ls=dashed)
    panel.set(yscale='log', xlabel='tension of the solid / of the liquid', xlim=(0.25, 1.0))
    panel.set_yticks([0.5, 1.0, 2.0, 3.0], ['0.5', '1', '2', '3'], minor=False)
    panel.minorticks_off()
