# SPDX-License-Identifier: Apache-2.0
"""What all commands of ``pad`` have: how they are added, and how a complaint is printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TypeAlias

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it

Commands: TypeAlias = 'argparse._SubParsersAction[argparse.ArgumentParser]'


def add_command(
    commands: Commands,
    name: str,
    run: Callable[[argparse.Namespace], int],
    text: str,
    example: str,
) -> argparse.ArgumentParser:
    """Add a command with its help and an example; return the parser for its arguments."""
    parser = commands.add_parser(
        name,
        help=text,
        description=text,
        epilog=f'example: {example}',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(command=run)
    return parser


def complain(error: object, status: int) -> int:
    """Print an error for the user on stderr; return the exit status."""
    print(f'pad: {error}', file=sys.stderr)
    return status
