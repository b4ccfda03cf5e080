# SPDX-License-Identifier: Apache-2.0
"""The other methods fail as documented, and those of ros_pad do not."""

import numpy as np
import pytest

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
