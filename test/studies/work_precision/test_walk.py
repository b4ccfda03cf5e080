# SPDX-License-Identifier: Apache-2.0
import importlib.util
import math
from dataclasses import replace

import pytest

from ros_pad.contact import Film, Foot, film_thickness, laws
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation.soles import Soles
from studies.work_precision.walk import chart, hexapod, rail, results, study, unlanded
from studies.work_precision.walk.walkers import HEXAPOD, RAIL, Walk, Walked, Walker

pytestmark = pytest.mark.slow


# --- the truth of the rail leg ------------------------------------------------------------------


@pytest.mark.parametrize('case', rail.rail_walks(), ids=lambda case: case.name)
def test_the_rail_leg_converges_to_the_truth(case):
    case = replace(case, scene=replace(case.scene, cycles=2))
    truth, slip, _ = rail.walk_by_events(case, 'DOP853', 1e-11)
    leg = rail.leg_of(case, 5e-5)
    for _ in range(round(case.scene.duration / leg.period)):
        leg.step([case.pressure])
    assert leg.body[0] == pytest.approx(truth, rel=1e-3)
    assert leg.feet[0].slip_path == pytest.approx(slip, rel=3e-3, abs=1e-6)


# --- results from walks -------------------------------------------------------------------------


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
    least = results.LEAST * scene.gait.stride
    top = fake('top', [
        went(0.1, 0.02, 4.0), went(0.1, 0.02, 4.0, 1e-3, -2e-3), went(0.1, 0.0, 8.0),
        went(0.1, 0.02, 4.0),
    ])  # fmt: skip
    other = fake('other', [
        went(0.102, 0.021, 2.0, 1e-3, 1e-3), went(0.08, 0.03, 1.0, -1e-3, 2e-3),
        went(0.1, 0.5 * least, 1.0), went(0.1, 0.02, 1.0, verdict='tip-over'),
    ])  # fmt: skip
    lost = fake('lost', [
        ArithmeticError('diverged'), InvalidInput('no'), went(math.nan, 0.0, 1.0), went(0, 0, 1.0),
    ])  # fmt: skip
    shares = []
    found = results.run(HEXAPOD, walks, [top, other, lost], ('top',), 'top', shares.append)
    assert shares == sorted(shares)
    assert len(shares) == 12 and shares[-1] == 1.0
    top, other, lost = found
    assert top.failures == top.slip_failures == top.refused == 0
    assert set(top.errors.values()) == {0.0}
    assert (top.versus, top.ms_per_second, top.us_per_step) == (1.0, 800.0, 4000.0)
    # The true slip of the third walk is zero; its error is relative to LEAST of a stride.
    assert other.errors == pytest.approx({'distance': 0.02, 'slip': 0.5})
    assert other.worst == pytest.approx({'distance': 0.2, 'slip': 0.5})
    assert (other.failures, other.slip_failures, other.refused, other.cases) == (2, 3, 1, 4)
    assert other.versus == pytest.approx(0.25)
    assert other.ms_per_second == pytest.approx(200.0)
    assert [each['distance_error'] for each in other.walks[:2]] == pytest.approx([0.02, -0.2])
    assert (lost.failures, lost.refused) == (4, 3)
    assert lost.errors['distance'] == lost.worst['distance'] == 1.0
    assert lost.walks[0]['verdict'] == 'ArithmeticError: diverged'
    text = chart.table(found)
    assert 'lost' in text and 'verdict' in text


def test_errors_against_another_engine_and_against_the_mean_of_both():
    scene = replace(Scene.load('hexapod_smooth_dry_flat'), cycles=5)
    ways = [
        fake('one', [went(0.10, 0.02, 1.0, 3e-3)]),
        fake('two', [went(0.12, 0.04, 1.0, 1e-3)]),
        fake('third', [went(0.11, 0.06, 1.0, 2e-3)]),
    ]
    tops = 'one', 'two'
    found = results.run(HEXAPOD, [Walk('a', scene, 0.0)], ways, tops, 'one', lambda _: None)
    one, two, third = found
    assert {(result.top, result.second) for result in found} == {tops}
    assert one.errors == {'distance': 0.0, 'slip': 0.0}
    assert two.errors == pytest.approx({'distance': 0.2, 'slip': 1.0})
    assert third.errors == pytest.approx({'distance': 0.1, 'slip': 2.0})
    # The mean is in the middle: 0.11 m and 0.03 m.
    assert one.mean_errors == pytest.approx({'distance': 0.01 / 0.11, 'slip': 1.0 / 3.0})
    assert two.mean_errors == pytest.approx(one.mean_errors)
    assert third.mean_errors == pytest.approx({'distance': 0.0, 'slip': 1.0})


# --- the study ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def measured_walks():
    pytest.importorskip('mujoco')
    pytest.importorskip('numba')
    with pytest.MonkeyPatch.context() as patch:
        # With Drake the study would take minutes.
        find = importlib.util.find_spec
        patch.setattr(
            importlib.util, 'find_spec', lambda name: None if name == 'pydrake' else find(name)
        )
        every = {case.name: case for case in hexapod.hexapod_walks()}
        walks = [every[name] for name in ('wet, dome', 'wet, flat')]
        patch.setattr(study, 'hexapod_walks', lambda: walks)
        shares = []
        measured = study.measure(shares.append, 2)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    return measured


def test_every_level_is_there_and_finer_ones_are_nearer(measured_walks):
    found = {other.method: other for other in measured_walks}
    assert len(found) == len(measured_walks)
    for other in measured_walks:
        assert other.us_per_step > 0.0 and other.ms_per_second > 0.0
        assert other.refused == 0
        assert all(other.worst[name] >= error >= 0.0 for name, error in other.errors.items())
    assert found['L2, 1 ms'].versus == found['RailLeg, 4 ms'].versus == 1.0
    # The same walk runs in three ways.
    for step in ('1', '4', '10'):
        same = [found[f'{name}, {step} ms'].errors for name in ('L1', 'L1, compiled')]
        assert same[0] == same[1]
    half, two, planar, peer = (
        found[method] for method in ('L2, 0.5 ms', 'L2, 2 ms', 'L1, 4 ms', 'MuJoCo defaults, 2 ms')
    )
    assert (
        half.errors['slip'] < two.errors['slip'] < min(planar.errors['slip'], peer.errors['slip'])
    )
    assert two.worst['distance'] < min(planar.worst['distance'], peer.worst['distance'])
    # With MuJoCo's defaults feet creep, and a robot on wet domes walks less far without a warning.
    assert found['MuJoCo defaults, 2 ms'].walks[0]['distance_error'] < -0.06
    assert found['MuJoCo defaults, 0.5 ms'].walks[0]['distance_error'] < -0.06


def test_the_rail_leg_against_integrators(measured_walks):
    found = {other.method: other for other in measured_walks if other.robot == RAIL}
    assert found['solve_ivp, events, 1e-6'].worst['distance'] < 1e-5
    ways = [found[f'RailLeg, {step} ms'].worst['distance'] for step in ('0.1', '1', '4')]
    assert ways[0] < 0.3 * ways[1] < 0.3 * ways[2]


# --- without landing, and Drake -----------------------------------------------------------------


def test_films_without_landing_are_those_of_rigid_discs():
    film, load, pressure = Film(Foot.load('large37')), 5.0, 75e3
    film.touch_down(3e-4)
    for _ in range(10):
        thin, sole = unlanded.drained(film, film._state, load, 2.0, pressure, 0.01, 0.1)
    radius = math.sqrt(load / (math.pi * film.pads * pressure))
    assert thin == pytest.approx(film_thickness(3e-4, pressure, radius, 0.1))
    mean, radius = 2.0 / film.sole_area, math.sqrt(film.sole_area / math.pi)
    assert sole == pytest.approx(film_thickness(3e-4, mean, radius, 0.1), rel=1e-3)
    # Twice the area: half of it is as thick as at touch-down.
    half, _ = unlanded.drained(film, film._state, 2.0 * load, 0.0, pressure, 0.0, 0.0)
    assert half**-2 == pytest.approx(0.5 * (thin**-2 + 3e-4**-2))


def test_landing_is_left_out_only_while_a_walker_without_it_walks():
    pytest.importorskip('mujoco')
    before = laws.drained, Soles._give_way
    case = next(case for case in hexapod.hexapod_walks() if case.name == 'wet, dome')
    case = replace(case, scene=replace(case.scene, cycles=1))
    every = {walker.name: walker for walker in hexapod.hexapod_walkers()[0]}
    ways = [every[name].walk(case) for name in ('L2, 1 ms', 'L2 without landing, 1 ms')]
    assert (laws.drained, Soles._give_way) == before
    assert abs(ways[0].slip / ways[1].slip - 1.0) > 0.02


@pytest.mark.parametrize('name', ['rough dry, flat', 'wet, dome'])
def test_drake_with_the_spring_of_the_pads_goes_as_far_as_l2(name):
    pytest.importorskip('pydrake')
    case = next(case for case in hexapod.hexapod_walks() if case.name == name)
    case = replace(case, scene=replace(case.scene, cycles=1))
    every = {walker.name: walker for walker in hexapod.hexapod_walkers()[0]}
    ours, other = (every[name].walk(case) for name in ('L2, 0.5 ms', 'Drake, 0.4 ms'))
    assert not other.verdict
    assert other.distance == pytest.approx(ours.distance, rel=0.01)
    assert other.slip == pytest.approx(ours.slip, rel=0.15)
