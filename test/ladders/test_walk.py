# SPDX-License-Identifier: Apache-2.0
import importlib.util
import math
from dataclasses import replace

import mpmath
import pytest

from ros_pad.commands import chart
from ros_pad.errors import InvalidInput
from ros_pad.ladders import walk
from ros_pad.ladders.walk import Walk
from ros_pad.ladders.walk import Walked
from ros_pad.ladders.walk import Walker
from ros_pad.simulation import RailLeg
from ros_pad.simulation import Scene

LEG = Scene.load('leg_dry_flat')


def rail_walk(cap, drag=0.235, mass=0.85, cycles=1):
    """A dry leg whose foot holds exactly ``cap`` newtons."""
    body = replace(LEG.body, mass=mass, rolling_drag=drag)
    foot = replace(LEG.foot, friction=cap / body.load, shear_strength=0.0)
    return Walk('leg', replace(LEG, body=body, foot=foot, settle=0.0, cycles=cycles), 0.0)


# --- the truth of the rail leg ------------------------------------------------------------------


@pytest.mark.parametrize('cap', [0.7, 0.9, 1.05])
def test_truth_is_the_closed_form_of_a_cycle(cap):
    """From rest: pushed at (c - F)/M, held, braked at (c + F)/M once it is let go, coasting.

    The foot catches up where a t = V sin(πt/T), and lets go where M u' + F = -c.
    """
    mass, drag = 0.85, 0.6
    with mpmath.workdps(30):
        stance, stroke = mpmath.mpf(1) / 2, mpmath.mpf(5) / 100
        rate = mpmath.pi / stance
        peak = rate * stroke / 2
        push, brake = (mpmath.mpf(cap) - drag) / mass, (mpmath.mpf(cap) + drag) / mass
        assert push < peak * rate  # it slips at first

        def back(t):
            return peak * mpmath.sin(rate * t)

        met = mpmath.findroot(lambda t: push * t - back(t), (0.1, 0.9 * stance), 'anderson')
        assert 0.01 < met < stance
        assert mass * peak * rate * mpmath.cos(rate * met) + drag > -cap  # and is held then
        left = mpmath.acos(-(cap + drag) / (mass * peak * rate)) / rate if (
            (cap + drag) < mass * peak * rate
        ) else stance  # fmt: skip
        ends = back(left) - brake * (stance - left)
        assert left > met and (left == stance or ends > 0)
        foot = stroke / 2 * (mpmath.cos(rate * met) - mpmath.cos(rate * left))
        braked = back(left) * (stance - left) - brake * (stance - left) ** 2 / 2
        way = push * met**2 / 2 + foot + braked + ends**2 * mass / drag / 2
        slip = stroke / 2 * (1 - mpmath.cos(rate * met)) - push * met**2 / 2
        slip += braked - stroke / 2 * (mpmath.cos(rate * left) + 1)
    found, slipped, steps = walk.walk_by_events(rail_walk(cap, drag, mass), 'DOP853', 1e-11)
    assert found == pytest.approx(float(way), rel=1e-9)
    assert slipped == pytest.approx(float(slip), rel=1e-8)
    assert steps > 3


def test_truth_of_legs_that_hold_and_that_do_not_move():
    held = walk.walk_by_events(rail_walk(5.0, cycles=3), 'DOP853', 1e-11)
    assert held[:2] == pytest.approx((0.15, 0.0), abs=1e-12)
    stuck = walk.walk_by_events(rail_walk(0.2, cycles=3), 'DOP853', 1e-11)
    assert stuck[:2] == pytest.approx((0.0, 0.15), abs=1e-12)


@pytest.mark.parametrize('case', walk.rail_walks(), ids=lambda case: case.name)
def test_the_rail_leg_converges_to_the_truth(case):
    case = replace(case, scene=replace(case.scene, cycles=2))
    truth, slip, _ = walk.walk_by_events(case, 'DOP853', 1e-11)
    leg = RailLeg(case.scene, case.scene.floor.build(0), 5e-5)
    for _ in range(round(case.scene.duration / leg.period)):
        leg.step([case.pressure])
    assert leg.body[0] == pytest.approx(truth, rel=1e-3)
    assert leg.feet[0].slip_path == pytest.approx(slip, rel=3e-3, abs=1e-6)


# --- what is made of walks ----------------------------------------------------------------------


def fake(name, walked, family='fake'):
    answers = iter(walked)

    def step(_):
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    return Walker(family, name, 1e-3, step)


def went(distance, slip, seconds, lateral=0.0, yaw=0.0, verdict=None):
    return Walked(distance, slip, lateral, yaw, verdict, 1000, seconds)


def test_errors_failures_and_ratios():
    scene = replace(Scene.load('hexapod_smooth_dry_flat'), settle=0.0, cycles=5)  # 5 s
    walks = [Walk(f'{number}', scene, 0.0) for number in range(4)]
    least = walk.LEAST * scene.stride
    top = fake('top', [
        went(0.1, 0.02, 4.0), went(0.1, 0.02, 4.0, 1e-3, -2e-3), went(0.1, 0.0, 8.0),
        went(0.1, 0.02, 4.0),
    ])  # fmt: skip
    rung = fake('rung', [
        went(0.102, 0.021, 2.0, 1e-3, 1e-3), went(0.08, 0.03, 1.0, -1e-3, 2e-3),
        went(0.1, 0.5 * least, 1.0), went(0.1, 0.02, 1.0, verdict='tip-over'),
    ])  # fmt: skip
    lost = fake('lost', [
        ArithmeticError('diverged'), InvalidInput('no'), went(math.nan, 0.0, 1.0), went(0, 0, 1.0),
    ])  # fmt: skip
    shares = []
    rungs = walk.climb(walk.HEXAPOD, walks, [top, rung, lost], 'top', 'top', shares.append)
    assert shares == sorted(shares)
    assert len(shares) == 12 and shares[-1] == 1.0
    top, rung, lost = rungs
    assert top.failures == top.slip_failures == top.refused == 0
    assert set(top.errors.values()) == {0.0}
    assert (top.versus, top.ms_per_second, top.us_per_step) == (1.0, 800.0, 4000.0)
    # The third walk slips nowhere in truth: what is asked is a hundredth of the stride.
    assert rung.errors == pytest.approx(
        {'distance': 0.02, 'slip': 0.5, 'lateral': 1e-3, 'yaw': 1e-3}
    )
    assert rung.worst == pytest.approx(
        {'distance': 0.2, 'slip': 0.5, 'lateral': 2e-3, 'yaw': 4e-3}
    )
    assert (rung.failures, rung.slip_failures, rung.refused, rung.cases) == (2, 3, 1, 4)
    assert rung.versus == pytest.approx(0.25)
    assert rung.ms_per_second == pytest.approx(200.0)
    assert [each['distance_error'] for each in rung.walks[:2]] == pytest.approx([0.02, -0.2])
    assert (lost.failures, lost.refused) == (4, 3)
    assert lost.errors['distance'] == lost.worst['distance'] == 1.0
    assert lost.walks[0]['verdict'] == 'ArithmeticError: diverged'
    said = walk.table(rungs)
    assert 'hexapod (4 walks of 6 cycles; median and worst errors against top' in said
    (line,) = [line for line in said.splitlines() if line.startswith('  rung ')]
    assert line.split() == [
        *('rung', '200', '1e+03', '0.25', '2', '20', '50', '50', '1', '2', '1', '4'),
        *('2', '3', '1'),
    ]  # fmt: skip


# --- the ladder itself --------------------------------------------------------------------------


@pytest.fixture(scope='module')
def rungs():
    pytest.importorskip('mujoco')
    pytest.importorskip('numba')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(walk, 'CYCLES', {walk.HEXAPOD: 2, walk.RAIL: 2})
        every = {case.name: case for case in walk.hexapod_walks()}
        walks = [every[name] for name in ('wet, dome', 'wet, flat')]
        patch.setattr(walk, 'hexapod_walks', lambda: walks)
        shares = []
        measured = walk.measure(shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return measured


def test_every_rung_is_there_and_nearer_the_further_up(rungs):
    found = {rung.method: rung for rung in rungs}
    assert len(found) == len(rungs)
    for rung in rungs:
        assert rung.us_per_step > 0.0 and rung.ms_per_second > 0.0
        assert rung.refused == 0
        assert all(rung.worst[name] >= error >= 0.0 for name, error in rung.errors.items())
    assert found['L2, 2 ms'].versus == found['RailLeg, 4 ms'].versus == 1.0
    # One walk, three ways to run it.
    for step in ('1', '4', '10'):
        same = [
            found[f'{name}, {step} ms'].errors for name in walk._LOOKS if name.startswith('L1')
        ]
        assert same[0] == same[1] == same[2]
        assert same[3]['slip'] < same[0]['slip']
    assert found['L1, compiled, walk, 4 ms'].versus < found['L1, compiled, 4 ms'].versus < 0.2
    half, two, planar, peer = (
        found[method] for method in ('L2, 0.5 ms', 'L2, 2 ms', 'L1, 4 ms', 'MuJoCo defaults, 2 ms')
    )
    assert (
        half.errors['slip'] < two.errors['slip'] < min(planar.errors['slip'], peer.errors['slip'])
    )
    assert two.worst['distance'] < min(planar.worst['distance'], peer.worst['distance'])
    # MuJoCo's own settings creep: a robot on wet domes falls behind, and says nothing.
    assert found['MuJoCo defaults, 2 ms'].walks[0]['distance_error'] < -0.08
    assert found['MuJoCo defaults, 0.5 ms'].walks[0]['distance_error'] < -0.08


def test_integrators_step_over_stances_in_silence(rungs):
    found = {rung.method: rung for rung in rungs if rung.robot == walk.RAIL}
    assert found['solve_ivp, smoothed, LSODA'].failures > 0
    assert found['solve_ivp, smoothed, LSODA'].refused == 0
    assert found['solve_ivp, events, 1e-6'].worst['distance'] < 1e-5
    ways = [found[f'RailLeg, {step} ms'].worst['distance'] for step in ('0.1', '1', '4')]
    assert ways[0] < 0.3 * ways[1] < 0.3 * ways[2]


def test_table_and_picture(rungs, tmp_path):
    said = walk.table(rungs)
    assert 'against L2, top, 0.25 ms' in said
    assert 'pip install' not in said
    assert 'wet, dome' in said
    pictures = walk.figures(rungs)
    assert set(pictures) == {'walk'}
    pictures['walk'].savefig(tmp_path / 'walk.png')
    assert (tmp_path / 'walk.png').stat().st_size > 50_000


def test_without_extras(monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    walkers, top, baseline = walk.hexapod_walkers()
    names = {walker.name for walker in walkers}
    assert {top, baseline} <= names
    assert top == 'L1, 0.25 ms'
    assert not any('L2' in name or 'MuJoCo' in name or 'compiled' in name for name in names)
    case = walk.hexapod_walks()[0]
    case = replace(case, scene=replace(case.scene, cycles=1))
    few = [walker for walker in walkers if walker.name in (top, baseline)]
    rungs = walk.climb(walk.HEXAPOD, [case], few, top, baseline, lambda _: None)
    said = walk.table(rungs)
    assert 'L1, compiled: pip install "ros_pad[fast]"' in said
    assert 'pip install "ros_pad[mujoco]"' in said
    legs = [each for each in walk.rail_walkers() if each.name in (walk.EVENTS, walk.LEG)]
    rungs += walk.climb(walk.RAIL, [rail_walk(0.5)], legs, walk.EVENTS, walk.LEG, lambda _: None)
    assert len(walk.figures(rungs)['walk'].axes) == 6


def test_command_knows_it():
    assert chart.LADDERS['walk'] is walk
    assert chart.TABLES['walk'] is walk.table
