# SPDX-License-Identifier: Apache-2.0
"""A progress bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def bar(text: str, total: float, unit: str = 's') -> Iterator[Callable[[float], None]]:
    """Show a progress bar on stderr; yield what tells it how far things are.

    At the end it is full if the last report was no further from the end than two reports are
    from one another, or if there was none. What ended early, or was stopped, stays where it was.
    """
    shape = '{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} [{elapsed}<{remaining}]'
    stride: float | None = None
    with tqdm(total=total, desc=text, unit=unit, bar_format=shape, file=sys.stderr) as shown:

        def reach(place: float) -> None:
            nonlocal stride
            stride = max(stride or 0.0, place - shown.n)
            shown.update(place - shown.n)

        yield reach
        if stride is None or total - shown.n <= 1.01 * stride:
            shown.update(total - shown.n)
