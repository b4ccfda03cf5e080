# SPDX-License-Identifier: Apache-2.0
"""Provoke a deadlock between rclpy's EventsExecutor and events of QoS; tell a hang by its stacks.

In rmw_fastrtps without the correction of its pull request 890, the executor that takes an event
(message lost, incompatible QoS, matched) locks first the event and then the reader, and the thread
that receives messages locks first the reader and then the event. Nodes of ros_pad register a
callback for incompatible QoS on every topic, and none for lost messages.

Three processes publish and subscribe on the same topics some hundred times a second, with offered
and requested QoS that match in part only, and with callbacks for these events. Each process makes
and destroys a second node at random, on an executor of its own: where the executor spins on,
rclpy 7.1 crashes if events of a removed node wait. Two of the processes end and are started again
at random. The messages come in bursts into queues of depth 1, so that some are lost. With --renew,
a subscription with incompatible QoS is destroyed and replaced in its callback; the recorder
replaces it, too, but keeps the old one.

A process whose executor calls nothing for 20 s prints the Python stacks of its threads and ends.
The exit status is 1 if that happened, if a process crashed, or if a kind of event never came, so
that nothing was tested; 0 otherwise. No message leaves the machine.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import faulthandler
import functools
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import String

from ros_pad.commands.progress import bar
from ros_pad.nodes import qos
from ros_pad.signals import STOP
from studies import command

HANG = 20.0  # s without a call of the executor
PATIENCE = 2.0 * HANG  # s for the orderly end of a process
TURN = 0.1  # of one of the executors of a process, s
PERIOD = 0.01  # between two bursts of one node, s
BURST = 6  # messages on each topic
TOPICS = ('one', 'two', 'three')
LIVES = (3600.0, 15.0, 6.0)  # mean lives of the processes, s
EVENTS = ('lost', 'incompatible', 'matched')
_LOSSY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
OFFERED = (_LOSSY, qos.SENSOR_PUBLISH, qos.COMMAND, qos.STATE)
REQUESTED = (_LOSSY, _LOSSY, qos.SENSOR, qos.RECORD, qos.STATE)


class Worker:
    """Nodes, each on an executor of its own, and the number of their messages and events."""

    def __init__(self, seed: int, events: Sequence[str], renew: bool) -> None:
        self._random = random.Random(seed)
        self._events = events
        self._renew = renew
        self.counts: collections.Counter[str] = collections.Counter()
        self._nodes: list[tuple[Node, Executor]] = []
        self._made = 0
        self._alarm = 0.0

    def _count(self, kind: str, event: object = None) -> None:
        self.counts[kind] += 1
        if time.monotonic() > self._alarm:
            # A thread of its own, which needs no lock of Python, prints the stacks.
            faulthandler.dump_traceback_later(HANG, exit=True)
            self._alarm = time.monotonic() + 1.0

    def _callbacks(self, *kinds: str) -> dict[str, Any]:
        """Return the callbacks that were asked for, of those that are possible."""
        names = {'lost': 'message_lost', 'incompatible': 'incompatible_qos', 'matched': 'matched'}
        return {
            names[kind]: functools.partial(self._count, kind)
            for kind in kinds
            if kind in self._events
        }

    def add(self) -> None:
        """Add a node with a publisher and a subscription on each topic, of random QoS."""
        self._made += 1
        node = Node(
            f'worker_{os.getpid()}_{self._made}',
            start_parameter_services=False,
            enable_rosout=False,
        )
        events = PublisherEventCallbacks(
            use_default_callbacks=False, **self._callbacks('incompatible', 'matched')
        )
        publishers = []
        for topic in TOPICS:
            offered = self._random.choice(OFFERED)
            publisher = node.create_publisher(String, topic, offered, event_callbacks=events)
            publishers.append(publisher)
            self._subscribe(node, topic)
        message = String(data='x' * self._random.choice((10, 1000, 30_000)))

        def publish() -> None:
            for publisher in publishers * BURST:
                publisher.publish(message)
            self._count('tick')

        node.create_timer(PERIOD, publish)
        executor = EventsExecutor()
        executor.add_node(node)
        self._nodes.append((node, executor))

    def _subscribe(self, node: Node, topic: str) -> None:
        def renew(event: object) -> None:
            self._count('incompatible')
            node.destroy_subscription(subscription)
            self._subscribe(node, topic)

        callbacks = self._callbacks('lost', 'incompatible', 'matched')
        if self._renew:
            callbacks['incompatible_qos'] = renew
        subscription = node.create_subscription(
            String,
            topic,
            functools.partial(self._count, 'message'),
            self._random.choice(REQUESTED),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False, **callbacks),
        )

    def remove(self) -> None:
        """Remove and destroy a node."""
        node, executor = self._nodes.pop(self._random.randrange(len(self._nodes)))
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()

    def run(self) -> None:
        """Spin until SIGTERM, and add and remove nodes."""
        never = Future()
        self.add()
        self._count('tick')
        while not STOP.requested:
            for _, executor in self._nodes:
                executor.spin_until_future_complete(never, timeout_sec=TURN)
            if self._random.random() < 0.1:
                self.add() if len(self._nodes) < 2 else self.remove()
        while self._nodes:
            self.remove()


def _work(seed: int, events: Sequence[str], renew: bool) -> None:
    """Run a worker in this process until SIGTERM; print its counts as JSON."""
    faulthandler.register(signal.SIGUSR1)  # prints the stacks
    set_logger_level('', LoggingSeverity.FATAL)  # a warning for each mismatch
    with STOP.during():
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        worker = Worker(seed, events, renew)
        worker.run()
        rclpy.shutdown()
        faulthandler.cancel_dump_traceback_later()
        print(json.dumps(worker.counts))


class Process:
    """A worker in a process of its own, which is started again when it ends."""

    def __init__(self, life: float, seed: int, options: Sequence[str]) -> None:
        self._life = life
        self._options = options
        self._random = random.Random(seed)
        self.counts: collections.Counter[str] = collections.Counter()
        self.starts = 0
        self.hangs: list[str] = []
        self.crashes: list[str] = []
        self._start()

    def _start(self) -> None:
        self.starts += 1
        self._end = time.monotonic() + 3.0 + self._random.expovariate(1.0 / self._life)
        seed = self._random.randrange(2**31)
        self._child = subprocess.Popen(
            [sys.executable, '-m', 'studies', 'deadlock', '--worker', str(seed), *self._options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=command.ROOT,
        )

    def tend(self) -> None:
        """Start the process again if its life is over or it ended by itself."""
        if self._child.poll() is not None or time.monotonic() > self._end:
            self.close()
            self._start()

    def close(self) -> None:
        """End the process, and add its counts."""
        self._child.terminate()
        try:
            printed, errors = self._child.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            self._child.send_signal(signal.SIGUSR1)
            time.sleep(1.0)
            self._child.kill()
            printed, errors = self._child.communicate()
            self.hangs.append(f'no end {PATIENCE:g} s after SIGTERM\n{errors}')
            return
        with contextlib.suppress(json.JSONDecodeError):
            self.counts.update(json.loads(printed))
        if self._child.returncode not in (0, -signal.SIGTERM):  # the latter before it began
            text = f'exit status {self._child.returncode}\n{errors}'
            (self.hangs if 'Timeout (' in errors else self.crashes).append(text)


def run(minutes: float, seed: int = 0, options: Sequence[str] = ()) -> list[Process]:
    """Let the processes work for a time; return them, closed.

    Parameters
    ----------
    minutes : float
        Duration.
    seed : int
        Seed of all that is random but the order of threads.
    options : sequence of str
        Options for the processes.
    """
    processes = [Process(life, seed + place, options) for place, life in enumerate(LIVES)]
    begin = time.monotonic()
    try:
        with bar('deadlock', 60.0 * minutes) as reach:
            while (passed := time.monotonic() - begin) < 60.0 * minutes:
                time.sleep(0.5)
                for each in processes:
                    each.tend()
                reach(passed)
    finally:
        for each in processes:
            each.close()
    return processes


def table(processes: Sequence[Process]) -> str:
    """Return the results as text."""
    kinds = ('message', *EVENTS)
    lines = [f'life (s)  starts  hangs  crashes{"".join(f"{kind:>14}" for kind in kinds)}']
    for life, each in zip(LIVES, processes, strict=True):
        counts = ''.join(f'{each.counts[kind]:14}' for kind in kinds)
        lines.append(
            f'{life:8.0f} {each.starts:7} {len(each.hangs):6} {len(each.crashes):8}{counts}'
        )
    return '\n'.join(lines)


def main(words: Sequence[str]) -> int:
    """Run the study; return the exit status."""
    parser = command.parser('deadlock', __doc__)
    parser.add_argument('--minutes', type=float, default=30.0, help='duration (default: 30)')
    parser.add_argument('--seed', type=int, default=0, help='default: 0')
    parser.add_argument(
        '--events', nargs='+', choices=EVENTS, default=EVENTS, help='events with callbacks'
    )
    parser.add_argument(
        '--renew', action='store_true', help='replace subscriptions with incompatible QoS'
    )
    parser.add_argument('--worker', type=int, help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if options.worker is not None:
        _work(options.worker, options.events, options.renew)
        return 0
    own = ['--events', *options.events, *['--renew'] * options.renew]
    processes = run(options.minutes, options.seed, own)
    rows = [
        {'starts': each.starts, 'hangs': each.hangs, 'crashes': each.crashes, **each.counts}
        for each in processes
    ]
    command.show(options, rows, table(processes))
    failures = [text for each in processes for text in each.hangs + each.crashes]
    print(*failures, sep='\n', file=sys.stderr)
    missing = [kind for kind in options.events if not any(x.counts[kind] for x in processes)]
    if missing:
        print(f'never came: {", ".join(missing)}', file=sys.stderr)
    return int(bool(missing or failures))
