# SPDX-License-Identifier: Apache-2.0
"""The recorder node: writes all topics of a robot into a bag."""

from __future__ import annotations

import datetime
import json
import struct
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from rclpy.subscription import Subscription
from rclpy.task import Future

from ros_pad.bags import BagWriter, topics
from ros_pad.bags.topics import Topic
from ros_pad.bags.wire import Wire
from ros_pad.bags.writer import FLUSH_PERIOD
from ros_pad.errors import BadMessage, BagError
from ros_pad.nodes import qos
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.intake import Intake
from ros_pad.nodes.parameters import LEGS, Parameter, plain
from ros_pad.nodes.process import run
from ros_pad.pace import LATE
from ros_pad.trials import label

PARAMETERS = (
    LEGS,
    Parameter(
        'folder',
        '',
        'Folder of the bag, which must not exist; empty: a new one, named after the time.',
    ),
    Parameter(
        'reliable',
        False,
        'Ask publishers to repeat lost measurements: for a recorder on another computer.',
    ),
)

_STAMPS = [struct.Struct(order + '4xiI') for order in '><']  # by the byte order of a message

INTAKE_PERIOD = 0.1
"""Time after which received messages are written, s; the middleware keeps them until then."""


class RecorderNode(PadNode):
    """Write every topic of `ros_pad.bags.topics.RECORDED`, latched ones too, into a new bag.

    Messages are written without decoding, so that tens of thousands a second can be recorded; of
    a block of records each is written alone. Their log time is the time of receipt; with
    ``use_sim_time`` it is their stamp, and without one the time in the last ``/clock`` message.

    Messages reach the disk within about a second. Messages that were lost before they arrived are
    counted; the node reports the counts on ``/diagnostics``, and writes them into the bag under
    `ros_pad.trials.label.LOST`.

    Its ROS parameters are in :data:`PARAMETERS`; ``use_sim_time`` is read at the start only.

    Parameters
    ----------
    custom_data : mapping of str to str, optional
        Texts about the trial, for the bag. Without it, the bag has the versions of ros_pad and its
        libraries, the parameters of all nodes in the namespace of this one, requested as the
        nodes appear, and later changes of these parameters.
    **kwargs
        Passed on to `rclpy.node.Node`.

    Raises
    ------
    BagError
        When the folder exists or cannot be written. While the node records, the executor raises
        it when the disk is full.
    ConfigError
        When the value of a parameter is not allowed.
    """

    _bag: BagWriter | None = None

    def __init__(self, custom_data: Mapping[str, str] | None = None, **kwargs: Any) -> None:
        super().__init__('recorder', PARAMETERS, **kwargs)
        self._clock_ns = 0
        self._failed = False  # whether writing has failed
        self._told = 0  # lost messages in the last message on /diagnostics
        folder = self.values['folder'] or f'trial_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}'
        about = custom_data or {label.MADE_WITH: json.dumps(label.made_with())}
        self._bag = BagWriter(folder, about)
        self._intake = Intake(self)
        self._topics: dict[str, tuple[Topic, Wire | None]] = {}  # by full name
        for topic in topics.RECORDED:
            name, wire = self.resolve_topic_name(topic.name()), None
            if topic.record:
                wire = Wire(topic.record, self.values['legs'])
            self._topics[name] = topic, wire
            self._bag.add_topic(name, topic.type_name, qos.offered(topic))
            profile = qos.recording(topic, self.values['reliable'])
            self._intake.add(name, qos.message_class(topic.type_name), profile)
        self._collector: _Parameters | None = None
        if custom_data is None:
            self._collector = _Parameters(self, self._bag)
        # In wall time, independent of the clock of the trial.
        self.every(FLUSH_PERIOD, self._look)
        self.every(INTAKE_PERIOD, self._take)
        self.get_logger().info(f'recording {len(self._topics)} topics into {folder}')

    @property
    def message_count(self) -> int:
        """Number of messages recorded so far."""
        return self._bag.message_count if self._bag else 0

    @property
    def lost(self) -> dict[str, int]:
        """Number of messages that were lost before they arrived, by topic, where there are any."""
        return dict(self._intake.lost)

    @property
    def time_ns(self) -> int:
        """Time of the trial, ns."""
        return self._clock_ns if self.simulated else time.time_ns()

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Subscriptions whose messages an executor takes: not the recorded ones."""
        recorded = list(self._intake.subscriptions.values())
        return (each for each in super().subscriptions if each not in recorded)

    def _take(self) -> None:
        try:
            self._intake.take(self._write)
        except BagError:
            # Raise once only: later messages fail because the bag is closed.
            if not self._failed:
                self._failed = True
                raise

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add custom data about the trial to the bag."""
        if self._bag:
            self._bag.describe(custom_data)

    def close(self) -> None:
        """Stop recording and close the bag.

        Raises
        ------
        BagError
            When the disk is full; it says how many messages are saved.
        """
        if not self._bag:
            return
        if not self._failed:
            self._take()
        self._intake.close()
        self._bag.describe({label.LOST: json.dumps(self.lost)})
        self._bag.close()

    def destroy_node(self) -> None:
        """Close the bag, if it is open, and the node; raise the same errors as :meth:`close`."""
        try:
            self.close()
        finally:
            super().destroy_node()

    def _look(self) -> None:
        """Flush the bag, also when no messages arrive, and request parameters of new nodes."""
        if self._failed or not self._bag:
            return
        if self._collector:
            self._collector.look()
        lost = self._intake.lost.total()
        if lost > self._told:
            self._told = lost
            text = f'{LATE}: {lost} messages lost so far'
            self.get_logger().warning(text)
            self.report(self.now_ns(), [self.status('lost messages', self.WARN, text, self.lost)])
        try:
            self._bag.flush()
        except BagError:
            self._failed = True
            raise

    def _write(self, name: str, data: bytes, at_ns: int) -> None:
        """Write a message that was received at a time, ns."""
        assert self._bag
        topic, wire = self._topics[name]
        records = [(at_ns, data)]
        if wire:
            try:
                records = wire.split(data)
            except BadMessage as error:
                self.refuse(name, error)  # it is kept all the same
        elif self.simulated and (topic.frame or topic is topics.CLOCK):
            records = [(_stamp_of(data), data)]
            if topic is topics.CLOCK:
                self._clock_ns = max(0, records[0][0])
        elif self.simulated:
            records = [(self._clock_ns, data)]
        late_ns = 0 if self.simulated else at_ns - records[-1][0]
        for stamp_ns, record in records:
            self._bag.write(name, record, max(0, stamp_ns + late_ns))  # a bag begins at 0


class _Parameters:
    """Parameters of the robot's nodes, which are requested for a bag as the nodes appear."""

    def __init__(self, node: RecorderNode, bag: BagWriter) -> None:
        self._node, self._bag = node, bag
        self._clients: dict[str, tuple[Client, Client] | None] = {}  # by full name of the node
        # A node publishes changes of its parameters: another publisher is a node that restarted.
        self._looks: Counter[bytes] = Counter()
        self._answered: set[bytes] = set()
        self._values: dict[str, dict[str, Any]] = {}
        self._changes: list[tuple[int, str, str, Any]] = []
        node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_change, qos_profile_parameter_events
        )

    def look(self) -> None:
        """Request the parameters of new nodes when their services are there.

        A request without a response is repeated, ever more seldom, to spare a slow node.
        """
        namespace = self._node.get_namespace()
        for each in self._node.get_publishers_info_by_topic('/parameter_events'):
            name, publisher = each.node_name, bytes(each.endpoint_gid)
            hidden = name.startswith('_')  # also that of a node whose name is not known yet
            if hidden or publisher in self._answered or each.node_namespace != namespace:
                continue
            node = f'{namespace.rstrip("/")}/{name}'
            if node not in self._clients:
                self._clients[node] = self._made(node)
            clients = self._clients[node]
            if clients and all(client.service_is_ready() for client in clients):
                self._looks[publisher] += 1
                if self._looks[publisher].bit_count() == 1:  # 1, 2, 4, 8 and so on
                    self._request(publisher, node, *clients)

    def _made(self, node: str) -> tuple[Client, Client] | None:
        """Return clients of a node, which list its parameters and get them."""
        try:
            lister = self._node.create_client(ListParameters, f'{node}/list_parameters')
            return lister, self._node.create_client(GetParameters, f'{node}/get_parameters')
        except RuntimeError as error:  # SROS 2 may forbid these clients
            log = self._node.get_logger()
            log.warning(f'the bag will lack the parameters of {node}: {error}')
            return None

    def _request(self, publisher: bytes, node: str, lister: Client, getter: Client) -> None:
        known: dict[str, Any] = {}

        def on_names(future: Future) -> None:
            self._values.setdefault(node, {})  # changes from now on are recorded
            ask(list(future.result().result.names))

        def ask(names: list[str]) -> None:
            request = GetParameters.Request(names=names)
            getter.call_async(request).add_done_callback(partial(on_values, names))

        def on_values(names: list[str], future: Future) -> None:
            # Not before: after a restart, get_parameters may be discovered after list_parameters.
            self._answered.add(publisher)
            values = future.result().values
            if len(values) < len(names):  # one that has no value leaves all others out
                for name in names[1:] and names:
                    ask([name])
                return
            for name, value in zip(names, values, strict=True):
                with suppress(RuntimeError):  # a type that ROS does not have
                    known[name] = plain(parameter_value_to_python(value))
            self._values[node] = known
            self._bag.describe({label.PARAMETERS: json.dumps(self._values)})

        lister.call_async(ListParameters.Request()).add_done_callback(on_names)

    def _on_change(self, event: ParameterEvent) -> None:
        """Record changed parameters of the nodes whose parameters are in the bag."""
        if event.node not in self._values:
            return
        for each in event.changed_parameters:
            with suppress(RuntimeError):
                value = plain(parameter_value_to_python(each.value))
                self._changes.append((self._node.time_ns, event.node, each.name, value))
        self._bag.describe({label.CHANGES: json.dumps(self._changes)})


def _stamp_of(data: bytes) -> int:
    """Return the time, ns, with which a message in plain CDR begins; 0 if there is none."""
    try:
        seconds, rest = _STAMPS[data[1] & 1].unpack_from(data)
    except (IndexError, struct.error):
        return 0
    return int(seconds * 1_000_000_000 + rest)


if __name__ == '__main__':
    sys.exit(run(RecorderNode))
