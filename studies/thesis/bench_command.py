# SPDX-License-Identifier: Apache-2.0
"""Compare one pad of the thesis on its test bench with the measurements, point by point.

Computes a bench scene (inflation, press, tangential), draws its figures (PNG, PDF) and writes a
page and summary.json, in SI units, into a new folder. ``pad run bench_press`` does the same.
"""

from __future__ import annotations

import json
import pathlib
import textwrap
from collections.abc import Sequence
from contextlib import suppress

import matplotlib

from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.contact import Foot
from ros_pad.reports.files import save
from ros_pad.reports.style import PAPER_STYLE, rendered
from studies import command
from studies.thesis import bench, bench_figures, bench_page
from studies.thesis.bench_scene import BenchScene
from studies.thesis.explained import counted

DPI = 200  # of a PNG


def main(words: Sequence[str]) -> int:
    """Compute one bench scene, draw it, write its page; return the exit status.

    Raises
    ------
    InvalidInput
        When the folder exists.
    ConfigError
        For a scene that cannot be read.
    """
    parser = command.parser('bench', __doc__)
    parser.add_argument('scene', metavar='SCENE', help='name of a bench scene, or a YAML file')
    parser.add_argument('--foot', help="a foot other than the scene's: a name or a YAML file")
    parser.add_argument('--out', type=pathlib.Path, metavar='DIR', help='new folder')
    options = parser.parse_args(words)
    foot = None if options.foot is None else Foot.load(options.foot)
    scene = BenchScene.load(options.scene, foot)
    trial = bench.run(scene)
    folder = new_folder(options.out, scene.name)
    try:
        page, files = _write(trial, folder)
    finally:
        with suppress(OSError):  # remove an empty folder, so that the name can be used again
            folder.rmdir()
    summary = trial.as_dict() | {'report': str(page), 'figures': [str(file) for file in files]}
    text = json.dumps(summary, indent=1, allow_nan=False)
    save(folder / 'summary.json', (text + '\n').encode())
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        _show(trial)
        print(f'figures:  {folder}')
        print(f'report:   {page}')
    return 0


def _write(
    trial: bench.BenchTrial, folder: pathlib.Path
) -> tuple[pathlib.Path, list[pathlib.Path]]:
    """Write figures and page; return the page and the figures."""
    page = folder / 'report.html'
    files = []
    with bar('drawing', 100.0, '%') as reach, matplotlib.rc_context(PAPER_STYLE):
        drawn = bench_figures.draw(trial)
        for done, (name, each) in enumerate(drawn.items(), start=1):
            for kind in ('png', 'pdf'):
                file = folder / f'{name}.{kind}'
                save(file, rendered(each.figure, kind, dpi=DPI))
                files.append(file)
            reach(80.0 * done / len(drawn))
        bench_page.write(trial, drawn, page)
    return page, files


def _show(trial: bench.BenchTrial) -> None:
    scene = trial.scene
    print(f'\n{scene.name}, {bench.FIDELITY}: {scene.description}\n')
    lines = [list(bench_page.HEAD), *(bench_page.cells(row) for row in trial.rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    for line in lines:
        print(
            '  '.join(
                text.rjust(width) if 5 <= column <= 7 else text.ljust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
        )
    print(f'\nStatements of the thesis: {counted(trial.claims)}.')
    for claim in trial.claims:
        print(f'\n{claim.where}: {claim.verdict}')
        said = f'{claim.thesis} {claim.printed and f"({claim.printed})"}'
        for who, text in (('thesis', said), ('here', claim.ours), ('rule', claim.reason())):
            print(textwrap.fill(text, 99, initial_indent=f'  {who:8}', subsequent_indent=10 * ' '))
    print()
    for note in trial.notes:
        print(textwrap.fill(note, 99, initial_indent='note:     ', subsequent_indent=10 * ' '))
    for omission in trial.omitted:
        bound = '' if omission.bound is None else f' (at most {100 * omission.bound:.2g} %)'
        print(f'left out: {omission.term}{bound}: {omission.reason}')
