# SPDX-License-Identifier: Apache-2.0
import csv
import dataclasses
import math
import os
import signal
import sqlite3
import sys

import numpy as np
import pytest
import scipy.stats

from ros_pad import configuration
from ros_pad.errors import ConfigError, InvalidInput, PadError
from ros_pad.simulation.scene import Scene
from ros_pad.trials import loop
from ros_pad.trials import sweep as sweeps
from ros_pad.trials.node_settings import tuning_for
from ros_pad.trials.sweep import Sweep, execution, plan, table
from ros_pad.trials.sweep.table import Results

LEG = 'leg_wet_flat'
SHORT = {'cycles': [2]}
SMALL = Sweep([LEG], ['flat', 'dome'], [0, 1], {**SHORT, 'body.rolling_drag': [0.5, 1.0]})


def without_pace(rows):
    """Return rows without the column that depends on the machine's speed."""
    return [{name: row[name] for name in row if name != 'real_time_factor'} for row in rows]


# --- jobs ---------------------------------------------------------------------------------------


def test_every_combination_is_there_once_and_in_order():
    jobs = SMALL.jobs()
    assert [list(job.labels.values()) for job in jobs] == [
        [LEG, policy, seed, 2, drag]
        for drag in (0.5, 1.0)
        for policy in ('flat', 'dome')
        for seed in (0, 1)
    ]
    assert len({job.key for job in jobs}) == 8
    assert [job.seed for job in jobs] == [0, 1] * 4
    assert {job.level for job in jobs} == {'L0'}
    for job in jobs:
        assert job.scene.cycles == 2
        assert job.scene.body.rolling_drag == job.labels['body.rolling_drag']


def test_values_land_where_they_belong():
    job = Sweep(
        ['hexapod_patches'],
        ['adaptive'],
        [3],
        {
            'tow.weight': [4],
            'floor.slope': [0.1],  # the file has the default
            'foot': ['large19'],
            'filter_period': [0.1],
            'policy.wet_above': [0.9],
        },
    ).jobs()[0]
    assert (job.scene.tow.weight, job.scene.floor.slope, job.scene.foot.source) == (
        4.0,
        0.1,
        'large19',
    )
    # The noise is still that of the scene's sensors.
    plain = tuning_for(Scene.load('hexapod_patches'))
    assert job.tuning == dataclasses.replace(plain, filter_period=0.1)
    assert job.policy_parameters == {'wet_above': 0.9}


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'scenes': ['leg_wet_fla']}, "'leg_wet_fla'.* Did you mean 'leg_wet_flat'"),
        ({'scenes': []}, 'scene: at least one'),
        ({'scenes': [LEG, LEG]}, f"scene = '{LEG}' is given twice"),
        ({'policies': ['brave']}, "policy = 'brave' is not allowed: one of flat, dome, adaptive"),
        ({'seeds': [-1]}, 'seed = -1 is not allowed: a whole number from 0 to 2147483647'),
        ({'fidelity': 'L2'}, "fidelity = 'L2' is not allowed: scene 'leg_wet_flat'"),
        ({'parameters': {'body.mass': [1.0, 1.0]}}, 'body.mass = 1.0 is given twice'),
        ({'parameters': {'body.mass': [1.0, 1e3]}}, 'body.mass=1000.0: .*mass .* 0.01 to 100 kg'),
        ({'parameters': {'body.mas': [1.0]}}, "body.mas=1.0: .* Did you mean 'mass'"),
        ({'parameters': {'foot.friction': [0.3]}}, "foot = 'large19' has no keys below it"),
        ({'parameters': {'estimator.filter_perio': [1]}}, "mean 'filter_period'"),
        ({'parameters': {'wet_prior': [2.0]}}, 'wet_prior=2.0: .*0.01 to 0.99'),
        ({'parameters': {'policy.wet_abov': [0.5]}}, "Did you mean 'policy.wet_above'"),
        ({'parameters': {'policy.wet_above': [0.5]}}, 'only adaptive has parameters'),
    ],
)  # fmt: skip
def test_what_is_not_allowed_is_refused_by_name(changes, message, tmp_path):
    with pytest.raises((ConfigError, InvalidInput), match=message):
        sweeps.run(dataclasses.replace(Sweep([LEG], seeds=[0]), **changes), tmp_path / 'new')
    assert not (tmp_path / 'new').exists()


# --- results ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_rows_are_those_of_single_trials_whatever_the_number_of_workers(tmp_path):
    reported = []
    one = sweeps.run(SMALL, tmp_path / 'one', 1, progress=reported.append)
    two = sweeps.run(SMALL, tmp_path / 'two', 2)
    assert without_pace(one) == without_pace(two)
    assert reported == list(range(9))
    row = one[5]
    assert (row['policy'], row['seed'], row['body.rolling_drag']) == ('flat', 1, 1.0)
    trial = loop.run(plan.scene_with(LEG, {'cycles': 2, 'body.rolling_drag': 1.0}), 'flat', 1)
    assert row['distance_per_cycle_m'] == trial.metrics.distance_per_cycle_m
    assert row['slip_path_m_leg1'] == trial.metrics.slip_path_m[0]
    assert (row['level'], row['verdict'], row['error']) == ('L0', None, None)
    assert row['real_time_factor'] > 1.0
    with (tmp_path / 'two' / 'trials.csv').open(newline='') as file:
        read = list(csv.DictReader(file))
    assert list(read[0]) == list(two[0])
    assert [float(each['distance_m']) for each in read] == [row['distance_m'] for row in two]


def test_a_trial_that_fails_is_a_row_and_can_be_tried_again(tmp_path, monkeypatch):
    sweep = Sweep([LEG], ['flat'], [0, 1, 2], SHORT)
    jobs = sweep.jobs()
    broken = dataclasses.replace(jobs[1], policy_parameters=1)
    monkeypatch.setattr(Sweep, 'jobs', lambda self: [jobs[0], broken, jobs[2]])
    rows = sweeps.run(sweep, tmp_path / 'sweep', 2)
    assert [bool(row['error']) for row in rows] == [False, True, False]
    assert 'TypeError' in rows[1]['error']
    assert (rows[1]['seed'], rows[1]['distance_m'], rows[1]['level']) == (1, None, 'L0')
    monkeypatch.undo()
    assert sweeps.run(sweep, tmp_path / 'sweep', 1) == rows
    again = sweeps.run(sweep, tmp_path / 'sweep', 1, retry=True)
    assert [row['error'] for row in again] == [None] * 3
    assert [again[0], again[2]] == [rows[0], rows[2]]


class Deadly:
    """An object that ends the process that unpickles it."""

    def __reduce__(self):
        return os._exit, (1,)


@pytest.mark.slow
def test_a_process_that_dies_costs_only_its_own_trial(tmp_path, monkeypatch):
    sweep = Sweep([LEG], ['flat'], range(5), SHORT)
    jobs = sweep.jobs()
    jobs[2] = dataclasses.replace(jobs[2], tuning=Deadly())
    monkeypatch.setattr(Sweep, 'jobs', lambda self: jobs)
    rows = sweeps.run(sweep, tmp_path / 'sweep', 2)
    assert [bool(row['error']) for row in rows] == [False, False, True, False, False]
    assert 'died' in rows[2]['error']


# --- continuing ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_sweep_that_was_stopped_keeps_what_is_done_and_goes_on(tmp_path):
    def stop(done):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweeps.run(SMALL, tmp_path / 'sweep', 1, progress=stop)
    with (tmp_path / 'sweep' / 'trials.csv').open(newline='') as file:
        assert len(list(csv.DictReader(file))) == 3
    reported = []
    rows = sweeps.run(SMALL, tmp_path / 'sweep', 1, progress=reported.append)
    assert reported == [3, 4, 5, 6, 7, 8]
    assert without_pace(rows) == without_pace(sweeps.run(SMALL, tmp_path / 'whole', 1))


def test_more_of_the_same_is_added_and_less_refused(tmp_path):
    small = Sweep([LEG], ['flat'], [0], SHORT)
    more = dataclasses.replace(small, seeds=[1, 0])
    first = sweeps.run(small, tmp_path / 'sweep', 1)
    rows = sweeps.run(more, tmp_path / 'sweep', 1)
    assert [row['seed'] for row in rows] == [1, 0]
    assert rows[1] == first[0]
    with pytest.raises(InvalidInput, match=r'1 trials that are not in this sweep.*seed'):
        sweeps.run(small, tmp_path / 'sweep', 1)


def test_another_sweep_in_the_same_folder_is_refused(tmp_path, monkeypatch):
    mine = tmp_path / 'mine.yaml'
    text = (configuration.shared_folder() / 'scenes' / f'{LEG}.yaml').read_text()
    mine.write_text(text)
    sweep = Sweep([str(mine)], ['flat'], [0], SHORT)
    sweeps.run(sweep, tmp_path / 'sweep', 1)
    with pytest.raises(InvalidInput, match=r"with parameters \['cycles'\], not \['body.mass'"):
        other = dataclasses.replace(sweep, parameters={'body.mass': [1.0], **SHORT})
        sweeps.run(other, tmp_path / 'sweep', 1)
    with pytest.raises(InvalidInput, match='with fidelity auto, not L0'):
        sweeps.run(dataclasses.replace(sweep, fidelity='L0'), tmp_path / 'sweep', 1)
    mine.write_text(text.replace('mass: ', 'mass: 1'))
    with pytest.raises(InvalidInput, match=r'with scene .*mine.yaml'):
        sweeps.run(sweep, tmp_path / 'sweep', 1)
    mine.write_text(text)
    sweeps.run(sweep, tmp_path / 'sweep', 1)
    monkeypatch.setattr('ros_pad.__version__', '99')
    with pytest.raises(InvalidInput, match='with version'):
        sweeps.run(sweep, tmp_path / 'sweep', 1)


def test_a_folder_has_one_sweep_at_work_at_a_time(tmp_path):
    with (
        Results(tmp_path / 'sweep', {}, []),
        pytest.raises(PadError, match='a sweep is running'),
    ):
        Results(tmp_path / 'sweep', {}, [])
    Results(tmp_path / 'sweep', {}, []).__exit__()


def test_a_kill_in_the_middle_of_a_write_leaves_the_rows_before_it(tmp_path):
    """The process is killed after many rows are in the file, but before their commit."""
    child = os.fork()
    if not child:
        with Results(tmp_path / 'sweep', {}, ['a', 'b']) as results:
            results.add('a', {'n': 1})
        base = sqlite3.connect(tmp_path / 'sweep' / table.RESULTS, isolation_level=None)
        base.execute('PRAGMA cache_size = 1')
        base.execute('BEGIN')
        for number in range(100):
            base.execute('INSERT INTO trial VALUES (?, ?)', (f'b{number}', 'x' * 10000))
        os.kill(os.getpid(), signal.SIGKILL)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    assert (tmp_path / 'sweep' / table.RESULTS).stat().st_size > 500_000  # rows without commit
    with Results(tmp_path / 'sweep', {}, ['a', 'b']) as results:
        assert results.rows(['a', 'b'])[0]['n'] == 1
        assert len(results.done) == 1
        results.add('b', {'n': 2})
        results.add('b', {'n': 3})
        assert [row['n'] for row in results.rows(['a', 'b'])] == [1, 2]
    base = sqlite3.connect(tmp_path / 'sweep' / table.RESULTS)
    assert base.execute('SELECT COUNT(*) FROM trial').fetchone() == (3,)  # one says what is swept


# --- means --------------------------------------------------------------------------------------


def test_points_are_means_with_students_interval():
    ways = [0.1, 0.12, 0.11, 0.15]
    rows = [
        {'scene': 's', 'policy': 'flat', 'x': 1, 'distance_per_cycle_m': way} for way in ways
    ] + [
        {'scene': 's', 'policy': 'flat', 'x': 1, 'distance_per_cycle_m': 9.0, 'verdict': 'tip'},
        {'scene': 's', 'policy': 'flat', 'x': 1, 'distance_per_cycle_m': None, 'error': 'no'},
        {'scene': 's', 'policy': 'dome', 'x': 1, 'distance_per_cycle_m': 0.2},
        {'scene': 's', 'policy': 'dome', 'x': 2, 'distance_per_cycle_m': None, 'error': 'no'},
    ]
    first, single, none = sweeps.points(rows, ['x'])
    assert first.labels == {'scene': 's', 'policy': 'flat', 'x': 1}
    assert (first.walks, first.left_out) == (4, 2)
    low, high = scipy.stats.t.interval(0.95, 3, np.mean(ways), scipy.stats.sem(ways))
    assert (first.mean, first.low, first.high) == pytest.approx((np.mean(ways), low, high))
    assert (single.mean, single.low, single.high) == (0.2, None, None)
    assert (none.walks, none.left_out, none.mean) == (0, 1, None)
    assert math.isclose(first.high + first.low, 2.0 * first.mean)


# --- Dask ---------------------------------------------------------------------------------------


def test_without_dask_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(PadError, match=r'pip install "ros_pad\[sweep\]"'):
        sweeps.run(SMALL, tmp_path / 'sweep', scheduler='tcp://127.0.0.1:1')
    assert not (tmp_path / 'sweep').exists()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_loses_no_trial(tmp_path):
    distributed = pytest.importorskip('distributed', reason='pip install "ros_pad[sweep]"')
    sweep = Sweep([LEG], ['flat', 'dome'], range(8), {'cycles': [10]})
    killed = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host='127.0.0.1', dashboard_address=None
    ) as cluster:
        assert len(cluster.workers) == 2

        def kill(done):
            if done == 3:
                killed.append(cluster.workers[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        rows = sweeps.run(
            sweep, tmp_path / 'sweep', scheduler=cluster.scheduler_address, progress=kill
        )
    assert killed
    with Results(tmp_path / 'here', {}, []) as results:
        for job in sweep.jobs():
            results.add(job.key, execution.run_job(job))
        here = results.rows(job.key for job in sweep.jobs())
    assert [row['error'] for row in rows] == [None] * 16
    assert without_pace(rows) == without_pace(here)
