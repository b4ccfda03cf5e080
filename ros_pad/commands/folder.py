# SPDX-License-Identifier: Apache-2.0
"""Check where a command is to write: a new folder, existing paths, pictures."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ros_pad.configuration import choice
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


@contextmanager
def kept_if_filled(folder: pathlib.Path) -> Iterator[None]:
    """Remove a folder that is empty after the block, so that its name can be used again."""
    try:
        yield
    finally:
        with suppress(OSError):
            folder.rmdir()


def refuse_existing(option: str, path: pathlib.Path | None) -> None:
    """Raise InvalidInput if the path that an option gives exists."""
    if path is not None and path.exists():
        raise InvalidInput(f'{option} {path}: exists already: give another name')


def check_picture(path: pathlib.Path | None) -> None:
    """Check what ``--figure`` gives before the work begins: a new file of a kind that is known.

    Raises
    ------
    InvalidInput
        When the path exists, or does not end in .png, .svg or .pdf.
    ConfigError
        When Matplotlib is missing.
    """
    if path is not None:
        import ros_pad.reports  # noqa: F401

        choice('ending of --figure', path.suffix, PICTURES)
        refuse_existing('--figure', path)
