# SPDX-License-Identifier: Apache-2.0
"""Batches: the measurements that a node publishes at one moment, in one message.

A message costs as much as a hundred numbers in it, and a robot with six legs has 6,000 messages
a second. A batch is a ``std_msgs/UInt8MultiArray``: ``data`` has the messages one after another,
``layout.dim`` has the full name of the topic and the size in bytes of each, and as stride the
number of bytes before it.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence

from rclpy.serialization import deserialize_message
from rclpy.serialization import serialize_message
from std_msgs.msg import MultiArrayDimension
from std_msgs.msg import MultiArrayLayout
from std_msgs.msg import UInt8MultiArray

from ros_pad.errors import BadMessage

_COUNT = struct.Struct('<I')  # length of `data`, which its bytes follow
_MOST_LAYOUTS = 64  # that are remembered
_MOST_MESSAGES = 1000
_LARGEST = 262_144  # bytes; a batch of six legs has 3,000


def batch_head(names: Sequence[str], sizes: Sequence[int]) -> bytes:
    """Return the bytes of a batch that come before its messages.

    Parameters
    ----------
    names : sequence of str
        Full name of the topic of each message.
    sizes : sequence of int
        Number of bytes of each message.
    """
    starts = itertools.accumulate(sizes, initial=0)
    dimensions = [
        MultiArrayDimension(label=name, size=size, stride=start)
        for name, size, start in zip(names, sizes, starts, strict=False)
    ]
    empty = serialize_message(UInt8MultiArray(layout=MultiArrayLayout(dim=dimensions)))
    return bytes(empty[: -_COUNT.size]) + _COUNT.pack(sum(sizes))


class BatchReader:
    """Read batches; their topics and sizes are much the same from one to the next."""

    def __init__(self) -> None:
        self._layouts: dict[bytes, list[tuple[str, slice]]] = {}  # by what comes before `data`

    def __call__(self, batch: bytes) -> list[tuple[str, bytes]]:
        """Return the full name of the topic and the bytes of each message in a batch.

        Raises
        ------
        BadMessage
            When these are not the bytes of a batch, or it is larger than any of a robot.
        """
        found = next(
            (each for head, each in self._layouts.items() if batch.startswith(head)), None
        )
        if found is None:
            head, found = _layout(batch)
            if len(self._layouts) == _MOST_LAYOUTS:
                self._layouts.clear()
            self._layouts[head] = found
        if found and len(batch) < found[-1][1].stop:
            raise BadMessage(f'{len(batch)} bytes are too few for {len(found)} messages')
        return [(name, batch[place]) for name, place in found]


def _layout(batch: bytes) -> tuple[bytes, list[tuple[str, slice]]]:
    """Return the bytes of a batch that come before its messages, and the place of each message."""
    if len(batch) > _LARGEST:
        raise BadMessage(f'{len(batch)} bytes are too many: at most {_LARGEST} are allowed')
    count = int.from_bytes(batch[4:8], 'little' if batch[1:2] == b'\1' else 'big')
    if count > _MOST_MESSAGES:
        raise BadMessage(f'{count} messages are too many: at most {_MOST_MESSAGES} are allowed')
    try:
        layout = deserialize_message(batch, UInt8MultiArray).layout
    except Exception as error:  # rclpy raises various ones
        raise BadMessage(f'{len(batch)} bytes are no batch: {error}') from None
    names = [each.label for each in layout.dim]
    sizes = [each.size for each in layout.dim]
    head = batch[: len(batch_head(names, sizes))]
    ends = itertools.accumulate(sizes, initial=len(head))
    places = [slice(start, end) for start, end in itertools.pairwise(ends)]
    return head, list(zip(names, places, strict=True))
