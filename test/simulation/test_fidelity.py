# SPDX-License-Identifier: Apache-2.0
import dataclasses
import importlib.util
import math
import pathlib

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation import fidelity
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.planar_hexapod import PlanarHexapod
from ros_pad.simulation.rail_leg import RailLeg

HEXAPOD, LEG = Scene.load('hexapod_patches'), Scene.load('leg_wet_flat')
BENCH = pathlib.Path(__file__).resolve().parents[2] / 'bench' / 'fidelity.py'


def test_rungs():
    assert fidelity.rung(HEXAPOD, 'L1') == 'L1'
    assert fidelity.rung(HEXAPOD, 'L2') == 'L2'
    assert fidelity.rung(LEG) == fidelity.rung(LEG, 'L0') == 'L0'
    with pytest.raises(InvalidInput, match=r"'L1': scene 'leg_wet_flat' has a rail_leg, which L0"):
        fidelity.rung(LEG, 'L1')
    with pytest.raises(InvalidInput, match=r"'L0': scene 'hexapod_patches' .* L1 and L2 model"):
        fidelity.rung(HEXAPOD, 'L0')
    with pytest.raises(InvalidInput, match='one of auto, L0, L1, L2'):
        fidelity.rung(HEXAPOD, 'L9')


@pytest.mark.parametrize(
    'scene, name, kind',
    [(HEXAPOD, 'L1', PlanarHexapod), (HEXAPOD, 'L2', FullHexapod), (LEG, 'auto', RailLeg)],
)
def test_robots(scene, name, kind):
    if kind is FullHexapod:
        pytest.importorskip('mujoco')
    robot = fidelity.build(scene, scene.floor.build(0), 0.004, name)
    assert isinstance(robot, kind)
    assert robot.legs == scene.legs
    assert len(robot.feet) == len(scene.legs)
    assert len(robot.joint_names) == len(robot.joint_positions)
    robot.step([0.0] * len(scene.legs))
    assert robot.time == pytest.approx(0.004)


# --- the choice -------------------------------------------------------------------------------


def with_table(monkeypatch, **bounds):
    """Put a table with two classes, below and above a reserve of 2, in place of the measured."""
    table = fidelity.Ladder((0.0, 2.0), {'L0': (0.5, 0.01)} | bounds)
    monkeypatch.setattr(fidelity.Ladder, 'load', lambda: table)


def test_auto_takes_the_cheapest_rung_that_is_accurate_enough(monkeypatch):
    monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy: 3.0)
    for l1, l2, expected in [(0.2, 0.1, 'L1'), (0.21, 0.1, 'L2'), (math.inf, 0.3, 'L2')]:
        with_table(monkeypatch, L1=(math.inf, l1), L2=(math.inf, l2))
        choice = fidelity.choose(dataclasses.replace(HEXAPOD, accuracy=0.2))
        assert choice.rung == expected
        assert choice.bound == (l1 if expected == 'L1' else l2)
        assert ('asks for' in choice.note) == (choice.bound > 0.2)
    # One that is asked for is taken, whatever it promises, and says so.
    forced = fidelity.choose(HEXAPOD, 'L1')
    assert (forced.rung, forced.bound) == ('L1', math.inf)
    assert 'not to be trusted, and the scene asks for 20 %' in forced.note


def test_classes_begin_at_their_lower_end(monkeypatch):
    with_table(monkeypatch, L1=(0.5, 0.1), L2=(0.2, 0.1))
    for own, expected in [(0.0, 0.5), (1.999, 0.5), (2.0, 0.1), (1e9, 0.1)]:
        monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy, own=own: own)
        assert fidelity.choose(HEXAPOD, 'L1').bound == expected


def test_without_mujoco_auto_takes_l1_and_says_what_it_is_worth(monkeypatch):
    monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy: 1.0)
    monkeypatch.setattr(fidelity.importlib.util, 'find_spec', lambda name: None)
    with_table(monkeypatch, L1=(0.5, 0.1), L2=(0.2, 0.1))
    choice = fidelity.choose(HEXAPOD)
    assert choice.rung == 'L1'
    assert choice.note.endswith('asks for 20 %; pip install "ros_pad[mujoco]" brings L2')


def test_nothing_is_promised_of_scenes_unlike_those_measured(bench):
    """L1 has no pitch: it walks a tenth too far on 5 mm of unevenness; on 10 mm L2 is stuck."""
    dry = dataclasses.replace(Scene.load('hexapod_smooth_dry_flat'), accuracy=0.2)
    assert fidelity.choose(dry).rung == 'L1'
    for robot, ranges in bench.RANGES.items():
        scene = dry if robot == 'hexapod' else LEG
        assert fidelity.Ladder.load().ranges[robot] == ranges
        for name, (low, high) in ranges.items():
            part, _, key = name.partition('.')

            def changed(value, scene=scene, part=part, key=key):
                owner = dataclasses.replace(getattr(scene, part), **{key: value})
                return dataclasses.replace(scene, **{part: owner})

            for value in (low, high):
                assert not fidelity.Ladder.load().beyond(changed(value)), name
            choice = fidelity.choose(changed(1.01 * high))
            assert choice.bound == math.inf
            told = f'({name} = {1.01 * high:g}, measured from {low:g} to {high:g})'
            assert f'of unknown error {told}' in choice.note
            if robot == 'hexapod' and importlib.util.find_spec('mujoco'):
                assert choice.rung == 'L2'


def test_a_fault_may_give_a_foot_the_other_shape():
    silent = dataclasses.replace(HEXAPOD, faults=(Fault('silence', start=3.0),))
    shapes = [fidelity.reserve(HEXAPOD, policy) for policy in ('flat', 'dome')]
    for policy in ('flat', 'dome', 'adaptive'):
        assert fidelity.reserve(silent, policy) == min(shapes)


def test_a_broken_table_is_told_of(monkeypatch, tmp_path):
    (tmp_path / 'fidelity.yaml').write_text('reserves: [0, 1]\nbounds: {L0: [1], L1: [1, 2]}\n')
    monkeypatch.setattr(fidelity.configuration, 'shared_folder', lambda: tmp_path)
    with pytest.raises(ConfigError, match=r'fidelity.yaml: no table of rungs .* bench/fidelity'):
        fidelity.Ladder.load.__wrapped__(fidelity.Ladder)


def test_reserve_by_hand():
    """Flat on dry ground: 0.8 against 4π stride/cycle² and a tenth of the weight of a load."""
    tow = dataclasses.replace(HEXAPOD.tow, weight=5.0, friction_dry=0.4)
    floor = dataclasses.replace(HEXAPOD.floor, kind='dry')
    gait = dataclasses.replace(HEXAPOD.gait, stride=0.1, cycle=1.0)
    scene = dataclasses.replace(HEXAPOD, tow=tow, floor=floor, gait=gait)
    mass, towed = 2.09, 5.0 / 9.81
    asked = (mass + towed) * 4.0 * math.pi * 0.1 + 0.4 * 5.0
    assert fidelity.reserve(scene, 'flat') == pytest.approx(0.8 * mass * 9.81 / asked, rel=1e-3)
    # Uphill by 0.1 rad asks for more, and presses less.
    steep = dataclasses.replace(scene, floor=dataclasses.replace(floor, slope=0.1))
    asked = (mass + towed) * (0.4 * math.pi + 9.81 * math.sin(0.1)) + 2.0 * math.cos(0.1)
    expected = 0.8 * mass * 9.81 * math.cos(0.1) / asked
    assert fidelity.reserve(steep, 'flat') == pytest.approx(expected, rel=1e-3)


def test_reserve_of_the_rail_leg_by_hand():
    """The floating foot holds 0.12 · 2.5 N; 0.85 kg gain π² S/2T² = 0.987 m/s² against 0.235 N."""
    assert fidelity.reserve(LEG) == pytest.approx(0.30 / (0.85 * 0.98696 + 0.235), rel=1e-3)


def test_reserve_of_the_rail_leg_on_a_slope():
    for slope in (-0.1, 0.1):
        steep = dataclasses.replace(LEG, floor=dataclasses.replace(LEG.floor, slope=slope))
        asked = 0.85 * (0.98696 + 9.81 * math.sin(0.1)) + 0.235
        assert fidelity.reserve(steep) == pytest.approx(0.30 / asked, rel=1e-3)


@pytest.mark.parametrize('dry, wet', [(0.2, 0.5), (0.5, 0.2)])
def test_reserve_where_feet_and_load_stand_on_the_worse_ground(dry, wet):
    """Feet float, 0.12 of 20.50 N, and 5 N drag with the larger of their frictions."""
    tow = dataclasses.replace(HEXAPOD.tow, weight=5.0, friction_dry=dry, friction_wet=wet)
    gait = dataclasses.replace(HEXAPOD.gait, stride=0.1, cycle=1.0)
    scene = dataclasses.replace(HEXAPOD, tow=tow, gait=gait)
    asked = (2.09 + 5.0 / 9.81) * 0.4 * math.pi + 0.5 * 5.0
    assert fidelity.reserve(scene, 'flat') == pytest.approx(0.12 * 20.503 / asked, rel=1e-3)


def test_reserve_on_a_film_in_mid_stance():
    """1/h² = 4 π n p² t/(3 η N) after half a stance, 0.09 s: that film, not the one at the end."""
    gait = dataclasses.replace(HEXAPOD.gait, cycle=0.3, duty=0.6)
    floor = dataclasses.replace(HEXAPOD.floor, kind='wet', viscosity=1e-3)
    scene = dataclasses.replace(HEXAPOD, gait=gait, floor=floor, dome_pressure=75e3)
    load, foot = 2.09 * 9.81 / 3.0, HEXAPOD.foot
    film = math.sqrt(3e-3 * load / (4.0 * math.pi * 37 * 75e3**2 * 0.09))
    touching = math.exp(-((film / foot.critical_film) ** foot.film_exponent))
    dry = foot.friction + foot.shear_strength / 75e3
    expected = touching * dry + (1.0 - touching) * foot.boundary_friction
    assert expected < 0.95 * dry
    assert fidelity._grip(scene, True, True) == pytest.approx(expected, rel=1e-3)


def test_reserve_is_least_where_feet_hold_least():
    patches = {
        policy: fidelity.reserve(HEXAPOD, policy) for policy in ('flat', 'dome', 'adaptive')
    }
    assert patches['flat'] < 0.5 * patches['dome']
    # Adaptive feet are domes where it is wet, which is where they hold least.
    assert patches['adaptive'] == patches['dome']
    assert fidelity.reserve(HEXAPOD) == fidelity.reserve(HEXAPOD, HEXAPOD.policy)


@pytest.fixture(scope='module')
def bench():
    spec = importlib.util.spec_from_file_location('bench_fidelity', BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize('robot', ['hexapod', 'rail_leg'])
def test_what_is_promised_is_kept_on_scenes_that_nobody_measured(robot, bench):
    """The error of the chosen rung is within its bound, for ten scenes the table was not made of.

    The scenes are asked for an accuracy that makes the choice come out both ways. The other rung
    keeps its promise, too.
    """
    pytest.importorskip('mujoco')
    taken = set()
    for seed in range(100000, 100010):
        scene, policy = getattr(bench, robot)(seed)
        scene = dataclasses.replace(scene, cycles=4, accuracy=0.15)
        taken.add(fidelity.choose(scene, policy=policy).rung)
        rungs = ('L1', 'L2') if robot == 'hexapod' else ('L0',)
        top = bench.way(scene, policy, seed, rungs[-1], top=True)
        for rung in rungs:
            choice = fidelity.choose(scene, rung, policy)
            here = bench.way(scene, policy, seed, rung)
            assert bench.apart(scene, here, top) <= choice.bound, (seed, choice.note)
    assert taken == set(rungs)


# --- what is left out -------------------------------------------------------------------------


@pytest.mark.parametrize(
    'name', [name for name in configuration.names('scenes') if not name.startswith('bench_')]
)
def test_what_is_left_out(name):
    scene = Scene.load(name)
    terms = fidelity.omitted(scene)
    assert len(terms) >= (1 if scene.floor.kind == 'dry' else 3)
    assert len({term.term for term in terms}) == len(terms)
    for term in terms:
        assert term.term and term.reason
        assert term.bound is None or 0.0 <= term.bound < 1.0
        assert term.bound is None or term.reason.startswith('of the ')


def bound(scene, word):
    return next((t.bound for t in fidelity.omitted(scene) if word in t.term), None)


def test_bound_of_the_capillary_force():
    # By hand: 37 pads, 2 · 0.073 N/m · 3 mm each, against 0.35 · 6.834 N.
    assert bound(HEXAPOD, 'capillary') == pytest.approx(37 * 0.000438 / 2.392, rel=1e-3)


def test_a_foot_with_a_capillary_force_leaves_none_out():
    foot = dataclasses.replace(HEXAPOD.foot, capillary_force=1e-4)
    assert bound(dataclasses.replace(HEXAPOD, foot=foot), 'capillary') is None


def test_film_that_a_dome_can_drag():
    """The best plane wedge: Reynolds' equation in closed form, over all inclinations.

    With h from h1 (1 + k) to h1 over a length L the mean pressure is η U L/h1² times
    6/k² (ln(1 + k) - 2k/(2 + k)).
    """
    k = np.linspace(0.01, 10.0, 100001)
    best = np.max(6.0 / k**2 * (np.log1p(k) - 2.0 * k / (2.0 + k)))
    floor = dataclasses.replace(HEXAPOD.floor, viscosity=2e-3)
    scene = dataclasses.replace(HEXAPOD, floor=floor, dome_pressure=75e3)
    across = 2.0 * math.sqrt(2.09 * 9.81 / 3.0 / 37 / 75e3 / math.pi)
    film = math.sqrt(best * 2e-3 * 0.01 * across / 75e3)
    assert fidelity._dragged_film(scene, 0.01) == pytest.approx(film, rel=2e-3)


def test_bound_of_soft_pads():
    # By hand: 0.80 of 6.834 N over 5 kN/m, twice a cycle, of 140 mm; a leg does it once.
    assert bound(HEXAPOD, 'soft pads') == pytest.approx(2 * 0.8 * 6.834 / 5e3 / 0.14, rel=2e-3)
    leg = Scene.load('leg_wet_flat')
    assert leg.foot.shear_stiffness == 5e3
    grip = bound(leg, 'soft pads') * 5e3 * 0.05 / 2.5
    assert grip == pytest.approx(0.35 + 4700 * min(1.0, 2.5 / 10444 / leg.foot.sole_area) *
                                 leg.foot.sole_area / 2.5, rel=1e-3)  # fmt: skip


def test_what_a_per_cent_of_friction_is_worth():
    """A foot that slips all the time gains c/(c - F) per cent: 0.30 N on a film, 0.235 of drag."""
    assert bound(Scene.load('leg_wet_flat'), 'per cent') == pytest.approx(
        0.01 * 0.30 / (0.30 - 0.235), rel=0.1
    )
    assert bound(Scene.load('leg_dry_flat'), 'per cent') < 1e-3  # it sticks


def test_a_dry_floor_has_no_menisci():
    assert bound(Scene.load('leg_dry_flat'), 'capillary') is None
