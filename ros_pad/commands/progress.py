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

    The bar ends full if the last report came within one reporting interval of the end, or if there
    was no report. After an early end it stays at the last report. Where stderr is no terminal, it
    is shown once a minute. With ``delay``, s, it is shown after that time, and only on a terminal.
    """
    stride: float | None = None
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
            nonlocal stride
            stride = max(stride or 0.0, place - shown.n)
            shown.update(place - shown.n)

        yield show
        if stride is None or total - shown.n <= 1.01 * stride:
            shown.update(total - shown.n)
