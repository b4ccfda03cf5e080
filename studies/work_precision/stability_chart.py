# SPDX-License-Identifier: Apache-2.0
"""Draw the picture of inputs at which simulations of a robot fail: a panel for each case."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PAPER_STYLE, PURPLE, VERMILION
from studies.work_precision.stability import (
    ILL,
    KICK,
    NEEDS_MUJOCO,
    STABLE,
    Outcome,
    linear_limit,
    step_limits,
)

# Colours and markers of the plain methods, in the order of a case; line styles of ours.
_NAIVE = ((VERMILION, 'o'), (ORANGE, 's'), (PURPLE, 'D'), (BLUE, '^'), (PALE, 'v'))
_OURS = {'elastic': '-', 'creeping': '--', 'exact_stick': ':'}
_LAW: dict[str, Any] = {'color': BLACK, 'lw': 0.9, 'zorder': 1.5}


def draw(outcomes: Sequence[Outcome]) -> Figure:
    """Return the picture; a case that was not measured is an empty panel with a note."""
    with matplotlib.rc_context(PAPER_STYLE):
        figure = Figure(figsize=(11.0, 6.0))
        figure.set_layout_engine('constrained', w_pad=0.06, h_pad=0.08)
        panels = figure.subplots(2, 4).ravel()
        for letter, panel, (part, fill) in zip('abcdefg', panels[:7], _PANELS, strict=True):
            case = [outcome for outcome in outcomes if outcome.case.startswith(part)]
            panel.set_title(f'{letter}  {part}')
            if case:
                fill(panel, case)
            else:
                why = NEEDS_MUJOCO.replace(', ', ',\n') if letter == 'b' else 'not measured'
                panel.text(0.5, 0.5, why, ha='center', fontsize=8, transform=panel.transAxes)
                panel.set(xticks=[], yticks=[])
        panels[7].axis('off')
        handles = [
            Line2D([], [], color=VERMILION, marker='o', ms=4, lw=0.8, label='written first'),
            Line2D([], [], color=ORANGE, marker='s', ms=4, lw=0.8, label='tried next'),
            *(
                Line2D([], [], color=GREEN, ls=ls, lw=2.0, label=f'ours: {name}')
                for name, ls in _OURS.items()
            ),
            Line2D([], [], **_LAW, label='law, not fitted'),
            Line2D([], [], color=PALE, lw=0.9, ls='--', label='limit, predicted or allowed'),
        ]
        panels[7].legend(handles=handles, loc='center left', fontsize=9, labelspacing=0.7)
    return figure


def _methods(case: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    return {
        name: [outcome for outcome in case if outcome.method == name]
        for name in dict.fromkeys(outcome.method for outcome in case)
    }


def _curves(
    panel: Axes, case: Sequence[Outcome], across: float, up: float, floor: float
) -> dict[str, Line2D]:
    """Draw value times ``up``, at least ``floor``, over input times ``across``; return lines."""
    drawn = {}
    naive = iter(_NAIVE)
    for name, part in _methods(case).items():
        x = [across * outcome.at for outcome in part]
        y = [
            np.nan if outcome.value is None else max(up * outcome.value, floor) for outcome in part
        ]
        if part[0].ours:
            style: dict[str, Any] = {'color': GREEN, 'ls': _OURS.get(name, '-'), 'lw': 2.0}
        else:
            colour, marker = next(naive)
            style = {'color': colour, 'marker': marker, 'ms': 3.5, 'lw': 0.8}
        drawn[name] = panel.plot(x, y, **style, clip_on=False)[0]
        law = [(across * o.at, up * o.law) for o in part if o.law and up * o.law > floor]
        if law and not part[0].ours:
            panel.plot(*zip(*law, strict=True), **_LAW)
    return drawn


def _explicit(panel: Axes, case: Sequence[Outcome]) -> None:
    panel.set(xscale='log', yscale='log', ylim=(1e-6, 1e2))
    _curves(panel, case, 1e3, 1e3, 1e-6)
    limit = 1e3 * step_limits()['turning']
    for stable in STABLE.values():
        panel.axvline(limit * stable / 2.0, color=PALE, lw=0.9, ls='--', zorder=1)
    panel.axhline(1e3 * KICK, color=PALE, lw=0.9, ls='--', zorder=1)
    panel.text(20.0, 1.3e-3, 'first touch', color='#666666', ha='right', fontsize=8)
    panel.text(0.055, 30.0, 'Euler', color=VERMILION)
    panel.text(0.055, 8.0, 'RK4', color=ORANGE)
    panel.set(xlabel='step, ms', ylabel='chatter of the feet, mm/s')


def _creep(panel: Axes, case: Sequence[Outcome]) -> None:
    panel.set(xscale='log', yscale='log', ylim=(1e-5, 2e2))
    _curves(panel, case, 1e3, 1e3, 1e-5)
    panel.axhline(0.1, color=PALE, lw=0.9, ls='--', zorder=1)
    for text, (y, colour) in {
        'pyramidal (default)': (28.0, VERMILION),
        'elliptic': (2.2, ORANGE),
        'elliptic, impratio 10': (0.22, PURPLE),
        'elliptic, impratio 100': (0.022, BLUE),
        'elliptic, 10, noslip 5': (2e-5, '#666666'),
    }.items():
        panel.text(0.1, y, text, color=colour, fontsize=7.5)
    panel.set(xlabel='step, ms', ylabel='creep at 0.8 of the limit, mm/s')


def _split(panel: Axes, case: Sequence[Outcome]) -> None:
    methods = _methods(case)
    legs = sorted({int(outcome.at) for outcome in case})
    rows = list(methods)
    for row, part in enumerate(methods.values()):
        for leg, shift in zip(legs, (-0.25, 0.0, 0.25), strict=True):
            mine = [outcome for outcome in part if outcome.at == leg]
            ours = part[0].ours
            values = [np.nan if o.value is None else o.value for o in mine]
            panel.plot(
                values,
                [row + shift] * len(values),
                'o',
                ms=6 if ours else 4,
                color=GREEN if ours else VERMILION,
                mec='white',
                mew=0.4,
                clip_on=False,
            )
            if mine[0].law is not None:
                panel.plot(mine[0].law, row + shift, '|', color=BLACK, ms=10, mew=1.0)
            panel.text(1.0, row + shift, f'foot {leg}', transform=panel.get_yaxis_transform(),
                       ha='left', va='center', fontsize=7, color='#666666')  # fmt: skip
    names = ['Gauss-\nSeidel,\nsix orders', *rows[1:]]
    panel.set_yticks(range(len(rows)), names)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.set_xlim(left=min(0.0, min(o.value for o in case if o.value is not None)) - 0.01)
    panel.set_xlabel('force along a push of 0.3 N, N')


def _slipping(panel: Axes, case: Sequence[Outcome]) -> None:
    panel.set(xscale='log', yscale='log', ylim=(1e-11, 3.0))
    naive = iter(_NAIVE)
    for part in _methods(case).values():
        x = [outcome.at for outcome in part]
        y = [3.0 if outcome.value is None else max(outcome.value, 1e-11) for outcome in part]
        colour, marker = (GREEN, '.') if part[0].ours else next(naive)
        panel.plot(x, y, marker, color=colour, ms=3.5, mew=0.0, alpha=0.8)
    panel.axvline(1.0, color=PALE, lw=0.9, ls='--', zorder=1)
    left = panel.get_xlim()[0]
    panel.text(1.3 * left, 0.3, 'fixed point', color=VERMILION)
    panel.text(1.3 * left, 0.1, 'Newton,\nfull steps', color=ORANGE, va='top')
    panel.text(1.3 * left, 1e-7, 'ours', color=GREEN)
    panel.set(xlabel='growth of an error by the fixed point', ylabel='error of the twist, m/s')


def _pulling(panel: Axes, case: Sequence[Outcome]) -> None:
    naive = [outcome for outcome in case if not outcome.ours]
    for (name, part), (colour, marker) in zip(_methods(naive).items(), _NAIVE, strict=False):
        style: dict[str, Any] = {'ms': 5.5, 'mfc': 'none'} if 'scaled' in name else {'ms': 3.5}
        panel.plot(
            [1e3 * outcome.at for outcome in part],
            [1e2 * (outcome.value or 0.0) for outcome in part],
            marker,
            color=colour,
            **style,
        )
    part = _methods(naive)['clamped']
    panel.plot([1e3 * o.at for o in part], [1e2 * (o.law or 0.0) for o in part], **_LAW)
    panel.plot([0.0, 0.0], [0.0, 19.0], color=GREEN, lw=2.0)
    panel.text(-3.0, 18.5, 'ours: tip-\nover, when,\nwhich leg', color=GREEN, ha='right', va='top')
    panel.text(-60.0, 6.0, 'clamped:\nweight', color=VERMILION)
    panel.text(-60.0, 2.4, 'and scaled:\nmoment', color=ORANGE)
    panel.set(xlabel='pressure point beyond the edge, mm', ylabel='made up, % of the weight')


def _filling(panel: Axes, case: Sequence[Outcome]) -> None:
    panel.set(xscale='log', yscale='log', ylim=(1e-3, 1e6))
    _curves(panel, case, 1e3, 1.0, 1e-3)
    panel.text(0.011, 2e5, 'ISO, Euler', color=VERMILION)
    panel.text(0.011, 3e4, 'linear range', color=ORANGE)
    panel.text(20.0, 2e-3, 'ours', color=GREEN, ha='right')
    panel.axvline(1e3 * linear_limit(), color=PALE, lw=0.9, ls='--', zorder=1)
    panel.set(xlabel='step, ms', ylabel='chatter of the pressure, Pa')


def _threshold(panel: Axes, case: Sequence[Outcome]) -> None:
    panel.set(xscale='log', yscale='log')
    methods = list(_methods(case).items())
    for (name, part), style in zip(methods, ('o', 'x'), strict=True):
        label = name.removeprefix('RailLeg, ')
        x = [1e2 * (o.at - 1.0) for o in part]
        y = [np.nan if o.value is None else o.value for o in part]
        panel.plot(x, y, style, color=BLUE, ms=5, mfc='none', label=label)
    law = [(1e2 * (o.at - 1.0), o.law) for o in methods[0][1] if o.law is not None]
    panel.plot(*zip(*law, strict=True), **_LAW)
    panel.axhline(ILL, color=PALE, lw=0.9, ls='--', zorder=1)
    panel.set_xticks([3.0, 10.0, 30.0, 100.0, 300.0], ['3', '10', '30', '100', '300'])
    panel.set_yticks([0.1, 1.0, 10.0], ['0.1', '1', '10'])
    panel.legend(loc='upper right', fontsize=8, handletextpad=0.2)
    panel.set(
        xlabel='margin of the cap over the drag, %', ylabel='distance for 1 % of friction, %'
    )


_PANELS = (
    ('explicit friction', _explicit),
    ('creep in MuJoCo', _creep),
    ('three sticking feet', _split),
    ('all feet slip', _slipping),
    ('a foot would have to pull', _pulling),
    ('pad filled through a hose', _filling),
    ('threshold of the rail leg', _threshold),
)
