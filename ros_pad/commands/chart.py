# SPDX-License-Identifier: Apache-2.0
"""``pad chart``: speed against accuracy of every way to solve a problem."""

from __future__ import annotations

import argparse
import json
import pathlib
from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import asdict
from types import ModuleType
from typing import Any

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.ladders import capillary
from ros_pad.ladders import contact
from ros_pad.ladders import estimator
from ros_pad.ladders import meniscus
from ros_pad.ladders import stability
from ros_pad.ladders import walk
from ros_pad.ladders.ladder import machine
from ros_pad.ladders.ladder import table

LADDERS: dict[str, ModuleType] = {
    'capillary': capillary,
    'contact': contact,
    'estimator': estimator,
    'meniscus': meniscus,
    'stability': stability,
    'walk': walk,
}
# What is no ladder of time against one error has a table of its own.
TABLES: dict[str, Callable[[Sequence[Any]], str]] = {
    'capillary': capillary.table,
    'estimator': estimator.table,
    'stability': stability.table,
    'walk': walk.table,
}


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'chart',
        run,
        'Measure a ladder of methods here and now: time, error, failures; table, JSON, pictures.',
        'pad chart contact',
    )
    part.add_argument(
        'ladder',
        choices=(*LADDERS, 'all'),
        help='capillary and walk take about a minute each, contact 15 s, estimator and meniscus a'
        ' minute and a half each, stability 10 s',
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='DIR',
        help='folder in which files of the same name are replaced (default: a new one in runs)',
    )
    part.add_argument('--json', action='store_true', help='print one JSON list of rows')


def run(options: argparse.Namespace) -> int:
    """Measure, print and draw; return the exit status."""
    names = list(LADDERS) if options.ladder == 'all' else [options.ladder]
    if options.out is None:
        folder = new_folder(None, f'chart_{options.ladder}')
    else:
        folder = options.out
        folder.mkdir(parents=True, exist_ok=True)
    every = []
    for name in names:
        ladder = LADDERS[name]
        with bar(f'{name}: measuring', 100.0, '%') as reach:
            rungs = ladder.measure(lambda share, reach=reach: reach(100.0 * share))
        with bar(f'{name}: drawing', 100.0, '%') as reach:
            pictures = ladder.figures(rungs, lambda share, reach=reach: reach(100.0 * share))
            for picture, figure in pictures.items():
                figure.savefig(folder / f'{picture}.png', dpi=150)
        rows = [asdict(rung) for rung in rungs]
        every += rows
        (folder / f'{name}.json').write_text(
            json.dumps({'machine': machine(), 'rows': rows}, indent=1) + '\n', encoding='utf-8'
        )
        if not options.json:
            print(TABLES.get(name, table)(rungs))
    if options.json:
        print(json.dumps(every))
    else:
        print(f'table and pictures: {folder}')
    return 0
