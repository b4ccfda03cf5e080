# SPDX-License-Identifier: Apache-2.0
import os
import time

import pytest

from ros_pad.errors import TransportError
from ros_pad.regulators.emulate import (
    AlicatEmulator,
    Emulator,
    FaultSchedule,
    SerialTextEmulator,
    SmcItvEmulator,
    Valve,
)


def test_pressure_follows_with_one_time_constant(monkeypatch):
    now = 100.0
    monkeypatch.setattr(time, 'monotonic', lambda: now)
    valve = Valve()
    valve.follow(50e3)
    now += 0.1
    assert valve.pressure == pytest.approx(50e3 * 0.6321206)
    valve.follow(0.0)
    now += 0.1
    assert valve.pressure == pytest.approx(50e3 * 0.6321206 * 0.3678794)
    valve.follow(50e3, held=True)
    before = valve.pressure
    now += 1.0
    assert valve.pressure == before


def test_faults_act_at_their_times_and_addresses(monkeypatch):
    clock = iter([100.0, *[100.5] * 3, *[101.5] * 3, *[102.5] * 3, *[103.5] * 3, 104.0])
    monkeypatch.setattr(time, 'monotonic', lambda: next(clock))
    faults = FaultSchedule(('silence', 'echo'), ['silence@B:1:2', 'echo:3'])
    seen = []
    for _ in range(4):
        seen.append((faults.act('silence', 'A'), faults.act('silence', 'B'), faults.act('echo')))
    assert seen == [(0, 0, 0), (0, 1, 0), (0, 0, 0), (0, 0, 1)]
    faults.clear()
    assert not faults.act('echo')


def test_a_file_that_takes_the_link_is_kept_and_reported(until, tmp_path):
    link = tmp_path / 'regulator'
    device = SmcItvEmulator()
    emulator = Emulator(device, str(link))
    device.faults.add('unplugged')
    until(lambda: not os.path.lexists(link))
    link.write_text('mine')
    open_before = len(os.listdir('/proc/self/fd'))
    device.faults.clear()
    with pytest.raises(TransportError, match='cannot be plugged in: File exists'):
        emulator.wait()
    assert len(os.listdir('/proc/self/fd')) <= open_before
    emulator.close()  # does not raise the error again
    assert link.read_text() == 'mine'


@pytest.mark.parametrize('other', ['file', 'link', 'nothing'])
def test_a_link_that_was_replaced_is_kept(other, until, tmp_path):
    link = tmp_path / 'regulator'
    emulator = Emulator(SmcItvEmulator(), str(link))
    link.unlink()
    if other == 'file':
        link.write_text('mine')
    elif other == 'link':
        link.symlink_to('/dev/null')
    emulator.close()
    assert os.path.lexists(link) == (other != 'nothing')


def test_replies_of_an_alicat(monkeypatch):
    monkeypatch.setattr(Valve, 'TIME_CONSTANT', 1e-6)
    device = AlicatEmulator('AB')

    def reply(command):
        return device.answer(command)

    assert reply('C') is None  # no such unit
    assert reply('a') == ('A', 'A +000.00 +000.00')
    assert reply('AS75.00')[1].endswith(' +075.00')
    assert reply('ASx')[1] == reply('AS-1')[1] == reply('AS1000')[1] == reply('AWHAT')[1] == '?'
    assert reply('ALS 60.00 10')[1] == 'A +060.00 +060.00 10 kPaG'
    assert reply('ALS')[1] == 'A +060.00 +060.00 10 kPaG'
    assert reply('ALS 60.00 7')[1] == reply('ALS 60.00')[1] == reply('ALS 1000 10')[1] == '?'
    assert reply('AHP')[1].endswith(' HLD')
    assert not reply('AC')[1].endswith(' HLD')
    assert reply('BLSS')[1] == 'B S'
    assert AlicatEmulator(firmware='7v09').answer('ALSS')[1].endswith(' LCK')


def test_replies_of_a_board():
    device = SerialTextEmulator(channels=1)
    words = ['SET 1 2.5', 'READ 1', 'SET 1', 'SET 2 1.0', 'SET 1 x', '', 'WHAT 1 1']
    reply = [device.answer(each)[1] for each in words]
    assert reply[0] == 'OK 1 2.500'
    assert reply[1].startswith('1 1.')
    assert reply[2:] == ['ERROR'] * 5
