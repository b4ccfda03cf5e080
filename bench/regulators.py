# SPDX-License-Identifier: Apache-2.0
"""How long a serial regulator takes to be read, beside a bare write and read_until.

Run ``python bench/regulators.py``; prints a table. Each device is emulated in a process of its
own on a pseudo-terminal, which takes no time for its characters: what a real line adds at its
baud rate is a column of its own. In one run, for each backend:

- bare: pyserial alone, write and read_until, of the lines that make one reading;
- reading: from frame to frame when the bus does nothing else (``poll_period`` 0);
- set-point: from ``set_pressure`` until ``read`` has it;
- age: of what ``read`` returns in a loop of 50 Hz that serves every device on the bus;
- call: how long that loop waits for one ``set_pressure`` and one ``read``.

A reading is promised in 20 ms: the program ends with status 1 when its median takes longer.
"""

from __future__ import annotations

import argparse
import itertools
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from typing import Any

import serial

from ros_pad.regulators import Regulator
from ros_pad.regulators import create

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
    """Return what readings take without ros_pad, s, and the characters of one."""
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
    """Return the times from frame to frame, s."""
    times = [regulator.read().time]
    while len(times) <= count:
        now = regulator.read().time
        if now != times[-1]:
            times.append(now)
        time.sleep(1e-5)
    return [after - before for before, after in itertools.pairwise(times)]


def setpoints(regulator: Regulator, count: int) -> list[float]:
    """Return the times from a set-point to its reading, s."""
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


def measure(case: dict[str, Any], count: int) -> dict[str, list[float] | float]:
    """Return all figures of one backend."""
    with tempfile.TemporaryDirectory() as folder:
        port = str(pathlib.Path(folder) / 'port')
        command = [sys.executable, '-m', 'ros_pad.cli', 'emulate', *case['emulator']]
        emulator = subprocess.Popen(
            [*command, '--link', port], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        assert emulator.stdout
        try:
            emulator.stdout.readline()
            alone, characters = bare(port, case, count)
            backend = case['emulator'][0]
            first = create(backend, port=port, poll_period=0.0, **case['devices'][0])
            first.open()
            between, told = readings(first, count), setpoints(first, count // 4)
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
    return {
        'bare': alone,
        'reading': between,
        'set-point': told,
        'age': ages,
        'call': calls,
        'wire': 10.0 * characters / case['baudrate'],
    }


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=500, help='readings of each (500)')
    options = parser.parse_args()
    slow = False
    columns = ('bare', 'reading', 'set-point', 'age', 'call')
    print('median / 99 % in ms; wire: what characters take at the baud rate')
    print(f'{"":15}' + ''.join(f'{each:>16}' for each in columns) + f'{"wire":>8}{"ratio":>8}')
    for name, case in CASES.items():
        found = measure(case, options.count)
        cells, middle = '', {}
        for each in columns:
            times = sorted(found[each])
            middle[each] = statistics.median(times)
            late = times[int(0.99 * (len(times) - 1))]
            cells += f'{1e3 * middle[each]:8.3f} /{1e3 * late:6.2f}'
        ratio = middle['reading'] / middle['bare']
        print(f'{name:15}{cells}{1e3 * found["wire"]:8.1f}{ratio:8.2f}')
        slow = slow or middle['reading'] > PROMISED
    return int(slow)


if __name__ == '__main__':
    sys.exit(main())
