# SPDX-License-Identifier: Apache-2.0
import html
import itertools
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from ros_pad.reports.style import PAPER_STYLE, rendered
from studies.thesis import bench
from studies.thesis import bench_figures as thesis
from studies.thesis import bench_page as page
from studies.thesis.bench_scene import BENCHES
from studies.thesis.explained import counted

pytestmark = pytest.mark.slow

TRIALS = {kind: bench.run(f'bench_{kind}') for kind in BENCHES}
DRAWN = {kind: thesis.draw(trial) for kind, trial in TRIALS.items()}
FIGURES = {name: drawn for part in DRAWN.values() for name, drawn in part.items()}


def lines(name, axes=0):
    return FIGURES[name].figure.axes[axes].lines


def points(name, axes, marker='o', open_=False):
    """Return x and y of the filled or open markers of a panel."""
    found = [
        line.get_xydata()
        for line in lines(name, axes)
        if line.get_marker() == marker and (line.get_markerfacecolor() == 'white') == open_
    ]
    return np.concatenate(found).T


def test_the_thesis_figures_are_all_there():
    assert set(DRAWN['inflation']) == {'figure_14', 'figure_15'}
    assert set(DRAWN['press']) == {'figure_16', 'figure_17', 'figure_18'}
    assert set(DRAWN['tangential']) == {'figure_20', 'figure_21', 'figure_10'}
    for name, drawn in FIGURES.items():
        assert drawn.title.startswith(f'Figure {name[-2:]}: ')
        assert drawn.alt and drawn.caption
        for ax in drawn.figure.axes:  # every axis has its quantity and unit
            assert ' / ' in ax.get_ylabel() or not ax.get_subplotspec().is_first_col()
            assert ' / ' in ax.get_xlabel() or not ax.get_subplotspec().is_last_row()


@pytest.mark.parametrize('name', FIGURES)
def test_nothing_is_cut_off(name):
    figure = FIGURES[name].figure
    canvas = FigureCanvasAgg(figure)
    with matplotlib.rc_context(PAPER_STYLE):
        canvas.draw()
        box = figure.get_tightbbox(canvas.get_renderer())
    width, height = figure.get_size_inches()
    assert box.x0 > -0.01 and box.y0 > -0.01
    assert box.x1 < width + 0.01 and box.y1 < height + 0.01


@pytest.mark.parametrize('name', FIGURES)
def test_no_two_labels_of_a_panel_overlap(name):
    figure = FIGURES[name].figure
    canvas = FigureCanvasAgg(figure)
    with matplotlib.rc_context(PAPER_STYLE):
        canvas.draw()
        renderer = canvas.get_renderer()
        for ax in figure.axes:
            boxes = [text.get_window_extent(renderer) for text in ax.texts]
            for one, other in itertools.combinations(boxes, 2):
                assert not one.overlaps(other)


def test_profiles_of_free_domes():
    """Profiles are circles through the rim and the top: modelled solid, measured dashed."""
    flat, *domes = lines('figure_14')
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


def test_measured_points_lie_on_the_curves_figure():
    x, y = points('figure_15', 0)
    assert x == pytest.approx([55.0, 65.0, 75.0, 85.0])
    assert y == pytest.approx([1.25, 1.6, 2.0, 2.4])
    _, stiffness = points('figure_15', 3)
    assert stiffness == pytest.approx([44.03, 40.94, 39.06, 38.75], abs=5e-3)
    _, error = points('figure_15', 2)
    assert error == pytest.approx([10.0, 2.6, -2.9, -4.5], abs=0.05)
    shown = [text.get_text() for text in FIGURES['figure_15'].figure.axes[0].texts]
    assert shown == ['+10.0 %', '+2.6 %', '−2.9 %', '−4.5 %']


@pytest.mark.parametrize('axes, forces', [(0, (0.08, 0.19, 0.285)), (1, (0.1, 0.2, 0.3))])
def test_pressed_profiles(axes, forces):
    """Profiles are flat between the edges of contact, at the gap; the membrane's are lower."""
    pressed = lines('figure_16', axes)[3:]  # without the base and two free domes
    assert len(pressed) == 9
    labels = FIGURES['figure_16'].figure.axes[axes].get_legend_handles_labels()[1]
    assert labels == ['free', *(f'{force:g} N' for force in forces)]
    measured = ((1.715566, 0.5), (1.03783, 0.98), (0.5632, 1.1))
    for (gap, contact), force, model, dashed, exact in zip(
        measured, forces, pressed[::3], pressed[1::3], pressed[2::3], strict=True
    ):
        x, z = dashed.get_xydata().T
        assert z.max() == pytest.approx(gap, rel=1e-9)
        top = x[np.isclose(z, gap, rtol=1e-9)]
        assert (top.min(), top.max()) == pytest.approx((-contact, contact), rel=8e-3)
        assert contact in np.round(top, 12)
        x, z = model.get_xydata().T
        edge = np.ptp(x[np.isclose(z, z.max(), rtol=1e-9)]) / 2.0
        # Pressure on the contact is the force, except for adhesion, less than 1e-3.
        assert 1e-6 * np.pi * edge**2 * 75e3 == pytest.approx(force, rel=1e-3)
        assert exact.get_ydata()[0] < z.max()


@pytest.mark.parametrize(
    'name, axes, values',
    [
        ('figure_17', 0, (1.8, 1.4, 1.0)),
        ('figure_18', 0, (0.5, 0.98, 1.1)),
        ('figure_18', 1, (0.084434, 0.36217, 0.4368)),
    ],
)
def test_pressed_points_stand_at_both_forces(name, axes, values):
    for open_, forces in ((False, (0.08, 0.19, 0.285)), (True, (0.1, 0.2, 0.3))):
        x, y = points(name, axes, open_=open_)
        assert x == pytest.approx(forces)
        assert y == pytest.approx(values)


def test_tangential_curves_end_at_the_limits():
    ends, _ = points('figure_20', 0)
    assert sorted(ends) == pytest.approx([0.15, 0.15, 0.3, 0.3, 0.4, 0.4])
    dashed = [line for line in lines('figure_20') if line.get_linestyle() == '--']
    assert len(dashed) == 4  # dry, flat and three domes
    assert dashed[0].get_ydata()[-1] == max(line.get_ydata().max() for line in lines('figure_20'))


def test_rises_with_their_optima():
    (claimed,) = FIGURES['figure_10'].figure.axes[0].patches
    corners = claimed.get_patch_transform().transform(claimed.get_path().vertices)[:, 0]
    assert (corners.min(), corners.max()) == pytest.approx((0.3, 0.8))
    x, _ = points('figure_10', 0)
    assert sorted(x) == pytest.approx([0.848, 2.327, 2.668], rel=2e-3)


def test_forces_of_a_foot_on_two_floors():
    """Dry slopes are 0.8 (flat, smooth), 0.459 (flat, rough) and 0.444 (domes), by hand."""
    smooth, rough, less = FIGURES['figure_34'].figure.axes
    for ax, flat in (
        (smooth, 0.35 + 4700.0 / 10444.0),
        (rough, 0.35 + 4700.0 / 10444.0 / 17.0**0.5),
    ):
        dry = [line for line in ax.lines if line.get_linestyle() == '--']
        ends = sorted(line.get_ydata()[-1] / line.get_xdata()[-1] for line in dry)
        assert ends == pytest.approx([0.444, flat], rel=1e-6)
        assert len(ax.lines) == 4
        assert ax.get_ylim() == smooth.get_ylim()
    without = [line for line in less.lines if len(line.get_xdata()) > 2][:6:3]
    assert [line.get_ydata().max() < 0.0 for line in without] == [True, True]


@pytest.mark.parametrize('kind', ['svg', 'pdf'])
def test_the_same_bench_gives_the_same_file(kind):
    def file():
        with matplotlib.rc_context(PAPER_STYLE):
            drawn = thesis.draw(TRIALS['inflation'])['figure_14']
            return rendered(drawn.figure, kind)

    assert file() == file()


@pytest.mark.parametrize('kind', BENCHES)
def test_page(kind, tmp_path):
    trial, path = TRIALS[kind], tmp_path / 'report.html'
    page.write(trial, DRAWN[kind], path)
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


def test_numbers_of_the_table_have_units_that_suit_them():
    row = TRIALS['inflation'].pick('height')[0]
    assert page.cells(row)[4:8] == ['55 kPa, 0 N', '1.375 mm', '1.25 mm', '+10.0 %']
    row = TRIALS['tangential'].pick('wet less dry')[1]
    assert page.cells(row)[5].startswith('−1.3') and page.cells(row)[5].endswith(' mN')
    assert page.cells(row)[6:] == ['', '', 'no numbers in the thesis']
