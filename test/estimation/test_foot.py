# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import FootEstimator, Tuning
from ros_pad.estimation.friction import GroundFilter, GroundModel
from ros_pad.estimation.ground import LONGEST_GAP
from ros_pad.estimation.scales import Scale

FOOT = Foot.load('large37')
LOAD = 6.8  # N
PERIOD = 0.004  # s
RIGID = dataclasses.replace(FOOT, shear_stiffness=1e7)


class Stance:
    """A foot on the floor; shear of the pads puts its marker ahead of its ``contact``."""

    def __init__(self, foot=FOOT, load=LOAD, seed=0, noise=True, tuning=None, believed=None):
        self.estimator = FootEstimator(believed or foot, load, tuning)
        self.foot, self.load = foot, load
        self.time = 0.0
        self.contact = np.zeros(2)
        self._random = np.random.default_rng(seed)
        # Sensors with exactly equal readings would be faulty.
        self._noise = (0.03, 1.5e-4) if noise else (1e-12, 1e-12)
        self.estimates = []

    def sample(self, ratio, slip=0.0, heading=0.0, pressure=0.0, share=1.0):
        """Push along the heading with T = ratio N while the contact slides at ``slip``, m/s."""
        ahead = np.array([math.cos(heading), math.sin(heading)])
        self.time += PERIOD
        self.contact = self.contact + slip * PERIOD * ahead
        normal = share * self.load
        pull = -ratio * normal * ahead
        marker = self.contact - pull / self.foot.shear_stiffness
        force = np.array([*pull, normal]) + self._random.normal(size=3) * self._noise[0]
        position = np.array([*marker, 0.0]) + self._random.normal(size=3) * self._noise[1]
        estimate = self.estimator.update(self.time, force.tolist(), position.tolist(), pressure)
        self.estimates.append(estimate)
        return estimate

    def swing(self, to=0.1, duration=0.4):
        for _ in range(round(duration / PERIOD)):
            self.sample(0.0, share=0.0)
        self.contact[0] += to


# --- slip ---------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_shipped_foot_raises_no_alarm_in_two_minutes_of_stick():
    stance = Stance()
    alarms = sum(stance.sample(0.3).slipping for _ in range(30_000))
    assert alarms == 0


@pytest.mark.parametrize('heading', [0.0, -2.0])
def test_slip_velocity_points_where_the_foot_slides(heading):
    stance = Stance(noise=False)
    for _ in range(100):
        estimate = stance.sample(0.3, slip=0.05, heading=heading)
    assert estimate.slipping
    assert estimate.slip_speed == pytest.approx(0.05, rel=0.01)
    assert estimate.slip_velocity == pytest.approx(
        (0.05 * math.cos(heading), 0.05 * math.sin(heading)), abs=5e-4
    )


@pytest.mark.parametrize('seed', range(2))
def test_a_slip_of_50_mm_a_second_is_detected_within_3_mm(seed):
    stance = Stance(seed=seed)
    for _ in range(100):
        assert not stance.sample(0.3).slipping
    slid = next(k for k in range(1, 200) if stance.sample(0.3, slip=0.05).slipping) * 0.05 * PERIOD
    assert 2e-4 < slid < 3e-3
    for _ in range(50):
        stance.sample(0.3, slip=0.05)
    quiet = next(k for k in range(1, 200) if not stance.sample(0.3).slipping) * PERIOD
    assert quiet < 0.1


# --- wetness and friction -----------------------------------------------------------------------


def wet_slip(stance):
    """Let a flat foot slip at T/N = 0.12 for half a second; return the estimate."""
    for _ in range(125):
        estimate = stance.sample(0.12, slip=0.05)
    return estimate


def dry_stick(stance):
    """Let a flat foot stick at T/N = 0.6 for half a second; return the estimate."""
    for _ in range(125):
        estimate = stance.sample(0.6)
    return estimate


@pytest.mark.parametrize('seed', range(2))
def test_flat_slip_is_wet_and_flat_stick_is_dry(seed):
    wet, dry = wet_slip(Stance(seed=seed)), dry_stick(Stance(seed=seed))
    assert wet.wet_probability > 0.95
    assert wet.friction_mean == pytest.approx(0.12, abs=0.02)
    assert dry.wet_probability < 0.05
    assert dry.friction_mean > 0.6


@pytest.mark.parametrize('wet_prior', [0.1, 0.9])
@pytest.mark.parametrize('ratio', [0.03])
def test_standing_without_pull_shows_nothing_of_the_ground(wet_prior, ratio):
    """A stance changes P(wet) a little; ten seconds of the same pull add hardly more."""
    stance = Stance(tuning=Tuning(wet_prior=wet_prior))
    for _ in range(150):
        estimate = stance.sample(ratio)
    assert estimate.wet_probability == pytest.approx(wet_prior, abs=0.07)
    for _ in range(2350):
        estimate = stance.sample(ratio)
    assert estimate.wet_probability == pytest.approx(wet_prior, abs=0.15)


def test_margin_is_the_5_percent_quantile_of_friction_less_the_ratio_now(monkeypatch):
    quantile = GroundFilter.quantile
    quantiles = []

    def recorded(ground, share):
        quantiles.append((share, quantile(ground, share)))
        return quantiles[-1][1]

    monkeypatch.setattr(GroundFilter, 'quantile', recorded)
    stance = Stance(noise=False)
    while not stance.sample(0.3).fresh or stance.time < 0.4:
        pass
    estimate = stance.estimates[-1]
    share, friction = quantiles[-1]
    assert share == 0.05
    assert estimate.margin == pytest.approx(friction - 0.3, abs=1e-9)
    # The margin follows T/N from sample to sample, also between updates of the filter.
    harder = stance.sample(0.35)
    assert not harder.fresh
    assert harder.margin == pytest.approx(estimate.margin - 0.05, abs=1e-9)


# --- offsets of force sensors ------------------------------------------------------------------


GROUND = 0.5  # m: the floor need not be at zero


def test_friction_is_given_for_the_load_that_a_foot_stands_under():
    """Adhesion of a whole sole, 4700 Pa on 908 mm², is the same at any load, so that T/N falls
    with the load."""

    def friction(load):
        return 0.35 + 4700.0 * math.pi * 0.017**2 / load

    heavy = Stance(load=4.0 * LOAD)
    for _ in range(125):
        slid = heavy.sample(friction(4.0 * LOAD), slip=0.1)
    assert slid.friction_mean == pytest.approx(friction(4.0 * LOAD), abs=0.05)
    for _ in range(25):
        light = heavy.sample(0.3, share=0.5)
    assert light.friction_mean == pytest.approx(friction(2.0 * LOAD), abs=0.07)
    assert light.friction_mean - slid.friction_mean > 0.1
    fifth = light.friction_mean - 1.64 * light.friction_sd  # percentile, at this load, too
    assert light.margin + 0.3 == pytest.approx(fifth, abs=0.03)
    assert light.wet_probability < 0.1


class Offset:
    """An estimator whose force sensor has an offset, N, after some steps."""

    def __init__(self, offset, lift, swings):
        self.inner = FootEstimator(FOOT, LOAD)
        self.offset = offset
        self.time = self.height = 0.0
        for _ in range(swings):
            self.feel(50, (0.0, 0.0, LOAD), 0.0)
            self.feel(100, (0.0, 0.0, 0.0), lift)

    def feel(self, samples, force, height, slip=0.0):
        x = 0.0
        if height != self.height:
            self.height = height
            self.time += 0.02  # no samples while the height changes
        for _ in range(samples):
            self.time += PERIOD
            x += slip * PERIOD
            jitter = 1e-12 * math.sin(self.time)  # exactly equal readings would be faulty
            felt = [f + o + jitter for f, o in zip(force, self.offset, strict=True)]
            marker = x - force[0] / FOOT.shear_stiffness + jitter
            estimate = self.inner.update(self.time, felt, (marker, 0.0, GROUND + height), 0.0)
        return estimate


@pytest.mark.parametrize('offset', [(-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, -1.0, -1.0)])
def test_an_offset_of_1_newton_is_taken_off_in_the_air(offset):
    """The foot slips at T/N = 0.12, but its sensor reads 0.18 to 0.27."""
    pull = (-0.12 * LOAD, 0.0, LOAD)
    told = Offset(offset, lift=0.03, swings=5).feel(125, pull, 0.0, slip=0.05)
    assert told.wet_probability > 0.95
    assert told.friction_mean == pytest.approx(0.12, abs=0.03)
    # If the foot is not lifted high enough, the offset stays.
    lame = Offset(offset, lift=0.005, swings=5).feel(125, pull, 0.0, slip=0.05)
    assert abs(lame.friction_mean - 0.12) > 0.01


def test_what_is_known_of_friction_counts_from_the_start():
    known = Tuning(scales={'flat_dry': Scale(0.5, 0.05)})
    found = [GroundModel.of(FOOT, LOAD, each).shared.scales for each in (known, Tuning())]
    assert found[0]['flat_dry'].scale == pytest.approx(0.5, rel=0.05)
    assert found[0]['dome'] == found[1]['dome']


def test_a_foot_that_lands_on_a_step_stands_there():
    foot = Offset((0.0, 0.0, 0.0), lift=0.05, swings=3)
    for load in (0.1, 0.2, 0.5, 1.0):
        estimate = foot.feel(5, (0.0, 0.0, load * LOAD), 0.04)
    assert estimate.standing
    dry = foot.feel(125, (-0.6 * LOAD, 0.0, LOAD), 0.04)
    assert dry.friction_mean > 0.6
    assert dry.margin == pytest.approx(0.0, abs=0.1)


# --- samples as they come -----------------------------------------------------------------------

GOOD = (1.0, (-1.0, 0.0, LOAD), (0.0, 0.0, 0.0), 0.0)
PLACES = [
    ('time', lambda bad: (bad, *GOOD[1:])),
    ('force x', lambda bad: (1.0, (bad, 0.0, LOAD), *GOOD[2:])),
    ('force y', lambda bad: (1.0, (0.0, bad, LOAD), *GOOD[2:])),
    ('force z', lambda bad: (1.0, (0.0, 0.0, bad), *GOOD[2:])),
    ('position x', lambda bad: (*GOOD[:2], (bad, 0.0, 0.0), 0.0)),
    ('position y', lambda bad: (*GOOD[:2], (0.0, bad, 0.0), 0.0)),
    ('position z', lambda bad: (*GOOD[:2], (0.0, 0.0, bad), 0.0)),
    ('pressure', lambda bad: (*GOOD[:3], bad)),
]


@pytest.mark.parametrize('bad', [math.nan, math.inf])
@pytest.mark.parametrize(('name', 'place'), PLACES, ids=[name for name, _ in PLACES])
def test_values_that_are_no_numbers_are_named_and_change_nothing(name, place, bad):
    estimator = FootEstimator(FOOT, LOAD)
    before = estimator.estimate
    with pytest.raises(InvalidInput, match=f'{name} = {bad!r} '):
        estimator.update(*place(bad))
    assert estimator.estimate is before
    assert estimator.update(*GOOD).standing


@pytest.mark.parametrize('late', [1.0, 0.999, 1.001 - LONGEST_GAP])
def test_duplicate_and_late_samples_are_refused_and_change_nothing(late):
    estimator, other = FootEstimator(FOOT, LOAD), FootEstimator(FOOT, LOAD)
    for each in (estimator, other):
        each.update(*GOOD)
    with pytest.raises(InvalidInput, match=r'time = .* must be later'):
        estimator.update(late, (-6.0, 0.0, LOAD), (0.5, 0.0, 0.0), 0.0)
    following = (1.004, *GOOD[1:])
    assert estimator.update(*following) == other.update(*following)


def test_a_gap_longer_than_a_stance_is_a_new_stance():
    """After half a second without samples the foot is 0.16 m ahead, which is no slip."""
    stance = Stance(noise=False)
    for _ in range(100):
        stance.sample(0.3)
    stance.time += 0.5
    stance.contact[0] += 0.16
    assert not any(stance.sample(0.3).slipping for _ in range(20))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(1e-4, 0.5),
            st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-50, 50)),
            st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-0.004, 0.004)),
            st.floats(-1e3, 1e5),
        ),
        min_size=1,
        max_size=60,
    )
)
def test_estimates_are_finite_whatever_comes(samples):
    estimator = FootEstimator(FOOT, LOAD)
    now = 0.0
    for dt, force, position, pressure in samples:
        now += dt
        estimate = estimator.update(now, force, position, pressure)
        assert 0.0 <= estimate.wet_probability <= 1.0
        assert estimate.friction_sd > 0.0
        assert math.isfinite(
            estimate.friction_mean + estimate.slip_speed + sum(estimate.slip_velocity)
        )
        assert math.isfinite(estimate.margin) or not (estimate.sound and estimate.standing)
        # Slip velocity and slip speed have the same magnitude.
        vx, vy = estimate.slip_velocity
        assert math.hypot(vx, vy) == pytest.approx(abs(estimate.slip_speed), rel=1e-6, abs=1e-12)
        assert estimate.standing == (estimate.sound and force[2] >= 0.1 * LOAD)
        assert estimate.doubt or estimate.standing or estimate.sound


# --- settings ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', [field.name for field in dataclasses.fields(Tuning)])
@pytest.mark.parametrize('value', [-1.0, math.nan, 'much'])
def test_bad_tuning_is_named(name, value):
    with pytest.raises(InvalidInput, match=name.replace('_', '.')):
        Tuning(**{name: value})
