# SPDX-License-Identifier: Apache-2.0
"""Bounds keep what they promise on scenes to which they were not fitted."""

import dataclasses
import itertools
import json
import math

import numpy as np
import pytest

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
        low, high = conformal.interval(sum(kept), len(kept), 0.999)
        assert low <= study.PROMISE <= high, name


def test_bounds_of_the_slip_on_l1_are_of_no_use():
    """Its feet stick where those of L2 scuff."""
    assert DOCUMENT['ch3r']['bounds']['L1 slip']['median_error'] > 0.8
    scene = dataclasses.replace(Scene.load('hexapod_dry_slow'), metric='slip')
    assert fidelity.choose(scene, 'L1').bound > 0.8


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
    assert found['friction distance'] == pytest.approx(0.05)  # against L1
    assert found['friction slip'] == pytest.approx(0.5)
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


def test_fit_finds_a_quantile_that_depends_on_a_feature():
    """Logarithms are 2 x - 3 plus an exponential law, whose 90 % quantile is ln 10.

    With its density there, 0.1, a quantile of 400 values has a standard error of 0.15, the
    constant twice that, the slope 0.15/0.29. Tolerances are three standard errors of eight fits.
    """
    random, lines = np.random.default_rng(5), []
    for _ in range(8):
        known = np.column_stack([random.uniform(0.0, 1.0, 400), np.ones(400)])
        errors = np.exp(2.0 * known[:, 0] - 3.0 + random.exponential(size=400)) - conformal.LEAST
        errors[errors > 10.0] = math.inf  # what is out of reach does not move a quantile
        lines.append(conformal.fit(known, errors, 0.9))
    constant, slope, fixed = np.mean(lines, axis=0)
    assert fixed == 0.0  # the second feature does not vary
    assert constant == pytest.approx(math.log(10.0) - 3.0, abs=0.32)
    assert slope == pytest.approx(2.0, abs=0.55)


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


def test_intervals():
    """Clopper and Pearson's for 8 of 10, from tables: 0.444 to 0.975."""
    assert conformal.interval(8, 10) == pytest.approx((0.4439, 0.9748), abs=1e-4)


def test_a_stopped_run_goes_on_where_it_stopped(tmp_path, monkeypatch):
    walked = []

    def walks(robot, seed):
        walked.append((robot, seed))
        return {'top': [1.0, 0.0, 0.1]}

    monkeypatch.setattr(study, 'walks', walks)
    monkeypatch.setattr(
        study.command, 'in_processes', lambda task, cases, *_: [task(*case) for case in cases]
    )
    path = tmp_path / 'store' / 'walks.jsonl'
    study.measure(path, [('ch3r', 0), ('go2', 0)], 1)
    found = study.measure(path, [('ch3r', 0), ('go2', 0), ('ch3r', 1)], 1)
    assert walked == [('ch3r', 0), ('go2', 0), ('ch3r', 1)]
    assert [(row['robot'], row['seed']) for row in found] == walked


def test_drawn_scenes_are_within_the_ranges(robots=tuple(random_scenes.BASES)):
    for robot in robots:
        for seed in range(12):
            scene, policy = random_scenes.draw(robot, seed)
            drawn = {'ranges': random_scenes.ranges(robot), 'features': {}}
            assert not fidelity.Promises({robot: drawn}).beyond(scene, policy)
