# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest

from ros_pad.errors import InvalidInput
from ros_pad.simulation.terrain import Floor, patch_lengths

FILM = 3e-4
SEEDS = range(8)


def mean_chord(floor):
    """Return the mean length of wet runs along lines in x, m."""
    lengths = []
    for row in floor.wet_map:
        edges = np.flatnonzero(np.diff(row.astype(int)))
        starts = [e for e in edges if not row[e]]
        if not starts:
            continue
        turned = np.roll(row, -starts[0] - 1)  # begins with a whole wet run
        run = 0
        for wet in [*turned.tolist(), False]:
            if wet:
                run += 1
            elif run:
                lengths.append(run)
                run = 0
    return float(np.mean(lengths)) * floor.cell


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('fraction', [0.1, 0.45, 0.8])
def test_wet_fraction(fraction, seed):
    floor = Floor.patches(fraction, 0.9 * patch_lengths(fraction)[1] / 3.0, FILM, seed)
    assert floor.wet_map.mean() == pytest.approx(fraction, abs=1e-4)


@pytest.mark.parametrize(
    'fraction, length, tolerance',
    [
        (0.45, 0.1, 0.05), (0.45, 0.5, 0.04), (0.45, 1.5, 0.08), (0.45, 3.0, 0.15),
        (0.1, 0.2, 0.05), (0.1, 0.8, 0.1), (0.8, 1.0, 0.05), (0.95, 3.0, 0.06),
    ],
)  # fmt: skip
def test_mean_length_of_patches(fraction, length, tolerance):
    found = [mean_chord(Floor.patches(fraction, length, FILM, seed)) for seed in SEEDS]
    assert np.mean(found) == pytest.approx(length, rel=tolerance)


def test_cells_are_placed_by_the_origin():
    floor = Floor(np.array([[True, False, False], [False, False, True]]), 0.5, (-1.0, 2.0), FILM)
    assert floor.wet(-0.9, 2.1) and floor.wet(-0.51, 2.49)
    assert not floor.wet(-0.49, 2.1) and not floor.wet(-0.9, 2.51)
    assert floor.wet(0.1, 2.6)
    assert floor.wet(-0.9 - 1.5, 2.1 + 1.0)
    assert floor.depth(-0.9, 2.1) == FILM
    assert floor.depth(0.1, 2.1) == 0.0


def test_wet_along_is_wet():
    """Both agree also at edges of cells, where a rounded quotient can be in the next cell."""
    floor = Floor.patches(0.45, 0.2, FILM, 1)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-30.0, 30.0, (2, 2000))
    edges = floor.origin[0] + floor.cell * np.arange(-3000, 3000)
    x = np.concatenate([x, edges, np.arange(-500, 500) * 0.02])
    y = np.resize(np.concatenate([y, edges]), x.shape)
    expected = [floor.wet(*place) for place in zip(x.tolist(), y.tolist(), strict=True)]
    found = floor.wet_along(x, y)
    assert found.dtype == bool
    assert found.tolist() == expected
    assert floor.wet_along(x.reshape(2, -1), y.reshape(2, -1)).shape == (2, len(x) // 2)


# --- drawn floors -----------------------------------------------------------------------------

DRAWING = ('..#', '###')  # the first row is on the left (+y)


def test_a_drawing_lies_as_the_robot_sees_it():
    floor = Floor.drawn(DRAWING, 0.5, FILM)
    # Columns are centred at x = 0, 0.5 and 1 m; rows at y = 0.25 and -0.25 m.
    assert [floor.wet(x, 0.25) for x in (0.0, 0.5, 1.0)] == [False, False, True]
    assert [floor.wet(x, -0.25) for x in (0.0, 0.5, 1.0)] == [True, True, True]
    assert floor.depth(1.0, 0.25) == FILM
    # The drawing repeats.
    assert not floor.wet(1.5, 0.25)
    assert floor.wet(-0.5, 0.25)
    assert floor.wet(0.0, 0.75) and not floor.wet(0.0, 1.25)


@pytest.mark.parametrize('drawing', [(), ('',), ('#.', '#'), ('#.', '#o')])
def test_bad_drawings(drawing):
    with pytest.raises(InvalidInput, match='rows of one length'):
        Floor.drawn(drawing, 0.5, FILM)


# --- heights ----------------------------------------------------------------------------------


def test_an_even_floor_is_at_zero():
    floor = Floor.uniform(True, FILM)
    assert floor.uneven(0.0, 0) is floor
    assert floor.height(0.3, -0.2) == 0.0


def test_heights_have_the_spread_and_the_reach_that_are_asked_for():
    heights = Floor.uniform(False, FILM).uneven(5e-4, 1).heights
    assert heights.mean() == pytest.approx(0.0, abs=1e-12)
    assert heights.std() == pytest.approx(5e-4)
    # Correlation exp(-(d/0.05 m)²): 0.527 after two cells of 20 mm, 0.077 after four.
    for axis, cells, expected in ((0, 2, 0.527), (1, 2, 0.527), (0, 4, 0.077), (1, 4, 0.077)):
        likeness = (heights * np.roll(heights, cells, axis)).mean() / 25e-8
        assert likeness == pytest.approx(expected, abs=0.02)
    # Normal distribution: 68.3 % within one standard deviation, 95.4 % within two.
    assert (np.abs(heights) < 5e-4).mean() == pytest.approx(0.683, abs=0.02)
    assert (np.abs(heights) < 1e-3).mean() == pytest.approx(0.954, abs=0.02)


def test_height_at_a_place_is_that_of_its_cell():
    floor = Floor.uniform(False, FILM).uneven(1e-3, 0)
    assert floor.height(-1.0 + 0.01, -4.0 + 0.01) == floor.heights[0, 0]
    assert floor.height(0.51, 0.13) == floor.heights[206, 75]
    assert floor.height(0.51 + 16.0, 0.13 - 8.0) == floor.height(0.51, 0.13)


@pytest.mark.parametrize('value', [-1e-3, math.nan, math.inf])
def test_bad_cell_and_unevenness(value):
    for cell in (value, 0.0):
        with pytest.raises(InvalidInput, match=r'cell = .* is not allowed: .* m is needed'):
            Floor.drawn(['#.'], cell, FILM)
    with pytest.raises(InvalidInput, match=r'unevenness = .* is not allowed: .* m is needed'):
        Floor.uniform(False, FILM).uneven(value, 0)
