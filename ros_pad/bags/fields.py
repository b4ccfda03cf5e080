# SPDX-License-Identifier: Apache-2.0
"""Read and write single fields of messages, several times faster than whole messages.

Where the fields are in the bytes follows from the definition of the message type. A reader knows
messages that have fields of fixed size and at most one text, as most messages with a header are.
A writer knows every message, because texts and lengths of lists stay the same in what it writes.

Source: OMG, Common Object Request Broker Architecture, part 2, section 9.3 (CDR). A message starts
with four bytes of encapsulation, of which the second gives the byte order; after them each number
is at a multiple of its size.
"""

from __future__ import annotations

import functools
import operator
import struct
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from ros_pad.bags.codec import MessageType
from ros_pad.errors import BadMessage
from ros_pad.errors import UnknownEncoding

_ENCAPSULATION = 4  # bytes
_FORMATS = {
    'bool': '?', 'byte': 'B', 'char': 'B', 'octet': 'B', 'int8': 'b', 'uint8': 'B', 'int16': 'h',
    'uint16': 'H', 'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q', 'float32': 'f',
    'float64': 'd',
}  # fmt: skip
_ORDERS = '><'  # by the byte-order flag of a message
_SIZES = tuple(struct.Struct(order + 'I') for order in _ORDERS)
_SIZE, _COUNT = '#', '[#]'  # ends of the paths of the size of a text and of the length of a list
_MOST_PLANS = 64  # sizes of the text that are remembered
_SHORT = 64  # bytes, of texts that are remembered

_Field = tuple[str, str]  # path, such as twist.covariance[7], and format for struct
_Piece = bytes | tuple[int, str]  # constant bytes, or which value, and its format for struct


class FieldReader:
    """Read fields of a message from its bytes.

    Parameters
    ----------
    message_type : MessageType
        Type of the messages.
    paths : sequence of str
        Fields, such as ``header.stamp.sec``, ``wrench.force.x`` or ``twist.covariance[7]``.

    Raises
    ------
    UnknownEncoding
        When the type has a list of variable length, or more than one text.
    ValueError
        When the type has no such field, or a path is given twice.
    """

    def __init__(self, message_type: MessageType, paths: Sequence[str]) -> None:
        self.paths = tuple(paths)
        self._fields = list(_fields(message_type, message_type.blank()))
        texts = [place for place, (_, form) in enumerate(self._fields) if form.endswith('s')]
        if len(texts) > 1 or any(path.endswith(_COUNT) for path, _ in self._fields):
            raise UnknownEncoding(f'{message_type.name} has a list, or more than one text')
        self._wanted = _chosen(self._fields, paths)
        self._text = texts[0] if texts else None
        self._size_at = _places(self._fields)[self._text - 1] if self._text is not None else 0
        self._text_at = self._wanted.index(self._text) if self._text in self._wanted else None
        self._plans: dict[tuple[int, int], Callable[[bytes], tuple[Any, ...]]] = {}
        # struct returns fields in the order of the message.
        in_order = sorted(self._wanted)
        self._pick = _picker([in_order.index(place) for place in self._wanted])

    def __call__(self, data: bytes) -> tuple[Any, ...]:
        """Return the fields of a message, in the order of the paths.

        Raises
        ------
        BadMessage
            When there are too few bytes, or the text is not UTF-8.
        UnknownEncoding
            When the encapsulation is not plain CDR.
        """
        try:
            order = data[1]
            if data[0] or order > 1:
                raise UnknownEncoding(f'encapsulation {data[:2].hex()} is not 0000 or 0001')
            size = _SIZES[order].unpack_from(data, self._size_at)[0] if self._size_at else 0
            unpack = self._plans.get((order, size))
            if unpack is None:
                unpack = self._plan(order, size, len(data))
            values = self._pick(unpack(data))
        except (IndexError, struct.error):
            raise BadMessage(f'{len(data)} bytes are too few') from None
        return values if self._text_at is None else self._decoded(values, self._text_at)

    def _plan(self, order: int, size: int, available: int) -> Callable[[bytes], tuple[Any, ...]]:
        """Return a function that unpacks messages with a text of this size, bytes."""
        if size > available:
            raise BadMessage(f'{available} bytes are too few for a text of {size} bytes')
        fields = self._sized(size)
        form = _format(fields, _places(fields), self._wanted)
        plan = struct.Struct(_ORDERS[order] + form).unpack_from
        if len(self._plans) == _MOST_PLANS:
            self._plans.clear()  # texts of many sizes must not keep out the usual one
        self._plans[order, size] = plan
        return plan

    def _sized(self, size: int) -> list[_Field]:
        """Return the fields of messages whose text has this size, bytes."""
        fields = list(self._fields)
        if self._text is not None:
            fields[self._text] = fields[self._text][0], f'{size}s'
        return fields

    @staticmethod
    def _decoded(values: tuple[Any, ...], place: int) -> tuple[Any, ...]:
        data = values[place]
        text = (_short_text if len(data) < _SHORT else _text)(data)
        return *values[:place], text, *values[place + 1 :]

    def table(self, messages: Sequence[bytes]) -> np.ndarray:
        """Return numbers of many messages as an array.

        Parameters
        ----------
        messages : sequence of bytes
            Messages of the type.

        Returns
        -------
        numpy.ndarray
            Float64, shape (len(messages), len(paths)).

        Raises
        ------
        BadMessage, UnknownEncoding
            As for a single message.
        ValueError
            When a path is that of a text.
        """
        if self._text_at is not None:
            raise ValueError(f'{self.paths[self._text_at]} is a text, and a table has numbers')
        table = np.empty((len(messages), len(self.paths)))
        sizes = np.array([len(each) for each in messages], dtype=np.int64)
        rows = self.rows(b''.join(messages), np.cumsum(sizes) - sizes, sizes)
        for column, path in enumerate(self.paths):
            table[:, column] = rows[path]
        return table

    def rows(self, data: bytes, starts: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Return the fields of many messages as a structured array.

        Parameters
        ----------
        data : bytes
            Bytes with the messages in them.
        starts, sizes : ndarray of int
            First byte in `data` and number of bytes of each message.

        Returns
        -------
        numpy.ndarray
            Has a row for each message, in which the fields have their paths as names.

        Raises
        ------
        BadMessage, UnknownEncoding
            As for a single message.
        """
        if len(starts) and self._text_at is None:
            first = data[starts[0] : starts[0] + sizes[0]]
            self(first)  # refuses wrong bytes
            if np.all(sizes == sizes[0]):
                record = self._record(first)
                found = items(data, f'V{record.itemsize}')[starts]
                if self._alike(found):
                    return found.view(record)
        ends = (starts + sizes).tolist()
        found = [self(data[s:e]) for s, e in zip(starts.tolist(), ends, strict=True)]
        forms = (self._fields[place][1] for place in self._wanted)
        return np.array(
            found,
            [(p, 'O' if f.endswith('s') else f) for p, f in zip(self.paths, forms, strict=True)],
        )

    def _alike(self, messages: np.ndarray) -> bool:
        """Return whether messages have the same encapsulation, and texts of the same size."""
        table = messages.view(np.uint8).reshape(len(messages), -1)
        places = [slice(at, at + _ENCAPSULATION) for at in (0, self._size_at)]
        return all(bool(np.all(table[:, at] == table[0, at])) for at in places)

    def _record(self, message: bytes) -> np.dtype[np.void]:
        """Return the layout of messages that are like this one."""
        order, at = message[1], self._size_at
        fields = self._sized(_SIZES[order].unpack_from(message, at)[0] if at else 0)
        places = _places(fields)
        formats = [np.dtype(_ORDERS[order] + fields[place][1]) for place in self._wanted]
        offsets = [places[place] for place in self._wanted]
        ends = [offset + form.itemsize for offset, form in zip(offsets, formats, strict=True)]
        return np.dtype(
            {
                'names': list(self.paths),
                'formats': formats,
                'offsets': offsets,
                'itemsize': max([at + _ENCAPSULATION, *ends]),  # up to the last field
            }
        )


class FieldWriter:
    """Write messages that differ from one another only in some numbers.

    Parameters
    ----------
    message_type : MessageType
        Type of the messages.
    paths : sequence of str
        Numbers that differ, such as ``wrench.force.x`` or ``position[2]``.
    constants : mapping of str to object
        Other fields that are not zero or empty, such as ``{'header.frame_id': 'world'}``; a list
        keeps its length.

    Attributes
    ----------
    size : int
        Number of bytes that it writes.

    Raises
    ------
    AttributeError, ValueError
        When the type has no such field, a list has no such element, or a path is given twice or
        is that of a text.
    """

    def __init__(
        self,
        message_type: MessageType,
        paths: Sequence[str],
        constants: Mapping[str, Any] | None = None,
    ) -> None:
        message = message_type.blank()
        for path, value in (constants or {}).items():
            owner, _, name = path.rpartition('.')
            target = operator.attrgetter(owner)(message) if owner else message
            before = getattr(target, name)
            if isinstance(before, np.ndarray):
                value = np.asarray(value, before.dtype)
            setattr(target, name, value)
        fields = list(_fields(message_type, message))
        wanted = _chosen(fields, paths)
        for path, form in map(fields.__getitem__, wanted):
            if form.endswith('s'):
                raise ValueError(f'{path} is a text: only numbers may differ')
        template = message_type.encode(message)
        places = _places(fields)
        # Numbers that differ, and the bytes between them, in the order of the message.
        pieces: list[_Piece] = []
        end = 0
        for place in sorted(wanted):
            pieces += [template[end : places[place]], (wanted.index(place), fields[place][1])]
            end = places[place] + struct.calcsize(fields[place][1])
        self._compile([*pieces, template[end:]])

    def _compile(self, pieces: Sequence[_Piece]) -> None:
        self._pieces = [piece for piece in pieces if piece != b'']
        self._between = tuple(piece for piece in self._pieces if isinstance(piece, bytes))
        self._count = len(self._pieces) - len(self._between)
        form, order, constants = '<', [], self._count
        for piece in self._pieces:
            if isinstance(piece, tuple):
                form += piece[1]
                order.append(piece[0])
            else:
                form += f'{len(piece)}s'
                order.append(constants)
                constants += 1
        self._pick = _picker(order)
        packing = struct.Struct(form)
        self._pack, self.size = packing.pack, packing.size

    def __call__(self, *values: float) -> bytes:
        """Return the bytes of a message, little-endian, with values in the order of the paths.

        Raises
        ------
        struct.error, OverflowError
            When a value does not fit its field.
        """
        return self._pack(*self._pick(values + self._between))


def _text(data: bytes) -> str:
    try:
        return data.removesuffix(b'\0').decode()  # texts end with a zero byte
    except UnicodeDecodeError as error:
        raise BadMessage(f'text {data[:20]!r} is not UTF-8: {error.reason}') from None


_short_text = functools.lru_cache(maxsize=256)(_text)  # names of frames come again and again


def field_of(message: Any, path: str) -> Any:
    """Return a field of a message, such as ``twist.covariance[7]``."""
    field, _, place = path.rstrip(']').partition('[')
    value = operator.attrgetter(field)(message)
    return value[int(place)] if place else value


def items(data: bytes, form: str, first: int = 0) -> np.ndarray:
    """Return a view of bytes in which the index of an item is the place where it begins.

    Parameters
    ----------
    data : bytes
        Any bytes.
    form : str
        NumPy type of an item.
    first : int
        Place of the item with index 0.
    """
    count = max(0, len(data) - first - np.dtype(form).itemsize + 1)
    return np.ndarray((count,), form, data, first if count else 0, (1,))


def _fields(message_type: MessageType, message: Any) -> Iterator[_Field]:
    """Yield path and format of each number and text of a message, in the order of its bytes."""

    def inside(name: str, message: Any, path: str) -> Iterator[_Field]:
        for field, (kind, inner) in message_type.fields(name):
            yield from one(kind, inner, getattr(message, field), f'{path}{field}')

    def one(kind: Nodetype, inner: Any, value: Any, path: str) -> Iterator[_Field]:
        if kind == Nodetype.NAME:
            yield from inside(inner, value, f'{path}.')
        elif kind != Nodetype.BASE:
            (element_kind, element), _ = inner
            if kind == Nodetype.SEQUENCE:
                yield path + _COUNT, 'I'
            for place, each in enumerate(value):
                yield from one(element_kind, element, each, f'{path}[{place}]')
        elif inner[0] == 'string':
            yield path + _SIZE, 'I'
            yield path, f'{len(value.encode()) + 1}s'
        elif inner[0] in _FORMATS:
            yield path, _FORMATS[inner[0]]
        else:
            raise UnknownEncoding(f'{message_type.name}: type {inner[0]} of {path}')

    return inside(message_type.name, message, '')


def _chosen(fields: Sequence[_Field], paths: Sequence[str]) -> list[int]:
    """Return the number of the field of each path."""
    if len(set(paths)) < len(paths):
        raise ValueError(f'{paths} has a path twice')
    known = [path for path, _ in fields]
    return [known.index(path) for path in paths]


def _places(fields: Sequence[_Field]) -> list[int]:
    """Return the place of each field in the bytes of a message."""
    places, end = [], 0
    for _, form in fields:
        size = struct.calcsize('<' + form)
        step = 1 if form.endswith('s') else size
        start = -(-end // step) * step
        places.append(_ENCAPSULATION + start)
        end = start + size
    return places


def _format(fields: Sequence[_Field], places: Sequence[int], wanted: Collection[int]) -> str:
    """Return the format of a whole message, for struct, with only the wanted fields in it."""
    form, end = '', 0
    for number, ((_, each), start) in enumerate(zip(fields, places, strict=True)):
        size = struct.calcsize('<' + each)
        form += f'{start - end}x' + (each if number in wanted else f'{size}x')
        end = start + size
    return form


def _picker(order: Sequence[int]) -> Callable[[tuple[Any, ...]], tuple[Any, ...]]:
    """Return a function that puts the items of a tuple into an order."""
    if len(order) > 1 and list(order) != sorted(order):
        return operator.itemgetter(*order)
    return tuple  # a tuple is returned as it is


__all__ = ['FieldReader', 'FieldWriter', 'field_of', 'items']
