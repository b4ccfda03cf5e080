# SPDX-License-Identifier: Apache-2.0
import dataclasses
import importlib.util
import math

import numpy as np
import pytest

from ros_pad import configuration
from ros_pad.contact import Foot
from ros_pad.errors import ConfigError
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene
from ros_pad.simulation import fidelity
from ros_pad.simulation.faults import Fault
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.rail_leg import RailLeg

HEXAPOD, LEG = Scene.load('hexapod_patches'), Scene.load('leg_wet_flat')


def test_levels_of_robots():
    assert fidelity.level(HEXAPOD, 'L1') == 'L1'
    assert fidelity.level(HEXAPOD, 'L2') == 'L2'
    assert fidelity.level(LEG) == fidelity.level(LEG, 'L0') == 'L0'
    with pytest.raises(InvalidInput, match=r"'L1' .* 'leg_wet_flat' has rail_leg, which only"):
        fidelity.level(LEG, 'L1')
    with pytest.raises(InvalidInput, match=r"'L0' .* 'hexapod_patches' .* only L1 and L2 model"):
        fidelity.level(HEXAPOD, 'L0')
    with pytest.raises(InvalidInput, match='one of auto, L0, L1, L2'):
        fidelity.level(HEXAPOD, 'L9')


@pytest.mark.parametrize(
    'scene, name, kind',
    [(HEXAPOD, 'L1', PlanarRobot), (HEXAPOD, 'L2', FullRobot), (LEG, 'auto', RailLeg)],
)
def test_robots(scene, name, kind):
    if kind is FullRobot:
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
    """Replace the measured bounds by a table with two classes, grip margin below and above 2."""
    table = fidelity.ErrorTable((0.0, 2.0), {'L0': (0.5, 0.01)} | bounds)
    monkeypatch.setattr(fidelity.ErrorTable, 'load', lambda: table)


def test_auto_takes_the_cheapest_level_that_is_accurate_enough(monkeypatch):
    monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy: 3.0)
    for l1, l2, expected in [(0.2, 0.1, 'L1'), (0.21, 0.1, 'L2'), (math.inf, 0.3, 'L2')]:
        with_table(monkeypatch, L1=(math.inf, l1), L2=(math.inf, l2))
        choice = fidelity.choose(dataclasses.replace(HEXAPOD, accuracy=0.2))
        assert choice.level == expected
        assert choice.bound == (l1 if expected == 'L1' else l2)
        assert ('requires' in choice.note) == (choice.bound > 0.2)
    # A level that is given by name is used whatever its bound.
    forced = fidelity.choose(HEXAPOD, 'L1')
    assert (forced.level, forced.bound) == ('L1', math.inf)
    assert f'{100.0 * HEXAPOD.accuracy:.0f} %' in forced.note


def test_classes_begin_at_their_lower_end(monkeypatch):
    with_table(monkeypatch, L1=(0.5, 0.1), L2=(0.2, 0.1))
    for own, expected in [(0.0, 0.5), (1.999, 0.5), (2.0, 0.1), (1e9, 0.1)]:
        monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy, own=own: own)
        assert fidelity.choose(HEXAPOD, 'L1').bound == expected


def test_without_mujoco_auto_takes_l1_and_names_the_extra(monkeypatch):
    monkeypatch.setattr(fidelity, 'reserve', lambda scene, policy: 1.0)
    monkeypatch.setattr(fidelity.importlib.util, 'find_spec', lambda name: None)
    with_table(monkeypatch, L1=(0.5, 0.1), L2=(0.2, 0.1))
    choice = fidelity.choose(HEXAPOD)
    assert choice.level == 'L1'
    assert 'ros_pad[mujoco]' in choice.note


def test_no_bound_outside_the_measured_ranges():
    """Outside the measured ranges errors are unknown, so no level has a bound and L2 is chosen."""
    dry = dataclasses.replace(Scene.load('hexapod_smooth_dry_flat'), accuracy=0.2)
    assert fidelity.choose(dry).level == 'L1'
    for robot, ranges in fidelity.ErrorTable.load().ranges.items():
        scene = dry if robot == 'ch3r' else LEG
        for name, (low, high) in ranges.items():
            part, _, key = name.partition('.')

            def changed(value, scene=scene, part=part, key=key):
                owner = dataclasses.replace(getattr(scene, part), **{key: value})
                return dataclasses.replace(scene, **{part: owner})

            for value in (low, high):
                assert not fidelity.ErrorTable.load().beyond(changed(value)), name
            choice = fidelity.choose(changed(1.01 * high))
            assert choice.bound == math.inf
            assert f'{name} = {1.01 * high:g}, measured from {low:g} to {high:g}' in choice.note
            if robot == 'ch3r' and importlib.util.find_spec('mujoco'):
                assert choice.level == 'L2'


@pytest.mark.parametrize('name', ['inertia', 'height', 'leg_stiffness'])
def test_no_bound_for_another_body(name):
    dry = Scene.load('hexapod_smooth_dry_flat')
    assert fidelity.choose(dry).bound < 1.0
    body = dataclasses.replace(dry.body, **{name: 2.0 * getattr(dry.body, name)})
    choice = fidelity.choose(dataclasses.replace(dry, body=body))
    assert choice.bound == math.inf
    assert f'body.{name} = ' in choice.note


def test_a_fault_may_give_a_foot_the_other_morphology():
    silent = dataclasses.replace(HEXAPOD, faults=(Fault('silence', start=3.0),))
    reserves = [fidelity.reserve(HEXAPOD, policy) for policy in ('flat', 'dome')]
    for policy in ('flat', 'dome', 'adaptive'):
        assert fidelity.reserve(silent, policy) == min(reserves)


def test_a_broken_table_is_an_error(monkeypatch, tmp_path):
    (tmp_path / 'fidelity.yaml').write_text('reserves: [0, 1]\nbounds: {L0: [1], L1: [1, 2]}\n')
    monkeypatch.setattr(fidelity.configuration, 'shared_folder', lambda: tmp_path)
    with pytest.raises(ConfigError, match=r'fidelity.yaml: .* studies fidelity'):
        fidelity.ErrorTable.load.__wrapped__(fidelity.ErrorTable)


def test_reserve_by_hand():
    """Flat feet on dry ground: 0.8 of the weight over inertia, 4π stride/cycle², and tow."""
    tow = dataclasses.replace(HEXAPOD.tow, weight=5.0, friction_dry=0.4)
    floor = dataclasses.replace(HEXAPOD.floor, kind='dry')
    gait = dataclasses.replace(HEXAPOD.gait, stride=0.1, cycle=1.0)
    scene = dataclasses.replace(HEXAPOD, tow=tow, floor=floor, gait=gait)
    mass, towed = 2.09, 5.0 / 9.81
    demand = (mass + towed) * 4.0 * math.pi * 0.1 + 0.4 * 5.0
    assert fidelity.reserve(scene, 'flat') == pytest.approx(0.8 * mass * 9.81 / demand, rel=1e-3)
    # Uphill by 0.1 rad the demand is larger and the load smaller.
    steep = dataclasses.replace(scene, floor=dataclasses.replace(floor, slope=0.1))
    demand = (mass + towed) * (0.4 * math.pi + 9.81 * math.sin(0.1)) + 2.0 * math.cos(0.1)
    expected = 0.8 * mass * 9.81 * math.cos(0.1) / demand
    assert fidelity.reserve(steep, 'flat') == pytest.approx(expected, rel=1e-3)


def test_reserve_of_the_rail_leg_by_hand():
    """Capacity is 0.12 · 2.5 N; demand is 0.85 kg · π² S/2T², 0.987 m/s², and 0.235 N of drag."""
    assert fidelity.reserve(LEG) == pytest.approx(0.30 / (0.85 * 0.98696 + 0.235), rel=1e-3)


def test_reserve_of_the_rail_leg_on_a_slope():
    for slope in (-0.1, 0.1):
        steep = dataclasses.replace(LEG, floor=dataclasses.replace(LEG.floor, slope=slope))
        demand = 0.85 * (0.98696 + 9.81 * math.sin(0.1)) + 0.235
        assert fidelity.reserve(steep) == pytest.approx(0.30 / demand, rel=1e-3)


@pytest.mark.parametrize('dry, wet', [(0.2, 0.5), (0.5, 0.2)])
def test_reserve_where_feet_and_load_stand_on_the_worse_ground(dry, wet):
    """Wet feet hold 0.12 of 20.50 N, and the sled of 5 N drags with its larger friction."""
    tow = dataclasses.replace(HEXAPOD.tow, weight=5.0, friction_dry=dry, friction_wet=wet)
    gait = dataclasses.replace(HEXAPOD.gait, stride=0.1, cycle=1.0)
    scene = dataclasses.replace(HEXAPOD, tow=tow, gait=gait)
    demand = (2.09 + 5.0 / 9.81) * 0.4 * math.pi + 0.5 * 5.0
    assert fidelity.reserve(scene, 'flat') == pytest.approx(0.12 * 20.503 / demand, rel=1e-3)


def test_reserve_on_a_film_in_mid_stance():
    """The film is that after half a stance, 0.09 s: 1/h² = 4 π n p² t/(3 η N)."""
    gait = dataclasses.replace(HEXAPOD.gait, cycle=0.3, duty=0.6)
    floor = dataclasses.replace(HEXAPOD.floor, kind='wet', viscosity=1e-3)
    scene = dataclasses.replace(HEXAPOD, gait=gait, floor=floor, dome_pressure=75e3)
    load, foot = 2.09 * 9.81 / 3.0, HEXAPOD.foot
    film = math.sqrt(3e-3 * load / (4.0 * math.pi * 37 * 75e3**2 * 0.09))
    touching = math.exp(-((film / foot.critical_film) ** foot.film_exponent))
    dry = foot.friction + foot.shear_strength / 75e3
    expected = touching * dry + (1.0 - touching) * foot.boundary_friction
    assert expected < 0.95 * dry
    assert fidelity.mid_stance_grip(scene, True, True) == pytest.approx(expected, rel=1e-3)


def test_reserve_is_least_where_feet_hold_least():
    patches = {
        policy: fidelity.reserve(HEXAPOD, policy) for policy in ('flat', 'dome', 'adaptive')
    }
    assert patches['flat'] < 0.5 * patches['dome']
    # The margin is least on wet ground, where adaptive feet are domes.
    assert patches['adaptive'] == patches['dome']
    assert fidelity.reserve(HEXAPOD) == fidelity.reserve(HEXAPOD, HEXAPOD.policy)


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


def test_pads_of_a_material_leave_ballooning_out():
    """The maximum of the small foot is between those of the neighbours of its material."""
    assert not [t for t in fidelity.omitted(HEXAPOD) if 'balloon' in t.term]
    scene = dataclasses.replace(HEXAPOD, foot=Foot.load('small217'))
    (term,) = (t for t in fidelity.omitted(scene) if 'balloon' in t.term)
    assert 'above 12663 Pa' in term.reason and '11000 Pa' in term.reason


def bound(scene, word):
    return next((t.bound for t in fidelity.omitted(scene) if word in t.term), None)


def test_bound_of_the_capillary_force():
    # By hand: 37 pads with 2 · 0.073 N/m · 3 mm each, over 0.35 · 6.834 N.
    assert bound(HEXAPOD, 'capillary') == pytest.approx(37 * 0.000438 / 2.392, rel=1e-3)


def test_a_foot_with_a_capillary_force_leaves_none_out():
    foot = dataclasses.replace(HEXAPOD.foot, capillary_force=1e-4)
    assert bound(dataclasses.replace(HEXAPOD, foot=foot), 'capillary') is None


def test_film_that_a_dome_can_drag():
    """The plane wedge with the largest pressure, by the closed form of Reynolds' equation.

    With a film from h1 (1 + k) to h1 over a length L the mean pressure is η U L/h1² times
    6/k² (ln(1 + k) - 2k/(2 + k)).
    """
    k = np.linspace(0.01, 10.0, 100001)
    best = np.max(6.0 / k**2 * (np.log1p(k) - 2.0 * k / (2.0 + k)))
    floor = dataclasses.replace(HEXAPOD.floor, viscosity=2e-3)
    scene = dataclasses.replace(HEXAPOD, floor=floor, dome_pressure=75e3)
    across = 2.0 * math.sqrt(2.09 * 9.81 / 3.0 / 37 / 75e3 / math.pi)
    film = math.sqrt(best * 2e-3 * 0.01 * across / 75e3)
    assert fidelity.dragged_film(scene, 0.01) == pytest.approx(film, rel=2e-3)


def reason(scene, word):
    return next(t.reason for t in fidelity.omitted(scene) if word in t.term)


def test_suction_of_a_flat_sole_at_lift_off():
    """By hand: 17 mm, 7.53 kPa, 0.6 s of water leave 6.93 um; 3 π η a⁴/(2 h³) = 1.18 N s/um.

    Atmosphere on 9.08 cm²: 92 N. The foot rises as 30 mm sin²(π t/0.4 s), 1.85 m/s² t². The pull
    12 π η a⁴/((3.70 m/s²)² t⁵) falls below 92 N after 4.8 ms, and a quarter of it follows.
    """
    scene = Scene.load('hexapod_smooth_wet_flat')
    words = reason(scene, 'suction')
    assert 'at most 92 N' in words and 'a film of 6.93 um pull with 1180 N a mm/s' in words
    after = (12.0 * math.pi * 1e-3 * 0.017**4 / (3.701**2 * 92.0)) ** 0.2
    expected = 1.25 * 92.0 * after / (6.834 * 0.6)
    assert bound(scene, 'suction') == pytest.approx(expected, rel=2e-3)


def test_suction_of_domes_acts_on_their_contact_alone():
    scene = Scene.load('hexapod_smooth_wet_dome')
    pressure = 70068.0  # 37 domes touch on 6.834 N / 70.07 kPa = 97.5 mm²
    assert f'at most {101325.0 * 6.834 / pressure:.3g} N' in reason(scene, 'suction')


def test_suction_under_feet_that_adapt_is_that_of_a_flat_one():
    """They step flat onto wet ground before they know it."""
    flat = fidelity.omitted(HEXAPOD, policy='flat')
    for policy in ('adaptive', 'oracle'):
        assert fidelity.omitted(HEXAPOD, policy=policy)[0] == flat[0]
    assert flat[0].term.startswith('suction') and flat[0].bound > 0.1
    assert fidelity.omitted(HEXAPOD, policy='dome')[0].bound < 0.01


def test_dimple_under_domes_and_under_a_sole():
    """By hand: the lens of 0.424 · 7.53 kPa · 17 mm/395 kPa = 138 um has 235 um in its middle."""
    flat = Scene.load('hexapod_smooth_wet_flat')
    assert 'under the sole the dimple is 235 um' in reason(flat, 'dimple')
    assert bound(flat, 'dimple') == pytest.approx(0.0, abs=1e-6)  # neither film is thin enough
    # Rigid film 0.17 um: exp(-(0.17/0.5)²) = 0.89 dry; μ falls from 0.89 of dry to 0.12.
    domes = Scene.load('hexapod_smooth_wet_dome')
    assert 'under the domes the dimple is 5.54 um' in reason(domes, 'dimple')
    assert 'of 0.173 um 88.7 %' in reason(domes, 'dimple')
    dry = 0.35 + 4700.0 / 70068.0
    wet = 0.89 * dry + 0.11 * 0.12
    assert bound(domes, 'dimple') == pytest.approx(1.0 - 0.12 / wet, rel=0.01)


def test_a_stiff_foot_has_no_dimple():
    """In a very thick liquid the rigid film stays ten times as thick as the dimple."""
    scene = Scene.load('hexapod_smooth_wet_flat')
    floor = dataclasses.replace(scene.floor, viscosity=1e5, film_thickness=5e-3)
    assert bound(dataclasses.replace(scene, floor=floor), 'dimple') is None


def test_bound_of_soft_pads():
    # By hand: 0.80 of 6.834 N over 5 kN/m, twice in a cycle of 140 mm; a rail leg has it once.
    assert bound(HEXAPOD, 'soft pads') == pytest.approx(2 * 0.8 * 6.834 / 5e3 / 0.14, rel=2e-3)
    leg = Scene.load('leg_wet_flat')
    assert leg.foot.shear_stiffness == 5e3
    grip = bound(leg, 'soft pads') * 5e3 * 0.05 / 2.5
    assert grip == pytest.approx(0.35 + 4700 * min(1.0, 2.5 / 10444 / leg.foot.sole_area) *
                                 leg.foot.sole_area / 2.5, rel=1e-3)  # fmt: skip


def test_what_a_per_cent_of_friction_is_worth():
    """A foot that always slips gains c/(c - F) per cent: 0.30 N of friction, 0.235 N of drag."""
    assert bound(Scene.load('leg_wet_flat'), 'per cent') == pytest.approx(
        0.01 * 0.30 / (0.30 - 0.235), rel=0.1
    )
    assert bound(Scene.load('leg_dry_flat'), 'per cent') < 1e-3  # the foot sticks


def test_a_dry_floor_has_no_menisci():
    assert bound(Scene.load('leg_dry_flat'), 'capillary') is None
