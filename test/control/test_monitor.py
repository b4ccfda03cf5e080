# SPDX-License-Identifier: Apache-2.0
"""The monitor of a pad with simulated regulators; it does not receive the list of their faults."""

import contextlib
import math
import random
import re

import pytest

from ros_pad.contact.resistance import Foot
from ros_pad.control import PadMonitor
from ros_pad.errors import TransportError
from ros_pad.regulators import SimulatedRegulator

FOOT = Foot.load('large37')
CEILING = 90e3
PERIOD = 0.02  # s


class Pad:
    """A regulator with hose and pad, and a monitor that is updated 50 times a second."""

    def __init__(self, *faults, **options):
        self.now = 0.0
        options = {'pad_volume': FOOT.air_volume, **options}
        self.regulator = SimulatedRegulator(lambda: self.now, faults=faults, **options)
        self.regulator.open()
        self.watch = PadMonitor(CEILING)
        self.setpoint = 0.0
        self.steps = 0
        self.said = []  # (time, reason) of each change

    def hold(self, setpoint, duration):
        """Command a pressure, Pa, for a time, s; return the reason of the monitor."""
        for _ in range(round(duration / PERIOD)):
            self.now = self.steps * PERIOD
            self.steps += 1
            try:
                reading = self.regulator.read().pressure
            except TransportError:
                reading = None
            self.watch.update(self.now, self.setpoint, reading)
            if self.watch.reason != (self.said[-1][1] if self.said else ''):
                self.said.append((self.now, self.watch.reason))
            self.setpoint = setpoint
            with contextlib.suppress(TransportError):
                self.regulator.set_pressure(setpoint)
        return self.watch.reason


LINES = {
    'shipped': {},
    'long and thin': {'hose_diameter': 2e-3, 'hose_length': 2.0},
    'hair': {'hose_diameter': 1e-3, 'hose_length': 10.0},
    'narrow fitting, 0.6 s': {'hose_diameter': 2e-3, 'hose_conductance': 7.7e-11},
    'narrow fitting, 1.25 s': {'hose_diameter': 2e-3, 'hose_conductance': 3.32e-11},
    'big chamber': {'pad_volume': 20e-6},
    'small chamber': {'pad_volume': 0.5e-6},
    'slow regulator': {'natural_frequency': 4.0, 'dead_time': 0.1},
    'coarse': {'dead_band': 0.01, 'quantum': 500.0},
}


@pytest.mark.slow
@pytest.mark.parametrize('noise', [300.0])
@pytest.mark.parametrize('line', LINES)
def test_a_sound_pad_is_never_accused(line, noise):
    """The pad is domed and flat by turns, each for one to four steps, at random pressures."""
    draw = random.Random(3)
    pad = Pad(sensor_noise=noise, seed=1, **LINES[line])
    for _ in range(10):
        for _ in range(draw.randint(1, 4)):
            pad.hold(draw.uniform(55e3, 85e3) if draw.random() < 0.3 else 70e3, 1.0)
        pad.hold(0.0, draw.randint(1, 4))
    assert pad.said == []


@pytest.mark.parametrize('period', [0.1, 0.48])
def test_a_pad_that_moves_is_not_accused_however_rarely_it_is_read(period):
    watch = PadMonitor(CEILING)
    now = pressure = 0.0
    for aim in (75e3, 0.0, 75e3, 0.0):
        for _ in range(round(4.0 / period)):
            now += period
            pressure = aim + (pressure - aim) * math.exp(-period / 0.8)
            watch.update(now, aim, pressure)
            assert watch.reason == ''


def test_it_learns_how_long_the_hose_takes():
    """Hoses fill the pad to 90 % of 75 kPa in 0.086, 0.57 and 1.25 s.

    The monitor waits until 2.7 kPa, 3.6 %, are missing: 1.45 times as long for an exponential.
    """
    for options, filling in [({}, 0.086), (LINES['narrow fitting, 0.6 s'], 0.57),
                             (LINES['narrow fitting, 1.25 s'], 1.25)]:  # fmt: skip
        pad = Pad(**options)
        for _ in range(5):
            pad.hold(75e3, 4.0)
            pad.hold(0.0, 4.0)
        assert filling < pad.watch.fill_time < 1.7 * filling + PERIOD
        assert filling < pad.watch.vent_time < 2.2 * filling + PERIOD
        # Changes of the load move the set-point by less than a fill, so nothing is learnt.
        learnt = pad.watch.fill_time
        pad.hold(60e3, 5.0)
        whole = pad.watch.fill_time
        for _ in range(5):
            pad.hold(70e3, 2.0)
            pad.hold(60e3, 2.0)
        assert pad.watch.fill_time == whole == pytest.approx(learnt, rel=0.1)


def test_changes_that_end_early_show_a_slow_hose():
    """The pad fills and vents by turns of 0.5 s; its time constant is 1 s."""
    watch = PadMonitor(CEILING)
    pressure = 0.0
    for step in range(500):
        aim = 75e3 if step % 50 < 25 else 0.0
        pressure = aim + (pressure - aim) * math.exp(-PERIOD)
        watch.update(step * PERIOD, aim, pressure)
    assert 2.0 < watch.fill_time < 3.0 and 2.0 < watch.vent_time < 3.0


# Fault; set-points, Pa, each with its time, s; time from which the fault can be seen; reason.
# A stuck valve is seen when the pad should move, a leak when the pad is out of tolerance.
STUCK_FLAT = '{kind: stuck_valve, start: 1.0, end: 8.0}'
STUCK_DOMED = '{kind: stuck_valve, start: 3.0, end: 8.0}'
CASES = {
    'does not fill': (STUCK_FLAT, [(0.0, 2.0), (70e3, 2.0)], 2.0, r'does not fill: 0\.0 kPa'),
    'does not vent': (STUCK_DOMED, [(70e3, 4.0), (0.0, 2.0)], 4.0, r'does not vent: 70\.\d kPa'),
    'leaks from the start': (
        '{kind: leak, start: 1.0, conductance: 1.0e-8}', [(0.0, 2.0), (70e3, 2.0)], 2.1,
        r'leaks or lacks air: 4\d\.\d kPa, 2\d\.\d kPa below',
    ),
    'begins to leak': (
        '{kind: leak, start: 3.0, conductance: 1.0e-8}', [(70e3, 5.0)], 3.0,
        r'sags: .* at a set-point of 70\.0 kPa',
    ),
    # The supply is below 70 - 2.7 kPa after ln(100/67.3) = 0.40 s.
    'supply lost': (
        '{kind: supply_loss, start: 3.0}', [(70e3, 5.0)], 3.4, 'sags: .* at a set-point',
    ),
    # The reading rises by 8 kPa in 2 s, so that it is 2.7 kPa too high after 0.7 s.
    'drifts up': (
        '{kind: sensor_drift, start: 3.0, offset: 8.0e3, rise: 2.0}', [(0.0, 6.0)], 3.7, 'rises',
    ),
    'drifts down': (
        '{kind: sensor_drift, start: 3.0, offset: -8.0e3, rise: 2.0}', [(0.0, 6.0)], 3.7,
        'its pressure sensor is faulty',
    ),
    'silence': ('{kind: silence, start: 3.0}', [(70e3, 5.0)], 3.0, r'no reading for 0\.5 s'),
}  # fmt: skip


@pytest.mark.parametrize('noise', [200.0])
@pytest.mark.parametrize('case', CASES)
def test_a_fault_is_reported_within_a_second_of_its_being_visible(case, noise):
    fault, asked, visible, reason = CASES[case]
    pad = Pad(fault, sensor_noise=noise)
    for setpoint, duration in asked:
        pad.hold(setpoint, duration)
    (at, said) = pad.said[0]
    assert visible < at < visible + 1.0
    assert re.search(reason, said), said


def test_a_pad_that_is_stuck_between_neither_fills_nor_vents():
    pad = Pad('{kind: stuck_valve, start: 0.05}')
    pad.hold(70e3, 2.0)
    pad.hold(0.0, 2.0)
    assert pad.watch.reason.startswith('stuck: ')
    assert pad.watch.reason.endswith('neither fills nor vents')
    assert 1e3 < pad.watch.pressure < 69e3


def test_too_much_pressure_is_reported_at_once():
    """The pressure of the pad is above its ceiling."""
    watch = PadMonitor(CEILING)
    for k in range(10):
        watch.update(k * PERIOD, 88e3, 95e3)
    assert re.search('95.0 kPa .* 90.0 kPa', watch.reason)


def test_a_fault_heals_when_the_pad_does_what_it_could_not():
    pad = Pad(STUCK_FLAT)
    pad.hold(0.0, 2.0)
    assert 'does not fill' in pad.hold(70e3, 2.0)
    # A flat pad that is commanded flat does not show that the valve works again.
    assert 'does not fill' in pad.hold(0.0, 8.0)
    assert pad.hold(70e3, 1.0) == ''
    assert len(pad.said) == 2


class TimedMonitor(PadMonitor):
    """A monitor with a clock that advances with each reading."""

    time = 0.0

    def read(self, setpoint, *readings):
        """Update with pressures, Pa, each for a time, s; return the reason."""
        for pressure, duration in readings:
            for _ in range(round(duration / PERIOD)):
                self.time += PERIOD
                self.update(self.time, setpoint, pressure)
        return self.reason


@pytest.mark.parametrize('bad', [None, math.nan, math.inf])
def test_what_is_no_number_is_no_reading(bad):
    watch = PadMonitor(CEILING)
    watch.update(0.0, 0.0, 0.0)
    for k in range(1, 40):
        watch.update(k * PERIOD, 0.0, bad)
    assert re.search('no reading for 0.5 s.* 0.0 kPa', watch.reason)
    assert watch.pressure == 0.0


@pytest.mark.parametrize('jump', [-100.0, 3.0])
def test_a_clock_that_jumps_accuses_nobody(jump):
    """A fill begins before the jump; after the jump the pad still has the whole time."""
    watch = PadMonitor(CEILING)
    watch.update(0.0, 0.0, 0.0)
    for k in range(1, 11):
        watch.update(k * PERIOD, 70e3, 0.0)
    for k in range(11, 30):
        watch.update(jump + k * PERIOD, 70e3, 0.0)
    assert watch.reason == ''
    for k in range(30, 60):
        watch.update(jump + k * PERIOD, 70e3, 0.0)
    assert 'does not fill' in watch.reason
