# SPDX-License-Identifier: Apache-2.0
"""The page of a sweep and its figure: distance per cycle over parameters, a line each policy."""

from __future__ import annotations

import html
import itertools
import os
import shlex
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.configuration import refuse
from ros_pad.errors import InvalidInput
from ros_pad.reports.files import save
from ros_pad.reports.page import heading, page, plain_table, section, table, warning
from ros_pad.reports.style import COLUMN, PALE, PAPER_STYLE, WIDE, Drawn, legend, policy_look
from ros_pad.trials.sweep import Found, Point, Row, points

PANELS = 48  # largest number of panels of the figure
MOST_ROWS = 1000  # largest number of rows of the table of conditions
MOST_FAILURES = 50  # largest number of failed or ended trials in a table


def drawn(found: Found) -> Drawn:
    """Draw the means of a sweep with their 95 % intervals over seeds.

    The horizontal axis is the first parameter that has several values; without one, it is the
    scene. The second such parameter gives the columns; scenes and all other parameters give the
    rows. The caller must save the figure under ``matplotlib.rc_context(PAPER_STYLE)``.

    Raises
    ------
    InvalidInput
        When the figure would have more than 48 panels.
    """
    sweep, shown = found.sweep, points(found.rows, found.sweep.parameters)
    scenes = {'scene': list(sweep.scenes)}
    several = {name: list(each) for name, each in sweep.parameters.items() if len(each) > 1}
    axis, *others = several or scenes
    values = several | scenes
    down = [*(['scene'] if axis != 'scene' and len(sweep.scenes) > 1 else []), *others[1:]]
    columns, rows = (
        [
            dict(zip(names, each, strict=True))
            for each in itertools.product(*(values[name] for name in names))
        ]
        for names in (others[:1], down)
    )
    if len(rows) * len(columns) > PANELS:
        raise InvalidInput(
            f'the figure would have {len(rows) * len(columns)} panels: at most {PANELS} are'
            ' allowed; draw from trials.csv yourself'
        )
    with matplotlib.rc_context(PAPER_STYLE):
        wide = len(columns) > 1 or len(values[axis]) > 6
        size = (WIDE if wide else COLUMN, 0.9 + 1.7 * len(rows))
        figure = Figure(figsize=size, layout='constrained')
        grid = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
        for axes_row, row in zip(grid, rows, strict=True):
            for axes, column in zip(axes_row, columns, strict=True):
                wanted = row | column
                # None: the policy does not depend on this parameter, and is in all panels.
                own = [
                    point
                    for point in shown
                    if all(point.labels[name] in (each, None) for name, each in wanted.items())
                ]
                _panel(axes, own, axis, values[axis])
                axes.set_title('\n'.join(f'{name} = {_cell(v)}' for name, v in wanted.items()))
        for axes in grid[-1]:
            axes.set_xlabel(axis)
        figure.supylabel('advance per cycle / mm', fontsize=8)
        _legend(figure, shown, 4 if wide else 2)
    ways = [1e3 * point.mean for point in shown if point.mean is not None]
    reach = f'{min(ways):.0f} to {max(ways):.0f} mm' if ways else 'no valid walk'
    return Drawn(
        figure,
        f'Advance per gait cycle over {axis}',
        f'Mean advance per gait cycle over {axis}, one line for each policy: {reach}',
        "Means over seeds with their 95 % intervals (Student's t), shifted sideways so that none"
        ' hides another. Open points: some walks failed or ended early and are left out.',
    )


def _panel(axes: Axes, shown: Sequence[Point], axis: str, values: Sequence[Any]) -> None:
    words = any(isinstance(value, str) for value in values)
    place = {value: index if words else value for index, value in enumerate(values)}
    first, last = min(place.values()), max(place.values())
    reach = (last - first) or 1.0
    policies = list(dict.fromkeys(point.labels['policy'] for point in shown))
    for number, policy in enumerate(policies):
        colour, mark = policy_look(policy)
        # Shift the policies sideways, so that no interval hides another.
        aside = (0.06 if words else 0.012) * reach * (number - 0.5 * (len(policies) - 1))
        line = []
        for point in shown:
            if point.labels['policy'] != policy or point.mean is None:
                continue
            mean, value = 1e3 * point.mean, point.labels[axis]
            if value is None:  # of a policy without this parameter: level, marked at the end
                axes.axhline(mean, color=colour, lw=1.4)
            else:
                line.append((place[value] + aside, mean))
            x = last + 0.08 * reach + aside if value is None else place[value] + aside
            if point.low is not None and point.high is not None:
                axes.plot([x, x], [1e3 * point.low, 1e3 * point.high], color=colour, lw=1.1)
            inside = 'white' if point.left_out else colour
            axes.plot(x, mean, mark, color=colour, mfc=inside, ms=4.5)
        if line:
            axes.plot(*zip(*sorted(line), strict=True), color=colour, lw=0 if words else 1.4)
    if all(point.mean is None for point in shown):
        axes.text(0.5, 0.5, 'no valid walk', ha='center', transform=axes.transAxes)
    if words:
        axes.set_xlim(-0.5, len(values) - 0.5)
        axes.set_xticks(range(len(values)), [str(value) for value in values])
        axes.tick_params(axis='x', rotation=20 if len(values) > 1 else 0)
    else:
        axes.set_xlim(first - 0.06 * reach, last + 0.14 * reach)
        if len(values) <= 5:
            axes.set_xticks(list(place.values()))
    axes.grid(axis='y', color=PALE, alpha=0.3, lw=0.6)
    axes.set_axisbelow(True)


def _legend(figure: Figure, shown: Sequence[Point], columns: int) -> None:
    lines = []
    for policy in dict.fromkeys(point.labels['policy'] for point in shown):
        colour, mark = policy_look(policy)
        lines.append(Line2D([], [], color=colour, marker=mark, ms=4.5, lw=1.4, label=policy))
    if any(point.left_out for point in shown):
        look: dict[str, Any] = {'color': PALE, 'marker': 'o', 'mfc': 'white', 'lw': 0}
        lines.append(Line2D([], [], label='some walks left out', **look))
    seeds = sorted({point.walks + point.left_out for point in shown})
    most = f' to {seeds[-1]}' if seeds[1:] else ''
    legend(figure, lines, columns, f'mean and 95 % interval over {seeds[0]}{most} seeds')


def write(found: Found, path: str | os.PathLike[str], force: bool = False) -> None:
    """Write the page of a sweep: one HTML file that needs no other file, and no script.

    Parameters
    ----------
    found : Found
        Result of :func:`ros_pad.trials.sweep.read`.
    path : path
        HTML file to write.
    force : bool
        Whether to replace an existing file.

    Raises
    ------
    InvalidInput
        When the file exists and ``force`` is False.
    PadError
        When the file cannot be written.
    """
    refuse(path, force)
    sweep, rows = found.sweep, found.rows
    name = found.folder.resolve().name
    facts = [
        f'{len(rows)} trials of {len(sweep.scenes)} scene{"s" if sweep.scenes[1:] else ""}',
        f'{len(sweep.policies)} policies' if sweep.policies[1:] else f'policy {sweep.policies[0]}',
        f'seeds {_seeds(sweep.seeds)}',
        f'ros_pad {found.about["version"]}',
    ]
    failed = [(row['error'], row) for row in rows if row['error']]
    ended = [(row['verdict'], row) for row in rows if row['verdict'] and not row['error']]
    left_out = {'trials failed': failed, 'walks ended early': ended}
    warnings = [
        f'{len(some)} of {len(rows)} {words}, and are in no mean.'
        for words, some in left_out.items()
        if some
    ]
    for scene in sweep.scenes:
        levels = sorted({row['level'] for row in rows if row['scene'] == scene})
        if len(levels) > 1:
            words = f'{scene} was walked on {" and ".join(levels)}'
            warnings.append(f'{words}: a difference may come from that.')
    try:
        with matplotlib.rc_context(PAPER_STYLE):
            figure = section(drawn(found))
    except InvalidInput:
        figure = '<p>A figure would have too many panels: the table has all numbers.</p>'
    parts = [heading(f'Sweep {name}', facts), *map(warning, warnings), figure]
    parts.append('<h2>Condition by condition</h2>' + _conditions_table(found))
    for words, some in left_out.items():
        if some:
            parts.append(f'<h2>Which {words}</h2>' + _failures(found, some))
    parts.append('<h2>What was swept</h2>' + _swept(found))
    save(path, page(f'Sweep {name}: ros_pad', parts).encode())


def _conditions_table(found: Found) -> str:
    # Parameters with only one value are below the table, not in it.
    values = {'scene': found.sweep.scenes, **found.sweep.parameters}
    names = [*(name for name, each in values.items() if len(each) > 1), 'policy']
    shown = points(found.rows, found.sweep.parameters)
    body = []
    for point in shown[:MOST_ROWS]:
        ends = [f'{1e3 * end:.1f}' for end in (point.low, point.high) if end is not None]
        mean = '–' if point.mean is None else f'{1e3 * point.mean:.1f}'
        cells = [html.escape(_cell(point.labels[name])) for name in names]
        body.append([*cells, str(point.walks), str(point.left_out), mean, ' to '.join(ends)])
    head = [*map(html.escape, names), 'walks', 'left out', 'mean / mm', '95 % interval']
    text = table(head, body, range(len(names), len(head)))
    text += '<p class="note">Advance per gait cycle; its interval is by Student\'s t.</p>'
    return text + _more(len(shown) - MOST_ROWS, 'conditions')


def _more(count: int, what: str) -> str:
    return f'<p>{count} more {what} are in trials.csv.</p>' if count > 0 else ''


def _failures(found: Found, rows: Sequence[tuple[str, Row]]) -> str:
    """Return a table of trials: why, which, and the command that repeats it."""
    body = []
    for why, row in rows[:MOST_FAILURES]:
        words = ['pad', 'sweep', row['scene'], '--policy', row['policy'], '--seed']
        words.append(str(row['seed']))
        for name in found.sweep.parameters:
            if row[name] is not None:
                words += ['--set', f'{name}={row[name]}']
        again = html.escape(shlex.join([*words, '--fidelity', row['level']]))
        body.append([html.escape(str(why)), f'<code>{again}</code>'])
    # Reasons are long: unlike in other tables, let the first column wrap.
    text = table(['why', 'command to repeat it'], body, range(0))
    text = text.replace('<td>', '<td style="white-space: normal">')
    return text + _more(len(rows) - MOST_FAILURES, 'trials')


def _swept(found: Found) -> str:
    sweep, about = found.sweep, found.about
    levels = sorted({str(row['level']) for row in found.rows})
    return plain_table(
        [
            ('scenes', ', '.join(sweep.scenes)),
            ('policies', ', '.join(sweep.policies)),
            ('seeds of floor and noise', _seeds(sweep.seeds)),
            *((name, ', '.join(map(_cell, each))) for name, each in sweep.parameters.items()),
            ('fidelity', f'{about["fidelity"]}: walked on {", ".join(levels)}'),
            *((f'fingerprint of {name}', each[:16]) for name, each in found.fingerprints.items()),
            ('all numbers', 'trials.csv beside this page, one row for each trial'),
        ]
    )


def _seeds(seeds: Sequence[int]) -> str:
    if len(seeds) > 2 and list(range(seeds[0], seeds[-1] + 1)) == list(seeds):
        return f'{seeds[0]} to {seeds[-1]}'
    return ', '.join(map(str, seeds))


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return '–' if value is None else str(value)
