# SPDX-License-Identifier: Apache-2.0
"""``pad doctor``: what is wrong with this machine, and what to do."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from dataclasses import asdict

from ros_pad.commands.command import WIDEST
from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.doctor import LOOPBACK
from ros_pad.doctor import Finding
from ros_pad.doctor import examine

_DESCRIPTION = f"""\
Check Python, packages, ROS 2, its middleware, serial ports, disk and terminal; say what to do.
Two processes exchange a message, with the ROS settings of this shell, within {LOOPBACK:g} s.

  ok       as it should be
  warning  something does not work that not everybody needs
  problem  mend this; the exit status is then 1"""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'doctor', run, _DESCRIPTION, 'pad doctor\npad doctor --json')
    part.add_argument('--json', action='store_true', help='print one JSON object')


def run(options: argparse.Namespace) -> int:
    """Look at everything and print it; return the exit status."""
    findings = _findings()
    problems = sum(each.status == 'problem' for each in findings)
    warnings = sum(each.status == 'warning' for each in findings)
    if options.json:
        print(
            json.dumps(
                {
                    'problems': problems,
                    'warnings': warnings,
                    'findings': [asdict(each) for each in findings],
                }
            )
        )
    else:
        for each in findings:
            _show(each)
        print(f'\nproblems: {problems}, warnings: {warnings}')
    return 1 if problems else 0


def _findings() -> list[Finding]:
    try:
        from ros_pad.commands.progress import bar
    except ImportError:  # the missing package is among the findings
        return list(examine())
    with bar('looking', 1.0, 'machine') as progress:
        return list(examine(progress))


def _show(finding: Finding) -> None:
    width = min(shutil.get_terminal_size().columns, WIDEST)
    head = f'{finding.status:8} {finding.what}: '
    print(_folded(head + finding.found, width))
    if finding.advice:
        print(_folded(f'{"":9}-> {finding.advice}', width))


def _folded(text: str, width: int) -> str:
    # Paths and settings are to be copied in one piece.
    return textwrap.fill(
        text, width, subsequent_indent=' ' * 12, break_long_words=False, break_on_hyphens=False
    )
