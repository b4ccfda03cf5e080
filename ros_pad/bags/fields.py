# SPDX-License-Identifier: Apache-2.0
"""Read and write single fields of messages, several times faster than whole messages.

Where the fields are in the bytes follows from the definition of the message type, and from the
sizes of texts and lists, which are mostly the same in message after message.

Source: OMG, Common Object Request Broker Architecture, part 2, section 9.3 (CDR). A message starts
with four bytes of encapsulation, of which the second gives the byte order; after them each number
is at a multiple of its size.
"""

from __future__ import annotations

import operator
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype

from ros_pad.bags.codec import MessageType
from ros_pad.errors import BadMessage, UnknownEncoding

_ENCAPSULATION = 4  # bytes
_FORMATS = {
    'bool': '?', 'byte': 'B', 'char': 'B', 'octet': 'B', 'int8': 'b', 'uint8': 'B', 'int16': 'h',
    'uint16': 'H', 'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q', 'float32': 'f',
    'float64': 'd',
}  # fmt: skip
_ORDERS = '><'  # by the byte-order flag of a message
_SIZE = '#'  # end of the path of the size of a text or list


class _Field(NamedTuple):
    """A number or text of a message: its path, format for struct, and place in the bytes."""

    path: str
    form: str
    place: int

    @property
    def end(self) -> int:
        """Place of the next byte."""
        return self.place + struct.calcsize('<' + self.form)


class _Plan:
    """Where the wanted fields are in messages whose texts and lists have certain sizes."""

    def __init__(self, order: str, fields: Sequence[_Field], paths: Sequence[str]) -> None:
        known = {field.path: field for field in fields}
        missing = [path for path in paths if path not in known]
        if missing:
            raise BadMessage(f'it has no {missing[0]}')
        self.wanted = [known[path] for path in paths]
        self.order, self.end = order, fields[-1].end if fields else _ENCAPSULATION
        sizes = [field for field in fields if field.path.endswith(_SIZE)]
        self.fixed = [slice(0, 2), *(slice(field.place, field.end) for field in sizes)]
        form, end, in_order = order, 0, sorted(self.wanted, key=operator.attrgetter('place'))
        for field in in_order:
            form += f'{field.place - end}x{field.form}'
            end = field.end
        self.unpack = struct.Struct(form).unpack_from
        # struct returns fields in the order of the message.
        self.places = [in_order.index(field) for field in self.wanted]

    def like(self, message: bytes) -> list[bytes]:
        """Return the bytes of a message that must be the same in all of this plan."""
        return [message[each] for each in self.fixed]


class FieldReader:
    """Read fields of a message from its bytes.

    Parameters
    ----------
    message_type : MessageType
        Type of the messages.
    paths : sequence of str
        Fields, such as ``header.stamp.sec``, ``wrench.force.x`` or ``twist.covariance[7]``; no
        elements of lists whose length is variable.

    Raises
    ------
    UnknownEncoding
        When a field has a type that is not read.
    ValueError
        When the type has no such field, or a path is given twice.
    """

    def __init__(self, message_type: MessageType, paths: Sequence[str]) -> None:
        self.paths = tuple(paths)
        self._type = message_type
        forms = {field.path: field.form for field in _layout(message_type)}
        self._texts = [place for place, path in enumerate(paths) if _form(forms, path)[-1] == 's']
        if len(set(paths)) < len(paths):
            raise ValueError(f'{paths} has a path twice')
        self._plan: _Plan | None = None
        self._like: list[bytes] = []  # of the last message

    def __call__(self, data: bytes) -> tuple[Any, ...]:
        """Return the fields of a message, in the order of the paths.

        Raises
        ------
        BadMessage
            When there are too few bytes, or the text is not UTF-8.
        UnknownEncoding
            When the encapsulation is not plain CDR.
        """
        plan = self._plan
        if plan is None or plan.like(data) != self._like:
            plan = self._planned(data)
        if len(data) < plan.end:
            raise BadMessage(f'{len(data)} bytes are too few')
        found = plan.unpack(data)
        values = [found[place] for place in plan.places]
        for place in self._texts:
            values[place] = _text(values[place])
        return tuple(values)

    def _planned(self, data: bytes) -> _Plan:
        """Return where the fields are in messages like this one, and remember it."""
        if len(data) < _ENCAPSULATION:
            raise BadMessage(f'{len(data)} bytes are too few')
        if data[0] or data[1] > 1:
            raise UnknownEncoding(f'encapsulation {data[:2].hex()} is not 0000 or 0001')
        plan = _Plan(_ORDERS[data[1]], _layout(self._type, data), self.paths)
        self._plan, self._like = plan, plan.like(data)
        return plan

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
        for place in self._texts:
            raise ValueError(f'{self.paths[place]} is a text, and a table has numbers')
        table = np.empty((len(messages), len(self.paths)))
        if not messages:
            return table
        self(messages[0])
        plan, size = self._plan, len(messages[0])
        assert plan
        if all(len(each) == size for each in messages):
            data = b''.join(messages)
            octets = np.frombuffer(data, np.uint8).reshape(-1, size)
            if all((octets[:, each] == octets[0, each]).all() for each in plan.fixed):
                for column, field in enumerate(plan.wanted):
                    form = np.dtype(plan.order + field.form)
                    strides = (size,)
                    table[:, column] = np.ndarray(len(table), form, data, field.place, strides)
                return table
        table[:] = [self(each) for each in messages]
        return table


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
        template = message_type.encode(message)
        fields = {field.path: field for field in _layout(message_type, template)}
        for path in paths:
            if _form(fields, path)[1].endswith('s'):
                raise ValueError(f'{path} is a text: only numbers may differ')
        if len(set(paths)) < len(paths):
            raise ValueError(f'{paths} has a path twice')
        # Numbers that differ, and the bytes between them, in the order of the message.
        form, order, end = f'<{_ENCAPSULATION}s', [len(paths)], _ENCAPSULATION
        self._constants: tuple[bytes, ...] = (template[:end],)
        for path in sorted(paths, key=lambda path: fields[path].place):
            field = fields[path]
            form += f'{field.place - end}s{field.form}'
            order += [len(paths) + len(self._constants), paths.index(path)]
            self._constants += (template[end : field.place],)
            end = field.end
        self._pack = struct.Struct(f'{form}{len(template) - end}s').pack
        self._pick = operator.itemgetter(*order, len(paths) + len(self._constants))
        self._constants += (template[end:],)
        self._count = len(paths)

    def __call__(self, *values: float) -> bytes:
        """Return the bytes of a message, little-endian, with values in the order of the paths.

        Raises
        ------
        struct.error, OverflowError
            When a value does not fit its field.
        """
        if len(values) != self._count:
            raise struct.error(f'{len(values)} values are given, {self._count} are needed')
        return self._pack(*self._pick(values + self._constants))


def _text(data: bytes) -> str:
    try:
        return data.removesuffix(b'\0').decode()  # texts end with a zero byte
    except UnicodeDecodeError as error:
        raise BadMessage(f'text {data[:20]!r} is not UTF-8: {error.reason}') from None


def _form(known: Mapping[str, Any], path: str) -> Any:
    """Return what is known of a path."""
    if path not in known:
        raise ValueError(f'{path!r} is no number or text of the messages')
    return known[path]


def field_of(message: Any, path: str) -> Any:
    """Return a field of a message, such as ``twist.covariance[7]``."""
    field, _, place = path.rstrip(']').partition('[')
    value = operator.attrgetter(field)(message)
    return value[int(place)] if place else value


def _layout(message_type: MessageType, data: bytes | None = None) -> list[_Field]:
    """Return the numbers and texts of a message, in the order of its bytes.

    Without a message, all texts and lists are empty.

    Raises
    ------
    BadMessage
        When there are too few bytes.
    """
    found: list[_Field] = []

    def put(path: str, form: str, step: int = 1) -> _Field:
        end = found[-1].end - _ENCAPSULATION if found else 0
        field = _Field(path, form, _ENCAPSULATION + end + -end % step)
        if data is not None and field.end > len(data):
            raise BadMessage(f'{len(data)} bytes are too few for {path} of {field.end}')
        found.append(field)
        return field

    def size_of(path: str, what: str) -> int:
        place = put(path + _SIZE, 'I', 4).place
        if data is None:
            return 0
        size = int.from_bytes(data[place : place + 4], ('big', 'little')[data[1]])
        if size > len(data):
            raise BadMessage(f'{len(data)} bytes are too few for a {what} of {size} bytes')
        return size

    def walk(kind: Nodetype, inner: Any, path: str) -> None:
        if kind == Nodetype.NAME:
            for field, (of_field, inside) in message_type.fields(inner):
                walk(of_field, inside, f'{path}.{field}' if path else field)
        elif kind != Nodetype.BASE:
            (element_kind, element), length = inner
            for place in range(size_of(path, 'list') if kind == Nodetype.SEQUENCE else length):
                walk(element_kind, element, f'{path}[{place}]')
        elif inner[0] == 'string':
            put(path, f'{size_of(path, "text")}s')
        elif inner[0] in _FORMATS:
            form = _FORMATS[inner[0]]
            put(path, form, struct.calcsize(form))
        else:
            raise UnknownEncoding(f'{message_type.name}: type {inner[0]} of {path}')

    walk(Nodetype.NAME, message_type.name, '')
    return found


__all__ = ['FieldReader', 'FieldWriter', 'field_of']
