# SPDX-License-Identifier: Apache-2.0
"""Figure of the study of policies: gains with their intervals, where adapting wins and loses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import STYLE

BETTER = 'better fixed shape'


def draw(document: Mapping[str, Any]) -> Figure:
    """Draw the adaptive policy against every other, and ground by ground."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9.6, 5.4), layout='constrained')
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        ratios = document['held out']['all']['ratios']
        pairs = [(name, row['adaptive to it']) for name, row in ratios.items()]
        pairs = [(BETTER, ratios['adaptive'][BETTER]), *pairs]
        pairs = [pair for pair in pairs if pair[0] != 'adaptive']
        pairs.sort(key=lambda pair: -pair[1]['of_means'])
        _forest(left, [name for name, _ in pairs], [row for _, row in pairs], GREEN)
        count = len(document['held out']['all']['flat']['seeds'])
        left.set_title(f'{count} held-out floors: adaptive to')
        parts = [document[part]['grounds'] for part in ('held out', 'against')]
        grounds = {name: row for part in parts for name, row in part.items()}
        for other, colour, shift in ((BETTER, GREEN, -0.15), ('oracle', BLUE, 0.15)):
            rows = [row['ratios']['adaptive'][other] for row in grounds.values()]
            _forest(right, list(grounds), rows, colour, shift, f'to the {other}')
        right.axhline(len(parts[0]) - 0.5, color='0.6', linewidth=0.8)
        right.set_title('adaptive, ground by ground')
        figure.legend(*right.get_legend_handles_labels(), loc='outside lower right', ncols=2)
        for panel in (left, right):
            panel.axvline(1.0, color='0.6', linewidth=0.8, zorder=0)
            panel.set_xlabel('ratio of mean distances')
    return figure


def _forest(
    panel: Axes,
    names: list[str],
    rows: list[Mapping[str, float]],
    colour: str,
    shift: float = 0.0,
    label: str | None = None,
) -> None:
    places = [place + shift for place in range(len(rows))]
    middles = [row['of_means'] for row in rows]
    ends = [
        [max(0.0, row['of_means'] - row['low']) for row in rows],
        [max(0.0, row['high'] - row['of_means']) for row in rows],
    ]
    panel.errorbar(
        middles, places, xerr=ends, fmt='o', color=colour, markersize=4, linewidth=1.2, label=label
    )
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
