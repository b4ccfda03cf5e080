# SPDX-License-Identifier: Apache-2.0
"""The other methods fail as documented, and those of ros_pad do not."""

import numpy as np
import pytest

from ros_pad.simulation import Scene
from studies.work_precision import stability

pytestmark = pytest.mark.slow


def test_creep_of_mujoco_does_not_shrink_with_the_step_and_that_of_l2_grows(monkeypatch):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'CREEP_STEPS', (1e-3, 4e-3))
    found = {}
    for row in stability.creep():
        found.setdefault(row.method, []).append(row)
    speeds = {name: np.array([row.value for row in part]) for name, part in found.items()}
    plain = speeds['elliptic cone']
    assert plain == pytest.approx(5.65e-3, rel=2e-3)
    for ratio in (100, 3000):
        assert speeds[f'elliptic, impratio {ratio}'] == pytest.approx(plain / ratio, rel=1e-4)
    for part in found.values():
        values, expected = zip(*((row.value, row.law) for row in part), strict=True)
        assert None in expected or expected == pytest.approx(values, rel=1e-5)
    # Ours creeps faster than MuJoCo's own contact at the same impratio.
    assert speeds['L2'][0] > speeds['L2'][1] > 20.0 * speeds['elliptic, impratio 3000'][1]
    assert speeds['elliptic, noslip'].max() < 1e-9


def _rows(monkeypatch, steps):
    pytest.importorskip('mujoco')
    monkeypatch.setattr(stability, 'STEPS', steps)
    return {(row.case, row.method, row.at): row for row in stability.feet()}


def test_feet_stand_up_to_the_step_of_the_law(monkeypatch):
    rows = _rows(monkeypatch, (1e-3,))
    limit = rows['standing', stability.DIRECT, 1e-3].limit
    direct = stability.METHODS[stability.DIRECT]
    assert stability._stood(direct, 0.9 * limit) < 0.01 < stability._stood(direct, 1.1 * limit)
    assert all(not row.fails for (case, *_), row in rows.items() if case == 'standing')
    assert stability._stood(stability.by_mujoco, 0.02) < 1e-12


def test_the_step_of_l2_damps_a_bounce_as_its_law_says_and_others_do_not(monkeypatch):
    rows = _rows(monkeypatch, (1e-4, 3e-4, 1e-3, 2e-3))
    for dt in (1e-4, 3e-4):
        row = rows['bounce without damper', 'L2', dt]
        assert row.value == pytest.approx(row.law, rel=0.03)
    for name in list(stability.METHODS)[1:]:
        assert rows['bounce without damper', name, 1e-3].value < 2e-3
        landing = rows['landing at 0.1 m/s', name, 1e-4].value
        assert landing < rows['landing at 0.1 m/s', 'L2', 1e-4].value


@pytest.mark.parametrize('mass', [0.02, 1.0, 30.0])
@pytest.mark.parametrize('name', ['hexapod_patches', 'quadruped_patches'])
def test_a_block_is_a_spring_in_series(name, mass):
    pytest.importorskip('mujoco')
    scene = Scene.load(name)
    assert stability.sunk(scene, mass) == pytest.approx(stability.sunk_law(scene, mass), rel=1e-3)
    assert stability.sunk_law(scene, mass) > 1.3


def test_a_foot_without_a_block_sinks_as_its_pads():
    pytest.importorskip('mujoco')
    assert stability.sunk_alone('L2') == pytest.approx(1.0, rel=1e-6)
    assert stability.sunk_alone(stability.DIRECT) == pytest.approx(1.0, rel=2e-4)
    assert stability.sunk_alone(stability.LOOSE) > 8.0


def test_a_film_with_the_load_at_the_end_of_a_step_is_off_by_its_law():
    assert stability.thinned(2e-3, 1.0) == pytest.approx(stability.film_law(2e-3), rel=1e-9)
    assert stability.thinned(2e-3, 0.5) < 1e-12
    assert stability.thinned(2e-3, None, rtol=1e-9, atol=1e-15) < 1e-6
