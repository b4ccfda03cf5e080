# SPDX-License-Identifier: Apache-2.0
"""Definitions and hashes of the message types of ROS 2 Jazzy itself, from ``rosbags``."""

from __future__ import annotations

import functools
from typing import Any

from rosbags.typesys import Stores, get_typestore

from ros_pad.errors import BagError


@functools.cache
def _store() -> Any:
    return get_typestore(Stores.ROS2_JAZZY)


def _known(type_name: str) -> str:
    if type_name not in _store().fielddefs:
        raise BagError(
            f'no definition of message type {type_name!r}: one of ROS 2 Jazzy itself is needed;'
            ' declare a topic of another type with its schema (BagWriter.copy_topic)'
        )
    return type_name


def message_definition(type_name: str) -> str:
    """Return the definition of a message type, followed by those of all types in it.

    This is the ``ros2msg`` schema text: parts are separated by a line of 80 ``=`` and a line
    ``MSG: package/Name``.

    Raises
    ------
    BagError
        When the type is none of ROS 2 Jazzy.
    """
    return str(_store().generate_msgdef(_known(type_name), ros_version=2)[0])


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a message type.

    Raises
    ------
    BagError
        When the type is none of ROS 2 Jazzy.
    """
    return str(_store().hash_rihs01(_known(type_name)))


__all__ = ['message_definition', 'type_hash']
