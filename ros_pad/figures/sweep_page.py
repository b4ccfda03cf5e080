# SPDX-License-Identifier: Apache-2.0
"""The page of a sweep: one HTML file with its figure, a row a condition, and what went wrong."""

from __future__ import annotations

import html
import json
import os
import pathlib
import shlex
import sqlite3
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import matplotlib
import numpy as np
from scipy.special import bdtr

from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.figures.sweep import figure
from ros_pad.trials.page import PAPER_STYLE
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import embedded
from ros_pad.trials.page import page
from ros_pad.trials.page import refuse
from ros_pad.trials.page import save
from ros_pad.trials.page import table
from ros_pad.trials.sweep import LAST_COLUMNS
from ros_pad.trials.sweep import RESULTS
from ros_pad.trials.sweep import Point
from ros_pad.trials.sweep import Row
from ros_pad.trials.sweep import Sweep
from ros_pad.trials.sweep import points

MOST_ROWS = 1000  # of the table of conditions; trials.csv has them all
MOST_FAILURES = 50


@dataclass(frozen=True)
class Found:
    """What a folder holds of a sweep.

    Attributes
    ----------
    folder : Path
    sweep : Sweep
        As far as it was walked.
    rows : list of dict
        A row a trial, in the order of the sweep, all with the same columns.
    about : dict
        ``version``, ``fidelity``, ``parameters``, and a fingerprint of each scene.
    """

    folder: pathlib.Path
    sweep: Sweep
    rows: list[Row]
    about: dict[str, Any]


def is_sweep(folder: str | os.PathLike[str]) -> bool:
    """Whether a folder holds a sweep."""
    return (pathlib.Path(folder) / RESULTS).is_file()


def read(folder: str | os.PathLike[str]) -> Found:
    """Read the trials of a sweep that are done; nothing is changed.

    Raises
    ------
    InvalidInput
        When the folder holds no sweep, or one of which nothing is done.
    PadError
        When the sweep is at work, or its file is damaged.
    """
    folder = pathlib.Path(folder)
    path = folder / RESULTS
    if not path.is_file():
        raise InvalidInput(f'{folder}: holds no sweep: there is no {RESULTS} in it')
    try:
        base = sqlite3.connect(f'{path.resolve().as_uri()}?mode=ro', timeout=0.0, uri=True)
        try:
            about = {
                name: json.loads(value)
                for name, value in base.execute('SELECT name, value FROM about ORDER BY rowid')
            }
            rows = [json.loads(row) for (row,) in base.execute('SELECT row FROM trial')]
        finally:
            base.close()
    except sqlite3.Error as error:
        if 'locked' in str(error):
            raise PadError(f'{folder}: a sweep is at work in it: wait for its end') from error
        raise PadError(f'{path}: is damaged: {error}') from error
    if not rows:
        raise InvalidInput(f'{folder}: no trial of this sweep is done')
    # A row begins with what it was asked for, in the order of the command line.
    names = [name for name in rows[0] if name in about['parameters']]
    scenes = [name.removeprefix('scene ') for name in about if name.startswith('scene ')]
    walked = {row['scene'] for row in rows}
    sweep = Sweep(
        [scene for scene in scenes if scene in walked],
        _values(rows, 'policy'),
        _values(rows, 'seed'),
        {name: _values(rows, name) for name in names},
        about['fidelity'],
    )
    order = {'scene': sweep.scenes, 'policy': sweep.policies, 'seed': sweep.seeds}
    places = [(name, list(each)) for name, each in (order | dict(sweep.parameters)).items()]
    # First the parameters, then policies, then seeds: as the sweep walks them.
    places = [places[0], *places[3:], *places[1:3]]
    rows.sort(key=lambda row: [-1 if row[n] is None else each.index(row[n]) for n, each in places])
    columns = dict.fromkeys(name for row in rows for name in row if name not in LAST_COLUMNS)
    rows = [{name: row.get(name) for name in (*columns, *LAST_COLUMNS)} for row in rows]
    return Found(folder, sweep, rows, about)


def draw(found: Found) -> dict[str, Drawn]:
    """Draw the figures of a sweep, by name; none where there would be too many panels."""
    try:
        return {'sweep': figure(points(found.rows, found.sweep.parameters), found.sweep)}
    except InvalidInput:
        return {}


def median(values: Sequence[float]) -> tuple[float | None, float | None, float | None]:
    """Return the median and the ends of its interval, which covers it in 95 % of cases at least.

    The interval is between order statistics, so that nothing is assumed of the distribution; None
    for fewer than six values, of which no interval is so sure.
    """
    if not values:
        return None, None, None
    ordered = sorted(values)
    count = len(ordered)
    outside = 0  # how many values lie beyond each end
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
        Of :func:`read`.
    path : path
        HTML file to write.
    force : bool
        Replace a file that is there.

    Raises
    ------
    PadError
        When the file exists or cannot be written.
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
    parts = [
        f'<h1>Sweep {html.escape(name)}</h1><p class="facts">{html.escape(" · ".join(facts))}</p>'
    ]
    for words in _warnings(rows, failed, early):
        parts.append(f'<p class="warning">{html.escape(words)}</p>')
    drawn = draw(found)
    with matplotlib.rc_context(PAPER_STYLE):
        for each in drawn.values():
            parts.append(f'<h2>{html.escape(each.title)}</h2>')
            parts.append(embedded(each.figure, each.alt, html.escape(each.caption)))
    if not drawn:
        parts.append('<p>There are too many panels for a picture: the table has all numbers.</p>')
    parts.append('<h2>Condition by condition</h2>' + _conditions_table(found))
    if failed:
        parts.append('<h2>Trials that failed</h2>' + _failures(found, failed, 'error'))
    if early:
        parts.append('<h2>Walks that ended early</h2>' + _failures(found, early, 'verdict'))
    parts.append('<h2>What was swept</h2>' + _swept(found))
    save(path, page(f'Sweep {name}: ros_pad', parts).encode())


def _conditions_table(found: Found) -> str:
    sweep = found.sweep
    # What is the same in all rows stands below.
    values = {'scene': sweep.scenes, **sweep.parameters}
    names = [name for name, each in values.items() if len(each) > 1]
    shown = points(found.rows, sweep.parameters)
    head = [
        *(html.escape(name) for name in names),
        *('policy', 'walks', 'left out', 'mean / mm', '95 % interval', 'median / mm'),
        *('≥ 95 % interval', 'slip / mm', 'switches', 'judged right / %'),
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
        'mean is by Student\'s t, that of the median between order statistics (from six walks '
        'on). Slip is the way that a foot slid under load in a cycle, mean of the feet; switches '
        'are all changes of shape of a walk; judged right are flat stances at whose end P(wet) '
        'was on the right side of one half: medians over walks. Walks that failed or ended early '
        'are left out.</p>'
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
    # A long reason may be broken: it stands first, where other tables have names.
    text = table(['why', 'trial', 'walks it again'], body, range(0))
    text = text.replace('<td>', '<td style="white-space: normal">')
    if len(rows) > MOST_FAILURES:
        text += f'<p>{len(rows) - MOST_FAILURES} more are in trials.csv.</p>'
    return text


def _swept(found: Found) -> str:
    sweep, about = found.sweep, found.about
    rungs = sorted({str(row['rung']) for row in found.rows})
    lines = [
        ('scenes', ', '.join(sweep.scenes)),
        ('policies', ', '.join(sweep.policies)),
        ('seeds of floor and noise', _seeds(sweep.seeds)),
        *((name, ', '.join(map(_cell, each))) for name, each in sweep.parameters.items()),
        ('fidelity', f'{about["fidelity"]}: walked on {", ".join(rungs)}'),
        ('version', f'ros_pad {about["version"]}'),
        *(
            (f'fingerprint of {name.removeprefix("scene ")}', str(each)[:16])
            for name, each in about.items()
            if name.startswith('scene ')
        ),
        ('all numbers', 'trials.csv beside this page, a row a trial'),
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
            or 'none: trials of a sweep leave no bag; <code>pad run</code> walks one with its '
            'report',
        ]
    )
    return table(['', ''], cells, range(0))


def _warnings(rows: Sequence[Row], failed: Sequence[Row], early: Sequence[Row]) -> list[str]:
    found = []
    if failed:
        found.append(f'{len(failed)} of {len(rows)} trials failed, and are in no number.')
    if early:
        found.append(f'{len(early)} of {len(rows)} walks ended early, and are in no number.')
    for scene in dict.fromkeys(row['scene'] for row in rows):
        rungs = sorted({row['rung'] for row in rows if row['scene'] == scene})
        if len(rungs) > 1:
            found.append(
                f'{scene} was walked on {" and ".join(rungs)}: part of a difference may come from '
                'that.'
            )
    return found


def _values(rows: Iterable[Row], name: str) -> list[Any]:
    """Return what rows have in a column: numbers in order, words as they come by name."""
    found = {row[name] for row in rows if row[name] is not None}
    if all(isinstance(each, (int, float)) for each in found):
        return sorted(found)
    if name == 'policy':
        return [each for each in ('flat', 'dome', 'adaptive', 'oracle') if each in found]
    return sorted(found, key=str)


def _counts(row: Mapping[str, Any]) -> bool:
    return not row['error'] and not row['verdict']


def _is_of(row: Mapping[str, Any], point: Point) -> bool:
    return all(row[name] == value for name, value in point.labels.items())


def _of_legs(row: Mapping[str, Any], name: str) -> list[float]:
    return [
        each for key, each in row.items() if key.startswith(f'{name}_leg') and each is not None
    ]


def _slip_a_cycle(row: Mapping[str, Any]) -> float:
    return 1e3 * float(np.mean(_of_legs(row, 'slip_path_m'))) / row['cycles_walked']


def _labels(found: Found, row: Mapping[str, Any]) -> list[str]:
    return [n for n in ('scene', 'policy', 'seed', *found.sweep.parameters) if row[n] is not None]


def _again(found: Found, row: Mapping[str, Any]) -> str:
    words = ['pad', 'sweep', row['scene'], '--policy', row['policy'], '--seed', str(row['seed'])]
    for name in found.sweep.parameters:
        if row[name] is not None:
            words += ['--set', f'{name}={row[name]}']
    return shlex.join([*words, '--fidelity', row['rung']])


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
