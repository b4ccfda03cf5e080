# SPDX-License-Identifier: Apache-2.0
"""Measure the message rate that the recorder node can record, and its processor time.

This process sends records of all kinds in turn, at each rate to two receivers one after
the other, each in a process of its own:

- bare: rclpy's EventsExecutor with raw, reliable subscriptions and callbacks that only count;
- recorder: the recorder node as ``ros2 run`` starts it, with a bag in a temporary folder.

*lost* is the number of messages that the recorder counted as lost (0 for bare, which does not
count them), *unexplained* the number that neither arrived nor were counted. The requirement is
8000 messages a second without loss, on at most one core. The exit status is 1 if the recorder has
lost or unexplained messages at a rate of up to 8000; it does not judge the cores.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from ros_pad.bags import BagReader
from ros_pad.bags.wire import Wire
from ros_pad.errors import PadError
from ros_pad.nodes import qos, topics
from ros_pad.records import Block
from ros_pad.trials import label
from studies import command
from studies.machine import processor_time

PROMISED = 8000.0  # messages a second
PATIENCE = 30.0  # s


def main(words: Sequence[str]) -> int:
    """Send at every rate to both receivers, and print the table; return the exit status."""
    parser = command.parser('recorder', __doc__)
    parser.add_argument(
        '--rates', type=float, nargs='+', default=[2000.0, 8000.0, 16000.0], metavar='N',
        help='messages a second (default: 2000 8000 16000)',
    )  # fmt: skip
    parser.add_argument('--seconds', type=float, default=5.0, help='time of sending (default: 5)')
    parser.add_argument('--receive', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    if options.receive:
        return receive()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    rows = [
        measured(name, rate, options.seconds)
        for rate in command.each(options.rates, 'recorder', 'rate')
        for name in ('bare', 'recorder')
    ]
    rclpy.try_shutdown()
    command.show(options, [dataclasses.asdict(row) for row in rows], table(rows))
    kept = [row for row in rows if row.wanted <= PROMISED and row.receiver == 'recorder']
    return int(any(row.lost or row.unexplained for row in kept))


def table(rows: Sequence[Row]) -> str:
    """Return the rows as text; for each rate, the row of ``bare`` comes before ``recorder``."""
    lines = ['receiver wanted 1/s  sent 1/s     sent  arrived  lost  unexplained  cores  ratio']
    for bare, recorder in zip(rows[::2], rows[1::2], strict=True):
        for row in (bare, recorder):
            ratio = row.cores / bare.cores if bare.cores else math.nan
            lines.append(
                f'{row.receiver:9}{row.wanted:10.0f}{row.rate:10.0f}{row.sent:9}{row.arrived:9}'
                f'{row.lost:6}{row.unexplained:13}{row.cores:7.2f}{ratio:7.2f}'
            )
    return '\n'.join(lines)


@dataclasses.dataclass(frozen=True)
class Row:
    """Result of one receiver at one rate.

    Attributes
    ----------
    receiver : str
        ``bare`` or ``recorder``.
    wanted, rate : float
        Messages a second, as configured and as sent.
    sent, arrived, lost, unexplained : int
        Numbers of messages.
    cores : float
        Processor time over elapsed time.
    """

    receiver: str
    wanted: float
    rate: float
    sent: int
    arrived: int
    lost: int
    unexplained: int
    cores: float


def measured(name: str, rate: float, seconds: float) -> Row:
    """Start a receiver, send to it at a rate, 1/s, for a time, s, and return the result.

    Raises
    ------
    PadError
        When the receiver does not subscribe to the records in time.
    """
    node = Node('sender')
    publishers = [topic.publisher(node) for topic in topics.RECORDS]
    with tempfile.TemporaryDirectory() as folder:
        bag = pathlib.Path(folder) / 'bag'
        receiver = {
            'bare': ('studies', 'recorder', '--receive'),
            'recorder': (
                *('ros_pad.nodes.recorder', '--ros-args'),
                *('-p', f'folder:={bag}', '--log-level', 'warn'),
            ),
        }[name]
        child = subprocess.Popen(
            [sys.executable, '-m', *receiver], stdout=subprocess.PIPE, text=True, cwd=command.ROOT
        )
        try:
            until = time.monotonic() + PATIENCE
            while any(each.get_subscription_count() == 0 for each in publishers):
                if time.monotonic() > until:
                    raise PadError(
                        f'receiver {name} has not subscribed to all records in {PATIENCE:g} s'
                    )
                time.sleep(0.05)
            time.sleep(1.0)  # the start of the process is not measured
            before = processor_time(child.pid)
            sent, elapsed = _send(publishers, rate, seconds)
            quiet = processor_time(child.pid)
            while (now := processor_time(child.pid)) > quiet + 0.02:  # still works on its queue
                quiet = now
                time.sleep(0.2)
            used = processor_time(child.pid) - before
            child.send_signal(signal.SIGTERM)
            printed, _ = child.communicate(timeout=PATIENCE)
        finally:
            child.kill()
            node.destroy_node()
        if name == 'bare':
            arrived, lost = int(printed), 0
        else:
            reader = BagReader(bag)
            arrived = reader.message_count - reader.counts.get('/diagnostics', 0)
            lost = sum(json.loads(reader.custom_data[label.LOST]).values())
    unexplained = sent - arrived - lost
    return Row(name, rate, sent / elapsed, sent, arrived, lost, unexplained, used / elapsed)


def _send(publishers: Sequence[Publisher], rate: float, seconds: float) -> tuple[int, float]:
    """Publish at a rate, 1/s, for a time, s; return number of messages and time of sending, s."""
    legs, kinds = topics.LEGS, [topic.schema.record for topic in topics.RECORDS]
    data = [Wire(k, legs).encode(Block.of(0, k.rows(len(legs)))) for k in kinds if k]
    started, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - started) < seconds:
        while sent < int(elapsed * rate):
            place = sent % len(publishers)
            publishers[place].publish(data[place])
            sent += 1
        time.sleep(0.0005)
    for each in publishers:
        each.wait_for_all_acked()
    return sent, elapsed


def receive() -> int:
    """Count messages until SIGTERM, and print their number."""
    count = 0
    stopped = False

    def stop(*_: object) -> None:
        nonlocal stopped
        stopped = True

    def callback(_: bytes) -> None:
        nonlocal count
        count += 1

    signal.signal(signal.SIGTERM, stop)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node('receiver')
    for topic in topics.RECORDS:
        node.create_subscription(topic.message, topic.name(), callback, qos.RECORD, raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    while not stopped:
        executor.spin_once(timeout_sec=0.1)
    print(count)
    return 0
