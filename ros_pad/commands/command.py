# SPDX-License-Identifier: Apache-2.0
"""Shared by all commands of ``pad``: help, errors, exit status and tables."""

from __future__ import annotations

import argparse
import inspect
import math
import os
import pathlib
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from ros_pad.errors import BagError, ConfigError, InvalidInput, PadError, reason
from ros_pad.signals import INTERRUPTED

UNITS = {
    **{'_n_per_m': 'N/m', '_kg_per_m3': 'kg/m³', '_m2': 'm²', '_m3': 'm³', '_m': 'm'},
    **{'_pa': 'Pa', '_n': 'N', '_deg': '°', '_s': 's'},
}
"""Units of values, by the end of their names in JSON; longer ends first."""

FILE: dict[str, Any] = {'type': pathlib.Path, 'metavar': 'FILE'}
FOLDER: dict[str, Any] = {'type': pathlib.Path, 'metavar': 'DIR'}

Commands: TypeAlias = 'argparse._SubParsersAction[argparse.ArgumentParser]'


class Help(argparse.HelpFormatter):
    """Format help: texts keep their lines; those that are not indented are folded."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return '\n'.join(
            line if line.startswith(' ') else textwrap.fill(line, width)
            for line in text.splitlines()
        )


def prose(doc: str | None) -> str:
    """Return a docstring whose paragraphs are lines; lists and indented lines stay as they are."""
    return re.sub(r'(?<!\n)\n(?![\n -])', ' ', inspect.cleandoc(doc or ''))


def add_command(
    commands: Commands, name: str, run: Callable[[argparse.Namespace], int], doc: str | None
) -> argparse.ArgumentParser:
    """Add a command and return its parser.

    The docstring of its module is the help: description, and as last paragraph examples.
    """
    description, _, examples = prose(doc).rpartition('\n\n')
    parser = commands.add_parser(
        name, description=description, epilog=examples, formatter_class=Help
    )
    parser.register('type', float, partial(_read, float, 'a number in SI units, without a unit,'))
    parser.register('type', int, partial(_read, int, 'a whole number'))
    # Without this, -75e3 would be taken for an option (Python 3.14 has the same pattern).
    parser._negative_number_matcher = re.compile(r'-\.?\d')
    parser.set_defaults(command=run)
    return parser


def _read(kind: type[float] | type[int], needed: str, word: str) -> float:
    """Return an argument as a number, in the form of a ``type`` of argparse."""
    try:
        return kind(word)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{word} is not allowed: {needed} is needed') from None


def exit_status(run: Callable[[], int], program: str = 'pad') -> int:
    """Run a command and return its exit status; print an error that it raises.

    Returns
    -------
    int
        Status that the command returns, or 1 after a failure at run time, 2 after bad usage or
        input, 130 after Ctrl-C or SIGTERM, 0 after the reader of the output has closed it.
    """
    try:
        return run()
    except BrokenPipeError:
        # The reader of the output, for example head, has ended. Without a new file for the output,
        # Python would report an error at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ConfigError, InvalidInput) as error:
        return complain(error, 2, program)
    except BagError as error:
        # A bag that is not valid is bad input; an error of the operating system is a failure.
        return complain(error, 1 if isinstance(error.__cause__, OSError) else 2, program)
    except PadError as error:
        return complain(error, 1, program)
    except OSError as error:
        where = f'{error.filename}: ' if error.filename else ''
        return complain(f'{where}{reason(error)}', 1, program)
    except KeyboardInterrupt:
        return complain('stopped', INTERRUPTED, program)


def complain(error: object, status: int, program: str = 'pad') -> int:
    """Print an error on stderr; return the given exit status."""
    print(f'{program}: {error}', file=sys.stderr)
    return status


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> None:
    """Print a table; the first ``texts`` columns and those without a head are aligned left."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    left = [place < texts or not name for place, name in enumerate(head)]
    for row in (head, *rows):
        cells = [
            cell.ljust(width) if is_text else cell.rjust(width)
            for cell, width, is_text in zip(row, widths, left, strict=True)
        ]
        print('  '.join(cells).rstrip())


def named(name: str, value: Any) -> tuple[str, str]:
    """Return a name of JSON as words, and its value as text with the unit that ends the name."""
    unit = next((each for each in UNITS if name.endswith(each)), '')
    words = name.removesuffix(unit).replace('_', ' ')
    if isinstance(value, list):
        return words, ' to '.join(f'{100.0 * share:+.2g} %' for share in value)
    if not isinstance(value, float):
        return words, str(value)
    return words, 'no answer' if math.isnan(value) else f'{value:.6g} {UNITS.get(unit, "")}'
