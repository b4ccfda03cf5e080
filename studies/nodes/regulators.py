# SPDX-License-Identifier: Apache-2.0
"""Measure the time of reading a serial regulator with ros_pad, and with pyserial alone.

Each device is emulated in a process of its own on a pseudo-terminal, which transfers characters
without delay: the time of the characters at the real baud rate is in the separate column *wire*.
For each backend, the columns are:

- bare: write and read_until of pyserial, for the lines that make one reading;
- reading: from one reading to the next when the bus does nothing else (``poll_period`` 0);
- set-point: from ``set_pressure`` until ``read`` returns this set-point;
- age: age of the reading that ``read`` returns in a loop of 50 Hz that serves all devices of the
bus;
- call: time that this loop waits for one ``set_pressure`` and one ``read``;
- ratio: the median of *reading* over that of *bare*.

The requirement is a reading in 20 ms: the exit status is 1 if the median of *reading* is longer
for any backend.
"""

from __future__ import annotations

import itertools
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import serial

from ros_pad.regulators import Regulator, create
from studies import command

PROMISED = 0.020  # s
CASES: dict[str, dict[str, Any]] = {
    'alicat, 1': {
        'emulator': ['alicat'],
        'devices': [{'unit_id': 'A'}],
        'lines': [b'A\r'],
        'end': b'\r',
        'baudrate': 19200,
    },
    'alicat, 6': {
        'emulator': ['alicat', '--unit-ids', 'ABCDEF'],
        'devices': [{'unit_id': each} for each in 'ABCDEF'],
        'lines': [b'A\r'],
        'end': b'\r',
        'baudrate': 19200,
    },
    'smc_itv, 1': {
        'emulator': ['smc_itv'],
        'devices': [{'full_scale': 100e3}],
        'lines': [b'REQ\r\n', b'MON\r\n'],
        'end': b'\r\n',
        'baudrate': 9600,
    },
    'serial_text, 6': {
        'emulator': ['serial_text'],
        'devices': [{'channel': each} for each in range(1, 7)],
        'lines': [b'READ 1\n'],
        'end': b'\n',
        'baudrate': 115200,
    },
}


def bare(port: str, case: dict[str, Any], count: int) -> tuple[list[float], int]:
    """Return the times of readings without ros_pad, s, and the number of characters of each."""
    times = []
    with serial.Serial(port, case['baudrate'], timeout=1.0, exclusive=True) as line:
        for _ in range(count):
            started = time.perf_counter()
            characters = 0
            for each in case['lines']:
                line.write(each)
                characters += len(each) + len(line.read_until(case['end']))
            times.append(time.perf_counter() - started)
    return times, characters


def readings(regulator: Regulator, count: int) -> list[float]:
    """Return the times from each reading to the next, s."""
    times = [regulator.read().time]
    while len(times) <= count:
        now = regulator.read().time
        if now != times[-1]:
            times.append(now)
        time.sleep(1e-5)
    return [after - before for before, after in itertools.pairwise(times)]


def setpoints(regulator: Regulator, count: int) -> list[float]:
    """Return the times from commanding a set-point until it is read back, s."""
    times = []
    for number in range(count):
        wanted = 20e3 if number % 2 else 40e3
        started = time.perf_counter()
        regulator.set_pressure(wanted)
        while not abs(regulator.read().setpoint - wanted) < 100.0:
            time.sleep(1e-5)
        times.append(time.perf_counter() - started)
    return times


def loop(regulators: Sequence[Regulator], seconds: float) -> tuple[list[float], list[float]]:
    """Return ages of readings and times of calls in a loop of 50 Hz, s."""
    ages, calls = [], []
    end = time.monotonic() + seconds
    number = 0
    while time.monotonic() < end:
        number += 1
        for each in regulators:
            started = time.monotonic()
            each.set_pressure(1e3 * (20 + number % 20))
            taken = each.read().time
            now = time.monotonic()
            ages.append(now - taken)
            calls.append(now - started)
        time.sleep(0.02)
    return ages, calls


def measure(case: dict[str, Any], count: int) -> tuple[dict[str, list[float]], float]:
    """Return all times of one backend, and the time of its characters at the baud rate, s."""
    with tempfile.TemporaryDirectory() as folder:
        port = str(pathlib.Path(folder) / 'port')
        words = ('emulate', *case['emulator'], '--link', port)
        emulator = subprocess.Popen(
            [sys.executable, '-m', 'ros_pad.cli', *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert emulator.stdout
        try:
            emulator.stdout.readline()
            alone, characters = bare(port, case, count)
            backend = case['emulator'][0]
            first = create(backend, port=port, poll_period=0.0, **case['devices'][0])
            first.open()
            between, after = readings(first, count), setpoints(first, max(1, count // 4))
            first.close()
            regulators = [create(backend, port=port, **each) for each in case['devices']]
            for each in regulators:
                each.open()
            ages, calls = loop(regulators, 0.02 * count / 5)
            for each in regulators:
                each.close()
        finally:
            emulator.terminate()
            emulator.wait()
    times = {'bare': alone, 'reading': between, 'set-point': after, 'age': ages, 'call': calls}
    return times, 10.0 * characters / case['baudrate']


def main(words: Sequence[str]) -> int:
    """Measure and print; return the exit status."""
    parser = command.parser('regulators', __doc__)
    command.add_count(parser, '--count', 500, 'readings of each backend')
    options = parser.parse_args(words)
    columns = ('bare', 'reading', 'set-point', 'age', 'call')
    document: dict[str, Any] = {}
    lines = [
        'median / 99 % in ms; wire: time of the characters at the baud rate',
        f'{"":15}' + ''.join(f'{each:>16}' for each in columns) + f'{"wire":>8}{"ratio":>8}',
    ]
    for name in command.each(list(CASES), 'regulators', 'device'):
        found, wire = measure(CASES[name], options.count)
        middle = {each: statistics.median(found[each]) for each in columns}
        late = {each: float(np.percentile(found[each], 99.0)) for each in columns}
        document[name] = {'median_s': middle, 'percentile_99_s': late, 'wire_s': wire}
        cells = ''.join(f'{1e3 * middle[each]:8.3f} /{1e3 * late[each]:6.2f}' for each in columns)
        ratio = middle['reading'] / middle['bare']
        lines.append(f'{name:15}{cells}{1e3 * wire:8.1f}{ratio:8.2f}')
    command.show(options, document, '\n'.join(lines))
    return int(any(each['median_s']['reading'] > PROMISED for each in document.values()))
