# SPDX-License-Identifier: Apache-2.0
"""Figures 38, 39 and 41 to 44 of the thesis show walks; verdicts follow from the walks."""

import dataclasses

import pytest

from ros_pad.simulation import Scene
from ros_pad.trials import run
from studies.thesis import walks

pytestmark = pytest.mark.slow

SEEDS = 1, 2


@pytest.fixture(scope='module')
def walked():
    """Return short walks: of the leg to the end of its rail, of the hexapod 11 cycles."""
    found = {}
    for name in walks.RAIL:
        cycles = 56 if name in ('leg_wet_flat', 'leg_wet_dome_40') else 14
        scene = dataclasses.replace(Scene.load(name), cycles=cycles)
        found[name, 0] = run(scene)
    for case in walks.CASES:
        scene = dataclasses.replace(Scene.load(f'hexapod_smooth_{case}'), cycles=11)
        found |= {(scene.name, seed): run(scene, seed=seed) for seed in SEEDS}
    return found


@pytest.fixture(autouse=True)
def two_seeds(monkeypatch):
    monkeypatch.setattr(walks, 'SEEDS', SEEDS)


def verdicts(walked, number):
    (found,) = walks.draw(walked, (number,))
    assert found.number == number
    return [claim.holds for claim in found.claims]


def swapped(walked, one, other):
    names = {one: other, other: one}
    return {(name, seed): walked[names.get(name, name), seed] for name, seed in walked}


def test_short_walks_have_the_verdicts_of_the_docs(walked, agree):
    """The study walks longer, and on three floors."""
    for number in (38, 39, 42, 44):
        (found,) = walks.draw(walked, (number,))
        agree(found.claims)


def test_walks_that_contradict_the_thesis_do_not_hold(walked):
    mixed = swapped(walked, 'leg_dry_flat', 'leg_wet_flat')
    assert verdicts(mixed, 38) == [False, False, True]
    assert verdicts(mixed, 39) == [False, False, True]
    mixed = swapped(walked, 'leg_wet_dome_75', 'leg_wet_dome_40')
    assert verdicts(mixed, 39) == [False, False, False]


def test_claims_of_the_thesis_about_the_hexapod(walked):
    assert verdicts(walked, 42) == [True, True, True, True]
    names = [f'hexapod_smooth_{case}' for case in ('dry_flat', 'wet_flat', 'wet_dome')]
    assert verdicts(swapped(walked, names[0], names[1]), 42)[:2] == [False, False]
    assert verdicts(swapped(walked, names[1], names[2]), 42)[2] is False


def test_paths_that_leave_their_course(walked):
    def aside(drift, *cases):
        """Return the walks of some cases, all so far aside, m."""
        found = {}
        for case in cases:
            for key in ((f'hexapod_smooth_{case}', seed) for seed in SEEDS):
                own = dataclasses.replace(
                    walked[key].metrics, lateral_drift_m=drift, distance_m=1.0
                )
                found[key] = dataclasses.replace(walked[key], metrics=own)
        return found

    straight = aside(0.001, *walks.CASES)
    assert verdicts(straight, 44) == [False, True]
    assert verdicts(straight | aside(-0.1, 'wet_flat'), 44) == [True, True]
    assert verdicts(straight | aside(0.1, 'wet_dome'), 44) == [False, False]
