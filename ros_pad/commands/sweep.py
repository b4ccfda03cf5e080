# SPDX-License-Identifier: Apache-2.0
r"""Run every combination of scenes, policies, seeds and parameters, without ROS.

It runs on all cores or on a Dask cluster, and writes trials.csv, a picture with confidence
intervals, and a page. A sweep that was stopped or killed continues when the same command is given
again with --out and its folder; seeds, policies, scenes and values may be added.

NAME of --set is a key of the scene's YAML, with dots between levels (tow.weight, N; cycles), or a
parameter of the estimator node (filter_period, s) or of the adaptive policy (policy.wet_above).
The first NAME with several values is the axis of the picture.

For example:
  pad sweep hexapod_patches --policy flat,dome,adaptive --seed 0:9 \
      --set tow.weight=3:12:4 --set floor.wet_fraction=0.2,0.5 --out towing
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import pathlib
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ros_pad.commands.command import FOLDER, Commands, add_command, complain, print_table
from ros_pad.commands.folder import kept_if_filled, new_folder
from ros_pad.commands.progress import bar
from ros_pad.configuration import integer
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.signals import INTERRUPTED
from ros_pad.simulation import fidelity as levels
from ros_pad.trials import sweep as sweeps

TABLES = ('.csv', '.parquet')
LINES = 60  # largest number of rows of the table on the screen
MOST = 100_000  # largest number of values in a range, and of seeds in FIRST:LAST


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'sweep', run, __doc__)
    add = part.add_argument
    add('scenes', metavar='SCENE', nargs='+', help='names of scenes, or YAML files')
    add('--policy', metavar='NAMES', help="flat,dome,adaptive,oracle (default: each scene's own)")
    text = 'seeds of floor and noise, with commas, or FIRST:LAST (default 0:4)'
    add('--seed', default='0:4', metavar='LIST', help=text)
    text = 'values with commas, or START:STOP:COUNT with both ends, SI; may be repeated'
    add('--set', action='append', default=[], metavar='NAME=VALUES', help=text)
    add('--fidelity', choices=levels.FIDELITIES, default='auto', help='level; auto chooses it')
    where = part.add_mutually_exclusive_group()
    where.add_argument('--workers', type=int, help='number of processes (default: one for a core)')
    text = 'address of a Dask scheduler (tcp://host:8786) to run on'
    where.add_argument('--scheduler', metavar='ADDRESS', help=text)
    add('--retry', action='store_true', help='also run failed trials again')
    add('--out', help='new folder, or that of this sweep, which continues', **FOLDER)
    add('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Run the sweep, write its table, picture and page; return the exit status."""
    sweep = sweeps.Sweep(
        options.scenes,
        () if options.policy is None else options.policy.split(','),
        seeds(options.seed),
        parameters(options.set),
        options.fidelity,
    )
    total = len(sweep.jobs())  # invalid input is an error before a folder is created
    folder = new_folder(None, 'sweep') if options.out is None else options.out
    print(f'{total} trials; after a stop, --out {folder} continues them', file=sys.stderr)
    try:
        with kept_if_filled(folder), bar('sweep', total, 'trials') as show:
            rows = sweeps.run(
                sweep, folder, options.workers, options.scheduler, show, options.retry
            )
    except KeyboardInterrupt:
        return complain(f'stopped: --out {folder} continues what is done there', INTERRUPTED)
    return _report(options, folder, rows)


def _report(options: argparse.Namespace, folder: pathlib.Path, rows: list[sweeps.Row]) -> int:
    """Write picture and page, print the means of the trials; return the exit status."""
    points, notes = sweeps.points(rows, parameters(options.set)), []
    failed = [row['error'] for row in rows if row['error']]
    ended = [row['verdict'] for row in rows if row['verdict']]
    if ended:
        notes.append(
            f'{len(ended)} of {len(rows)} walks ended early and are left out of the means;'
            f' the first because of: {ended[0]}'
        )
    picture = report = None
    try:
        from ros_pad.reports import sweep as pages
        from ros_pad.reports.files import write_picture

        found = sweeps.read(folder)
        report = folder / 'report.html'
        pages.write(found, report, force=True)
        write_picture(folder / 'sweep.png', lambda: pages.drawn(found).figure)
        picture = folder / 'sweep.png'
    except (ConfigError, InvalidInput) as error:
        notes.append(f'no picture: {error}')
    tables = sorted(str(each) for each in folder.glob('trials.*') if each.suffix in TABLES)
    if options.json:
        summary = {
            'folder': str(folder),
            'trials': len(rows),
            'failed': len(failed),
            'ended_early': len(ended),
            'tables': tables,
            'picture': picture and str(picture),
            'report': report and str(report),
            'notes': notes,
            'points': [_flat(point) for point in points],
        }
        print(json.dumps(summary))
    else:
        _show(points)
        print(*notes, *tables, *filter(None, (picture, report)), sep='\n')
    if failed:
        words = f'{len(failed)} of {len(rows)} trials failed, the first with: {failed[0]}'
        return complain(words, 1)
    return 0


def seeds(text: str) -> list[int]:
    """Return the seeds in a list such as ``0,1,5:9``; raise InvalidInput for any other text."""
    found: list[int] = []
    for part in text.split(','):
        ends = part.split(':')
        if len(ends) > 2 or not all(end.strip().isdecimal() for end in ends):
            raise InvalidInput(
                f'--seed {text}: {part!r} is neither a whole number from 0 nor FIRST:LAST'
            )
        first, last = int(ends[0]), int(ends[-1])
        integer(f'--seed {text}: LAST', last, first, first + MOST - 1)
        found += range(first, last + 1)
    return found


def pairs(option: str, texts: Sequence[str], sign: str) -> dict[str, str]:
    """Return names and values of texts with a sign between; raise InvalidInput for others."""
    found: dict[str, str] = {}
    for text in texts:
        name, _, value = text.partition(sign)
        if not name or not value:
            raise InvalidInput(f'{option} {text}: NAME{sign}VALUE is needed')
        if name in found:
            raise InvalidInput(f'{option} {text}: {name} is given twice')
        found[name] = value
    return found


def parameters(texts: Sequence[str]) -> dict[str, list[sweeps.Value]]:
    """Return the values by name from texts ``NAME=VALUES``; raise InvalidInput for other texts."""
    found = {}
    for name, values in pairs('--set', texts, '=').items():
        parts = [typed(each.strip()) for each in values.split(':' if ':' in values else ',')]
        found[name] = _spaced(f'{name}={values}', parts) if ':' in values else parts
    return found


def _spaced(text: str, parts: Sequence[sweeps.Value]) -> list[sweeps.Value]:
    """Return the values of START, STOP and COUNT, with both ends."""
    numbers = [each for each in parts if not isinstance(each, str) and math.isfinite(each)]
    if len(parts) != 3 or len(numbers) != 3 or not isinstance(parts[2], int):
        raise InvalidInput(
            f'--set {text}: START:STOP:COUNT needs two finite numbers and a whole number'
        )
    start, stop, count = numbers
    integer(f'--set {text}: COUNT', parts[2], 2, MOST)
    if start == stop:
        raise InvalidInput(f'--set {text}: a STOP other than START is needed')
    # Round to twelve digits: 0.3, not 0.30000000000000004.
    spaced = [float(f'{each:.12g}') for each in np.linspace(start, stop, int(count))]
    if isinstance(start, int) and isinstance(stop, int) and all(map(float.is_integer, spaced)):
        return [int(each) for each in spaced]
    return [*spaced]


def typed(text: str) -> sweeps.Value:
    """Return a value as it is typed: a whole number, a number or a text."""
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


def _flat(point: sweeps.Point) -> dict[str, Any]:
    values = asdict(point)
    names = {'mean': 'distance_per_cycle_m', 'low': 'low_m', 'high': 'high_m'}
    return values.pop('labels') | {names.get(name, name): each for name, each in values.items()}


def _show(points: list[sweeps.Point]) -> None:
    """Print a row for each condition, with the parameters that have several values."""
    labels = [point.labels for point in points]
    several = [name for name in labels[0] if len({str(each[name]) for each in labels}) > 1]
    names = ['scene', *(each for each in several if each not in ('scene', 'policy')), 'policy']
    table = []
    for point in points[:LINES]:
        ends = [f'{1e3 * end:.1f}' for end in (point.low, point.high) if end is not None]
        mean = '-' if point.mean is None else f'{1e3 * point.mean:.1f}'
        cells = [_cell(point.labels[name]) for name in names]
        table.append([*cells, mean, ' to '.join(ends) or '-', str(point.walks)])
    print()
    print_table([*names, 'mm/cycle', '95 % interval', 'walks'], table, len(names))
    if len(points) > LINES:
        print(f'... and {len(points) - LINES} more')
    print()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return '-' if value is None else str(value)
