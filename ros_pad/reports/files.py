# SPDX-License-Identifier: Apache-2.0
"""Write the files of pages and figures, completely or not at all; protect existing files."""

from __future__ import annotations

import contextlib
import os
import pathlib
from collections.abc import Callable, Mapping

import matplotlib
from matplotlib.figure import Figure

from ros_pad.configuration import choice, refuse
from ros_pad.errors import PadError
from ros_pad.reports.style import DPI, PAPER_STYLE, Drawn, rendered


def save(path: str | os.PathLike[str], data: bytes, new_folder: bool = True) -> None:
    """Write a file completely or not at all; create its folder if ``new_folder`` is True.

    Raises PadError if the file cannot be written.
    """
    path = pathlib.Path(path)
    new = path.with_name(path.name + '.new')
    try:
        if new_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        new.write_bytes(data)
        new.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            new.unlink()
        raise PadError(f'{path}: cannot be written: {error.strerror}') from error


def write_picture(path: str | os.PathLike[str], draw: Callable[[], Figure]) -> None:
    """Draw a figure in :data:`PAPER_STYLE` and write it; an existing file is replaced.

    Parameters
    ----------
    path : path
        Ends in .png, .svg or .pdf.
    draw : callable
        Returns the figure; a PNG has 200 dots per inch of it.

    Raises
    ------
    InvalidInput
        When the path has another ending.
    PadError
        When the file cannot be written.
    """
    path = pathlib.Path(path)
    ending = choice(f'ending of {path}', path.suffix, ('.png', '.svg', '.pdf'))
    with matplotlib.rc_context(PAPER_STYLE):
        save(path, rendered(draw(), ending[1:], dpi=200), new_folder=False)


def write_figures(
    drawn: Mapping[str, Drawn], folder: str | os.PathLike[str], force: bool = False
) -> list[pathlib.Path]:
    """Write figures for a paper, each as PDF and as PNG of 300 dpi, and return the files.

    The same figures give the same bytes. Nothing is written when one of the files exists.

    Parameters
    ----------
    drawn : mapping of str to Drawn
        Figures, drawn in :data:`PAPER_STYLE`, by file name without ending.
    folder : path
        Created if it is missing.
    force : bool
        Replace existing files.

    Raises
    ------
    InvalidInput
        When a file exists and ``force`` is False.
    PadError
        When a file cannot be written.
    """
    files = {
        pathlib.Path(folder) / f'{name}.{kind}': (each.figure, kind)
        for name, each in drawn.items()
        for kind in ('pdf', 'png')
    }
    for path in files:
        refuse(path, force)
    with matplotlib.rc_context(PAPER_STYLE):
        for path, (figure, kind) in files.items():
            save(path, rendered(figure, kind, dpi=DPI))
    return list(files)
