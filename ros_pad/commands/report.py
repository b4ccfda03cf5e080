# SPDX-License-Identifier: Apache-2.0
"""``pad report``: the HTML page of a bag."""

from __future__ import annotations

import argparse
import os
import pathlib

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.progress import bar
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.trials import recorded
from ros_pad.trials import report


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'report',
        run,
        'Write the HTML report of a bag.',
        'pad report runs/hexapod_patches_adaptive_seed0/bag --force',
    )
    part.add_argument('bag', metavar='BAG', type=pathlib.Path, help='folder of a bag')
    part.add_argument(
        '--out', type=pathlib.Path, metavar='FILE', help='default: report.html beside the bag'
    )
    part.add_argument('--force', action='store_true', help='replace a report that is there')


def run(options: argparse.Namespace) -> int:
    """Write the report; return the exit status."""
    page = options.out or options.bag / '..' / 'report.html'
    page = pathlib.Path(os.path.normpath(page))
    if not options.bag.exists():
        raise BagError(f'{options.bag}: no such bag')
    if page.exists() and not options.force:
        raise InvalidInput(f'{page}: exists already; --force replaces it, --out names another')
    with bar('reading', 1.0, 'bag') as progress:
        trial = recorded.load(options.bag, progress=progress)
    with bar('report', 1.0, 'page') as progress:
        report.write(trial, page, force=options.force, progress=progress)
    print(page)
    return 0
