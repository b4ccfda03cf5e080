# SPDX-License-Identifier: Apache-2.0
"""Draw the picture of liquid around a pad: errors over time, and heights over the tension."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.reports.style import legend
from studies.drawing import BLACK, BLUE, GREEN, PALE, PAPER_STYLE, PURPLE, VERMILION

_LOWEST = 1e-5  # smaller errors are written as numbers at the lower edge
_BESIDE: dict[str, Any] = {'textcoords': 'offset points', 'fontsize': 7.0}
# Colour, mark and words of each family of methods.
LOOKS = {
    'thesis': (VERMILION, 'o', "layers, thesis' balance"),
    'force': (BLUE, 's', 'layers, force'),
    'energy': (GREEN, '^', 'layers, energy'),
    'minimised': (PURPLE, 'D', 'surface of least energy'),
    'exact meniscus': (BLACK, '*', 'exact meniscus'),
}


def draw(results: Sequence[Any]) -> Figure:
    """Return the picture: for each shape, errors over time, and heights over the tension."""
    shapes = list(dict.fromkeys(result.shape for result in results))
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(8.4, 7.2), layout='constrained')
        panels = figure.subplots(3, len(shapes), sharey='row', squeeze=False)
        for column, shape in enumerate(shapes):
            part = [result for result in results if result.shape == shape]
            heights, forces, spread = panels[:, column]
            heights.set_title(f'{"abc"[column]}  {shape}: height')
            forces.set_title(f'{"def"[column]}  {shape}: force')
            spread.set_title(f'{"ghi"[column]}  {shape}: height')
            _errors(heights, part, 'height')
            _errors(forces, part, 'force')
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


def _errors(panel: Axes, results: Sequence[Any], quantity: str) -> None:
    for family, (colour, mark, _) in LOOKS.items():
        part = [result for result in results if result.family == family]
        times = [result.ms_per_solve for result in part]
        medians = [getattr(result, f'{quantity}_error') for result in part]
        if len(part) > 1:
            panel.plot(times, medians, color=colour, lw=0.7, alpha=0.6)
        for k, (result, x, y) in enumerate(zip(part, times, medians, strict=True)):
            if math.isnan(y):
                continue
            worst = getattr(result, f'worst_{quantity}_error')
            if y < _LOWEST:
                panel.plot(x, 2.5 * _LOWEST, mark, color=colour, ms=9.0, mec='white', mew=0.5)
                panel.plot(x, 1.25 * _LOWEST, 'v', color=colour, ms=3.5, clip_on=False)
                text = f'{y:.0e} '.replace('e-0', 'e-')
                panel.annotate(
                    text, (x, 2.5 * _LOWEST), (-4, 0), ha='right', va='center', **_BESIDE
                )
                continue
            panel.plot([x, x], [y, worst], '-_', color=colour, lw=0.8, ms=4, alpha=0.6)
            panel.plot(x, y, mark, color=colour, ms=4.0 + 1.2 * k, mec='white', mew=0.5, zorder=3)
    panel.set(
        xscale='log', yscale='log', xlabel='processor time of one case / ms', ylim=(_LOWEST, 20.0)
    )
    panel.grid(color=PALE, alpha=0.3, lw=0.5)


def _spread(panel: Axes, results: Sequence[Any]) -> None:
    panel.axhline(1.0, color=PALE, lw=0.7)
    for family in ('thesis', 'force', 'energy'):
        colour, mark, _ = LOOKS[family]
        result = [result for result in results if result.family == family][-1]
        for tension in dict.fromkeys(case['tension'] for case in result.cases):
            cases = [
                case
                for case in result.cases
                if case['tension'] == tension and case['exact_height'] > 0.0
            ]
            x = [case['ratio'] for case in cases]
            y = [(case['height'] or math.nan) / case['exact_height'] for case in cases]
            dashed = (0, (4, 2)) if tension < 0.01 else '-'
            panel.plot(x, y, color=colour, marker=mark, ms=3.5, lw=1.0, ls=dashed)
    panel.set(yscale='log', xlabel='tension of the solid / of the liquid', xlim=(0.25, 1.0))
    panel.set_yticks([0.5, 1.0, 2.0, 3.0], ['0.5', '1', '2', '3'], minor=False)
    panel.minorticks_off()
