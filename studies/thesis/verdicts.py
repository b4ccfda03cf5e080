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

PAGES = {'thesis.md': '3', 'thesis_4_5.md': '457'}
"""Pages of docs, and the chapters whose statements they have."""

MARK = '<!-- below: python -m studies thesis --table -->\n'


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
    counts = f'Verdicts on all {kept["statements"]} statements: {kept["counts"]}.\n\n'
    for page, chapters in PAGES.items():
        table = '| where | the thesis states | verdict | why |\n| --- | --- | --- | --- |\n'
        for claim in kept['claims']:
            if re.findall(r'\d', claim['where'])[0] in chapters:
                verdict = f'[{claim["verdict"]}]({claim["see"]})'
                stated = claim['thesis'] + (f' ({claim["printed"]})' if claim['printed'] else '')
                table += f'| {claim["where"]} | {stated} | {verdict} | {claim["why"]} |\n'
        yield command.ROOT / 'docs' / page, counts + table


def write(kept: Mapping[str, Any]) -> None:
    """Write docs/charts/thesis.json, and what stands below the mark of the pages."""
    command.write(command.CHARTS, 'thesis', kept)
    for page, table in tables(kept):
        head = page.read_text(encoding='utf-8').partition(MARK)[0]
        save(page, f'{head}{MARK}\n{table}'.encode())
