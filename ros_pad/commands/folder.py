# SPDX-License-Identifier: Apache-2.0
"""Create the new folder that a command writes into, and refuse existing paths."""

from __future__ import annotations

import pathlib

from ros_pad.errors import InvalidInput


def new_folder(wanted: pathlib.Path | None, name: str) -> pathlib.Path:
    """Create the folder that ``--out`` gives or, without it, the next free one in ``runs``."""
    if wanted is not None:
        refuse_existing('--out', wanted)
        wanted.mkdir(parents=True)
        return wanted
    number = 1
    while True:
        folder = pathlib.Path('runs') / (name if number == 1 else f'{name}_{number}')
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
        else:
            return folder


def refuse_existing(option: str, path: pathlib.Path | None) -> None:
    """Raise InvalidInput if the path that an option gives exists."""
    if path is not None and path.exists():
        raise InvalidInput(f'{option} {path}: exists already: give another name')
