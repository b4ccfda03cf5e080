# SPDX-License-Identifier: Apache-2.0
"""Make the table and the picture of the walks."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.pace import Progress
from studies.drawing import BLACK, BLUE, GREEN, ORANGE, PALE, PURPLE, SKY, STYLE, VERMILION
from studies.work_precision.walk.hexapod import DRAKE, FREE, STIFF, TOP
from studies.work_precision.walk.results import FAILED, WalkResult
from studies.work_precision.walk.walkers import HEXAPOD, RAIL, TOWING, named

# Methods that are shown walk by walk.
SHOWN = tuple(
    named(family, step)
    for family, step in (
        ('L1', 4e-3),
        ('L1, soles turn', 4e-3),
        ('L2', 2e-3),
        (STIFF, 2e-3),
        ('MuJoCo defaults', 2e-3),
        (DRAKE['lagged'], 1e-3),
    )
)
_UNITS = {
    'distance': ('distance, %', 1e2),
    'slip': ('slip path, %', 1e2),
    'lateral': ('aside, mm/cycle', 1e3),
    'yaw': ('yaw, mrad/cycle', 1e3),
}


def table(results: Sequence[WalkResult]) -> str:
    """Return the results as text: a block for each robot, and the distances walk by walk."""
    lines: list[str] = []
    for robot in dict.fromkeys(result.robot for result in results):
        part = [result for result in results if result.robot == robot]
        lines += [*_block(robot, part), '']
        if robot == TOWING:
            lines += [*_matrix(part), '']
        if robot == HEXAPOD:
            lines += [*_walk_by_walk(part), '']
            if any(result.family == STIFF for result in part):
                lines.append(f'{STIFF}: impratio 10 and noslip_iterations 5, not impratio 100')
            lines += [f'left out: {why}' for why in _missing(part)]
            lines.append('')
    return '\n'.join(lines)


def _block(robot: str, part: Sequence[WalkResult]) -> list[str]:
    first, width = part[0], max(len(result.method) for result in part)
    heads = ''.join(f'{_UNITS[name][0]:>18}' for name in first.errors)
    lines = [
        f'{robot} ({first.cases} walks of {first.cycles} cycles; median and worst errors against'
        f' {first.top}; times against {first.baseline})',
        f'  {"method":{width}}      ms/s  us/step    ratio{heads}  distance fails  slip fails'
        '  refused',
    ]
    for result in part:
        errors = ''.join(
            f'{scale * result.errors[name]:9.2g}{scale * result.worst[name]:9.2g}'
            for name, (_, scale) in _UNITS.items()
            if name in result.errors
        )
        ratio = f'1/{1 / result.versus:.0f}' if result.versus < 0.1 else f'{result.versus:.2g}'
        lines.append(
            f'  {result.method:{width}}  {result.ms_per_second:8.3g} {result.us_per_step:8.3g}'
            f' {ratio:>8}{errors}  {result.failures:14d}  {result.slip_failures:10d}'
            f'  {result.refused:7d}'
        )
    return lines


def _matrix(part: Sequence[WalkResult]) -> list[str]:
    """Return distance and mean slip of each walk by each method, as a table in Markdown."""
    lines = [
        'distance (slip path of a foot, mean), mm a cycle',
        '| | ' + ' | '.join(result.method for result in part) + ' |',
        '|---' * (len(part) + 1) + '|',
    ]
    for row, walk in enumerate(part[0].walks):
        cells = [walk['walk']]
        for here in (result.walks[row] for result in part):
            went = f'{1e3 * here["distance"]:.1f} ({1e3 * here["slip"]:.1f})'
            cells.append('verdict' if here['verdict'] else went)
        lines.append('| ' + ' | '.join(cells) + ' |')
    return lines


def _walk_by_walk(part: Sequence[WalkResult]) -> list[str]:
    named = {result.method: result for result in part}
    tops = [named[name].walks for name in part[0].top.split(' and ')]
    shown = [named[name] for name in SHOWN if name in named]
    width = max(len(walk['walk']) for walk in tops[0])
    heads = ''.join(f'  {result.method}' for result in shown)
    lines = [
        f'{part[0].top}, a cycle, and by how much others are off in distance, %',
        f'  {"walk":{width}}  distance, mm   +-, mm  slip, mm  aside, mm  yaw, mrad{heads}',
    ]
    for row, walks in enumerate(zip(*tops, strict=True)):
        true = {
            name: fmean(walk[name] for walk in walks)
            for name in ('distance', 'slip', 'lateral', 'yaw')
        }
        off = ''
        for result in shown:
            walk = result.walks[row]
            text = 'verdict' if walk['verdict'] else f'{1e2 * walk["distance_error"]:+.1f}'
            off += f'  {text:>{len(result.method)}}'
        lines.append(
            f'  {walks[0]["walk"]:{width}}  {1e3 * true["distance"]:12.1f}'
            f'  {1e3 * abs(walks[0]["distance"] - true["distance"]):7.2f}'
            f'  {1e3 * true["slip"]:8.1f}'
            f'  {1e3 * true["lateral"]:+9.2f}  {1e3 * true["yaw"]:+9.2f}{off}'
        )
    return lines


def _missing(part: Sequence[WalkResult]) -> list[str]:
    families = {result.family for result in part}
    why = ['laws of friction that the hexapod does not walk with: pad chart stability']
    if 'L1, compiled' not in families:
        why.append('L1, compiled: pip install "ros_pad[fast]"')
    if 'Drake, SAP' not in families:
        why.append('Drake, and with it a reference of two engines: pip install drake')
    if 'L2' not in families:
        why.append('L2, and with it the true errors of L1: pip install "ros_pad[mujoco]"')
    return why


def figures(results: Sequence[WalkResult], progress: Progress | None = None) -> dict[str, Figure]:
    """Return the picture, by name."""
    return {'walk': draw(results)}


_LOOKS: dict[str, dict[str, Any]] = {
    'L1': {'color': BLUE, 'marker': 'o'},
    'L1, compiled': {'color': BLUE, 'marker': 's'},
    'L1, compiled, walk': {'color': SKY, 'marker': 'v'},
    'L1, soles turn': {'color': PURPLE, 'marker': 'o'},
    'L2': {'color': GREEN, 'marker': 'D'},
    STIFF: {'color': ORANGE, 'marker': 'P'},
    'MuJoCo defaults': {'color': VERMILION, 'marker': 'X'},
    DRAKE['bristles']: {'color': BLACK, 'marker': '^'},
    DRAKE['lagged']: {'color': BLACK, 'marker': '<'},
    DRAKE['sap']: {'color': PALE, 'marker': '>'},
    DRAKE['tamsi']: {'color': PALE, 'marker': 'v'},
    'RailLeg': {'color': GREEN, 'marker': 'o'},
    'solve_ivp, events, 1e-6': {'color': BLUE, 'marker': 'D'},
    'solve_ivp, events, 1e-3': {'color': BLUE, 'marker': 'D'},
    'solve_ivp, smoothed, LSODA': {'color': VERMILION, 'marker': 'X'},
    'solve_ivp, smoothed, RK45': {'color': VERMILION, 'marker': 'P'},
}
_LEGEND = {STIFF: 'L2, impratio 10 and noslip 5'}
_PANELS = {
    'distance': ('distance', 'error, %'),
    'slip': ('slip path of a foot', 'error, %'),
    'lateral': ('drift aside', 'error, mm a cycle'),
    'yaw': ('heading', 'error, mrad a cycle'),
}


def draw(results: Sequence[WalkResult]) -> Figure:
    """Return the picture: time against each error, distances walk by walk, and the rail leg."""
    hexapod = [result for result in results if result.robot == HEXAPOD]
    rail = [result for result in results if result.robot == RAIL]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(11.5, 8.0))
        figure.set_layout_engine('constrained', w_pad=0.08, h_pad=0.08)
        panels = figure.subplots(2, 3).ravel()
        towing = [result for result in results if result.robot == TOWING]
        # Without Drake there is no towing; the heading is then drawn in its place.
        places = zip('abce', (0, 1, 2, 4)[: 3 if towing else 4], _PANELS, strict=False)
        for letter, place, name in places:
            _errors(panels[place], hexapod, name, f'{letter}  hexapod: {_PANELS[name][0]}')
        if towing:
            _tows(panels[4], towing, 'e  hexapod: dry, flat, with a load in tow')
        _strips(panels[3], hexapod, 'd  hexapod: distance, walk by walk')
        _errors(panels[5], rail, 'distance', 'f  rail leg: distance')
        _write_names(panels[5], rail)
        families = {result.family for result in hexapod}
        handles = [
            Line2D([], [], ls='', ms=6, label=_with_steps(family, hexapod), **look)
            for family, look in _LOOKS.items()
            if family in families
        ]
        double = bool(hexapod) and ' and ' in hexapod[0].top
        doubt = (
            'half of the difference of the references'
            if double
            else 'top level against half its step'
        )
        width = 7.0 if double else 0.9
        handles.append(
            Line2D(
                [], [], color=PALE, alpha=0.5, ls='-' if double else '--', lw=width, label=doubt
            )
        )
        figure.legend(
            handles=handles,
            loc='outside lower center',
            ncol=4,
            title='Mark: median of the walks; whisker: the worst. Beside names: steps.'
            ' Soles free to turn: dashed in e; SAP, lagged and TAMSI.\n'
            'In f, events and smoothed friction are those of solve_ivp.',
        )
    return figure


def _with_steps(family: str, part: Sequence[WalkResult]) -> str:
    """Return the name of a family with its shortest and longest step, ms."""
    steps = [1e3 * each.step_s for each in part if each.family == family and each.step_s]
    return f'{_LEGEND.get(family, family)}: {min(steps):g} to {max(steps):g} ms'


def _errors(panel: Axes, part: Sequence[WalkResult], name: str, title: str) -> None:
    """Draw time over the error called ``name``: mark at the median, whisker to the worst walk."""
    scale = _UNITS[name][1]
    panel.set(xscale='log', yscale='log', title=title, ylabel=_PANELS[name][1])
    panel.set_xlabel('time for a simulated second, ms')
    for family, look in _LOOKS.items():
        mine = [result for result in part if result.family == family]
        mine.sort(key=lambda result: result.step_s or 0.0)
        x = [result.ms_per_second for result in mine]
        y = [scale * result.errors[name] for result in mine]
        panel.plot(x, y, ls='-', lw=1.0, ms=6, zorder=3, **look)
        for result, at, error in zip(mine, x, y, strict=True):
            # Compiled walks have the same errors as walks in plain Python.
            if 'compiled' not in family:
                ends = [error, scale * result.worst[name]]
                panel.plot([at, at], ends, '-_', color=look['color'], lw=1.0, ms=5, alpha=0.5)
    if part and (band := scale * part[0].band[name]):
        panel.axhspan(1e-9, band, color=PALE, alpha=0.35, lw=0, zorder=0)
        panel.set_ylim(bottom=0.3 * band)
    for result in part:
        if result.family == TOP and not band and result.method != result.top:
            own = scale * result.errors[name]
            panel.axhline(own, color=PALE, ls='--', lw=0.9, zorder=1)
            # Smaller errors are not meaningful.
            panel.set_ylim(bottom=0.6 * own)
    panel.xaxis.set_major_formatter('{x:g}')
    panel.yaxis.set_major_formatter('{x:g}')
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


def _tows(panel: Axes, part: Sequence[WalkResult], title: str) -> None:
    """Draw the distance over the weight in tow, with soles that resist turning, and without."""
    for result in part:
        family, free = result.family.removesuffix(f', {FREE}'), FREE in result.family
        loads = [walk for walk in result.walks if walk['walk'].endswith(' N')]
        x = [float(walk['walk'].removesuffix(' N')) for walk in loads]
        y = [1e3 * walk['distance'] for walk in loads]
        panel.plot(x, y, ls='--' if free else '-', lw=1.0, ms=5, **_LOOKS[family])
    panel.set(title=title, xlabel='towed, N', ylabel='distance, mm a cycle')
    panel.grid(color=PALE, alpha=0.25, lw=0.5)


def _write_names(panel: Axes, part: Sequence[WalkResult]) -> None:
    """Write the names of methods beside the marks of the rail leg."""
    # Of each family, the name is written at the first result, which has the shortest step.
    first = {result.family: result for result in reversed(part) if result.family in _LOOKS}
    for family, result in first.items():
        panel.annotate(
            (_with_steps(family, part) if result.step_s else family).removeprefix('solve_ivp, '),
            (result.ms_per_second, 1e2 * result.errors['distance']),
            xytext={'RailLeg': (2, 9)}.get(family, (8, -3)),
            textcoords='offset points',
            fontsize=8,
            color=_LOOKS[family]['color'],
        )
    panel.set_xlim(right=60.0 * max(result.ms_per_second for result in part))


def _strips(panel: Axes, part: Sequence[WalkResult], title: str) -> None:
    """Draw the errors of the distance, a row for each walk."""
    names = [walk['walk'] for walk in part[0].walks]
    shown = [result for result in part if result.method in SHOWN]
    for result, shift in zip(shown, np.linspace(-0.28, 0.28, len(shown)), strict=True):
        off = [1e2 * walk['distance_error'] for walk in result.walks]
        look = _LOOKS[result.family]
        panel.plot(off, shift + np.arange(len(names)), ls='', ms=5, **look)
    panel.axvline(0.0, color=BLACK, lw=0.8, zorder=1)
    for limit in (-1e2 * FAILED, 1e2 * FAILED):
        panel.axvline(limit, color=PALE, lw=0.9, ls=':', zorder=1)
    panel.set_yticks(range(len(names)), names)
    panel.set_ylim(len(names) - 0.5, -0.5)
    panel.set(title=title, xlabel='distance off by, %')
    panel.grid(axis='y', color=PALE, alpha=0.25, lw=0.5)
