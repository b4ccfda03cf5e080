# SPDX-License-Identifier: Apache-2.0
import dataclasses
import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.contact.resistance import Foot
from ros_pad.control import (
    POLICIES,
    Choice,
    LiftOff,
    MorphologyController,
    adaptive,
    dome,
    first_morphologies,
    policy_named,
)
from ros_pad.errors import InvalidInput

FOOT = Foot.load('large37')
LOAD = 6.8  # N
STRIDE = 0.16  # m


def lift_off(**changes):
    step = LiftOff(
        leg=1, morphology='flat', steps=5, probing=False, wet_ahead=0.5,
        next_position=(1.0, 0.0), others_probing=False,
    )  # fmt: skip
    return dataclasses.replace(step, **changes)


# --- policies ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('step', 'expected'),
    [
        # A flat foot becomes a dome above P(wet) = 0.65.
        ({'wet_ahead': 0.66}, Choice('dome')),
        ({'wet_ahead': 0.64}, Choice('flat')),
        ({'wet_ahead': 0.0}, Choice('flat')),
        # It keeps its morphology for two steps.
        ({'wet_ahead': 0.99, 'steps': 1}, Choice('flat')),
        ({'wet_ahead': 0.99, 'steps': 2}, Choice('dome')),
        # A domed foot becomes flat below P(wet) = 0.35.
        ({'morphology': 'dome', 'wet_ahead': 0.34}, Choice('flat')),
        ({'morphology': 'dome', 'wet_ahead': 0.34, 'steps': 1}, Choice('dome')),
        # In between domed feet probe, up to 0.8 and one leg at a time.
        ({'morphology': 'dome', 'wet_ahead': 0.36}, Choice('flat', probe=True)),
        ({'morphology': 'dome', 'wet_ahead': 0.79}, Choice('flat', probe=True)),
        ({'morphology': 'dome', 'wet_ahead': 0.81}, Choice('dome')),
        ({'morphology': 'dome', 'wet_ahead': 0.5, 'others_probing': True}, Choice('dome')),
        ({'morphology': 'dome', 'wet_ahead': 0.34, 'others_probing': True}, Choice('flat')),
        ({'morphology': 'dome', 'wet_ahead': 0.5, 'steps': 1}, Choice('dome')),
        # There is no dwell after a probe: the foot is a dome again if wet, else stays flat.
        ({'probing': True, 'steps': 1, 'wet_ahead': 0.9}, Choice('dome')),
        ({'probing': True, 'steps': 1, 'wet_ahead': 0.1}, Choice('flat')),
        ({'probing': True, 'steps': 1, 'wet_ahead': 0.5}, Choice('flat')),
        # If flat feet do not pay, feet are domes on dry ground, too, and seldom probe.
        ({'wet_ahead': 0.0, 'flat_pays': False}, Choice('dome')),
        ({'wet_ahead': 0.0, 'steps': 1, 'flat_pays': False}, Choice('flat')),
        ({'morphology': 'dome', 'wet_ahead': 0.0, 'flat_pays': False}, Choice('dome')),
        ({'morphology': 'dome', 'steps': 63, 'flat_pays': False}, Choice('dome')),
        ({'morphology': 'dome', 'steps': 64, 'flat_pays': False}, Choice('flat', probe=True)),
        ({'morphology': 'dome', 'steps': math.inf, 'flat_pays': False}, Choice('dome')),
        # If domes hold hardly more on wet ground, only ground that is surely wet makes domes.
        ({'wet_ahead': 0.89, 'break_even': 0.9}, Choice('flat')),
        ({'wet_ahead': 0.91, 'break_even': 0.9}, Choice('dome')),
        ({'morphology': 'dome', 'wet_ahead': 0.89, 'break_even': 0.9}, Choice('flat', probe=True)),
        ({'morphology': 'dome', 'wet_ahead': 0.91, 'break_even': 0.9}, Choice('dome')),
    ],
)
def test_adaptive_step_by_step(step, expected):
    assert adaptive()(lift_off(**step)) == expected


def test_first_morphologies():
    legs = (1, 2, 3, 4, 5, 6)
    assert set(first_morphologies('flat', legs).values()) == {'flat'}
    assert set(first_morphologies('oracle', legs).values()) == {'flat'}
    assert set(first_morphologies('dome', legs).values()) == {'dome'}
    # One foot of each tripod begins flat and observes the ground.
    adaptive_shapes = first_morphologies('adaptive', legs)
    assert [leg for leg in legs if adaptive_shapes[leg] == 'flat'] == [1, 6]
    assert first_morphologies('adaptive', (1,)) == {1: 'flat'}
    controller = MorphologyController(FOOT, legs, adaptive(), LOAD, start=adaptive_shapes)
    assert {leg: controller.morphology(leg) for leg in legs} == adaptive_shapes
    assert sum(controller.switches.values()) == 0
    with pytest.raises(InvalidInput, match=r'start = .* leg 2'):
        MorphologyController(FOOT, (1, 2), adaptive(), LOAD, start={1: 'flat'})


@pytest.mark.parametrize(
    'bad',
    [
        {'wet_above': 1.1},
        {'dry_below': -0.1},
        {'dry_below': 0.7},
        {'probe_below': math.nan},
        {'dwell': 0},
    ],
)
def test_bad_thresholds_are_named(bad):
    with pytest.raises(InvalidInput, match=next(iter(bad))):
        adaptive(**bad)


# --- the controller ------------------------------------------------------------------------------


class Walk:
    """Legs that step one after the other along x; flat feet observe the ground correctly."""

    def __init__(self, policy, legs=(1,), is_wet=lambda x: False, told=(0.03, 0.97), **options):
        self.controller = MorphologyController(FOOT, legs, policy, LOAD, **options)
        self.legs, self.is_wet, self.told = legs, is_wet, told
        self.x = dict.fromkeys(legs, 0.0)
        self.belief = dict.fromkeys(legs, 0.5)

    def step(self, leg, load=LOAD, impact=LOAD):
        """Stand, then lift off; return the morphology chosen for the next step."""
        controller, x = self.controller, self.x[leg]
        if controller.morphology(leg) == 'flat':
            self.belief[leg] = self.told[self.is_wet(x)]
        before = controller.setpoint(leg)
        for now in (0.1 * load, impact, impact, load, load, load, impact, 0.5 * load):
            assert controller.update(leg, now, self.belief[leg], (x, 0.0)) == before
        controller.update(leg, 0.0, self.belief[leg], (x, 0.0))
        self.x[leg] = x + STRIDE
        return controller.morphology(leg)


def test_a_flat_foot_turns_to_dome_on_wet_ground():
    walk = Walk(adaptive(), is_wet=lambda x: x > 0.5)
    shapes = [walk.step(1) for _ in range(6)]
    # The fifth footprint, at 0.64 m, is the first wet one.
    assert shapes == ['flat'] * 4 + ['dome'] * 2
    assert walk.controller.setpoint(1) > 52e3
    assert walk.controller.switches == {1: 1}


def test_on_wet_ground_a_lone_foot_probes_and_goes_back_to_dome():
    walk = Walk(adaptive(), is_wet=lambda x: True)
    shapes = [walk.step(1) for _ in range(40)]
    probes = [k for k in range(1, 40) if shapes[k] == 'flat' and shapes[k - 1] == 'dome']
    assert len(probes) >= 4
    assert all(shapes[k + 1] == 'dome' for k in probes if k < 39)  # probes last one step
    # P(wet) fades from 0.97 to 0.8 in ln(0.47/0.3) = 0.45 m: three strides.
    assert {b - a for a, b in itertools.pairwise(probes)} == {3}


def test_one_leg_probes_at_a_time_and_its_footprint_serves_all():
    legs = (1, 2, 3, 4, 5, 6)
    walk = Walk(adaptive(), legs=legs, is_wet=lambda x: True)
    flats = []
    for _ in range(40):
        for leg in legs:
            walk.step(leg)
            flats.append([n for n in legs if walk.controller.morphology(n) == 'flat'])
    settled = flats[3 * len(legs) :]
    assert max(map(len, settled)) == 1
    # Six legs together probe hardly more often than one leg alone, every third stride.
    probes = sum(bool(now) and now != before for before, now in itertools.pairwise(settled))
    assert 5 <= probes <= 12


def test_pressure_follows_the_heaviest_recent_step():
    walk = Walk(dome)
    walk.step(1, load=10.0)
    # By hand: the larger of the measured peak, 10 N, and the initial 10.2 N after fading.
    expected = 75e3 + (1.2 * 10.18 / 37 - 0.2833) / 1.25e-5
    assert walk.controller.setpoint(1) == pytest.approx(expected, abs=10.0)
    walk.step(1, load=12.0)
    assert walk.controller.setpoint(1) == pytest.approx(
        75e3 + (1.2 * 12.0 / 37 - 0.2833) / 1.25e-5, abs=10.0
    )
    for _ in range(60):
        walk.step(1, load=5.0)
    assert walk.controller.setpoint(1) == pytest.approx(
        75e3 + (1.2 * 5.0 / 37 - 0.2833) / 1.25e-5, abs=50.0
    )


def test_impacts_do_not_ask_for_pressure():
    walks = Walk(dome), Walk(dome)
    for walk, impact in zip(walks, (LOAD, 3.0 * LOAD), strict=True):
        assert walk.step(1, impact=impact) == 'dome'
    assert walks[0].controller.setpoint(1) == walks[1].controller.setpoint(1)


def test_a_foot_too_heavy_for_domes_stays_flat_with_a_reason():
    walk = Walk(dome)
    assert walk.step(1, load=LOAD) == 'dome'
    assert walk.step(1, load=20.0) == 'flat'
    assert walk.controller.setpoint(1) == 0.0
    assert walk.controller.refusals[1].startswith('20 N with margin 1.2 on 37 pads')
    for _ in range(40):
        walk.step(1, load=LOAD)
    assert walk.controller.morphology(1) == 'dome'
    assert walk.controller.refusals == {}


def test_a_fixed_pressure_above_the_ceiling_is_refused_before_anything_moves():
    with pytest.raises(
        InvalidInput, match=r'fixed_pressure = 95000.0 .* to 90000 Pa, the ceiling of large37'
    ):
        MorphologyController(FOOT, (1,), dome, LOAD, fixed_pressure=95e3)


streams = st.lists(
    st.tuples(
        st.sampled_from((1, 2, 3)),
        st.floats(-1.0, 25.0),
        st.floats(0.0, 1.0),
        st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    ),
    max_size=150,
)


@settings(max_examples=60, deadline=None)
@given(streams, st.sampled_from(POLICIES))
def test_never_a_change_in_stance(stream, name):
    """For any input a set-point changes only when a foot that stood falls below the load gate."""
    policy = policy_named(name, lambda x, y: x + y > 0.0)
    controller = MorphologyController(FOOT, (1, 2, 3), policy, LOAD)
    stood = dict.fromkeys((1, 2, 3), False)
    switches = dict.fromkeys((1, 2, 3), 0)
    for leg, load, belief, position in stream:
        before = {n: (controller.setpoint(n), controller.morphology(n)) for n in stood}
        returned = controller.update(leg, load, belief, position)
        after = {n: (controller.setpoint(n), controller.morphology(n)) for n in stood}
        assert returned == after[leg][0]
        lifted = stood[leg] and load < 0.3 * LOAD
        for n in stood:
            if n != leg or not lifted:
                assert after[n] == before[n]
        switches[leg] += after[leg][1] != before[leg][1]
        if load >= 0.6 * LOAD:
            stood[leg] = True
        elif load < 0.3 * LOAD:
            stood[leg] = False
        assert (after[leg][0] > 0.0) == (after[leg][1] == 'dome')
        assert after[leg][0] <= FOOT.ceiling
    assert controller.switches == switches


def test_a_foot_that_lands_lightly_has_not_stepped():
    """Feet touch down with half their load, then carry little until the other tripod lifts off."""
    decisions = []

    def spy(step):
        decisions.append(step)
        return Choice('flat')

    controller = MorphologyController(FOOT, (1,), spy, LOAD)
    for load in (0.0, 0.55, 0.5, 0.2, 0.0, 0.2, 0.65, 1.5, 1.5, 0.65, 0.2, 0.0):
        controller.update(1, load * LOAD, 0.5, (0.0, 0.0))
    assert len(decisions) == 1


@pytest.mark.parametrize('bad', [math.nan, math.inf])
@pytest.mark.parametrize('place', ['load', 'wet_probability', 'x', 'y'])
def test_values_that_are_no_numbers_change_nothing(bad, place):
    controller = MorphologyController(FOOT, (1,), dome, LOAD)
    controller.update(1, LOAD, 0.5, (0.0, 0.0))
    values = {'load': 0.0, 'wet_probability': 0.5, 'x': 0.0, 'y': 0.0} | {place: bad}
    with pytest.raises(InvalidInput, match='leg 1: '):
        controller.update(1, values['load'], values['wet_probability'], (values['x'], values['y']))
    assert controller.setpoint(1) == 0.0
    # The lift-off was not counted: the next valid sample is the lift-off.
    assert controller.update(1, 0.0, 0.5, (0.0, 0.0)) > 0.0
