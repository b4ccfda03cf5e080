# SPDX-License-Identifier: Apache-2.0
"""Where a command puts its files: in a folder of their own."""

from __future__ import annotations

import pathlib

from ros_pad.errors import InvalidInput


def new_folder(wanted: pathlib.Path | None, name: str) -> pathlib.Path:
    """Make the folder that is wanted, or the next free one below ``runs``."""
    if wanted is not None:
        try:
            wanted.mkdir(parents=True)
        except FileExistsError:
            raise InvalidInput(
                f'--out {wanted}: exists already, and nothing is ever overwritten'
            ) from None
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
