# SPDX-License-Identifier: Apache-2.0
"""Style of all pictures of studies: that of the reports, with a few more colours."""

from __future__ import annotations

from typing import Any

from ros_pad.reports.style import BLACK, BLUE, GREEN, PALE, PAPER_STYLE, VERMILION
from ros_pad.reports.style import STYLE as PAGE_STYLE

__all__ = [
    'BLACK',
    'BLUE',
    'DARK',
    'GREEN',
    'LIGHT',
    'ORANGE',
    'PALE',
    'PAPER_STYLE',
    'PURPLE',
    'SKY',
    'STYLE',
    'VERMILION',
]

SKY, ORANGE, PURPLE = '#56B4E9', '#E69F00', '#CC79A7'  # Okabe and Ito
DARK, LIGHT = '#005A43', '#73CFB0'  # shades of GREEN

STYLE: dict[Any, Any] = PAGE_STYLE | {'font.size': 9.0, 'axes.titlesize': 9.5}
