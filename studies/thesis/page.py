# SPDX-License-Identifier: Apache-2.0
"""Write the thesis' figures on one page, with their measured, modelled and assumed parts."""

from __future__ import annotations

import html
import os
from collections.abc import Collection, Sequence

import matplotlib

import ros_pad
from ros_pad.configuration import refuse
from ros_pad.errors import InvalidInput
from ros_pad.pace import Progress
from ros_pad.reports.files import save
from ros_pad.reports.page import embedded, page, table
from ros_pad.reports.style import PAPER_STYLE
from studies.thesis import bench, liquid, walks
from studies.thesis import bench_figures as thesis
from studies.thesis.bench_page import statements
from studies.thesis.explained import Claim, Explained, counted

_BENCHES = {
    'bench_inflation': (14, 15),
    'bench_press': (16, 17, 18),
    'bench_tangential': (10, 20, 21),
    'bench_foot': (34,),
}
_DRAWN_WITH = {33: 34}  # pictures of the floors of figure 34
NUMBERS = tuple(
    sorted(
        [n for numbers in _BENCHES.values() for n in numbers] + [*liquid.NUMBERS, *walks.NUMBERS]
    )
)

_COMMON_DOME = (
    'Nothing: radius 1.5 mm, stiffness 40 N/m and adhesion 0.006 J/m² are from the thesis.'
)
# Texts about what is measured, modelled and assumed, for each figure of a bench.
_WORDS = {
    10: (
        'Nothing: the thesis computes it.',
        'Rise of water between the domes of a sole by three readings of 3.101.',
        'Nothing: water at 60° is from the thesis.',
    ),
    14: (
        'Heights of four free domes, 55 to 85 kPa, from the program of the thesis. Dashed '
        'profiles are spheres through the rim with these heights: the program has no outlines.',
        'A spherical cap whose stretched skin balances the pressure (3.34 to 3.41).',
        _COMMON_DOME,
    ),
    15: (
        'Heights and sphere radii of the same four domes.',
        'The same cap over all pressures; the stiffness in (d) is the one with which the cap has '
        'the measured height.',
        _COMMON_DOME,
    ),
    16: (
        'Height, contact radius and gap of one dome at 75 kPa under three forces.',
        'A sphere cut off flat by the floor (3.44 to 3.61), and the exact membrane of the same '
        'energy.',
        'Which forces belong to the three domes: those of the program and those of the text '
        'differ, so both are drawn.',
    ),
    17: (
        'Height and sphere radius of the same dome under the three forces.',
        'As for figure 16, over all forces.',
        'As for figure 16.',
    ),
    18: (
        'Contact radius, depth and gap of the same dome under the three forces.',
        'As for figure 16, over all forces.',
        'As for figure 16.',
    ),
    20: (
        'The force limits of the domes, 0.15, 0.30 and 0.40 N: where their curves end. The '
        'thesis gives no numbers of the curves.',
        'A foot with one pad: friction in proportion to the load and to the area of contact (3.65 '
        'to 3.67), and a film of liquid that drains from under it.',
        'Friction, shear strength, sole and film: the thesis gives only orderings.',
    ),
    21: (
        'Nothing: the thesis compares with measurements, but does not give their numbers.',
        'The capillary force of a ring of liquid by three versions of 3.82, and a bound on it.',
        'Tensions of water and silicone, or those of the thesis, which are ten times smaller; '
        'advancing and receding angles of 120° and 90° for the bound.',
    ),
    34: (
        'Nothing: the thesis prints no number of the figure.',
        'A whole foot at 50 kPa and flat, as in figure 20; roughness of the floor raises the film '
        'that keeps contact apart and the pressure at which a sole conforms. Bounds on the force '
        'of pinned lines, and on suction.',
        'Number of domes, loads, friction, film, roughness and contact angles; intervals draw '
        'each of them up to twice and half.',
    ),
}


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
        if set(own) & set(numbers):
            done += _of_bench(name, set(own) & set(numbers))
    done += liquid.draw(numbers)
    first = 0.1 if done else 0.0
    if progress:
        progress(first)
    walked = walks.walk(
        numbers, progress and (lambda share: progress(first + (0.95 - first) * share))
    )
    done += walks.draw(walked, numbers)
    if progress:
        progress(1.0)
    return sorted(done, key=lambda each: each.number)


def _of_bench(name: str, numbers: Collection[int]) -> list[Explained]:
    trial = bench.run(name)
    drawn = thesis.draw(trial)
    return [
        Explained(
            number,
            drawn[f'figure_{number}'],
            *_WORDS[number],
            claims=tuple(
                claim
                for claim in trial.claims
                if _DRAWN_WITH.get(claim.figure, claim.figure) == number
            ),
        )
        for number in sorted(numbers)
    ]


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
    parts = [
        "<h1>The thesis' figures, drawn again</h1>",
        f'<p class="facts">{len(figures)} figures · ros_pad {ros_pad.__version__}</p>',
        f'<p class="result">Of {len(claims)} statements of the thesis: {counted(claims)}.</p>',
        "<p>Each figure has the thesis' number. Where the thesis gives no number for a word, the "
        'number assumed here is in the rule.</p>',
        table(
            ['figure', 'subject', 'statements'],
            [
                [
                    f'<a href="#figure-{each.number}">{each.number}</a>',
                    html.escape(each.drawn.title.partition(': ')[2]),
                    counted(each.claims) or 'none of its own',
                ]
                for each in figures
            ],
            range(0),
        ),
    ]
    with matplotlib.rc_context(PAPER_STYLE):
        for each in figures:
            parts.append(f'<h2 id="figure-{each.number}">{html.escape(each.drawn.title)}</h2>')
            parts.append(
                embedded(each.drawn.figure, each.drawn.alt, html.escape(each.drawn.caption))
            )
            words = {
                'measured': each.measured,
                'modelled': each.modelled,
                'assumed': each.assumed,
            }
            rows = [[f'<b>{name}</b>', html.escape(text)] for name, text in words.items()]
            parts.append(table(['', ''], rows, range(0)))
            if each.claims:
                parts.append(statements(each.claims))
    if text:
        parts += ['<h2>Statements without a figure</h2>', statements(text)]
    save(path, page("The thesis' figures: ros_pad", parts).encode())
