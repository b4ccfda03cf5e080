# SPDX-License-Identifier: Apache-2.0
"""``pad sweep``: walk every combination of scenes, policies, seeds and parameters."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import pathlib
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from ros_pad.commands.command import INTERRUPTED
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.command import complain
from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.errors import InvalidInput
from ros_pad.simulation import fidelity as ladder
from ros_pad.trials import sweep as sweeps

LINES = 60  # of the table on the screen
MOST = 100_000  # values of a range, seeds


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'sweep',
        run,
        'Walk every combination of scenes, policies, seeds and parameters, without ROS, on all '
        'cores or on a Dask cluster: trials.csv, a picture with confidence intervals, and a page.',
        'pad sweep hexapod_patches --policy flat,dome,adaptive --seed 0:9 '
        '--set tow.weight=3:12:4 --set floor.wet_fraction=0.2,0.5 --out towing',
    )
    part.description = (
        f'{part.description}\nA sweep that was stopped or killed goes on when the same command is '
        'given again with its --out;\nmore seeds, policies, scenes and values may be asked for.'
    )
    part.add_argument(
        'scenes', metavar='SCENE', nargs='+', help='names of scenes, or paths of YAML files'
    )
    part.add_argument(
        '--policy',
        metavar='NAMES',
        help="with commas: flat, dome, adaptive, oracle (default: each scene's own)",
    )
    part.add_argument(
        '--seed',
        default='0:4',
        metavar='LIST',
        help='of floor and noise, with commas, or FIRST:LAST (default 0:4, which are five)',
    )
    part.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUES',
        help='values with commas, or START:STOP:COUNT, both ends included, in the units of the '
        "scene's YAML (SI). NAME is a key of it, dotted (tow.weight, N; cycles), "
        'estimator.KEY (estimator.filter_period, s) or policy.KEY (policy.wet_above); may be '
        'given more than once, and the first that has several values is the axis of the picture',
    )
    part.add_argument(
        '--fidelity',
        choices=ladder.FIDELITIES,
        default='auto',
        help='rung of every trial; auto (default) chooses it for each scene and its parameters',
    )
    where = part.add_mutually_exclusive_group()
    where.add_argument('--workers', type=int, metavar='N', help='processes (default: all cores)')
    where.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        help='walk on the cluster of this Dask scheduler (tcp://host:8786)',
    )
    part.add_argument(
        '--retry', action='store_true', help='walk trials that failed before once more'
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='DIR',
        help='new folder, or that of this sweep, which then goes on (default: runs/sweep...)',
    )
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Walk the sweep; return the exit status."""
    sweep = sweeps.Sweep(
        options.scenes,
        () if options.policy is None else options.policy.split(','),
        seeds(options.seed),
        parameters(options.set),
        options.fidelity,
    )
    total = len(sweep.jobs())  # refuses what is not allowed before there is a folder
    folder = new_folder(None, 'sweep') if options.out is None else options.out
    print(f'{total} trials; after a stop --out {folder} goes on', file=sys.stderr)
    done = 0
    try:
        with bar('sweep', total, 'trials') as reach:

            def progress(now: int, _: int) -> None:
                nonlocal done
                done = now
                reach(now)

            rows = sweeps.run(
                sweep, folder, options.workers, options.scheduler, progress, options.retry
            )
    except KeyboardInterrupt:
        return complain(
            f'stopped: {done} of {total} trials are in {folder};'
            f' the same command with --out {folder} goes on',
            INTERRUPTED,
        )
    finally:
        with contextlib.suppress(OSError):  # nothing came of it: the name stays free
            folder.rmdir()
    points = sweeps.points(rows, sweep.parameters)
    from ros_pad.figures import sweep_page
    from ros_pad.figures.sweep import draw

    picture: pathlib.Path | None = folder / 'sweep.png'
    notes = _notes(rows)
    try:
        draw(folder / 'sweep.png', points, sweep)
    except InvalidInput as error:
        picture = None
        notes.append(f'no picture: {error}')
    page = folder / 'report.html'
    sweep_page.write(sweep_page.read(folder), page, force=True)
    failed = [row for row in rows if row['error']]
    tables = [path for path in _tables(folder) if path.exists()]
    if options.json:
        print(
            json.dumps(
                {
                    'folder': str(folder),
                    'trials': len(rows),
                    'failed': len(failed),
                    'ended_early': sum(bool(row['verdict']) for row in rows),
                    'tables': [str(path) for path in tables],
                    'picture': None if picture is None else str(picture),
                    'report': str(page),
                    'notes': notes,
                    'points': [_flat(point) for point in points],
                }
            )
        )
    else:
        _show(points, sweep)
        for note in notes:
            print(note)
        for path in (*tables, *([picture] if picture else []), page):
            print(path)
    if failed:
        return complain(
            f'{len(failed)} of {len(rows)} trials failed, the first with: {failed[0]["error"]}', 1
        )
    return 0


def seeds(text: str) -> list[int]:
    """Return the seeds of a list such as ``0,1,5:9``."""
    found: list[int] = []
    for part in text.split(','):
        ends = part.split(':')
        if len(ends) > 2 or not all(end.strip().isdecimal() for end in ends):
            raise InvalidInput(
                f'--seed {text}: {part!r} is neither a whole number from 0 nor FIRST:LAST'
            )
        first, last = int(ends[0]), int(ends[-1])
        if not 0 <= last - first < MOST:
            raise InvalidInput(
                f'--seed {text}: {part!r}: LAST must be from FIRST to {MOST - 1} more'
            )
        found += range(first, last + 1)
    return found


def parameters(texts: list[str]) -> dict[str, list[sweeps.Value]]:
    """Return the values of each ``NAME=VALUES``."""
    found: dict[str, list[sweeps.Value]] = {}
    for text in texts:
        name, equals, values = text.partition('=')
        if not equals or not name or not values:
            raise InvalidInput(
                f'--set {text}: NAME=VALUE,VALUE or NAME=START:STOP:COUNT is needed'
            )
        if name in found:
            raise InvalidInput(f'--set {text}: {name} is there twice')
        if ':' in values:
            found[name] = _spaced(text, values)
        else:
            found[name] = [_value(each.strip()) for each in values.split(',')]
    return found


def _spaced(text: str, values: str) -> list[sweeps.Value]:
    parts = [_value(each) for each in values.split(':')]
    numbers = [each for each in parts if type(each) in (int, float) and math.isfinite(float(each))]
    if len(parts) != 3 or len(numbers) != 3 or not isinstance(parts[2], int):
        raise InvalidInput(f'--set {text}: START:STOP:COUNT are two numbers and a whole one')
    start, stop, count = float(numbers[0]), float(numbers[1]), parts[2]
    if not 2 <= count <= MOST or start == stop:
        raise InvalidInput(
            f'--set {text}: a COUNT from 2 to {MOST} is needed, and a STOP that is not START'
        )
    # Twelve digits: 0.3 is meant, not 0.30000000000000004.
    spaced = [float(f'{each:.12g}') for each in np.linspace(start, stop, count)]
    whole = all(isinstance(each, int) for each in numbers) and all(
        each.is_integer() for each in spaced
    )
    return [int(each) for each in spaced] if whole else list(spaced)


def _value(text: str) -> sweeps.Value:
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def _tables(folder: pathlib.Path) -> tuple[pathlib.Path, pathlib.Path]:
    return folder / 'trials.csv', folder / 'trials.parquet'


def _notes(rows: list[sweeps.Row]) -> list[str]:
    notes = []
    ended = [row for row in rows if row['verdict']]
    if ended:
        notes.append(
            f'{len(ended)} of {len(rows)} walks ended early and are in no mean;'
            f' the first: {ended[0]["verdict"]}'
        )
    for scene in dict.fromkeys(row['scene'] for row in rows):
        own = sorted({row['rung'] for row in rows if row['scene'] == scene})
        if len(own) > 1:
            notes.append(
                f'{scene} was walked on {" and ".join(own)}: --fidelity {own[-1]} keeps to one'
            )
    return notes


def _flat(point: sweeps.Point) -> dict[str, Any]:
    values = asdict(point)
    names = {'mean': 'distance_per_cycle_m', 'low': 'low_m', 'high': 'high_m'}
    return values.pop('labels') | {names.get(name, name): each for name, each in values.items()}


def _show(points: list[sweeps.Point], sweep: sweeps.Sweep) -> None:
    names = ['scene', *(name for name, each in sweep.parameters.items() if len(each) > 1)]
    heads = [*names, 'policy', 'mm/cycle', '95 % interval', 'walks']
    table = []
    for point in points[:LINES]:
        interval, mean = '-', '-'
        if point.mean is not None:
            mean = f'{1e3 * point.mean:.1f}'
        if point.low is not None and point.high is not None:
            interval = f'{1e3 * point.low:.1f} to {1e3 * point.high:.1f}'
        cells = [_cell(point.labels[name]) for name in names]
        table.append([*cells, point.labels['policy'], mean, interval, str(point.walks)])
    widths = [max(len(row[i]) for row in [heads, *table]) for i in range(len(heads))]
    print()
    for row in [heads, *table]:
        print(
            '  '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )
    if len(points) > LINES:
        print(f'... and {len(points) - LINES} more')
    print()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return '-' if value is None else str(value)
