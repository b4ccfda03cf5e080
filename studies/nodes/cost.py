# SPDX-License-Identifier: Apache-2.0
"""Processor time of nodes in real time, of a trial on nodes, of reading a bag, of the loop.

Another checkout of ros_pad with its own .venv, given by --against, is measured in turn with this
one. The ratios are those of the medians; processor times are those of all threads and children.

- live: five processes, six legs, and a floor: a bare publisher and one bare subscriber
- awake: the same while work of lowest priority keeps the cores awake, as other programs of a robot
  do; a core that sleeps between two messages finds its caches cold, and takes longer
- trial: pad run hexapod_patches on nodes, from start to report
- reading: the trial in a recorded bag, decoded to arrays
- loop: the closed loop without ROS on L2, per sample
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import os
import pathlib
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.figure import Figure

from ros_pad.commands.run import alone
from ros_pad.errors import PadError
from ros_pad.nodes import composed
from ros_pad.simulation.scene import Scene
from studies import command
from studies.drawing import BLUE
from studies.drawing import GREEN
from studies.drawing import ORANGE
from studies.drawing import PURPLE
from studies.drawing import SKY
from studies.drawing import STYLE
from studies.machine import memory
from studies.machine import processor_time

UNITS = {
    'live': 'processor time of all processes per second of wall time (s/s)',
    'awake': 'the same while the cores stay awake (s/s)',
    'trial': 'processor time of one run of the command (s)',
    'reading': 'processor time of reading one bag (s)',
    'loop': 'processor time of one sample (s)',
}
"""What each part measures."""

Result = dict[str, dict[str, dict[str, float]]]
"""Medians by part, checkout and quantity."""

OTHERS = ('rate', 'memory', 'wall')
"""Quantities that are no processor time: Hz, MB and s."""

_COLOURS = {
    **{'recorder': BLUE, 'regulator': ORANGE, 'estimator': SKY, 'controller': GREEN},
    **{'simulator': PURPLE, 'publish': '0.7', 'subscribe': '0.8'},
}

NODES = ('recorder', 'regulator', 'estimator', 'controller', 'simulator')
WARM_UP = 8.0  # s, until all nodes have found one another
_HERE = pathlib.Path(__file__).resolve().parents[2]

# These run in either checkout; the second name of the module is that of earlier versions.
_READING = """
import sys, time
try:
    from ros_pad.trials.recorded import load
except ImportError:
    from ros_pad.trials.bag import load
started = time.process_time()
load(sys.argv[1])
print(time.process_time() - started)
"""
_LOOP = """
import dataclasses, sys, time
from ros_pad.simulation.scene import Scene
from ros_pad.trials import run
scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=int(sys.argv[1]))
run(dataclasses.replace(scene, cycles=1), fidelity='L2')
started = time.process_time()
trial = run(scene, fidelity='L2')
print((time.process_time() - started) / len(trial.time))
"""
_RATE = """
import sys
from ros_pad.bags import BagReader
times = [time for _, _, time in BagReader(sys.argv[1]).messages(['/leg_1/wrench'])]
last = [time for time in times if time > times[-1] - 8e9]
print((len(last) - 1) / (last[-1] - last[0]) * 1e9)
"""


_AWAKE = """
import os
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
while True:
    pass
"""


@contextlib.contextmanager
def _awake() -> Iterator[None]:
    """Keep all cores awake."""
    loops = [subprocess.Popen([sys.executable, '-c', _AWAKE]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for each in loops:
            each.kill()
            each.wait()


def _environment() -> dict[str, str]:
    """Return the environment of the processes: a domain of their own, on this computer."""
    return os.environ | {
        'ROS_DOMAIN_ID': str(1 + os.getpid() % 100),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }


def _python(checkout: pathlib.Path) -> str:
    if checkout == _HERE:
        return sys.executable
    python = checkout / '.venv' / 'bin' / 'python'
    if not python.exists():
        raise PadError(f'{python}: is missing: run make run in {checkout} first')
    return os.fspath(python)


def _printed(checkout: pathlib.Path, code: str, *words: object) -> float:
    """Run code in a checkout, and return the number that it prints."""
    result = subprocess.run(
        [_python(checkout), '-c', code, *map(str, words)],
        cwd=checkout, env=_environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    if result.returncode:
        raise PadError(f'{checkout}: {result.stderr}')
    return float(result.stdout.split()[-1])


def _shares(commands: dict[str, list[str]], cwd: pathlib.Path, seconds: float) -> dict[str, float]:
    """Run processes; return the processor time of each, s/s, and the memory of all, MB."""
    processes = {
        name: subprocess.Popen(words, cwd=cwd, env=_environment(), stderr=subprocess.DEVNULL)
        for name, words in commands.items()
    }
    try:
        time.sleep(WARM_UP)
        before = {name: processor_time(each.pid) for name, each in processes.items()}
        started = time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - started
        shares = {
            name: (processor_time(each.pid) - before[name]) / passed
            for name, each in processes.items()
        }
        return shares | {'memory': sum(memory(each.pid) for each in processes.values())}
    finally:
        for each in processes.values():
            each.send_signal(signal.SIGINT)
        for each in processes.values():
            try:
                each.wait(20.0)
            except subprocess.TimeoutExpired:
                each.kill()


def live(checkout: pathlib.Path, seconds: float, rate: float) -> dict[str, float]:
    """Return the processor time a second of each node, memory, MB, and the reached rate, Hz."""
    with tempfile.TemporaryDirectory() as folder:
        bag = f'{folder}/bag'
        own = {'recorder': ('-p', f'folder:={bag}'), 'simulator': ('-p', f'rate:={rate}')}
        commands = {
            node: [
                *(_python(checkout), '-m', f'ros_pad.nodes.{node}', '--ros-args'),
                *('--params-file', os.fspath(checkout / 'config' / 'params.yaml')),
                *own.get(node, ()),
            ]
            for node in NODES
        }
        shares = _shares(commands, checkout, seconds)
        return shares | {'rate': _printed(_HERE, _RATE, bag)}


def floor(seconds: float) -> dict[str, float]:
    """Return the processor time a second of the bare publisher and the bare subscriber."""
    module = 'studies.nodes.floor'
    commands = {role: [sys.executable, '-m', module, role] for role in ('publish', 'subscribe')}
    return _shares(commands, _HERE, seconds)


def trial(checkout: pathlib.Path, cycles: int) -> dict[str, float]:
    """Return wall and processor time of ``pad run`` with report and comparison, s."""
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        started = time.monotonic()
        subprocess.run(
            [
                *(_python(checkout), '-m', 'ros_pad', 'run', 'hexapod_patches'),
                *('--cycles', str(cycles), '--out', f'{folder}/run'),
            ],
            cwd=checkout, env=_environment(), check=True, capture_output=True,
        )  # fmt: skip
        wall = time.monotonic() - started
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {'wall': wall, 'processor': used}


def _record(bag: str, cycles: int) -> None:
    """Record a walk of this checkout on nodes."""
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=cycles)
    with alone():
        composed.run(scene, bag=bag)


def _used(checkout: pathlib.Path, code: str, *words: object) -> dict[str, float]:
    return {'processor': _printed(checkout, code, *words)}


def _measures(
    options: argparse.Namespace, bag: str
) -> dict[str, Callable[[pathlib.Path], dict[str, float]]]:
    """Return a function for each part, which measures it in a checkout."""
    return {
        'live': lambda checkout: live(checkout, options.seconds, options.rate),
        'awake': lambda checkout: live(checkout, options.seconds, options.rate),
        'trial': lambda checkout: trial(checkout, options.cycles),
        'reading': lambda checkout: _used(checkout, _READING, bag),
        'loop': lambda checkout: _used(checkout, _LOOP, options.cycles),
    }


def _medians(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    return {name: statistics.median(row[name] for row in rows) for name in rows[0]}


def _measured(options: argparse.Namespace, bag: str) -> Result:
    """Measure all parts in turn; return medians by part and checkout."""
    checkouts = {'now': _HERE}
    if options.against:
        checkouts = {'before': options.against.resolve(), **checkouts}
    if 'reading' in options.parts:
        _record(bag, options.cycles)
    measures = _measures(options, bag)
    rows: dict[str, dict[str, list[dict[str, float]]]] = {}
    for part in command.each(options.parts * options.repeats, 'nodes', 'part'):
        of_part = rows.setdefault(part, {})
        with _awake() if part == 'awake' else contextlib.nullcontext():
            for name, checkout in checkouts.items():
                of_part.setdefault(name, []).append(measures[part](checkout))
            if part in ('live', 'awake'):
                of_part.setdefault('floor', []).append(floor(options.seconds))
    return {
        part: {name: _medians(each) for name, each in of_part.items()}
        for part, of_part in rows.items()
    }


def _total(values: dict[str, float]) -> float:
    """Return the processor time of a row."""
    return sum(value for name, value in values.items() if name not in OTHERS)


def ratio(rows: dict[str, dict[str, float]]) -> float:
    """Return the processor time now as a share of that before; live, of one sample."""
    now, before = (_total(rows[name]) / rows[name].get('rate', 1.0) for name in ('now', 'before'))
    return now / before


def table(result: Result) -> str:
    """Return the medians as text, with the ratios of the checkouts."""
    lines = []
    for part, rows in result.items():
        lines.append(f'{part:10}' + UNITS[part])
        for name, values in rows.items():
            each = '  '.join(f'{key} {value:.4g}' for key, value in values.items())
            lines.append(f'  {name:8}{_total(values):10.4g}   ({each})')
        if 'before' in rows:
            lines.append(f'  {"ratio":8}{ratio(rows):10.3f}')
    return '\n'.join(lines)


def chart(rows: dict[str, dict[str, float]]) -> Figure:
    """Draw the live processor time by process, as bars end to end."""
    widest = max(map(_total, rows.values()))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 1.2 + 0.4 * len(rows)), layout='constrained')
        axes = figure.subplots()
        for row, values in enumerate(rows.values()):
            left = 0.0
            parts = {name: value for name, value in values.items() if name not in OTHERS}
            for part, share in parts.items():
                axes.barh(row, share, left=left, color=_COLOURS[part], edgecolor='white')
                if share > 0.1 * widest:  # wide enough for the word
                    axes.text(left + share / 2, row, part, ha='center', va='center', fontsize=6.5)
                left += share
            rate = f' at {values["rate"]:.0f} Hz' if 'rate' in values else ''
            axes.text(left, row, f' {left:.2f}{rate}', va='center')
        axes.set_yticks(range(len(rows)), list(rows))
        axes.invert_yaxis()
        axes.set_xlabel('processor time of all processes per second (1 is one core)')
        axes.set_title('Five nodes in real time, six legs', loc='left')
        axes.margins(x=0.15)
    return figure


def main(words: Sequence[str]) -> int:
    """Measure, print the table, and write it with a picture; return the exit status."""
    parser = command.parser('nodes', __doc__)
    parser.add_argument('--against', type=pathlib.Path, metavar='DIR', help='the other checkout')
    parser.add_argument(
        '--parts', nargs='+', choices=UNITS, default=list(UNITS), help='what to measure'
    )
    command.add_count(parser, '--repeats', 5, 'measurements of each part')
    command.add_count(parser, '--cycles', 60, 'gait cycles of a walk')
    parser.add_argument(
        '--rate', type=float, default=250.0, help='samples a second, live, Hz (default: 250)'
    )
    parser.add_argument('--seconds', type=float, default=10.0, help='live time, s (default: 10)')
    command.add_out(parser)
    options = parser.parse_args(words)
    with tempfile.TemporaryDirectory() as folder:
        result = _measured(options, f'{folder}/bag')
    drawn = {
        f'{name}, awake' if part == 'awake' else name: values
        for part in ('live', 'awake')
        for name, values in result.get(part, {}).items()
    }
    pictures = {'nodes_live': chart(drawn)} if drawn else {}
    document = {'repeats': options.repeats, 'cycles': options.cycles, 'medians': result}
    kept = command.write(options.out, 'nodes', document, pictures)
    command.show(options, kept, table(result))
    return 0
