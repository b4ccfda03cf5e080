# SPDX-License-Identifier: Apache-2.0
"""Completion of scenes, feet and bags in a shell."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from typing import Any

from ros_pad import configuration

DEEPEST = 4
"""Number of folder levels below the typed folder that are searched for bags."""

MOST = 2000
"""Largest number of folders to search: searching a whole disk would take too long."""


def attach(parser: argparse.ArgumentParser) -> None:
    """Set how argcomplete completes the arguments of a parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for part in action.choices.values():
                attach(part)
        elif action.type in (int, float):
            action.completer = _nothing  # type: ignore[attr-defined]  # argcomplete's own
        elif action.dest in _COMPLETERS and not action.choices:
            action.completer = _COMPLETERS[action.dest]  # type: ignore[attr-defined]


def bags(prefix: str, **_: Any) -> list[str]:
    """Return bags and MCAP files whose path begins with a text or, if there are none, folders."""
    found = [path for path in _below(os.path.dirname(prefix)) if path.startswith(prefix)]
    return found or _paths(prefix, '')


def _below(folder: str) -> Iterator[str]:
    for looked, (root, folders, files) in enumerate(os.walk(folder or '.')):
        shown = root if folder else root[2:]  # without ./, unless it was typed
        folders[:] = sorted(name for name in folders if not name.startswith('.'))
        if looked >= MOST or root.count('/') - folder.count('/') >= DEEPEST:
            folders.clear()
        if 'metadata.yaml' in files:
            folders.clear()  # offer the bag, not the MCAP files in it
            yield shown
        else:
            yield from (os.path.join(shown, name) for name in files if name.endswith('.mcap'))


def _paths(prefix: str, ending: str) -> list[str]:
    """Return folders, and files with an ending (none if it is empty), that begin with a text."""
    here, start = os.path.split(prefix)
    try:
        entries = sorted(os.scandir(here or '.'), key=lambda each: each.name)
    except OSError:
        return []
    return [
        os.path.join(here, each.name) + ('/' if each.is_dir() else '')
        for each in entries
        if each.name.startswith(start)
        and (each.is_dir() or (ending and each.name.endswith(ending)))
    ]


def _shipped(kind: str, *endings: str) -> Callable[..., list[str]]:
    """Return a completer for shipped names (such as scenes) or, if none fits, for files."""

    def complete(prefix: str, **_: Any) -> list[str]:
        found = [name for name in configuration.names(kind) if name.startswith(prefix)]
        files = {path for ending in endings or ('.yaml',) for path in _paths(prefix, ending)}
        return found or sorted(files)

    return complete


def _policies(prefix: str, **_: Any) -> list[str]:
    """Return a list of policies completed by each policy that is not in it yet."""
    from ros_pad.control import POLICIES  # imported here because it is slow

    before, comma, _last = prefix.rpartition(',')
    return [f'{before}{comma}{name}' for name in POLICIES if name not in before.split(',')]


def _nothing(**_: Any) -> list[str]:
    """Offer no file names for a number or a name of ROS."""
    return []


_COMPLETERS: dict[str, Callable[..., list[str]]] = {
    'scene': _shipped('scenes'),
    'scenes': _shipped('scenes'),
    'foot': _shipped('feet'),
    'material': _shipped('materials'),
    'robot': _shipped('robots', '.yaml', '.urdf'),
    'mapping': _shipped('mappings'),
    'feet': _nothing,
    'imu': _nothing,
    'namespace': _nothing,
    'policy': _policies,
    'bag': bags,
    'path': bags,
}
