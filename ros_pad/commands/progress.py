# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tqdm import tqdm

from ros_pad.pace import Progress


@contextmanager
def bar(text: str, total: float, unit: str = 's') -> Iterator[Progress]:
    """Show a progress bar on stderr; yield the function that sets its position, 0 to ``total``.

    It is shown from 1 s on, and once a minute where stderr is no terminal. It ends full unless an
    exception ends the block.
    """
    with tqdm(
        total=total,
        desc=text,
        unit=unit,
        bar_format='{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} '
        '[{elapsed}<{remaining}]',
        file=sys.stderr,
        delay=1.0,
        mininterval=0.1 if sys.stderr.isatty() else 60.0,
        miniters=0,
        smoothing=0.0,  # time left from the mean rate: others are wrong if reports are rare
    ) as shown:

        def show(place: float) -> None:
            shown.update(place - shown.n)

        try:
            yield show
        except KeyboardInterrupt:
            shown.delay = 0.0  # its line ends, also where it is just being written
            raise
        shown.update(total - shown.n)
