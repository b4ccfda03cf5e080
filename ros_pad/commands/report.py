# SPDX-License-Identifier: Apache-2.0
"""``pad report``: the HTML page of a bag, of a sweep or of the thesis' figures, and figures."""

from __future__ import annotations

import argparse
import os
import pathlib
from collections.abc import Callable

from ros_pad.commands.command import Commands
from ros_pad.commands.command import add_command
from ros_pad.commands.progress import bar
from ros_pad.errors import BagError
from ros_pad.errors import InvalidInput
from ros_pad.trials import recorded
from ros_pad.trials import report
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import write_figures

THESIS = 'thesis_figures.html'


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(
        commands,
        'report',
        run,
        'Write the HTML report of a bag or of a sweep, or a page with our versions of the '
        "thesis' figures; and figures for a paper.",
        'pad report runs/hexapod_patches_adaptive_seed0/bag --figures figures',
    )
    part.description = (
        f'{part.description}\nA page is one file that needs no network; a walk can be played in '
        'it.\nFigures are PDF and PNG (300 dpi), 85 or 175 mm wide, with type of 8 points.'
    )
    part.add_argument(
        'path', metavar='PATH', nargs='?', type=pathlib.Path, help='folder of a bag or of a sweep'
    )
    part.add_argument(
        '--thesis',
        action='store_true',
        help="draw the thesis' figures, without PATH; all of them take about 45 s",
    )
    part.add_argument(
        '--only', type=int, nargs='+', metavar='N', help='with --thesis: figures of these numbers'
    )
    part.add_argument(
        '--out',
        type=pathlib.Path,
        metavar='FILE',
        help='page (default: report.html beside the bag, report.html in the folder of a sweep, '
        f'{THESIS} here; none with --figures)',
    )
    part.add_argument(
        '--figures',
        type=pathlib.Path,
        metavar='DIR',
        help='write each figure there as PDF and PNG; the page then only with --out',
    )
    part.add_argument('--force', action='store_true', help='replace files that are there')


def run(options: argparse.Namespace) -> int:
    """Write page and figures, say where; return the exit status."""
    if options.only and not options.thesis:
        raise InvalidInput('--only: chooses among the figures of --thesis, which is not given')
    if options.thesis:
        if options.path is not None:
            raise InvalidInput(f'--thesis: draws from the models, and takes no {options.path}')
        return _of_thesis(options)
    if options.path is None:
        raise InvalidInput('PATH or --thesis: one of them is needed')
    if not options.path.exists():
        raise BagError(f'{options.path}: no such bag or sweep')
    # Figures import much: only where they are asked for.
    from ros_pad.figures import sweep_page

    if sweep_page.is_sweep(options.path):
        page = _page(options, options.path / 'report.html')
        found = sweep_page.read(options.path)
        return _write(
            options,
            page,
            lambda out: sweep_page.write(found, out, options.force),
            lambda: sweep_page.draw(found),
        )
    page = _page(options, pathlib.Path(os.path.normpath(options.path / '..' / 'report.html')))
    with bar('reading', 1.0, 'bag') as progress:
        trial = recorded.load(options.path, progress=progress)

    def write(out: pathlib.Path) -> None:
        with bar('report', 1.0, 'page') as progress:
            report.write(trial, out, force=options.force, progress=progress)

    def drawn() -> dict[str, Drawn]:
        with bar('figures', 1.0, 'trial') as progress:
            return report.drawn(trial, progress=progress)

    return _write(options, page, write, drawn)


def _of_thesis(options: argparse.Namespace) -> int:
    from ros_pad.figures import thesis_page

    numbers = tuple(options.only or thesis_page.NUMBERS)
    page = _page(options, pathlib.Path(THESIS))
    names = [f'figure_{number}' for number in numbers]
    for name in names if options.figures is not None else []:
        for kind in ('pdf', 'png'):
            _refuse(options.figures / f'{name}.{kind}', options.force)
    with bar("the thesis' figures", 1.0, 'page') as progress:
        figures = thesis_page.draw(numbers, progress)
    return _write(
        options,
        page,
        lambda out: thesis_page.write(figures, out, options.force),
        lambda: {f'figure_{each.number}': each.drawn for each in figures},
    )


def _page(options: argparse.Namespace, default: pathlib.Path) -> pathlib.Path | None:
    """Return the page that is wanted; None for figures alone."""
    if options.figures is not None and options.out is None:
        return None
    page: pathlib.Path = options.out or default
    _refuse(page, options.force)
    return page


def _refuse(path: pathlib.Path, force: bool) -> None:
    if path.exists() and not force:
        raise InvalidInput(f'{path}: exists already; --force replaces it, --out names another')


def _write(
    options: argparse.Namespace,
    page: pathlib.Path | None,
    write: Callable[[pathlib.Path], None],
    drawn: Callable[[], dict[str, Drawn]],
) -> int:
    if page is not None:
        write(page)
        print(page)
    if options.figures is not None:
        for path in write_figures(drawn(), options.figures, options.force):
            print(path)
    return 0
