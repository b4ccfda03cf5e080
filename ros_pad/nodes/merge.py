# SPDX-License-Identifier: Apache-2.0
"""The merge node: joins what drivers of others publish by leg into records.

Drivers may publish ``leg_i/wrench``, ``leg_i/position``, ``leg_i/pressure`` and the other topics
of :data:`ros_pad.bags.topics.FROM_DRIVERS`; all other nodes of ros_pad receive records alone. A
record that somebody else publishes is not published here: two sources would contradict each other.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.node import Node

from ros_pad.bags import topics as schemas
from ros_pad.bags.topics import FRAME, STAMP
from ros_pad.errors import InvalidInput
from ros_pad.estimation.tuning import SOURCES
from ros_pad.joining import WAIT_NS, Joiner
from ros_pad.nodes import topics
from ros_pad.nodes.diagnostics import Diagnostics
from ros_pad.nodes.frames import check_frame
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import AMBIENT_PRESSURE, LEGS, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.records import COMMAND, PRESSURE, SAMPLE, Block

PARAMETERS = (
    LEGS,
    AMBIENT_PRESSURE,
    Parameter(
        'source', 'markers', 'What a sample needs beside the force: position, or velocity, too.',
        choices=SOURCES,
    ),
    Parameter(
        'topics', 'wrench, position, foot_wrench, pressure',
        'Topics of each leg that are joined, with commas between them; also contact_velocity and'
        ' pressure_setpoint.',
        read=lambda text: topics.chosen(text, schemas.FROM_DRIVERS),
    ),
)  # fmt: skip


class MergeNode(Node):
    """Join messages of single legs into records; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    messages : Messages
        Publishers and subscriptions.
    refused : dict of str to int
        Records that were not published because others publish them, by topic.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('merge', automatically_declare_parameters_from_overrides=True, **kwargs)
        values = declare(self, PARAMETERS)
        self._legs, self._ambient = values['legs'], values['ambient_pressure']
        self.messages = messages = Messages(self)
        self.refused: dict[str, int] = {}
        needed = ('force', 'position') + (('velocity',) if values['source'] == 'joints' else ())
        self._records = {
            topic.name(): _Record(self, topic, Joiner(kind, self._legs, fields))
            for topic, kind, fields in (
                (topics.SAMPLE, SAMPLE, needed),
                (topics.FORCE, SAMPLE, ('force',)),
                (topics.PRESSURE, PRESSURE, ()),
                (topics.COMMAND, COMMAND, ()),
            )
        }
        for schema in values['topics']:
            assert schema.record
            name = 'force' if schema is schemas.LEG_FOOT_WRENCH else schema.record.name
            record, topic = self._records[f'feet/{name}'], topics.of_leg(schema)
            for leg in self._legs:
                messages.receive(
                    topic,
                    partial(self._take, record, schema, leg),
                    (FRAME, *STAMP, *schema.values),
                    leg,
                )
        self._diagnostics = Diagnostics(self, messages)
        messages.on_tick(WAIT_NS * 1e-9, self._tick, every=True)

    def _take(
        self,
        record: _Record,
        schema: schemas.Topic,
        leg: int,
        frame: str,
        seconds: int,
        fraction: int,
        *values: float,
    ) -> None:
        """Process a message of a leg."""
        try:
            check_frame(frame, leg)
        except InvalidInput as error:
            self.messages.refusals(self.resolve_topic_name(schema.name(leg)), error)
            return
        stamp_ns = seconds * 1_000_000_000 + fraction or self.messages.now_ns()
        numbers = schemas.to_record(schema, np.array(values), self._ambient)
        record.add(leg, stamp_ns, dict(zip(schema.columns, numbers.tolist(), strict=True)))

    def _tick(self, now_ns: int) -> None:
        for record in self._records.values():
            record.expire(now_ns)
        if self._diagnostics.due(now_ns):
            self._diagnose(now_ns)

    def _diagnose(self, now_ns: int) -> None:
        statuses = []
        if self.refused:
            text = 'others publish records too: those of this node are refused'
            statuses.append(
                self._diagnostics.status('records', Diagnostics.ERROR, text, self.refused)
            )
        if statuses or self.messages.refusals.counts:
            self._diagnostics.send(now_ns, statuses)


class _Record:
    """A record that is joined, and its publisher, which is made with the first piece."""

    def __init__(self, node: MergeNode, topic: topics.Topic, joiner: Joiner) -> None:
        self._node, self._topic, self._joiner = node, topic, joiner
        self._publish: Callable[[Block], None] | None = None

    def add(self, leg: int, stamp_ns: int, values: dict[str, float]) -> None:
        """Add what a message of a leg has: numbers of the record, by column."""
        self._send(self._joiner.add(leg, stamp_ns, values))

    def expire(self, now_ns: int) -> None:
        """Publish what has waited too long."""
        self._send(self._joiner.expire(now_ns))

    def _send(self, blocks: list[Block]) -> None:
        for block in blocks:
            node, name = self._node, self._topic.name()
            if node.count_publishers(name) > (self._publish is not None):
                node.refused[name] = node.refused.get(name, 0) + 1
                node.get_logger().error(
                    f'{name}: somebody else publishes it: what drivers publish by leg is refused',
                    throttle_duration_sec=10.0,
                )
                continue
            if self._publish is None:
                legs = node.get_parameter('legs').value
                self._publish = node.messages.record_output(self._topic, legs)
            self._publish(block)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(MergeNode, args)


if __name__ == '__main__':
    sys.exit(main())
