# SPDX-License-Identifier: Apache-2.0
"""The style of all figures, and their conversion into the bytes of a file.

Colours are those of Okabe and Ito (2008), which people with any colour vision can distinguish;
markers and line styles differ, too, so that a grey print can be read.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

BLUE, VERMILION, GREEN, BLACK = '#0072B2', '#D55E00', '#009E73', '#222222'
WET, STANCE, PALE = '#B5DCF5', '#E4E4E4', '#9A9A9A'
COLUMN, WIDE = 85.0 / 25.4, 175.0 / 25.4  # inches, widths of one and two columns of a paper
DPI = 300  # dots per inch of a PNG for a paper
STYLE: dict[Any, Any] = {
    'font.family': 'DejaVu Sans',  # comes with matplotlib
    'font.size': 10.0,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.titlesize': 10.0,
    'axes.titlelocation': 'left',
    'legend.frameon': False,
    'svg.fonttype': 'path',
    'svg.hashsalt': 'ros_pad',  # without it, the same figure would give different files
    'path.simplify': True,
}
PAPER_STYLE: dict[Any, Any] = STYLE | {
    'font.size': 8.0,
    'axes.titlesize': 8.0,
    'legend.fontsize': 8.0,
    'legend.title_fontsize': 8.0,
    'legend.handlelength': 1.8,
    'legend.columnspacing': 1.2,
    'axes.linewidth': 0.7,
    'xtick.major.width': 0.7,
    'ytick.major.width': 0.7,
    'lines.linewidth': 1.4,
    'lines.markersize': 5.0,
    'pdf.fonttype': 42,  # TrueType: text that can be edited in the PDF
}
# Metadata to leave out, by kind of file: they depend on time and place of drawing.
_MARKS = {
    'svg': ('Date', 'Creator'),
    'png': ('Software',),
    'pdf': ('CreationDate', 'Creator', 'Producer'),
}


class Drawn(NamedTuple):
    """A figure with its title and texts.

    Attributes
    ----------
    figure : Figure
    title : str
    alt : str
        Description of the picture, for readers who cannot see it.
    caption : str
        Plain text that explains how to read the figure.
    """

    figure: Figure
    title: str
    alt: str
    caption: str


def rendered(figure: Figure, kind: str, **options: Any) -> bytes:
    """Return the bytes of a figure's file; they do not depend on time and place of drawing."""
    stream = io.BytesIO()
    metadata = dict.fromkeys(_MARKS[kind])
    figure.savefig(stream, format=kind, metadata=metadata, **options)
    return stream.getvalue()


def policy_look(policy: str) -> tuple[str, str]:
    """Return colour and marker of a policy in figures that compare several."""
    looks = {'adaptive': (GREEN, 'o'), 'flat': (VERMILION, 's'), 'dome': (BLUE, '^')}
    return looks.get(policy, (BLACK, 'D'))


def legend(
    figure: Figure, handles: Sequence[Any], columns: int | None = None, title: str = ''
) -> None:
    """Add a legend above all axes, where it hides no data, in one row or in ``columns``."""
    columns = columns or len(handles)
    figure.legend(
        handles=handles, loc='upper left', ncols=columns, title=title or None, alignment='left'
    )
    layout = figure.get_layout_engine()
    assert isinstance(layout, ConstrainedLayoutEngine)
    # In inches, because matplotlib before 3.7 cannot place a legend outside by itself.
    lines = -(-len(handles) // columns) + bool(title)
    layout.set(rect=(0.0, 0.0, 1.0, 1.0 - (0.14 + 0.18 * lines) / figure.get_figheight()))
