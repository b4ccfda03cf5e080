# SPDX-License-Identifier: Apache-2.0
"""Figure of a sweep: distance per cycle over the first parameter, one line for each policy."""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.errors import InvalidInput
from ros_pad.reports.files import write_picture
from ros_pad.reports.style import (
    BLACK,
    BLUE,
    COLUMN,
    GREEN,
    PALE,
    PAPER_STYLE,
    VERMILION,
    WIDE,
    Drawn,
)
from ros_pad.trials.sweep import Point, Sweep

LOOKS = {
    'adaptive': (GREEN, 'o'),
    'flat': (VERMILION, 's'),
    'dome': (BLUE, '^'),
    'oracle': (BLACK, 'D'),
}
PANELS = 48


def draw(path: str | os.PathLike[str], points: Sequence[Point], sweep: Sweep) -> None:
    """Write the figure of a sweep, see :func:`figure`.

    Parameters
    ----------
    path : path
        Ends in .png, .svg or .pdf. An existing file is replaced.
    points : sequence of Point
        Result of :func:`ros_pad.trials.sweep.points`.
    sweep : Sweep
        The sweep of these points.

    Raises
    ------
    InvalidInput
        When the path has another ending, or the figure would have more than 48 panels.
    """
    write_picture(path, lambda: figure(points, sweep).figure)


def figure(points: Sequence[Point], sweep: Sweep) -> Drawn:
    """Draw the means of a sweep with their 95 % intervals over seeds.

    The horizontal axis is the first parameter that has several values; without one, it is the
    scene. The second such parameter gives the columns; scenes and all other parameters give the
    rows. The caller must save the figure under ``matplotlib.rc_context(PAPER_STYLE)``.

    Raises
    ------
    InvalidInput
        When the figure would have more than 48 panels.
    """
    several = {name: list(each) for name, each in sweep.parameters.items() if len(each) > 1}
    scenes = {'scene': list(sweep.scenes)}
    # Without a parameter with several values, compare scenes.
    axis, *others = several or scenes
    across = others[:1]
    down = [*(['scene'] if axis != 'scene' and len(sweep.scenes) > 1 else []), *others[1:]]
    values = several | scenes
    columns = _combinations(values, across)
    rows = _combinations(values, down)
    if len(rows) * len(columns) > PANELS:
        raise InvalidInput(
            f'the figure would have {len(rows) * len(columns)} panels: at most {PANELS} are'
            ' allowed; draw from trials.csv yourself'
        )
    with matplotlib.rc_context(PAPER_STYLE):
        wide = len(columns) > 1 or len(values[axis]) > 6
        found = Figure(figsize=(WIDE if wide else COLUMN, 0.9 + 1.7 * len(rows)))
        found.set_layout_engine('constrained')
        grid = found.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
        for axes_row, row in zip(grid, rows, strict=True):
            for axes, column in zip(axes_row, columns, strict=True):
                wanted = row | column
                own = [each for each in points if _belongs(each, wanted)]
                _panel(axes, own, axis, values[axis])
                axes.set_title('\n'.join(f'{name} = {_text(v)}' for name, v in wanted.items()))
        for axes in grid[-1]:
            axes.set_xlabel(axis)
        found.supylabel('advance per cycle / mm', fontsize=8)
        _legend(found, points, 4 if wide else 2)
    known = [each for each in points if each.mean is not None]
    return Drawn(
        found,
        f'Advance per gait cycle over {axis}',
        f'Mean advance per gait cycle over {axis}, one line for each policy: '
        + (
            f'{1e3 * min(each.mean or 0.0 for each in known):.0f} to '
            f'{1e3 * max(each.mean or 0.0 for each in known):.0f} mm'
            if known
            else 'no valid walk'
        ),
        'Means over seeds with their 95 % intervals (Student\'s t). Points are shifted sideways '
        'so that none hides another. Open points: some walks failed or ended early and are left '
        'out.',
    )  # fmt: skip


def _combinations(values: Mapping[str, list[Any]], names: Sequence[str]) -> list[dict[str, Any]]:
    chosen = itertools.product(*(values[name] for name in names))
    return [dict(zip(names, each, strict=True)) for each in chosen]


def _belongs(point: Point, wanted: Mapping[str, Any]) -> bool:
    # None means that the policy does not depend on this parameter: the point is in all panels.
    return all(point.labels[name] in (value, None) for name, value in wanted.items())


def _panel(axes: Axes, points: Sequence[Point], axis: str, values: Sequence[Any]) -> None:
    words = any(isinstance(value, str) for value in values)
    place = {value: index if words else value for index, value in enumerate(values)}
    policies = list(dict.fromkeys(point.labels['policy'] for point in points))
    ends = min(place.values()), max(place.values())
    reach = (ends[1] - ends[0]) or 1.0
    for number, policy in enumerate(policies):
        colour = LOOKS[policy][0]
        # Shift the policies sideways, so that no interval hides another.
        aside = (0.06 if words else 0.012) * reach * (number - 0.5 * (len(policies) - 1))
        own = [
            (each, each.mean)
            for each in points
            if each.labels['policy'] == policy and each.mean is not None
        ]
        # Draw a policy without this parameter as a level line, with its interval at the end.
        level = [(point, mean) for point, mean in own if point.labels[axis] is None]
        for point, mean in level:
            axes.axhline(1e3 * mean, color=colour, lw=1.4)
            _mark(axes, ends[1] + 0.08 * reach + aside, mean, point, policy)
        own = [(point, mean) for point, mean in own if point.labels[axis] is not None]
        own.sort(key=lambda pair: place[pair[0].labels[axis]])
        x = [place[point.labels[axis]] + aside for point, _ in own]
        axes.plot(x, [1e3 * mean for _, mean in own], color=colour, lw=0 if words else 1.4)
        for at, (point, mean) in zip(x, own, strict=True):
            _mark(axes, at, mean, point, policy)
    if all(point.mean is None for point in points):
        axes.text(0.5, 0.5, 'no valid walk', ha='center', transform=axes.transAxes)
    axes.set_xlim(ends[0] - 0.06 * reach, ends[1] + 0.14 * reach)
    if len(values) <= 5:
        axes.set_xticks(list(place.values()))
    if words:
        axes.set_xlim(-0.5, len(values) - 0.5)
        axes.set_xticks(range(len(values)), [str(value) for value in values])
        axes.tick_params(axis='x', rotation=20 if len(values) > 1 else 0)
    axes.grid(axis='y', color=PALE, alpha=0.3, lw=0.6)
    axes.set_axisbelow(True)


def _mark(axes: Axes, x: float, mean: float, point: Point, policy: str) -> None:
    colour, mark = LOOKS[policy]
    if point.low is not None and point.high is not None:
        axes.plot([x, x], [1e3 * point.low, 1e3 * point.high], color=colour, lw=1.1)
    inside = 'white' if point.left_out else colour
    axes.plot(x, 1e3 * mean, mark, color=colour, mfc=inside, ms=4.5)


def _legend(figure: Figure, points: Sequence[Point], columns: int) -> None:
    policies = dict.fromkeys(point.labels['policy'] for point in points)
    lines = [
        Line2D([], [], color=LOOKS[each][0], marker=LOOKS[each][1], ms=4.5, lw=1.4, label=each)
        for each in policies
    ]
    seeds = sorted({point.walks + point.left_out for point in points})
    title = (
        f'mean and 95 % interval over {seeds[0]}{f" to {seeds[-1]}" if seeds[1:] else ""} seeds'
    )
    if any(point.left_out for point in points):
        lines.append(
            Line2D([], [], color=PALE, marker='o', mfc='white', lw=0, label='some walks left out')
        )
    figure.legend(
        handles=lines, loc='outside upper left', ncols=columns, title=title,
        title_fontsize=8, alignment='left',
    )  # fmt: skip


def _text(value: object) -> str:
    return f'{value:.4g}' if isinstance(value, float) else str(value)
