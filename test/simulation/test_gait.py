# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy.integrate import quad

from ros_pad.simulation.gait import WalkingGait

MIDDLES = (0.25, 0.75, 0.25, 0.75, 0.25, 0.75)
GAIT = WalkingGait(1.2, 0.16, 0.6, 0.03, MIDDLES, pushes=True)
LEGS = range(6)
TRIPODS = ((0, 2, 4), (1, 3, 5))
DUTIES = (0.51, 0.6, 0.75, 0.9)


def body_speed(time):
    """Return the speed of the body, m/s: a raised cosine for a cycle of 1.2 s and 0.16 m."""
    return 0.16 / 1.2 * (1.0 - math.cos(4.0 * math.pi * time / 1.2))


def gait_of(duty):
    return WalkingGait(1.2, 0.16, duty, 0.03, MIDDLES, pushes=True)


@pytest.mark.parametrize('time', [0.05, 0.3, 1.0, 1.2, 7.7])
def test_advance_is_the_integral_of_speed(time):
    expected, _ = quad(body_speed, 0.0, time, limit=200)
    assert GAIT.body_advance(time) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize('duty', DUTIES)
def test_stance_is_centred_on_the_push(duty):
    gait = gait_of(duty)
    times = np.linspace(0.0, 1.2, 24001)[:-1]
    pushes = {leg: 0.25 * 1.2 if leg in TRIPODS[0] else 0.75 * 1.2 for leg in LEGS}
    for leg in LEGS:
        standing = np.array([gait.phase(leg, time) < duty for time in times])
        assert standing.mean() == pytest.approx(duty, abs=2e-4)
        away = (times[standing] - pushes[leg] + 0.6) % 1.2 - 0.6
        assert away.mean() == pytest.approx(0.0, abs=1e-3)
        assert np.abs(away).max() == pytest.approx(0.5 * duty * 1.2, abs=1e-3)


@pytest.mark.parametrize('duty', DUTIES)
def test_foot_reaches_as_far_ahead_as_it_is_left_behind(duty):
    gait = gait_of(duty)
    half = 0.5 * duty * 1.2
    for middle in (0.3, 0.9):  # of the stances of both tripods
        under, _ = quad(body_speed, middle - half, middle + half)
        assert gait.reach() == pytest.approx(0.5 * under, abs=1e-9)


def test_swing():
    start, middle, end = (GAIT.swing(phase) for phase in (0.6, 0.8, 1.0))
    assert start == pytest.approx((0.0, 0.0), abs=1e-12)
    assert middle == pytest.approx((0.5, 0.03))
    assert end == pytest.approx((1.0, 0.0), abs=1e-12)
    # The foot leaves and meets the floor without speed, so that it does not scuff.
    for phase in (0.6, 1.0):
        one, other = GAIT.swing(phase), GAIT.swing(phase + math.copysign(1e-5, 0.8 - phase))
        assert one == pytest.approx(other, abs=1e-8)
