# SPDX-License-Identifier: Apache-2.0
"""The page of the thesis' figures, and the command that writes it."""

import html
import re

import matplotlib
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError
from ros_pad.reports.style import PAPER_STYLE
from ros_pad.reports.style import WIDE
from studies.__main__ import main
from studies.thesis import page as thesis_page

pytestmark = pytest.mark.slow

CHEAP = (14, 15, 16, 17, 18, 20, 21, 26, 27, 28, 29, 30, 31, 34)
FIGURES = thesis_page.draw(CHEAP)


def test_all_figures_that_were_asked_for_are_there():
    assert (*CHEAP, 38, 39, 41, 42, 43, 44) == thesis_page.NUMBERS
    assert tuple(each.number for each in FIGURES) == CHEAP
    assert [each.number for each in thesis_page.draw((30, 16))] == [16, 30]
    for each in FIGURES:
        assert each.drawn.title.startswith(f'Figure {each.number}: ')
        assert all(claim.figure == each.number for claim in each.claims)


@pytest.mark.parametrize('numbers', [(), (14, 19)])
def test_other_figures_are_refused(numbers):
    with pytest.raises(InvalidInput, match='14, 15, 16'):
        thesis_page.draw(numbers)


@pytest.mark.parametrize('number', range(26, 32))
def test_nothing_is_cut_off(number):
    figure = next(each.drawn.figure for each in FIGURES if each.number == number)
    canvas = FigureCanvasAgg(figure)
    with matplotlib.rc_context(PAPER_STYLE):
        canvas.draw()
        box = figure.get_tightbbox(canvas.get_renderer())
    width, height = figure.get_size_inches()
    assert width <= WIDE
    assert box.x0 > -0.01 and box.y0 > -0.01
    assert box.x1 < width + 0.01 and box.y1 < height + 0.01


def test_page(tmp_path):
    path = tmp_path / 'page.html'
    thesis_page.write(FIGURES, path)
    text = path.read_text(encoding='utf-8')
    assert text.count('src="data:image/svg+xml;base64,') == text.count('<img') == len(CHEAP)
    assert '<script' not in text and not re.search('https?:', text)
    for each in FIGURES:
        assert f'<h2 id="figure-{each.number}">' in text
        assert f'<a href="#figure-{each.number}">' in text
        for words in (each.measured, each.modelled, each.assumed):
            assert len(words) > 10 and html.escape(words) in text
        for claim in each.claims:
            assert html.escape(claim.thesis) in text and html.escape(claim.ours) in text
    for name in ('measured', 'modelled', 'assumed'):
        assert text.count(f'<b>{name}</b>') == len(CHEAP)
    with pytest.raises(PadError, match='exists'):
        thesis_page.write(FIGURES, path)


def test_command(tmp_path, capsys):
    page, folder = tmp_path / 'thesis.html', tmp_path / 'figures'
    words = ['thesis', '--only', '30', '--out', str(page), '--figures', str(folder)]
    assert main(words) == 0
    written = capsys.readouterr().out.split()
    assert written == [str(page), str(folder / 'figure_30.pdf'), str(folder / 'figure_30.png')]
    assert main(words) == 2
    assert 'thesis.html: exists already' in capsys.readouterr().err
    page.unlink()
    assert main(words) == 2
    assert 'figure_30.pdf: exists already' in capsys.readouterr().err
    assert not page.exists()
    assert main([*words, '--force']) == 0
