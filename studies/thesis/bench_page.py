# SPDX-License-Identifier: Apache-2.0
"""Write the page of a bench: an HTML file with its figures, points, and the thesis' claims."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence

import matplotlib

import ros_pad
from ros_pad.reports.files import save
from ros_pad.reports.page import embedded, page, table
from ros_pad.reports.style import PAPER_STYLE, Drawn
from studies.thesis.bench import FIDELITY, BenchTrial, Row
from studies.thesis.explained import Claim, counted

HEAD = (
    'figure',
    'quantity',
    'model',
    'condition',
    'at',
    'modelled',
    'measured',
    'error',
    'statement of the thesis',
)


def write(trial: BenchTrial, drawn: Mapping[str, Drawn], path: str | os.PathLike[str]) -> None:
    """Write the page of a bench: one HTML file that needs no other file, and no script.

    Parameters
    ----------
    trial : BenchTrial
        Result of the bench scene.
    drawn : mapping of str to Drawn
        Figures of :func:`studies.thesis.bench_figures.draw` for the trial.
    path : path
        HTML file; an existing one is replaced.

    Raises
    ------
    PadError
        When the file cannot be written.
    """
    scene = trial.scene
    facts = f'bench · {FIDELITY} · foot {scene.foot.source} · ros_pad {ros_pad.__version__}'
    parts = [
        f'<h1>{html.escape(scene.name)}</h1><p class="facts">{html.escape(facts)}</p>',
        f'<p>{html.escape(scene.description)}</p>',
        f'<p class="result">Statements of the thesis: {counted(trial.claims)}.</p>',
        '<h2>What the thesis states</h2>',
        statements(trial.claims),
    ]
    with matplotlib.rc_context(PAPER_STYLE):
        for each in drawn.values():
            caption = html.escape(each.caption)
            parts.append(f'<h2>{html.escape(each.title)}</h2>')
            parts.append(embedded(each.figure, each.alt, caption))
    parts.append('<h2>Point by point</h2>')
    parts.append(
        table(
            HEAD, [[html.escape(text) for text in cells(row)] for row in trial.rows], range(5, 8)
        )
    )
    parts.append('<p class="note">Error: modelled over measured value, minus 1.</p>')
    parts.append('<h2>Notes</h2>')
    parts += [f'<p>{html.escape(note)}</p>' for note in trial.notes]
    parts.append('<h2>What the model leaves out</h2>')
    parts.append(
        table(
            ['left out', 'bound', 'of what, and where it comes from'],
            [
                [
                    html.escape(each.term),
                    'unknown' if each.bound is None else f'≤ {100.0 * each.bound:.2g} %',
                    html.escape(each.reason),
                ]
                for each in trial.omitted
            ],
            range(1, 2),
        )
    )
    save(path, page(f'{scene.name}: ros_pad', parts).encode())


def statements(claims: Sequence[Claim]) -> str:
    """Return the table of statements with their verdicts, as HTML."""
    rows = [
        [
            html.escape(claim.where),
            f'<b>{claim.verdict}</b>',
            *map(html.escape, (claim.thesis, claim.printed, claim.ours, claim.reason())),
        ]
        for claim in claims
    ]
    return table(['', '', 'the thesis states', 'its number', 'here', 'rule'], rows, range(0))


def cells(row: Row) -> list[str]:
    """Return a row as text in the columns of :data:`HEAD`; lengths in mm, small forces in mN."""
    unit, factor = {'m': ('mm', 1e3)}.get(row.unit, (row.unit, 1.0))
    if row.unit == 'N' and abs(row.modelled) < 5e-3:
        unit, factor = 'mN', 1e3
    at = [] if row.pressure is None else [f'{1e-3 * row.pressure:g} kPa']
    at += [] if row.force is None else [f'{row.force:g} N']
    return [
        str(row.figure),
        row.quantity,
        row.model,
        row.condition,
        ', '.join(at),
        f'{factor * row.modelled:.4g} {unit}'.rstrip().replace('-', '−'),
        '' if row.measured is None else f'{factor * row.measured:.4g} {unit}',
        '' if row.error is None else f'{100.0 * row.error:+z.1f} %'.replace('-', '−'),
        row.claimed,
    ]
