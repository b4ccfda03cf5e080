# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from ros_pad import configuration
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation import Hose, PneumaticChannel, RegulatorModel, Scene
from ros_pad.simulation.faults import FOOT_KINDS, KINDS, Fault, faults_of, parsed

AMBIENT = 101325.0
HOSE = Hose(0.002, 1.0)
LEAK = Fault('leak', conductance=1e-9)


def channel_with(*faults, hose=HOSE, volume=5e-6, **regulator):
    options = {'dead_time': 0.0, 'dead_band': 0.0, 'quantum': 0.0, 'damping': 1.0} | regulator
    return PneumaticChannel(RegulatorModel(**options), hose, volume, faults=faults)


def walk(channel, setpoint, duration, dt=0.004):
    return np.array([channel.step(setpoint, dt) for _ in range(round(duration / dt))])


# --- leak -------------------------------------------------------------------------------------


def orifice(c, b, upstream, downstream):
    """Return the flow of reference air by ISO 6358, m³/s, times 100 kPa."""
    ratio = downstream / upstream
    if ratio <= b:
        return c * upstream * 1e5
    return c * upstream * math.sqrt(1.0 - ((ratio - b) / (1.0 - b)) ** 2) * 1e5


@pytest.mark.parametrize('setpoint', [5e3, 75e3])
@pytest.mark.parametrize('conductance', [1e-10, 1e-8])
def test_leak_takes_what_line_and_hole_agree_on(setpoint, conductance):
    channel = channel_with(Fault('leak', conductance=conductance))
    pad = walk(channel, setpoint, 3.0)[-1]

    def balance(pad):
        line = orifice(HOSE.sonic_conductance, HOSE.critical_ratio, setpoint + AMBIENT, pad)
        creeping = math.pi * 0.002**4 / (256.0 * 1.82e-5) * ((setpoint + AMBIENT) ** 2 - pad**2)
        return min(line, creeping) - orifice(conductance, 0.5, pad, AMBIENT)

    expected = brentq(balance, AMBIENT, setpoint + AMBIENT) - AMBIENT
    assert pad == pytest.approx(expected, abs=1.0)
    assert 0.0 < pad < setpoint
    assert channel.outlet == pytest.approx(setpoint, abs=0.1)


# --- stuck valve ------------------------------------------------------------------------------


def test_stuck_valve_holds_its_outlet_whatever_is_asked():
    channel = channel_with(Fault('stuck_valve', start=1.0, end=2.0))
    channel.step(60e3, 1.0)
    for setpoint in (0.0, 90e3, 30e3):
        assert np.ptp(walk(channel, setpoint, 0.3)) < 0.2
        assert channel.pad_pressure == pytest.approx(60e3, abs=0.2)
    channel.step(30e3, 0.1)
    assert channel.pad_pressure == pytest.approx(60e3, abs=0.2)
    assert channel.step(30e3, 0.5) == 30e3


# --- supply -----------------------------------------------------------------------------------


@pytest.mark.parametrize('remaining', [0.0, 30e3])
def test_all_feet_of_a_supply_sag_together(remaining):
    loss = Fault('supply_loss', start=2.0, end=6.0, pressure=remaining, time_constant=0.5)
    setpoints = (40e3, 75e3, 90e3)
    channels = [channel_with(loss) for _ in setpoints]
    for channel, setpoint in zip(channels, setpoints, strict=True):
        channel.step(setpoint, 2.0)
    for elapsed in np.arange(1, 40) * 0.1:
        supply = remaining + (100e3 - remaining) * math.exp(-elapsed / 0.5)
        for channel, setpoint in zip(channels, setpoints, strict=True):
            channel.step(setpoint, 0.1)
            assert channel.outlet <= supply + 1e-6
            # Behind the hose the pad lags by some tens of milliseconds.
            late = remaining + (100e3 - remaining) * math.exp(-(elapsed - 0.05) / 0.5)
            assert min(supply, setpoint) - 1.0 < channel.pad_pressure < min(late, setpoint) + 1.0
    for channel, setpoint in zip(channels, setpoints, strict=True):
        assert channel.step(setpoint, 1.5) == setpoint


# --- drift ------------------------------------------------------------------------------------


@pytest.mark.parametrize('offset', [-8e3, -500.0, 3e3])
def test_drift_moves_the_pad_the_other_way(offset):
    channel = channel_with(Fault('sensor_drift', start=1.0, end=9.0, offset=offset, rise=4.0))
    channel.step(60e3, 1.0)
    for elapsed in (1.0, 2.0, 3.0, 4.0):
        channel.step(60e3, 1.0)
        # A critically damped loop lags 2/ω behind a ramp; the hose adds a little.
        behind = 2.0 / 45.0 * abs(offset) / 4.0
        expected = 60e3 - offset * elapsed / 4.0
        assert channel.pad_pressure == pytest.approx(expected, abs=1.3 * behind)
    channel.step(60e3, 2.0)
    assert channel.pad_pressure == pytest.approx(60e3 - offset, abs=0.1)
    channel.step(60e3, 4.0)
    assert channel.pad_pressure == 60e3


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.builds(
                Fault,
                st.just('sensor_drift'),
                st.floats(0.0, 1.0),
                offset=st.floats(-20e3, 20e3),
                rise=st.floats(0.0, 1.0),
            ),
            st.builds(
                Fault, st.just('leak'), st.floats(0.0, 1.0), conductance=st.floats(1e-13, 1e-7)
            ),
            st.builds(Fault, st.just('stuck_valve'), st.floats(0.0, 0.5), st.floats(0.6, 1.0)),
            st.builds(
                Fault, st.just('supply_loss'), st.floats(0.0, 1.0), pressure=st.floats(0, 1e5)
            ),
            st.builds(Fault, st.just('silence'), st.floats(0.0, 1.0)),
        ),
        max_size=4,
    ),
    st.sampled_from([0.001, 0.004, 0.0173]),
)
def test_no_fault_but_drift_takes_a_pad_above_its_setpoint(faults, dt):
    """Drift raises a pad by at most its offset, and never above full scale."""
    channel = channel_with(*faults)
    low = sum(min(0.0, fault.offset) for fault in faults if fault.kind == 'sensor_drift')
    for setpoint in (40e3, 85e3, 60e3, 85e3):
        pad = walk(channel, setpoint, 0.3, dt)
        assert pad.min() >= 0.0
        assert pad.max() <= min(100e3, 85e3 - low) + 1e-6
        assert np.isfinite(pad).all()


# --- schedule ---------------------------------------------------------------------------------


def test_faults_start_and_end_between_steps():
    """For any step a fault acts exactly from its start to its end."""
    fault = Fault('stuck_valve', start=0.0533, end=0.1017)
    ends = []
    for dt in (0.001, 0.004, 0.0173, 0.05):
        channel = channel_with(fault)
        for _ in range(round(0.5191 / dt)):
            channel.step(75e3, dt)
            if 0.0533 < channel.time < 0.1017:
                # Closed form of critical damping at the start of the fault.
                held = 75e3 * (1.0 - (1.0 + 45.0 * 0.0533) * math.exp(-45.0 * 0.0533))
                assert channel.outlet == pytest.approx(held, abs=0.5)
        # After the fault the outlet starts from rest with the same response.
        free = channel.time - 0.1017
        left = (75e3 - held) * (1.0 + 45.0 * free) * math.exp(-45.0 * free)
        ends.append(channel.outlet - (75e3 - left))
    assert ends == pytest.approx([0.0] * 4, abs=0.5)


def test_a_fault_hours_ahead_costs_nothing_and_is_not_missed():
    channel = channel_with(Fault('supply_loss', start=7200.0, end=7201.0, time_constant=0.1))
    assert channel.step(75e3, 7199.0) == 75e3
    assert channel.settled
    assert channel.step(75e3, 1.0) == 75e3
    assert channel.step(75e3, 0.5) < 75e3
    assert channel.step(75e3, 7200.0) == 75e3
    assert channel.time == pytest.approx(14400.5)


def test_regulators_and_sensors_get_their_own():
    leak, dead = LEAK, Fault('force_dead', legs=(2,))
    assert faults_of(2, (leak, dead)) == (leak,)
    assert faults_of(2, (leak, dead), FOOT_KINDS) == (dead,)
    assert faults_of(3, (leak, dead), FOOT_KINDS) == ()
    with pytest.raises(InvalidInput, match="kind = 'force_dead' is not allowed"):
        parsed([str(leak), str(dead)])


# --- text -------------------------------------------------------------------------------------

EXAMPLES = [
    Fault('stuck_valve', 1.0, 2.5, (1, 6)),
    Fault('supply_loss', 0.1, pressure=20e3, time_constant=0.0),
    Fault('leak', legs=(3,), conductance=1.234567890123e-11),
    Fault('sensor_drift', 3.0, 4.0, offset=-2e3, rise=1.0 / 3.0),
    Fault('silence', 1e-3),
    Fault('force_dead', 0.5),
    Fault('force_frozen', 0.5, legs=(4,)),
    Fault('force_offset', 0.5, load=-2.5),
    Fault('force_range', load=5.0),
    Fault('marker_frozen', 2.0, 3.0),
    Fault('imu_silent', 2.0, 3.0),
    Fault('joints_silent', 2.0),
]


def test_text_and_back():
    assert {fault.kind for fault in EXAMPLES} == set(KINDS)
    for fault in EXAMPLES:
        assert Fault.parse(str(fault)) == fault


BAD = [
    ('{kind: fire}', "kind = 'fire' is not allowed: one of stuck_valve, supply_loss, leak"),
    ('{kind: leak}', "key 'conductance' is missing"),
    ('{kind: leak, conductance: 1.0}', 'a number from 1e-14 to 1e-06 m³/(s Pa) is needed'),
    ('{kind: silence, start: -1}', 'start = -1.0 is not allowed: a number from 0 to 1000000000 s'),
    ('{kind: silence, start: 2, end: 2}', 'end = 2.0 is not allowed: a number above 2'),
    ('{kind: silence, legs: [9]}', 'legs = [9] is not allowed: a list of different whole'),
    ('{kind: silence, offset: 1.0}', "unknown key 'offset'"),
    ('{kind: sensor_drift, offset: 2e5}', 'a number from -100000 to 100000 Pa is needed'),
    ('{kind: supply_loss, pressure: -1}', 'pressure = -1 is not allowed: a number from 0 to'),
    ('silence', "expected a table of keys, found 'silence'"),
]


@pytest.mark.parametrize('text, message', BAD)
def test_bad_texts(text, message):
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        Fault.parse(text)
    assert str(caught.value).startswith(f'fault {text!r}')


@pytest.mark.parametrize(
    'arguments, message',
    [
        ({'kind': 'silence', 'start': math.inf}, 'start'),
        ({'kind': 'silence', 'offset': 5.0}, 'a fault of kind silence has none'),
        ({'kind': 'leak', 'conductance': math.nan}, 'conductance'),
    ],
)
def test_bad_values(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        Fault(**arguments)


# --- scenes -----------------------------------------------------------------------------------


def scene_with(tmp_path, faults, name='hexapod_patches'):
    values = yaml.safe_load(configuration.locate('scenes', name).read_text(encoding='utf-8'))
    file = tmp_path / 'mine.yaml'
    file.write_text(yaml.safe_dump(values | {'faults': faults}))
    return file


def test_scene_lists_faults(tmp_path):
    assert Scene.load('hexapod_patches').faults == ()
    entries = [{'kind': 'leak', 'legs': [2], 'start': 5.0, 'end': 20.0, 'conductance': 1e-10}]
    file = scene_with(tmp_path, [*entries, {'kind': 'supply_loss', 'start': 8.0}])
    assert Scene.load(file).faults == (
        Fault('leak', 5.0, 20.0, (2,), conductance=1e-10),
        Fault('supply_loss', 8.0, time_constant=1.0),
    )


@pytest.mark.parametrize(
    'name, faults, message',
    [
        ('hexapod_patches', {'kind': 'leak'}, 'a list is needed'),
        (
            'hexapod_patches',
            [{'kind': 'silence'}, {'kind': 'leek'}],
            "fault 2: kind = 'leek' is not allowed",
        ),
        ('leg_wet_dome_60', [{'kind': 'silence', 'legs': [2]}], 'rail_leg has no leg 2'),
    ],
)
def test_bad_faults_of_a_scene(tmp_path, name, faults, message):
    file = scene_with(tmp_path, faults, name)
    with pytest.raises(ConfigError, match=re.escape(message)) as caught:
        Scene.load(file)
    assert str(caught.value).startswith(str(file))
