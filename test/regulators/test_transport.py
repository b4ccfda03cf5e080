# SPDX-License-Identifier: Apache-2.0
"""Regulators on one port share its thread, and no call waits for a reply."""

import sys
import threading
import time
from types import SimpleNamespace

import pytest
from shared import python

from ros_pad.errors import ConfigError, PadError, ProtocolError, TransportError
from ros_pad.regulators import create, serial_device

QUICK = {'reply_timeout': 0.1, 'silence': 1.0}


def raised(call):
    """Return the error that a call raises, or None."""
    try:
        call()
    except PadError as error:
        return error
    return None


def threads():
    return [each for each in threading.enumerate() if each.name.startswith('serial port')]


def test_regulators_on_one_bus_share_port_and_thread(emulated, opened, until):
    _, line = emulated('alicat', unit_ids='ABCDEF')
    feet = [opened('alicat', port=line.path, unit_id=each) for each in 'ABCDEF']
    assert len(threads()) == 1
    for number, foot in enumerate(feet):
        foot.set_pressure(10e3 * (number + 1))
    for number, foot in enumerate(feet):
        wanted = 10e3 * (number + 1)
        until(lambda foot=foot, wanted=wanted: abs(foot.read().pressure - wanted) < 100.0)
    feet[0].close()
    feet[1].vent()
    until(lambda: feet[1].read().setpoint == 0.0)
    for foot in feet:
        foot.close()
        foot.close()  # may be repeated
    assert not threads()


def test_a_port_has_one_line_setting_and_each_address_once(emulated, opened):
    _, line = emulated('alicat', unit_ids='AB')
    opened('alicat', port=line.path)
    with pytest.raises(ConfigError, match=r'open with .*19200.*38400.* cannot share it'):
        opened('alicat', port=line.path, unit_id='B', baudrate=38400)
    with pytest.raises(ConfigError, match="has a device 'A' already"):
        opened('alicat', port=line.path)
    opened('alicat', port=line.path, unit_id='B').read()


def test_nothing_waits_for_the_line(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path, reply_timeout=2.0, silence=10.0)
    regulator.set_pressure(10e3)
    until(lambda: regulator.read().setpoint == 10e3)
    device.faults.add('silence')
    received = len(line.commands)
    until(lambda: len(line.commands) > received)  # the thread waits 2 s for an answer now
    received = len(line.commands)
    for _ in range(100):
        regulator.read()
        regulator.set_pressure(20e3)
    regulator.vent()
    assert len(line.commands) == received  # all calls returned meanwhile
    device.faults.clear()


def test_a_vent_is_sent_before_other_commands(emulated, opened, until):
    device, line = emulated('alicat', unit_ids='ABCDEF')
    feet = {
        each: opened('alicat', port=line.path, unit_id=each, reply_timeout=1.0, silence=10.0)
        for each in 'ABCDEF'
    }
    for foot in feet.values():
        foot.set_pressure(50e3)
    for foot in feet.values():
        until(lambda foot=foot: foot.read().setpoint == 50e3)
    device.faults.add('silence@A')
    received = len(line.commands)
    until(lambda: 'A' in line.commands[received:])
    # While the thread waits for A, set-points are requested; the vent is the last request.
    for each in 'BCDE':
        feet[each].set_pressure(60e3)
    feet['F'].vent()
    until(lambda: 'FLS 0.00 10' in line.commands)
    orders = ('BLS 60.00 10', 'ELS 60.00 10', 'FLS 0.00 10')
    assert next(each for each in line.commands if each in orders) == orders[-1]
    device.faults.clear()


@pytest.mark.parametrize('kind', ['silence', 'wrong_id'])
def test_a_device_that_is_lost_is_vented_when_it_is_back(emulated, opened, until, kind):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path, **QUICK)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.faults.add(kind)
    error = until(lambda: raised(regulator.read))
    assert isinstance(error, (TransportError, ProtocolError))
    for part in (line.path, 'command', 'reply'):
        assert part in str(error)
    # Set-points are refused, not kept for later.
    assert raised(lambda: regulator.set_pressure(70e3))
    assert raised(regulator.vent)
    device.faults.clear()
    until(lambda: raised(regulator.read) is None)
    until(lambda: regulator.read().setpoint == 0.0)
    assert line.commands.count('ALSS') > 1  # identified again: it may be another device
    regulator.set_pressure(30e3)
    until(lambda: regulator.read().setpoint == 30e3)


def test_a_lost_device_is_tried_ever_more_rarely(monkeypatch):
    monkeypatch.setattr(serial_device, 'time', SimpleNamespace(monotonic=lambda: 0.0))
    regulator = create('serial_text', port='/dev/nowhere', poll_period=0.02)

    def silent(command):
        raise ConfigError('lost')

    pauses = [0.05, 0.1, 0.2, 0.4, 0.8, 1.0, 1.0]
    assert [regulator.take_turn(silent) for _ in pauses] == pytest.approx(pauses)
    assert regulator.take_turn(lambda command: '1 1.0') == 0.02
    assert regulator.take_turn(silent) == 0.05


def test_one_bad_reply_is_no_fault(emulated, opened, until):
    device, line = emulated('alicat')
    regulator = opened('alicat', port=line.path, reply_timeout=0.2, silence=10.0)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    for kind in ('silence', 'half_line', 'garbage'):
        device.faults.add(kind)
        received = len(line.commands)
        until(lambda received=received: len(line.commands) > received)
        device.faults.clear()
        now = time.monotonic()
        until(lambda now=now: regulator.read().time > now)
        assert regulator.read().setpoint == 60e3
    assert line.commands.count('ALS 0.00 10') == 0


def test_unplugged_in_mid_run_and_back(emulated, opened, until, tmp_path):
    device, line = emulated('alicat', link=str(tmp_path / 'regulator'))
    regulator = opened('alicat', port=line.path, **QUICK)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.faults.add('unplugged')
    error = until(lambda: raised(regulator.read))
    assert isinstance(error, TransportError)
    assert line.path in str(error)
    until(lambda: 'cannot be opened' in str(raised(regulator.read)))
    device.faults.clear()
    until(lambda: raised(regulator.read) is None)
    until(lambda: regulator.read().setpoint == 0.0)
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    assert len(threads()) == 1


def test_closing_vents_and_raises_if_it_cannot(emulated, until):
    device, line = emulated('alicat')
    regulator = create('alicat', port=line.path, **QUICK)
    regulator.open()
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    regulator.close()
    assert device.valves['A'].setpoint == 0.0
    regulator.open()
    regulator.set_pressure(60e3)
    until(lambda: regulator.read().setpoint == 60e3)
    device.faults.add('rejection')
    with pytest.raises(PadError, match=r'closed without a confirmed vent: .*rejected'):
        regulator.close()
    assert not threads()
    device.faults.clear()
    device.faults.add('silence')
    with pytest.raises(TransportError, match=r'no reply within 0\.1 s'):
        regulator.open()
    assert not threads()


def test_a_closed_regulator_accepts_nothing(emulated):
    _, line = emulated('alicat')
    regulator = create('alicat', port=line.path)
    for call in (regulator.read, regulator.vent, lambda: regulator.set_pressure(1e3)):
        assert 'is not open' in str(raised(call))
    regulator.close()


def test_without_pyserial_the_error_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, 'serial', None)
    with pytest.raises(TransportError, match='pip install pyserial'):
        create('alicat', port='/dev/nowhere').open()


def test_a_port_that_is_missing_or_in_use_is_an_error(emulated, opened):
    with pytest.raises(
        TransportError, match=r'port /dev/nowhere cannot be opened: .*No such file'
    ):
        create('alicat', port='/dev/nowhere').open()
    _, line = emulated('alicat')
    opened('alicat', port=line.path)
    code = f'from ros_pad.regulators import create; create("alicat", port="{line.path}").open()'
    other = python('-c', code)
    assert 'TransportError' in other.stderr
    assert 'lock' in other.stderr
