# SPDX-License-Identifier: Apache-2.0
"""Draw the figures of the thesis on one page, and judge its statements.

Pictures are PDF and PNG (300 dpi), 85 or 175 mm wide.
"""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

from ros_pad.commands.progress import bar
from ros_pad.commands.report import THESIS, page_for, write_all
from ros_pad.configuration import refuse
from ros_pad.errors import InvalidInput
from studies import command
from studies.thesis import page, statements, verdicts


def main(words: Sequence[str]) -> int:
    """Draw the figures and write the page; return the exit status."""
    parser = command.parser('thesis', __doc__)
    parser.add_argument('--only', type=int, nargs='+', metavar='N', help='figures (default: all)')
    parser.add_argument('--out', type=pathlib.Path, metavar='FILE', help=f'page ({THESIS})')
    parser.add_argument('--figures', type=pathlib.Path, metavar='DIR', help='for PDF and PNG')
    parser.add_argument('--force', action='store_true', help='replace existing files')
    parser.add_argument(
        '--table',
        action='store_true',
        help='write docs/charts/thesis.json and the table of docs/thesis.md, too',
    )
    options = parser.parse_args(words)
    if options.table and options.only:
        raise InvalidInput(
            '--table is not allowed with --only: it has the statements of all figures'
        )
    numbers = tuple(options.only or page.NUMBERS)
    path = page_for(options, pathlib.Path(THESIS))
    for number in numbers if options.figures is not None else ():
        for kind in ('pdf', 'png'):
            refuse(options.figures / f'figure_{number}.{kind}', options.force)
    with bar("the thesis' figures", 1.0, 'page') as progress:
        figures = page.draw(numbers, progress)
    text = () if options.only else statements.claims()
    if options.table:
        verdicts.write(verdicts.document(figures, text))
    return write_all(
        options,
        path,
        lambda out: page.write(figures, out, options.force, text),
        lambda: {f'figure_{each.number}': each.drawn for each in figures},
    )
