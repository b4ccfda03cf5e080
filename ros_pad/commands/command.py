# SPDX-License-Identifier: Apache-2.0
"""What all commands of ``pad`` have: how they are added, and how a complaint is printed."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import textwrap
from collections.abc import Callable
from typing import TypeAlias

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it
WIDEST = 98  # columns of help, however wide the terminal

Commands: TypeAlias = 'argparse._SubParsersAction[argparse.ArgumentParser]'


class Help(argparse.HelpFormatter):
    """Help whose descriptions keep their lines and columns, but are never wider than the page.

    A line that is too long goes on below its last column; one that is a command goes on after a
    backslash, so that it can be pasted into a shell.
    """

    def __init__(self, prog: str) -> None:
        width = min(shutil.get_terminal_size().columns - 2, WIDEST)
        super().__init__(prog, max_help_position=30, width=width)

    def add_argument(self, action: argparse.Action) -> None:
        """Add an argument to what the columns are measured by."""
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):
            # argparse forgets that commands are indented, and breaks the line of the longest.
            self._action_max_length += self._indent_increment

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return '\n'.join(_folded(indent + line, width) for line in text.splitlines())


def _folded(line: str, width: int) -> str:
    margin = line[: len(line) - len(line.lstrip())]
    if len(line) <= width:
        return line
    if not line[len(margin) :].startswith('pad '):
        # Below the second column of a list, if this is one.
        column = re.match(r'\s*(\S+(?: \S+)*\s{2,})?', line)
        hanging = ' ' * len(column[0]) if column else margin
        return textwrap.fill(line, width, subsequent_indent=hanging, drop_whitespace=True)
    rows = textwrap.wrap(
        line.strip(),
        width - len(margin) - 6,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return f' \\\n{margin}    '.join([margin + rows[0], *rows[1:]])


def add_command(
    commands: Commands,
    name: str,
    run: Callable[[argparse.Namespace], int],
    text: str,
    example: str,
) -> argparse.ArgumentParser:
    """Add a command with its help and an example in each line; return its parser."""
    lines = [line.strip() for line in example.splitlines()]
    parser = commands.add_parser(
        name,
        description=text,
        epilog='\n  '.join(['example:' if len(lines) == 1 else 'examples:', *lines]),
        formatter_class=Help,
    )
    parser.set_defaults(command=run)
    return parser


def complain(error: object, status: int) -> int:
    """Print an error for the user on stderr; return the exit status."""
    print(f'pad: {error}', file=sys.stderr)
    return status
