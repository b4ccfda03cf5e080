# SPDX-License-Identifier: Apache-2.0
import gc
import importlib.util
import pathlib
import sys

import pytest

from ros_pad.nodes.regulator import RegulatorNode

PATH = pathlib.Path(__file__).resolve().parents[2] / 'bench' / 'soak.py'
spec = importlib.util.spec_from_file_location('bench_soak', PATH)
bench = importlib.util.module_from_spec(spec)
sys.modules['bench_soak'] = bench  # dataclasses look their module up
spec.loader.exec_module(bench)


@pytest.fixture(autouse=True)
def busy(monkeypatch):
    """Have as much happen in seconds as otherwise in minutes."""
    monkeypatch.setattr(bench, 'ROUND', 8.0)
    monkeypatch.setattr(bench, 'FAULT_EVERY', 2.0)
    monkeypatch.setattr(bench, 'SUPPLY_EVERY', 20.0)
    monkeypatch.setattr(bench, 'TROUBLE_EVERY', 2.0)
    monkeypatch.setattr(bench, 'VENT_EVERY', 3.0)
    yield
    gc.collect()  # lifecycle nodes hold themselves


def test_twenty_seconds_without_a_missed_vent():
    result = bench.run(20.0, seed=6)
    assert result.missed == 0
    assert result.set_points > 6000
    assert result.refused > 300
    assert result.faults > 20
    assert result.stops > 10
    assert result.passes > 0
    assert result.calls > 2
    assert 0.3 <= result.reaction <= 0.31 + 1e-6
    assert result.ceiling_reaction <= 0.31 + 1e-6
    assert result.threads[0] == result.threads[1]


def test_a_soak_follows_from_its_seed():
    def figures(seed):
        found = bench.run(5.0, seed)
        return found.set_points, found.refused, found.faults, found.stops, found.calls

    assert figures(1) == figures(1) != figures(2)


real_tick = RegulatorNode._tick


def never_late(node, now_ns):
    for channel in node.channels.values():
        if channel.commanded_ns is not None:
            channel.commanded_ns = now_ns
    real_tick(node, now_ns)


@pytest.mark.parametrize(
    ('name', 'defect'),
    [
        ('_tick', never_late),  # commands that stop are not noticed
        ('_hold', lambda node, channel, reason: None),  # nor is the ceiling
        ('vent', lambda node, reason: None),  # nor what is asked for
    ],
)
def test_defects_of_the_node_are_missed_vents(monkeypatch, name, defect):
    monkeypatch.setattr(RegulatorNode, name, defect)
    assert bench.run(20.0, seed=6).missed > 0
