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
    """Show a progress bar on stderr; yield what tells it how far things are."""
    shape = '{desc} {percentage:3.0f}% {bar} {n:.0f}/{total:.0f} {unit} [{elapsed}<{remaining}]'
    with tqdm(total=total, desc=text, unit=unit, bar_format=shape, file=sys.stderr) as shown:

        def reach(place: float) -> None:
            shown.update(place - shown.n)

        yield reach
        reach(total)
