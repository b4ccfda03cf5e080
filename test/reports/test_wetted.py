# SPDX-License-Identifier: Apache-2.0
"""Pictures of wetted meshes: exactly the wall below the contact line is coloured wet."""

import matplotlib.image
import numpy as np
import pytest

from ros_pad.capillary import Mesh, wet, wet_pattern
from ros_pad.contact import Liquid
from ros_pad.errors import InvalidInput
from ros_pad.reports import wetted
from ros_pad.reports.files import write_picture

LIQUID = Liquid(0.02, 0.011)
DOME = Mesh.dome(1.55e-3, 0.583e-3, rings=16, sectors=24)


def area(triangles):
    a, b, c = np.moveaxis(triangles, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def test_a_cut_keeps_every_bit_of_the_mesh_on_its_side():
    rng = np.random.default_rng(3)
    triangles = rng.normal(size=(200, 3, 3))
    field = triangles @ [1.0, 2.0, 3.0] - 0.2
    above, below = wetted.split(triangles, field)
    assert area(above) + area(below) == pytest.approx(area(triangles), rel=1e-12)
    assert (above @ [1.0, 2.0, 3.0]).min() > 0.2 - 1e-9
    assert (below @ [1.0, 2.0, 3.0]).max() < 0.2 + 1e-9


def test_what_is_wet_ends_at_the_line():
    found = wet(DOME, LIQUID, slices=12)
    drawn = wetted.picture(DOME, found)
    top = 1e3 * found.mean_height
    assert drawn.wet[:, :, 2].max() == pytest.approx(top, rel=1e-6)
    assert drawn.dry[:, :, 2].min() == pytest.approx(top, rel=1e-6)
    assert drawn.line[0] == pytest.approx(drawn.line[-1])
    assert drawn.line[:, 2] == pytest.approx(top, rel=1e-6)
    assert np.hypot(*drawn.line[:, :2].T) == pytest.approx(1e3 * found.ring_radii[0], rel=1e-6)
    # The liquid surface goes from the contact line to the floor.
    assert drawn.surface[:, :, 2].min() == pytest.approx(0.0, abs=1e-9)
    reach = np.hypot(*np.moveaxis(drawn.surface[:, :, :2], 2, 0)).max()
    assert reach == pytest.approx(1e3 * found.floor_radii[0], rel=1e-6)


def test_nothing_is_wet_where_there_is_no_answer():
    apart, over = wet_pattern(DOME, LIQUID, 1e-3), wet(DOME, Liquid(0.073, 0.073), slices=12)
    assert (apart.status, over.status[0]) == ('far_apart', 'saturated')
    for found in (apart, over):
        drawn = wetted.picture(DOME, found)
        assert drawn.wet[:, :, 2].max() == 0.0  # only the base on the floor
        assert not drawn.surface.size


@pytest.mark.parametrize('height', [0.5e-3, 5e-3, 50e-3])
def test_pads_of_any_height_are_drawn_whole(height, tmp_path):
    mesh = Mesh.cylinder(1.2e-3, height)
    found = wet(mesh, LIQUID, 'force', slices=12)
    write_picture(tmp_path / 'it.png', lambda: wetted.draw(mesh, found))
    body = matplotlib.image.imread(tmp_path / 'it.png')[:, :666, :3]  # without the section
    assert (body < 0.9).any()
    assert (body[[0, -1]] == 1.0).all()


@pytest.mark.parametrize('kind', ['one', 'saturated', 'many'])
def test_figures_are_written(kind, tmp_path):
    mesh, found = DOME, wet(DOME, LIQUID if kind == 'one' else Liquid(0.073, 0.073), slices=12)
    if kind == 'many':
        mesh = Mesh.dome_pattern(7, 4e-3, 1.5e-3, 0.5e-3, 2.8e-3, rings=6, sectors=12)
        found = wet_pattern(mesh, Liquid(0.073, 0.027), 1e-4)
        assert found.status == 'ok'
    for suffix in ('png', 'svg', 'pdf'):
        write_picture(tmp_path / f'it.{suffix}', lambda: wetted.draw(mesh, found, 0.3))
        assert (tmp_path / f'it.{suffix}').stat().st_size > 8000
    shades = matplotlib.image.imread(tmp_path / 'it.png')[..., :3].reshape(-1, 3)
    blue = np.mean((shades[:, 2] > 0.6) & (shades[:, 0] < 0.6))
    assert (blue > 0.01) == (kind != 'saturated')
    with pytest.raises(InvalidInput, match=r'it\.jpg'):
        write_picture(tmp_path / 'it.jpg', lambda: wetted.draw(mesh, found))
