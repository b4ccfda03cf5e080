# SPDX-License-Identifier: Apache-2.0
"""Send two signals at random moments to each node and to ``pad run``; check how they end.

The pairs are SIGINT twice, and SIGINT and SIGTERM in either order. The first signal comes at a
random moment between the time when the process begins to handle signals, with its first import,
and its work (for ``pad run``, the end of a short walk); the second one follows after 1 ms to 1 s,
so that some hit the end of Python. Before that time Python itself starts, and a signal has the
effect that it has on every program in Python; the table shows how long this takes.

A try is good when the process ends within 10 s with status 0 or 130, without a traceback, and

- the bag of the recorder and of ``pad run`` is closed, if there is one;
- the last pressures in the bag of ``pad run`` are those of vented pads;
- the regulator leaves every device vented. Its devices are emulated on a pseudo-terminal, and get
  set-points from this process.

The target ``group`` is what ``ros2 launch`` does without a terminal: five nodes in one process
group, which gets the first signal; each node gets the second one, too. The target ``launch`` is
the launch file itself, where ``ros2 launch`` is installed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import rclpy
from rclpy.node import Node

from ros_pad.bags import BagReader, topics
from ros_pad.bags.wire import Wire
from ros_pad.commands.progress import bar
from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.errors import BagError
from ros_pad.nodes import qos
from ros_pad.nodes.parameters import LEGS
from ros_pad.records import COMMAND, PRESSURE, Block
from ros_pad.regulators.emulate import AlicatEmulator, Emulator
from studies import command

NODES = ('recorder', 'regulator', 'estimator', 'controller', 'simulator')
TARGETS = (*NODES, 'pad', 'group', 'launch')
PAIRS = (
    (signal.SIGINT, signal.SIGINT),
    (signal.SIGINT, signal.SIGTERM),
    (signal.SIGTERM, signal.SIGINT),
)
STATUSES = (0, 130)
WORK = {'group': 12.0, 'launch': 12.0}  # time in which the first signal comes, s; else:
WORK_OF_NODE = 8.0
SHORTEST, LONGEST = 1e-3, 1.0  # between two signals, s
PATIENCE = 10.0  # for the end of a process, s
START = 60.0  # for the start of Python, s
GAUGE = 40e3  # Pa
_WALK = ('run', 'hexapod_patches', '--policy', 'dome', '--no-compare', '--cycles', '1')


@dataclasses.dataclass
class Try:
    """Two signals to one target, and what followed.

    Attributes
    ----------
    target : str
        One of :data:`TARGETS`.
    pair : tuple of signal.Signals
        The signals.
    first, gap : float
        Time from the begin of the handling of signals to the first signal, and from that to the
        second one, s.
    python : float
        Time from the start to the begin of the handling of signals, s.
    ending : float
        Time from the first signal to the end, s.
    statuses : list of int
        Exit status of each process; 130 of a node: it was still in its imports.
    reached : bool
        Whether there was something to close: a bag, or a pad under pressure.
    problems : list of str
        What was not as it must be.
    errors : str
        Standard error of the processes.
    """

    target: str
    pair: tuple[signal.Signals, signal.Signals]
    first: float
    gap: float
    python: float = 0.0
    ending: float = 0.0
    statuses: list[int] = dataclasses.field(default_factory=list)
    reached: bool = False
    problems: list[str] = dataclasses.field(default_factory=list)
    errors: str = ''


# --- processes -----------------------------------------------------------------------------------


def script(name: str) -> str:
    """Return the path of a console script."""
    return str(pathlib.Path(sys.executable).parent / name)


def words_of(name: str, *parameters: str) -> list[str]:
    """Return the command of a node."""
    given = [word for each in parameters for word in ('-p', each)]
    return [script(f'{name}_node'), '--ros-args', *given]


def _handles_signals(child: subprocess.Popen[bytes]) -> bool:
    """Return whether a process handles SIGTERM, or has ended."""
    if child.poll() is not None:
        return True
    lines = pathlib.Path(f'/proc/{child.pid}/status').read_text(encoding='ascii').splitlines()
    (caught,) = (int(line.split()[1], 16) for line in lines if line.startswith('SigCgt:'))
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def perform(
    one: Try,
    commands: Sequence[Sequence[str]],
    folder: pathlib.Path,
    reached: Callable[[], bool] = lambda: False,
) -> None:
    """Start the commands in one process group, send the signals, and wait for the end.

    Parameters
    ----------
    one : Try
        Gets what happens.
    commands : sequence of commands
        Words of each process.
    folder : path
        Working directory.
    reached : callable
        Called before the first signal: whether there is something to close.

    Raises
    ------
    TimeoutError
        When a process does not handle signals in time.
    """
    begin = time.monotonic()
    with contextlib.ExitStack() as stack:
        errors = stack.enter_context((folder / 'errors').open('w+', encoding='utf-8'))
        children: list[subprocess.Popen[bytes]] = []
        for words in commands:
            group = children[0].pid if children else 0
            child = subprocess.Popen(
                words, stdout=subprocess.DEVNULL, stderr=errors, cwd=folder, process_group=group
            )
            children.append(child)
        for child in children:
            stack.callback(child.kill)
        while not all(map(_handles_signals, children)):
            if time.monotonic() > begin + START:
                raise TimeoutError(f'{commands[0]}: does not handle signals after {START:g} s')
            time.sleep(1e-3)
        one.python = time.monotonic() - begin
        time.sleep(one.first)
        one.reached = reached()
        sent = time.monotonic()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(children[0].pid, one.pair[0])
        time.sleep(one.gap)
        for child in children:
            child.send_signal(one.pair[1])
        for words, child in zip(commands, children, strict=True):
            name = words[0]
            try:
                status = child.wait(max(0.1, sent + PATIENCE - time.monotonic()))
            except subprocess.TimeoutExpired:
                one.problems.append(f'{name}: no end after {PATIENCE:g} s')
                continue
            one.statuses.append(status)
            if status not in STATUSES:
                one.problems.append(f'{name}: exit status {status}')
        one.ending = time.monotonic() - sent
        errors.seek(0)
        one.errors = errors.read()
    for word in ('Traceback', 'terminate called', 'Exception ignored', 'Fatal'):
        if word in one.errors:
            one.problems.append(f'{word!r} on stderr')


class Commander:
    """Sends set-points to all legs in a thread, while the context is entered."""

    def __enter__(self) -> None:
        rclpy.init(args=[])
        self._node = Node('commander', start_parameter_services=False, enable_rosout=False)
        self._publisher = qos.publisher(self._node, topics.COMMAND)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._publish, daemon=True)
        self._thread.start()

    def _publish(self) -> None:
        wire, rows = Wire(COMMAND, LEGS.default), COMMAND.rows(len(LEGS.default))
        rows['setpoint'] = GAUGE
        while not self._end.wait(0.02):
            self._publisher.publish(wire.encode(Block.of(time.time_ns(), rows)))

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown()


# --- targets -------------------------------------------------------------------------------------


def check_bag(one: Try, bag: pathlib.Path) -> None:
    """Add to the try whether there is a bag, and what is wrong with it."""
    one.reached = bag.exists()
    if not one.reached:
        return
    try:
        reader = BagReader(bag)
    except BagError as error:
        one.problems.append(str(error))
        return
    if reader.problem:
        one.problems.append(reader.problem)
    if one.target == 'pad':
        name = f'/{topics.PRESSURE.name()}'
        legs, _, block = reader.records({name: PRESSURE}).get(name, ((), None, None))
        last = block.rows[-1]['pressure'].tolist() if block and len(block.stamps) else []
        one.problems += [
            f'leg {leg}: last pressure {gauge:g} Pa'
            for leg, gauge in zip(legs, last, strict=False)
            if gauge >= DOME_PRESSURE
        ]


def _regulator(one: Try, folder: pathlib.Path) -> None:
    ids = 'ABCDEF'
    device = AlicatEmulator(ids)

    def filled() -> bool:
        return any(valve.setpoint > 0.0 for valve in device.valves.values())

    with Emulator(device) as line:
        parameters = (
            'backend:=alicat',
            f'backend_options.port:={line.path}',
            f'backend_options.unit_id:=[{",".join(ids)}]',
        )
        perform(one, [words_of('regulator', *parameters)], folder, filled)
        if filled():
            one.problems.append('a device was not vented')


def _recorder(one: Try, folder: pathlib.Path) -> None:
    perform(one, [words_of('recorder', 'folder:=bag')], folder)
    check_bag(one, folder / 'bag')


def _pad(one: Try, folder: pathlib.Path) -> None:
    perform(one, [[script('pad'), *_WALK, '--out', 'out']], folder)
    check_bag(one, folder / 'out' / 'bag')


def _group(one: Try, folder: pathlib.Path) -> None:
    own = {'recorder': ('folder:=bag',)}
    perform(one, [words_of(name, *own.get(name, ())) for name in NODES], folder)
    check_bag(one, folder / 'bag')


def _launch(one: Try, folder: pathlib.Path) -> None:
    file = command.ROOT / 'launch' / 'ros_pad.launch.py'
    perform(one, [['ros2', 'launch', str(file), 'folder:=bag']], folder)
    check_bag(one, folder / 'bag')


def _node(one: Try, folder: pathlib.Path) -> None:
    perform(one, [words_of(one.target)], folder)


_RUN = {
    'regulator': _regulator,
    'recorder': _recorder,
    'pad': _pad,
    'group': _group,
    'launch': _launch,
}


def duration_of_walk() -> float:
    """Return the time of the walk of ``pad run`` without signals, s."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.monotonic()
        subprocess.run(
            [script('pad'), *_WALK, '--out', 'out'], cwd=folder, check=True, capture_output=True
        )
        return time.monotonic() - begin


def run(target: str, repeats: int, work: float, seed: int = 0) -> Iterator[Try]:
    """Send every pair of signals to a target some times; yield each try.

    Parameters
    ----------
    target : str
        One of :data:`TARGETS`.
    repeats : int
        Number of tries of each pair.
    work : float
        Longest time to the first signal, s.
    seed : int
        Seed of the moments.
    """
    moments = random.Random(f'{target} {seed}')
    for number in range(repeats * len(PAIRS)):
        gap = math.exp(moments.uniform(math.log(SHORTEST), math.log(LONGEST)))
        one = Try(target, PAIRS[number % len(PAIRS)], moments.uniform(0.0, work), gap)
        with tempfile.TemporaryDirectory() as folder:
            _RUN.get(target, _node)(one, pathlib.Path(folder))
        yield one


def table(tries: Sequence[Try]) -> str:
    """Return the results as text, a line for each target."""
    rows = []
    for target in dict.fromkeys(one.target for one in tries):
        own = [one for one in tries if one.target == target]
        rows.append({
            'target': target,
            'tries': len(own),
            'good': sum(not one.problems for one in own),
            'status 0': sum(0 in one.statuses for one in own),
            'bag or pressure': sum(one.reached for one in own),
            'Python starts (s)': max(one.python for one in own),
            'longest end (s)': max(one.ending for one in own),
        })  # fmt: skip
    return command.listed(rows)


def _perform_all(target: str, repeats: int, seed: int, tries: list[Try]) -> None:
    """Add every try of a target to the list."""
    work = duration_of_walk() if target == 'pad' else WORK.get(target, WORK_OF_NODE)
    with (
        bar(target, repeats * len(PAIRS), 'tries') as reach,
        Commander() if target == 'regulator' else contextlib.nullcontext(),
    ):
        for done, one in enumerate(run(target, repeats, work, seed), start=1):
            tries.append(one)
            reach(done)


def main(words: Sequence[str]) -> int:
    """Run the study; return the exit status."""
    parser = command.parser('signals', __doc__)
    command.add_count(parser, '--repeats', 10, 'tries of each pair of signals')
    parser.add_argument('--only', nargs='+', choices=TARGETS, default=TARGETS, help='targets')
    parser.add_argument('--seed', type=int, default=0, help='seed of the moments (default: 0)')
    options = parser.parse_args(words)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    targets = list(options.only)
    if 'launch' in targets and not shutil.which('ros2'):
        print('ros2 launch is not installed: target launch is skipped', file=sys.stderr)
        targets.remove('launch')
    tries: list[Try] = []
    with contextlib.suppress(KeyboardInterrupt):  # what was tried so far is shown
        for target in targets:
            _perform_all(target, options.repeats, options.seed, tries)
    command.show(options, [dataclasses.asdict(one) for one in tries], table(tries))
    bad = [one for one in tries if one.problems]
    for one in bad:
        pair = ' and '.join(each.name for each in one.pair)
        print(
            f'{one.target}: {pair} at {one.first:.3f} s and {one.gap:.4f} s later:',
            *one.problems, one.errors, sep='\n', file=sys.stderr,
        )  # fmt: skip
    return int(bool(bad))
