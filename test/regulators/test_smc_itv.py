# SPDX-License-Identifier: Apache-2.0
import pytest

from ros_pad.errors import ConfigError, DeviceFault, ProtocolError
from ros_pad.regulators import Regulator, create

SLOW = {'poll_period': 1.0, 'silence': 10.0, 'reply_timeout': 1.0}
COUNT = 100e3 / 1023


def test_commands_to_set_read_and_vent(dialogue, until):
    device = dialogue(
        [
            *[('REQ', '0\r\n'), ('MON', '3\r\n')],
            *[('SET 767', '767\r\n'), ('REQ', '767\r\n'), ('MON', '700\r\n')],
            *[('SET 0', '0\r\n'), ('REQ', '0\r\n'), ('MON', '650\r\n')],
        ],
        '\r\n',
    )
    regulator = create('smc_itv', port=device.path, full_scale=100e3, **SLOW)
    assert isinstance(regulator, Regulator)
    regulator.open()
    assert regulator.read().pressure == pytest.approx(3 * COUNT)
    regulator.set_pressure(75e3)
    until(lambda: regulator.read().setpoint > 0.0)
    assert regulator.read().setpoint == pytest.approx(767 * COUNT)
    assert regulator.read().pressure == pytest.approx(700 * COUNT)
    assert regulator.read().faults == ()
    regulator.close()


def test_a_setpoint_at_the_ceiling_is_rounded_down(dialogue, until):
    device = dialogue(
        [
            *[('REQ', '0\r\n'), ('MON', '0\r\n')],
            *[('SET 613', '613\r\n'), ('REQ', '613\r\n'), ('MON', '0\r\n')],  # 613.8 rounded down
            *[('SET 0', '0\r\n'), ('REQ', '0\r\n'), ('MON', '0\r\n')],
        ],
        '\r\n',
    )
    regulator = create('smc_itv', port=device.path, full_scale=100e3, ceiling=60e3, **SLOW)
    regulator.open()
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint > 0.0)
    assert regulator.read().faults == ()
    regulator.close()


@pytest.mark.parametrize('reply', ['', '-1', '5.0', 'OK', '²'])
def test_an_invalid_count_is_refused_with_port_command_and_reply(reply):
    regulator = create('smc_itv', port='/dev/somewhere', full_scale=100e3)
    with pytest.raises(ProtocolError, match='the reply does not match') as caught:
        regulator.poll(lambda command: reply)
    assert f"port /dev/somewhere, command 'REQ', reply {reply!r}" in str(caught.value)


def test_a_rejection_is_a_fault_of_the_device():
    regulator = create('smc_itv', port='/dev/somewhere', full_scale=100e3)
    with pytest.raises(
        DeviceFault, match=r"does not match set_reply: .* 'SET 512', reply 'UNKNOWN COMMAND'"
    ):
        regulator.send(lambda command, reply: 'UNKNOWN COMMAND', 50e3)


@pytest.mark.parametrize(
    ('kind', 'words'),
    [
        ('rejection', 'UNKNOWN COMMAND'),
        ('echo', '614 was sent, 307 is in force'),
        ('analog_source', 'is not in force, but 0 Pa is'),
    ],
)
def test_a_setpoint_that_is_not_in_force_is_a_fault(emulated, opened, until, kind, words):
    device, line = emulated('smc_itv')
    regulator = opened('smc_itv', port=line.path, full_scale=100e3)
    device.faults.add(kind)
    regulator.set_pressure(60e3)
    fault = until(lambda: next(iter(regulator.read().faults), None))
    assert words in fault
    assert line.path in fault
    device.faults.clear()
    until(lambda: abs(regulator.read().setpoint - 60e3) < COUNT)
    assert regulator.read().faults == ()


def test_bad_options_name_value_and_range():
    with pytest.raises(ConfigError, match="needs the option 'full_scale'"):
        create('smc_itv', port='somewhere')
    with pytest.raises(ConfigError, match=r'ceiling = 90000\.0 .* from 1 to 50000 Pa'):
        create('smc_itv', port='somewhere', full_scale=50e3)
