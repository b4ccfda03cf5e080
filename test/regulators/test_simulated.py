# SPDX-License-Identifier: Apache-2.0
import math
import random

import numpy as np
import pytest

from ros_pad.errors import ConfigError, InvalidInput, LimitError, TransportError
from ros_pad.regulators import Reading, Regulator, create
from ros_pad.simulation.pneumatics import PneumaticChannel


class Clock:
    def __init__(self, now=0.0):
        self.now = now

    def __call__(self):
        return self.now


def opened(now=0.0, **options):
    clock = Clock(now)
    regulator = create('simulated', clock=clock, **options)
    regulator.open()
    return regulator, clock


# --- the protocol ------------------------------------------------------------------------------


def test_it_reaches_its_setpoint_and_vents():
    regulator, clock = opened()
    assert isinstance(regulator, Regulator) and regulator.ceiling == 90e3
    regulator.set_pressure(75e3)
    assert regulator.read() == Reading(0.0, 75e3, (), 0.0)
    clock.now = 1.0
    assert regulator.read() == Reading(75e3, 75e3, (), 1.0)
    regulator.vent()
    assert regulator.read().setpoint == 0.0
    clock.now = 2.0
    assert regulator.read() == Reading(0.0, 0.0, (), 2.0)


@pytest.mark.parametrize('value', [math.nan, math.inf, -0.1, '75e3', True])
def test_setpoint_that_is_no_pressure(value):
    regulator, _ = opened()
    regulator.set_pressure(40e3)
    with pytest.raises(
        InvalidInput, match=r'set-point = .* is not allowed: a finite number .* at most 90000 Pa'
    ):
        regulator.set_pressure(value)
    assert regulator.read().setpoint == 40e3


def test_setpoint_above_the_ceiling_is_refused_not_clipped():
    regulator, clock = opened(ceiling=60e3)
    regulator.set_pressure(60e3)
    with pytest.raises(LimitError, match='above the ceiling of 60000 Pa gauge'):
        regulator.set_pressure(60e3 + 0.1)
    regulator.set_pressure(40e3)
    with pytest.raises(LimitError):
        regulator.set_pressure(75e3)
    clock.now = 2.0
    assert regulator.read() == Reading(40e3, 40e3, (), 2.0)


@pytest.mark.parametrize('call', ['read', 'vent', 'set_pressure'])
def test_closed_it_answers_nothing(call):
    regulator = create('simulated')
    arguments = (1e3,) if call == 'set_pressure' else ()
    with pytest.raises(TransportError, match='not open'):
        getattr(regulator, call)(*arguments)
    regulator.open()
    getattr(regulator, call)(*arguments)
    regulator.close()
    with pytest.raises(TransportError, match='not open'):
        getattr(regulator, call)(*arguments)


# --- time --------------------------------------------------------------------------------------


def test_a_clock_that_goes_back():
    regulator, clock = opened(10.0)
    regulator.set_pressure(75e3)
    clock.now = 10.0503
    before = regulator.read()
    for backwards in (10.0502, 9.0, math.nan):
        clock.now = backwards
        with pytest.raises(InvalidInput, match=r'clock went from 10\.0503 s'):
            regulator.read()
        with pytest.raises(InvalidInput, match='clock went'):
            regulator.set_pressure(20e3)
    clock.now = 10.0503
    assert regulator.read() == before


def test_a_dead_time_goes_on_when_it_is_opened_at_another_time():
    regulator, clock = opened(dead_time=0.1)
    regulator.set_pressure(75e3)
    clock.now = 0.05
    regulator.close()
    clock.now = 500.0
    regulator.open()
    clock.now = 500.04
    assert regulator.pad_pressure == 0.0
    clock.now = 501.0
    assert regulator.pad_pressure == 75e3


def test_a_day_without_a_reading_takes_few_steps(monkeypatch):
    steps = 0
    step = PneumaticChannel.step

    def counted(self, setpoint, duration):
        nonlocal steps
        steps += 1
        return step(self, setpoint, duration)

    monkeypatch.setattr(PneumaticChannel, 'step', counted)
    regulator, clock = opened()
    regulator.set_pressure(75e3)
    clock.now = 86400.0
    assert regulator.read().pressure == 75e3
    assert 0 < steps < 2000  # a day has 21.6 million internal steps


# --- sensor ------------------------------------------------------------------------------------


def test_noise_has_its_size_and_seed_and_leaves_the_pad_alone():
    noisy, clock = opened(sensor_noise=100.0, seed=7, sensor_resolution=1.0)
    again, again_clock = opened(sensor_noise=100.0, seed=7, sensor_resolution=1.0)
    other, other_clock = opened(sensor_noise=100.0, seed=8, sensor_resolution=1.0)
    series = {}
    for name, regulator, own in [
        ('noisy', noisy, clock),
        ('again', again, again_clock),
        ('other', other, other_clock),
    ]:
        regulator.set_pressure(50e3)
        series[name] = []
        for i in range(2000):
            own.now = 1.0 + i * 0.004
            series[name].append(regulator.read().pressure)
    assert series['noisy'] == series['again'] != series['other']
    assert np.mean(series['noisy']) == pytest.approx(50e3, abs=10.0)
    assert np.std(series['noisy']) == pytest.approx(100.0, rel=0.1)


# --- faults ------------------------------------------------------------------------------------


def test_a_silent_device_raises_like_one_that_does_not_answer():
    regulator, clock = opened(faults=['{kind: silence, start: 1.0, end: 2.0}'])
    regulator.set_pressure(75e3)
    clock.now = math.nextafter(1.0, 0.0)
    assert regulator.read().pressure == 75e3
    for now in (1.0, 1.5, math.nextafter(2.0, 0.0)):
        clock.now = now
        for call in (regulator.read, regulator.vent, lambda: regulator.set_pressure(40e3)):
            with pytest.raises(TransportError, match=r'does not answer .silence from 1 s to 2 s'):
                call()
        assert regulator.pad_pressure == 75e3
    regulator.close()
    with pytest.raises(TransportError, match='does not answer'):
        regulator.open()
    clock.now = 2.0
    regulator.open()
    assert regulator.read() == Reading(75e3, 75e3, (), 2.0)


def test_drifted_sensor_reads_the_setpoint_and_the_pad_is_off():
    drift = '{kind: sensor_drift, start: 1.0, end: 5.0, offset: -6.0e3, rise: 1.0}'
    regulator, clock = opened(faults=[drift])
    regulator.set_pressure(60e3)
    seen = {}
    for now in (0.5, 3.0, 5.0, 7.0):
        clock.now = now
        seen[now] = regulator.read().pressure, regulator.pad_pressure
    assert seen[0.5] == seen[7.0] == (60e3, 60e3)
    assert seen[3.0] == (60e3, 66e3)
    assert seen[5.0] == (66e3, 66e3)  # the drift has ended, but the pad has not moved yet


def test_no_command_and_a_drifted_sensor_can_pass_full_scale():
    """A pad whose sensor reads too little can exceed the ceiling, but never full scale."""
    regulator, clock = opened(faults=['{kind: sensor_drift, offset: -30.0e3}'])
    regulator.set_pressure(90e3)
    clock.now = 2.0
    assert regulator.pad_pressure == 100e3
    assert regulator.read().pressure == 70e3  # below the set-point, as the supply is the limit
    regulator.vent()
    clock.now = 4.0
    assert regulator.pad_pressure == 0.0


def test_with_faults_the_trajectory_does_not_depend_on_the_readings(start=0.3013):
    faults = [
        f'{{kind: leak, start: {start}, end: 0.7, conductance: 5.0e-9}}',
        f'{{kind: supply_loss, start: {start + 0.1}, end: {start + 0.35}, time_constant: 0.1}}',
        '{kind: sensor_drift, start: 0.2, offset: 2.0e3, rise: 0.4}',
    ]
    rng = random.Random(5)
    often = sorted([i / 50 for i in range(60)] + [rng.uniform(0.0, 1.2) for _ in range(300)])
    seen = []
    for times in ([i / 50 for i in range(60)], often):
        regulator, clock = opened(faults=faults, sensor_resolution=0.1)
        series = []
        for now in times:
            clock.now = now
            if now == 0.04:
                regulator.set_pressure(75e3)
            pressure = regulator.read().pressure, regulator.pad_pressure
            if now in {i / 50 for i in range(60)}:
                series.append(pressure)
        seen.append(series)
    assert seen[0] == seen[1]
    assert max(seen[0])[1] > 60e3 > min(seen[0][20:])[1]


def test_bad_faults_are_refused():
    with pytest.raises(ConfigError, match=r'fault .*kind = .fire. is not allowed'):
        create('simulated', faults=['{kind: fire}'])
    for bad in ('{kind: silence}', 3):
        with pytest.raises(ConfigError, match=r'faults = .* a list of faults is needed'):
            create('simulated', faults=bad)


# --- create ------------------------------------------------------------------------------------


def test_bad_options_are_named_with_what_is_allowed():
    for options, words in (
        ({'ceiling': 120e3}, r'ceiling = 120000\.0 is not allowed: .*1 to 100000 Pa'),
        ({'hose_lenght': 2.0}, r"'hose_lenght' \(= 2.0\).*ceiling.*'hose_length'"),
    ):
        with pytest.raises(ConfigError, match=words):
            create('simulated', **options)
    with pytest.raises(ConfigError, match=r"no regulator backend 'simulatd'.*'simulated'"):
        create('simulatd')
