# SPDX-License-Identifier: Apache-2.0
"""Readings that contradict each other, made up: what is named, and what is not."""

import numpy as np
import pytest

from ros_pad.robots import Robot
from ros_pad.sensing.plausibility import Delay, Legs, Unloaded

PERIOD = 0.004
ARMS = np.array([[0.2, 0.15, -0.3], [0.2, -0.15, -0.3], [-0.2, 0.15, -0.3], [-0.2, -0.15, -0.3]])
STAND = np.ones(4, dtype=bool)


def swayed(lag, slip=0.0, seconds=12.0, seed=4):
    """Return a Delay after a body has swayed on four feet, its joints later by ``lag``, s.

    ``slip`` is the time, s, whose angular acceleration turns into slip in x and y.
    """
    found, generator = Delay(1e-3), np.random.default_rng(seed)
    phases = generator.uniform(0.0, 6.28, 3)

    def rate(time):
        return 0.3 * np.sin(2.0 * np.pi * np.array((1.7, 1.1, 0.9)) * time + phases)

    for row in range(round(seconds / PERIOD)):
        time = row * PERIOD
        true = rate(time)
        speeds = np.cross(true, ARMS) - np.cross(rate(time - lag), ARMS)
        acceleration = (true - rate(time - PERIOD)) / PERIOD
        speeds[:, :2] += slip * np.cross(acceleration, ARMS)[:, :2]
        measured = true + 1e-3 * generator.standard_normal(3)
        found.update(time, measured, ARMS, speeds, STAND)
    return found


@pytest.mark.parametrize('lag', [0.006, -0.005])
def test_a_delay_shows_in_all_directions(lag):
    found = swayed(lag)
    assert found.value == pytest.approx(lag, abs=1e-3)
    assert found.deviation < 1e-3
    assert found.doubt() == (
        'delay: joints are 6 ms later than the IMU'
        if lag > 0.0
        else 'delay: joints are 5 ms earlier than the IMU'
    )


@pytest.mark.parametrize('slip', [0.006, -0.006])
def test_slip_in_step_with_the_body_is_no_delay(slip):
    found = swayed(0.0, slip)
    assert found.doubt() == ''
    assert found.deviation > 2.5e-3  # as the two directions do not agree
    assert abs(found.value) < 2.0 * found.deviation


def walked(shares, seconds=20.0):
    """Return the Legs of a robot whose feet slip for shares of their stances, at their speed."""
    robot = Robot.load('ch3r')
    legs = Legs(robot)
    count = len(robot.legs)
    for row in range(round(seconds / PERIOD)):
        slipping = (row * 0.618) % 1.0 < np.array(shares)
        legs.update(
            PERIOD, np.ones(count, dtype=bool), slipping, np.full(count, 0.15), np.full(count, 0.2)
        )
    return legs


def test_a_leg_that_slips_alone_is_named():
    legs = walked([1.0, 0.2, 0.2, 0.2, 0.2, 0.2])
    assert 'leg 1 moves against the other legs' in legs.doubt()
    assert legs.against.tolist() == [True, False, False, False, False, False]


def swung(offset, lasts=0.05, seconds=6.0, seed=4):
    """Return the Unloaded of four feet, the last one off by ``offset``, N, and its errors.

    All stand and swing for 0.3 s in turns; loads last while the feet rise, as a share of that.
    """
    unloaded, generator = Unloaded(('a', 'b', 'c', 'd'), 80.0), np.random.default_rng(seed)
    errors = []
    for row in range(round(seconds / PERIOD)):
        step = (row * PERIOD / 0.3) % 2.0
        climbing = 0.6 * np.cos(np.pi * (step - 1.0)) if step > 1.0 else 0.0
        forces = 0.3 * generator.standard_normal((4, 3))
        forces[:, 2] += (40.0 + 40.0 * np.sin(37.0 * row)) * (step < 1.0 + lasts)
        given = forces.copy()
        given[3] += offset
        errors.append(unloaded.update(row * PERIOD, given, np.full(4, climbing))[3] - forces[3])
    return unloaded, np.array(errors)


@pytest.mark.parametrize('offset', [(0.0, 0.0, 8.0), (6.0, -5.0, 0.0), (0.0, 3.0, -30.0)])
def test_what_a_force_sensor_shows_in_the_air_is_taken_off(offset):
    unloaded, errors = swung(offset)
    assert np.abs(errors[500:]).max() < 0.5
    assert not unloaded.offset[:3].any()
    assert unloaded.doubt() == ''


def test_an_offset_of_more_than_half_of_the_load_is_named():
    unloaded, _ = swung((0.0, 0.0, 50.0))
    assert unloaded.doubt() == 'force: foot d shows more than half of the expected load in the air'
    assert not unloaded.offset.any()
