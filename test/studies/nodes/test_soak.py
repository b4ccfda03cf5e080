# SPDX-License-Identifier: Apache-2.0
import gc

import pytest

from ros_pad.regulators.channel import SupervisedChannel
from studies.nodes import soak

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def busy(monkeypatch):
    """Let as many events happen in seconds as otherwise in minutes."""
    monkeypatch.setattr(soak, 'ROUND', 8.0)
    monkeypatch.setattr(soak, 'FAULT_EVERY', 2.0)
    monkeypatch.setattr(soak, 'SUPPLY_EVERY', 20.0)
    monkeypatch.setattr(soak, 'TROUBLE_EVERY', 2.0)
    monkeypatch.setattr(soak, 'VENT_EVERY', 3.0)
    yield
    gc.collect()  # lifecycle nodes are in reference cycles


def test_twenty_seconds_without_a_missed_vent():
    result = soak.run(20.0, seed=6)
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
        found = soak.run(5.0, seed)
        return found.set_points, found.refused, found.faults, found.stops, found.calls

    assert figures(1) == figures(1) != figures(2)


@pytest.mark.parametrize(
    ('name', 'defect'),
    [
        ('expire', lambda channel, elapsed_ns: None),  # no command timeout
        ('hold', lambda channel, reason, fault: None),  # no reaction to the ceiling
        ('deactivate', lambda channel, reason: None),  # no reaction to ~/vent
    ],
)
def test_defects_of_the_supervision_are_missed_vents(monkeypatch, name, defect):
    monkeypatch.setattr(SupervisedChannel, name, defect)
    assert soak.run(20.0, seed=6).missed > 0
