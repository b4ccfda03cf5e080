# SPDX-License-Identifier: Apache-2.0
import re

import pytest

from ros_pad.errors import ConfigError, DeviceFault, LimitError, ProtocolError, TransportError
from ros_pad.regulators import Regulator, create
from ros_pad.regulators.alicat import STATUS

# Polls are so rare that one follows each command: a script then knows the whole dialogue.
SLOW = {'poll_period': 1.0, 'silence': 10.0, 'reply_timeout': 1.0}
GREETING = [
    ('A', 'A +000.00 +000.00\r'),
    ('AVE', 'A   10v20.0-R24 Jan  2 2024,10:20:30\r'),
    ('ALS', 'A +000.00 +000.00 10 kPaG\r'),
    ('ALSS', 'A S\r'),
]


def fault_of(regulator):
    return next(iter(regulator.read().faults), None)


# --- scripted dialogues ------------------------------------------------------------------------


def test_commands_to_set_read_and_vent(dialogue, until):
    device = dialogue(
        [
            *GREETING,
            ('ALS 75.00 10', 'A +000.00 +075.00 10 kPaG\r'),
            ('A', 'A +000.00 +075.00\r'),
            ('ALS 12.35 10', 'A +075.00 +012.35 10 kPaG\r'),
            ('A', 'A +074.31 +012.35\r'),
            ('ALS 0.00 10', 'A +012.35 +000.00 10 kPaG\r'),
            ('A', 'A +012.34 +000.00\r'),
        ]
    )
    regulator = create('alicat', port=device.path, **SLOW)
    assert isinstance(regulator, Regulator)
    regulator.open()
    reading = regulator.read()
    assert (reading.pressure, reading.setpoint, reading.faults) == (0.0, 0.0, ())
    regulator.set_pressure(75e3)
    until(lambda: regulator.read().setpoint == 75e3)
    regulator.set_pressure(75e3)  # no new value: nothing is sent
    regulator.set_pressure(12_345.6)
    reading = until(lambda: (found := regulator.read()).setpoint < 75e3 and found)
    assert reading.pressure == pytest.approx(74_310.0)
    assert reading.setpoint == pytest.approx(12_350.0)
    assert reading.faults == ()
    regulator.close()
    assert device.sent == 10


@pytest.mark.parametrize(
    ('units', 'frame', 'setpoint', 'command', 'in_force'),
    [
        ('psi', 'A +00.000 +00.000', 75e3, 'AS10.878', 10.878 * 6894.757293168361),
        ('kPa', 'A +000 +000', 74_600.0, 'AS75', 75e3),
        ('kPa', 'A +000 +000', 89_700.0, 'AS89', 89e3),  # 90 would be above the ceiling
    ],
)
def test_setpoints_have_the_decimals_of_the_frame(
    dialogue, until, units, frame, setpoint, command, in_force
):
    def echo(value):
        return f'{frame.rsplit(" ", 1)[0]} {value}\r'

    device = dialogue(
        [
            ('A', frame + '\r'),
            ('AVE', 'A 8v17.0-R23 Oct 20 2017,16:35:38\r'),  # firmware without LS and LSS
            (command, echo(command[2:])),
            ('AS' + format(0.0, f'.{len(command.partition(".")[2])}f'), frame + '\r'),
        ]
    )
    ceiling = 89_800.0
    regulator = create('alicat', port=device.path, units=units, ceiling=ceiling, **SLOW)
    regulator.open()
    regulator.set_pressure(setpoint)
    until(lambda: regulator.read().setpoint > 0.0)
    assert regulator.read().setpoint == pytest.approx(in_force)
    assert regulator.read().setpoint <= ceiling
    regulator.close()


def test_valves_that_are_held_are_released_for_a_vent(dialogue, until):
    device = dialogue(
        [
            ('A', 'A +050.00 +000.00 HLD\r'),
            *GREETING[1:],
            ('ALS 0.00 10', 'A +000.00 +000.00 10 kPaG\r'),
            ('AC', 'A +049.00 +000.00\r'),
        ]
    )
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    assert regulator.read().faults == (STATUS['HLD'],)
    regulator.vent()
    until(lambda: regulator.read().faults == ())
    regulator.close()


@pytest.mark.parametrize(
    ('reply', 'words'),
    [
        ('B +000.00 +000.00', 'the reply is not of unit A'),
        ('A +000.00 +000.00 +023.40', 'the reply is not a frame'),
        ('A +000.00 +000.00 WHAT', 'the reply is not a frame'),
        ('A +0e3.00 +nan', 'the reply is not a frame'),
    ],
)
def test_an_invalid_frame_is_refused_with_port_command_and_reply(reply, words):
    regulator = create('alicat', port='/dev/somewhere')
    with pytest.raises(ProtocolError, match=re.escape(words)) as caught:
        regulator.poll(lambda command: reply)
    assert f"port /dev/somewhere, command 'A', reply {reply!r}" in str(caught.value)


@pytest.mark.parametrize(
    ('reply', 'kind', 'words'),
    [
        ('A +000.0', TransportError, 'half a line within 0.05 s'),
        ('\xfe\x91\x00+0.00\r', ProtocolError, 'the reply is not ASCII'),
        ('x' * 300, ProtocolError, 'the reply has no terminator'),
    ],
)
def test_an_invalid_line_is_an_error_with_port_command_and_reply(mute, reply, kind, words):
    device = mute([('A', reply)] * 100)
    with pytest.raises(kind, match=words) as caught:
        create('alicat', port=device.path, reply_timeout=0.05).open()
    assert type(caught.value) is kind
    assert f"port {device.path}, command 'A', reply b'{reply[:1]}"[:-1] in str(caught.value)
    device.close()


# --- settings of the device --------------------------------------------------------------------


def test_an_analog_source_is_detected_at_identification(emulated, opened):
    device, line = emulated('alicat')
    device.faults.add('analog_source')
    with pytest.raises(
        DeviceFault, match=r"source of the device is analogue.*'ALSS', reply 'A A'"
    ):
        opened('alicat', port=line.path)


def test_units_of_the_device_must_be_those_of_the_option(emulated, opened):
    device, line = emulated('alicat')
    device.faults.add('wrong_unit')
    with pytest.raises(ConfigError, match=r"units = 'kPa' is not allowed: .* set to PSIG.*'ALS'"):
        opened('alicat', port=line.path)


def test_an_old_firmware_receives_no_command_that_locks_its_panel(emulated, opened, until):
    device, line = emulated('alicat', firmware='7v09')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(50e3)
    until(lambda: regulator.read().setpoint == 50e3)
    assert not device.locked
    assert not [each for each in line.commands if each.startswith('AL')]


def test_a_device_that_rejects_units_is_set_without_them(emulated, opened, until):
    _, line = emulated('alicat')
    regulator = opened('alicat', port=line.path, set_command='S')
    regulator.set_pressure(50e3)
    until(lambda: regulator.read().setpoint == 50e3)
    assert 'AS50.00' in line.commands


# --- against the emulator ----------------------------------------------------------------------


def test_pressure_follows_and_vents(emulated, opened, until):
    _, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(75e3)
    until(lambda: abs(regulator.read().pressure - 75e3) < 100.0)
    with pytest.raises(LimitError):
        regulator.set_pressure(90_001.0)
    assert regulator.read().setpoint == 75e3
    regulator.vent()
    until(lambda: regulator.read().pressure < 100.0)


def test_an_unknown_firmware_counts_as_old(dialogue):
    device = dialogue([GREETING[0], ('AVE', '?\r'), ('A', 'A +000.00 +000.00\r')])
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    regulator.close()
    # Neither LS nor LSS is sent: these would lock the front panel of an old device.
    assert device.sent == 3
    assert device.problems == []


@pytest.mark.parametrize(
    ('firmware', 'kind', 'words'),
    [
        ('10v20', 'analog_source', '60.00 was sent, 0 is in force'),
        ('10v20', 'rejection', 'rejected'),
        ('8v17', 'echo', 'set-point of 60000 Pa is not in force'),
    ],
)
def test_a_setpoint_that_is_not_in_force_is_a_fault(
    emulated, opened, until, firmware, kind, words
):
    device, line = emulated('alicat', firmware=firmware)
    regulator = opened('alicat', port=line.path)
    device.faults.add(kind)
    regulator.set_pressure(60e3)
    fault = until(lambda: fault_of(regulator))
    assert line.path in fault
    assert words in fault
    assert regulator.read().setpoint == (30e3 if kind == 'echo' else 0.0)
    device.faults.clear()
    until(lambda: regulator.read().setpoint == 60e3)
    assert regulator.read().faults == ()


@pytest.mark.parametrize(
    ('reply', 'error', 'words'),
    [
        ('A +060.00 +060.00', ProtocolError, 'not have two numbers, a code and a unit'),
        ('B +060.00 +060.00 10 kPaG', ProtocolError, 'the reply is not of unit A'),
        ('A +060.00 +059.99 10 kPaG', DeviceFault, '60.00 was sent, 59.99 is in force'),
        ('A +008.70 +008.70 10 PSIG', ConfigError, 'the device is set to PSIG'),
        ('A +060.00 +060.00 10 kPaA', ConfigError, 'the device is set to kPaA'),
    ],
)
def test_the_answer_to_a_setpoint_names_value_and_unit(reply, error, words):
    regulator = create('alicat', port='/dev/somewhere')
    replies = dict(GREETING) | {'ALS 60.00 10': reply, 'AS0': 'A +000.00 +000.00'}
    commands = []

    def query(command):
        commands.append(command)
        return replies[command].strip()

    regulator.identify(query)
    with pytest.raises(error, match=re.escape(words)):
        regulator.send(query, 60e3)
    # Zero is the same pressure in all units.
    assert (commands[-1] == 'AS0') is (error is ConfigError)


def test_units_that_change_end_in_a_vent(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.faults.add('wrong_unit')
    regulator.set_pressure(70e3)
    until(lambda: 'AS0' in line.commands)
    with pytest.raises(ConfigError, match='the device is set to PSIG'):
        until(lambda: regulator.read() is None)
    assert device.valves['A'].setpoint == 0.0
    assert line.commands.count('ALS 70.00 10') == 1
    device.faults.clear()
    until(lambda: _answers(regulator))
    assert regulator.read().setpoint == 0.0


def _answers(regulator):
    try:
        return regulator.read()
    except ConfigError:
        return None


def test_a_device_that_loses_its_setpoint_receives_it_again(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.valves['A'].follow(20e3)  # changed by hand
    until(lambda: line.commands.count('ALS 60.00 10') == 2)
    until(lambda: regulator.read().setpoint == 60e3)
    assert device.valves['A'].setpoint == pytest.approx(60e3)
