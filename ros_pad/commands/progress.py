# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tqdm import tqdm

from ros_pad.pace import Progress


@contextmanager
def bar(text: str, total: float, unit: str = 's', delay: float = 0.0) -> Iterator[Progress]:
    """Show a progress bar on stderr; yield the function that sets its position, 0 to ``total``.

    The bar ends full unless an exception ends the block. Where stderr is no terminal, it is shown
    once a minute. With ``delay``, s, it is shown after that time, and only on a terminal.
    """
    terminal = sys.stderr.isatty()
    with tqdm(
        total=total,
        desc=text,
        unit=unit,
        bar_format='{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} '
        '[{elapsed}<{remaining}]',
        file=sys.stderr,
        delay=delay or 1.0,  # nothing is written before this block can end its line
        mininterval=0.1 if terminal else 60.0,
        miniters=0,
        smoothing=0.0,  # time left from the mean rate: others are wrong if reports are rare
        disable=delay > 0.0 and not terminal,
    ) as shown:
        if not delay:
            shown.delay = 0.0
            shown.refresh()

        def show(place: float) -> None:
            shown.update(place - shown.n)

        yield show
        shown.update(total - shown.n)
