# SPDX-License-Identifier: Apache-2.0
"""The page of a sweep: one HTML file with figure, table of conditions, and failures."""

from __future__ import annotations

import html
import os
import shlex
from collections.abc import Sequence
from urllib.parse import quote

import matplotlib
import numpy as np
from scipy.special import bdtr

from ros_pad.configuration import refuse
from ros_pad.errors import InvalidInput
from ros_pad.reports.files import save
from ros_pad.reports.page import heading, page, section, table, warning
from ros_pad.reports.style import PAPER_STYLE, Drawn
from ros_pad.reports.sweep import figure
from ros_pad.trials.sweep import Found, Point, Row, points

MOST_ROWS = 1000  # largest number of rows of the table of conditions
MOST_FAILURES = 50  # largest number of failed or ended trials in a table


def draw(found: Found) -> dict[str, Drawn]:
    """Draw the figures of a sweep, by name; none if the figure would have too many panels."""
    try:
        return {'sweep': figure(points(found.rows, found.sweep.parameters), found.sweep)}
    except InvalidInput:
        return {}


def median(values: Sequence[float]) -> tuple[float | None, float | None, float | None]:
    """Return the median and the ends of an interval for it with at least 95 % confidence.

    The ends are order statistics, so that the distribution of the values does not matter. They are
    None for fewer than six values, the median is None for no values.
    """
    if not values:
        return None, None, None
    ordered = sorted(values)
    count = len(ordered)
    outside = 0  # rank of the lower end, counted from 1; 0 if there is no interval
    while 2.0 * bdtr(outside, count, 0.5) <= 0.05:
        outside += 1
    low = ordered[outside - 1] if outside else None
    high = ordered[count - outside] if outside else None
    return float(np.median(ordered)), low, high


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
    failed = [row for row in rows if row['error']]
    early = [row for row in rows if row['verdict'] and not row['error']]
    name = found.folder.resolve().name
    facts = [
        f'{len(rows)} trials of {len(sweep.scenes)} scene{"s" if sweep.scenes[1:] else ""}',
        f'{len(sweep.policies)} policies' if sweep.policies[1:] else f'policy {sweep.policies[0]}',
        f'seeds {_seeds(sweep.seeds)}',
        f'ros_pad {found.about["version"]}',
    ]
    parts = [heading(f'Sweep {name}', facts), *map(warning, _warnings(rows, failed, early))]
    drawn = draw(found)
    with matplotlib.rc_context(PAPER_STYLE):
        parts += map(section, drawn.values())
    if not drawn:
        parts.append('<p>A figure would have too many panels: the table has all numbers.</p>')
    parts.append('<h2>Condition by condition</h2>' + _conditions_table(found))
    if failed:
        parts.append('<h2>Trials that failed</h2>' + _failures(found, failed, 'error'))
    if early:
        parts.append('<h2>Walks that ended early</h2>' + _failures(found, early, 'verdict'))
    parts.append('<h2>What was swept</h2>' + _swept(found))
    save(path, page(f'Sweep {name}: ros_pad', parts).encode())


def _conditions_table(found: Found) -> str:
    sweep = found.sweep
    # Parameters with only one value are below the table, not in it.
    values = {'scene': sweep.scenes, **sweep.parameters}
    names = [name for name, each in values.items() if len(each) > 1]
    shown = points(found.rows, sweep.parameters)
    head = [
        *(html.escape(name) for name in names),
        *('policy', 'walks', 'left out', 'mean / mm', '95 % interval', 'median / mm'),
        *('≥ 95 % interval', 'slip / mm', 'switches', 'wetness accuracy / %'),
    ]
    body = []
    for point in shown[:MOST_ROWS]:
        own = [row for row in found.rows if _counts(row) and _is_of(row, point)]
        middle, low, high = median([row['distance_per_cycle_m'] for row in own])
        slips = [_slip_a_cycle(row) for row in own]
        switches = [sum(_of_legs(row, 'switches')) for row in own]
        right = [row['wet_accuracy'] for row in own if row.get('wet_accuracy') is not None]
        body.append(
            [
                *(html.escape(_cell(point.labels[name])) for name in names),
                html.escape(str(point.labels['policy'])),
                str(point.walks),
                str(point.left_out),
                _number(point.mean, 1e3),
                _interval(point.low, point.high),
                _number(middle, 1e3),
                _interval(low, high),
                _number(median(slips)[0], 1.0),
                _number(median(switches)[0], 1.0, '.0f'),
                _number(median(right)[0], 1e2),
            ]
        )
    text = table(head, body, range(len(names) + 1, len(head)))
    text += (
        '<p class="note">Mean and median are of the advance per gait cycle. The interval of the '
        'mean is by Student\'s t, that of the median by order statistics (six walks or more). The '
        'last three columns are medians over walks: slip is the slip path of a foot in a gait '
        'cycle, mean of the feet; switches are all morphology changes of a walk; wetness accuracy '
        'is the share of flat stances at whose end P(wet) was on the correct side of 0.5. '
        'Walks that failed or ended early are left out.</p>'
    )  # fmt: skip
    if len(shown) > MOST_ROWS:
        text += f'<p>{len(shown) - MOST_ROWS} more conditions are in trials.csv.</p>'
    return text


def _failures(found: Found, rows: Sequence[Row], why: str) -> str:
    body = [
        [
            html.escape(str(row[why])),
            html.escape(', '.join(f'{n} {_cell(row[n])}' for n in _labels(found, row))),
            f'<code>{html.escape(_again(found, row))}</code>',
        ]
        for row in rows[:MOST_FAILURES]
    ]
    # Reasons are long: unlike in other tables, let the first column wrap.
    text = table(['why', 'trial', 'command to repeat it'], body, range(0))
    text = text.replace('<td>', '<td style="white-space: normal">')
    if len(rows) > MOST_FAILURES:
        text += f'<p>{len(rows) - MOST_FAILURES} more are in trials.csv.</p>'
    return text


def _swept(found: Found) -> str:
    sweep, about = found.sweep, found.about
    levels = sorted({str(row['level']) for row in found.rows})
    lines = [
        ('scenes', ', '.join(sweep.scenes)),
        ('policies', ', '.join(sweep.policies)),
        ('seeds of floor and noise', _seeds(sweep.seeds)),
        *((name, ', '.join(map(_cell, each))) for name, each in sweep.parameters.items()),
        ('fidelity', f'{about["fidelity"]}: walked on {", ".join(levels)}'),
        ('version', f'ros_pad {about["version"]}'),
        *((f'fingerprint of {name}', each[:16]) for name, each in found.fingerprints.items()),
        ('all numbers', 'trials.csv beside this page, one row for each trial'),
    ]
    reports = [
        f'<a href="{quote(each.relative_to(found.folder).as_posix())}">'
        f'{html.escape(each.parent.name)}</a>'
        for each in sorted(found.folder.glob('*/report.html'))
    ]
    cells = [[html.escape(text) for text in line] for line in lines]
    cells.append(
        [
            'reports of trials',
            ', '.join(reports)
            or 'none: trials of a sweep have no bag; <code>pad run</code> walks a trial with bag '
            'and report',
        ]
    )
    return table(['', ''], cells, range(0))


def _warnings(rows: Sequence[Row], failed: Sequence[Row], early: Sequence[Row]) -> list[str]:
    found = []
    if failed:
        found.append(f'{len(failed)} of {len(rows)} trials failed, and are in no mean or median.')
    if early:
        found.append(
            f'{len(early)} of {len(rows)} walks ended early, and are in no mean or median.'
        )
    for scene in dict.fromkeys(row['scene'] for row in rows):
        levels = sorted({row['level'] for row in rows if row['scene'] == scene})
        if len(levels) > 1:
            found.append(
                f'{scene} was walked on {" and ".join(levels)}: a difference may come from that.'
            )
    return found


def _counts(row: Row) -> bool:
    return not row['error'] and not row['verdict']


def _is_of(row: Row, point: Point) -> bool:
    return all(row[name] == value for name, value in point.labels.items())


def _of_legs(row: Row, name: str) -> list[float]:
    return [
        each for key, each in row.items() if key.startswith(f'{name}_leg') and each is not None
    ]


def _slip_a_cycle(row: Row) -> float:
    return 1e3 * float(np.mean(_of_legs(row, 'slip_path_m'))) / row['cycles_walked']


def _labels(found: Found, row: Row) -> list[str]:
    return [n for n in ('scene', 'policy', 'seed', *found.sweep.parameters) if row[n] is not None]


def _again(found: Found, row: Row) -> str:
    words = ['pad', 'sweep', row['scene'], '--policy', row['policy'], '--seed', str(row['seed'])]
    for name in found.sweep.parameters:
        if row[name] is not None:
            words += ['--set', f'{name}={row[name]}']
    return shlex.join([*words, '--fidelity', row['level']])


def _seeds(seeds: Sequence[int]) -> str:
    whole = list(range(seeds[0], seeds[-1] + 1)) == list(seeds)
    if whole and len(seeds) > 2:
        return f'{seeds[0]} to {seeds[-1]}'
    return ', '.join(map(str, seeds))


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return '–' if value is None else str(value)


def _number(value: float | None, factor: float, form: str = '.1f') -> str:
    return '–' if value is None else f'{factor * value:{form}}'.replace('-', '−')


def _interval(low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return '–'
    return f'{1e3 * low:.1f} to {1e3 * high:.1f}'.replace('-', '−')
