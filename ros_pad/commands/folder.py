# SPDX-License-Identifier: Apache-2.0
"""Check where a command is to write: a new folder, existing paths, pictures."""

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


def check_pictures(*paths: object) -> None:
    """Raise ConfigError if the path of a picture is given and Matplotlib is missing."""
    if any(path is not None for path in paths):
        import ros_pad.reports  # noqa: F401
