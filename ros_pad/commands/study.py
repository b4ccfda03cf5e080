# SPDX-License-Identifier: Apache-2.0
"""Run a study from the source checkout for a command of ``pad``."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys

from ros_pad.errors import PadError


def run_study(*words: str, **options: object) -> int:
    """Run ``python -m studies`` with these words and options; return its exit status.

    Options that are None or False are left out; those that are True have no value.

    Raises
    ------
    PadError
        When ros_pad does not run from a checkout: studies are not installed with the package.
    """
    checkout = pathlib.Path(__file__).resolve().parents[2]
    if not (checkout / 'studies' / '__main__.py').is_file():
        raise PadError(
            f'study {words[0]!r} is not installed: studies are only in the source. Clone ros_pad'
            f' and run in its folder: python -m studies {" ".join(words)}'
        )
    for name, value in options.items():
        if value is not None and value is not False:
            words += (f'--{name}',) if value is True else (f'--{name}', str(value))
    path = os.pathsep.join(filter(None, (str(checkout), os.environ.get('PYTHONPATH'))))
    command = [sys.executable, '-m', 'studies', *words]
    return subprocess.run(command, env=os.environ | {'PYTHONPATH': path}).returncode
