# SPDX-License-Identifier: Apache-2.0
"""Supervised channels without ROS: set-points keep their limits; pads without commands vent."""

import dataclasses
import math
import re
from functools import partial

import numpy as np
import pytest
from shared import Device

from ros_pad.control.faults import KINDS, Kind, text
from ros_pad.errors import TransportError
from ros_pad.records import COMMAND, Block
from ros_pad.regulators import create
from ros_pad.regulators.channel import Health, Level, SupervisedChannel, SupervisorSettings
from ros_pad.regulators.supervision import Supervision, supply_health

MS = 1_000_000
TICK_NS = 10 * MS
CEILING = 80e3


class Log:
    """Records log messages as pairs of level and text."""

    def __init__(self):
        self.lines = []
        self.info, self.warning, self.error = (
            partial(self.add, level) for level in ('info', 'warning', 'error')
        )

    def add(self, level, text, **throttle):
        self.lines.append((level, text))

    def texts(self, level):
        return [text for each, text in self.lines if each == level]


class Rig:
    """Supervised channels in order of legs, driven in simulated time."""

    def __init__(self, *regulators, **values):
        self.now_ns = 1000 * MS
        self.log = Log()
        self.channels = [
            SupervisedChannel(leg, regulator, SupervisorSettings(**values), self.log)
            for leg, regulator in enumerate(regulators, start=1)
        ]

    @classmethod
    def simulated(cls, *faults, **values):
        """Return a rig with a simulated regulator for each list of faults; one by default."""
        rig = cls(**values)
        for leg, own in enumerate(faults or ([],), start=1):
            regulator = create('simulated', clock=lambda: rig.now_ns * 1e-9, faults=own)
            rig.channels.append(
                SupervisedChannel(leg, regulator, SupervisorSettings(**values), rig.log)
            )
        return rig.start()

    def start(self):
        self.supervision = Supervision(self.channels)
        for channel in self.channels:
            channel.open()
        self.supervision.activate(self.now_ns)
        return self

    def tick(self, seconds=0.01):
        """Advance in steps of 10 ms; devices are read at every second step."""
        for _ in range(round(seconds * 1e9) // TICK_NS):
            self.now_ns += TICK_NS
            self.supervision.tick(self.now_ns)
            if self.now_ns % (2 * TICK_NS) == 0:
                self.record = self.supervision.read(self.now_ns, self.now_ns)

    def send(self, gauge, age=0.0, leg=1):
        return self.channels[leg - 1].command(gauge, age, self.now_ns)

    def command(self, *gauges, age_ns=0):
        """Command pressures by a record."""
        rows = COMMAND.rows(len(gauges))
        rows['setpoint'] = gauges
        record = Block.of(self.now_ns - age_ns, rows)
        self.supervision.command(record, self.now_ns, self.now_ns)

    def faults(self):
        """Return the faults in the last record of pressures, as texts."""
        rows = self.record.rows[0]
        return [text(row['fault'], *row['detail']) for row in rows]

    def hold(self, gauges, seconds):
        """Command the pressures of all pads every 20 ms, as a controller does."""
        for _ in range(round(seconds / 0.02)):
            self.command(*gauges)
            self.tick(0.02)

    def first(self, level, seconds, gauges, leg=1):
        """Hold pressures, Pa, for a time, s; return time and message of the first ``level``."""
        channel, found = self.channels[leg - 1], None
        for _ in range(round(seconds / 0.02)):
            self.hold(gauges, 0.02)
            health = channel.health()
            if found is None and health.level == level:
                found = self.now_ns * 1e-9, health.message
        return found


def device_rig(**values):
    """Return a started rig with one device, its channel, and the device."""
    device = Device()
    rig = Rig(device, **values).start()
    return rig, rig.channels[0], device


# --- settings ------------------------------------------------------------------------------------


def test_settings_are_replaced_while_a_pad_is_up():
    rig, channel, device = device_rig(command_timeout=5.0)
    rig.send(50e3)
    rig.tick(0.5)
    assert device.setpoint == 50e3
    channel.settings = dataclasses.replace(channel.settings, command_timeout=0.1)
    rig.tick()
    assert device.setpoint == 0.0


# --- commands ------------------------------------------------------------------------------------

REFUSED = {
    'stale': ((50e3, 0.51), 'stamp of the set-point is 0.510 s old: at most 0.5 s'),
    'future': ((50e3, -0.51), 'stamp of the set-point is 0.510 s in the future: at most 0.5 s'),
    'nan': (
        (math.nan, 0.0),
        'set-point = nan is not allowed: a finite number of at least 0 Pa gauge and at most',
    ),
    'negative': (
        (-1.0, 0.0),
        'set-point = -1.0 is not allowed: a finite number of at least 0 Pa gauge and at most',
    ),
    'above the ceiling': (
        (80001.0, 0.0),
        'set-point 80001 Pa is refused: it is above the ceiling of 80000',
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_bad_command_is_refused_and_reported_once(case):
    command, message = REFUSED[case]
    rig, channel, device = device_rig()
    assert rig.send(30e3)
    assert not rig.send(*command)
    assert (channel.answers.accepted, channel.answers.refused) == (1, 1)
    assert device.setpoint == 30e3
    assert channel.answers.due
    level, words = channel.answers.report(channel.health())
    assert level == Level.WARN
    assert words.startswith(message)
    assert not channel.answers.due
    assert channel.answers.report(channel.health()) == Health(Level.OK, 'under pressure')
    assert rig.log.texts('warning') == [f'leg 1: set-point refused: {words}']
    assert rig.send(50e3)
    assert device.setpoint == 50e3


def test_an_inactive_channel_sends_nothing():
    rig, channel, device = device_rig()
    channel.deactivate('deactivated')
    assert not rig.send(50e3)
    assert (device.received, channel.answers.accepted, channel.answers.refused) == ([], 0, 0)


# --- vents ---------------------------------------------------------------------------------------


def test_a_device_is_vented_when_it_is_opened_and_closed():
    rig, channel, device = device_rig()
    assert (device.is_open, device.setpoint) == (True, 0.0)
    rig.send(50e3)
    channel.close('the test ends')
    assert (device.is_open, device.setpoint, channel.active) == (False, 0.0, False)
    (text,) = rig.log.texts('info')
    assert 'leg 1' in text and text.endswith('the test ends')


def test_a_device_that_cannot_be_vented_is_closed_again():
    device = Device()
    device.broken = TransportError('cable')
    with pytest.raises(TransportError, match='cable'):
        Rig(device).start()
    assert not device.is_open


def test_without_commands_a_pad_is_vented():
    rig = Rig.simulated(command_timeout=0.3)
    (channel,) = rig.channels
    rig.hold([60e3], 1.0)
    rig.tick(0.28)
    assert channel.pressure > 59e3
    rig.tick(0.5)
    assert channel.pressure < 1e3
    assert channel.health().level == Level.STALE
    assert any(re.search('leg 1: .* 0.3 s', text) for text in rig.log.texts('info'))
    rig.hold([60e3], 0.6)
    assert channel.pressure > 59e3
    assert channel.health() == Health(Level.OK, 'under pressure')


def test_a_command_concerns_the_legs_that_it_names():
    """A set-point that is missing or refused changes nothing for the other legs."""
    rig = Rig(Device(), Device(), Device()).start()
    rig.command(50e3, 60e3, 70e3)
    rig.command(math.nan, CEILING + 1.0, 20e3)
    _, second, third = rig.channels
    assert [each.sent for each in rig.channels] == [50e3, 60e3, 20e3]
    assert [each.answers.accepted for each in rig.channels] == [1, 1, 2]
    assert [each.answers.refused for each in rig.channels] == [0, 1, 0]
    rig.command(math.nan, 10e3, 10e3, age_ns=501 * MS)
    assert [each.sent for each in rig.channels] == [50e3, 60e3, 20e3]
    assert '0.501 s old' in second.answers.refusal and '0.501 s old' in third.answers.refusal


def test_commands_of_other_legs_do_not_keep_a_pad_up():
    """A record vents pads that have been without a set-point for too long, before any tick."""
    rig = Rig(Device(), Device()).start()
    rig.command(50e3, 50e3)
    for _ in range(6):
        rig.now_ns += 100 * MS
        rig.command(math.nan, 50e3)
    assert [each.sent for each in rig.channels] == [0.0, 50e3]


def test_a_device_that_fails_keeps_no_other_pad_up():
    rig = Rig(Device(), Device()).start()
    one, other = (each.regulator for each in rig.channels)
    rig.command(50e3, 50e3)
    one.broken = TransportError('cable')
    rig.tick(0.52)
    assert (one.setpoint, other.setpoint) == (50e3, 0.0)
    one.broken = None
    rig.tick()
    assert one.setpoint == 0.0


def test_refused_commands_do_not_keep_a_pad_up():
    rig, channel, device = device_rig(command_timeout=0.3)
    rig.send(60e3)
    for _ in range(40):
        rig.send(60e3, age=0.4)
        rig.tick(0.02)
    assert channel.answers.refused == 40
    assert device.setpoint == 0.0


def test_a_clock_that_is_set_back_keeps_no_pad_up():
    rig, _, device = device_rig()
    rig.send(50e3)
    rig.tick()
    assert device.setpoint == 50e3
    rig.now_ns -= 3 * TICK_NS
    rig.tick()
    assert device.setpoint == 0.0
    assert 'leg 1: vented: the clock was set back' in rig.log.texts('info')


@pytest.mark.parametrize('error', [TransportError('cable'), OSError(5, 'cable')])
def test_a_vent_that_fails_is_repeated_until_the_device_obeys(error):
    rig, channel, device = device_rig()
    rig.send(50e3)
    device.broken = error
    channel.vent('a test')
    assert not channel.vented
    assert device.setpoint == 50e3
    assert channel.health().message.endswith('cannot be vented')
    device.broken = None
    rig.tick()
    assert (device.setpoint, channel.vented) == (0.0, True)


def test_a_command_without_an_answer_is_vented():
    """The device may have received the command."""
    rig, channel, device = device_rig()
    device.broken = TransportError('no answer')
    assert not rig.send(50e3)
    assert device.setpoint == 50e3
    assert channel.health() == Health(Level.ERROR, 'the pad cannot be vented')
    device.broken = None
    rig.tick()
    assert device.setpoint == 0.0


# --- faults --------------------------------------------------------------------------------------

# Fault, time from which it can be seen, s, and first words of its report.
FAULTS = {
    'stuck flat': ('{kind: stuck_valve}', 2.0, 'does not fill: 0.0 kPa'),
    'stuck filled': ('{kind: stuck_valve, start: 2.5}', 3.2, 'does not vent: 60.'),
    'leak': ('{kind: leak, start: 2.5, conductance: 1.0e-8}', 2.5, 'sags: '),
    'drift': ('{kind: sensor_drift, start: 2.5, offset: 8.0e3}', 3.2, 'does not vent: 8.0 kPa'),
    'silence': (
        '{kind: silence, start: 2.5, end: 3.4}', 2.5, 'the simulated regulator does not answer',
    ),
}  # fmt: skip


@pytest.mark.parametrize('case', FAULTS)
def test_each_fault_is_an_error_within_a_second(case):
    fault, visible, words = FAULTS[case]
    rig = Rig.simulated([fault], [])
    found = []
    for gauge, seconds in ((0.0, 1.0), (60e3, 1.2), (0.0, 1.1)):
        found.append(rig.first(Level.ERROR, seconds, [gauge, gauge]))
    at, message = next(filter(None, found))
    assert visible <= at <= visible + 1.0
    assert message.startswith(words)
    assert rig.channels[1].health().level == Level.OK
    assert not [text for text in rig.log.texts('error') if 'leg 2' in text]
    assert supply_health(rig.channels).level == Level.OK  # one pad shows no loss of supply
    if case != 'silence':
        assert rig.channels[0].answers.refused == 0  # the fault is only reported


def test_a_low_supply_is_distinguished_from_a_leak():
    fault = '{kind: supply_loss, start: 2.0}'
    rig = Rig.simulated([fault], [fault])
    rig.hold([60e3, 50e3], 2.4)
    assert supply_health(rig.channels) == (
        Level.ERROR,
        'the supply of air is low: pads of legs 1, 2 are below their set-points',
    )


def test_sound_pads_have_no_fault():
    rig = Rig.simulated([], [])
    gauges = [(60e3, 0.0, 0.5), (0.0, 88e3, 0.5), (90e3, 20e3, 1.0), (0.0, 90e3, 1.0)]
    for one, two, seconds in gauges:
        for leg in (1, 2):
            assert rig.first(Level.ERROR, seconds / 2, [one, two], leg) is None
    rig.tick(2.0)
    assert rig.log.texts('error') == []
    assert {each.health().level for each in rig.channels} == {Level.STALE}


def test_a_faulty_pad_is_held_until_the_next_activation():
    leak = '{kind: leak, start: 2.0, end: 3.5, conductance: 1.0e-8}'
    rig = Rig.simulated([leak], [], on_fault='vent')
    rig.hold([60e3, 40e3], 2.0)
    first, second = rig.channels
    assert first.setpoint == 0.0
    assert second.pressure == pytest.approx(40e3, abs=500.0)
    assert 0 < first.answers.refused == 100 - first.answers.accepted
    level, message = first.health()
    assert level == Level.ERROR
    assert message.startswith('sags: ')
    assert 'vented until' in message
    assert any(text.startswith('leg 1: vented: sags: ') for text in rig.log.texts('info'))
    rig.hold([60e3, 40e3], 0.5)
    assert first.pressure < 1e3  # also after the leak has ended
    first.deactivate('deactivated')
    first.activate(rig.now_ns)
    assert rig.first(Level.ERROR, 1.0, [60e3, 40e3]) is None
    assert first.pressure == pytest.approx(60e3, abs=500.0)


def test_faults_that_a_device_reports_count_as_well():
    rig, channel, device = device_rig(on_fault='vent')
    rig.send(50e3)
    device.faults = ('EXH: the exhaust is open',)
    rig.tick(0.02)
    assert device.setpoint == 0.0
    assert channel.health().message.startswith('EXH: the exhaust is open')


def test_a_device_that_is_silent_for_long_is_held_but_one_lost_answer_is_not():
    lost = '{kind: silence, start: 2.0, end: 2.1}'
    silent = '{kind: silence, start: 2.0, end: 2.7}'
    rig = Rig.simulated([lost], [silent], on_fault='vent')
    rig.hold([60e3, 60e3], 2.5)
    first, second = rig.channels
    assert first.pressure == pytest.approx(60e3, abs=500.0)
    assert second.pressure < 1e3
    assert second.held.startswith('no reading for 0.5 s')


def test_a_pad_above_the_ceiling_is_vented_at_once_and_held():
    rig, channel, device = device_rig()
    rig.send(70e3)
    device.reads = 81.5e3  # the limit is 80 kPa and 2 %: 81.6 kPa
    rig.tick(0.06)
    assert device.setpoint == 70e3
    device.reads = 81.7e3
    rig.tick(0.02)
    assert device.setpoint == 0.0
    assert not rig.send(70e3)
    assert device.setpoint == 0.0
    held = '81.7 kPa .* 80.0 kPa'
    assert re.search(f'set-point 70000 Pa .* {held}', channel.answers.refusal)
    assert re.search(held, channel.health().message)
    assert channel.answers.report(channel.health()).message.endswith(channel.answers.refusal)
    assert any(re.search(f'leg 1: .* {held}', text) for text in rig.log.texts('info'))


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_a_reading_that_is_not_finite_is_none(value):
    rig, channel, device = device_rig()
    device.reads = value
    assert channel.read(rig.now_ns) is None
    assert f'{value!r} Pa' in channel.health().message
    (row,) = rig.supervision.read(5, rig.now_ns).rows[0]
    assert math.isnan(row['pressure']) and math.isnan(row['setpoint'])
    assert row['fault'] == Kind.DEVICE.code


def test_a_record_has_the_readings_and_faults_of_all_legs():
    leak = '{kind: leak, start: 1.0, conductance: 1.0e-8}'
    drift = '{kind: sensor_drift, start: 1.0, offset: 5.0e3}'
    silent = '{kind: silence, start: 1.5}'
    rig = Rig.simulated([], [leak], [drift], [silent], on_fault='vent')
    rig.hold([60e3] * 4, 0.6)
    assert rig.record.last_ns == rig.now_ns
    row = rig.record.rows[0]
    assert row['pressure'][[0, 2]] == pytest.approx([60e3] * 2, abs=500.0)
    assert row['setpoint'][[0, 2]].tolist() == [60e3] * 2
    assert row['pad'][2] == pytest.approx(55e3, abs=500.0)  # what the sensor does not show
    assert np.isnan([row['pressure'][3], row['setpoint'][3]]).all()
    assert row['pad'][3] == pytest.approx(60e3, abs=500.0)
    faults = rig.faults()
    assert (faults[0], faults[2], faults[3]) == ('', '', 'device error')
    rig.hold([60e3] * 4, 0.6)
    assert re.fullmatch(r'leaks or lacks air: .*', rig.faults()[1])
    assert rig.faults()[3].startswith('no reading for 0.5 s, the last was 60.')


def test_a_pad_that_is_held_says_so_in_records():
    rig, _, device = device_rig()
    rig.command(70e3)
    device.reads = 90e3
    rig.tick(0.02)
    device.reads = None
    rig.tick(0.02)
    assert rig.faults() == ['vented until the node is activated again']
    (row,) = rig.record.rows[0]
    assert KINDS[row['detail'][0]] is Kind.CEILING
    assert math.isnan(row['pad'])  # not known of a real device
