# SPDX-License-Identifier: Apache-2.0
import dataclasses
import types

import numpy as np
import pytest

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.robot import FootState, Proprioception
from ros_pad.simulation.scene import Scene, SensorNoise
from ros_pad.simulation.sensors import BodySensors, Sensors

NOISE = SensorNoise(rate=250.0, force=0.03, position=1.5e-4)
WITH_MOMENTS = dataclasses.replace(NOISE, moment=5e-4)


class Statue:
    """A robot with two feet that never move."""

    def __init__(self):
        self.feet = [FootState(), FootState()]
        self.feet[0].force = (1.0, -2.0, 7.0)
        self.feet[1].position = (0.1, 0.2, 0.3)

    @property
    def contacts(self):
        return np.array([(*foot.force, foot.moment, *foot.position) for foot in self.feet])


def both(rows):
    """Return force and position: (..., foot, what, axis)."""
    return np.stack([rows['force'], rows['position']], axis=-2)


def sensors_of_two(noise=NOISE, seed=0, faults=()):
    return Sensors(types.SimpleNamespace(sensors=noise, legs=(1, 2), faults=faults), seed)


def read(noise=NOISE, seed=0, count=5000):
    sensors, statue = sensors_of_two(noise, seed), Statue()
    return both(np.array([sensors.sample(statue) for _ in range(count)]))


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


def test_noise_repeats_with_its_seed():
    assert (read(seed=1, count=3) == read(seed=1, count=3)).all()
    assert (read(seed=1, count=3) != read(seed=2, count=3)).all()


def test_without_noise_the_truth():
    samples = read(SensorNoise(250.0, 0.0, 0.0), count=3)
    assert (samples[:, 0, 0] == [1.0, -2.0, 7.0]).all()
    assert (samples[:, 1, 1] == [0.1, 0.2, 0.3]).all()


def test_moments_are_read_where_they_are_measured():
    statue = Statue()
    statue.feet[0].moment, statue.feet[1].moment = 0.03, -0.01
    assert np.isnan(sensors_of_two().sample(statue)['moment']).all()
    sensors = sensors_of_two(WITH_MOMENTS)
    moments = np.array([sensors.sample(statue)['moment'] for _ in range(5000)])
    assert moments.mean(axis=0) == pytest.approx([0.03, -0.01], abs=5 * 5e-4 / 5000**0.5)
    assert moments.std(axis=0) == pytest.approx([5e-4, 5e-4], rel=0.05)


@pytest.mark.parametrize('kind', ['force_dead', 'force_frozen'])
def test_a_dead_or_frozen_sensor_has_no_moment_of_its_own(kind):
    for noise, measured in ((WITH_MOMENTS, True), (NOISE, False)):
        sensors, statue = sensors_of_two(noise, faults=[Fault(kind, 0.5, legs=(1,))]), Statue()
        moments = []
        for statue.time in (0.0, 0.5, 1.0):
            moments.append(sensors.sample(statue)['moment'].tolist())
        first, other = zip(*moments, strict=True)
        if measured:
            assert first[1] == first[2] == (0.0 if kind == 'force_dead' else first[0])
            assert len(set(other)) == 3
        else:
            assert np.isnan(moments).all()


FAULTS = {
    'force_dead': (Fault('force_dead', 0.1, 0.2, (1,)), (0.0, 0.0, 0.0)),
    'force_frozen': (Fault('force_frozen', 0.1, 0.2, (1,)), None),
    'force_offset': (Fault('force_offset', 0.1, 0.2, (1,), load=1.5), (1.0, -2.0, 8.5)),
    'force_range': (Fault('force_range', 0.1, 0.2, (1,), load=1.2), (1.0, -1.2, 1.2)),
}


@pytest.mark.parametrize('kind', FAULTS)
def test_faults_are_in_what_is_read_and_end(kind):
    fault, expected = FAULTS[kind]
    noise = SensorNoise(250.0, 1e-9, 1e-9)
    sensors, statue = sensors_of_two(noise, faults=[fault]), Statue()
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
        before = both(sensors.sample(statue))
        assert before[0][0] == pytest.approx(held, abs=1e-8)
        assert before[0][1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)
        assert before[1][0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)


# --- IMU and joints ---------------------------------------------------------------------------

SCENE = Scene.load('hexapod_patches')
TRUTH = Proprioception(
    (0.1, -0.2, 0.3),
    (0.5, -0.5, 9.81),
    [0.01 * joint for joint in range(18)],
    [0.1 * joint for joint in range(18)],
    [0.02 * joint for joint in range(18)],
    [(1.0, -2.0, 7.0 + leg) for leg in range(6)],
)
LOUD = SensorNoise(
    250.0, 0.03, 1.5e-4, gyro=0.004, accelerometer=0.06, gyro_bias=0.02, accelerometer_bias=0.1,
    encoder=6e-4, joint_velocity=0.04, effort=0.03,
)  # fmt: skip


def body_readings(seed=0, count=3000, noise=LOUD, faults=()):
    scene = dataclasses.replace(SCENE, sensors=noise, faults=tuple(faults))
    sensors = BodySensors(scene, seed, 18)
    return [sensors.read(TRUTH, 0.004 * index) for index in range(count)]


def test_imu_and_joints_have_the_noise_and_bias_that_are_asked_for():
    readings = body_readings()
    imu = np.array([each.imu for each in readings])
    joints = np.array([each.joints for each in readings])
    forces = np.array([each.rows['force'] for each in readings])
    assert imu.std(axis=0) == pytest.approx(np.array([[0.004] * 3, [0.06] * 3]), rel=0.07)
    biases = imu.mean(axis=0) - [TRUTH.gyro, TRUTH.accelerometer]
    # Means are within 5 standard errors of 0.004 and 0.06.
    assert np.linalg.norm(biases, axis=1) == pytest.approx([0.02, 0.1], rel=0.06)
    deviations = np.repeat([[6e-4], [0.04], [0.03]], 18, axis=1)
    assert joints.std(axis=0) == pytest.approx(deviations, rel=0.08)
    truth = [TRUTH.positions, TRUTH.velocities, TRUTH.efforts]
    assert (np.abs(joints.mean(axis=0) - truth) < 5 * deviations / 3000**0.5).all()
    assert forces.std(axis=0) == pytest.approx(np.full((6, 3), 0.03), rel=0.08)
    assert forces.mean(axis=0) == pytest.approx(np.array(TRUTH.forces), abs=5 * 0.03 / 3000**0.5)


def bits(readings):
    return [tuple(part.tobytes() for part in each) for each in readings]


def test_body_sensors_repeat_with_their_seed():
    one, same, other = (bits(body_readings(seed, 20)) for seed in (3, 3, 4))
    assert one == same
    assert one != other
    biases = [
        np.mean([each.imu[0] for each in body_readings(seed, 200)], axis=0) - TRUTH.gyro
        for seed in (3, 4)
    ]
    assert np.linalg.norm(biases[0] - biases[1]) > 0.002  # directions differ


def test_silent_imu_and_joints_and_dead_forces():
    faults = (
        Fault('imu_silent', 0.02, 0.06),
        Fault('joints_silent', 0.04, 0.08),
        Fault('force_dead', 0.02, legs=(2,)),
        Fault('force_frozen', 0.02, legs=(3,)),
    )
    readings = body_readings(count=30, faults=faults)
    for index, reading in enumerate(readings):
        time = 0.004 * index
        assert (np.isnan(reading.imu) == (0.02 <= time < 0.06)).all()
        assert (np.isnan(reading.joints) == (0.04 <= time < 0.08)).all()
        force = reading.rows['force']
        assert force[1].any() != (time >= 0.02)
        if time >= 0.02:
            assert force[2].tolist() == readings[4].rows['force'][2].tolist()
    # A gap changes nothing of what comes later.
    assert [imu for imu, *_ in bits(readings[20:])] == [
        imu for imu, *_ in bits(body_readings(count=30)[20:])
    ]
