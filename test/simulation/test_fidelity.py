# SPDX-License-Identifier: Apache-2.0
import bisect
import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from ros_pad import configuration
from ros_pad.contact import Film, MeasuredLimit
from ros_pad.control.morphology import MARGIN
from ros_pad.errors import InvalidInput
from ros_pad.simulation import Scene, fidelity, margin, terms
from ros_pad.simulation.faults import Fault

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


# --- the choice -------------------------------------------------------------------------------


def with_bounds(monkeypatch, **bounds):
    """Replace the bounds by ones that do not depend on the scene, without ranges."""
    names = fidelity.features(HEXAPOD)
    lines = {
        f'{level.replace("_", " ")} {metric}': {'constant': math.log(bound + fidelity.LEAST)}
        | dict.fromkeys(names, 0.0)
        for level, parts in bounds.items()
        for metric, bound in zip(('distance', 'slip'), parts, strict=True)
    }
    promises = fidelity.Promises({'ch3r': {'ranges': {}, 'features': {}, 'bounds': lines}})
    monkeypatch.setattr(fidelity.Promises, 'load', lambda: promises)


def test_auto_takes_the_cheapest_level_that_is_accurate_enough(monkeypatch):
    scene = dataclasses.replace(HEXAPOD, accuracy=0.2)
    for l1, l2, expected in [(0.199, 0.1, 'L1'), (0.201, 0.1, 'L2'), (0.9, 0.3, 'L2')]:
        with_bounds(monkeypatch, L1=(l1, 1.0), L2=(l2, 0.1))
        choice = fidelity.choose(scene)
        assert choice.level == expected
        assert choice.bound == pytest.approx(l1 if expected == 'L1' else l2)
        assert ('requires 20 %' in choice.note) == (choice.bound > 0.2)
    # A level that is given by name is used whatever its bound, which is rounded up in words.
    forced = fidelity.choose(scene, 'L1')
    assert (forced.level, forced.bound) == ('L1', pytest.approx(0.9))
    for bound, words in [(0.0999, 'within 10 %'), (0.9901, 'off by up to 100 %')]:
        with_bounds(monkeypatch, L1=(bound, 1.0), L2=(0.2, 0.1), no_slip=(bound, 1.0))
        note = fidelity.choose(scene, 'L1').note
        assert f'the distance on L1 is {words} of the top level' in note
        assert (f'no slip at all, without a simulation, is {words}' in note) == (bound < 0.2)
    # L1 has no slip of a few millimetres: a scene that asks for slip does not get it.
    slip = fidelity.choose(dataclasses.replace(scene, metric='slip'))
    assert (slip.level, slip.bound) == ('L2', pytest.approx(0.1))


def test_without_mujoco_auto_takes_l1_and_names_the_extra(monkeypatch):
    monkeypatch.setattr(fidelity.importlib.util, 'find_spec', lambda name: None)
    with_bounds(monkeypatch, L1=(0.5, 1.0), L2=(0.2, 0.1))
    choice = fidelity.choose(HEXAPOD)
    assert choice.level == 'L1'
    assert 'ros_pad[mujoco]' in choice.note


def changed(owner, name, value):
    """Return a scene or a part of it with another value, by dotted name."""
    part, _, rest = name.partition('.')
    if isinstance(owner, dict):
        return owner | {name: value}
    value = changed(getattr(owner, part), rest, value) if rest else value
    return dataclasses.replace(owner, **{part: value})


@pytest.mark.parametrize('name', ['hexapod_patches', 'quadruped_patches', 'leg_wet_dome_75'])
def test_no_promise_outside_the_ranges_drawn(name):
    """Outside the ranges errors are unknown: no level has a bound, and the best one is chosen."""
    scene = Scene.load(name)
    assert fidelity.choose(scene).bound < math.inf
    ranges = fidelity.Promises.load().robots[scene.robot]['ranges']
    for key, (low, high) in ranges.items():
        beyond = int(high) + 1 if key == 'foot.pads' else high + 0.01 * max(abs(high), 1e-6)
        choice = fidelity.choose(changed(scene, key, beyond))
        assert choice.bound == math.inf
        assert f'{key} = {beyond:.4g}, drawn from {low:.4g} to {high:.4g}' in choice.note
    foot = {key.name: getattr(scene.foot, key.name) for key in dataclasses.fields(scene.foot)}
    numbers = {f'foot.{key}' for key, value in foot.items() if isinstance(value, (int, float))}
    assert numbers - {'foot.limit_cell'} <= ranges.keys()


def test_no_promise_with_what_was_not_drawn():
    silent = dataclasses.replace(HEXAPOD, faults=(Fault('silence', start=3.0),))
    floor = dataclasses.replace(HEXAPOD.floor, kind='drawn', drawing=('.#',), cell=1.0)
    gait = dataclasses.replace(HEXAPOD.gait, pushes=False)
    sticky = dataclasses.replace(HEXAPOD.gait, cycle=0.8, stride=0.15)
    slope = dataclasses.replace(HEXAPOD.floor, slope=0.08)
    limit = MeasuredLimit(0.3, 75e3, 4e-6)
    for scene, words in [
        (silent, 'faults'),
        (dataclasses.replace(HEXAPOD, floor=floor), 'a floor as in a drawing'),
        (dataclasses.replace(HEXAPOD, gait=gait), 'phases or pushes of the gait'),
        (changed(HEXAPOD, 'foot.pad.measured_limit', limit), 'pads, drawn were large ones'),
        (changed(HEXAPOD, 'foot.limit', 'flattening'), 'pads, drawn were large ones'),
        (changed(HEXAPOD, 'regulator.hose_conductance', 1e-8), 'a measured conductance'),
        (dataclasses.replace(HEXAPOD, robot='mine.yaml'), 'robot = mine.yaml, drawn were ch3r'),
    ]:
        choice = fidelity.choose(scene)
        assert choice.bound == math.inf and words in choice.note
    # Each value is in its range, but the grip margin of all of them together is not.
    feeble = dataclasses.replace(HEXAPOD.foot, boundary_friction=0.12)
    tow = dataclasses.replace(HEXAPOD.tow, weight=12.0, friction_dry=0.8, friction_wet=0.5)
    body = dataclasses.replace(HEXAPOD.body, mass=1.0, inertia=0.03 / 2.09)
    worst = dataclasses.replace(
        HEXAPOD, foot=feeble, tow=tow, body=body, gait=sticky, floor=slope, policy='flat'
    )
    assert 'margin = -2' in fidelity.choose(worst).note


def test_shipped_scenes_for_which_l1_or_no_simulation_suffices():
    choice = fidelity.choose(Scene.load('hexapod_dry_slow'))
    assert choice.level == 'L1' and choice.bound < 0.1
    assert fidelity.answer(Scene.load('hexapod_dry_slow')) is None  # the walk itself is wanted
    scene = Scene.load('hexapod_dry_distance')
    known = fidelity.answer(scene)
    assert known.level == fidelity.STICKING and known.bound < 0.1
    assert fidelity.sticking_distance(scene) == pytest.approx(0.9)  # 15 cycles of 60 mm
    assert fidelity.level(scene) == 'L1'  # for those who walk it nevertheless
    for change in ({'accuracy': 0.9 * known.bound}, {'metric': 'slip'}, {'cycles': 1000}):
        assert fidelity.answer(dataclasses.replace(scene, **change)) is None


def test_a_bound_by_hand():
    tow = dataclasses.replace(HEXAPOD.tow, weight=0.0)
    floor = dataclasses.replace(HEXAPOD.floor, kind='dry')
    scene = dataclasses.replace(HEXAPOD, tow=tow, floor=floor)
    line = dict.fromkeys(fidelity.features(scene), 0.0)
    line |= {'constant': -3.0, 'margin': -0.5, 'ample': 0.1}
    promises = fidelity.Promises(
        {'ch3r': {'ranges': {}, 'features': {}, 'bounds': {'L1 distance': line}}}
    )
    margin = 0.8 * 9.81 / (4.0 * math.pi * 0.14)  # 0.8 of the weight over the inertia
    expected = math.exp(-3.0 - 0.5 * math.log(margin) + 0.1 * math.log(margin / 2.0)) - 1e-4
    assert promises.bound('L1', scene, 'flat') == pytest.approx(expected, rel=1e-3)
    assert promises.bound('L2', scene, 'flat') == math.inf
    line['constant'] = -20.0  # a bound below 1e-4, which was added to all errors, is not known
    assert promises.bound('L1', scene, 'flat') == pytest.approx(1e-4)


def test_features_by_hand():
    """Uphill by 0.05 rad on patches, with 5 N that drag with 0.4 and 0.1 of their weight."""
    tow = dataclasses.replace(HEXAPOD.tow, weight=5.0, friction_dry=0.4, friction_wet=0.1)
    floor = dataclasses.replace(HEXAPOD.floor, slope=0.05, unevenness=5e-4, wet_fraction=0.3)
    gait = dataclasses.replace(HEXAPOD.gait, stride=0.1, cycle=1.0)
    scene = dataclasses.replace(HEXAPOD, tow=tow, floor=floor, gait=gait, cycles=8)
    mass = 2.09 + 5.0 / 9.81
    parts = mass * 0.4 * math.pi, 2.0 * math.cos(0.05), mass * 9.81 * math.sin(0.05)
    found = fidelity.features(scene)
    assert found['dragged'] == pytest.approx(parts[1] / sum(parts), rel=1e-3)
    assert found['climbed'] == pytest.approx(parts[2] / sum(parts), rel=1e-3)
    assert found['uneven'] == pytest.approx(5e-4 * 3000.0 / (2.09 * 9.81 / 3.0), rel=1e-3)
    assert found['pace'] == pytest.approx(math.log(0.4 * math.pi / 9.81), rel=1e-3)
    assert (found['wet'], found['domes'], found['adapts']) == (0.3, 1.0, 1.0)
    assert (found['duty'], found['steered']) == (0.6, 1.0)
    assert found['near'] == 1.0
    assert fidelity.features(Scene.load('hexapod_dry_slow'))['near'] == 0.0
    flat = fidelity.features(scene, 'flat')
    assert (flat['domes'], flat['adapts']) == (0.0, 0.0)
    # 0.12 of the weight on wet ground is all that flat feet hold.
    least = 0.12 * 2.09 * 9.81 * math.cos(0.05) / sum(parts)
    assert flat['margin'] == -flat['scarce'] == pytest.approx(math.log(least), rel=1e-3)
    assert flat['ample'] == 0.0


def test_reserve_of_the_rail_leg_on_a_slope():
    """Capacity is 0.12 · 2.5 N; demand is 0.85 kg · π² S/2T², 0.987 m/s², slope, and drag."""
    for slope in (-0.1, 0.0, 0.1):
        steep = dataclasses.replace(LEG, floor=dataclasses.replace(LEG.floor, slope=slope))
        demand = 0.85 * (0.98696 + 9.81 * math.sin(abs(slope))) + 0.235
        assert fidelity.reserve(steep) == pytest.approx(0.30 / demand, rel=1e-3)


def test_reserve_on_a_film_in_mid_stance():
    """The film is that after half a stance, 0.09 s; half of the load came in 7 ms."""
    gait = dataclasses.replace(HEXAPOD.gait, cycle=0.3, duty=0.6)
    floor = dataclasses.replace(HEXAPOD.floor, kind='wet', viscosity=1e-3)
    scene = dataclasses.replace(HEXAPOD, gait=gait, floor=floor, dome_pressure=75e3)
    load, foot = 2.09 * 9.81 / 3.0, HEXAPOD.foot
    film = Film(foot)
    film.touch_down(3e-4)
    film.drain(0.5 * load, 0.0, 75e3, 7e-3)
    thickness, _ = film.drain(load, 0.0, 75e3, 0.083)
    touching = math.exp(-((thickness / foot.critical_film) ** foot.film_exponent))
    dry = foot.friction + foot.shear_strength / 75e3
    expected = touching * dry + (1.0 - touching) * foot.boundary_friction
    assert expected < 0.95 * dry
    assert margin.mid_stance_grip(scene, True, True) == pytest.approx(expected, rel=1e-3)
    # 10 kg: of 32.7 N, 37 pads carry 0.2833 N + 12.5 uN/Pa · 15 kPa each at the ceiling.
    heavy = margin.Stand(changed(HEXAPOD, 'body.mass', 10.0), True)
    assert heavy.pressure == HEXAPOD.foot.ceiling == 90e3
    assert heavy.on_sole == pytest.approx(10.0 * 9.81 / 3.0 - 37 * 0.4708, rel=1e-3)
    assert MARGIN.default == margin._MARGIN


# --- what is left out -------------------------------------------------------------------------


def bound(scene, word):
    return next((t.bound for t in terms.terms(scene) if word in t.term), None)


@pytest.mark.parametrize(
    'name', [name for name in configuration.names('scenes') if not name.startswith('bench_')]
)
def test_nothing_left_out_of_a_shipped_scene_exceeds_its_accuracy(name):
    assert not [each.term for each in terms.terms(Scene.load(name)) if each.exceeds]


def test_bound_of_the_pull_of_liquid():
    """By hand: 2 π γ r, round 37 domes or the sole."""
    for policy, count, r in [('dome', 37, 1.5e-3), ('flat', 1, 17e-3)]:
        pull = count * 2.0 * math.pi * 0.073 * r
        (term,) = (t for t in terms.terms(HEXAPOD, policy=policy) if 'pull' in t.term)
        assert term.bound == pytest.approx(pull / 6.834, rel=0.01)


def test_the_effect_of_a_term_is_that_of_friction_in_proportion(monkeypatch):
    """Five per cent of friction change the distance by 20 %: contact lines, 0.68 %, by 2.7 %."""
    with_bounds(monkeypatch, L2=(0.01, 0.1), friction=(0.2, 0.1))
    line = 37 * 0.000438 / 2.392
    for accuracy, added in [(0.03, False), (0.025, True)]:
        scene = dataclasses.replace(HEXAPOD, accuracy=accuracy)
        (term,) = (t for t in terms.terms(scene) if 'capillary' in t.term)
        assert term.effect == pytest.approx(4.0 * line, rel=1e-3)
        assert term.taken == added and not term.exceeds
        assert bool(terms.with_terms(scene).foot.capillary_force) == added
    (pull,) = (t for t in terms.terms(scene, policy='dome') if 'pull' in t.term)
    assert pull.effect == pytest.approx(4.0 * pull.bound) and not pull.exceeds
    strict = dataclasses.replace(scene, accuracy=0.9 * pull.effect)
    (pull,) = (t for t in terms.terms(strict, policy='dome') if 'pull' in t.term)
    assert pull.exceeds
    # A metric of its own: five per cent of friction change the slip by 10 %.
    slip = dataclasses.replace(HEXAPOD, metric='slip')
    (pull,) = (t for t in terms.terms(slip, policy='dome') if 'pull' in t.term)
    assert pull.effect == pytest.approx(2.0 * pull.bound)


def test_contact_lines_that_matter_are_added_to_the_robot(monkeypatch):
    """A pad of 1.5 mm resists by γ 2 r (cos 90° - cos 120°), 0.109 mN, on domes on wet ground."""
    with_bounds(monkeypatch, L2=(0.01, 0.1), friction=(0.2, 0.1))
    strict = dataclasses.replace(HEXAPOD, accuracy=0.02)
    force = 0.073 * 3e-3 * 0.5
    assert terms.with_terms(strict).foot.capillary_force == pytest.approx(force, rel=0.01)
    assert terms.with_terms(HEXAPOD).foot.capillary_force == 0.0
    dry = dataclasses.replace(strict, floor=dataclasses.replace(strict.floor, kind='dry'))
    assert terms.with_terms(dry).foot.capillary_force == 0.0
    own = dataclasses.replace(strict, foot=dataclasses.replace(strict.foot, capillary_force=1e-4))
    assert terms.with_terms(own).foot.capillary_force == 1e-4


@pytest.mark.parametrize('name', ['hexapod_patches', 'hexapod_dry_slow', 'leg_wet_dome_75'])
def test_feet_without_friction_have_terms_without_bounds(name):
    """Of no friction nothing is a share; loads have theirs."""
    scene = Scene.load(name)
    none = dict.fromkeys(('friction', 'shear_strength', 'boundary_friction'), 0.0)
    scene = dataclasses.replace(scene, foot=dataclasses.replace(scene.foot, **none))
    assert terms.with_terms(scene) == scene
    assert 'foot.friction = 0, drawn from 0.35' in fidelity.choose(scene).note
    found = {term.term: term.bound for term in terms.terms(scene, policy='dome')}
    assert found['air in hose and pads'] is None
    assert found.get(terms.LINES) is None
    assert ('suction of the film at lift-off' in found) == (scene.floor.kind != 'dry')
    slippery = changed(scene, 'foot.boundary_friction', 0.12)  # a film is better than none
    assert all(each.bound is None or each.bound >= 0.0 for each in terms.terms(slippery))


def reason(scene, word):
    return next(t.reason for t in terms.terms(scene) if word in t.term)


def share_of_a_vacuum(centre, count=100):
    """Return the mean suction below a disc over that of a vacuum, by finite differences.

    ``centre`` is the share that its centre would have if liquid could not part.
    """
    r = (np.arange(count) + 0.5) / count
    inner, outer = r - 0.5 / count, r + 0.5 / count  # p = 0 at the rim, half a cell away
    matrix = np.diag(inner + outer) - np.diag(outer[:-1], 1) - np.diag(inner[1:], -1)
    matrix[-1, -1] += outer[-1]
    wanted = 4.0 * centre * r / count**2

    def suction(parted):
        held = np.where(np.arange(count)[:, None] < parted, np.eye(count), matrix)
        return np.linalg.solve(held, np.where(np.arange(count) < parted, 1.0, wanted))

    # No more of the middle parts than keeps the rest above a vacuum.
    parted = bisect.bisect_left(range(count), True, key=lambda n: suction(n).max() < 1.0 + 1e-9)
    return float(2.0 / count * suction(parted) @ r)


def test_suction_of_a_flat_sole_at_lift_off():
    """By hand: 17 mm, a mean of 5.65 kPa, 0.6 s of water leave 8.0 um; 1.12 for slow voids.

    Atmosphere on 9.08 cm²: 92 N. The foot rises as 30 mm sin²(π t/0.4 s), 1.85 m/s² t².
    """
    scene = Scene.load('hexapod_smooth_wet_flat')
    assert 'as much as 92 N' in reason(scene, 'suction')
    assert bound(Scene.load('hexapod_smooth_wet_dome'), 'suction') < 0.1 * bound(scene, 'suction')
    time = np.geomspace(1e-5, 0.1, 300)
    height = 8.0e-6 + 0.5 * 3.701 * time**2
    centre = 3.0 * 1e-3 * 3.701 * time * 0.017**2 / (101325.0 * height**3)
    force = 92.0 * np.array([share_of_a_vacuum(each) for each in centre])
    expected = 1.12 * trapezoid(force, time) / (6.834 * 0.6)
    assert bound(scene, 'suction') == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ('name', 'radius', 'film'), [('hexapod', 0.017, 8.0e-6), ('quadruped', 0.051, 26e-6)]
)
def test_voids_that_fill_slowly_are_within_the_bound(name, radius, film):
    """Liquid runs into a void from its edge, at h²/(12 η) dp/dr, until air is let in at 0.3 mm."""
    scene = Scene.load(f'{name}_patches')
    swing = scene.gait.cycle - scene.gait.stance
    rise = 2.0 * scene.gait.lift * (math.pi / swing) ** 2
    vacuum, viscosity, step = 101325.0, 1e-3, 2e-6
    impulse, time, edge, height = 0.0, 0.0, 0.0, film
    while height < 3e-4:
        time += step
        height = film + 0.5 * rise * time**2
        sucked = 3.0 * viscosity * rise * time / height**3  # suction is this times a² - r²
        share = sucked * radius**2 / vacuum

        def even(u, share=share):
            return 1.0 - u + u * math.log(u) - 1.0 / share

        least = radius * math.sqrt(brentq(even, 1e-12, 1.0)) if share > 1.0 else 0.0
        if edge > least:
            slope = (vacuum - sucked * (radius**2 - edge**2)) / math.log(radius / edge)
            inwards = slope / edge + 2.0 * sucked * edge  # of the suction; it drives liquid in
            edge -= step * height**2 / (12.0 * viscosity) * max(inwards, 0.0)
        edge = max(edge, least, 1e-4 * radius)
        slope = (vacuum - sucked * (radius**2 - edge**2)) / math.log(radius / edge)
        r = np.linspace(edge, radius, 60)
        suction = sucked * (radius**2 - r**2) + slope * np.log(radius / r)
        if edge <= 1e-4 * radius:
            suction = sucked * (radius**2 - r**2)
        force = math.pi * edge**2 * vacuum + trapezoid(suction * 2.0 * math.pi * r, r)
        impulse += force * step
    share = impulse / (scene.expected_load * scene.gait.stance)
    assert share <= bound(scene, 'suction') < 1.06 * share


def test_bounds_of_the_film():
    """Three points of dry contact, of 0.83 at 70 kPa; no dry contact under a sole to lose."""
    scene = Scene.load('hexapod_smooth_wet_dome')
    dry = 0.35 + 4700.0 / 70068.0
    wet = 0.83 * dry + 0.17 * 0.12
    assert bound(scene, 'shape of the film') == pytest.approx(0.03 * (dry - 0.12) / wet, rel=0.02)
    assert bound(scene, 'dragged') == 0.0
    assert bound(Scene.load('hexapod_smooth_wet_flat'), 'dragged') == pytest.approx(0.0, abs=1e-9)


def test_bound_of_soft_pads():
    # By hand: 0.80 of 6.834 N over 5 kN/m, twice in a cycle of 140 mm; a rail leg has it once.
    assert bound(HEXAPOD, 'soft pads') == pytest.approx(2 * 0.8 * 6.834 / 5e3 / 0.14, rel=2e-3)
    leg = Scene.load('leg_wet_flat')
    assert leg.foot.shear_stiffness == 5e3
    grip = bound(leg, 'soft pads') * 5e3 * 0.05 / 2.5
    assert grip == pytest.approx(0.35 + 4700 * min(1.0, 2.5 / 10444 / leg.foot.sole_area) *
                                 leg.foot.sole_area / 2.5, rel=1e-3)  # fmt: skip
