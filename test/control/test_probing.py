# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
import pytest

from ros_pad.contact.resistance import Foot
from ros_pad.control.footprints import Footprints
from ros_pad.control.probing import PREMIUM
from ros_pad.control.probing import TRIAL_STRIDES
from ros_pad.control.probing import Planner
from ros_pad.control.probing import Stakes
from ros_pad.control.probing import Step
from ros_pad.control.probing import probe_interval
from ros_pad.errors import InvalidInput

STRIDE = 0.14  # m
LEGS = (1, 2, 3, 4, 5, 6)
TRIPODS = ((1, 3, 5), (2, 4, 6))
STAKES = Stakes(gain=0.1, cost=0.2, probe_cost=0.01)

# --- the interval --------------------------------------------------------------------------------


def gain_per_metre(stakes, wet_share, length, interval, seed, way=40_000.0):
    """Walk over random patches with probes at a fixed interval, m; return the gain per metre."""
    random = np.random.default_rng(seed)
    mean = {True: length / (1.0 - wet_share), False: length / wet_share}
    x, gained, wet, end = 0.0, 0.0, True, random.exponential(mean[True])
    while x < way:
        x += interval
        while end < x:
            wet = not wet
            end += random.exponential(mean[wet])
        if wet:
            gained -= stakes.probe_cost * STRIDE
        else:
            # Two steps to a stride gain up to the end of the patch; one step beyond it is lost.
            gained += 2.0 * stakes.gain * (end - x) - stakes.cost * STRIDE
            x, wet = end, True
            end += random.exponential(mean[True])
    return gained / x


@pytest.mark.parametrize(
    ('stakes', 'wet_share', 'length'),
    [
        (STAKES, 0.5, 1.0),
        (Stakes(0.05, 0.2, 0.06), 0.5, 1.0),
        (Stakes(0.1, 0.2, 0.05), 0.85, 1.0),
        (Stakes(0.02, 0.1, 0.03), 0.3, 2.0),
        (Stakes(0.1, 0.1, 0.1), 0.7, 0.4),
        (Stakes(0.3, 0.2, 1.0), 0.1, 0.5),
    ],
)
def test_the_planned_interval_is_as_good_as_the_best(stakes, wet_share, length):
    planned = probe_interval(stakes, wet_share, length, STRIDE)
    tried = {
        way: gain_per_metre(stakes, wet_share, length, way, seed=5)
        for way in (*np.geomspace(STRIDE, 6.0, 14), planned)
    }
    assert max(tried.values()) > 0.0
    assert tried[planned] > 0.95 * max(tried.values())
    # Intervals far from the best gain much less.
    assert min(tried.values()) < 0.8 * max(tried.values())


@pytest.mark.parametrize('gain', [0.0, -0.005, 0.003])
def test_where_probes_bring_nothing_they_take_a_fixed_share_of_the_way(gain):
    """On patches of 0.3 m, steps into the next wet patch cost more than a small gain."""
    stakes = Stakes(gain, 0.2, 0.01)
    interval = probe_interval(stakes, 0.5, 0.15, STRIDE)
    assert stakes.probe_cost * STRIDE / interval == pytest.approx(PREMIUM)
    assert PREMIUM < 0.003


def test_that_probes_cost_nothing_is_no_reason_to_make_them():
    """At least 0.01 strides are counted as cost; at 0.0025 of the distance: four strides."""
    assert probe_interval(Stakes(0.0, 0.2, 0.0), 0.5, 1.0, STRIDE) == pytest.approx(4.0 * STRIDE)


def test_a_probe_on_dry_ground_costs_where_domes_hold_better():
    interval = probe_interval(Stakes(-0.1, 0.2, 0.01), 0.5, 1.0, STRIDE)
    assert 0.1 * STRIDE / interval == pytest.approx(PREMIUM)


def test_dearer_probes_and_wetter_ground_are_probed_less():
    by_price = [
        probe_interval(dataclasses.replace(STAKES, probe_cost=cost), 0.5, 1.0, STRIDE)
        for cost in (0.02, 0.05, 0.1, 0.2)
    ]
    assert by_price == sorted(by_price) and by_price[-1] > 2.0 * by_price[0]
    by_share = [
        probe_interval(dataclasses.replace(STAKES, probe_cost=0.1), share, 1.0, STRIDE)
        for share in (0.3, 0.6, 0.9, 0.99)
    ]
    assert by_share == sorted(by_share) and by_share[-1] > 2.0 * by_share[0]


def test_probes_that_cost_little_are_made_each_stride():
    """By hand, with cost c₁, stride s, length ℓ, wet share q and gain g, the best interval is near
    sqrt(2 c₁ s ℓ²/((1 - q) 2 g ℓ/q)) = 0.08 m, below a stride."""
    assert probe_interval(Stakes(0.4, 0.1, 0.02), 0.5, 1.0, STRIDE) == pytest.approx(STRIDE)
    assert probe_interval(Stakes(0.1, 0.1, 0.0), 0.5, 1.0, STRIDE) == STRIDE


@pytest.mark.parametrize(
    ('name', 'value'),
    [('wet_share', 0.0), ('wet_share', 1.1), ('fading_length', 0.0), ('stride', math.nan)],
)
def test_bad_values_are_named(name, value):
    values = {'wet_share': 0.5, 'fading_length': 1.0, 'stride': STRIDE} | {name: value}
    with pytest.raises(InvalidInput, match=name):
        probe_interval(STAKES, **values)


@pytest.mark.parametrize(
    ('name', 'value'), [('gain', math.inf), ('cost', -0.1), ('probe_cost', math.nan)]
)
def test_bad_stakes_are_named(name, value):
    with pytest.raises(InvalidInput, match=name):
        dataclasses.replace(STAKES, **{name: value})


def test_expected_stakes_follow_the_contact_model():
    """Stakes are a quarter of the differences in friction that feet/large37.yaml states."""
    foot = Foot.load('large37')
    stakes = Stakes.expected(foot, 6.8)
    assert stakes.gain == pytest.approx(0.25 * (0.80 - 0.41), abs=0.005)
    assert stakes.cost == pytest.approx(0.25 * (0.41 - 0.12), abs=0.005)
    # Without adhesion all dry contact has the same friction.
    assert Stakes.expected(dataclasses.replace(foot, shear_strength=0.0), 6.8).gain == 0.0


# --- learning ------------------------------------------------------------------------------------


class Body:
    """Six feet that slip; each step loses a given share of the stride."""

    def __init__(self, heading=0.0, expected=STAKES):
        self.ground = Footprints()
        self.planner = Planner(expected, LEGS)
        self.x = dict.fromkeys(LEGS, 0.0)
        self.ahead = math.cos(heading), math.sin(heading)
        self.steps = 0

    def at(self, x, leg):
        (cos, sin), y = self.ahead, 0.1 * leg
        return x * cos - y * sin, x * sin + y * cos

    def step(self, lost, flat=(), probing=(), wet=0.0):
        """Step with the tripod whose turn it is; return the plans of its legs."""
        tripod = TRIPODS[self.steps % 2]
        self.steps += 1
        for leg in tripod:
            landed = self.x[leg] + STRIDE * (1.0 - lost)
            self.x[leg] = landed - STRIDE * lost
            step = Step(
                self.at(landed, leg), self.at(self.x[leg], leg), leg in flat, leg in probing, wet
            )
            self.planner.step(leg, step, self.ground)
        return {leg: self.planner.plan(leg) for leg in tripod}


def on_dry_ground(body, steps, flat, domes):
    """Walk on dry ground; return the legs with a dome test, in order, and the last plans."""
    tried = []
    trying = set()
    for _ in range(steps):
        tripod = set(TRIPODS[body.steps % 2])
        on_trial = trying & tripod
        lost = domes if on_trial else flat
        plans = body.step(lost, flat=tripod - on_trial, probing=on_trial)
        trying -= on_trial
        new = {leg for leg, plan in plans.items() if plan.trial}
        tried += sorted(new)
        trying |= new
    return tried, plans


@pytest.mark.parametrize('heading', [0.0, 2.0])
@pytest.mark.parametrize('domes', [0.15, 0.04])
def test_domes_are_tried_once_on_dry_ground(heading, domes):
    """The dome test shows that domes lose 0.15 or 0.04 of a stride; flat feet lose 0.05."""
    body = Body(heading)
    tried, plans = on_dry_ground(body, 60, 0.05, domes)
    assert sorted(tried) == list(LEGS)
    assert body.planner.stakes.gain == pytest.approx(domes - 0.05)
    assert all(plan.flat_pays == (domes > 0.05) for plan in plans.values())


def test_an_old_trial_counts_no_more():
    body = Body()
    on_dry_ground(body, 60, 0.05, 0.15)
    tried, _ = on_dry_ground(body, round(2 * TRIAL_STRIDES) + 20, 0.05, 0.07)
    assert sorted(tried) == list(LEGS)
    assert body.planner.stakes.gain == pytest.approx(0.02)


def test_that_flat_feet_do_not_pay_is_forgotten_in_the_end():
    body = Body(expected=Stakes(0.0, 0.1, 0.02))
    strides = 0
    while not body.step(0.0, wet=0.5)[2 if body.steps % 2 == 0 else 1].flat_pays:
        strides = body.steps / 2
    assert strides == pytest.approx(TRIAL_STRIDES, abs=1.0)


def test_no_trial_where_flat_feet_lose_nothing():
    body = Body()
    for _ in range(80):
        plans = body.step(0.005, flat=LEGS)
        assert not any(plan.trial for plan in plans.values())


def test_what_a_probe_costs_is_what_its_tripod_lost_more_than_before():
    """This holds even if all steps lose more and more, as when a sled comes onto dry ground."""
    body = Body()
    for leg in LEGS:  # all legs have wet footprints
        body.ground.add(*body.at(0.0, leg), 0.97)
    for count in range(120):
        tripod = TRIPODS[count % 2]
        probe = tripod[:1] if count % 8 == 6 else ()
        towed = 0.002 * (count // 2) + 0.05 * (count % 2)  # one tripod always loses more
        body.step(towed + (0.04 if probe else 0.01), flat=probe, probing=probe, wet=0.97)
    # 0.03 more than the last step of the same tripod, and 0.002 as all losses grow.
    assert body.planner.stakes.probe_cost == pytest.approx(0.032, abs=1e-6)


def test_a_walk_on_dry_domes_shows_what_they_lose():
    """On domes the loss is still measured, so that flat feet can pay again."""
    body = Body()
    for _ in range(20):
        body.step(0.05, flat=LEGS)
    for _ in range(20):
        body.ground.add(*body.at(body.x[1] + STRIDE, 1), 0.0)  # ground known to be dry
        body.step(0.2)
    assert body.planner.stakes.gain == pytest.approx(0.15)


@pytest.mark.parametrize('length', [0.0, 5e-324, 1e-300, 1e-6])
def test_feet_that_do_not_advance_plan_no_probes(length):
    """Rounding and hostile messages make strides of no length: a logarithm of it has no value."""
    planner, ground = Planner(STAKES, LEGS), Footprints()
    for number in range(100):
        at = number % 2 * length, 0.0
        for leg in LEGS:
            planner.step(leg, Step(at, at, True, False, 0.5), ground)
    assert planner.interval == math.inf
