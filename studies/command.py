# SPDX-License-Identifier: Apache-2.0
"""Common parts of all studies: options, progress, processes, files."""

from __future__ import annotations

import argparse
import inspect
import json
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from types import ModuleType
from typing import Any, TypeVar

from matplotlib.figure import Figure

from ros_pad.commands.command import Help, prose
from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.reports.files import save
from ros_pad.reports.style import rendered
from studies.machine import machine

ROOT = pathlib.Path(__file__).resolve().parent.parent
CHARTS = ROOT / 'docs' / 'charts'
"""Folder of the pictures and tables of the documentation."""

DPI = 150  # of a PNG

_Item = TypeVar('_Item')
_Result = TypeVar('_Result')


# --- options -------------------------------------------------------------------------------------


def parser(study: str, doc: str | None) -> argparse.ArgumentParser:
    """Return the parser of a study, with its module's docstring as description and ``--json``."""
    part = argparse.ArgumentParser(
        prog=f'python -m studies {study}', description=prose(doc), formatter_class=Help
    )
    part.add_argument('--json', action='store_true', help='print JSON in place of a table')
    return part


def add_out(part: argparse.ArgumentParser, folder: pathlib.Path | None = CHARTS) -> None:
    """Add ``--out DIR``; the default is ``folder``, or a new folder in runs if that is None."""
    shown = 'a new one in runs' if folder is None else folder.relative_to(ROOT)
    part.add_argument(
        '--out',
        type=pathlib.Path,
        default=folder,
        metavar='DIR',
        help=f'folder in which files of the same name are replaced (default: {shown})',
    )


def add_count(
    part: argparse.ArgumentParser, name: str, default: int | None, text: str, least: int = 1
) -> None:
    """Add an option whose value is a whole number of at least ``least``."""

    def number(word: str) -> int:
        if not word.isdecimal() or int(word) < least:
            raise argparse.ArgumentTypeError(
                f'{word!r} is not allowed: a whole number from {least} is needed'
            )
        return int(word)

    part.add_argument(
        name,
        type=number,
        default=default,
        metavar='N',
        help=text if default is None else f'{text} (default: {default})',
    )


def add_processes(part: argparse.ArgumentParser) -> None:
    """Add ``--processes``."""
    add_count(part, '--processes', 2, 'how many processes run at once')


# --- progress and processes ----------------------------------------------------------------------


def each(items: Sequence[_Item], text: str, unit: str) -> Iterator[_Item]:
    """Yield items, and show the number done on stderr."""
    with bar(text, len(items), unit) as reach:
        for done, item in enumerate(items, start=1):
            yield item
            reach(done)


def in_processes(
    task: Callable[..., _Result],
    cases: Sequence[tuple[Any, ...]],
    processes: int,
    text: str,
    unit: str = 'walk',
) -> list[_Result]:
    """Call a task with the arguments of each case, in processes; return results in case order.

    Cases are started in the given order. Progress is shown on stderr. If a case raises, waiting
    cases are cancelled and the error is raised here.
    """
    with ProcessPoolExecutor(processes) as pool, bar(text, len(cases), unit) as reach:
        futures = [pool.submit(task, *case) for case in cases]
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                future.result()
                reach(done)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        return [future.result() for future in futures]


# --- files ---------------------------------------------------------------------------------------


def write(
    folder: pathlib.Path,
    name: str,
    document: Mapping[str, Any],
    pictures: Mapping[str, Figure] | None = None,
) -> dict[str, Any]:
    """Write ``name.json``, with a description of the machine, and pictures; return the JSON."""
    kept = {'machine': machine(), **document}
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(kept, indent=1, ensure_ascii=False)
    save(folder / f'{name}.json', (text + '\n').encode())
    for picture, figure in (pictures or {}).items():
        save(folder / f'{picture}.png', rendered(figure, 'png', dpi=DPI))
    return kept


def pasted(page: str, marks: tuple[str, str], text: str) -> str:
    """Return a page with another text between two marks."""
    before, rest = page.split(marks[0])
    return f'{before}{marks[0]}\n{text}\n{marks[1]}{rest.split(marks[1])[1]}'


def listed(rows: Sequence[Mapping[str, Any]], title: str = '') -> str:
    """Return rows as a table in text, numbers with four digits."""

    def word(value: Any) -> str:
        if isinstance(value, Mapping):
            return ', '.join(f'{key} {word(each)}' for key, each in value.items())
        if isinstance(value, (list, tuple)):
            return ' '.join(map(word, value)) if len(value) <= 6 else f'{len(value)} values'
        return f'{value:.4g}' if isinstance(value, float) else '-' if value is None else str(value)

    names = [*{name: None for row in rows for name in row}]
    lines = [names, *([word(row[name]) if name in row else '' for name in names] for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(names))]
    shown = ('  '.join(map(str.ljust, line, widths)).rstrip() for line in lines)
    return '\n'.join(filter(None, (title, *shown)))


def show(options: argparse.Namespace, document: Any, table: str) -> None:
    """Print the JSON if ``--json`` was given, else the table."""
    print(json.dumps(document, indent=1, ensure_ascii=False) if options.json else table)


def compare_methods(name: str, study: ModuleType, words: Sequence[str]) -> int:
    """Run a work-precision study: measure, print its table, write JSON and pictures.

    Parameters
    ----------
    name : str
        Name of the study, and of its JSON file.
    study : module
        Module with ``measure``, ``figures`` and, for a table of its own form, ``table``.
    words : sequence of str
        Arguments of the command line.

    Returns
    -------
    int
        Exit status.
    """
    part = parser(name, study.__doc__)
    add_out(part, None)
    brief = 'cycles' in inspect.signature(study.measure).parameters
    if brief:
        add_count(part, '--cycles', None, 'gait cycles of each walk, for a short run')
    options = part.parse_args(words)
    chosen = {'cycles': options.cycles} if brief else {}
    folder = options.out or new_folder(None, f'chart_{name}')
    with bar(f'{name}: measuring', 100.0, '%') as reach:
        results = study.measure(lambda share: reach(100.0 * share), **chosen)
    with bar(f'{name}: drawing', 100.0, '%') as reach:
        pictures = study.figures(results, lambda share: reach(100.0 * share))
    rows = [vars(result) for result in results]
    write(folder, name, {'rows': rows}, pictures)
    if options.json:
        print(json.dumps(rows))
        return 0
    print(study.table(results) if hasattr(study, 'table') else listed(rows))
    print(f'table and pictures: {folder}')
    return 0
