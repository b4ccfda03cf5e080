# SPDX-License-Identifier: Apache-2.0
"""The study of slower landings."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('mujoco')
from ros_pad.simulation import balance_step
from ros_pad.simulation.balance_step import AIM_Z, FROM_Z, GOAL, GROUND, PHASE, RATE_Z, ROWS
from studies.__main__ import main
from studies.closed_loop import landing
from studies.closed_loop.landing import HEIGHT, Job, Walk

HEXAPOD, QUADRUPED = landing.GROUNDS
SPEED = 0.05


def test_feet_with_servos_are_lowered_over_one_place():
    gait = landing.ground(HEXAPOD, 'as shipped', 1, SPEED).gait
    usual = landing.ground(HEXAPOD, 'as shipped', 1).gait
    swing = (1.0 - gait.duty) * gait.cycle
    since = np.linspace(0.0, swing, 4001)
    progress, height = np.array([gait.swing(gait.duty + each / gait.cycle) for each in since]).T
    assert (progress[0], height[0]) == pytest.approx((0.0, 0.0))
    assert (progress[-1], height[-1]) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert height.max() == pytest.approx(usual.lift, rel=1e-3)
    slow = since > swing - HEIGHT / SPEED
    assert height[slow] == pytest.approx(SPEED * (swing - since[slow]), abs=1e-9)
    # It comes there at the same speed.
    speeds = np.diff(height) / np.diff(since)
    assert np.abs(np.diff(speeds)).max() < 0.01
    start = (gait.middles[0] - 0.5 * gait.duty + gait.duty) * gait.cycle
    body = np.array([gait.body_advance(start + each) for each in since])
    places = body + 2.0 * gait.reach() * progress
    assert np.ptp(places[slow]) < 1e-9 < 3e-3 < np.ptp(body[slow])


def test_feet_of_a_gait_with_balance_are_lowered():
    plan = SimpleNamespace(duty=0.6, cycle=0.5, lift=0.05)
    goal, feet = np.zeros(GOAL), np.zeros((ROWS, 1))
    goal[GROUND], feet[FROM_Z, 0] = 0.01, -0.02
    aim = landing.lowering(SPEED, lambda *_: None)
    since, aims, rates = np.linspace(0.0, 0.2, 2001), [], []
    for each in since:
        feet[PHASE, 0] = plan.duty + each / plan.cycle
        aim(plan, 0, goal, feet, None)
        aims.append(feet[AIM_Z, 0])
        rates.append(feet[RATE_Z, 0])
    assert (aims[0], aims[-1], max(aims)) == pytest.approx((-0.02, 0.01, 0.06), abs=1e-6)
    slow = since > 0.2 - HEIGHT / SPEED
    assert np.array(aims)[slow] == pytest.approx(0.01 + SPEED * (0.2 - since[slow]))
    middles = 0.5 * (np.array(rates)[1:] + np.array(rates)[:-1])
    steady = ~np.isclose(since[1:], 0.2 - HEIGHT / SPEED, atol=2e-4)  # its speed jumps there
    assert middles[steady] == pytest.approx((np.diff(aims) / np.diff(since))[steady], abs=1e-3)


@pytest.mark.parametrize(
    ('scene', 'least', 'most'), [(HEXAPOD, 0.12, 0.08), (QUADRUPED, 0.13, 0.07)]
)
def test_feet_land_more_slowly(scene, least, most):
    kept = balance_step.aim, balance_step.AHEAD
    usual, slow = (
        landing.walk(Job(scene, 'as shipped', 'dome', speed, 1, 2)) for speed in (None, SPEED)
    )
    assert usual.landing > least > most > slow.landing
    assert (balance_step.aim, balance_step.AHEAD) == kept
    for walk in (usual, slow):
        assert walk.verdict is None
        assert walk.distance > 0.02
        assert 0.5 * walk.load < walk.dry < walk.load


def made_up(distance, dry=1.0, load=2.0):
    return Walk(distance, 0.01, dry, load, 0.1, None)


def test_a_row_by_hand():
    walks, others = [made_up(0.1), made_up(0.12, 3.0)], [made_up(0.1), made_up(0.1)]
    row = landing.row(walks, others, walks, [7, 8])
    assert (row['dry_share'], row['dry_low'], row['dry_high']) == (1.0, 0.5, 1.5)
    assert (row['mm_a_cycle'], row['slip_mm'], row['landing_mm_s']) == (110.0, 10.0, 100.0)
    assert row['to usual']['of_means'] == pytest.approx(1.1)
    assert row['to as fast']['of_means'] == 1.0
    dry = landing.row([made_up(0.1, 0.0, 0.0)], others[:1], others[:1], [7])
    assert dry['dry_share'] is None


def test_the_landing_that_goes_farthest_is_chosen():
    rows = {
        'all': {
            policy: {
                '80 mm/s': {'mm_a_cycle': 100.0},
                '40 mm/s': {'mm_a_cycle': 90.0 if policy == 'dome' else 111.0},
            }
            for policy in landing.POLICIES
        }
    }
    assert landing.chosen(rows, (0.08, 0.04)) == 0.04


def test_the_page_has_the_figures_of_the_last_run():
    robots = json.loads((landing.command.CHARTS / 'landing.json').read_text())['robots']
    page = (landing.command.ROOT / 'docs' / 'model' / 'film.md').read_text()
    text = ' '.join(page.split('## Landing')[1].split('##')[0].split())
    of_six, of_four = ({**robot['held out'], 'new': robot['chosen']} for robot in robots.values())

    def row(robot, ground='all', policy='dome', landing=None):
        return robot[ground][policy][landing or robot['new']]

    touch = [
        round(row(robot, landing=each)['landing_mm_s'])
        for robot in (of_six, of_four)
        for each in (None, 'usual')
    ]
    assert "at {} instead of {} mm/s, the quadruped's at {} instead of {}.".format(*touch) in text
    drier = [
        round(100 * (row(robot)['dry_share'] - row(robot, landing='usual')['dry_share']))
        for robot in (of_six, of_four)
    ]
    assert 'changes by {} and {} points'.format(*drier) in text
    said = [
        landing.interval(row(robot, policy='adaptive')['to usual']) for robot in (of_six, of_four)
    ]
    assert '{} and {} times as far'.format(*said) in text
    domes = landing.interval(row(of_six)['to usual'])
    placed = row(of_six, landing='150 mm/s')['to usual']['of_means']
    assert f'domes go {domes} times as far, but {placed:.3f} if' in text
    assert f'towed ({landing.interval(row(of_four, "90 N towed")["to usual"])})' in text
    # In the printed digits no others gain beyond chance, except by landing over one place.
    gaining = [
        (ground, policy)
        for robot in (of_six, of_four)
        for ground, policies in robot.items()
        if ground not in ('all', 'new')
        for policy in policies
        if min(row(robot, ground, policy)[each]['low'] for each in ('to usual', 'to as fast'))
        > 1.0005
    ]
    assert gaining == [('90 N towed', 'dome')]


def invented(job):
    """Return a walk that goes the farther the slower feet land, but not with 12 N towed."""
    speed = 0.2 if job.speed is None else job.speed
    gain = 0.0 if job.ground == '12 N towed' else 0.2 - speed
    return Walk(0.1 + 1e-4 * job.seed % 7e-4 + gain, 0.01, 1.0, 2.0, speed, None)


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(landing, 'walk', invented)
    monkeypatch.setattr(
        landing.command, 'in_processes', lambda task, cases, *_: [task(*case) for case in cases]
    )
    assert main(['landing', '--floors', '3', '--tuning', '2', '--out', str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert {each.name for each in tmp_path.iterdir()} == {'landing.json', 'landing.png'}
    robots = json.loads((tmp_path / 'landing.json').read_text())['robots']
    seeds = []
    for scene, robot in robots.items():
        assert robot['chosen'] == '40 mm/s'
        for name in landing.GROUNDS[scene]:
            rows = robot['held out'][name]['adaptive']
            assert (rows['40 mm/s']['to usual']['low'] > 1.0) == (name != '12 N towed')
            assert rows['usual']['to usual']['of_means'] == 1.0
            assert rows['usual']['seeds'] == rows['40 mm/s']['seeds']
            seeds += rows['usual']['seeds']
        assert robot['tuning']['as shipped']['dome']['usual']['seeds'] == [0, 1]
    # Each ground has floors of its own.
    assert len(set(seeds)) == len(seeds) == 3 * len(landing.COLOURS) + 3 * 2
    assert min(seeds) >= landing.FIRST_SEED
    assert len([line for line in said.splitlines() if 'held out' in line]) == 3 * 2 * 10
