# SPDX-License-Identifier: Apache-2.0
"""Compare one pad of the thesis on its test bench with the measurements, point by point.

Computes a bench scene (inflation, press, tangential), draws its figures (PNG, PDF) and writes a
page and summary.json, in SI units, into a new folder. ``pad run bench_press`` does the same.
"""

from __future__ import annotations

import json
import pathlib
from collections.abc import Sequence

import matplotlib

from ros_pad.commands.folder import new_folder
from ros_pad.contact import Foot
from ros_pad.reports.files import save
from ros_pad.reports.style import PAPER_STYLE, rendered
from studies import command
from studies.thesis import bench, bench_figures, page
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
    report, files = folder / 'report.html', []
    with matplotlib.rc_context(PAPER_STYLE):
        drawn = bench_figures.draw(trial)
        for number, each in drawn.items():
            for kind in ('png', 'pdf'):
                files.append(folder / f'figure_{number}.{kind}')
                save(files[-1], rendered(each.figure, kind, dpi=DPI))
    page.write_bench(trial, drawn, report)
    summary = trial.as_dict() | {'report': str(report), 'figures': [str(file) for file in files]}
    text = json.dumps(summary, indent=1, allow_nan=False)
    save(folder / 'summary.json', (text + '\n').encode())
    command.show(options, summary, _table(trial) + f'\nfigures:  {folder}\nreport:   {report}')
    return 0


def _table(trial: bench.BenchTrial) -> str:
    scene = trial.scene
    rows = [dict(zip(page.HEAD, page.cells(row), strict=True)) for row in trial.rows]
    shown = [command.listed(rows, f'{scene.name}, {bench.FIDELITY}: {scene.description}')]
    shown += ['', f'Statements of the thesis: {counted(trial.claims)}.']
    for claim in trial.claims:
        shown += ['', f'{claim.where}: {claim.verdict}', f'  thesis  {claim.thesis}']
        shown += [f'  here    {claim.ours}', f'  rule    {claim.reason()}']
    shown += ['', *(f'note:     {note}' for note in trial.notes)]
    shown += [f'left out: {" ".join(omission.words())}' for omission in trial.omitted]
    return '\n'.join(shown)
