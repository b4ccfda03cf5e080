# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest

from studies import __main__ as studies
from studies.work_precision import thickness

pytest.importorskip('skfem')
pytestmark = pytest.mark.slow

from studies.work_precision.solid import Rubber, Solid  # noqa: E402

ROWS = json.loads(thickness.REFERENCE.read_text())['rows']


@pytest.mark.parametrize('row', [ROWS[0], ROWS[3], ROWS[14], ROWS[18]], ids=lambda r: r['clamp'])
def test_solids_against_another_program(row):
    modulus, radius = 2.0 * row['C_Pa'][0], row['radius_m']
    edge = {'bond': 'bonded', 'side': 'clamped'}[row['clamp']]
    rubber = Rubber(*(c / modulus for c in row['C_Pa']))
    solid = Solid(rubber, row['thickness_m'] / radius, edge, 3)
    height = row['height_outer_m'] / radius
    *_, last = solid.path(0.1, height)
    found = solid.solve(last, None, row['pressure_Pa'] / modulus)
    assert found.outer == pytest.approx(height, rel=0.005)
    assert found.inner == pytest.approx(row['height_inner_m'] / radius, rel=0.005)


@pytest.mark.parametrize('ratio', [0.1, 0.05, 0.025])
def test_a_clamped_solid_bends_like_a_plate(ratio):
    *_, last = Solid(Rubber(), ratio, 'clamped', 3).path(0.01 * ratio, 0.02 * ratio)
    # With shear (Mindlin, κ = 5/6) and D = μ h³/3: w = p r⁴/(64 D) + p r²/(4 κ μ h). The clamp,
    # which holds the sheet over its whole thickness, adds a share in proportion to it.
    expected = 64.0 / 3.0 * ratio**2 / (1.0 + 6.4 * ratio**2) * last.outer
    assert last.pressure / ratio == pytest.approx(expected, rel=0.35 * ratio)


def test_derivatives_of_the_energy():
    """The tangent matrix is the derivative of the forces, with I2 too."""
    solid = Solid(Rubber(0.3, 0.05, -0.001, 0.2), 0.3, 'bonded', 1)
    rng = np.random.default_rng(1)
    x = np.append(0.01 * rng.standard_normal(solid._size), rng.standard_normal(solid._full))
    x = x[: solid._full]
    step = 1e-6 * rng.standard_normal(x.size)
    above, below = solid._assemble(x + step), solid._assemble(x - step)
    _, matrix, push, more, _ = solid._assemble(x)
    np.testing.assert_allclose(above[0] - below[0], 2.0 * (matrix @ step), rtol=0, atol=1e-11)
    np.testing.assert_allclose(above[2] - below[2], 2.0 * (more @ step), rtol=0, atol=1e-11)
    assert above[4] - below[4] == pytest.approx(2.0 * push @ step, rel=1e-6)


def test_the_study(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(thickness, 'HELD_LAWS', thickness.HELD_LAWS[-1:])
    monkeypatch.setattr(thickness, 'HELD_RATIOS', (0.35,))
    monkeypatch.setattr(thickness, 'THIN', (0.02,))
    rows = tmp_path / 'rows.json'
    rows.write_text(json.dumps({'rows': ROWS[18:19]}))
    monkeypatch.setattr(thickness, 'REFERENCE', rows)
    assert studies.main(['thickness', '--out', str(tmp_path)]) == 0
    out = capsys.readouterr().out
    kept = json.loads((tmp_path / 'thickness.json').read_text())
    assert (tmp_path / 'thickness.png').stat().st_size > 10_000
    # Of another program: +1.8 %.
    assert kept['thin'][1]['more'] == pytest.approx(0.018, abs=0.001)
    assert f'{kept["thin"][1]["more"]:.4g}' in out
    for row in kept['summary']:
        assert row['pressure'] < 0.025 and row['height'] < 0.025 and row['volume'] < 0.04
