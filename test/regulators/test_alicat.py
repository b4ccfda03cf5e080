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
        ('bar', 'A +0.0000 +0.0000', 75e3, 'AS0.7500', 75e3),
        ('Pa', 'A +000000 +000000', 75e3, 'AS75000', 75e3),
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


def test_zero_is_sent_even_if_valves_are_not_released():
    regulator = create('alicat', port='/dev/somewhere')
    replies = dict(GREETING) | {
        'A': 'A +050.00 +060.00 HLD',
        'ALS 0.00 10': 'A +060.00 +000.00 10 kPaG',
        'AC': '?',
    }
    commands = []

    def query(command):
        commands.append(command)
        return replies[command].strip()

    regulator.identify(query)
    with pytest.raises(DeviceFault, match='rejected'):
        regulator.send(query, 0.0)
    assert commands[-2:] == ['ALS 0.00 10', 'AC']


def test_a_rejection_is_a_fault_and_the_old_setpoint_stays(dialogue, until):
    device = dialogue(
        [
            *GREETING,
            ('ALS 75.00 10', '?\r'),
            ('A', 'A +000.00 +000.00\r'),
            ('A', 'A +000.00 +000.00\r'),
        ]
    )
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    regulator.set_pressure(75e3)
    fault = until(lambda: fault_of(regulator))
    for part in ('rejected', device.path, "'ALS 75.00 10'", "'?'"):
        assert part in fault
    assert regulator.read().setpoint == 0.0
    regulator.close()


@pytest.mark.parametrize(
    ('reply', 'words'),
    [
        ('B +000.00 +000.00', 'the reply is not of unit A'),
        ('', 'the reply is not of unit A'),
        ('?', 'the reply is not of unit A'),
        ('A +000.00', 'numbers found: 1'),
        ('A +000.00 +000.00 +023.40', 'numbers found: 3'),
        ('A +000.00 +000.00 WHAT', 'the reply is not a frame'),
        ('A +000.00 HLD +000.00', 'the reply is not a frame'),
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
        ('', TransportError, 'no reply within 0.05 s'),
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


def test_unexpected_bytes_are_an_error_and_discarded(dialogue):
    device = dialogue(
        [
            GREETING[0],
            ('AVE', 'A   10v20.0-R24\rA +011.11 +022.22\r'),
            *GREETING,  # identified again
            ('A', 'A +000.00 +000.00\r'),
        ]
    )
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    assert regulator.read().pressure == 0.0
    regulator.close()


# --- scripts must detect errors of a driver ----------------------------------------------------


def test_a_script_detects_replies_that_are_left_unread(mute):
    device = mute([*GREETING, ('A', 'A +000.00 +000.00\rmore')])
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    regulator.close()
    device.close()
    (problem,) = device.problems
    assert '4 bytes' in problem


def test_a_script_detects_a_wrong_command_and_a_missing_one(mute):
    device = mute([*GREETING, ('A', 'A +000.00 +000.00\r'), ('AS1.00', '?\r')])
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    regulator.close()
    device.close()
    assert device.problems == ["never received 'AS1.00\\r'"]
    device = mute([('A', 'A +000.00 +000.00\r'), ('AWRONG', '?\r')])
    with pytest.raises(TransportError):
        create('alicat', port=device.path, **SLOW).open()
    device.close()
    assert "received 'AVE\\r', the script has 'AWRONG\\r'" in device.problems


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


def test_nothing_is_ever_saved(emulated, opened, until):
    _, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    for pressure in (10e3, 20e3, 0.0, 30e3):
        regulator.set_pressure(pressure)
        until(lambda pressure=pressure: regulator.read().setpoint == pressure)
    regulator.vent()
    until(lambda: regulator.read().setpoint == 0.0)
    words = {each.split()[0] for each in line.commands}
    assert words == {'A', 'AVE', 'ALS', 'ALSS'}


@pytest.mark.parametrize(
    ('name', 'value', 'allowed'),
    [
        ('unit_id', 'a', 'one letter from A to Z'),
        ('unit_id', 'AB', 'one letter from A to Z'),
        ('unit_id', 1, 'one letter from A to Z'),
        ('units', 'torr', 'one of Pa, hPa, kPa'),
        ('baudrate', 19.2, '300 to 4000000'),
        ('baudrate', 0, '300 to 4000000'),
        ('ceiling', 0.5, '1 to 10000000 Pa'),
        ('reply_timeout', 0.0, '0.005 to 5 s'),
        ('poll_period', -1.5, '0 to 1 s'),
        ('silence', float('nan'), '0.05 to 10 s'),
        ('port', '', 'the name of a serial port'),
    ],
)
def test_bad_options_name_value_and_range(name, value, allowed):
    with pytest.raises(ConfigError) as caught:
        create('alicat', **{'port': 'somewhere', name: value})
    for part in ('alicat', name, str(value), allowed):
        assert part in str(caught.value)


# --- against the emulator ----------------------------------------------------------------------


def test_pressure_follows_and_vents(emulated, opened, until):
    _, line = emulated('alicat', time_constant=0.02)
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(75e3)
    until(lambda: abs(regulator.read().pressure - 75e3) < 100.0)
    with pytest.raises(LimitError):
        regulator.set_pressure(90_001.0)
    assert regulator.read().setpoint == 75e3
    regulator.vent()
    until(lambda: regulator.read().pressure < 100.0)


def test_status_tokens_are_faults(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    found = {}
    for token, words in STATUS.items():
        device.faults.add(f'status={token}')
        expected = () if token == 'LCK' else (words,)
        until(lambda expected=expected: regulator.read().faults == expected)
        found[token] = regulator.read().faults
        device.faults.clear()
        until(lambda: regulator.read().faults == ())
    # Only a locked panel is no fault.
    assert {token for token, faults in found.items() if not faults} == {'LCK'}


def test_an_unknown_firmware_counts_as_old(dialogue):
    device = dialogue([GREETING[0], ('AVE', '?\r'), ('A', 'A +000.00 +000.00\r')])
    regulator = create('alicat', port=device.path, **SLOW)
    regulator.open()
    regulator.close()
    # Neither LS nor LSS is sent: these would lock the front panel of an old device.
    assert device.sent == 3
    assert device.problems == []


@pytest.mark.parametrize(
    ('set_command', 'kind', 'words'),
    [
        ('LS', 'analog_source', '60.00 was sent, 0 is in force'),
        ('LS', 'echo', '60.00 was sent, 30 is in force'),
        ('LS', 'rejection', 'rejected'),
        ('S', 'analog_source', 'set-point of 60000 Pa is not in force'),
        ('S', 'echo', 'set-point of 60000 Pa is not in force'),
        ('S', 'rejection', 'rejected'),
    ],
)
def test_a_setpoint_that_is_not_in_force_is_a_fault(
    emulated, opened, until, set_command, kind, words
):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path, set_command=set_command)
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
        ('A +060.00 +nan 10 kPaG', ProtocolError, 'not have two numbers, a code and a unit'),
        ('A +060.00 +060.00 x kPaG', ProtocolError, 'not have two numbers, a code and a unit'),
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


@pytest.mark.parametrize(
    ('firmware', 'set_command', 'expected'),
    [
        ('10v20', 'auto', 'ALS 60.00 10'),
        ('9v00', 'auto', 'ALS 60.00 10'),
        ('8v17', 'auto', 'AS60.00'),
        ('10v20', 'S', 'AS60.00'),
        ('8v17', 'S', 'AS60.00'),
    ],
)
def test_which_command_sets(emulated, opened, until, firmware, set_command, expected):
    device, line = emulated('alicat', firmware=firmware)
    regulator = opened('alicat', port=line.path, set_command=set_command)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    assert expected in line.commands
    assert not device.locked


def test_a_vent_is_repeated_until_it_is_in_force(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.faults.add('rejection')
    regulator.vent()
    until(lambda: line.commands.count('ALS 0.00 10') > 2)
    assert 'rejected' in fault_of(regulator)
    device.faults.clear()
    until(lambda: regulator.read().setpoint == 0.0)


def test_a_device_that_loses_its_setpoint_receives_it_again(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.valves['A'].setpoint = 20e3  # changed by hand
    until(lambda: line.commands.count('ALS 60.00 10') == 2)
    until(lambda: regulator.read().setpoint == 60e3)
    assert device.valves['A'].setpoint == pytest.approx(60e3)


def test_valves_held_by_hand_are_released(emulated, opened, until):
    device, line = emulated('alicat', time_constant=0.02)
    regulator = opened('alicat', port=line.path)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().pressure > 59e3)
    device.valves['A'].held = True
    until(lambda: regulator.read().faults == (STATUS['HLD'],))
    regulator.vent()
    until(lambda: regulator.read().pressure < 1e3)
    assert not device.valves['A'].held
    assert 'AC' in line.commands
