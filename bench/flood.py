# SPDX-License-Identifier: Apache-2.0
"""Flood one leg of the regulator node with set-points from another process, and watch the others.

``python bench/flood.py`` starts the node on all six legs with simulated regulators, in a process
of its own, as ``ros2 run`` does. A second process publishes set-points for leg 1 as fast as it is
told to: valid ones, invalid ones, both in turn, and bytes that are no messages. This one commands
the other legs for a while, stops, and takes the time from its last set-points until their pads are
told to vent, round by round; it counts messages on ``/diagnostics``, and looks at the node's
memory and processor time. Nothing leaves the machine.

A vent that comes later than ``command_timeout`` and what a read of the pressures takes is printed,
and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from collections.abc import Iterator

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from tqdm import tqdm

from ros_pad.nodes import topics
from ros_pad.nodes.stamps import set_stamp

AMBIENT = 101325.0
TIMEOUT = 0.3  # command_timeout, s
RATE = 10_000.0  # set-points a second
ROUND = 2.5  # of commands and silence, s
COMMANDED = 1.0  # of which commands come, s
LATEST = 0.25  # s after the timeout in which a vent must be seen: reading and telling take time
PATIENCE = 20.0
FLOODED, GAUGE = 1, 40e3
KINDS = ('none', 'valid', 'invalid', 'mixed', 'torn')
"""What floods: nothing, set-points that are accepted, refused, both in turn, and no messages."""


@dataclasses.dataclass
class Result:
    """What a flood did.

    Attributes
    ----------
    kind : str
        Of :data:`KINDS`.
    rate : float
        Set-points published a second.
    rounds : int
        Vents waited for, each of five pads.
    reaction : float
        Longest time from the last set-point to a pad that is seen to fall, s.
    flooded_up : bool
        Whether the flooded pad was ever found under pressure.
    pressures : float
        Lowest number of pressures a second of a pad, in any round.
    diagnostics : float
        Messages of the node on ``/diagnostics`` a second.
    growth : float
        Of the node's resident memory from the first round to the last, MB.
    processor : float
        Share of one processor that the node took.
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
    """Publish set-points for one leg until standard input ends; print how many a second."""
    rclpy.init()
    node = Node('flood', start_parameter_services=False, enable_rosout=False)
    publisher = topics.PRESSURE_SETPOINT.publisher(node, FLOODED)
    good, bad = topics.PRESSURE_SETPOINT.message(), topics.PRESSURE_SETPOINT.message()
    good.fluid_pressure, bad.fluid_pressure = AMBIENT + GAUGE, AMBIENT + 1e9
    messages: list[object] = {
        'valid': [good], 'invalid': [bad], 'mixed': [good, bad], 'torn': [b'\0\1\0\0' + b'\1' * 9],
    }[kind]  # fmt: skip
    os.set_blocking(sys.stdin.fileno(), False)
    count, start = 0, time.monotonic()
    while True:
        if count % 100 == 0:
            with contextlib.suppress(BlockingIOError):
                if sys.stdin.buffer.raw.read(1) == b'':
                    break
            for each in (good, bad):
                set_stamp(each.header.stamp, time.time_ns())
        publisher.publish(messages[count % len(messages)])
        count += 1
        ahead = start + count / rate - time.monotonic()
        if ahead > 1e-3:
            time.sleep(ahead)
    print(count / (time.monotonic() - start))


def _memory(pid: int) -> float:
    with open(f'/proc/{pid}/statm', encoding='ascii') as file:
        return int(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE') / 1e6


def _processor(pid: int) -> float:
    with open(f'/proc/{pid}/stat', encoding='ascii') as file:
        words = file.read().rpartition(')')[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf('SC_CLK_TCK')


@contextlib.contextmanager
def _process(*command: str, **settings: object) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([sys.executable, *command], text=True, **settings)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(PATIENCE)


class Watcher:
    """The node that commands the other legs, and hears how their pads do."""

    def __init__(self, legs: tuple[int, ...]) -> None:
        self.node = Node('watcher', start_parameter_services=False, enable_rosout=False)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.legs = [leg for leg in legs if leg != FLOODED]
        self._publishers = [topics.PRESSURE_SETPOINT.publisher(self.node, x) for x in self.legs]
        self._message = topics.PRESSURE_SETPOINT.message()
        self.gauges = dict.fromkeys(legs, 0.0)
        self.counts = dict.fromkeys(legs, 0)
        self.told = 0
        for leg in legs:
            topics.PRESSURE.subscription(
                self.node, lambda message, leg=leg: self._hear(leg, message.fluid_pressure), leg
            )
        topics.DIAGNOSTICS.subscription(self.node, self._count)

    def _hear(self, leg: int, pressure: float) -> None:
        self.gauges[leg] = pressure - AMBIENT
        self.counts[leg] += 1

    def _count(self, message: object) -> None:
        self.told += 1

    def until(self, done: Callable[[], object], seconds: float, what: str = '') -> None:
        """Spin until something is so, or for some time where nothing need be said of it."""
        end = time.monotonic() + seconds
        while not done():
            self.executor.spin_once(timeout_sec=0.005)
            if time.monotonic() > end:
                if what:
                    raise TimeoutError(f'waited {seconds:g} s in vain for {what}')
                return

    def connected(self) -> bool:
        """Whether the regulator node is there."""
        return all(each.get_subscription_count() for each in self._publishers) and all(
            self.counts.values()
        )

    def command(self) -> None:
        """Send a set-point to each of the other legs."""
        set_stamp(self._message.header.stamp, time.time_ns())
        self._message.fluid_pressure = AMBIENT + GAUGE
        for publisher in self._publishers:
            publisher.publish(self._message)


def _round(watcher: Watcher, result: Result) -> None:
    """Command the other legs, stop, and wait until their pads fall."""
    start = time.monotonic()
    before = dict(watcher.counts)
    last = start
    while time.monotonic() < start + COMMANDED:
        last = time.monotonic()
        watcher.command()
        watcher.until(lambda: False, 0.02)
    if min(watcher.gauges[leg] for leg in watcher.legs) < 0.9 * GAUGE:
        raise RuntimeError(f'the pads did not fill: {watcher.gauges}')
    # 3 % below the set-point it is on its way down; the simulated device takes 20 ms for that.
    fallen: dict[int, float] = {}

    def fell() -> bool:
        for leg in watcher.legs:
            if leg not in fallen and watcher.gauges[leg] < 0.97 * GAUGE:
                fallen[leg] = time.monotonic() - last
        return len(fallen) == len(watcher.legs)

    watcher.until(fell, PATIENCE, f'the vents: {watcher.gauges}')
    watcher.until(lambda: time.monotonic() > start + ROUND, ROUND)
    seconds = time.monotonic() - start
    result.rounds += 1
    result.reaction = max(result.reaction, *fallen.values())
    result.flooded_up |= watcher.gauges[FLOODED] > 0.1 * GAUGE
    slowest = min(watcher.counts[leg] - before[leg] for leg in watcher.legs) / seconds
    result.pressures = min(result.pressures, slowest)


def run(
    kind: str, rounds: int, rate: float = RATE, progress: Callable[[], object] | None = None
) -> Result:
    """Flood the node with one kind of message, and return what that did.

    Parameters
    ----------
    kind : str
        Of :data:`KINDS`.
    rounds : int
        Each takes :data:`ROUND` s.
    rate : float
        Set-points a second.
    progress : callable, optional
        Called after each round.
    """
    result = Result(kind)
    node = ('-m', 'ros_pad.nodes.regulator', '--ros-args', '-p', f'command_timeout:={TIMEOUT}')
    rclpy.init()
    try:
        with (
            _process(*node, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as regulator,
            contextlib.ExitStack() as stack,
        ):
            watcher = Watcher(topics.LEGS)
            watcher.until(watcher.connected, PATIENCE, 'the regulator node')
            flooder = None
            if kind != 'none':
                flooder = stack.enter_context(
                    _process(
                        __file__, '--flood', kind, '--rate', str(rate),
                        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    )
                )  # fmt: skip
                name = topics.PRESSURE_SETPOINT.name(FLOODED)
                watcher.until(lambda: watcher.node.count_publishers(name), PATIENCE, 'the flood')
                watcher.until(lambda: False, 1.0)
            _round(watcher, Result(kind))  # until memory and discovery have settled
            memory, processor = _memory(regulator.pid), _processor(regulator.pid)
            told, start = watcher.told, time.monotonic()
            for _ in range(rounds):
                _round(watcher, result)
                if progress:
                    progress()
            seconds = time.monotonic() - start
            result.diagnostics = (watcher.told - told) / seconds
            result.growth = _memory(regulator.pid) - memory
            result.processor = (_processor(regulator.pid) - processor) / seconds
            if flooder is not None:
                said, _ = flooder.communicate(timeout=PATIENCE)
                result.rate = float(said)
    finally:
        rclpy.try_shutdown()
    return result


def main() -> int:
    """Flood with every kind; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rounds', type=int, default=8, help=f'of {ROUND:g} s, each kind')
    parser.add_argument('--rate', type=float, default=RATE, help='set-points a second')
    parser.add_argument('--kinds', nargs='+', choices=KINDS, default=KINDS, help='of flood')
    parser.add_argument('--json', action='store_true', help='print one JSON object a kind')
    parser.add_argument('--flood', choices=KINDS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.flood:
        flood(options.flood, options.rate)
        return 0
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    results = []
    with tqdm(total=len(options.kinds) * options.rounds, unit='round') as bar:
        for kind in options.kinds:
            results.append(run(kind, options.rounds, options.rate, bar.update))
    if options.json:
        for each in results:
            print(json.dumps(dataclasses.asdict(each)))
    else:
        print(
            'flood    set-points/s  vent after (s)  flooded pad  pressures/s  diagnostics/s'
            '  growth (MB)  processor'
        )
        for each in results:
            print(
                f'{each.kind:8} {each.rate:12.0f} {each.reaction:15.3f}'
                f'  {"up" if each.flooded_up else "vented":>11} {each.pressures:12.1f}'
                f' {each.diagnostics:14.1f} {each.growth:12.1f} {each.processor:9.0%}'
            )
    late = [each.kind for each in results if each.reaction > TIMEOUT + LATEST]
    if late:
        print(f'vents came late under: {", ".join(late)}', file=sys.stderr)
    return 1 if late else 0


if __name__ == '__main__':
    sys.exit(main())
