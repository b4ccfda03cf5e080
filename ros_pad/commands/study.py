# SPDX-License-Identifier: Apache-2.0
"""Run a study from the source checkout for a command of ``pad``."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys

from ros_pad.errors import PadError


def run_study(*words: str) -> int:
    """Run ``python -m studies`` with these words; return its exit status.

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
    path = os.pathsep.join(filter(None, (str(checkout), os.environ.get('PYTHONPATH'))))
    command = [sys.executable, '-m', 'studies', *words]
    return subprocess.run(command, env=os.environ | {'PYTHONPATH': path}).returncode
