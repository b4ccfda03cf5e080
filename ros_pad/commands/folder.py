# SPDX-License-Identifier: Apache-2.0
"""Check where a command is to write: a new folder, existing paths, pictures."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

from ros_pad.errors import InvalidInput, PadError

PICTURES = ('.png', '.svg', '.pdf')
"""Endings of the pictures that commands write."""


def new_folder(wanted: pathlib.Path | None, name: str) -> pathlib.Path:
    """Create the folder that ``--out`` gives or, without it, the next free one in ``runs``."""
    refuse_existing('--out', wanted)
    first = wanted or pathlib.Path('runs') / name
    folder, number = first, 1
    while True:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
            folder = first.with_name(f'{first.name}_{number}')
        except OSError as error:
            raise PadError(
                f'{folder}: cannot be created: {error.strerror}: --out gives another folder'
            ) from error
        else:
            return folder


def refuse_existing(option: str, path: pathlib.Path | None, endings: Sequence[str] = ()) -> None:
    """Raise InvalidInput if the path that an option gives exists, or lacks one of the endings."""
    if path is None:
        return
    if endings and path.suffix not in endings:
        raise InvalidInput(f'{option} {path}: a name that ends in {", ".join(endings)} is needed')
    if path.exists():
        raise InvalidInput(f'{option} {path}: exists already: give another name')


def check_pictures(*paths: object) -> None:
    """Raise ConfigError if the path of a picture is given and Matplotlib is missing."""
    if any(path is not None for path in paths):
        import ros_pad.reports  # noqa: F401
