# SPDX-License-Identifier: Apache-2.0
"""Bounds keep what they promise on scenes to which they were not fitted."""

import dataclasses
import itertools
import json
import math

import numpy as np
import pytest
from scipy import stats

from ros_pad.simulation import fidelity
from ros_pad.simulation.scene import Scene
from studies.closed_loop import conformal, random_scenes
from studies.closed_loop import fidelity as study
from studies.command import CHARTS

DOCUMENT = json.loads((CHARTS / 'fidelity.json').read_text(encoding='utf-8'))['robots']
ROBOTS = sorted(DOCUMENT)


def test_the_file_of_bounds_has_the_robots_and_ranges_of_the_study():
    found = fidelity.Promises.load().robots
    assert [*found] == [*DOCUMENT]
    for robot in ROBOTS:
        ranges = {name: tuple(ends) for name, ends in found[robot]['ranges'].items()}
        assert ranges == random_scenes.ranges(robot)


def test_the_page_has_the_table_of_the_study():
    page = study.PAGE.read_text(encoding='utf-8')
    assert study.pasted(page) == page


@pytest.mark.parametrize('robot', ROBOTS)
def test_bounds_keep_their_promise_on_stored_walks(robot):
    """Scenes are drawn anew here; their errors were stored by the study.

    The share kept must be one that 95 % makes likely: its 99.9 % interval holds 95 %.
    """
    stored, promises = DOCUMENT[robot], fidelity.Promises.load()
    walks = random_scenes.unlisted(stored['walks'])
    scenes = [random_scenes.draw(robot, int(walk['seed'])) for walk in walks]
    assert not [why for scene, policy in scenes if (why := promises.beyond(scene, policy))]
    for name, row in stored['bounds'].items():
        level, _, metric = name.rpartition(' ')
        kept = []
        for (scene, policy), walk in zip(scenes, walks, strict=True):
            if name in walk:
                asked = dataclasses.replace(scene, metric=metric)
                kept.append(walk[name] <= promises.bound(level, asked, policy))
        assert len(kept) == row['held_out']
        # Bounds and errors are stored with four digits.
        assert np.mean(kept) == pytest.approx(row['kept'], abs=1.5 / len(kept))
        likely = stats.binomtest(sum(kept), len(kept)).proportion_ci(0.999, 'exact')
        assert likely.low <= study.PROMISE <= likely.high, name


@pytest.mark.slow
def test_bounds_hold_on_fresh_scenes():
    """Of eight bounds that are promised for 95 of 100, at most one is broken."""
    pytest.importorskip('mujoco')
    kept = []
    drawn = ((seed, *random_scenes.draw('ch3r', seed)) for seed in range(300000, 300100))
    flat = (each for each in drawn if each[2] == 'flat')  # the fastest to walk
    for seed, scene, policy in itertools.islice(flat, 4):
        scene = dataclasses.replace(scene, cycles=4)
        walks = {
            name: random_scenes.walk(scene, policy, seed, name[-2:], top=name == 'top L2')
            for name in ('L1', 'L2', 'top L2')
        }
        errors = study.errors(scene, walks | {'top': walks['top L2']})
        for level in ('L1', 'L2'):
            kept.append(errors[f'{level} distance'] <= fidelity.choose(scene, level, policy).bound)
    assert sum(kept) >= len(kept) - 1


# --- errors and conformal prediction ----------------------------------------------------------


def test_errors_by_hand():
    """Ten cycles of 0.14 m: errors are relative to 0.7 m and 28 mm at least."""
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=10)
    found = study.errors(
        scene,
        {'L1': (1.4, 0.0, 0.1), 'L2': (1.0, 0.05, 0.2), 'top': (0.5, 0.04, 1.0),
         'friction': (1.33, 0.014, 0.1)},
    )  # fmt: skip
    assert found['L1 distance'] == pytest.approx(0.9 / 0.7)
    assert found['no slip distance'] == pytest.approx(0.9 / 0.7)
    assert found['L2 distance'] == pytest.approx(0.5 / 0.7)
    assert found['L2 slip'] == pytest.approx(0.25)
    assert found['friction distance'] == pytest.approx(0.33)  # against L2
    assert found['friction slip'] == pytest.approx(0.036 / 0.05)
    assert 'no slip slip' not in found
    lost = study.errors(scene, {'L1': (1.4, 0.0, 0.1), 'L2': None, 'top': None, 'friction': None})
    assert lost['L1 distance'] == math.inf
    assert not [name for name in lost if name.startswith(('L2', 'friction'))]


def test_shift_is_an_order_statistic():
    """With n scenes it is the ceil(0.95 (n + 1))-th smallest distance from the line."""
    flat, known = np.array([math.log(0.1), 0.0]), np.zeros((39, 1))
    errors = 0.1 * np.exp(np.arange(39.0) - 10.0) - conformal.LEAST
    order = np.random.default_rng(1).permutation(39)
    assert conformal.shift(flat, known, errors[order], 0.95) == pytest.approx(37.0 - 10.0)
    assert conformal.shift(flat, known[:18], errors[:18], 0.95) == math.inf
    assert conformal.shift(flat, known[:19], errors[:19], 0.95) == pytest.approx(8.0)
    errors[-3:] = math.inf
    assert conformal.shift(flat, known, errors, 0.95) == math.inf


def test_calibrated_bounds_cover_whatever_the_law():
    """A line fitted to few scenes with a wrong form covers 95 % of others after its shift."""
    random, kept = np.random.default_rng(7), []
    for _ in range(40):
        known = random.normal(size=(300, 1))
        errors = np.exp(np.sin(3.0 * known[:, 0]) + random.standard_t(2, 300))
        line = conformal.fit(known[:30], errors[:30])
        line[0] += conformal.shift(line, known[30:129], errors[30:129], 0.95)
        kept.append(np.mean(errors[129:] <= conformal.bounds(line, known[129:])))
    assert np.mean(kept) == pytest.approx(0.95, abs=0.012)  # three standard errors: 40 shifts


def test_drawn_scenes_are_within_the_ranges(robots=tuple(random_scenes.BASES)):
    for robot in robots:
        for seed in range(12):
            scene, policy = random_scenes.draw(robot, seed)
            drawn = {'ranges': random_scenes.ranges(robot), 'features': {}}
            assert not fidelity.Promises({robot: drawn}).beyond(scene, policy)
