# SPDX-License-Identifier: Apache-2.0
"""Records as messages: one sensor_msgs/JointState for each block, on the wire and in bags.

``name`` has ``time`` and the names of all numbers of a record, such as ``leg_1/force_z``;
``position`` has their values, record after record, where ``time`` is that after
``header.stamp``, s. It is the one type of ROS 2 itself that has a stamp and names of numbers,
so that PlotJuggler plots each number by its name. A bag has one record in each message.
"""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Sequence

import numpy as np

from ros_pad.bags.codec import MessageType
from ros_pad.bags.codec import message_type
from ros_pad.bags.fields import items
from ros_pad.errors import BadMessage
from ros_pad.records import TIME
from ros_pad.records import Block
from ros_pad.records import Kind

TYPE = 'sensor_msgs/msg/JointState'

_DEFINITION = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
""".replace('=' * 16, '=' * 80)

_HEAD = struct.Struct('<4siI')  # encapsulation, stamp
_ENCAPSULATION = b'\0\1\0\0'  # plain CDR, little-endian
_COUNT = struct.Struct('<I')
_NOTHING = bytes(2 * _COUNT.size)  # no velocity, no effort
_LONGEST = 10_000  # records in a message, and s from the first to the last


@functools.cache
def _type() -> MessageType:
    return message_type(TYPE, _DEFINITION)


class Wire:
    """Convert blocks of records of a kind, and messages.

    Parameters
    ----------
    kind : Kind
        Kind of the records.
    legs : sequence of int
        Numbers of the legs, in the order of the rows.

    Notes
    -----
    The bytes of names are compared with those of ros_pad's own messages; where they are equal, the
    numbers are read as they stand. Otherwise the message is converted as a whole: its numbers may
    have another order, and those that it lacks are NaN.
    """

    def __init__(self, kind: Kind, legs: Sequence[int]) -> None:
        self.kind, self.legs = kind, tuple(legs)
        self._names = (TIME, *kind.names(legs))
        self._width = len(self._names)
        message = _type().blank()
        message.name = list(self._names)
        self._head = _type().encode(message)[_HEAD.size : -3 * _COUNT.size]
        self._count_at = _HEAD.size + len(self._head)
        # CDR aligns numbers of 8 bytes to what follows the encapsulation.
        start = self._count_at + _COUNT.size - len(_ENCAPSULATION)
        self._padding = bytes(-start % 8)
        self._start = len(_ENCAPSULATION) + start + len(self._padding)

    def encode(self, block: Block) -> bytes:
        """Return the message of a block."""
        stamps, rows = block
        first = int(stamps[0])
        values = np.empty((len(stamps), self._width))
        values[:, 0] = (stamps - first) * 1e-9
        values[:, 1:] = rows.view('f8').reshape(len(stamps), -1)
        seconds, rest = divmod(first, 1_000_000_000)
        head = _HEAD.pack(_ENCAPSULATION, (seconds + 2**31) % 2**32 - 2**31, rest)
        count = _COUNT.pack(values.size)
        return b''.join((head, self._head, count, self._padding, values.tobytes(), _NOTHING))

    def decode(self, data: bytes) -> Block:
        """Return the block of a message.

        Raises
        ------
        BadMessage
            When the bytes are no such message, a name is unknown, there is not a value for each
            name, or stamps do not advance.
        """
        if not (
            data.startswith(_ENCAPSULATION)
            and data.startswith(self._head, _HEAD.size)
            and len(data) >= self._start
        ):
            return self._converted(data)
        _, seconds, rest = _HEAD.unpack_from(data)
        (size,) = _COUNT.unpack_from(data, self._count_at)
        if size % self._width or len(data) < self._start + 8 * size:
            raise BadMessage(f'{len(data)} bytes are no records of {self._width} numbers')
        values = np.frombuffer(data, '<f8', size, self._start).reshape(-1, self._width)
        return self._block(seconds * 1_000_000_000 + rest, values)

    def split(self, data: bytes) -> list[tuple[int, bytes]]:
        """Return the stamp, ns, and the message of each record of a message.

        Raises
        ------
        BadMessage
            As :meth:`decode`.
        """
        block = self.decode(data)
        if len(block.stamps) == 1:
            return [(block.last_ns, data)]
        cuts = [slice(place, place + 1) for place in range(len(block.stamps))]
        return [
            (stamp_ns, self.encode(Block(block.stamps[cut], block.rows[cut])))
            for stamp_ns, cut in zip(block.stamps.tolist(), cuts, strict=True)
        ]

    def table(self, data: bytes, starts: np.ndarray, sizes: np.ndarray) -> Block:
        """Return the block of all records in many messages in the order of the messages.

        Parameters
        ----------
        data : bytes
            Bytes with the messages in them.
        starts, sizes : array of int
            First byte in `data` and number of bytes of each message.

        Raises
        ------
        BadMessage
            As for a single message.
        """
        size = self._start + 8 * self._width + len(_NOTHING)
        if len(starts) and np.all(sizes == size):
            found = items(data, f'V{size}')[starts]
            octets = found.view(np.uint8).reshape(len(starts), size)
            ours = np.frombuffer(
                _ENCAPSULATION + self._head + _COUNT.pack(self._width), np.uint8
            )  # all that comes before the numbers, but not the stamp
            place = np.r_[0 : len(_ENCAPSULATION), _HEAD.size : self._count_at + _COUNT.size]
            if (octets[:, place] == ours).all():
                stamps = octets[:, 4:12].copy().view('<i4').astype(np.int64)
                numbers = octets[:, self._start : -len(_NOTHING)].copy().view('<f8')
                return Block(
                    stamps[:, 0] * 1_000_000_000 + stamps[:, 1].astype(np.uint32),
                    self._rows(numbers),
                )
        ends = (starts + sizes).tolist()
        blocks = [self.decode(data[a:b]) for a, b in zip(starts.tolist(), ends, strict=True)]
        if not blocks:
            return Block(np.empty(0, np.int64), self.kind.rows(0, len(self.legs)))
        stamps = np.concatenate([each.stamps for each in blocks])
        return Block(stamps, np.concatenate([each.rows for each in blocks]))

    def _rows(self, values: np.ndarray) -> np.ndarray:
        """Return the rows of a table of numbers with their time."""
        numbers = np.ascontiguousarray(values[:, 1:], 'f8')
        return numbers.view(self.kind.dtype).reshape(len(values), len(self.legs))

    def _block(self, first_ns: int, values: np.ndarray) -> Block:
        times = values[:, 0].tolist()  # there are few: this takes less time than arrays
        if not times or times[0] != 0.0 or not all(a < b for a, b in itertools.pairwise(times)):
            raise BadMessage('the times of the records in it do not advance from 0')
        if len(times) > _LONGEST or not times[-1] < _LONGEST:
            raise BadMessage(f'{len(times)} records up to {times[-1]:g} s are too many')
        stamps = np.array([first_ns + round(1e9 * each) for each in times])
        return Block(stamps, self._rows(values))

    def _converted(self, data: bytes) -> Block:
        try:
            message = _type().decode(data)
        except Exception as error:  # invalid bytes can raise any exception
            raise BadMessage(f'{len(data)} bytes are no {TYPE}: {error}') from None
        names = list(message.name)
        unknown = sorted(set(names) - set(self._names))
        if unknown or len(set(names)) < len(names) or not names:
            wrong = f'unknown names {", ".join(unknown[:3])}' if unknown else 'no names, or two'
            raise BadMessage(
                f'{wrong}: names such as {self._names[1]} of the legs'
                f' {", ".join(map(str, self.legs))} are needed'
            )
        if len(message.position) % len(names):
            raise BadMessage(f'{len(message.position)} values for {len(names)} names')
        given = message.position.reshape(-1, len(names))
        values = np.full((len(given), self._width), np.nan)
        values[:, 0] = 0.0
        values[:, [self._names.index(name) for name in names]] = given
        stamp = message.header.stamp
        return self._block(stamp.sec * 1_000_000_000 + stamp.nanosec, values)


def legs_of(data: bytes) -> tuple[int, ...]:
    """Return the legs that the names in a message are of, in their order.

    Raises
    ------
    BadMessage
        When the bytes are no such message.
    """
    try:
        names = _type().decode(data).name
        legs = [int(name.partition('/')[0].removeprefix('leg_')) for name in names if name != TIME]
    except Exception as error:  # invalid bytes can raise any exception
        raise BadMessage(f'{len(data)} bytes are no record: {error}') from None
    return tuple(dict.fromkeys(legs))


__all__ = ['TYPE', 'Wire', 'legs_of']
