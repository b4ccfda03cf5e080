# SPDX-License-Identifier: Apache-2.0
"""Flood the regulator node with commands of one leg from another process; measure the others.

Starts the node for all six legs with simulated regulators in a process of its own, as ``ros2 run``
does. A second process publishes records with a set-point for leg 1 alone at a high rate: valid
ones, invalid ones, both in turn, and bytes that are no messages. This process repeats rounds: it
commands the other legs for a while, stops, and measures the time from its last record until their
pads vent. It also counts messages on ``/diagnostics``, and reads the node's memory and processor
time. No message leaves the machine.

The exit status is 1 if a pad of another leg vents later than ``command_timeout`` plus 0.25 s; the
0.25 s are for reading the pressures.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from ros_pad.bags import topics
from ros_pad.bags.wire import Wire
from ros_pad.commands.progress import bar
from ros_pad.nodes import qos
from ros_pad.nodes.parameters import LEGS
from ros_pad.records import COMMAND, PRESSURE, Block
from studies import command
from studies.machine import memory, processor_time

TIMEOUT = 0.3  # command_timeout, s
RATE = 10_000.0  # records a second
ROUND = 2.5  # length of a round: commands, then silence, s
COMMANDED = 1.0  # part of a round with commands, s
LONGEST = 20.0  # s, until all pads must be up
LATEST = 0.25  # s after the timeout: a vent must be measured by then, because readings take time
PATIENCE = 20.0  # s
FLOODED, GAUGE = 1, 40e3
KINDS = ('none', 'valid', 'invalid', 'mixed', 'torn')
"""Kinds of flood: none, accepted set-points, refused set-points, both in turn, and bytes that are
no messages."""


@dataclasses.dataclass
class Result:
    """Result of a flood.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    rate : float
        Messages that the flood published a second.
    rounds : int
        Number of rounds, each with the vents of five pads.
    reaction : float
        Longest time from the last set-point until the pressure of a commanded pad falls, s.
    flooded_up : bool
        Whether the flooded pad was under pressure at the end of any round.
    pressures : float
        Lowest rate at which records of pressures were received in any round, 1/s.
    diagnostics : float
        Messages of the node on ``/diagnostics`` a second.
    growth : float
        Growth of the node's resident memory from the first round to the last, MB.
    processor : float
        Share of one processor that the node used.
    """

    kind: str
    rate: float = 0.0
    rounds: int = 0
    reaction: float = 0.0
    flooded_up: bool = False
    pressures: float = math.inf
    diagnostics: float = 0.0
    growth: float = 0.0
    processor: float = 0.0


def flood(kind: str, rate: float) -> None:
    """Publish one kind of flood for one leg until standard input ends; print the rate, 1/s."""
    rclpy.init()
    node = Node('flood', start_parameter_services=False, enable_rosout=False)
    publisher = qos.publisher(node, topics.COMMAND)
    gauges = {'valid': [GAUGE], 'invalid': [1e9], 'mixed': [GAUGE, 1e9]}.get(kind, [])
    messages = [b'\0\1\0\0' + b'\1' * 9]
    os.set_blocking(sys.stdin.fileno(), False)
    count, start = 0, time.monotonic()
    while True:
        if count % 100 == 0:
            with contextlib.suppress(BlockingIOError):
                if os.read(sys.stdin.fileno(), 1) == b'':
                    break
            messages = [_command((FLOODED,), each) for each in gauges] or messages
        publisher.publish(messages[count % len(messages)])
        count += 1
        ahead = start + count / rate - time.monotonic()
        if ahead > 1e-3:
            time.sleep(ahead)
    print(count / (time.monotonic() - start))
    node.destroy_node()
    rclpy.shutdown()


def _command(legs: Sequence[int], gauge: float) -> bytes:
    """Return the message of a record of this time with set-points, Pa, for some legs."""
    rows = COMMAND.rows(len(LEGS.default))
    rows['setpoint'][[leg in legs for leg in LEGS.default]] = gauge
    return Wire(COMMAND, LEGS.default).encode(Block.of(time.time_ns(), rows))


@contextlib.contextmanager
def _process(*words: str, **settings: Any) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, '-m', *words], text=True, cwd=command.ROOT, **settings
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE)


class Commander:
    """A node that commands the legs without flood, and receives the pressures of all legs."""

    def __init__(self, legs: tuple[int, ...]) -> None:
        self.node = Node('commander', start_parameter_services=False, enable_rosout=False)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.legs = [leg for leg in legs if leg != FLOODED]
        self._publisher = qos.publisher(self.node, topics.COMMAND)
        self.gauges = dict.fromkeys(legs, 0.0)
        self.count = self.diagnostics = 0
        decode = Wire(PRESSURE, legs).decode
        qos.subscription(
            self.node, topics.PRESSURE, lambda data: self._receive(decode(data)), raw=True
        )
        qos.subscription(self.node, topics.DIAGNOSTICS, self._count)

    def _receive(self, block: Block) -> None:
        pressures = block.rows[-1]['pressure'].tolist()
        self.gauges = dict(zip(self.gauges, pressures, strict=True))
        self.count += 1

    def _count(self, message: object) -> None:
        self.diagnostics += 1

    def until(self, done: Callable[[], object], seconds: float, what: str = '') -> None:
        """Spin until a condition holds, at most for a time, s.

        Raises
        ------
        TimeoutError
            When the condition does not hold in time, and ``what`` describes it.
        """
        end = time.monotonic() + seconds
        while not done():
            self.executor.spin_once(timeout_sec=0.005)
            if time.monotonic() > end:
                if what:
                    raise TimeoutError(f'timed out after {seconds:g} s waiting for {what}')
                return

    def connected(self) -> bool:
        """Return whether the regulator node has subscribed and its pressures have arrived."""
        return self._publisher.get_subscription_count() > 0 and self.count > 0

    def command(self) -> None:
        """Send a set-point to each leg without flood."""
        self._publisher.publish(_command(self.legs, GAUGE))


def _round(commander: Commander, result: Result) -> None:
    """Command the other legs, stop, and wait until their pads vent; add to the result."""
    start = time.monotonic()
    before = commander.count
    last = start
    up = 0.9 * GAUGE

    def low() -> bool:
        return min(commander.gauges[leg] for leg in commander.legs) < up

    # On a busy machine pads rise later.
    while time.monotonic() < start + (LONGEST if low() else COMMANDED):
        last = time.monotonic()
        commander.command()
        commander.until(lambda: False, 0.02)
    if low():
        raise RuntimeError(
            f'pressures by leg after {LONGEST:g} s of set-points: {commander.gauges} Pa gauge;'
            f' all but that of leg {FLOODED} must be at least {up:g} Pa'
        )
    # A pad 3 % below the set-point is venting. A simulated pad falls so far within 20 ms.
    fallen: dict[int, float] = {}

    def fell() -> bool:
        for leg in commander.legs:
            if leg not in fallen and commander.gauges[leg] < 0.97 * GAUGE:
                fallen[leg] = time.monotonic() - last
        return len(fallen) == len(commander.legs)

    commander.until(fell, PATIENCE, f'all pads to vent from (leg: Pa gauge) {commander.gauges}')
    commander.until(lambda: time.monotonic() > start + ROUND, ROUND)
    seconds = time.monotonic() - start
    result.rounds += 1
    result.reaction = max(result.reaction, *fallen.values())
    result.flooded_up |= commander.gauges[FLOODED] > 0.1 * GAUGE
    result.pressures = min(result.pressures, (commander.count - before) / seconds)


def run(
    kind: str, rounds: int, rate: float = RATE, progress: Callable[[float], object] | None = None
) -> Result:
    """Flood the node with one kind of message, and return the result.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`.
    rounds : int
        Number of rounds, each of :data:`ROUND` s.
    rate : float
        Messages a second.
    progress : callable, optional
        Called after each round with the number of rounds.
    """
    result = Result(kind)
    node = ('ros_pad.nodes.start', 'regulator', '--ros-args', '-p', f'command_timeout:={TIMEOUT}')
    rclpy.init()
    try:
        with (
            _process(*node, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as regulator,
            contextlib.ExitStack() as stack,
        ):
            commander = Commander(LEGS.default)
            commander.until(commander.connected, PATIENCE, 'the regulator node')
            flooder = None
            if kind != 'none':
                flooder = stack.enter_context(
                    _process(
                        'studies', 'flood', '--flood', kind, '--rate', str(rate),
                        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    )
                )  # fmt: skip
                name = topics.COMMAND.name()
                commander.until(
                    lambda: commander.node.count_publishers(name) > 1, PATIENCE, 'the flood'
                )
                commander.until(lambda: False, 1.0)
            _round(commander, Result(kind))  # not counted: memory and discovery settle first
            size, used = memory(regulator.pid), processor_time(regulator.pid)
            count, start = commander.diagnostics, time.monotonic()
            for done in range(1, rounds + 1):
                _round(commander, result)
                if progress:
                    progress(done)
            seconds = time.monotonic() - start
            result.diagnostics = (commander.diagnostics - count) / seconds
            result.growth = memory(regulator.pid) - size
            result.processor = (processor_time(regulator.pid) - used) / seconds
            if flooder is not None:
                printed, _ = flooder.communicate(timeout=PATIENCE)
                result.rate = float(printed)
    finally:
        rclpy.try_shutdown()
    return result


def main(words: Sequence[str]) -> int:
    """Flood with every kind; return the exit status."""
    parser = command.parser('flood', __doc__)
    command.add_count(parser, '--rounds', 8, f'rounds of {ROUND:g} s for each kind')
    parser.add_argument(
        '--rate', type=float, default=RATE, help=f'records a second (default: {RATE:g})'
    )
    parser.add_argument('--kinds', nargs='+', choices=KINDS, default=KINDS, help='kinds of flood')
    parser.add_argument('--flood', choices=KINDS, help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    if options.flood:
        flood(options.flood, options.rate)
        return 0
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    results = []
    for kind in options.kinds:
        with bar(f'flood: {kind}', options.rounds, 'round') as reach:
            results.append(run(kind, options.rounds, options.rate, reach))
    kept = [dataclasses.asdict(each) for each in results]
    command.show(options, kept, command.listed(kept))
    late = [each.kind for each in results if each.reaction > TIMEOUT + LATEST]
    if late:
        print(
            f'a pad vented later than {TIMEOUT + LATEST:g} s after its last set-point under'
            f' floods of kind {", ".join(late)}',
            file=sys.stderr,
        )
    return 1 if late else 0
