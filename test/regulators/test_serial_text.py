# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from ros_pad.errors import ConfigError, DeviceFault, ProtocolError
from ros_pad.regulators import Regulator, create

SLOW = {'poll_period': 1.0, 'silence': 10.0, 'reply_timeout': 1.0}
COUNT = 100e3 / 1023  # Pa, of an SMC ITV


def test_commands_to_set_read_and_vent(dialogue, until):
    device = dialogue(
        [
            ('READ 3', '3 1.040\n'),
            *[('SET 3 3.750', 'OK 3 3.750\n'), ('READ 3', '3 3.96\n')],
            *[('SET 3 0.000', 'OK 3 0\n'), ('READ 3', '3 3.9\n')],
        ],
        '\n',
    )
    regulator = create('serial_text', port=device.path, channel=3, **SLOW)
    assert isinstance(regulator, Regulator)
    regulator.open()
    assert regulator.read().pressure == pytest.approx(1e3)
    assert math.isnan(regulator.read().setpoint)  # the board does not report it
    regulator.set_pressure(75e3)
    until(lambda: regulator.read().setpoint == 75e3)
    assert regulator.read().pressure == pytest.approx(74e3)
    assert regulator.read().faults == ()
    regulator.close()


def test_a_board_with_other_templates_counts_and_no_reply(dialogue, until):
    # Counts have 12 bit, the count of a command falls with pressure, and commands have no reply.
    device = dialogue(
        [
            ('p2?', 'p2=+204.8\r\n'),
            *[('p2!1024', ''), ('p2?', 'p2=819.2\r\n')],
            *[('p2!4095', ''), ('p2?', 'p2=8e2\r\n')],
        ],
        '\r\n',
    )
    regulator = create(
        'serial_text',
        port=device.path,
        channel=2,
        set_template='p{channel}!{value:d}',
        set_reply='',
        read_template='p{channel}?',
        read_reply='p{channel}={value}',
        terminator='\r\n',
        command_zero=4095.0,
        command_full=0.0,
        monitor_zero=204.8,
        monitor_full=1024.0,
        full_scale=200e3,
        ceiling=180e3,
        **SLOW,
    )
    regulator.open()
    assert regulator.read().pressure == pytest.approx(0.0)
    regulator.set_pressure(150e3)
    until(lambda: regulator.read().setpoint > 0.0)
    assert regulator.read().setpoint == pytest.approx(3071 / 4095 * 200e3)
    assert regulator.read().pressure == pytest.approx(150e3)
    regulator.close()


@pytest.mark.parametrize('reply', ['', '2 1.0', '1 1.0 V', '1 nan', '1 1e999'])
def test_an_invalid_reading_is_refused_with_port_command_and_reply(reply):
    regulator = create('serial_text', port='/dev/somewhere')
    with pytest.raises(ProtocolError, match='the reply does not match') as caught:
        regulator.poll(lambda command: reply)
    assert f"port /dev/somewhere, command 'READ 1', reply {reply!r}" in str(caught.value)


@pytest.mark.parametrize(
    ('kind', 'words'),
    [('rejection', "reply 'ERROR'"), ('echo', '3.000 was sent, 1.5 is in force')],
)
def test_a_setpoint_that_is_not_in_force_is_a_fault(emulated, opened, until, kind, words):
    device, line = emulated('serial_text')
    regulator = opened('serial_text', port=line.path)
    device.faults.add(kind)
    regulator.set_pressure(60e3)
    fault = until(lambda: next(iter(regulator.read().faults), None))
    assert words in fault
    assert line.path in fault
    assert math.isnan(regulator.read().setpoint)
    device.faults.clear()
    until(lambda: regulator.read().setpoint == 60e3)
    assert regulator.read().faults == ()


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        ({'set_template': 'SET {channel}'}, '1 {value} is needed'),
        ({'read_template': 'READ {value}'}, '0 {value} is needed'),
        ({'set_template': 'SET {value:d}'}, 'its step is 20000 Pa, and at most a tenth'),
        ({'command_zero': 0.0001}, 'has 3 decimals, which must express the value of a vent'),
        ({'command_zero': 5.0}, 'must differ from command_zero'),
        ({'terminator': ''}, '1 to 4 ASCII'),
        ({'set_reply': '', 'setpoint_template': 'REQ'}, '1 {value} is needed'),
        ({'full_scale': 50e3}, 'from 1 to 50000 Pa'),
    ],
)
def test_bad_options_name_what_is_allowed(options, words):
    with pytest.raises(ConfigError) as caught:
        create('serial_text', port='somewhere', **options)
    assert words in str(caught.value)


# --- SMC ITV ----------------------------------------------------------------------------------


def test_commands_of_an_itv(dialogue, until):
    device = dialogue(
        [
            *[('REQ', '0\r\n'), ('MON', '3\r\n')],
            *[('SET 613', '613\r\n'), ('REQ', '613\r\n'), ('MON', '600\r\n')],  # of 613.8
            *[('SET 0', '0\r\n'), ('REQ', '0\r\n'), ('MON', '550\r\n')],
        ],
        '\r\n',
    )
    regulator = create('smc_itv', port=device.path, full_scale=100e3, ceiling=60e3, **SLOW)
    regulator.open()
    assert regulator.read().pressure == pytest.approx(3 * COUNT)
    regulator.set_pressure(60e3)  # the nearest setting is above the ceiling
    until(lambda: regulator.read().setpoint > 0.0)
    assert regulator.read().setpoint == pytest.approx(613 * COUNT)
    assert regulator.read().pressure == pytest.approx(600 * COUNT)
    assert regulator.read().faults == ()
    regulator.close()


@pytest.mark.parametrize('reply', ['', '-1', '5.0', 'OK', '²'])
def test_a_count_of_an_itv_is_a_whole_number(reply):
    regulator = create('smc_itv', port='/dev/somewhere', full_scale=100e3)
    with pytest.raises(ProtocolError, match='the reply does not match') as caught:
        regulator.poll(lambda command: reply)
    assert f"port /dev/somewhere, command 'REQ', reply {reply!r}" in str(caught.value)


@pytest.mark.parametrize('garbled', ['REQ', 'MON', 'SET 512'])
def test_a_count_of_an_itv_beyond_full_scale_is_no_count(garbled):
    regulator = create('smc_itv', port='/dev/somewhere', full_scale=100e3)

    def query(command, reply=True):
        return '5512' if command == garbled else '1023'

    with pytest.raises(ProtocolError, match=f"from 0 to 1023: .*'{garbled}', reply '5512'"):
        regulator.send(query, 50e3) if garbled == 'SET 512' else regulator.poll(query)


def test_a_rejection_by_an_itv_is_a_fault_of_the_device():
    regulator = create('smc_itv', port='/dev/somewhere', full_scale=100e3)

    def query(command, reply=True):
        return 'UNKNOWN COMMAND'

    for call in (lambda: regulator.poll(query), lambda: regulator.send(query, 50e3)):
        with pytest.raises(DeviceFault, match='the device rejected the command: '):
            call()


def test_an_itv_that_is_set_by_its_analogue_input_is_a_fault(emulated, opened, until):
    device, line = emulated('smc_itv')
    regulator = opened('smc_itv', port=line.path, full_scale=100e3)
    device.faults.add('analog_source')
    regulator.set_pressure(60e3)
    fault = until(lambda: next(iter(regulator.read().faults), None))
    assert 'is not in force, but 0 Pa is' in fault and line.path in fault
    assert "regulator 'ITV'" in fault
    device.faults.clear()
    until(lambda: abs(regulator.read().setpoint - 60e3) < COUNT)
    assert regulator.read().faults == ()


def test_the_full_scale_of_an_itv_is_needed_and_the_ceiling_is_within_it():
    with pytest.raises(ConfigError, match="needs the option 'full_scale'"):
        create('smc_itv', port='somewhere')
    with pytest.raises(ConfigError, match=r'ceiling = 90000\.0 .* from 1 to 50000 Pa'):
        create('smc_itv', port='somewhere', full_scale=50e3)
