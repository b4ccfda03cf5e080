# SPDX-License-Identifier: Apache-2.0
"""Write pages: the thesis' figures with their statements, and one bench point by point."""

from __future__ import annotations

import html
import os
from collections.abc import Collection, Mapping, Sequence

import matplotlib

import ros_pad
from ros_pad.configuration import refuse
from ros_pad.errors import InvalidInput
from ros_pad.pace import Progress
from ros_pad.reports.files import save
from ros_pad.reports.page import embedded, page, table
from ros_pad.reports.style import PAPER_STYLE, Drawn
from studies.thesis import bench, bench_figures, liquid, walks
from studies.thesis.bench import FIDELITY, BenchTrial, Row
from studies.thesis.explained import Claim, Explained, counted, explained

_BENCHES = {
    'bench_inflation': (14, 15),
    'bench_press': (16, 17, 18),
    'bench_tangential': (10, 20, 21),
    'bench_foot': (34,),
}
_DRAWN_WITH = {33: 34}  # pictures of the floors of figure 34
NUMBERS = tuple(sorted([*sum(_BENCHES.values(), ()), *liquid.NUMBERS, *walks.NUMBERS]))

HEAD = (
    *('figure', 'quantity', 'model', 'condition', 'at', 'modelled', 'measured', 'error'),
    'statement of the thesis',
)


def draw(numbers: Collection[int] = NUMBERS, progress: Progress | None = None) -> list[Explained]:
    """Compute and draw some of the thesis' figures; return them by number.

    All of them take about 45 s: 15 for figures 26 to 31, the rest for the walks of 41 to 44.

    Parameters
    ----------
    numbers : collection of int
        Numbers of figures, from :data:`NUMBERS`.
    progress : callable or None
        Called with the share of the work that is done, 0 to 1.

    Raises
    ------
    InvalidInput
        For no figure, or for one that is not drawn here.
    """
    unknown = sorted(set(numbers) - set(NUMBERS))
    if unknown or not numbers:
        raise InvalidInput(
            f'figures = {unknown or []} is not allowed: one or more of'
            f' {", ".join(map(str, NUMBERS))} are needed'
        )
    done: list[Explained] = []
    for name, own in _BENCHES.items():
        if wanted := set(own) & set(numbers):
            trial = bench.run(name)
            done += [
                explained(number, figure, _claims_of(trial, number))
                for number, figure in bench_figures.draw(trial).items()
                if number in wanted
            ]
    done += liquid.draw(numbers)
    walked = walks.walk(numbers, progress and (lambda share: progress(0.1 + 0.85 * share)))
    done += walks.draw(walked, numbers)
    if progress:
        progress(1.0)
    return sorted(done, key=lambda each: each.number)


def _claims_of(trial: BenchTrial, number: int) -> list[Claim]:
    return [c for c in trial.claims if _DRAWN_WITH.get(c.figure, c.figure) == number]


def write(
    figures: Sequence[Explained],
    path: str | os.PathLike[str],
    force: bool = False,
    text: Sequence[Claim] = (),
) -> None:
    """Write the page: one HTML file that needs no other file, and no script.

    Parameters
    ----------
    figures : sequence of Explained
        Result of :func:`draw`.
    path : path
        HTML file to write.
    force : bool
        Replace an existing file.
    text : sequence of Claim
        Statements without a figure.

    Raises
    ------
    PadError
        When the file exists or cannot be written.
    """
    refuse(path, force)
    claims = [*text, *(claim for each in figures for claim in each.claims)]
    subjects = [
        [
            f'<a href="#figure-{each.number}">{each.number}</a>',
            html.escape(each.drawn.title.partition(': ')[2]),
            counted(each.claims) or 'none of its own',
        ]
        for each in figures
    ]
    parts = [
        "<h1>The thesis' figures, drawn again</h1>",
        f'<p class="facts">{len(figures)} figures · ros_pad {ros_pad.__version__}</p>',
        f'<p class="result">Of {len(claims)} statements of the thesis: {counted(claims)}.</p>',
        "<p>Each figure has the thesis' number. Where the thesis gives no number for a word, the "
        'number assumed here is in the rule.</p>',
        table(['figure', 'subject', 'statements'], subjects, range(0)),
    ]
    for each in figures:
        parts += _figure(each.drawn, f'figure-{each.number}')
        rows = [[f'<b>{name}</b>', html.escape(words)] for name, words in each.parts.items()]
        parts.append(table(['', ''], rows, range(0)))
        if each.claims:
            parts.append(_statements(each.claims))
    if text:
        parts += ['<h2>Statements without a figure</h2>', _statements(text)]
    save(path, page("The thesis' figures: ros_pad", parts).encode())


def write_bench(
    trial: BenchTrial, drawn: Mapping[int, Drawn], path: str | os.PathLike[str]
) -> None:
    """Write the page of a bench: one HTML file that needs no other file, and no script.

    Parameters
    ----------
    trial : BenchTrial
        Result of the bench scene.
    drawn : mapping of int to Drawn
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
    bounds = [[*map(html.escape, each.words())] for each in trial.omitted]
    points = [[html.escape(text) for text in cells(row)] for row in trial.rows]
    parts = [
        f'<h1>{html.escape(scene.name)}</h1><p class="facts">{html.escape(facts)}</p>',
        f'<p>{html.escape(scene.description)}</p>',
        f'<p class="result">Statements of the thesis: {counted(trial.claims)}.</p>',
        '<h2>What the thesis states</h2>',
        _statements(trial.claims),
        *(part for number, each in drawn.items() for part in _figure(each, f'figure-{number}')),
        '<h2>Point by point</h2>',
        table(HEAD, points, range(5, 8)),
        '<p class="note">Error: modelled over measured value, minus 1.</p>',
        '<h2>Notes</h2>',
        *(f'<p>{html.escape(note)}</p>' for note in trial.notes),
        '<h2>What the model leaves out</h2>',
        table(['left out', 'bound', 'of what, and where it comes from'], bounds, range(1, 2)),
    ]
    save(path, page(f'{scene.name}: ros_pad', parts).encode())


def _figure(drawn: Drawn, anchor: str) -> list[str]:
    with matplotlib.rc_context(PAPER_STYLE):
        return [
            f'<h2 id="{anchor}">{html.escape(drawn.title)}</h2>',
            embedded(drawn.figure, drawn.alt, html.escape(drawn.caption)),
        ]


def _statements(claims: Sequence[Claim]) -> str:
    """Return the table of statements with their verdicts, as HTML."""
    rows = [
        [
            html.escape(claim.where),
            f'<b>{claim.verdict}</b>',
            *map(html.escape, (claim.thesis, claim.printed, claim.ours, claim.reason())),
        ]
        for claim in claims
    ]
    return table(['', '', 'the thesis states', 'its number', 'here', 'why'], rows, range(0))


def cells(row: Row) -> list[str]:
    """Return a row as text in the columns of :data:`HEAD`; lengths in mm, small forces in mN."""
    unit, factor = {'m': ('mm', 1e3)}.get(row.unit, (row.unit, 1.0))
    if row.unit == 'N' and abs(row.modelled) < 5e-3:
        unit, factor = 'mN', 1e3
    at = [] if row.pressure is None else [f'{1e-3 * row.pressure:g} kPa']
    at += [] if row.force is None else [f'{row.force:g} N']
    return [
        *(str(row.figure), row.quantity, row.model, row.condition, ', '.join(at)),
        f'{factor * row.modelled:.4g} {unit}'.rstrip().replace('-', '−'),
        '' if row.measured is None else f'{factor * row.measured:.4g} {unit}',
        '' if row.error is None else f'{100.0 * row.error:+z.1f} %'.replace('-', '−'),
        row.claimed,
    ]
