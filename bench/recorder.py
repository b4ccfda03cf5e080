# SPDX-License-Identifier: Apache-2.0
"""How many messages a second the recorder node takes, and what processor time that costs.

Run ``python bench/recorder.py [--rates 2000 8000] [--seconds 5]``; prints a table. Another process
sends wrenches of six legs, each leg's turn after the other, at every rate to two listeners in
turn, which are processes of their own:

- recorder: the recorder node as ``ros2 run`` starts it, into a bag in a temporary folder;
- bare: rclpy's EventsExecutor with the same raw subscriptions and callbacks that only count.

*lost* is what the middleware said was lost, *unexplained* what is neither there nor said to be
lost. 8000 a second are promised without loss on one core at most: the program ends with status 1
when a rate up to that loses messages, or anything is unexplained.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from tqdm import tqdm

from ros_pad.nodes import qos
from ros_pad.nodes import topics
from ros_pad.trials import label
from ros_pad.trials.bag import BagReader

PROMISED = 8000.0  # messages a second
PATIENCE = 30.0  # s


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--rates', type=float, nargs='+', default=[2000.0, 8000.0, 16000.0],
                        metavar='N', help='messages a second')  # fmt: skip
    parser.add_argument('--seconds', type=float, default=5.0, help='s of sending')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.add_argument('--listen', action='store_true', help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.listen:
        return listen()
    rclpy.init()
    rows = []
    for rate in tqdm(options.rates, unit='rate'):
        for name in ('bare', 'recorder'):
            rows.append({'listener': name} | measured(name, rate, options.seconds))
    rclpy.try_shutdown()
    if options.json:
        print(json.dumps(rows))
    else:
        print('listener  asked 1/s  sent 1/s     sent  arrived  lost  unexplained  cores  ratio')
        for bare, recorder in zip(rows[::2], rows[1::2], strict=True):
            for row in (bare, recorder):
                ratio = row['cores'] / bare['cores'] if bare['cores'] else float('nan')
                print(
                    f'{row["listener"]:9}{row["asked"]:10.0f}{row["rate"]:10.0f}{row["sent"]:9}'
                    f'{row["arrived"]:9}{row["lost"]:6}{row["unexplained"]:13}'
                    f'{row["cores"]:7.2f}{ratio:7.2f}'
                )
    kept = [row for row in rows if row['asked'] <= PROMISED and row['listener'] == 'recorder']
    return int(any(row['lost'] or row['unexplained'] for row in kept))


def measured(name: str, rate: float, seconds: float) -> dict[str, float]:
    """Send to a listener; return what became of it."""
    node = Node('sender')
    publishers = [topics.WRENCH.publisher(node, leg) for leg in topics.LEGS]
    data = serialize_message(WrenchStamped())
    with tempfile.TemporaryDirectory() as folder:
        bag = pathlib.Path(folder) / 'bag'
        command = {
            'bare': [sys.executable, __file__, '--listen'],
            'recorder': [
                *(sys.executable, '-m', 'ros_pad.nodes.recorder', '--ros-args'),
                *('-p', f'folder:={bag}', '--log-level', 'warn'),
            ],
        }[name]
        child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            until = time.monotonic() + PATIENCE
            while any(each.get_subscription_count() == 0 for each in publishers):
                if time.monotonic() > until:
                    raise SystemExit(f'{name} was not found in {PATIENCE:g} s')
                time.sleep(0.05)
            time.sleep(1.0)  # its start is not measured
            before = processor_time(child.pid)
            started = time.monotonic()
            sent = 0
            while (elapsed := time.monotonic() - started) < seconds:
                while sent < int(elapsed * rate):
                    publishers[sent % len(publishers)].publish(data)
                    sent += 1
                time.sleep(0.0005)
            for each in publishers:
                each.wait_for_all_acked()
            quiet = processor_time(child.pid)
            while (now := processor_time(child.pid)) > quiet + 0.02:  # still at its queue
                quiet = now
                time.sleep(0.2)
            used = processor_time(child.pid) - before
            child.send_signal(signal.SIGTERM)
            said, _ = child.communicate(timeout=PATIENCE)
        finally:
            child.kill()
            node.destroy_node()
        if name == 'bare':
            arrived, lost = int(said), 0
        else:
            reader = BagReader(bag)
            arrived = reader.message_count - reader.counts.get('/diagnostics', 0)
            lost = sum(json.loads(reader.custom_data[label.LOST]).values())
    return {
        'asked': rate,
        'rate': sent / elapsed,
        'sent': sent,
        'arrived': arrived,
        'lost': lost,
        'unexplained': sent - arrived - lost,
        'cores': used / elapsed,
    }


def processor_time(pid: int) -> float:
    """Return the s of processor time of a process."""
    words = pathlib.Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf('SC_CLK_TCK')


def listen() -> int:
    """Count messages until SIGTERM, and print how many came."""
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
    node = Node('listener')
    for leg in topics.LEGS:
        node.create_subscription(
            WrenchStamped, topics.WRENCH.name(leg), callback, qos.RECORD, raw=True
        )
    executor = EventsExecutor()
    executor.add_node(node)
    while not stopped:
        executor.spin_once(timeout_sec=0.1)
    print(count)
    return 0


if __name__ == '__main__':
    sys.exit(main())
