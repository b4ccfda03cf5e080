# SPDX-License-Identifier: Apache-2.0
"""bench/turning_feet.py, on walks that are made up."""

from __future__ import annotations

import importlib.util
import pathlib
import sys

import numpy as np
import pytest

pytest.importorskip('mujoco')
PATH = pathlib.Path(__file__).resolve().parent.parent / 'bench' / 'turning_feet.py'
spec = importlib.util.spec_from_file_location('bench_turning_feet', PATH)
bench = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = bench
spec.loader.exec_module(bench)


def walk(rate_of, seed: int = 0):
    """Return six feet that always stand; half a cycle of 1 s they may slip, the rest they rest."""
    draw = np.random.default_rng(seed)
    stamps = 0.004 * np.arange(1, 9951)  # ends in the midst of a half cycle
    phase = (stamps[:, None] + 0.5 * (np.arange(6) % 2)) % 1.0
    # In the first half of a cycle one whole cycle in two slips.
    slips = (phase < 0.5) & (((stamps[:, None] + 0.5 * (np.arange(6) % 2)) // 1.0) % 2 == 0)
    speed = np.where(slips, 0.05, 0.0)
    rate = rate_of(phase, slips, draw)
    return bench.Walk(0.004, 10.0, stamps, np.full(speed.shape, 10.0), speed, rate, slips)


def test_a_rate_that_follows_the_gait_alone_says_nothing_at_one_phase():
    found = bench.own_robot(
        [walk(lambda phase, slips, draw: np.where(phase < 0.5, 2.0, 0.1))], 1.0
    )
    # A slip beats the two thirds of stick in the other half, and ties with the rest.
    assert found['auc'] == pytest.approx(2.0 / 3.0 + 1.0 / 6.0, abs=0.01)
    assert found['auc_at_same_phase'] == pytest.approx(0.5, abs=0.01)


def test_a_rate_that_follows_slip_says_all_at_one_phase():
    found = bench.own_robot([walk(lambda phase, slips, draw: np.where(slips, 2.0, 0.1))], 1.0)
    assert found['auc_at_same_phase'] == pytest.approx(1.0, abs=0.01)
    shipped = found['alarms']['alarm as shipped']
    assert shipped['missed'] == 0.0 and shipped['false_per_minute'] == 0.0
    assert shipped['on_in_slip'] == 1.0 and shipped['on_in_stick'] == 0.0


def test_walks_of_the_robot_are_measured():
    found = bench.walked(cycles=2, seed=0)
    assert found.load.shape == found.speed.shape == found.rate.shape == (len(found.stamps), 6)
    # While it stands before its first step nothing turns; then shanks do.
    assert found.rate[found.stamps < 0.5].max() < 0.5
    assert np.median(found.rate[found.begun]) > 0.05
