# SPDX-License-Identifier: Apache-2.0
"""The other methods fail as documented, and those of ros_pad do not."""

import math

import numpy as np
import pytest

from studies.work_precision import stability
from studies.work_precision.friction import elastic

pytestmark = pytest.mark.slow

MASS, INERTIA = stability.MASS, stability.INERTIA


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


def test_where_iterations_fail_when_all_feet_slip():
    """The truth satisfies M (q - b) + dt Σ c Bᵀ ŝ = 0, the minimum of a convex function."""
    slides = stability.slides(30, seed=1)
    newton = 0
    for slide in slides:
        twist = np.array(slide.truth)
        rest = stability.MASSES @ (twist - slide.free)
        for foot in slide.feet:
            slip = np.array(foot.slip(slide.truth))
            rest += slide.dt * foot.cap * foot.arm()[:2].T @ slip / np.linalg.norm(slip)
        assert np.abs(rest).max() < 1e-4 * slide.dt * sum(foot.cap for foot in slide.feet)
        fails = not stability.miss(stability.fixed_point(slide), slide.truth) < 1e-6
        if slide.contraction > 1.0:
            assert fails
        if slide.contraction < 0.8:  # 0.8^100 = 2e-10
            assert not fails
        newton += not stability.miss(stability.full_newton(slide), slide.truth) < 1e-6
        ours = elastic(slide.free, MASS, INERTIA, slide.feet, slide.dt, slide.start)
        assert stability.miss(ours, slide.truth) < 1e-6
        for foot in slide.feet:
            assert math.hypot(foot.force_x, foot.force_y) == pytest.approx(foot.cap, rel=1e-5)
    assert newton > 2


def test_printed_flow_law_has_no_stable_step_and_ours_no_chatter(monkeypatch):
    # The step limit is 0.438 ms; with laminar flow, as in this hose, it is 0.479 ms.
    monkeypatch.setattr(stability, 'FILL_STEPS', (1e-4, 4.3e-4, 4.6e-4, 5e-3))
    for row in stability.filling():
        if row.method == stability.ISO:
            assert row.value > 0.05
            assert row.law is None or row.value == pytest.approx(row.law, rel=0.01)
        elif row.method == stability.ISO_LINEAR:
            assert row.fails == (row.at > 4.38e-4)
        else:
            assert row.value < 0.1


@pytest.mark.parametrize('ratio', [1.03, 1.3])
def test_one_per_cent_of_friction_near_the_threshold(ratio):
    """While the foot slips, the body accelerates in proportion to cap less drag: c/(c - F)."""
    assert stability.condition(ratio, 1e-3) == pytest.approx(ratio / (ratio - 1.0), rel=0.07)
