# SPDX-License-Identifier: Apache-2.0
"""``pad run`` of a bench scene: figures of the thesis, point by point beside measurements."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import textwrap
from contextlib import suppress

import matplotlib

from ros_pad.commands.folder import new_folder
from ros_pad.commands.progress import bar
from ros_pad.contact import Foot
from ros_pad.errors import InvalidInput
from ros_pad.figures import bench as bench_page
from ros_pad.figures import thesis
from ros_pad.simulation.bench import BenchScene
from ros_pad.trials import bench
from ros_pad.trials.report import PAPER_STYLE
from ros_pad.trials.report import rendered
from ros_pad.trials.report import save

DPI = 200  # of a PNG
# Options of a walk, with what they are where nobody gave them, and why a bench has none.
_OF_A_WALK = {
    'policy': (None, 'its pad has the shape that the scene says'),
    'cycles': (None, 'nothing walks'),
    'seed': (0, 'nothing is left to chance'),
    'fidelity': ('auto', 'it is worked out, not simulated'),
    'no_compare': (False, 'there are no policies to compare'),
    'live': (False, 'it has no nodes'),
}


def run_bench(options: argparse.Namespace, path: str | os.PathLike[str]) -> int:
    """Work out a bench scene, draw it, write its page; return the exit status.

    Parameters
    ----------
    options : Namespace
        Of ``pad run``: ``out``, ``json`` and ``foot`` count; ``no_ros`` is granted.
    path : str or path
        Name of a shipped bench scene, or path of a YAML file.

    Raises
    ------
    InvalidInput
        For an option that only a walk has.
    ConfigError
        For a scene that cannot be read.
    """
    refuse_walking(options, path)
    foot = None if options.foot is None else Foot.load(options.foot)
    scene = BenchScene.load(path, foot)
    trial = bench.run(scene)
    folder = new_folder(options.out, scene.name)
    try:
        page, files = _write(trial, folder)
    finally:
        with suppress(OSError):  # nothing came of it: the name stays free
            folder.rmdir()
    summary = trial.as_dict() | {'report': str(page), 'figures': [str(file) for file in files]}
    text = json.dumps(summary, indent=1, allow_nan=False)
    (folder / 'summary.json').write_text(text + '\n', encoding='utf-8')
    if options.json:
        print(json.dumps(summary, allow_nan=False))
    else:
        _show(trial)
        print(f'figures:  {folder}')
        print(f'report:   {page}')
    return 0


def refuse_walking(options: argparse.Namespace, path: str | os.PathLike[str]) -> None:
    """Raise InvalidInput for an option that means nothing on a bench."""
    for name, (default, why) in _OF_A_WALK.items():
        if getattr(options, name, default) != default:
            flag = '--' + name.replace('_', '-')
            raise InvalidInput(f'{flag}: {os.fspath(path)} is a bench, which takes none: {why}')


def _write(
    trial: bench.BenchTrial, folder: pathlib.Path
) -> tuple[pathlib.Path, list[pathlib.Path]]:
    """Write figures and page; return the page and the figures."""
    page = folder / 'report.html'
    files = []
    with bar('drawing', 100.0, '%') as reach, matplotlib.rc_context(PAPER_STYLE):
        drawn = thesis.draw(trial)
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
    print('\n' + bench_page.verdict(trial.claims))
    for claim in trial.claims:
        print(f'\nfigure {claim.figure}: {bench_page.VERDICTS[claim.holds]}')
        for who, text in (('thesis', claim.thesis), ('here', claim.ours)):
            print(textwrap.fill(text, 99, initial_indent=f'  {who:8}', subsequent_indent=10 * ' '))
    print()
    for note in trial.notes:
        print(textwrap.fill(note, 99, initial_indent='note:     ', subsequent_indent=10 * ' '))
    for omission in trial.omitted:
        bound = '' if omission.bound is None else f' (at most {100 * omission.bound:.2g} %)'
        print(f'left out: {omission.term}{bound}: {omission.reason}')
