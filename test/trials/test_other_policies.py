# SPDX-License-Identifier: Apache-2.0
"""Walks in other processes give what they give in this one, however these processes end."""

import contextlib
import dataclasses
import os
import signal

import pytest

from ros_pad import workers
from ros_pad.estimation.scales import Scale
from ros_pad.simulation.scene import Scene
from ros_pad.trials import loop, other_policies
from ros_pad.trials.node_settings import tuning_for

SCENE = dataclasses.replace(Scene.load('hexapod_patches'), cycles=2)
POLICIES = ('flat', 'dome', 'oracle')


@pytest.fixture
def shown():
    """Return a bar that notes its texts and its last places."""
    texts, places = [], {}

    @contextlib.contextmanager
    def bar(text, total):
        texts.append(text.split()[0])
        yield lambda place: places.__setitem__(text.split()[0], place)

    bar.texts, bar.places = texts, places
    return bar


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(other_policies, 'SHORTEST', 0.0)


def expected(tuning=None):
    return {p: loop.run(SCENE, p, 1, 'L1', tuning=tuning).metrics for p in POLICIES}


@pytest.mark.parametrize('cores', [1, 8])
def test_results_and_their_order_do_not_depend_on_the_cores(monkeypatch, shown, cores):
    """They have the tuning given: with another friction on wet ground feet find less of it."""
    tuning = tuning_for(SCENE, 'markers')
    tuning = dataclasses.replace(tuning, scales={'flat_wet': Scale(3.0, 0.01)})
    monkeypatch.setattr(workers, 'cores', lambda: cores)
    with other_policies.beside(SCENE, POLICIES, 1, 'L1', 'markers', tuning) as metrics:
        found = metrics(shown)
    assert found == expected(tuning)
    assert found['flat'].wet_accuracy < loop.run(SCENE, 'flat', 1, 'L1').metrics.wet_accuracy
    assert list(found) == list(POLICIES)
    assert sorted(shown.texts) == sorted(POLICIES)


def test_a_process_that_is_killed_costs_no_result(monkeypatch, shown):
    monkeypatch.setattr(workers, 'cores', lambda: 3)
    opened = []
    pool = workers.pool

    @contextlib.contextmanager
    def watched(*given):
        with pool(*given) as executor:
            opened.append(executor)
            yield executor

    monkeypatch.setattr(workers, 'pool', watched)
    with other_policies.beside(SCENE, POLICIES, 1, 'L1', 'markers', None) as metrics:
        for pid in list(opened[0]._processes):
            os.kill(pid, signal.SIGKILL)
        assert metrics(shown) == expected()
