# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib

import pytest

from ros_pad.capillary import Mesh, wet
from ros_pad.contact import Liquid
from studies.work_precision import capillary

pytestmark = pytest.mark.slow

REFERENCE = pathlib.Path(__file__).parents[2] / 'reference'
DOME, CONE, CYLINDER = capillary.SHAPES


@pytest.fixture(scope='module')
def rows():
    """Measure on some of the cases, on coarse meshes."""
    shares = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capillary, 'TENSIONS', (0.073,))
        patch.setattr(capillary, 'RATIOS', (0.3, 0.8))
        patch.setattr(capillary, 'SIZES', ((50, 6, 24, 24), (100, 6, 24, 24)))
        patch.setattr(capillary, 'MINIMISED', ((12, 0),))
        patch.setattr(capillary, 'FEW', slice(1, None))
        measured = capillary.measure(shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return measured


@pytest.fixture(scope='module')
def results(rows):
    return {(result.shape, result.family): result for result in rows}  # the finest mesh of each


@pytest.mark.parametrize('row', [0, 7, 14, -2])
def test_truth_is_that_of_the_reference_table(row):
    row = json.loads((REFERENCE / 'wet_dome_layers.json').read_text())['rows'][row]
    if row['gs_gl'] == 1.0:
        pytest.skip('the truth is for contact angles above 0')
    height, _ = capillary.truth(DOME, Liquid(row['gl'], row['gs_gl'] * row['gl']))
    assert height == pytest.approx(row['exact_bath'], rel=1e-6)


@pytest.mark.parametrize('ratio', [0.3, 0.8])
def test_a_cylinder_is_pulled_by_its_line_alone(ratio):
    """The exact force and the force balance on layers are Wilhelmy's 2 π r γ cos θ."""
    liquid = Liquid(0.004, ratio * 0.004)
    expected = 2.0 * math.pi * 1.2e-3 * 0.004 * math.cos(liquid.angle)
    assert capillary.truth(CYLINDER, liquid)[1] == pytest.approx(expected, rel=1e-8)
    found = wet(CYLINDER.mesh(24, 96), liquid, 'force', 200, 6, strict=False)
    assert capillary.weight_lifted(found, CYLINDER.solid) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize('shape', capillary.SHAPES, ids=lambda shape: shape.name)
def test_shapes_are_the_same_as_walls_meshes_and_solids(shape):
    mesh: Mesh = shape.mesh(64, 128)
    place = 0.6 * (shape.wall.top - shape.wall.floor) + shape.wall.floor
    radius, height, inclination = shape.wall.meridian(place)
    assert shape.outside(radius, height) == pytest.approx(0.0, abs=1e-12)
    assert shape.inclination(height) == pytest.approx(inclination)
    assert shape.solid(mesh.height) == pytest.approx(mesh.volume, rel=1e-3)


def test_exact_meniscus_and_minimiser_come_out_as_they_should(results):
    for shape in capillary.SHAPES:
        exact = results[shape.name, capillary.EXACT]
        assert exact.worst_height_error < 1e-9 and exact.worst_force_error < 1e-8
        # With a dozen sectors the minimiser has a moderate error.
        assert 1e-3 < results[shape.name, 'minimised'].worst_height_error < 0.15
        assert results[shape.name, 'minimised'].worst_force_error < 0.15
