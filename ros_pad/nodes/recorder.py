# SPDX-License-Identifier: Apache-2.0
"""The recorder node: writes all topics of a robot into a bag."""

from __future__ import annotations

import dataclasses
import datetime
import json
import struct
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_parameter_events
from rclpy.subscription import Subscription
from rclpy.task import Future

from ros_pad.bags import BagWriter
from ros_pad.bags.wire import Wire
from ros_pad.bags.writer import FLUSH_PERIOD
from ros_pad.errors import BadMessage, BagError
from ros_pad.nodes import qos, topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.intake import Intake
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import LEGS, Parameter, declare, plain
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


_Write = Callable[[bytes, int], None]

_STAMPS = [struct.Struct(order + '4xiI') for order in '><']  # by the byte order of a message

INTAKE_PERIOD = 0.1
"""Time after which received messages are written, s; the middleware keeps them until then."""


@dataclasses.dataclass
class _Peer:
    """A node of the robot, and the state of the requests for its parameters."""

    clients: tuple[Client, Client] | None  # list and get parameters; None where that is forbidden
    publishers: set[bytes] = dataclasses.field(default_factory=set)  # of its parameter events
    looks: int = 0  # calls of due() since the node appeared or restarted
    answered: bool = False

    def due(self) -> bool:
        """Count a call; return True at calls 1, 2, 4, 8 and so on, to spare a slow node."""
        self.looks += 1
        return self.looks & (self.looks - 1) == 0


class RecorderNode(Node):
    """Write every topic of `ros_pad.nodes.topics`, latched ones too, into a new bag.

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

    def __init__(
        self,
        custom_data: Mapping[str, str] | None = None,
        **kwargs: Any,
    ) -> None:
        super().__init__('recorder', **kwargs)
        try:
            values = declare(self, PARAMETERS)
            folder = values['folder'] or f'trial_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}'
            recorded = topics.names()
            self._reliable: bool = values['reliable']
            self._simulated = self.get_parameter('use_sim_time').value
            self._clock_ns = 0
            about = dict(custom_data or {label.MADE_WITH: json.dumps(label.made_with())})
            self._bag = BagWriter(folder, about)
        except BaseException:
            super().destroy_node()
            raise
        self._intake = Intake(self)
        self._told = 0  # lost messages in the last message on /diagnostics
        messages = Messages(self)
        self._diagnostics, self._refusals = Diagnostics(self, messages), messages.refusals
        self._failed = False  # whether writing has failed
        self._writers: dict[str, _Write] = {}  # by full name of the topic
        for name, topic in recorded.items():
            full_name = self.resolve_topic_name(name)
            self._bag.add_topic(full_name, topic.type_name, qos.offered_profiles(topic.publish))
            self._writers[full_name] = self._writer(full_name, topic, values['legs'])
            self._intake.add(full_name, topic.message, partial(self._profile, topic))
        self._peers: dict[str, _Peer] = {}
        self._node_parameters: dict[str, dict[str, Any]] = {}  # by full name of the node
        # In wall time, independent of the clock of the trial.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(FLUSH_PERIOD, self._look, clock=steady)
        self.create_timer(INTAKE_PERIOD, self._take, clock=steady)
        self._collects_parameters = custom_data is None
        self._changes: list[tuple[int, str, str, Any]] = []
        if self._collects_parameters:
            self.create_subscription(
                ParameterEvent, '/parameter_events', self._on_change, qos_profile_parameter_events
            )
        self.get_logger().info(f'recording {len(recorded)} topics into {self._bag.folder}')

    @property
    def message_count(self) -> int:
        """Number of messages recorded so far."""
        return self._bag.message_count

    @property
    def lost(self) -> dict[str, int]:
        """Number of messages that were lost before they arrived, by topic, where there are any."""
        return dict(self._intake.lost)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """Subscriptions whose messages an executor takes: not the recorded ones."""
        recorded = self._intake.subscriptions if hasattr(self, '_intake') else []
        return (each for each in super().subscriptions if each not in recorded)

    def _take(self) -> None:
        try:
            self._intake.take(lambda name, data, at_ns: self._writers[name](data, at_ns))
        except BagError:
            # Raise once only: later messages fail because the bag is closed.
            if not self._failed:
                self._failed = True
                raise

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add custom data about the trial to the bag."""
        self._bag.describe(custom_data)

    def close(self, custom_data: Mapping[str, str] | None = None) -> None:
        """Stop recording and close the bag.

        Parameters
        ----------
        custom_data : mapping of str to str, optional
            Added to the custom data of the bag.

        Raises
        ------
        BagError
            When the disk is full; it says how many messages are saved.
        """
        if not self._failed:
            self._take()
        self._intake.close()
        self._bag.close({label.LOST: json.dumps(self.lost)} | dict(custom_data or {}))

    def destroy_node(self) -> None:
        """Close the bag, if it is open, and the node; raise the same errors as :meth:`close`."""
        try:
            self.close()
        finally:
            super().destroy_node()

    def _profile(self, topic: topics.Topic, offered: list[QoSProfile]) -> QoSProfile:
        measured = topic.subscribe.reliability == ReliabilityPolicy.BEST_EFFORT
        # Drivers of sensors may offer less than is requested: request less.
        return qos.recording([topic.publish, *offered], measured and not self._reliable)

    def _look(self) -> None:
        """Flush the bag, also when no messages arrive, and request parameters of new nodes."""
        if self._failed:
            return
        if self._collects_parameters:
            self._look_for_nodes()
        lost = self._intake.lost.total()
        if lost > self._told:
            self.get_logger().warning(f'{lost} messages lost so far: see /diagnostics')
            self._told = lost
            self._diagnose()
        try:
            self._bag.flush()
        except BagError:
            self._failed = True
            raise

    def _diagnose(self) -> None:
        """Tell on ``/diagnostics`` how many messages were lost."""
        text = f'{LATE}: {self._told} messages lost so far'
        status = self._diagnostics.status('lost messages', Diagnostics.WARN, text, self.lost)
        self._diagnostics.send(self.get_clock().now().nanoseconds, [status])

    def _look_for_nodes(self) -> None:
        """Request the parameters of every node of the robot when its services are there.

        A request without a response is repeated, and a node that restarts gets a new request. A
        killed node stays on the graph for a while: when it restarts before its name is removed,
        only its publishers are new.
        """
        here = {
            f'{namespace.rstrip("/")}/{name}'
            for name, namespace in self.get_node_names_and_namespaces()
            if namespace == self.get_namespace() and not name.startswith('_')
        }
        for node in self._peers.keys() - here:
            for client in self._peers.pop(node).clients or ():
                self.destroy_client(client)
        publishers: dict[str, set[bytes]] = {}
        for each in self.get_publishers_info_by_topic('/parameter_events'):
            node = f'{each.node_namespace.rstrip("/")}/{each.node_name}'
            publishers.setdefault(node, set()).add(bytes(each.endpoint_gid))
        for node in here:
            peer = self._peers.get(node)
            if peer is None:
                peer = self._peers[node] = _Peer(self._parameter_clients(node))
            found = publishers.get(node, set())
            if found - peer.publishers:
                peer.answered, peer.looks = False, 0
            peer.publishers = found
            if peer.clients and not peer.answered:
                ready = all(client.service_is_ready() for client in peer.clients)
                if ready and peer.due():
                    self._request_names(node, peer, *peer.clients)

    def _parameter_clients(self, node: str) -> tuple[Client, Client] | None:
        try:
            lister = self.create_client(ListParameters, f'{node}/list_parameters')
            return lister, self.create_client(GetParameters, f'{node}/get_parameters')
        except RuntimeError as error:  # SROS 2 may forbid these clients
            self.get_logger().warning(f'the bag will lack the parameters of {node}: {error}')
            return None

    def _request_names(self, node: str, peer: _Peer, lister: Client, getter: Client) -> None:
        def on_response(future: Future) -> None:
            self._node_parameters.setdefault(node, {})  # changes from now on are recorded
            self._request_values(list(future.result().result.names), node, peer, getter, {})

        lister.call_async(ListParameters.Request()).add_done_callback(on_response)

    def _request_values(
        self, names: list[str], node: str, peer: _Peer, getter: Client, known: dict[str, Any]
    ) -> None:
        """Request values of a node's parameters, and add them to the known ones in the bag."""

        def on_response(future: Future) -> None:
            # Not before: after a restart, get_parameters may be discovered after list_parameters.
            peer.answered = True
            values = future.result().values
            if len(values) == len(names):
                try:
                    known.update(
                        (name, plain(parameter_value_to_python(value)))
                        for name, value in zip(names, values, strict=True)
                    )
                except RuntimeError as error:  # the parameter type is unknown to ROS
                    self.get_logger().warning(
                        f'the bag will lack parameters of {node}: {error}', once=True
                    )
                    return
                self._node_parameters[node] = known
                self._bag.describe({label.PARAMETERS: json.dumps(self._node_parameters)})
            elif len(names) > 1:
                # If one requested parameter has no value, the response has no values at all:
                # request each parameter alone.
                for name in names:
                    self._request_values([name], node, peer, getter, known)

        request = GetParameters.Request(names=names)
        getter.call_async(request).add_done_callback(on_response)

    def _on_change(self, event: ParameterEvent) -> None:
        """Record changed parameters of the nodes whose parameters are in the bag."""
        if event.node not in self._node_parameters:
            return
        now_ns = self._clock_ns if self._simulated else time.time_ns()
        for each in event.changed_parameters:
            with suppress(RuntimeError):  # skip a parameter of a type that ROS does not have
                value = plain(parameter_value_to_python(each.value))
                self._changes.append((now_ns, event.node, each.name, value))
        self._bag.describe({label.CHANGES: json.dumps(self._changes)})

    def _writer(self, name: str, topic: topics.Topic, legs: Sequence[int]) -> _Write:
        """Return a function that writes a message: its bytes, and time of receipt, ns."""
        write = self._bag.write
        if topic is topics.CLOCK:
            return partial(self._write_clock, name)
        if topic.schema.record and not topic.schema.columns:
            return partial(self._write_records, name, Wire(topic.schema.record, legs).split)
        if not self._simulated:
            return lambda data, at_ns: write(name, data, at_ns)
        if not topic.schema.frame:
            return lambda data, _: write(name, data, self._clock_ns)
        return lambda data, _: write(name, data, _stamp_of(data))

    def _write_clock(self, name: str, data: bytes, at_ns: int) -> None:
        if self._simulated:
            at_ns = self._clock_ns = max(0, _stamp_of(data))  # a bag has no times before 0
        self._bag.write(name, data, at_ns)

    def _write_records(
        self, name: str, split: Callable[[bytes], list[tuple[int, bytes]]], data: bytes, at_ns: int
    ) -> None:
        try:
            records = split(data)
        except BadMessage as error:
            self._refusals(name, error)
            records = [(at_ns, data)]  # it is kept all the same
        last_ns = records[-1][0]
        for stamp_ns, record in records:
            time_ns = stamp_ns if self._simulated else at_ns - (last_ns - stamp_ns)
            self._bag.write(name, record, max(0, time_ns))


def _stamp_of(data: bytes) -> int:
    """Return the time, ns, with which a message in plain CDR begins; 0 before 1970."""
    try:
        seconds, rest = _STAMPS[data[1] & 1].unpack_from(data)
    except (IndexError, struct.error):
        return 0
    return int(max(0, seconds * 1_000_000_000 + rest))


def main(args: list[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM; return the exit status.

    Returns
    -------
    int
        0 when the bag was closed, 1 when it could not be written, 2 for a bad parameter.
    """
    return run(RecorderNode, args)


if __name__ == '__main__':
    sys.exit(main())
