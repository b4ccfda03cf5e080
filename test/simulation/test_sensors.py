# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.robot import FootState
from ros_pad.simulation.scene import SensorNoise
from ros_pad.simulation.sensors import Sensors

NOISE = SensorNoise(rate=250.0, force=0.03, position=1.5e-4)


class Statue:
    """A robot with two feet that never move."""

    def __init__(self):
        self.feet = [FootState(), FootState()]
        self.feet[0].force = (1.0, -2.0, 7.0)
        self.feet[1].position = (0.1, 0.2, 0.3)


def read(noise=NOISE, seed=0, count=5000):
    sensors, statue = Sensors(noise, 2, seed), Statue()
    return np.array([sensors.read(statue) for _ in range(count)])  # (sample, foot, what, axis)


def test_noise_is_white_and_as_wide_as_asked_for():
    samples = read()
    means, sds = samples.mean(axis=0), samples.std(axis=0)
    # Means are within 5 standard errors, standard deviations within 5 %.
    assert means[0, 0] == pytest.approx([1.0, -2.0, 7.0], abs=5 * 0.03 / 5000**0.5)
    assert means[1, 1] == pytest.approx([0.1, 0.2, 0.3], abs=5 * 1.5e-4 / 5000**0.5)
    assert sds[:, 0] == pytest.approx(np.full((2, 3), 0.03), rel=0.05)
    assert sds[:, 1] == pytest.approx(np.full((2, 3), 1.5e-4), rel=0.05)
    flat = (samples - means).reshape(len(samples), -1) / sds.reshape(-1)
    across = flat.T @ flat / len(flat)
    assert np.abs(across - np.eye(12)).max() < 0.08
    assert np.abs((flat[1:] * flat[:-1]).mean(axis=0)).max() < 0.08
    # Noise is drawn in blocks, and no block repeats.
    assert np.abs((flat[1000:] * flat[:-1000]).mean(axis=0)).max() < 0.08


def test_seeds():
    assert np.array_equal(read(seed=5, count=50), read(seed=5, count=50))
    assert not np.array_equal(read(seed=5, count=50), read(seed=6, count=50))


def test_without_noise_the_truth():
    samples = read(SensorNoise(250.0, 0.0, 0.0), count=3)
    assert (samples[:, 0, 0] == [1.0, -2.0, 7.0]).all()
    assert (samples[:, 1, 1] == [0.1, 0.2, 0.3]).all()


def test_readings_are_plain_floats():
    force, position = Sensors(NOISE, 2, 0).read(Statue())[0]
    assert all(type(value) is float for value in (*force, *position))


def test_moments_are_read_where_they_are_measured():
    statue = Statue()
    statue.feet[0].moment, statue.feet[1].moment = 0.03, -0.01
    assert Sensors(NOISE, 2, 0).read_moments(statue) == [None, None]
    noise = SensorNoise(rate=250.0, force=0.03, position=1.5e-4, moment=5e-4)
    sensors = Sensors(noise, 2, 0)
    moments = np.array([sensors.read_moments(statue) for _ in range(5000)])
    assert moments.mean(axis=0) == pytest.approx([0.03, -0.01], abs=5 * 5e-4 / 5000**0.5)
    assert moments.std(axis=0) == pytest.approx([5e-4, 5e-4], rel=0.05)


def test_a_moment_leaves_the_other_readings_as_they_are():
    """Reading moments must not change the noise of other readings."""
    noise = SensorNoise(rate=250.0, force=0.03, position=1.5e-4, moment=5e-4)
    sensors, statue = Sensors(noise, 2, 0), Statue()
    readings = []
    for _ in range(50):
        readings.append(sensors.read(statue))
        sensors.read_moments(statue)
    assert np.array_equal(np.array(readings), read(count=50))


FAULTS = {
    'force_dead': (Fault('force_dead', 0.1, 0.2), (0.0, 0.0, 0.0)),
    'force_frozen': (Fault('force_frozen', 0.1, 0.2), None),
    'force_offset': (Fault('force_offset', 0.1, 0.2, load=1.5), (1.0, -2.0, 8.5)),
    'force_range': (Fault('force_range', 0.1, 0.2, load=1.2), (1.0, -1.2, 1.2)),
}


@pytest.mark.parametrize('kind', FAULTS)
def test_faults_are_in_what_is_read_and_end(kind):
    fault, expected = FAULTS[kind]
    noise = SensorNoise(250.0, 1e-9, 1e-9)
    sensors, statue = Sensors(noise, 2, 0, [(fault,), ()]), Statue()
    before = []
    for number in range(100):
        statue.time = number / 250.0
        if number == 30:
            statue.feet[0].force = (1.1, -2.0, 7.0)  # the force changes while the sensor is frozen
        if fault.start <= statue.time < fault.end:
            held = before[0][0] if expected is None else expected
            if number >= 30 and expected and expected[0] == 1.0:
                held = (1.1, *expected[1:])
        else:
            held = statue.feet[0].force
        before = sensors.read(statue)
        assert before[0][0] == pytest.approx(held, abs=1e-8)
        assert before[0][1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)
        assert before[1][0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)


def test_a_frozen_marker_leaves_the_force():
    sensors = Sensors(NOISE, 2, 0, [(), (Fault('marker_frozen', 0.5),)])
    statue = Statue()
    read = []
    for number in range(250):
        statue.time = number / 250.0
        statue.feet[1].position = (0.01 * number, 0.0, 0.0)
        read.append(sensors.read(statue))
    positions = [place for _, (_, place) in read]
    assert len(set(positions)) == 125
    assert len({force for _, (force, _) in read}) == 250
    assert len({place for (_, place), _ in read}) == 250
