# SPDX-License-Identifier: Apache-2.0
import html
import re

import numpy as np
import pytest

from studies.thesis import bench, page
from studies.thesis import bench_figures as thesis
from studies.thesis.explained import counted

BENCHES = ('inflation', 'press', 'tangential', 'foot')

pytestmark = pytest.mark.slow

TRIALS = {kind: bench.run(f'bench_{kind}') for kind in BENCHES}
DRAWN = {kind: thesis.draw(trial) for kind, trial in TRIALS.items()}
FIGURES = {name: drawn for part in DRAWN.values() for name, drawn in part.items()}


def lines(name, axes=0):
    return FIGURES[name].figure.axes[axes].lines


def test_profiles_of_free_domes():
    """Profiles are circles through the rim and the top: modelled solid, measured dashed."""
    flat, *domes = lines(14)
    assert flat.get_xydata() == pytest.approx(np.array([[-1.5, 0.0], [1.5, 0.0]]))
    rows = TRIALS['inflation'].pick('height')
    assert len(domes) == 2 * len(rows)
    for row, solid, dashed in zip(rows, domes[::2], domes[1::2], strict=True):
        for line, height, style in ((solid, row.modelled, '-'), (dashed, row.measured, '--')):
            x, z = line.get_xydata().T
            c = 1e3 * height
            radius = (1.5**2 + c**2) / (2.0 * c)
            assert np.hypot(x, z - (c - radius)) == pytest.approx(radius)
            assert (x[0], x[-1]) == pytest.approx((-1.5, 1.5))
            assert (z[0], z[-1]) == pytest.approx((0.0, 0.0), abs=1e-9)
            assert z.max() == pytest.approx(c, rel=1e-4)
            assert line.get_linestyle() == style
    # Domes from 65 kPa on are wider than their rim.
    assert [line.get_xdata().max() > 1.5001 for line in domes[::2]] == [False, True, True, True]


@pytest.mark.parametrize('kind', ['press', 'foot'])
def test_page(kind, tmp_path):
    trial, path = TRIALS[kind], tmp_path / 'report.html'
    page.write_bench(trial, DRAWN[kind], path)
    text = path.read_text(encoding='utf-8')
    # The file contains every picture; nothing is loaded or executed.
    sources = re.findall(r'src="([^"]{0,30})', text)
    assert len(sources) == len(DRAWN[kind])
    assert all(source.startswith('data:image/svg+xml;base64,') for source in sources)
    assert '<script' not in text and not re.search('https?:', text)
    for claim in trial.claims:
        assert html.escape(claim.ours) in text
    for drawn in DRAWN[kind].values():
        assert html.escape(drawn.title) in text and html.escape(drawn.caption) in text
    for row in trial.rows:
        assert all(f'>{html.escape(cell)}</td>' in text for cell in page.cells(row))
    assert counted(trial.claims) in text
