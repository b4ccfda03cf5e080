# SPDX-License-Identifier: Apache-2.0
"""What node tests share: records, messages, and a bench for nodes without DDS."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections import defaultdict

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Header

from ros_pad.bags import topics
from ros_pad.bags.wire import Wire, legs_of
from ros_pad.nodes.qos import message_class
from ros_pad.records import COMMAND, ESTIMATE, PRESSURE, SAMPLE, Block, split

MS = 1_000_000
SECOND = 1_000 * MS
AMBIENT = 101325.0
SIX = (1, 2, 3, 4, 5, 6)
NODES = (
    'simulator', 'body_estimator', 'estimator', 'controller', 'regulator', 'merge', 'views',
    'recorder',
)  # fmt: skip
LOAD = 6.83
"""Load of a foot in stance, N."""


def start_node(name, *parameters):
    """Start a node in a process of its own, with parameters such as ``legs:=[1]``."""
    given = [word for each in parameters for word in ('-p', each)]
    command = [sys.executable, '-m', 'ros_pad.nodes.start', name, '--ros-args', *given]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def node_class(name):
    """Return the class of a node, whose module has its parameters."""
    module = importlib.import_module(f'ros_pad.nodes.{name}')
    return getattr(module, f'{name.title().replace("_", "")}Node')


def nanoseconds(stamp):
    """Return a stamp in ns."""
    return stamp.sec * SECOND + stamp.nanosec


def record(kind, stamp_ns, legs=2, **fields):
    """Return a record; a field has a value for all legs, or one for each; others are missing."""
    rows = kind.rows(legs)
    for name, value in fields.items():
        rows[name] = value
    return Block.of(stamp_ns, rows)


def sample(stamp_ns, force=(0.0, 0.0, LOAD), position=(0.0, 0.0, 0.0), **more):
    return record(SAMPLE, stamp_ns, force=force, position=position, **more)


def estimate(stamp_ns, load=LOAD, wetness=0.5, position=(0.0, 0.0), **more):
    """Return an estimate of an observable foot in stance."""
    fields = {'load': load, 'wetness': wetness, 'position': position, 'friction': 0.5}
    return record(ESTIMATE, stamp_ns, **(fields | {'doubt': 0.0, 'detail': 0.0} | more))


def command(stamp_ns, setpoint, **more):
    return record(COMMAND, stamp_ns, setpoint=setpoint, dome=1.0, **more)


def pressure(stamp_ns, gauge, **more):
    return record(PRESSURE, stamp_ns, pressure=gauge, **more)


def header(stamp_ns, frame=''):
    seconds, rest = split(stamp_ns)
    return Header(stamp=Time(sec=seconds, nanosec=rest), frame_id=frame)


def wrench(stamp_ns, force=(0.0, 0.0, LOAD), moment=0.0, frame=''):
    message = WrenchStamped(header=header(stamp_ns, frame))
    f = message.wrench.force
    f.x, f.y, f.z = map(float, force)
    message.wrench.torque.z = moment
    return message


def position(stamp_ns, point=(0.0, 0.0, 0.0), frame=''):
    message = PointStamped(header=header(stamp_ns, frame))
    p = message.point
    p.x, p.y, p.z = map(float, point)
    return message


def fluid(stamp_ns, gauge, frame=''):
    return FluidPressure(header=header(stamp_ns, frame), fluid_pressure=gauge + AMBIENT)


def decoded(topic, data):
    """Return the block or message in bytes."""
    if topic in topics.RECORDS:
        return Wire(topic.record, legs_of(data)).decode(data)
    return deserialize_message(data, message_class(topic.type_name))


def encoded(topic, content, legs):
    """Return the bytes of a block of records of these legs, or of a message."""
    if isinstance(content, bytes):
        return content
    if isinstance(content, Block):
        return Wire(topic.record, legs).encode(content)
    return serialize_message(content)


def overrides(values):
    return [Parameter(name, value=value) for name, value in values.items()]


def deliver(node, name, data):
    """Call a node's subscriptions to a topic, as an executor does."""
    found = [each for each in node.subscriptions if each.topic_name == '/' + name.lstrip('/')]
    assert found, f'{node.get_name()} does not subscribe to {name}'
    for each in found:
        each.callback(data if each.raw else deserialize_message(data, each.msg_type))


class Bench:
    """Run nodes, hand messages to them and keep what they publish, all without DDS.

    Attributes
    ----------
    node : Node
        The node that was started last.
    sent : dict of str to list of bytes
        What was published, by topic.
    now_ns : int
        Simulated time, ns.
    """

    def __init__(self, context, executor, until, monkeypatch):
        self._context, self._executor, self.until = context, executor, until
        self.nodes: list[Node] = []
        self.sent: dict[str, list[bytes]] = defaultdict(list)
        self.now_ns = 0
        self.legs: tuple[int, ...] = (1, 2)
        monkeypatch.setattr(Publisher, 'publish', lambda *given: self._keep(*given))

    def _keep(self, publisher, message):
        if publisher.topic_name == '/parameter_events':  # with the time of day
            return
        data = message if isinstance(message, bytes) else serialize_message(message)
        self.sent[publisher.topic_name].append(data)

    def start(self, kind, **parameters):
        """Start a node, unless told otherwise with legs 1 and 2 and in simulated time."""
        values = {'use_sim_time': True, 'legs': list(self.legs)} | parameters
        self.legs = tuple(values['legs'])
        self.node = kind(context=self._context, parameter_overrides=overrides(values))
        self._executor.add_node(self.node)
        self.nodes.append(self.node)
        return self.node

    def stop(self):
        """Destroy the node that was started last."""
        self._executor.remove_node(self.node)
        self.nodes.remove(self.node)
        self.node.destroy_node()

    def give(self, topic, content, leg=None):
        """Hand bytes, a message or records to the nodes that subscribe to a topic."""
        name = topic.name(leg)
        for node in self.nodes:
            if any(each.topic_name == '/' + name.lstrip('/') for each in node.subscriptions):
                deliver(node, name, encoded(topic, content, self.legs))

    def tick(self, seconds=0.01):
        """Advance simulated time in steps of 10 ms."""
        for _ in range(round(seconds / 0.01)):
            self.clock(self.now_ns + 10 * MS)

    def clock(self, now_ns):
        """Set the simulated time, ns."""
        self.now_ns = now_ns
        message = message_class(topics.CLOCK.type_name)()
        message.clock = header(now_ns).stamp
        self.give(topics.CLOCK, message)

    def heard(self, topic, leg=None):
        """Return what was published on a topic: blocks or messages."""
        name = '/' + topic.name(leg).lstrip('/')
        return [decoded(topic, data) for data in self.sent.get(name, ())]

    def last(self, topic):
        """Return the rows of the last record of a topic."""
        return self.heard(topic)[-1].rows[-1]

    def statuses(self, name=''):
        """Return the statuses with a name on /diagnostics, each with its time, s."""
        return [
            (nanoseconds(array.header.stamp) * 1e-9, status)
            for array in self.heard(topics.DIAGNOSTICS)
            for status in array.status
            if name in status.name
        ]

    def call(self, name, request):
        """Call a service of the node that was started last."""
        (service,) = [each for each in self.node.services if each.srv_name.endswith(name)]
        return service.callback(request, service.srv_type.Response())

    def set(self, name, value):
        """Change a parameter; return the result."""
        return self.node.set_parameters([Parameter(name, value=value)])[0]
