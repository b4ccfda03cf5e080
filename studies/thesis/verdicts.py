# SPDX-License-Identifier: Apache-2.0
"""Write all statements of the thesis with their verdicts: JSON, and a table of the docs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ros_pad.reports.files import save
from studies import command
from studies.thesis import walks
from studies.thesis.explained import Claim, Explained, counted
from studies.thesis.tangential import DRAWS

PAGE = command.ROOT / 'docs' / 'thesis.md'
MARK = '<!-- below: python -m studies thesis --table -->\n'
_HEAD = ('where', 'the thesis states', 'verdict')


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


def markdown(kept: Mapping[str, Any]) -> str:
    """Return the table as Markdown."""
    rows = [
        (
            claim['where'],
            claim['thesis'] + (f' ({claim["printed"]})' if claim['printed'] else ''),
            f'[{claim["verdict"]}]({claim["see"]})' if claim['see'] else claim['verdict'],
        )
        for claim in kept['claims']
    ]
    lines = [_HEAD, ('---',) * len(_HEAD), *rows]
    table = ''.join(f'| {" | ".join(line)} |\n' for line in lines)
    return f'{kept["statements"]} statements: {kept["counts"]}.\n\n{table}'


def write(kept: Mapping[str, Any]) -> None:
    """Write docs/charts/thesis.json, and the table below the mark of docs/thesis.md."""
    command.write(command.CHARTS, 'thesis', kept)
    head = PAGE.read_text(encoding='utf-8').partition(MARK)[0]
    save(PAGE, f'{head}{MARK}\n{markdown(kept)}'.encode())
