# SPDX-License-Identifier: Apache-2.0
"""``pad chart``: run a work-precision study, which measures time and error of each method."""

from __future__ import annotations

import argparse
import pathlib

from ros_pad.commands.command import Commands, add_command
from ros_pad.commands.study import run_study

CHARTS = ('capillary', 'contact', 'estimator', 'meniscus', 'stability', 'walk')


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'chart',
        run,
        'Measure time, error and failures of every method on this machine; write table, JSON and '
        'pictures. This runs python -m studies NAME, which needs a checkout of ros_pad.',
        'pad chart contact',
    )
    part.add_argument(
        'name',
        choices=CHARTS,
        help='study to run: stability takes 10 s, contact 15 s, walk about a minute, estimator and'
        ' meniscus a minute and a half each, capillary two minutes',
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='DIR',
        help='folder for the results; files of the same name are replaced (default: a new folder '
        'in runs)',
    )
    part.add_argument('--json', action='store_true', help='print one JSON list of rows')


def run(options: argparse.Namespace) -> int:
    """Run the work-precision study; return the exit status."""
    words = ['--out', str(options.out)] if options.out else []
    return run_study(options.name, *words, *(['--json'] if options.json else []))
