# SPDX-License-Identifier: Apache-2.0
"""Measure time, error and failures of every method on this machine.

This runs python -m studies NAME, which needs a checkout of ros_pad and writes table, JSON and
pictures.

For example:
  pad chart contact
"""

from __future__ import annotations

import argparse

from ros_pad.commands.command import FOLDER, Commands, add_command
from ros_pad.commands.study import run_study

CHARTS = ('capillary', 'contact', 'estimator', 'meniscus', 'stability', 'walk')


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'chart', run, __doc__)
    add = part.add_argument
    add('name', choices=CHARTS, help='study to run; they take from 10 s to two minutes')
    add('--out', help='folder, in which files are replaced (default: a new one in runs)', **FOLDER)
    add('--json', action='store_true', help='print one JSON list of rows')


def run(options: argparse.Namespace) -> int:
    """Run the work-precision study; return the exit status."""
    return run_study(options.name, out=options.out, json=options.json)
