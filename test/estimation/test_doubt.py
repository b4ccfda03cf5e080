# SPDX-License-Identifier: Apache-2.0
"""A foot reports what it cannot measure, and does not estimate from it.

If wet and dry ground give the same readings, the estimate must not change; else it must.
"""

import math

import numpy as np
import pytest

from ros_pad.contact.resistance import Foot, expected_friction
from ros_pad.estimation import FootEstimator, Tuning
from ros_pad.estimation.scales import Scale

FOOT = Foot.load('large37')
LOAD = 6.8  # N
PERIOD = 0.004  # s
PRIOR = expected_friction(FOOT, LOAD)
LEVER = 2.0 / 3.0 * FOOT.sole_radius


class Walk:
    """A foot that walks ahead; slip, load and yaw moment of each stance are given."""

    def __init__(self, seed=0, **tuning):
        self.estimator = FootEstimator(FOOT, LOAD, Tuning(**tuning))
        self.random = np.random.default_rng(seed)
        self.time = self.x = 0.0

    @property
    def estimate(self):
        return self.estimator.estimate

    def sample(self, ratio, slip=0.0, load=LOAD, height=0.0, pressure=0.0, moment=None):
        self.time += PERIOD
        self.x += slip * PERIOD
        pull = -ratio * load
        force = np.array([pull, 0.0, load]) + 0.03 * self.random.normal(size=3)
        marker = np.array([self.x - pull / FOOT.shear_stiffness, 0.0, height])
        marker += 1.5e-4 * self.random.normal(size=3)
        if moment is not None:
            moment += 5e-4 * self.random.normal()
        return self.estimator.update(self.time, force.tolist(), marker.tolist(), pressure, moment)

    def stand(self, ratio=0.3, slip=0.0, seconds=0.5, load=LOAD, **more):
        """Stand under a pull that reaches ``ratio`` times the load after 0.1 s."""
        for k in range(round(seconds / PERIOD)):
            grown = min(1.0, k * PERIOD / 0.1)
            self.sample(grown * ratio, slip if grown == 1.0 else 0.0, load, **more)
        return self.estimate

    def swing(self, stride=0.14, seconds=0.4):
        count = round(seconds / PERIOD)
        for k in range(count):
            self.x += stride / count
            self.sample(0.0, load=0.0, height=0.03 * math.sin(math.pi * k / count))
        return self.estimate


def kind(estimate):
    return estimate.doubt.partition(':')[0]


# --- the ground ---------------------------------------------------------------------------------


@pytest.mark.parametrize('ratio', [0.0, 0.08])
def test_a_foot_that_is_never_pulled_stays_with_its_prior(ratio):
    """The foot would stick on wet and on dry ground, so that the ground is unobservable."""
    for prior in (0.1, 0.5):
        walk = Walk(wet_prior=prior)
        for _ in range(12):
            estimate = walk.stand(ratio)
            assert kind(estimate) == 'not pulled'
            walk.swing()
        # Sticking is weak evidence of dry ground, which has more friction. It must not add up to
        # more than that of one stance in a patch length.
        odds = math.log(estimate.wet_probability / (1.0 - estimate.wet_probability))
        assert abs(odds - math.log(prior / (1.0 - prior))) < 1.0
        assert estimate.friction_sd > 0.2


@pytest.mark.parametrize(('ratio', 'slip', 'wet'), [(0.12, 0.05, True), (0.6, 0.0, False)])
def test_knowledge_fades_over_the_way_and_comes_back(ratio, slip, wet):
    walk = Walk()
    known = walk.stand(ratio, slip)
    assert (kind(known), known.wet_probability > 0.9) == ('', wet)
    assert (known.wet_probability < 0.1) != wet
    walk.swing()
    excess = []
    for _ in range(11):
        excess.append(abs(walk.stand(0.01).wet_probability - 0.5))
        assert kind(walk.estimate) == 'not pulled'
        walk.swing()
    # P(wet) fades with exp(-d / 1.5 m) over 1.4 m; the ten stances between add weak evidence.
    assert excess[-1] / excess[0] == pytest.approx(math.exp(-1.4 / 1.5), abs=0.12)
    assert kind(walk.stand(ratio, slip)) == ''
    assert (walk.estimate.wet_probability > 0.9) == wet


@pytest.mark.parametrize('wet', [False, True])
def test_a_dome_cannot_distinguish_the_grounds_and_reports_it(wet):
    walk = Walk()
    known = walk.stand(*((0.12, 0.05) if wet else (0.6, 0.0)))
    excess = known.wet_probability - 0.5
    for step in range(1, 12):
        walk.swing()
        for slip in (0.0, 0.03):
            walk.stand(PRIOR.dome, slip, pressure=80e3)
        assert kind(walk.estimate) == 'domed'
        slid = walk.x - 0.14 * step
    faded = 0.5 + excess * math.exp(-(11 * 0.14 + slid) / 1.5)
    assert walk.estimate.wet_probability == pytest.approx(faded, abs=0.02)
    assert walk.estimate.friction_mean == pytest.approx(PRIOR.dome, abs=0.1)


@pytest.mark.parametrize('seed', range(2))
def test_what_turning_hides_a_moment_shows(seed):
    """A slip at T/N = 0.12 is on wet ground, or on dry ground where the foot also turns.

    Without a measured yaw moment wet ground is more probable.
    """
    shown = 0.12
    unknown = Walk(seed).stand(shown, 0.01)
    assert unknown.wet_probability > 0.5
    moment = math.sqrt(PRIOR.flat_dry**2 - shown**2) * LOAD * LEVER
    dry = Walk(seed, moment_noise=5e-4).stand(shown, 0.01, moment=moment)
    assert dry.wet_probability < 0.05
    assert dry.friction_mean == pytest.approx(PRIOR.flat_dry, abs=2.0 * dry.friction_sd)
    assert dry.margin < 0.05
    wet = Walk(seed, moment_noise=5e-4).stand(shown, 0.04, moment=0.0)
    assert wet.wet_probability > 0.95
    assert wet.friction_mean == pytest.approx(shown, abs=2.0 * wet.friction_sd)
    assert wet.friction_sd < unknown.friction_sd


def test_doubts_are_where_the_errors_are():
    """In stances drawn from the prior, estimates without doubt are right, others near chance."""
    random = np.random.default_rng(11)
    knowing, doubting = [], []
    for seed in range(150):
        wet = random.random() < 0.5
        mean = PRIOR.flat_wet if wet else PRIOR.flat_dry
        # Places differ by 0.14 (root mean square of the spreads), scales by the given deviation.
        friction = mean * math.exp(random.normal(0.0, math.hypot(0.15, 0.14)))
        demand = random.exponential(0.2)
        slips = demand > friction
        walk = Walk(seed, scales={'flat_dry': Scale(1.0, 0.15), 'flat_wet': Scale(1.0, 0.15)})
        estimate = walk.stand(min(demand, friction), random.gamma(2.0, 0.04) if slips else 0.0)
        likely = estimate.wet_probability if wet else 1.0 - estimate.wet_probability
        (doubting if estimate.doubt else knowing).append(likely)
    assert len(knowing) > 35
    assert len(doubting) > 35
    assert np.mean(np.array(knowing) > 0.5) > 0.97
    assert np.mean(doubting) < 0.65
    # Probabilities are calibrated.
    every = np.array(knowing + doubting)
    assert np.mean(every > 0.5) == pytest.approx(np.mean(np.maximum(every, 1.0 - every)), abs=0.06)


# --- the sensors --------------------------------------------------------------------------------


class Broken(Walk):
    """A walk in which a function changes the readings before the estimator receives them."""

    def __init__(self, change, seed=0, **tuning):
        super().__init__(seed, **tuning)
        update, self.broken = self.estimator.update, False
        self.last = None

        def changed(time, force, position, *rest):
            if not self.broken:
                self.last = force, position
                return update(time, force, position, *rest)
            force, position = change(force, position, *(self.last or (force, position)))
            return update(time, force, position, *rest)

        self.estimator.update = changed


def frozen_force(force, position, last_force, last_position):
    return last_force, position


def frozen_marker(force, position, last_force, last_position):
    return force, last_position


def test_estimates_from_a_frozen_force_sensor_are_taken_back():
    """The sensor freezes at full load while the foot walks on, which looks like a slip."""
    walk = Broken(frozen_force)
    known = walk.stand(0.6)
    assert known.wet_probability < 0.1
    walk.broken = True
    alarms = 0
    for _ in range(10):
        alarms += walk.swing().slipping
        walk.stand(0.3)
    estimate = walk.estimate
    assert estimate.doubt.startswith(f'force stands still: {walk.last[0][2]:.3g} N')
    assert not (estimate.sound or estimate.standing or estimate.slipping)
    assert alarms == 0
    assert math.isnan(estimate.margin)
    assert estimate.slip_speed_sd == math.inf
    assert estimate.wet_probability == pytest.approx(0.5)
    assert estimate.friction_sd > known.friction_sd
    walk.broken = False
    for healed in (walk.swing(), walk.sample(0.12)):
        assert (kind(healed), healed.sound) == ('not yet', True)
    healed = walk.stand(0.12, 0.05)
    assert healed.sound
    assert healed.wet_probability > 0.9
    assert math.isfinite(healed.margin)


def test_a_coarse_force_sensor_is_given_longer_and_takes_back_all_of_it():
    """At a resolution of 0.2 N equal readings are normal: the fault is found after two seconds."""

    kept = []

    def coarse(force, position, *_):
        if not stopped:
            kept[:] = [0.2 * round(component / 0.2) for component in force]
        return list(kept), position

    walk = Broken(coarse)
    walk.broken, stopped = True, False
    walk.swing()
    for k in range(125):  # load and pull change all the time
        known = walk.sample(0.12 + 0.5 * math.sin(math.pi * k / 124), load=LOAD + 0.01 * k)
    assert known.wet_probability < 0.1
    stopped = True
    for _ in range(4):
        walk.stand(slip=0.05, seconds=0.6)
    estimate = walk.estimate
    assert kind(estimate) == 'force stands still'
    assert estimate.wet_probability == pytest.approx(0.5)


@pytest.mark.parametrize('range_known', [True, False])
def test_a_sensor_at_the_end_of_its_range_is_not_used(range_known):
    """If the sensor ends at 5 N under a load of 6.8 N, T/N = 0.6 looks like 0.82."""

    def saturated(force, position, last_force, last_position):
        return [force[0], force[1], min(force[2], 5.0)], position

    walk = Broken(saturated, **({'force_range': 5.0} if range_known else {}))
    walk.broken = True
    for _ in range(5):
        estimate = walk.stand(0.6)
        assert kind(estimate) == 'force out of range'
        assert estimate.doubt.endswith('z = 5 N' if range_known else 'z stays at 5 N')
        walk.swing()
    assert estimate.friction_mean == pytest.approx(walk.estimate.friction_mean)
    assert estimate.wet_probability == pytest.approx(0.5, abs=0.05)


def test_a_marker_that_leaps_is_no_slip_and_no_way():
    """Motion capture can take another marker for this one for a while."""
    walk = Walk()
    walk.stand(0.6)
    walk.x += 0.4
    assert walk.sample(0.3).doubt == 'marker leapt: 400 mm'
    away = walk.stand(0.3, seconds=0.1)
    walk.x -= 0.4
    back = walk.stand(0.3, seconds=0.1)
    assert not (away.slipping or back.slipping)


@pytest.mark.parametrize('bias', [0.5, 3.0])
def test_a_bias_too_large_to_be_none_is_found_in_the_first_swing(bias):
    """In the air the sensor reads nearly half of the load, but a rising foot does not stand."""
    walk = Broken(lambda force, position, *_: ([force[0], force[1], force[2] + bias], position))
    walk.broken = True
    for _ in range(6):
        estimate = walk.stand(0.12, 0.05)
        in_the_air = [walk.swing(seconds=0.2).standing, walk.swing(seconds=0.2).standing]
    assert not any(in_the_air)
    assert estimate.wet_probability > 0.9
    assert estimate.friction_mean == pytest.approx(0.12, abs=0.04)
