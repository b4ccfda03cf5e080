# SPDX-License-Identifier: Apache-2.0
"""Figure of the study of policies: gains with their intervals, where adapting wins and loses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.drawing import BLACK, BLUE, GREEN, STYLE

BETTER = 'better fixed shape'
_LOOKS = ((BETTER, GREEN, -0.15), ('oracle', BLUE, 0.15))
_PARTS = {'held out': 'held out', 'against': 'little to win, or file wrong'}


def draw(document: Mapping[str, Any], tuned_on: Sequence[str] = ()) -> Figure:
    """Draw the adaptive policy against every other, and ground by ground.

    Grounds in ``tuned_on``, on which a setting was chosen, are hollow.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(9.0, 6.0), layout='constrained')
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.35))
        whole = document['held out']['all']
        pairs = [(name, row['adaptive to it']) for name, row in whole['ratios'].items()]
        pairs = [(BETTER, whole['ratios']['adaptive'][BETTER]), *pairs]
        pairs = [pair for pair in pairs if pair[0] != 'adaptive']
        pairs.sort(key=lambda pair: -pair[1]['of_means'])
        for place, (_, row) in enumerate(pairs):
            _ratio(left, place, row, BLACK)
        _finish(left, [name for name, _ in pairs])
        left.set_title(f'adaptive to others, {len(whole["flat"]["seeds"])} held-out floors')
        _by_ground(right, document, tuned_on)
        handles = [
            Line2D([], [], color=colour, marker='o', ms=4, label=f'to the {name}')
            for name, colour, _ in _LOOKS
        ]
        hollow = Line2D([], [], color=BLACK, marker='o', ls='', ms=4, mfc='white')
        hollow.set_label('tuned on')
        handles.append(hollow)
        figure.legend(handles=handles, loc='outside lower right', ncols=3)
    return figure


def _by_ground(panel: Axes, document: Mapping[str, Any], tuned_on: Sequence[str]) -> None:
    names: list[str] = []
    heads = []
    for part, heading in _PARTS.items():
        heads.append(len(names))
        names.append(heading)
        for name, row in document[part]['grounds'].items():
            for other, colour, shift in _LOOKS:
                ratio = row['ratios']['adaptive'][other]
                _ratio(panel, len(names) + shift, ratio, colour, name in tuned_on)
            names.append(f'{name} ({len(row["flat"]["seeds"])})')
    _finish(panel, names)
    for head in heads:
        panel.get_yticklabels()[head].set_fontweight('bold')
    panel.set_title('adaptive, by ground (floors; one floor has no interval)', loc='right')


def _ratio(
    panel: Axes, place: float, row: Mapping[str, float], colour: str, hollow: bool = False
) -> None:
    """Draw a ratio and its interval, which has no length where there is one floor."""
    panel.plot([row['low'], row['high']], [place, place], color=colour, lw=1.2)
    face = 'white' if hollow else colour
    panel.plot(row['of_means'], place, 'o', color=colour, mfc=face, ms=4)


def _finish(panel: Axes, names: list[str]) -> None:
    panel.axvline(1.0, color='0.6', linewidth=0.8, zorder=0)
    panel.set_yticks(range(len(names)), names)
    panel.tick_params(axis='y', length=0)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set_xlabel('ratio of mean distances, 95 % interval')
