# SPDX-License-Identifier: Apache-2.0
"""``pad sweep``: run every combination of scenes, policies, seeds and parameters."""

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

from ros_pad.commands.command import INTERRUPTED, Commands, add_command, complain, print_table
from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation import fidelity as levels
from ros_pad.trials import sweep as sweeps

LINES = 60  # largest number of rows of the table on the screen
MOST = 100_000  # largest number of values in a range, and of seeds in FIRST:LAST
_TABLES = ('trials.csv', 'trials.parquet')


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'sweep',
        run,
        'Run every combination of scenes, policies, seeds and parameters, without ROS, on all '
        'cores or on a Dask cluster; write trials.csv, a picture with confidence intervals, and a '
        'page.\nA sweep that was stopped or killed continues when the same command is given again '
        'with --out and its folder; seeds, policies, scenes and values may be added.',
        'pad sweep hexapod_patches --policy flat,dome,adaptive --seed 0:9 '
        '--set tow.weight=3:12:4 --set floor.wet_fraction=0.2,0.5 --out towing',
    )
    part.add_argument(
        'scenes', metavar='SCENE', nargs='+', help='names of scenes, or paths of YAML files'
    )
    part.add_argument(
        '--policy',
        metavar='NAMES',
        help='flat, dome, adaptive, oracle, with commas between several '
        "(default: each scene's own)",
    )
    part.add_argument(
        '--seed',
        default='0:4',
        metavar='LIST',
        help='seeds of floor and noise, 0 to 2147483647: a list with commas, or FIRST:LAST'
        ' (default 0:4, five seeds)',
    )
    _add_parameters(part)
    _add_execution(part)
    part.add_argument('--json', action='store_true', help='print one JSON object')


def _add_parameters(part: argparse.ArgumentParser) -> None:
    part.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUES',
        help='values with commas, or START:STOP:COUNT with both ends, in SI units. NAME is a key '
        "of the scene's YAML, with dots between levels (tow.weight, N; cycles), or a parameter of "
        'the estimator node (filter_period, s) or of the adaptive policy (policy.wet_above). May '
        'be given more than once; the first NAME with several values is the axis of the picture',
    )
    part.add_argument(
        '--fidelity',
        choices=levels.FIDELITIES,
        default='auto',
        help='fidelity level; auto (default) chooses it for each scene and its parameters',
    )


def _add_execution(part: argparse.ArgumentParser) -> None:
    where = part.add_mutually_exclusive_group()
    where.add_argument(
        '--workers',
        type=int,
        metavar='N',
        help='number of processes, from 1 (default: one for each core)',
    )
    where.add_argument(
        '--scheduler',
        metavar='ADDRESS',
        help='address of a Dask scheduler on whose cluster to run (tcp://host:8786)',
    )
    part.add_argument(
        '--retry', action='store_true', help='also run trials again that failed before'
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='DIR',
        help='new folder, or the folder of this sweep, which continues (default: runs/sweep...)',
    )


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
    done = 0.0
    try:
        with bar('sweep', total, 'trials') as show:

            def progress(now: float) -> None:
                nonlocal done
                done = now
                show(now)

            rows = sweeps.run(
                sweep, folder, options.workers, options.scheduler, progress, options.retry
            )
    except KeyboardInterrupt:
        return complain(
            f'stopped: {done:.0f} of {total} trials are in {folder};'
            f' the same command with --out {folder} continues',
            INTERRUPTED,
        )
    finally:
        # Remove the folder if it is empty, so that its name can be used again.
        with contextlib.suppress(OSError):
            folder.rmdir()
    return _report(options, sweep, folder, rows)


def _report(
    options: argparse.Namespace,
    sweep: sweeps.Sweep,
    folder: pathlib.Path,
    rows: list[sweeps.Row],
) -> int:
    """Write picture and page, print the means of the trials; return the exit status."""
    points, notes = sweeps.points(rows, sweep.parameters), _notes(rows)
    files = [path for path in (folder / name for name in _TABLES) if path.exists()]
    summary: dict[str, Any] = {
        'folder': str(folder),
        'trials': len(rows),
        'failed': sum(bool(row['error']) for row in rows),
        'ended_early': sum(bool(row['verdict']) for row in rows),
        'tables': [str(path) for path in files],
        'picture': None,
        'report': None,
    }
    try:
        from ros_pad.reports import sweep_page
        from ros_pad.reports.sweep import draw

        page = folder / 'report.html'
        sweep_page.write(sweeps.read(folder), page, force=True)
        summary['report'] = str(page)
        draw(folder / 'sweep.png', points, sweep)
        summary['picture'] = str(folder / 'sweep.png')
    except (ConfigError, InvalidInput) as error:
        notes.append(f'no picture: {error}')
    files += [pathlib.Path(summary[name]) for name in ('picture', 'report') if summary[name]]
    if options.json:
        more = {'notes': notes, 'points': [_flat(p) for p in points]}
        print(json.dumps(summary | more))
    else:
        _show(points, sweep)
        print(*notes, *files, sep='\n')
    failed = [row for row in rows if row['error']]
    if failed:
        return complain(
            f'{len(failed)} of {len(rows)} trials failed, the first with: {failed[0]["error"]}', 1
        )
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
        if not 0 <= last - first < MOST:
            raise InvalidInput(
                f'--seed {text}: {part!r} is not allowed: LAST from FIRST to'
                f' FIRST + {MOST - 1} is needed'
            )
        found += range(first, last + 1)
    return found


def parameters(texts: list[str]) -> dict[str, list[sweeps.Value]]:
    """Return the values by name from texts ``NAME=VALUES``; raise InvalidInput for other texts."""
    found: dict[str, list[sweeps.Value]] = {}
    for text in texts:
        name, equals, values = text.partition('=')
        if not equals or not name or not values:
            raise InvalidInput(
                f'--set {text}: NAME=VALUE,VALUE or NAME=START:STOP:COUNT is needed'
            )
        if name in found:
            raise InvalidInput(f'--set {text}: {name} is given twice')
        if ':' in values:
            found[name] = _spaced(text, values)
        else:
            found[name] = [_value(each.strip()) for each in values.split(',')]
    return found


def _spaced(text: str, values: str) -> list[sweeps.Value]:
    parts = [_value(each) for each in values.split(':')]
    numbers = [each for each in parts if type(each) in (int, float) and math.isfinite(float(each))]
    if len(parts) != 3 or len(numbers) != 3 or not isinstance(parts[2], int):
        raise InvalidInput(
            f'--set {text}: START:STOP:COUNT needs two finite numbers and a whole number'
        )
    start, stop, count = float(numbers[0]), float(numbers[1]), parts[2]
    if not 2 <= count <= MOST or start == stop:
        raise InvalidInput(
            f'--set {text}: a COUNT from 2 to {MOST} is needed, and a STOP other than START'
        )
    # Round to twelve digits: 0.3, not 0.30000000000000004.
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


def _notes(rows: list[sweeps.Row]) -> list[str]:
    notes = []
    ended = [row for row in rows if row['verdict']]
    if ended:
        notes.append(
            f'{len(ended)} of {len(rows)} walks ended early and are left out of the means;'
            f' the first because of: {ended[0]["verdict"]}'
        )
    for scene in dict.fromkeys(row['scene'] for row in rows):
        own = sorted({row['level'] for row in rows if row['scene'] == scene})
        if len(own) > 1:
            notes.append(f'{scene} ran on {" and ".join(own)}: --fidelity {own[-1]} uses only one')
    return notes


def _flat(point: sweeps.Point) -> dict[str, Any]:
    values = asdict(point)
    names = {'mean': 'distance_per_cycle_m', 'low': 'low_m', 'high': 'high_m'}
    return values.pop('labels') | {names.get(name, name): each for name, each in values.items()}


def _show(points: list[sweeps.Point], sweep: sweeps.Sweep) -> None:
    names = ['scene', *(name for name, each in sweep.parameters.items() if len(each) > 1)]
    head = [*names, 'policy', 'mm/cycle', '95 % interval', 'walks']
    table = []
    for point in points[:LINES]:
        interval, mean = '-', '-'
        if point.mean is not None:
            mean = f'{1e3 * point.mean:.1f}'
        if point.low is not None and point.high is not None:
            interval = f'{1e3 * point.low:.1f} to {1e3 * point.high:.1f}'
        cells = [_cell(point.labels[name]) for name in names]
        table.append([*cells, point.labels['policy'], mean, interval, str(point.walks)])
    print()
    print_table(head, table, len(names) + 1)
    if len(points) > LINES:
        print(f'... and {len(points) - LINES} more')
    print()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return '-' if value is None else str(value)
