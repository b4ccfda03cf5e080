# SPDX-License-Identifier: Apache-2.0
"""The views node: shows single legs of records to people, and to drivers of others.

It publishes ``leg_i/wetness``, ``leg_i/wrench`` and the other topics of
:data:`ros_pad.bags.topics.OF_LEGS`, among them ``leg_i/pressure_setpoint`` for regulators of
others, and markers of the feet coloured by their probability of wet ground.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.node import Node
from std_msgs.msg import String

from ros_pad.bags import topics as schemas
from ros_pad.bags.topics import STAMP
from ros_pad.control.policies import DOME, FLAT
from ros_pad.estimation import doubt as doubts
from ros_pad.nodes import topics
from ros_pad.nodes.markers import ARRAY, marker_of_foot
from ros_pad.nodes.messages import Messages
from ros_pad.nodes.parameters import AMBIENT_PRESSURE, LEGS, Parameter, declare
from ros_pad.nodes.process import run
from ros_pad.nodes.stamps import set_stamp, split
from ros_pad.pace import Pace
from ros_pad.records import Block

SHOWN = [each for each in schemas.OF_LEGS if each is not schemas.LEG_FOOT_WRENCH]
"""Topics of a leg that records have."""

PARAMETERS = (
    LEGS,
    AMBIENT_PRESSURE,
    Parameter(
        'topics',
        ', '.join(each.kind for each in SHOWN),
        'Topics of each leg that are published, with commas between them: not those of a driver.',
        read=lambda text: topics.chosen(text, SHOWN),
    ),
    Parameter(
        'frame', 'world', 'Frame of the positions of the feet: world, or odom without markers.'
    ),
)

MARKERS_PERIOD_NS = 100_000_000
"""Time between two messages of markers, ns."""

Show = Callable[[int, Any], None]
"""Publishes a row of a record with its stamp, ns."""


class ViewsNode(Node):
    """Publish what records say of single legs; parameters are in :data:`PARAMETERS`.

    Attributes
    ----------
    messages : Messages
        Publishers and subscriptions.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('views', automatically_declare_parameters_from_overrides=True, **kwargs)
        values = declare(self, PARAMETERS)
        self._ambient, self._frame = values['ambient_pressure'], values['frame']
        self._legs: list[int] = values['legs']
        self.messages = messages = Messages(self)
        texts = {schemas.LEG_DOUBT: _doubt, schemas.LEG_MORPHOLOGY: _morphology}
        shows: dict[str, list[tuple[int, Show]]] = {}
        for index, leg in enumerate(self._legs):
            for schema in values['topics']:
                assert schema.record
                show = self._text(schema, leg, texts[schema]) if schema.text else None
                show = show or self._numbers(schema, leg)
                shows.setdefault(f'feet/{schema.record.name}', []).append((index, show))
        for topic in topics.RECORDS:
            if topic is not topics.FORCE:
                messages.receive_record(
                    topic, self._legs, partial(self._show, shows.get(topic.name(), []))
                )
        messages.receive_record(topics.ESTIMATE, self._legs, self._mark)
        self._send_markers = messages.output(topics.FEET_MARKERS)
        self._pace = Pace(MARKERS_PERIOD_NS)
        self._places = np.full((len(self._legs), 2), np.nan)

    def _numbers(self, schema: schemas.Topic, leg: int) -> Show:
        """Return a function that publishes numbers of a leg, if none of them is missing."""
        topic = topics.of_leg(schema)
        send = self.messages.sender(topic, (*(STAMP if schema.frame else ()), *schema.values), leg)
        assert schema.record
        columns = [schema.record.columns.index(each) for each in schema.columns]
        needed = slice(0, 3) if schema is schemas.LEG_WRENCH else slice(None)

        def show(stamp_ns: int, row: np.ndarray) -> None:
            numbers = np.atleast_1d(row).view('f8').ravel()[columns]
            if np.isnan(numbers[needed]).any():
                return
            values = schemas.from_record(
                schema, np.nan_to_num(numbers, posinf=np.inf), self._ambient
            )
            send(*(split(stamp_ns) if schema.frame else ()), *values.tolist())

        return show

    def _text(self, schema: schemas.Topic, leg: int, text_of: Callable[[Any], str | None]) -> Show:
        """Return a function that publishes a text of a leg when it changes."""
        publish, last = self.messages.output(topics.of_leg(schema), leg), ['?']

        def show(stamp_ns: int, row: np.ndarray) -> None:
            text = text_of(row)
            if text is not None and text != last[0]:
                last[0] = text
                publish(String(data=text))

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
        if not self._pace.due(block.last_ns):
            return
        array = ARRAY.blank()
        for leg, place, wetness in zip(
            self._legs, self._places.tolist(), rows['wetness'].tolist(), strict=True
        ):
            if math.isfinite(sum(place)):
                marker = marker_of_foot(leg, place[0], place[1], wetness)
                marker.header.frame_id = self._frame
                set_stamp(marker.header.stamp, block.last_ns)
                array.markers.append(marker)
        self._send_markers(ARRAY.encode(array))


def _doubt(row: Any) -> str | None:
    """Return the doubt in an estimate as text; None where it is missing."""
    return None if math.isnan(row['doubt']) else doubts.text(row['doubt'], *row['detail'])


def _morphology(row: Any) -> str | None:
    """Return the morphology in a command; None where it is missing."""
    return None if math.isnan(row['dome']) else DOME if row['dome'] == 1.0 else FLAT


def main(args: list[str] | None = None) -> int:
    """Run the node until it is interrupted; return the exit status."""
    return run(ViewsNode, args)


if __name__ == '__main__':
    sys.exit(main())
