# SPDX-License-Identifier: Apache-2.0
"""The other methods fail as documented, and those of ros_pad do not."""

import numpy as np
import pytest

from ros_pad.simulation import Scene
from studies.work_precision import stability

pytestmark = pytest.mark.slow


def test_creep_of_mujoco_does_not_shrink_with_the_step(monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'CREEP_STEPS', (1e-3, 4e-3))
    found = {}
    for row in stability.creep():
        found.setdefault(row.method, []).append(row)
    speeds = {name: np.array([row.value for row in part]) for name, part in found.items()}
    plain = speeds['elliptic, impratio 1']
    assert plain == pytest.approx(5.65e-3, rel=2e-3)
    for ratio in (1, 10, 100):
        name = f'elliptic, impratio {ratio}'
        assert speeds[name] == pytest.approx(plain / ratio, rel=1e-4)
        assert [row.law for row in found[name]] == pytest.approx(speeds[name], rel=1e-6)
        assert all(row.fails for row in found[name]) == (ratio < 100)
    assert speeds['elliptic, impratio 10, noslip 5'].max() < 1e-9
    assert speeds['elastic'].max() < 2e-7


@pytest.mark.parametrize('ratio', [1.03, 1.3])
def test_one_per_cent_of_friction_near_the_threshold(ratio):
    """While the foot slips, the body accelerates in proportion to cap less drag: c/(c - F)."""
    assert stability.condition(ratio, 1e-3) == pytest.approx(ratio / (ratio - 1.0), rel=0.07)


def test_damped_feet_come_to_rest_up_to_the_step_of_the_law(monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'STEPS', (1e-4,))
    limits = {row.method: row.limit for row in stability.feet() if 'damped' in row.case}
    for name, late in (('explicit Euler', False), ('semi-implicit Euler', True)):
        for share, rests in ((0.9, True), (1.1, False)):
            dt = share * limits[name]
            advance = stability.by_euler(dt, 0.0, stability._LOSS, stability.GRAVITY, late)
            assert (stability._stood(lambda *_, way=advance: way, dt) < 0.01) == rests
    assert limits['L2'] is None
    assert stability._stood(stability.by_row, 0.02) < 1e-12


def test_an_implicit_step_damps_a_bounce_as_its_law_says(monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'STEPS', (1e-4, 3e-4))
    bounces = [row for row in stability.feet() if 'spring' in row.case]
    first_order = [row for row in bounces if row.law is not None]
    assert {row.method for row in first_order} == {'explicit Euler', 'L2'}
    assert [row.value for row in first_order] == pytest.approx(
        [row.law for row in first_order], rel=0.03
    )
    assert max(row.value for row in bounces if row.law is None) < 1e-3


@pytest.mark.parametrize('mass', [0.02, 1.0, 30.0])
@pytest.mark.parametrize('name', ['hexapod_patches', 'quadruped_patches'])
def test_a_block_is_a_spring_in_series(name, mass):
    pytest.importorskip('mujoco')
    scene = Scene.load(name)
    assert stability.sunk(scene, mass) == pytest.approx(stability.sunk_law(scene, mass), rel=1e-3)
    assert stability.sunk_law(scene, mass) > 1.3


def test_a_foot_without_a_block_sinks_as_its_pads():
    pytest.importorskip('mujoco')
    assert stability.sunk_on_l2() == pytest.approx(1.0, rel=1e-6)


def test_an_explicit_film_holds_up_to_the_step_of_its_law():
    limit = stability.FILM_LIMIT
    assert stability.thinned(0.5 * limit, explicit=True) < 0.02
    assert stability.thinned(1.1 * limit, explicit=True) > 0.1
    assert stability.thinned(3.0 * limit, explicit=True) > 1e3
    assert stability.thinned(3.0 * limit, explicit=False) < 1e-12
