# SPDX-License-Identifier: Apache-2.0
"""Definitions of message types, messages of any type, and their fields, with ``rosbags``."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_pad.errors import BagError

_LONGEST_ARRAY = 65536
"""Largest number of elements of a fixed-length array: rosbags generates code for each one."""

_DTYPE = {'byte': 'uint8', 'char': 'uint8', 'octet': 'uint8'}  # NumPy has other names for these


class MessageType:
    """Read and write messages of one type.

    Parameters
    ----------
    name : str
        Name of the type, such as ``std_msgs/msg/Float64``.
    definition : str
        Definitions of the type and of all types that it refers to (``ros2msg``), see
        :func:`definition_of`.

    Raises
    ------
    Exception
        Of any kind, when the definition is invalid or incomplete, or has an array of fixed length
        with more than 65536 elements.
    """

    def __init__(self, name: str, definition: str) -> None:
        self.name = name
        self._store = get_typestore(Stores.EMPTY)
        self._store.register(get_types_from_msg(definition.replace('\r\n', '\n'), name))
        for each in self._store.fielddefs:
            for field, (kind, inner) in self.fields(each):
                if kind == Nodetype.ARRAY and inner[1] > _LONGEST_ARRAY:
                    raise ValueError(f'array {field} has more than {_LONGEST_ARRAY} elements')
                if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                    kind, inner = inner[0]
                if kind == Nodetype.NAME:
                    self.fields(inner)  # raises KeyError without a definition of the type

    @functools.cached_property
    def _type(self) -> Any:
        # Code for whole messages takes as long to make as all the rest; fields do without it.
        return self._store.get_msgdef(self.name)

    def decode(self, data: bytes) -> Any:
        """Return a message, with an attribute for each field, from its bytes.

        Raises
        ------
        Exception
            Of any kind, when the bytes are not a message of this type.
        """
        if data[0] or data[1] > 1:
            raise ValueError(f'encapsulation {data[:2].hex()} is not 0000 or 0001, plain CDR')
        of = self._type
        read = of.deserialize_cdr_le if data[1] else of.deserialize_cdr_be
        # Not deserialize_cdr of the store, which refuses the bytes with which DDS may pad.
        message, _ = read(data[4:], 0, of.cls, self._store)
        return message

    def encode(self, message: Any) -> bytes:
        """Return the bytes of a message, little-endian."""
        return bytes(self._store.serialize_cdr(message, self.name, little_endian=True))

    def fields(self, name: str) -> Any:
        """Return the fields of this type or of one inside it: pairs of name and description."""
        return self._store.fielddefs[name][1]

    def blank(self, name: str = '') -> Any:
        """Return a message, or one of a type inside it, of zeros, empty texts and empty lists."""
        _, fields = self._store.fielddefs[name or self.name]
        zeros = (self._zero(*description) for _, description in fields)
        return self._store.types[name or self.name](*zeros)

    def _zero(self, kind: Nodetype, inner: Any) -> Any:
        if kind == Nodetype.NAME:
            return self.blank(inner)
        if kind == Nodetype.BASE:
            return '' if inner[0] == 'string' else 0
        (element_kind, element), length = inner
        count = length if kind == Nodetype.ARRAY else 0
        if element_kind == Nodetype.BASE and element[0] != 'string':
            return np.zeros(count, _DTYPE.get(element[0], element[0]))
        return [self._zero(element_kind, element) for _ in range(count)]


def field_getter(paths: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that returns fields of a message.

    Parameters
    ----------
    paths : sequence of str
        Such as ``header.stamp.sec`` or ``twist.covariance[7]``.
    """
    names = [path.rstrip(']').partition('[') for path in paths]
    steps = [(operator.attrgetter(name), place) for name, _, place in names]

    def get(message: Any) -> tuple[Any, ...]:
        return tuple(
            value(message)[int(place)] if place else value(message) for value, place in steps
        )

    return get


def put_field(message: Any, path: str, value: Any) -> None:
    """Set a field of a message of `MessageType`; see :func:`field_getter`."""
    owner, _, name = path.rpartition('.')
    target = operator.attrgetter(owner)(message) if owner else message
    name, _, place = name.rstrip(']').partition('[')
    before = getattr(target, name)
    if place:
        before[int(place)] = value
    else:
        array = isinstance(before, np.ndarray)
        setattr(target, name, np.asarray(value, before.dtype) if array else value)


@functools.cache
def _jazzy() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


@functools.cache
def definition_of(type_name: str) -> tuple[str, str]:
    """Return definition and RIHS01 hash of a message type of ROS 2 Jazzy itself.

    The definition is followed by those of all types in it (schema text ``ros2msg``).

    Raises
    ------
    BagError
        When the type is none of ROS 2 Jazzy.
    """
    store = _jazzy()
    if type_name not in store.fielddefs:
        raise BagError(
            f'no definition of message type {type_name!r}: one of ROS 2 Jazzy itself is needed;'
            ' declare a topic of another type with its schema (BagWriter.copy_topic)'
        )
    definition, _ = store.generate_msgdef(type_name, ros_version=2)
    return str(definition), str(store.hash_rihs01(type_name))


@functools.lru_cache(maxsize=256)
def message_type(name: str, definition: str = '') -> MessageType:
    """Return a message type, by default of ROS 2 itself; see :class:`MessageType`.

    It is cached because making one takes 10 ms.
    """
    return MessageType(name, definition or definition_of(name)[0])


__all__ = ['MessageType', 'definition_of', 'field_getter', 'message_type', 'put_field']
