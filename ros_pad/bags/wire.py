# SPDX-License-Identifier: Apache-2.0
"""Records as messages: one sensor_msgs/JointState for each block, on the wire and in bags.

``name`` has ``time`` and the names of all numbers of a record, such as ``leg_1/force_z``;
``position`` has their values, record after record, where ``time`` is that after
``header.stamp``, s. It is the one type of ROS 2 itself that has a stamp and names of numbers,
so that PlotJuggler plots each number by its name. A bag has one record in each message.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_pad.bags.codec import MessageType, message_type
from ros_pad.errors import BadMessage
from ros_pad.records import TIME, Block, Kind, split

TYPE = 'sensor_msgs/msg/JointState'

_HEAD = struct.Struct('<4siI')  # encapsulation, stamp
_ENCAPSULATION = b'\0\1\0\0'  # plain CDR, little-endian
_COUNT = struct.Struct('<I')
_NOTHING = bytes(2 * _COUNT.size)  # no velocity, no effort
_LONGEST = 10_000  # records in a message, and s from the first to the last


def _type() -> MessageType:
    return message_type(TYPE)


class _Layout(NamedTuple):
    """Where the numbers of a message are.

    Attributes
    ----------
    head : bytes
        All that comes between the stamp and the number of values.
    names : tuple of str
        Names of the numbers of a record, beginning with the time.
    places : slice or array of int
        Place of each of them, but the time, among all numbers of a record.
    """

    head: bytes
    names: tuple[str, ...]
    places: slice | np.ndarray

    @property
    def start(self) -> int:
        """Place of the first value; CDR aligns it to what follows the encapsulation."""
        end = _HEAD.size + len(self.head) + _COUNT.size - len(_ENCAPSULATION)
        return len(_ENCAPSULATION) + end + -end % 8

    def message(self, stamp_ns: int, values: np.ndarray) -> bytes:
        """Return the message of some rows of values that begin at a time, ns."""
        head = _HEAD.pack(_ENCAPSULATION, *split(stamp_ns))
        count = _COUNT.pack(values.size)
        gap = bytes(self.start - _HEAD.size - len(self.head) - _COUNT.size)
        return b''.join((head, self.head, count, gap, values.tobytes(), _NOTHING))


class Wire:
    """Convert blocks of records of a kind, and messages.

    Parameters
    ----------
    kind : Kind
        Kind of the records.
    legs : sequence of int
        Numbers of the legs, in the order of the rows.
    fields : sequence of str or None
        Fields that messages have; None: all.

    Notes
    -----
    Names are the same in message after message: their bytes are compared with those of the last
    one, and the numbers are read as they stand. Where they differ, the message is converted as a
    whole; its numbers may have another order, and those that it lacks are NaN.
    """

    def __init__(
        self, kind: Kind, legs: Sequence[int], fields: Sequence[str] | None = None
    ) -> None:
        self.kind, self.legs = kind, tuple(legs)
        self._all = kind.names(legs)
        left = [c for f in kind.fields if fields is None or f.name in fields for c in f.columns]
        names = [each for each in self._all if each.partition('/')[2] in left]
        message = _type().blank()
        message.name = [TIME, *names]
        head = _type().encode(message)[_HEAD.size : -3 * _COUNT.size]
        self._own = self._last = self._layout(head, message.name)

    def _layout(self, head: bytes, names: Sequence[str]) -> _Layout:
        places = [self._all.index(name) for name in names[1:]]
        whole = places == list(range(len(self._all)))
        return _Layout(head, tuple(names), slice(None) if whole else np.array(places, np.intp))

    def encode(self, block: Block) -> bytes:
        """Return the message of a block."""
        stamps, rows = block
        first = int(stamps[0])
        values = np.empty((len(stamps), len(self._own.names)))
        values[:, 0] = (stamps - first) * 1e-9
        values[:, 1:] = rows.view('f8').reshape(len(stamps), -1)[:, self._own.places]
        return self._own.message(first, values)

    def decode(self, data: bytes) -> Block:
        """Return the block of a message.

        Raises
        ------
        BadMessage
            When the bytes are no such message, a name is unknown, there is not a value for each
            name, or stamps do not advance.
        """
        stamps, values = self._values(data)
        numbers = np.full((len(values), len(self._all)), np.nan)
        numbers[:, self._last.places] = values[:, 1:]
        return Block(np.array(stamps), numbers.view(self.kind.dtype))

    def split(self, data: bytes) -> list[tuple[int, bytes]]:
        """Return the stamp, ns, and the message of each record of a message.

        Raises
        ------
        BadMessage
            As :meth:`decode`.
        """
        stamps, values = self._values(data)
        if len(stamps) == 1:
            return [(stamps[0], data)]
        values = values.copy()
        values[:, 0] = 0.0
        return [
            (stamp_ns, self._last.message(stamp_ns, row))
            for stamp_ns, row in zip(stamps, values, strict=True)
        ]

    def _values(self, data: bytes) -> tuple[list[int], np.ndarray]:
        """Return stamps, ns, and values of a message, whose layout is then the last one."""
        last = self._last
        if not (
            data.startswith(_ENCAPSULATION)
            and data.startswith(last.head, _HEAD.size)
            and len(data) >= last.start
        ):
            return self._converted(data)
        _, seconds, rest = _HEAD.unpack_from(data)
        (size,) = _COUNT.unpack_from(data, _HEAD.size + len(last.head))
        if size % len(last.names) or len(data) < last.start + 8 * size:
            raise BadMessage(f'{len(data)} bytes are no records of {len(last.names)} numbers')
        values = np.frombuffer(data, '<f8', size, last.start).reshape(-1, len(last.names))
        return _stamps(seconds * 1_000_000_000 + rest, values), values

    def _converted(self, data: bytes) -> tuple[list[int], np.ndarray]:
        """Return the same of a message with other names than the last one."""
        try:
            message = _type().decode(data)
        except Exception as error:  # invalid bytes can raise any exception
            raise BadMessage(f'{len(data)} bytes are no {TYPE}: {error}') from None
        names = list(message.name)
        unknown = sorted(set(names) - {TIME, *self._all})
        if unknown or len(set(names)) < len(names) or not names:
            wrong = f'unknown names {", ".join(unknown[:3])}' if unknown else 'no names, or two'
            raise BadMessage(
                f'{wrong}: names such as {self._all[0]} of the legs'
                f' {", ".join(map(str, self.legs))} are needed'
            )
        if len(message.position) % len(names):
            raise BadMessage(f'{len(message.position)} values for {len(names)} names')
        values = np.array(message.position, float).reshape(-1, len(names))
        times = np.zeros((len(values), 1))
        if TIME in names:
            times = values[:, [names.index(TIME)]]
            values = np.delete(values, names.index(TIME), axis=1)
            names.remove(TIME)
        values = np.hstack([times, values])
        message.name, message.position = [TIME, *names], np.empty(0)
        message.velocity = message.effort = np.empty(0)
        stamp = message.header.stamp
        stamps = _stamps(stamp.sec * 1_000_000_000 + stamp.nanosec, values)
        head = _type().encode(message)[_HEAD.size : -3 * _COUNT.size]
        self._last = self._layout(head, message.name)
        return stamps, values


def _stamps(first_ns: int, values: np.ndarray) -> list[int]:
    """Return the stamps of rows of values that begin with their time, ns."""
    times = values[:, 0].tolist()  # there are few: this takes less time than arrays
    if not times or times[0] != 0.0 or not all(a < b for a, b in itertools.pairwise(times)):
        raise BadMessage('the times of the records in it do not advance from 0')
    if len(times) > _LONGEST or not times[-1] < _LONGEST:
        raise BadMessage(f'{len(times)} records up to {times[-1]:g} s are too many')
    return [first_ns + round(1e9 * each) for each in times]


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
