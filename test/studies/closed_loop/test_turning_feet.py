# SPDX-License-Identifier: Apache-2.0
"""The study turning_feet, on made-up walks."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('mujoco')
from studies.closed_loop import turning_feet


def walk(rate_of, seed: int = 0):
    """Return a walk of six feet that always stand, and may slip in half of each cycle of 1 s."""
    draw = np.random.default_rng(seed)
    stamps = 0.004 * np.arange(1, 9951)  # ends within a half cycle
    phase = (stamps[:, None] + 0.5 * (np.arange(6) % 2)) % 1.0
    # Feet slip in the first half of every second cycle.
    slips = (phase < 0.5) & (((stamps[:, None] + 0.5 * (np.arange(6) % 2)) // 1.0) % 2 == 0)
    speed = np.where(slips, 0.05, 0.0)
    rate = rate_of(phase, slips, draw)
    return turning_feet.Walk(0.004, 10.0, stamps, np.full(speed.shape, 10.0), speed, rate, slips)


def test_a_rate_that_follows_the_gait_alone_shows_nothing_at_one_phase():
    found = turning_feet.own_robot(
        [walk(lambda phase, slips, draw: np.where(phase < 0.5, 2.0, 0.1))], 1.0
    )
    # Slips are above the two thirds of stick in the other half, and equal to the rest.
    assert found['auc'] == pytest.approx(2.0 / 3.0 + 1.0 / 6.0, abs=0.01)
    assert found['auc_at_same_phase'] == pytest.approx(0.5, abs=0.01)


def test_a_rate_that_follows_slip_shows_all_at_one_phase():
    found = turning_feet.own_robot(
        [walk(lambda phase, slips, draw: np.where(slips, 2.0, 0.1))], 1.0
    )
    assert found['auc_at_same_phase'] == pytest.approx(1.0, abs=0.01)
    shipped = found['alarms']['alarm as shipped']
    assert shipped['missed'] == 0.0 and shipped['false_per_minute'] == 0.0
    assert shipped['on_in_slip'] == 1.0 and shipped['on_in_stick'] == 0.0


def test_walks_of_the_robot_are_measured():
    found = turning_feet.walked(cycles=2, seed=0)
    assert found.load.shape == found.speed.shape == found.rate.shape == (len(found.stamps), 6)
    # Shanks turn only after the first step.
    assert found.rate[found.stamps < 0.5].max() < 0.5
    assert np.median(found.rate[found.begun]) > 0.05
