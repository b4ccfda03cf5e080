# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ros_pad.errors import InvalidInput
from ros_pad.simulation.pneumatics import Hose, PneumaticChannel, RegulatorModel, time_to

FOUR_BY_ONE = Hose(0.004, 1.0)
BARE = RegulatorModel(dead_time=0.0, dead_band=0.0, quantum=0.0)


def mass_flow(hose, first, second):
    return hose.conductance(first, second) * (first - second)


def walk(channel, setpoint, duration, dt):
    return np.array([channel.step(setpoint, dt) for _ in range(round(duration / dt))])


# --- hose -------------------------------------------------------------------------------------


def test_conductance_of_a_hose_in_si_units():
    # By hand: 1/0.004^1.25 = 994.1, √1504.1 = 38.783, 0.029·16e-6/38.783.
    assert FOUR_BY_ONE.sonic_conductance == pytest.approx(1.1964e-8, rel=1e-4)
    assert FOUR_BY_ONE.critical_ratio == pytest.approx(0.3544, rel=1e-3)
    assert FOUR_BY_ONE.volume == pytest.approx(12.566e-6, rel=1e-4)


def churchill(reynolds):
    """Darcy's friction factor of a smooth pipe, laminar to turbulent (Churchill 1977)."""
    a = (2.457 * np.log(1.0 / (7.0 / reynolds) ** 0.9)) ** 16
    return 8.0 * ((8.0 / reynolds) ** 12 + 1.0 / (a + (37530.0 / reynolds) ** 16) ** 1.5) ** (
        1 / 12
    )


RT = 287.05 * 293.15
VISCOSITY = 1.82e-5


@pytest.mark.parametrize('diameter', [0.0005, 0.002, 0.006])
@pytest.mark.parametrize('length', [0.1, 10.0])
def test_flow_agrees_with_pipe_flow_from_creeping_to_choked(diameter, length):
    # Isothermal compressible flow from rest loses one and a half dynamic heads at the ends.
    hose, seen = Hose(diameter, length), []
    for excess in (100.0, 500.0, 2e3, 7.5e3, 25e3, 75e3):
        upstream = 101325.0 + excess

        def short_of(flux, upstream=upstream):
            friction = churchill(flux * diameter / VISCOSITY) * length / diameter + 1.5
            outlet = max(101325.0, flux * math.sqrt(RT))
            head = friction + 2.0 * math.log(upstream / outlet)
            return (upstream**2 - outlet**2) / RT - flux**2 * head

        flux = brentq(short_of, 1e-6, 0.999 * upstream / math.sqrt(RT))
        flow = mass_flow(hose, upstream, 101325.0)
        seen.append(flow / (flux * math.pi / 4.0 * diameter**2))
    assert min(seen) > 0.93
    assert max(seen) < 1.5
    # Without Poiseuille's law the flow of the thinnest hose would be eightfold at 7.5 kPa.
    if diameter == 0.0005:
        assert seen[3] == pytest.approx(1.0, abs=0.13)


def test_choked_mass_flow():
    # 1.19636e-8 m³/(s Pa) · 1.185 kg/m³ · 600 kPa; the flow is choked, as 150/600 is below b.
    assert mass_flow(FOUR_BY_ONE, 600e3, 150e3) == pytest.approx(8.506e-3, rel=1e-3)
    assert mass_flow(FOUR_BY_ONE, 600e3, 10e3) == mass_flow(FOUR_BY_ONE, 600e3, 150e3)


# --- regulator --------------------------------------------------------------------------------


@pytest.mark.parametrize('damping, dt', [(0.5, 0.001), (0.9, 0.017), (1.0, 0.004), (1.7, 0.004)])
def test_outlet_is_the_exact_second_order_response(damping, dt):
    model = RegulatorModel(damping=damping, dead_time=0.0, dead_band=0.0, quantum=0.0)
    channel = PneumaticChannel(model, FOUR_BY_ONE, 5e-6)
    times = np.arange(1, round(0.2 / dt)) * dt
    system = signal.lti([45.0**2], [1.0, 2.0 * damping * 45.0, 45.0**2])
    _, unit = signal.step(system, T=np.concatenate([[0.0], times]))
    outlet = []
    for _ in times:
        channel.step(50e3, dt)
        outlet.append(channel.outlet)
    assert outlet == pytest.approx(50e3 * unit[1:], abs=0.2)


def test_dead_time_need_not_be_a_number_of_steps():
    model = RegulatorModel(dead_time=0.0101, dead_band=0.0)
    channel = PneumaticChannel(model, FOUR_BY_ONE, 5e-6)
    walk(channel, 50e3, 0.008, 0.004)
    assert channel.outlet == 0.0
    walk(channel, 50e3, 0.032, 0.004)
    system = signal.lti([45.0**2], [1.0, 81.0, 45.0**2])
    _, unit = signal.step(system, T=[0.0, 0.040 - 0.0101])
    assert channel.outlet == pytest.approx(50e3 * unit[1], abs=0.2)


def test_set_points_in_dead_time_are_followed_one_after_another():
    model = RegulatorModel(dead_time=0.1, dead_band=0.0)
    channel = PneumaticChannel(model, FOUR_BY_ONE, 5e-6)
    channel.step(50e3, 0.05)
    channel.step(0.0, 0.09)
    assert channel.outlet > 10e3
    channel.step(0.0, 2.0)
    assert channel.outlet == 0.0


def test_quantum_rounds_the_setpoint():
    channel = PneumaticChannel(RegulatorModel(), FOUR_BY_ONE, 5e-6)
    assert channel.step(50_049.0, 2.0) == 50_000.0
    assert PneumaticChannel(BARE, FOUR_BY_ONE, 5e-6).step(50_049.0, 2.0) == 50_049.0


def test_dead_band_ignores_small_changes_but_never_zero():
    channel = PneumaticChannel(RegulatorModel(), FOUR_BY_ONE, 5e-6)
    assert channel.step(400.0, 2.0) == 0.0  # the band is 500 Pa
    assert channel.step(50_000.0, 2.0) == 50_000.0
    assert channel.step(50_500.0, 2.0) == 50_000.0
    assert channel.step(50_600.0, 2.0) == 50_600.0
    channel = PneumaticChannel(RegulatorModel(dead_band=0.1), FOUR_BY_ONE, 5e-6)
    channel.step(12e3, 2.0)
    channel.step(1e3, 2.0)
    assert channel.pad_pressure == 1e3
    assert channel.step(0.0, 2.0) == 0.0


# --- pad --------------------------------------------------------------------------------------


def reference(hose, volume, setpoint, start, times):
    """Integrate regulator and pad with SciPy, with independent ISO 6358 and Poiseuille laws."""
    c, b = hose.sonic_conductance, hose.critical_ratio
    creep = math.pi * hose.inner_diameter**4 / (256.0 * 1.82e-5 * hose.length) / 100e3

    def rate(t, y):
        outlet, speed, pad = y
        high, low = max(outlet, pad) + 101325.0, min(outlet, pad) + 101325.0
        r = low / high
        if r <= b:
            psi = 1.0
        else:
            psi = math.sqrt(1.0 - ((min(r, 0.999) - b) / (1.0 - b)) ** 2)
            psi *= min(1.0, (1.0 - r) / 0.001)
        flow = math.copysign(min(c * high * psi, creep * (high**2 - low**2)), outlet - pad)
        return [speed, 45.0**2 * (setpoint - outlet) - 81.0 * speed, 100e3 * flow / volume(pad)]

    result = solve_ivp(
        rate, (0.0, times[-1]), [start, 0.0, start], 'LSODA', times, rtol=1e-7, atol=1e-2
    )
    assert result.success
    return result.y[2]


LINES = [
    (Hose(0.002, 2.0), 0.4e-6),
    (Hose(0.002, 2.0), 100e-6),
    (Hose(0.004, 1.0), 5e-6),
]


@pytest.mark.parametrize('hose, volume', LINES)
@pytest.mark.parametrize('start, end', [(0.0, 75e3), (40e3, 75e3), (85e3, 20e3)])
def test_filling_and_venting_against_scipy(hose, volume, start, end):
    channel = PneumaticChannel(BARE, hose, volume)
    channel.step(start, 60.0)
    times = np.arange(1, 126) * 0.004
    exact = reference(hose, lambda p: volume + hose.volume / 2.0, end, start, times)
    pad = walk(channel, end, 0.5, 0.004)
    assert np.abs(pad - exact).max() < 0.01 * abs(end - start)
    assert np.ptp(pad) > 0.3 * abs(end - start)


def test_pad_that_swells_against_scipy():
    def volume(pressure):
        return 2e-6 + 30e-6 * (pressure / 75e3) ** 2

    def capacity(pressure):  # d(p V)/dp, p absolute
        slope = 60e-6 * pressure / 75e3**2
        return volume(pressure) + hose.volume / 2.0 + (pressure + 101325.0) * slope

    hose = Hose(0.002, 1.0)
    channel = PneumaticChannel(BARE, hose, volume)
    times = np.arange(1, 126) * 0.004
    exact = reference(hose, capacity, 75e3, 0.0, times)
    pad = walk(channel, 75e3, 0.5, 0.004)
    assert np.abs(pad - exact).max() < 750.0


@pytest.mark.parametrize('dt', [0.004, 0.020])
@pytest.mark.parametrize('volume', [1e-9, 5e-6, 2e-4])
@pytest.mark.parametrize('diameter', [0.002, 0.006])
def test_filling_is_monotone_at_any_step(dt, volume, diameter):
    model = RegulatorModel(damping=1.0)  # without overshoot of the regulator
    channel = PneumaticChannel(model, Hose(diameter, 0.1), volume)
    for end, sign in ((75e3, 1.0), (76e3, 1.0), (0.0, -1.0)):
        start = channel.pad_pressure
        pad = walk(channel, end, 2.0, dt)
        assert (sign * np.diff(pad, prepend=start)).min() >= -1e-6
        assert pad[-1] == end
        assert pad.min() >= 0.0


def test_settled_channel_skips_an_hour():
    class Counted(Hose):
        def conductance(self, first, second):
            nonlocal calls
            calls += 1
            return super().conductance(first, second)

    channel, calls = PneumaticChannel(RegulatorModel(), Counted(0.004, 1.0), 5e-6), 0
    assert channel.settled
    channel.step(75e3, 0.004)
    assert not channel.settled
    assert channel.step(75e3, 3600.0) == 75e3
    assert channel.settled
    assert 100 < calls < 1000  # two calls in each internal step


# --- time to nine tenths ------------------------------------------------------------------------


def time_through_a_divided_hose(diameter, length, volume):
    """Return the time to 90 %, s, with the hose divided into 16 cells, by Churchill's friction."""
    cells = 16
    area = math.pi / 4.0 * diameter**2
    capacity = np.full(cells, area * length / cells)
    capacity[-1] = capacity[-1] / 2.0 + volume  # half a cell belongs to the outlet
    # Pressures give f Re²; this table gives the Reynolds number for it.
    numbers = np.geomspace(1e-6, 1e7, 2000)
    given = np.log(churchill(numbers) * numbers**2)

    def rate(t, y):
        outlet, speed, pads = y[0], y[1], y[2:] + 101325.0
        before = np.concatenate([[outlet + 101325.0], pads[:-1]])
        squares = before**2 - pads**2
        lengths = np.full(cells, length / cells)
        for _ in range(4):  # inlet loss of 1.5 dynamic heads as a longer first cell
            drive = np.abs(squares) * diameter**3 / (RT * lengths * VISCOSITY**2)
            reynolds = np.exp(np.interp(np.log(np.maximum(drive, 1e-12)), given, np.log(numbers)))
            lengths[0] = length / cells + 1.5 * diameter / churchill(reynolds[0])
        flow = np.sign(squares) * reynolds * VISCOSITY / diameter * area
        gain = flow - np.append(flow[1:], 0.0)
        return [speed, 45.0**2 * (75e3 - outlet) - 81.0 * speed, *(gain * RT / capacity)]

    def full(t, y):
        return y[-1] - 67.5e3

    full.terminal = True
    start = np.zeros(cells + 2)
    result = solve_ivp(rate, (0.0, 30.0), start, 'LSODA', rtol=1e-5, atol=1.0, events=full)
    return result.t_events[0][0] + 0.010  # dead time


@pytest.mark.parametrize(
    'size, volume',
    [
        ((0.0005, 2.0), 2.4e-6),
        ((0.001, 10.0), 20e-6),
        ((0.004, 10.0), 2.4e-6),
    ],
)
def test_time_to_fill_against_a_divided_hose(size, volume):
    divided = time_through_a_divided_hose(*size, volume)
    channel = PneumaticChannel(RegulatorModel(), Hose(*size), volume)
    assert 0.81 < time_to(channel, 75e3, 67.5e3) / divided < 1.09


# --- bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize('volume', [0.0, math.nan, lambda p: 1e-3 - p * 1e-8])
def test_pad_volume_refused(volume):
    with pytest.raises(InvalidInput, match='pad_volume'):
        PneumaticChannel(RegulatorModel(), FOUR_BY_ONE, volume)


@pytest.mark.parametrize('setpoint', [-1.0, 100_001.0, math.nan, math.inf])
def test_setpoint_refused_and_nothing_moves(setpoint):
    channel = PneumaticChannel(RegulatorModel(), FOUR_BY_ONE, 5e-6)
    channel.step(50e3, 0.1)
    before = channel.pad_pressure
    with pytest.raises(InvalidInput, match=r'setpoint .* Pa is needed'):
        channel.step(setpoint, 0.004)
    assert (channel.pad_pressure, channel.setpoint) == (before, 50e3)


def test_the_time_to_a_pressure_does_not_depend_on_the_ticks():
    times = []
    for tick in (1e-4, 5e-4, 2e-3):
        channel = PneumaticChannel(RegulatorModel(), Hose(4e-3, 1.0), 2.4e-6)
        times.append(time_to(channel, 75e3, 67.5e3, tick))
        channel.step(75e3, 1.0)
        times.append(time_to(channel, 0.0, 1e3, tick))
    assert times[0] == pytest.approx(0.086, abs=0.001)  # docs/model/pneumatics.md
    assert times[2:] == pytest.approx(2 * times[:2], rel=0.01)
