# SPDX-License-Identifier: Apache-2.0
"""The views node: shows single legs of records to people, and to drivers of others.

It publishes ``leg_i/wetness``, ``leg_i/wrench`` and the other topics of
:data:`ros_pad.bags.topics.OF_LEGS`, among them ``leg_i/pressure_setpoint`` for regulators of
others, and markers of the feet coloured by their probability of wet ground.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ros_pad.bags import topics
from ros_pad.bags.topics import Topic
from ros_pad.control.policies import DOME, FLAT
from ros_pad.estimation import doubt as doubts
from ros_pad.nodes.base import PadNode
from ros_pad.nodes.markers import MARKERS_PERIOD_NS, array_of, marker_of_foot
from ros_pad.nodes.parameters import AMBIENT_PRESSURE, LEGS, Parameter, chosen
from ros_pad.nodes.qos import publisher
from ros_pad.pace import Pace
from ros_pad.records import Block

SHOWN = [each for each in topics.OF_LEGS if each is not topics.LEG_FOOT_WRENCH]
"""Topics of a leg that records have."""

PARAMETERS = (
    LEGS,
    AMBIENT_PRESSURE,
    Parameter(
        'topics',
        ', '.join(each.kind for each in SHOWN),
        'Topics of each leg that are published, with commas between them: not those of a driver.',
        read=chosen(SHOWN),
    ),
    Parameter(
        'frame', 'world', 'Frame of the positions of the feet: world, or odom without markers.'
    ),
)

Show = Callable[[int, Any], None]
"""Publishes a row of a record with its stamp, ns."""


class ViewsNode(PadNode):
    """Publish what records say of single legs; parameters are in :data:`PARAMETERS`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('views', PARAMETERS, **kwargs)
        self._legs: list[int] = self.values['legs']
        texts = {topics.LEG_DOUBT: _doubt, topics.LEG_MORPHOLOGY: _morphology}
        for record in topics.RECORDS:
            shows: list[tuple[int, Show]] = []
            for index, leg in enumerate(self._legs):
                for topic in self.values['topics']:
                    if topic.record is record.record and record is not topics.FORCE:
                        own = texts.get(topic)
                        show = self._text(topic, leg, own) if own else self._numbers(topic, leg)
                        shows.append((index, show))
            if shows:
                self.receive_record(record, self._legs, partial(self._show, shows))
        self.receive_record(topics.ESTIMATE, self._legs, self._mark)
        self._send_markers = publisher(self, topics.FEET_MARKERS).publish
        self._markers_pace = Pace(MARKERS_PERIOD_NS)
        self._places = np.full((len(self._legs), 2), np.nan)

    def _numbers(self, topic: Topic, leg: int) -> Show:
        """Return a function that publishes numbers of a leg, if none of them is missing."""
        send = self.sender(topic, topic.values, leg)
        assert topic.record
        columns = [topic.record.columns.index(each) for each in topic.columns]
        needed = slice(0, 3) if topic is topics.LEG_WRENCH else slice(None)

        def show(stamp_ns: int, row: np.ndarray) -> None:
            numbers = np.atleast_1d(row).view('f8').ravel()[columns]
            if np.isnan(numbers[needed]).any():
                return
            numbers = np.nan_to_num(numbers, posinf=np.inf)
            values = topics.from_record(topic, numbers, self.values['ambient_pressure'])
            send(*([stamp_ns] if topic.frame else []), *values.tolist())

        return show

    def _text(self, topic: Topic, leg: int, text_of: Callable[[Any], str | None]) -> Show:
        """Return a function that publishes a text of a leg when it changes."""
        send, last = self.sender(topic, topic.values, leg), ['?']

        def show(stamp_ns: int, row: np.ndarray) -> None:
            text = text_of(row)
            if text is not None and text != last[0]:
                last[0] = text
                send(text)

        return show

    def _show(self, shows: list[tuple[int, Show]], block: Block) -> None:
        for stamp_ns, rows in zip(block.stamps.tolist(), block.rows, strict=True):
            for index, show in shows:
                show(stamp_ns, rows[index])

    def _mark(self, block: Block) -> None:
        """Publish the feet as markers, blue where they are likely on wet ground."""
        rows = block.rows[-1]
        known = np.isfinite(rows['position']).all(axis=1)
        self._places[known] = rows['position'][known]
        if not self._markers_pace.due(block.last_ns):
            return
        if self.refused and self.due(block.last_ns):
            self.report(block.last_ns, [])
        feet = zip(self._legs, self._places.tolist(), rows['wetness'].tolist(), strict=True)
        markers = [marker_of_foot(leg, at, wet) for leg, at, wet in feet if math.isfinite(sum(at))]
        self._send_markers(array_of(markers, block.last_ns, self.values['frame']))


def _doubt(row: Any) -> str | None:
    """Return the doubt in an estimate as text; None where it is missing."""
    return None if math.isnan(row['doubt']) else doubts.text(row['doubt'], *row['detail'])


def _morphology(row: Any) -> str | None:
    """Return the morphology in a command; None where it is missing."""
    return None if math.isnan(row['dome']) else DOME if row['dome'] == 1.0 else FLAT
