# SPDX-License-Identifier: Apache-2.0
"""Definitions and hashes of message types, from the installed ROS packages."""

from __future__ import annotations

import json
import os
import pathlib
import re
import sys

from ros_pad.errors import BagError

# Type and name of a field of a .msg file; a constant has an equals sign after its name.
_FIELD = re.compile(
    r'^[ \t]*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?[ \t]+\w+[ \t]*(=?)', re.MULTILINE
)
_PRIMITIVE = re.compile(r'bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string')
_RULE = '=' * 80


def message_definition(type_name: str) -> str:
    """Return the definition of a message type, followed by those of all types in it.

    This is the ``ros2msg`` schema text: parts are separated by a line of 80 ``=`` and a line
    ``MSG: package/Name``.

    Raises
    ------
    BagError
        When the type, or one inside it, is not installed.
    """
    seen: set[str] = set()

    def expand(name: str) -> str:
        text = _interface_file(name, '.msg').read_text(encoding='utf-8')
        for inner in sorted(_nested_types(text, package=name.split('/')[0])):
            if inner not in seen:
                seen.add(inner)
                text += f'\n{_RULE}\nMSG: {inner}\n{expand(inner)}'
        return text

    return expand(type_name)


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a message type, which was computed when its package was built.

    Raises
    ------
    BagError
        When the type or its description (the ``.json`` file) is not installed, or the description
        has no hash of the type.
    """
    path = _interface_file(type_name, '.json')
    for entry in json.loads(path.read_text(encoding='utf-8'))['type_hashes']:
        if entry['type_name'] == type_name:
            return str(entry['hash_string'])
    raise BagError(f'{path}: has no type hash of message type {type_name}')


def _interface_file(type_name: str, suffix: str) -> pathlib.Path:
    """Return the installed file of a message type such as ``std_msgs/msg/Float64``."""
    package, name = type_name.split('/')[0], type_name.split('/')[-1]
    # First the prefixes of a sourced workspace, then this Python environment (ROS wheels).
    prefixes = [p for p in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if p]
    for prefix in [*prefixes, sys.prefix]:
        path = pathlib.Path(prefix) / 'share' / package / 'msg' / (name + suffix)
        if path.is_file():
            return path
    raise BagError(
        f'no definition of message type {type_name!r}: no share/{package}/msg/{name}{suffix} in '
        f'{os.pathsep.join([*prefixes, sys.prefix])}. Is the ROS package {package} installed, and'
        ' is the ROS workspace sourced?'
    )


def _nested_types(definition: str, package: str) -> set[str]:
    """Return the message types (``package/Name``) of the fields of one ``.msg`` text."""
    return {
        name if '/' in name else f'{package}/{name}'
        for name, constant in _FIELD.findall(definition)
        if not constant and not _PRIMITIVE.fullmatch(name)
    }


__all__ = ['message_definition', 'type_hash']
