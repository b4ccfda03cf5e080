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
    was no report. After an early end it stays at the last report. It is shown after ``delay``, s,
    and in a file once a minute.
    """
    shape = '{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} [{elapsed}<{remaining}]'
    stride: float | None = None
    with tqdm(
        total=total,
        desc=text,
        unit=unit,
        bar_format=shape,
        file=sys.stderr,
        delay=delay,
        mininterval=0.1 if sys.stderr.isatty() else 60.0,
        miniters=0,  # or a report after many small ones would be shown late
    ) as shown:

        def show(place: float) -> None:
            nonlocal stride
            stride = max(stride or 0.0, place - shown.n)
            shown.update(place - shown.n)

        yield show
        if stride is None or total - shown.n <= 1.01 * stride:
            shown.update(total - shown.n)
