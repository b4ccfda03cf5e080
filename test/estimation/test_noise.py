# SPDX-License-Identifier: Apache-2.0
"""Noise that the estimator measures while a foot stands, against the noise that was added."""

import math

import numpy as np
import pytest

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import FootEstimator, Tuning

FOOT = Foot.load('large37')
LOAD = 6.8  # N
TAU = 0.02  # s, smoothing of the slip speed
WHITE = 1.5e-4  # m


def white(samples, generator):
    return generator.normal(size=(samples, 2))


def first_order(samples, generator, period, time=TAU):
    """Return noise of deviation 1 with a correlation time, s."""
    share = math.exp(-period / time)
    values = generator.normal(size=(samples, 2))
    for now in range(1, samples):
        values[now] = share * values[now - 1] + math.sqrt(1.0 - share * share) * values[now]
    return values


def stood(marker, period=0.004, force_noise=0.03, slip=0.0, ratio=0.1, seed=1, **tuning):
    """Return the estimator of a foot on the floor whose marker has the given noise, m."""
    estimator = FootEstimator(FOOT, LOAD, Tuning(**tuning))
    pull = ratio * LOAD
    forces = np.random.default_rng(seed).normal(size=(len(marker), 3)) * force_noise
    for sample, ((x, y), (fx, fy, fz)) in enumerate(zip(marker, forces, strict=True), 1):
        position = (slip * sample * period + x, y, 0.0)
        estimator.update(sample * period, (fx - pull, fy, LOAD + fz), position, 0.0)
    return estimator


def smoothed(noise, period):
    """Return the white noise with the same deviation after a lag of 20 ms."""
    share, value, values = period / (TAU + period), np.zeros(2), []
    for each in noise:
        value = value + share * (each - value)
        values.append(value)
    return np.std(values[round(0.2 / period) :]) / math.sqrt(share / (2.0 - share))


@pytest.mark.parametrize('factor', [0.25, 4.0])
@pytest.mark.parametrize('period', [0.01, 0.004, 0.001])
def test_white_noise_is_found_whatever_was_configured(factor, period):
    marker = WHITE * white(round(4.0 / period), np.random.default_rng(2))
    estimator = stood(
        marker, period, position_noise=factor * WHITE, force_noise=0.03
    )  # fmt: skip
    assert estimator.noise.position.noise == pytest.approx(WHITE, rel=0.2)
    assert estimator.noise.force.noise == pytest.approx(0.03, rel=0.2)
    assert estimator.noise.position.configured == factor * WHITE


@pytest.mark.parametrize('time', [0.01, 0.02])
@pytest.mark.parametrize('period', [0.004, 0.001])
def test_noise_with_a_correlation_time_counts_by_its_effect_on_the_slip_speed(time, period):
    noise = WHITE * first_order(round(6.0 / period), np.random.default_rng(4), period, time)
    noise = stood(noise, period).noise.position, smoothed(noise, period)
    assert noise[0].white < 0.6 * WHITE  # from sample to sample, most of it is hidden
    assert 0.6 * noise[1] < noise[0].noise < 1.3 * noise[1]


@pytest.mark.parametrize('actual', [3e-4, 6e-4])
def test_after_half_a_second_two_and_four_times_the_noise_raise_no_alarm(actual):
    generator = np.random.default_rng(7)
    estimator = FootEstimator(FOOT, LOAD)  # 0.15 mm
    alarms = 0
    for sample in range(1, 8000):
        pull = 0.4 * LOAD * max(0.0, math.sin(2.0 * math.pi * (0.004 * sample - 1.0)))
        pull = pull if sample > 250 else 0.0
        fx, fy, fz = 0.03 * generator.normal(size=3)
        x, y, z = actual * generator.normal(size=3)
        estimate = estimator.update(
            0.004 * sample,
            (fx - pull, fy, LOAD + fz),
            (x + pull / FOOT.shear_stiffness, y, z),
            0.0,
        )
        alarms += estimate.slipping and sample > 125
    assert alarms == 0


def test_a_sensor_without_noise_is_not_measured():
    estimator = stood(np.zeros((500, 2)), force_noise=0.0, position_noise=0.0)
    assert estimator.noise.position.noise == 0.0
    assert estimator.noise.position.text('m') == 'not measured'
    assert 'configured 0.03 N' in estimator.noise.force.text('N')
