# SPDX-License-Identifier: Apache-2.0
"""Write all statements of the thesis with their verdicts: JSON, and the tables of the docs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ros_pad.reports.files import save
from studies import command
from studies.thesis import walks
from studies.thesis.explained import Claim, Explained, counted
from studies.thesis.tangential import DRAWS

PAGES = {'3': command.ROOT / 'docs' / 'thesis.md', '4, 5': command.ROOT / 'docs' / 'thesis_4_5.md'}
"""Pages of docs by the chapters whose statements they have."""

MARK = '<!-- below: python -m studies thesis --table -->\n'
_HEAD = ('where', 'the thesis states', 'verdict', 'why')


def document(figures: Sequence[Explained], text: Sequence[Claim]) -> dict[str, Any]:
    """Return all statements in the order of the thesis, for JSON."""
    claims = sorted([*text, *(claim for each in figures for claim in each.claims)], key=_order)
    return {
        'command': 'python -m studies thesis --table',
        'seeds': list(walks.SEEDS),
        'draws': DRAWS,
        'statements': len(claims),
        'counts': counted(claims),
        'claims': [claim.as_dict() | {'reason': claim.reason()} for claim in claims],
    }


def _order(claim: Claim) -> tuple[list[int], int]:
    sections = re.findall(r'\d+(?:\.\d+)+', claim.section)
    return [int(part) for part in sections[0].split('.')], claim.figure


def tables(kept: Mapping[str, Any]) -> Iterator[tuple[Any, str]]:
    """Return each page of docs with what stands on it below :data:`MARK`, as Markdown."""
    lines: dict[Any, list[tuple[str, ...]]] = {page: [] for page in PAGES.values()}
    for claim in kept['claims']:
        chapter = re.findall(r'\d', claim['where'])[0]
        verdict = f'[{claim["verdict"]}]({claim["see"]})' if claim['see'] else claim['verdict']
        stated = claim['thesis'] + (f' ({claim["printed"]})' if claim['printed'] else '')
        row = (claim['where'], stated, verdict, claim['why'])
        lines[PAGES['3' if chapter == '3' else '4, 5']].append(row)
    for page, rows in lines.items():
        table = ''.join(f'| {" | ".join(row)} |\n' for row in (_HEAD, ('---',) * 4, *rows))
        yield page, f'Of all {kept["statements"]} statements {kept["counts"]}.\n\n{table}'


def write(kept: Mapping[str, Any]) -> None:
    """Write docs/charts/thesis.json, and what stands below the mark of the pages."""
    command.write(command.CHARTS, 'thesis', kept)
    for page, table in tables(kept):
        head = page.read_text(encoding='utf-8').partition(MARK)[0]
        save(page, f'{head}{MARK}\n{table}'.encode())
