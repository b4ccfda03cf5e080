# SPDX-License-Identifier: Apache-2.0
"""The merge node: joins what drivers of others publish by leg into records.

Drivers may publish ``leg_i/wrench``, ``leg_i/position``, ``leg_i/pressure`` and the other topics
of :data:`ros_pad.bags.topics.FROM_DRIVERS`; all other nodes of ros_pad receive records alone. A
record that somebody else publishes is not published here: two sources would contradict each other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ros_pad.bags import topics
from ros_pad.bags.topics import FRAME, Topic
from ros_pad.errors import BadMessage
from ros_pad.estimation.tuning import SOURCES
from ros_pad.joining import WAIT_NS, Joiner
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.parameters import AMBIENT_PRESSURE, LEGS, Parameter, chosen
from ros_pad.records import Block

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
        read=chosen(topics.FROM_DRIVERS),
    ),
)  # fmt: skip


_OF_A_LEG = re.compile(r'(?:.*/)?leg_(\d+)_', re.DOTALL)


class MergeNode(PadNode):
    """Join messages of single legs into records; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    contested : Counter of str
        Records that were not published because others publish them, by topic.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('merge', PARAMETERS, **kwargs)
        legs, self.contested = self.values['legs'], Counter[str]()
        needed = ('force', 'position', 'velocity')[: 3 if self.values['source'] == 'joints' else 2]
        pieces = {topics.SAMPLE: needed, topics.FORCE: ('force',)}
        self._joiners = {
            topic: Joiner(topic.record, legs, pieces.get(topic, ()))
            for topic in (topics.SAMPLE, topics.FORCE, topics.PRESSURE, topics.COMMAND)
            if topic.record
        }
        # A publisher is made with the first record.
        self._outputs: dict[Topic, Callable[[Block], None]] = {}
        for topic in self.values['topics']:
            joined = topics.FORCE
            if topic is not topics.LEG_FOOT_WRENCH:
                joined = next(each for each in topics.RECORDS if each.record is topic.record)
            for leg in legs:
                take = partial(self._take, joined, topic, leg)
                self.receive(topic, take, (FRAME, *topic.values), leg)
        self.on_tick(self._on_time, WAIT_NS * 1e-9, all_steps=True)

    def _take(
        self, joined: Topic, topic: Topic, leg: int, stamp_ns: int, frame: str, *values: float
    ) -> None:
        """Process a message of a leg."""
        named = _OF_A_LEG.match(frame)
        if named and named[1] != str(leg):  # two cables or topics may be swapped
            error = BadMessage(f'frame_id = {frame[:80]!r} is that of another leg')
            self.refuse(self.resolve_topic_name(topic.name(leg)), error)
            return
        numbers = topics.to_record(topic, np.array(values), self.values['ambient_pressure'])
        piece = dict(zip(topic.columns, numbers.tolist(), strict=True))
        self._send(joined, self._joiners[joined].add(leg, stamp_ns or self.now_ns(), piece))

    def _send(self, topic: Topic, blocks: list[Block]) -> None:
        for block in blocks:
            name = topic.name()
            if self.count_publishers(name) > (topic in self._outputs):
                self.contested[name] += 1
                self.get_logger().error(
                    f'{name}: somebody else publishes it: what drivers publish by leg is refused',
                    throttle_duration_sec=10.0,
                )
                continue
            if topic not in self._outputs:
                self._outputs[topic] = self.record_output(topic, self.values['legs'])
            self._outputs[topic](block)

    def _on_time(self, now_ns: int) -> None:
        for topic, joiner in self._joiners.items():
            self._send(topic, joiner.expire(now_ns))
        if self.due(now_ns) and (self.contested or self.refused):
            text = 'others publish records too: those of this node are refused'
            statuses = [self.status('records', self.ERROR, text, self.contested)]
            self.report(now_ns, statuses if self.contested else [])
