# SPDX-License-Identifier: Apache-2.0
import json
import math
import pathlib
import sys
from dataclasses import asdict

import pytest

from ros_pad.capillary import Mesh
from ros_pad.capillary import wet
from ros_pad.commands import chart
from ros_pad.contact import Liquid
from ros_pad.ladders import capillary

REFERENCE = pathlib.Path(__file__).parent.parent / 'reference'
DOME, CONE, CYLINDER = capillary.SHAPES


@pytest.fixture(scope='module')
def rows():
    """Measure on a share of the cases, on coarse meshes."""
    shares = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capillary, 'TENSIONS', (0.073,))
        patch.setattr(capillary, 'RATIOS', (0.3, 0.8))
        patch.setattr(capillary, 'SIZES', ((50, 6, 24, 24), (100, 6, 24, 24)))
        patch.setattr(capillary, 'MINIMISED', ((12, 0),))
        patch.setattr(capillary, 'FEW', slice(1, None))
        patch.setattr(capillary, 'BIG', (20, 6, 16, 24))
        patch.setitem(sys.modules, 'trimesh', None)
        measured = capillary.measure(shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return measured


@pytest.fixture(scope='module')
def rungs(rows):
    found = [row for row in rows if isinstance(row, capillary.Rung)]
    return {(rung.shape, rung.family): rung for rung in found}  # the finest of each


@pytest.mark.parametrize('row', [0, 7, 14, -2])
def test_truth_is_that_of_the_reference_table(row):
    row = json.loads((REFERENCE / 'wet_dome_layers.json').read_text())['rows'][row]
    if row['gs_gl'] == 1.0:
        pytest.skip('the truth is for contact angles above 0')
    height, _ = capillary.truth(DOME, Liquid(row['gl'], row['gs_gl'] * row['gl']))
    assert height == pytest.approx(row['exact_bath'], rel=1e-6)


@pytest.mark.parametrize('ratio', [0.3, 0.8])
def test_a_cylinder_is_pulled_by_its_line_alone(ratio):
    """Wilhelmy: 2 π r γ cos θ, for the truth and for the force balance on layers."""
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


def test_no_rise_is_no_rise():
    assert capillary.truth(CONE, Liquid(0.073, 0.3 * 0.073)) == (0.0, 0.0)


def test_exact_meniscus_and_minimiser_come_out_as_they_should(rungs):
    for shape in capillary.SHAPES:
        exact = rungs[shape.name, capillary.EXACT]
        assert exact.worst_height_error < 1e-9 and exact.worst_force_error < 1e-8
        # A dozen sectors: that much, and no more.
        assert 1e-3 < rungs[shape.name, 'minimised'].worst_height_error < 0.15
        assert rungs[shape.name, 'minimised'].worst_force_error < 0.15


def test_balances_are_off_by_what_the_page_says(rungs):
    for shape in capillary.SHAPES:
        assert rungs[shape.name, 'energy'].worst_height_error < 0.15
        assert 0.3 < rungs[shape.name, 'energy'].force_error < 0.8
        thesis = rungs[shape.name, 'thesis']
        assert thesis.worst_height_error > 3.0 * rungs[shape.name, 'energy'].worst_height_error
    assert rungs['truncated cone', 'thesis'].height_error > 1.4
    assert rungs['cylinder', 'force'].force_error < 0.01 < rungs['dome', 'force'].force_error


def test_dry_cases_are_called_dry_by_all(rungs):
    for (shape, family), rung in rungs.items():
        assert rung.false == rung.refused == 0
        cases = 1 if family == 'minimised' else 2
        assert len(rung.cases) == cases
        assert rung.dry == (shape == 'truncated cone' and cases == 2)
        assert all(case.status for case in rung.cases)


def test_traps_are_named(rows):
    said = {(t.rung, t.given): t for t in rows if isinstance(t, capillary.Trap)}
    steep = 'dome, water, θ = 100°'
    assert said['thesis', steep].said == 'dry' and said['thesis', steep].true.endswith(' mm')
    assert said['energy', steep].said.endswith(' mm')
    low = 'dome 1.1 mm high, water, γs/γl = 0.8'
    for balance in capillary.BALANCES:
        assert said[balance, low].said == 'saturated'
    assert said[capillary.EXACT, low].said == 'rim'
    assert said['minimised', low].said.startswith('NoSurface')
    tall = said['thesis', 'dome 1.44 mm high, water, γs/γl = 0.7']
    assert tall.said == 'saturated' and float(tall.true.removesuffix(' mm')) < 1.44
    for shape in ('truncated cone', 'cylinder'):
        for balance in ('thesis', 'force'):
            assert said[balance, f'{shape}, water, γs/γl = 0.8'].said == 'far_off'
    wide = [trap for trap in said.values() if trap.given.endswith('9 mm apart')]
    assert [trap.said for trap in wide] == ['far_apart'] and wide[0].true.endswith(' mm')
    slope = said['energy', 'truncated cone, water, θ = 75°']
    assert (slope.said, slope.true) == ('dry', 'no rise')
    assert said['energy', 'dome, 1 mN/m, γs/γl = 0.3, 10 layers'].said == 'coarse'
    overlaps = [trap for trap in said.values() if trap.true == 'they overlap']
    assert len(overlaps) == 2
    assert all(trap.said.startswith('MeshError') for trap in overlaps)


def test_rows_are_json(rows):
    json.dumps([asdict(row) for row in rows], allow_nan=False)
    assert {row.kind for row in rows} == {'rung', 'trap', 'speed'}


def test_table_and_picture(rows, tmp_path):
    assert chart.LADDERS['capillary'] is capillary
    text = chart.TABLES['capillary'](rows)
    assert '100 sections' not in text and '20 sections' in text and 'not installed' in text
    assert text.count('exact meniscus  ') >= len(capillary.SHAPES)
    pictures = capillary.figures(rows)
    assert set(pictures) == {'capillary'}
    pictures['capillary'].savefig(tmp_path / 'it.png')
    assert (tmp_path / 'it.png').stat().st_size > 20_000
    panels = pictures['capillary'].axes
    assert len(panels) == 9
    # One mark for each rung at its time and error, where the scale has room.
    energy = next(row for row in rows if getattr(row, 'family', '') == 'energy')
    points = [
        line.get_xydata()[0].tolist() for line in panels[0].lines if len(line.get_xdata()) == 1
    ]
    assert [energy.ms_per_solve, energy.height_error] in points
