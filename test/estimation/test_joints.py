# SPDX-License-Identifier: Apache-2.0
"""A foot whose slip comes from joints: a velocity of the contact with its deviation."""

import dataclasses
import math
import re

import numpy as np
import pytest

from ros_pad.contact.resistance import Foot
from ros_pad.errors import InvalidInput
from ros_pad.estimation import DOUBTS, SENSOR_FAULTS, FootEstimator, Tuning, doubt
from ros_pad.estimation.stage import EstimationStage
from ros_pad.records import SAMPLE, Block

FOOT = Foot.load('large37')
LOAD = 6.8  # N
PERIOD = 0.004  # s
MS = 1_000_000
JOINTS = Tuning(source='joints', pads_shear=False)


class Stance:
    """A foot that is pulled along x, with the velocity that joints would show."""

    def __init__(self, sd, tuning=JOINTS, foot=FOOT, seed=0):
        self.estimator = FootEstimator(foot, LOAD, tuning)
        self.sd, self.time = sd, 0.0
        self._random = np.random.default_rng(seed)
        self.estimates = []

    def sample(self, ratio, velocity=0.0, known=True):
        self.time += PERIOD
        force = np.array((-ratio * LOAD, 0.0, LOAD)) + 0.03 * self._random.standard_normal(3)
        motion = {'velocity': (velocity, 0.0), 'variance': self.sd**2 if known else math.inf}
        estimate = self.estimator.update(self.time, force.tolist(), (0, 0, 0), 0.0, **motion)
        self.estimates.append(estimate)
        return estimate

    def slide(self, speed, samples, ratio=0.12):
        """Slide for some samples; return after how many the alarm rises, or None."""
        for count in range(1, samples + 1):
            if self.sample(ratio, speed).slipping:
                return count
        return None


def test_the_alarm_waits_longer_where_the_velocity_is_less_certain():
    # It counts what is faster than two deviations, of the body's velocity and 2 mm/s.
    for sd, speed in [(0.005, 0.06), (0.01, 0.06), (0.02, 0.1)]:
        faster = speed - 2.0 * math.hypot(sd, 0.002)
        count = Stance(sd, dataclasses.replace(JOINTS, pads_shear=False)).slide(speed, 300)
        # The five samples of the first 20 ms do not count.
        assert count == 5 + math.ceil(5e-4 / faster / PERIOD)
    assert Stance(0.02).slide(0.035, 100) is None


def test_an_uncertain_velocity_teaches_less():
    def wetness(sd):
        stance = Stance(sd)
        for _ in range(150):
            stance.sample(0.12, 0.05)
        return stance.estimates[-1].wet_probability

    # A foot that slips at T/N = 0.12 is on wet ground: μ is 0.80 dry and 0.12 wet.
    assert wetness(0.005) > 0.9
    assert 0.5 < wetness(0.05) < wetness(0.005)


def test_a_body_in_doubt_climbs():
    """What a foot bears on higher ground is no offset of its sensor."""
    estimator, time = FootEstimator(FOOT, LOAD, JOINTS), 0.0
    noise = np.random.default_rng(1)

    def move(samples, load, begin, end):
        nonlocal time
        for height in np.linspace(begin, end, samples):
            time += PERIOD
            force = [0.1 * load, 0.0, load] + 1e-3 * noise.standard_normal(3)
            motion = {'variance': math.inf if step else 1e-6}
            estimator.update(time, force.tolist(), (0, 0, float(height)), 0.0, **motion)
            stood.append(estimator.estimate.standing)

    for step in range(12):  # 8 mm each, with a quarter of the load as it begins and ends
        stood = []
        height = 0.008 * step
        for load in (1.7, LOAD, 1.7):
            move(20, load, height, height)
        assert all(stood), step
        move(20, 0.0, height, height + 0.05)
        move(20, 0.0, height + 0.05, height + 0.008)


def test_a_body_in_doubt_stops_alarm_and_learning():
    stance = Stance(0.005)
    for _ in range(100):
        stance.sample(0.3)
    before = stance.estimates[-1]
    assert before.wet_probability < 0.5  # it sticks at more than wet ground holds
    for _ in range(100):
        estimate = stance.sample(0.12, 0.2, known=False)
        assert estimate.doubt == 'motion unknown: the body is in doubt'
        assert not estimate.slipping
        assert estimate.standing
        assert estimate.sound
        assert estimate.slip_speed_sd == math.inf
        assert estimate.wet_probability == before.wet_probability
    assert 'motion unknown' in DOUBTS
    assert 'motion unknown' not in SENSOR_FAULTS  # force and pads are fine
    for _ in range(12):  # the window after the doubt has no sample of the doubt
        estimate = stance.sample(0.3)
    assert not estimate.slipping
    assert estimate.doubt.partition(':')[0] != 'motion unknown'
    assert estimate.wet_probability <= before.wet_probability


@pytest.mark.parametrize(('shears', 'slips'), [(True, False), (False, True)])
def test_the_link_above_soft_pads_moves_while_the_contact_sticks(shears, slips):
    soft = dataclasses.replace(FOOT, shear_stiffness=300.0)
    stance = Stance(0.003, Tuning(source='joints', pads_shear=shears), soft)
    alarms = 0
    for step in range(1, 1250):
        angle = math.pi * step / 125
        ratio = 0.5 * math.sin(angle) ** 2
        # The pull is -ratio times load: the link is ahead of the contact by ratio load / k.
        rate = 0.5 * math.sin(2.0 * angle) * math.pi / 125 / PERIOD * LOAD / 300.0
        alarms += stance.sample(ratio, rate).slipping
    assert (alarms > 0) == slips


@pytest.mark.parametrize(
    ('motion', 'named'),
    [
        ({'velocity': (math.nan, 0.0), 'variance': 1e-4}, 'velocity x = nan m/s'),
        ({'variance': math.nan}, 'variance = nan '),
        ({'variance': -0.01}, 'variance = -0.01 '),
    ],
)
def test_a_bad_motion_is_refused(motion, named):
    estimator = FootEstimator(FOOT, LOAD, JOINTS)
    with pytest.raises(InvalidInput, match=named):
        estimator.update(0.004, (0.0, 0.0, LOAD), (0.0, 0.0, 0.0), 0.0, **motion)
    assert estimator.estimate.time == -math.inf  # as before


def stage_with(tuning=JOINTS):
    rejected = []
    stage = EstimationStage(
        FOOT, LOAD, tuning, [1], reject=lambda leg, error: rejected.append(error)
    )
    return stage, rejected


def send(stage, ms, **values):
    rows = SAMPLE.rows(1)
    given = {'force': (0.5, 0.0, 6.0 + ms % 7), 'position': (0.001 * ms, 0.0, 1e-5 * ms),
             'velocity': (0.001 * ms, 0.0), 'variance': (1e-4, 9e-5)}  # fmt: skip
    for name, value in (given | values).items():
        rows[name] = value
    return stage.process(Block.of(ms * MS, rows))


@pytest.mark.parametrize('missing', ['force', 'position', 'velocity', 'variance'])
def test_a_sample_needs_all_of_one_stamp(missing):
    stage, rejected = stage_with()
    send(stage, 4)
    send(stage, 8, **{missing: math.nan})
    send(stage, 12)
    assert stage.samples == 2 and stage.used == [2]
    assert not rejected
    assert stage.tracks[0].slip.sd == pytest.approx(math.hypot(0.01, 0.002))


def test_an_infinite_variance_is_a_doubt():
    stage, _ = stage_with()
    send(stage, 4)
    (found,) = send(stage, 20, velocity=math.nan, variance=math.inf)
    assert doubt.kind(found.rows[0]['doubt'][0]) == 'motion unknown'
    assert found.rows[0]['slip_speed_sd'][0] == math.inf
    assert stage.samples == 2


@pytest.mark.parametrize(
    ('name', 'value', 'words'),
    [
        ('variance', (-1e-4, 2.0), r'variance = -0\.0001 m²/s²'),
        ('variance', (1e-4, -math.inf), 'variance = -inf m²/s²'),
        ('velocity', math.inf, 'velocity x = inf m/s'),
        ('force', (math.inf, math.nan, math.nan), 'force x = inf N'),
    ],
)
def test_a_variance_below_zero_and_infinite_numbers_are_refused(name, value, words):
    stage, rejected = stage_with()
    send(stage, 4, **{name: value})
    (error,) = rejected
    assert re.search(words, str(error)) and not stage.samples


def test_a_missing_velocity_becomes_a_fault():
    stage, _ = stage_with()
    for ms in range(4, 600, 4):
        send(stage, ms, velocity=math.nan)
        stage.tick(ms * MS)
    code = stage.estimate(600 * MS).rows[0]['doubt'][0]
    assert doubt.kind(code) == 'no contact velocity' and doubt.is_fault(code)
