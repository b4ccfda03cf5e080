# SPDX-License-Identifier: Apache-2.0
"""Write the page of a bag, of a sweep, or of the thesis' figures; write figures for a paper.

A page is one file that needs no network. Figures are PDF and PNG (300 dpi), 85 or 175 mm wide,
with type of 8 points.

For example:
  pad report runs/hexapod_patches_adaptive_seed0/bag --figures figures
"""

from __future__ import annotations

import argparse
import os
import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING

from ros_pad.commands.command import FILE, FOLDER, Commands, add_command
from ros_pad.commands.progress import bar
from ros_pad.commands.study import run_study
from ros_pad.configuration import refuse
from ros_pad.errors import BagError, InvalidInput
from ros_pad.trials import recorded
from ros_pad.trials import sweep as sweeps

if TYPE_CHECKING:
    from ros_pad.reports.style import Drawn

THESIS = 'thesis_figures.html'
"""Default file name of the page with the thesis' figures."""


def add(commands: Commands) -> None:
    """Add the command and its arguments."""
    part = add_command(commands, 'report', run, __doc__)
    add = part.add_argument
    text = 'folder of a bag or of a sweep'
    add('path', nargs='?', type=pathlib.Path, metavar='PATH', help=text)
    text = "draw the thesis' figures, without PATH; needs a checkout of ros_pad and about 45 s"
    add('--thesis', action='store_true', help=text)
    text = f'page to write (default: report.html beside bag or sweep, or {THESIS} here)'
    add('--out', help=text, **FILE)
    text = 'write each figure into this folder as PDF and PNG; no page without --out'
    add('--figures', help=text, **FOLDER)
    add('--force', action='store_true', help='replace existing files')


def run(options: argparse.Namespace) -> int:
    """Write page and figures and print their paths; return the exit status."""
    if options.thesis:
        if options.path is not None:
            raise InvalidInput(f'--thesis draws no bag or sweep: leave out {options.path}')
        return run_study('thesis', out=options.out, figures=options.figures, force=options.force)
    if options.path is None:
        raise InvalidInput('PATH (folder of a bag or sweep) or --thesis is needed')
    if not options.path.exists():
        raise BagError(f'{options.path}: no such bag or sweep')
    from ros_pad.reports import report, sweep

    where: pathlib.Path = options.path
    if sweeps.is_sweep(where):
        page, found = page_for(options, where / 'report.html'), sweeps.read(where)
        return write_all(
            options,
            page,
            lambda out: sweep.write(found, out, options.force),
            lambda: {'sweep': sweep.drawn(found)},
        )
    page = page_for(options, pathlib.Path(os.path.normpath(where / '..' / 'report.html')))
    with bar('reading', 1.0, 'bag') as progress:
        trial = recorded.load(where, progress=progress)
    return write_all(
        options,
        page,
        lambda out: report.write(trial, out, force=options.force),
        lambda: report.drawn(trial),
    )


def page_for(options: argparse.Namespace, default: pathlib.Path) -> pathlib.Path | None:
    """Return the path of the page; None if only figures are to be written.

    Raises InvalidInput if the page exists and ``--force`` is not given.
    """
    if options.figures is not None and options.out is None:
        return None
    page: pathlib.Path = options.out or default
    refuse(page, options.force)
    return page


def write_all(
    options: argparse.Namespace,
    page: pathlib.Path | None,
    write: Callable[[pathlib.Path], None],
    drawn: Callable[[], dict[str, Drawn]],
) -> int:
    """Write a page (unless it is None) and figures (with ``--figures``); print paths, return 0."""
    from ros_pad.reports.files import write_figures

    if page is not None:
        with bar('report', 1.0, 'page'):
            write(page)
        print(page)
    if options.figures is not None:
        with bar('drawing', 1.0, 'folder'):
            paths = write_figures(drawn(), options.figures, options.force)
        print(*paths, sep='\n')
    return 0
