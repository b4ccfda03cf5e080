# SPDX-License-Identifier: Apache-2.0
"""Records, and the tables of docs/topics.md; ``python test/test_records.py`` writes them."""

import pathlib
import re

import numpy as np
import pytest

from ros_pad.control import faults
from ros_pad.estimation import doubt
from ros_pad.records import KINDS, SAMPLE

PAGE = pathlib.Path(__file__).resolve().parents[1] / 'docs' / 'topics.md'


def tables():
    yield (
        'records',
        '| topic | number | unit | meaning |\n|---|---|---|---|\n'
        + ''.join(
            f'| `feet/{kind.name}` | `{field.name}{field.axes and "_"}{"/".join(field.axes)}` |'
            f' {field.unit or "–"} | {field.meaning} |\n'
            for kind in KINDS
            for field in kind.fields
        ),
    )
    rows = [f'| {code} | {row.kind} | {row.details} |\n' for code, row in enumerate(doubt.TABLE)]
    rows[0] = '| 0 | no doubt |  |\n'
    text = '| `doubt` | kind | details, with the two numbers a and b |\n|---|---|---|\n'
    yield 'doubts', text + ''.join(rows)
    text = '| `fault` | kind | two numbers |\n|---|---|---|\n'
    yield (
        'faults',
        text
        + ''.join(
            f'| {kind.code} | {kind.label or "no fault"} | {kind.numbers} |\n'
            for kind in faults.Kind
        ),
    )


def written(page):
    for name, table in tables():
        page = re.sub(
            rf'(?s)(<!-- {name}:begin -->\n).*?(<!-- {name}:end -->)',
            lambda match, table=table: match[1] + table + match[2],
            page,
        )
    return page


def test_the_page_has_the_tables():
    page = PAGE.read_text()
    assert all(f'<!-- {name}:begin -->' in page for name, _ in tables())
    assert page == written(page), 'run python test/test_records.py'


@pytest.mark.parametrize('kind', KINDS, ids=lambda kind: kind.name)
def test_rows_begin_with_nothing_known(kind):
    rows = kind.rows(3, 6)
    assert rows.shape == (3, 6) and rows.dtype == kind.dtype
    numbers = rows.view('f8').reshape(3, 6, -1)
    assert np.isnan(numbers).all() and numbers.shape[2] == len(kind.columns)


def test_numbers_of_a_record_are_named_by_leg():
    names = SAMPLE.names((1, 4))
    assert len(names) == 2 * len(SAMPLE.columns) == len(set(names))
    assert names[:3] == ('leg_1/force_x', 'leg_1/force_y', 'leg_1/force_z')


if __name__ == '__main__':
    PAGE.write_text(written(PAGE.read_text()))
