# SPDX-License-Identifier: Apache-2.0
"""The recorder node: writes all topics of a robot into a bag."""

from __future__ import annotations

import datetime
import json
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from rclpy.subscription import Subscription

from ros_pad.bags import BagWriter, topics
from ros_pad.bags.codec import message_type
from ros_pad.bags.topics import Topic
from ros_pad.bags.wire import Wire
from ros_pad.bags.writer import FLUSH_PERIOD
from ros_pad.errors import BadMessage, BagError
from ros_pad.nodes import qos
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.intake import Intake
from ros_pad.nodes.parameters import LEGS, Parameter
from ros_pad.pace import LATE
from ros_pad.trials import bag_notes

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

_TEXT = message_type(topics.PARAMETERS.type_name)
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
    `ros_pad.trials.bag_notes.LOST`.

    Its ROS parameters are in :data:`PARAMETERS`; ``use_sim_time`` is read at the start only.

    Parameters
    ----------
    custom_data : mapping of str to str, optional
        Texts about the trial, for the bag; without it, the versions of ros_pad and its libraries.
        The first parameters of all nodes of ros_pad in the namespace of this one, and changes,
        are added.
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

    def __init__(self, custom_data: Mapping[str, str] | None = None, **kwargs: Any) -> None:
        super().__init__('recorder', PARAMETERS, **kwargs)
        self._clock_ns = 0
        self._failed = False  # whether writing has failed
        self._told = 0  # lost messages in the last message on /diagnostics
        folder = self.values['folder'] or f'trial_{datetime.datetime.now():%Y_%m_%d-%H_%M_%S}'
        about = custom_data or {bag_notes.MADE_WITH: json.dumps(bag_notes.made_with())}
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
        self._first: dict[str, dict[str, Any]] = {}  # first values, by node
        self._newest: dict[str, dict[str, Any]] = {}
        self._changes: list[tuple[int, str, str, Any]] = []
        self._receive(topics.PARAMETERS, None, _parameters_in, self._on_parameters)
        # In wall time, independent of the clock of the trial.
        self.every(FLUSH_PERIOD, self._look)
        self.every(INTAKE_PERIOD, partial(self._save, self._intake.take, self._write))
        self.get_logger().info(f'recording {len(self._topics)} topics into {folder}')

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
        recorded = list(self._intake.subscriptions.values())
        return (each for each in super().subscriptions if each not in recorded)

    def _save(self, work: Callable[..., object], *given: Any) -> None:
        """Do what writes into the bag, until it fails once: the bag is closed then."""
        if self._failed:
            return
        try:
            work(*given)
        except BagError:
            self._failed = True
            raise

    def describe(self, custom_data: Mapping[str, str]) -> None:
        """Add custom data about the trial to the bag."""
        self._bag.describe(custom_data)

    def close(self) -> None:
        """Stop recording and close the bag.

        Raises
        ------
        BagError
            When the disk is full; it says how many messages are saved.
        """
        self._save(self._intake.take, self._write)
        self._intake.close()
        self._bag.describe({bag_notes.LOST: json.dumps(self.lost)})
        self._bag.close()

    def destroy_node(self) -> None:
        """Close the bag, if it is open, and the node; raise the same errors as :meth:`close`."""
        try:
            self.close()
        finally:
            super().destroy_node()

    def _look(self) -> None:
        """Flush the bag, also when no messages arrive, and report lost ones."""
        lost = self._intake.lost.total()
        if lost > self._told:
            self._told = lost
            text = f'{LATE}: {lost} messages lost so far'
            self.get_logger().warning(text)
            self.report(self.now_ns(), [self.status('lost messages', self.WARN, text, self.lost)])
        self._save(self._bag.flush)

    def _on_parameters(self, given: tuple[str, dict[str, Any]]) -> None:
        """Describe a node in the bag: its first parameters, and later changes."""
        node, values = given
        before = self._newest.get(node)
        self._newest[node] = values
        if before is None:
            self._first[node] = values
            self.describe({bag_notes.PARAMETERS: json.dumps(self._first)})
            return
        at_ns = self._clock_ns if self.simulated else time.time_ns()
        changed = [name for name in values if name not in before or before[name] != values[name]]
        self._changes += [(at_ns, node, name, values[name]) for name in changed]
        self.describe({bag_notes.CHANGES: json.dumps(self._changes)})

    def _write(self, name: str, data: bytes, at_ns: int) -> None:
        """Write a message that was received at a time, ns."""
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


def _parameters_in(data: bytes) -> tuple[str, dict[str, Any]]:
    """Return the name of a node and the values of its parameters, from a message."""
    ((node, values),) = json.loads(_TEXT.decode(data).data).items()
    return node, dict(values)


def _stamp_of(data: bytes) -> int:
    """Return the time, ns, with which a message in plain CDR begins; 0 if there is none."""
    try:
        seconds, rest = _STAMPS[data[1] & 1].unpack_from(data)
    except (IndexError, struct.error):
        return 0
    return int(seconds * 1_000_000_000 + rest)
