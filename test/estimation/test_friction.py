# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ros_pad.contact.resistance import ExpectedFriction, Foot, expected_friction
from ros_pad.estimation.friction import GRID, Evidence, GroundFilter, GroundModel
from ros_pad.estimation.scales import EDGES, FrictionScales

PRIOR = ExpectedFriction(flat_dry=0.8, flat_wet=0.12, dome=0.41, landed=0.32)
STILL = 0.0  # m/s
DT = 0.04
EXACT = 1e-5  # a model error too small to have an effect on any cell of the grid


@pytest.fixture
def exact(monkeypatch):
    """Switch the model error off, so that posteriors follow from Bayes' rule alone."""
    monkeypatch.setattr('ros_pad.estimation.friction.MODEL_ERROR', EXACT)


def flat(**options):
    ground = GroundFilter(GroundModel(FrictionScales(PRIOR), **options))
    ground.touch_down(0.0, dome=False)
    return ground


def stick(ground, ratio, count=1, noise=0.03):
    for _ in range(count):
        ground.update(Evidence(ratio, noise, STILL, 0.003, DT))
    return ground


def slip(ground, ratio, count=5, speed=0.1):
    for _ in range(count):
        ground.update(Evidence(ratio, 0.03, speed, 0.003, DT))
    return ground


def test_the_prior_is_the_contact_model_of_the_foot():
    """Friction is that of the foot's file: 0.8 flat and 0.41 domed if dry, 0.12 flat if wet."""
    prior = expected_friction(Foot.load('large19'), 2.0)
    assert prior.flat_dry == pytest.approx(0.8, abs=0.005)
    assert prior.flat_wet == pytest.approx(0.12, abs=1e-6)
    assert prior.dome == pytest.approx(0.41, abs=0.01)


@pytest.mark.parametrize('ratio', [0.1, 0.3, 0.6])
def test_stick_excludes_friction_below_and_nothing_else(ratio, exact):
    """The posterior is the prior times Φ((μ - ρ)/σ), normalised; here with SciPy's Φ."""
    ground = stick(flat(wet_prior=0.4), ratio, noise=0.02)
    dry, wet, *_ = FrictionScales(PRIOR).expected(0.0).rows
    cut = stats.norm.cdf(GRID, ratio, 0.02)
    on_dry, on_wet = 0.6 * dry * cut, 0.4 * wet * cut
    total = on_dry.sum() + on_wet.sum()
    marginal = (on_dry + on_wet) / total
    assert ground.wet_probability == pytest.approx(on_wet.sum() / total, abs=1e-4)
    mean = marginal @ GRID
    assert ground.friction == pytest.approx(
        (mean, math.sqrt(marginal @ (GRID - mean) ** 2)), abs=1e-4
    )
    for share in (0.01, 0.05, 0.5, 0.95):
        cell = np.searchsorted(np.cumsum(marginal), share)
        assert EDGES[cell] <= ground.quantile(share) <= EDGES[cell + 1]


@pytest.mark.parametrize('ratio', [0.12, 0.9])
def test_slip_pulls_friction_to_the_ratio(ratio):
    mean, sd = slip(flat(), ratio).friction
    assert mean == pytest.approx(ratio, abs=0.03)
    # Fast slips show small friction best: slow ones, of feet that hold, may be turning.
    assert sd < math.hypot(0.06, 0.12 * ratio**2)


stream = st.lists(
    st.tuples(
        st.floats(0.0, 3.0),  # ratio
        st.floats(1e-3, 0.5),  # its noise
        st.floats(-1.0, 1.0),  # speed
        st.floats(1e-3, 0.1),  # its noise
        st.floats(1e-3, 1.0),  # duration
        st.booleans(),  # touch down first
        st.booleans(),  # with the other morphology
        st.floats(0.0, 5.0),  # distance to it
    ),
    min_size=1,
    max_size=30,
)


@settings(max_examples=60, deadline=None)
@given(stream)
def test_beliefs_stay_probabilities(samples):
    ground = flat()
    dome = False
    for ratio, ratio_noise, speed, speed_noise, dt, new, other, distance in samples:
        if new:
            dome ^= other
            ground.touch_down(distance, dome)
        ground.update(Evidence(ratio, ratio_noise, speed, speed_noise, dt))
        assert 0.0 < ground.wet_probability < 1.0
        mean, sd = ground.friction
        assert 0.0 <= sd <= 1.3
        assert GRID[0] - 1e-9 <= mean <= GRID[-1] + 1e-9
        quantiles = [ground.quantile(share) for share in (0.0, 0.05, 0.5, 0.95, 1.0)]
        assert quantiles == sorted(quantiles)
        assert quantiles[0] >= EDGES[0] - 1e-9 and quantiles[-1] <= EDGES[-1] + 1e-9
        # The posterior adds up to 1.
        assert ground.posterior.sum() == pytest.approx(1.0, abs=1e-9)
        assert ground.posterior.min() >= 0.0


def test_a_dome_only_fades_with_the_way_it_steps_and_slides():
    ground = slip(flat(wet_prior=0.3, patch_length=1.5), 0.12)
    before = ground.wet_probability
    ground.touch_down(0.16, dome=True)
    slip(ground, 0.41, 10, speed=0.05)  # slides 20 mm
    faded = 0.3 + (before - 0.3) * math.exp(-(0.16 + 10 * 0.05 * DT) / 1.5)
    assert ground.wet_probability == pytest.approx(faded, abs=1e-9)


def test_no_number_of_samples_averages_the_model_error_out(exact, monkeypatch):
    """The model error adds its variance; the 5 % quantile is 1.64 deviations below the mean."""
    exact = slip(flat(), 0.5, 200).friction
    monkeypatch.setattr('ros_pad.estimation.friction.MODEL_ERROR', 0.06)
    ground = slip(flat(), 0.5, 200)
    mean, sd = ground.friction
    assert mean == pytest.approx(exact[0], abs=2e-3)
    assert sd == pytest.approx(math.hypot(exact[1], 0.06), rel=0.02)
    assert ground.quantile(0.05) == pytest.approx(mean - 1.64 * sd, abs=0.02)


@pytest.mark.parametrize('rim_speed', [0.02, 0.05])
def test_a_foot_that_turns_shows_no_more_than_a_part_of_its_friction(rim_speed):
    """At slip speed v and rim speed s, T/N is μ v/hypot(v, s) (Howe, Cutkosky); s is random."""
    straight, turning = (slip(flat(rim_speed=s), 0.2, 1, 0.02) for s in (0.0, rim_speed))
    table = FrictionScales(PRIOR).expected(0.0).rows[:2]
    draws = rim_speed * np.random.default_rng(0).chisquare(1, 20_000) / stats.chi2.median(1)
    shown = 0.02 / np.hypot(0.02, draws)
    likelihood = [np.exp(-0.5 * ((mu * shown - 0.2) / 0.03) ** 2).mean() for mu in GRID]
    # 20 mm/s is many times the noise: slip, or creep.
    slipping = 0.5 * math.exp(-0.5) / 0.04 * np.exp(-GRID / 0.3)
    slipping *= np.array(likelihood) / (math.sqrt(2.0 * math.pi) * 0.03)
    mean = 0.025 * (0.2 + 0.04)
    creeping = 0.01 * math.exp(-0.02 / mean) / mean * math.exp(-0.2 / 0.3) / 0.3
    creeping *= stats.norm.cdf(GRID, 0.2, 0.03)
    slipped = (slipping + creeping) * table
    wet = slipped[1].sum() / slipped.sum()
    assert turning.wet_probability == pytest.approx(wet, abs=0.05)
    assert turning.friction[0] > straight.friction[0] + 0.05
    # In a fast slip turning hardly matters.
    fast = slip(flat(rim_speed=rim_speed), 0.12, 5, 0.5)
    assert fast.friction[0] == pytest.approx(0.12, abs=0.03)


@pytest.mark.parametrize('dome', [False, True])
def test_a_thousand_touch_downs_without_a_word_leave_a_belief(dome):
    ground = slip(flat(), 0.12)
    for _ in range(1000):
        ground.touch_down(1e-3, dome)
    assert 0.6 < ground.wet_probability < 0.8  # 1 m on; the patch length is 1.5 m
    assert 0.0 < ground.friction[0] < 1.6
