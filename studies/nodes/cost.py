# SPDX-License-Identifier: Apache-2.0
"""Time that trials and nodes take, beside another checkout of ros_pad.

The other checkout, with its own .venv, is given by --against, and measured in turn with this one.
Processor times are those of all threads and processes.

- loop: a third of the walk without ROS, from start to report
- trial: the walk on nodes in one process, with bag and report, from start to report
- live: five nodes in processes of their own, in real time, with six legs
"""

from __future__ import annotations

import argparse
import os
import pathlib
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from ros_pad.errors import PadError
from studies import command
from studies.drawing import BLUE, GREEN, ORANGE, PURPLE, SKY, STYLE
from studies.machine import memory, processor_time

NODES = {
    **{'estimator': SKY, 'controller': GREEN, 'regulator': ORANGE, 'recorder': BLUE},
    'simulator': PURPLE,
}
"""Nodes that run live, with the colour of each."""

PARTS = ('loop', 'trial', 'live')
WALL, PROCESSOR = 'wall time (s)', 'processor time (s)'
A_SAMPLE = 'processor time a sample (ms)'
RATE, MEMORY = 'samples a second', 'memory (MB)'

Result = dict[str, dict[str, dict[str, float]]]
"""Medians by part, checkout and quantity."""

WARM_UP = 8.0  # s, until all nodes have found one another
LONGEST = 60.0  # s, until the recorder has started, however slow the machine
_HERE = pathlib.Path(__file__).resolve().parents[2]

# Runs in either checkout.
_START = 'from ros_pad.nodes.start import {0}; {0}()'  # in older checkouts, too
_RATE = """
import sys
from ros_pad.bags import BagReader
bag = BagReader(sys.argv[1])
topic = next(each for each in ('/feet/sample', '/leg_1/wrench') if each in bag.topics)
times = [time for _, _, time in bag.messages([topic])]
last = [time for time in times if time > times[-1] - 1e9 * float(sys.argv[2])]
print((len(last) - 1) / (last[-1] - last[0]) * 1e9)
"""


def _python(checkout: pathlib.Path) -> str:
    if checkout == _HERE:
        return sys.executable
    python = checkout / '.venv' / 'bin' / 'python'
    if not python.exists():
        raise PadError(f'{python}: is missing: run make run in {checkout} first')
    return os.fspath(python)


def _environment(checkout: pathlib.Path) -> dict[str, str]:
    """Return the environment of the processes: a domain of their own, on this computer."""
    return os.environ | {
        'ROS_DOMAIN_ID': str(1 + os.getpid() % 100),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONPATH': os.pathsep.join(filter(None, (f'{checkout}', os.getenv('PYTHONPATH')))),
    }


def _printed(checkout: pathlib.Path, *words: object) -> str:
    """Run Python in a checkout, and return what it prints."""
    result = subprocess.run(
        [_python(checkout), *map(str, words)],
        cwd=checkout, env=_environment(checkout), capture_output=True, text=True, check=False,
    )  # fmt: skip
    if result.returncode:
        raise PadError(f'{checkout}: {result.stderr}')
    return result.stdout


def _walk(checkout: pathlib.Path, out: pathlib.Path, *words: object) -> dict[str, float]:
    """Return wall and processor time of ``pad run`` without comparison, from start to report."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    walk = ('run', 'hexapod_patches', '--no-compare', '--out', out)
    _printed(checkout, '-m', 'ros_pad', *walk, *words)
    wall, after = time.monotonic() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {WALL: wall, PROCESSOR: used}


def _shares(
    commands: dict[str, list[str]], checkout: pathlib.Path, bag: pathlib.Path, seconds: float
) -> dict[str, float]:
    """Run processes; return the processor time of each, s/s, and the memory of all, MB.

    Time counts from some seconds after there is a bag.
    """
    processes = {
        name: subprocess.Popen(
            words, cwd=checkout, env=_environment(checkout), stderr=subprocess.DEVNULL
        )
        for name, words in commands.items()
    }
    try:
        end = time.monotonic() + LONGEST
        while not (bag / 'metadata.yaml').exists() and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(WARM_UP)
        before = {name: processor_time(each.pid) for name, each in processes.items()}
        started = time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - started
        shares = {
            name: (processor_time(each.pid) - before[name]) / passed
            for name, each in processes.items()
        }
        return shares | {MEMORY: sum(memory(each.pid) for each in processes.values())}
    finally:
        for each in processes.values():
            each.send_signal(signal.SIGINT)
        for each in processes.values():
            try:
                each.wait(20.0)
            except subprocess.TimeoutExpired:
                each.kill()


def _live(checkout: pathlib.Path, bag: pathlib.Path, seconds: float) -> dict[str, float]:
    """Return the processor time a sample, ms, of all nodes and of each, memory, and the rate."""
    commands = {
        node: [
            *(_python(checkout), '-c', _START.format(node), '--ros-args'),
            *('--params-file', os.fspath(checkout / 'config' / 'params.yaml')),
            *(('-p', f'folder:={bag}') if node == 'recorder' else ()),
        ]
        for node in NODES
    }
    shares = _shares(commands, checkout, bag, seconds)
    reached = float(_printed(_HERE, '-c', _RATE, bag, seconds))
    each = {node: 1e3 * shares[node] / reached for node in NODES}
    return {A_SAMPLE: sum(each.values()), **each, RATE: reached, MEMORY: shares[MEMORY]}


def _measured(
    part: str, checkout: pathlib.Path, folder: pathlib.Path, options: argparse.Namespace
) -> dict[str, float]:
    """Return the quantities of a part; ``folder`` is an empty one that a checkout keeps."""
    if part == 'live':
        with tempfile.TemporaryDirectory(dir=folder) as own:
            return _live(checkout, pathlib.Path(own) / 'bag', options.seconds)
    short = part == 'loop'
    words = ['--cycles', max(1, options.cycles // 3) if short else options.cycles]
    with tempfile.TemporaryDirectory(dir=folder) as own:
        return _walk(checkout, pathlib.Path(own) / 'out', *words, *['--no-ros'] * short)


def measure(options: argparse.Namespace, folder: pathlib.Path) -> Result:
    """Measure all parts in turn; return medians."""
    checkouts = {'now': _HERE}
    if options.against:
        checkouts = {'before': options.against.resolve(), **checkouts}
    rows: dict[str, dict[str, list[dict[str, float]]]] = {}
    for part in command.each(options.parts * options.repeats, 'nodes', 'part'):
        for name, checkout in checkouts.items():
            own = folder / name
            own.mkdir(exist_ok=True)
            found = _measured(part, checkout, own, options)
            rows.setdefault(part, {}).setdefault(name, []).append(found)
    return {
        part: {
            name: {key: statistics.median(row[key] for row in each) for key in each[0]}
            for name, each in of_part.items()
        }
        for part, of_part in rows.items()
    }


def table(result: Result) -> str:
    """Return the medians as text."""
    return command.listed([
        {'part': part, 'checkout': name, **row}
        for part, rows in result.items()
        for name, row in rows.items()
    ])  # fmt: skip


def chart(rows: dict[str, dict[str, float]]) -> Figure:
    """Draw the processor time of a sample by node, as bars end to end."""
    widest = max(values[A_SAMPLE] for values in rows.values())
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 1.2 + 0.4 * len(rows)), layout='constrained')
        axes = figure.subplots()
        for row, values in enumerate(rows.values()):
            left = 0.0
            for node, colour in NODES.items():
                own = values[node]
                axes.barh(row, own, left=left, color=colour, edgecolor='white')
                if own > 0.1 * widest:  # wide enough for the word
                    axes.text(left + own / 2, row, node, ha='center', va='center', fontsize=6.5)
                left += own
            axes.text(left, row, f' {left:.2f} at {values[RATE]:.0f} Hz', va='center')
        axes.set_yticks(range(len(rows)), list(rows))
        axes.invert_yaxis()
        axes.set_xlabel('processor time of all nodes for a sample of six legs, ms')
        axes.set_title('Five nodes in real time', loc='left')
        axes.margins(x=0.15)
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, print the table, and write it with a picture; return the exit status."""
    parser = command.parser('nodes', __doc__)
    parser.add_argument('--against', type=pathlib.Path, metavar='DIR', help='the other checkout')
    parser.add_argument(
        '--parts', nargs='+', choices=PARTS, default=list(PARTS), help='what to measure'
    )
    command.add_count(parser, '--repeats', 5, 'measurements of each part')
    command.add_count(parser, '--cycles', 60, 'gait cycles of the walk')
    parser.add_argument('--seconds', type=float, default=10.0, help='live time, s (default: 10)')
    command.add_out(parser)
    options = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        result = measure(options, pathlib.Path(folder))
    pictures = {'nodes_live': chart(result['live'])} if 'live' in result else {}
    document = {'repeats': options.repeats, 'cycles': options.cycles, 'medians': result}
    kept = command.write(options.out, 'nodes', document, pictures)
    command.show(options, kept, table(result))
    return 0
