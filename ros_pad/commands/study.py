# SPDX-License-Identifier: Apache-2.0
"""Run a study from the source checkout for a command of ``pad``."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
from collections.abc import Sequence

from ros_pad.errors import PadError


def checkout_of(words: Sequence[str]) -> pathlib.Path:
    """Return the checkout in which ``python -m studies`` can run with these words.

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
    return checkout


def run_study(*words: str, stdout: int | None = None) -> int:
    """Run ``python -m studies`` with these words; return its exit status.

    Parameters
    ----------
    words : str
        Name and options of the study.
    stdout : int or None
        Output of the study, as for :func:`subprocess.run`; None is that of this process.

    Raises
    ------
    PadError
        When ros_pad does not run from a checkout.
    """
    path = os.pathsep.join(filter(None, (str(checkout_of(words)), os.environ.get('PYTHONPATH'))))
    child = subprocess.run(
        [sys.executable, '-m', 'studies', *words],
        env=os.environ | {'PYTHONPATH': path},
        stdout=stdout,
    )
    return child.returncode
