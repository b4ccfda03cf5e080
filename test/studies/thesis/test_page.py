# SPDX-License-Identifier: Apache-2.0
"""The page of the thesis' figures, and the command that writes it."""

import html
import re

import pytest

from ros_pad.errors import InvalidInput, PadError
from studies.__main__ import main
from studies.thesis import page as thesis_page
from studies.thesis.explained import Claim

pytestmark = pytest.mark.slow

CHEAP = (10, 14, 15, 16, 17, 18, 20, 21, 28, 34)
TEXT = Claim(
    figure=0, thesis='It is more.', ours='It is less.', numbers=(0.9,), holds=False, section='3.1'
)
FIGURES = thesis_page.draw(CHEAP)


def test_all_figures_that_were_asked_for_are_there():
    assert {*CHEAP, *range(26, 32), 38, 39, *range(41, 45)} == {*thesis_page.NUMBERS}
    assert tuple(each.number for each in FIGURES) == CHEAP
    assert [each.number for each in thesis_page.draw((28, 16))] == [16, 28]
    for each in FIGURES:
        assert each.drawn.title.startswith(f'Figure {each.number}: ')
        drawn = {claim.figure for claim in each.claims}
        assert drawn == ({33, 34} if each.number == 34 else {each.number})


@pytest.mark.parametrize('numbers', [(), (14, 19)])
def test_other_figures_are_refused(numbers):
    with pytest.raises(InvalidInput, match='10, 14, 15, 16'):
        thesis_page.draw(numbers)


def test_statements_have_the_verdicts_of_the_docs(agree):
    agree([claim for each in FIGURES for claim in each.claims])


def test_page(tmp_path):
    path = tmp_path / 'page.html'
    thesis_page.write(FIGURES, path, text=(TEXT,))
    text = path.read_text(encoding='utf-8')
    assert text.count('src="data:image/svg+xml;base64,') == text.count('<img') == len(CHEAP)
    assert '<script' not in text and not re.search('https?:', text)
    assert TEXT.ours in text and TEXT.thesis in text
    for each in FIGURES:
        assert f'<h2 id="figure-{each.number}">' in text
        assert f'<a href="#figure-{each.number}">' in text
        for words in each.parts.values():
            assert len(words) > 10 and html.escape(words) in text
        for claim in each.claims:
            assert html.escape(claim.thesis) in text and html.escape(claim.ours) in text
    for name in ('measured', 'modelled', 'assumed'):
        assert text.count(f'<b>{name}</b>') == len(CHEAP)
    with pytest.raises(PadError, match='exists'):
        thesis_page.write(FIGURES, path)


def test_command(tmp_path, capsys):
    page, folder = tmp_path / 'thesis.html', tmp_path / 'figures'
    words = ['thesis', '--only', '28', '--out', str(page), '--figures', str(folder)]
    assert main(words) == 0
    written = capsys.readouterr().out.split()
    assert written == [str(page), str(folder / 'figure_28.pdf'), str(folder / 'figure_28.png')]
    assert main(words) == 2
    assert 'thesis.html: exists already' in capsys.readouterr().err
    assert main([*words, '--force', '--table']) == 2
    assert '--table is not allowed with --only' in capsys.readouterr().err
