# SPDX-License-Identifier: Apache-2.0
"""The study limit_surface: sums over pressure against closed forms, and the ellipsoid's errors."""

import math

import numpy as np
import pytest

from ros_pad.contact.resistance import DISC_TURNING_RADIUS
from studies.work_precision import limit_surface

SLIDE, TURN, ABOUT_RIM = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 1.0, 1.0]])


def unit(pressure='even'):
    return limit_surface.Patch(*limit_surface.disc(1.0, 80, pressure), 1.0, DISC_TURNING_RADIUS)


@pytest.fixture(scope='module')
def disc():
    return unit()


@pytest.mark.parametrize(
    ('pressure', 'expected'),
    # Mean distance from the middle: ∫ p r dA / ∫ p dA.
    [('even', 2.0 / 3.0), ('hertz', 3.0 * math.pi / 16.0)],
)
def test_turning_radius_is_that_of_the_pressure(pressure, expected):
    assert unit(pressure).own_turning == pytest.approx(expected, rel=1e-5)


def test_disc_that_turns_about_its_rim(disc):
    """In polar coordinates about the rim r <= 2 cos t: F = 8/(3 π), M about the middle 8/(9 π)."""
    found = limit_surface.summed(disc.points, disc.shares)(np.array([ABOUT_RIM]))[0]
    assert found == pytest.approx([0.0, 8.0 / (3.0 * math.pi), 8.0 / (9.0 * math.pi)], abs=1e-4)


def test_ellipsoid_is_too_large_and_turns_force_into_moment(disc):
    """About the rim, by the closed forms, 5.1 % in size and 13 % in force and moment of a motion.

    The largest errors over all motions are at least these.
    """
    truth = limit_surface.summed(disc.points, disc.shares)(limit_surface.twists(disc))
    found = limit_surface.errors(disc, limit_surface.ellipsoid(disc.turning), truth)
    size = 8.0 / (3.0 * math.pi) * math.hypot(1.0, 0.5) - 1.0
    assert -0.07 < found['inside'] < size + 1e-3
    # Within the largest force and moment, which are exact, it never holds less than the disc.
    assert found['outside'] < 1e-4
    slip = np.array([1.0, 2.0 / 3.0]) / math.hypot(1.0, 2.0 / 3.0)
    apart = math.hypot(slip[0] - 8.0 / (3.0 * math.pi), slip[1] - 4.0 / (3.0 * math.pi))
    assert apart - 1e-3 < found['motion'] < 0.16
