# SPDX-License-Identifier: Apache-2.0
"""What all pages and figures share: looks, tables, one HTML file, and files written as a whole.

Colours are those of Okabe and Ito (2008), which people with any colour vision tell apart; shapes
and strokes say the same once more, so that a grey print can be read too.
"""

from __future__ import annotations

import base64
import contextlib
import html
import io
import os
import pathlib
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import NamedTuple

import matplotlib
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ros_pad.errors import InvalidInput
from ros_pad.errors import PadError

BLUE, VERMILION, GREEN, BLACK = '#0072B2', '#D55E00', '#009E73', '#222222'
WET, STANCE, PALE = '#B5DCF5', '#E4E4E4', '#9A9A9A'
COLUMN, WIDE = 85.0 / 25.4, 175.0 / 25.4  # inches: one column of a paper, and both
DPI = 300  # of a PNG for a paper
STYLE: dict[Any, Any] = {
    'font.family': 'DejaVu Sans',  # comes with matplotlib
    'font.size': 10.0,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.titlesize': 10.0,
    'axes.titlelocation': 'left',
    'legend.frameon': False,
    'svg.fonttype': 'path',
    'svg.hashsalt': 'ros_pad',  # the same trial gives the same file
    'path.simplify': True,
}
PAPER_STYLE: dict[Any, Any] = STYLE | {
    'font.size': 8.0,
    'axes.titlesize': 8.0,
    'legend.fontsize': 8.0,
    'legend.handlelength': 1.8,
    'legend.columnspacing': 1.2,
    'axes.linewidth': 0.7,
    'xtick.major.width': 0.7,
    'ytick.major.width': 0.7,
    'lines.linewidth': 1.4,
    'lines.markersize': 5.0,
    'pdf.fonttype': 42,  # text that an editor can change
}
# What a file says of its making, by kind: left out.
_MARKS = {
    'svg': ('Date', 'Creator'),
    'png': ('Software',),
    'pdf': ('CreationDate', 'Creator', 'Producer'),
}


class Drawn(NamedTuple):
    """A figure with its words.

    Attributes
    ----------
    figure : Figure
    title : str
    alt : str
        What it shows, for those who cannot see it.
    caption : str
        How to read it.
    """

    figure: Figure
    title: str
    alt: str
    caption: str


def rendered(figure: Figure, kind: str, **options: Any) -> bytes:
    """Return a figure as a file that does not depend on when or where it was drawn."""
    stream = io.BytesIO()
    metadata = dict.fromkeys(_MARKS[kind])
    figure.savefig(stream, format=kind, metadata=metadata, **options)
    return stream.getvalue()


def legend(figure: Figure, handles: Sequence[Any], columns: int | None = None) -> None:
    """Add a legend above all axes, in one row or in some columns: there it hides no data."""
    columns = columns or len(handles)
    figure.legend(handles=handles, loc='upper left', ncols=columns)
    layout = figure.get_layout_engine()
    assert isinstance(layout, ConstrainedLayoutEngine)
    # In inches, because matplotlib before 3.7 cannot place a legend outside by itself.
    lines = -(-len(handles) // columns)
    layout.set(rect=(0.0, 0.0, 1.0, 1.0 - (0.14 + 0.18 * lines) / figure.get_figheight()))


def table(head: Sequence[str], body: Iterable[Sequence[str]], numbers: range) -> str:
    """Return an HTML table of escaped cells; ``numbers`` are the columns set to the right."""

    def cells(tag: str, row: Sequence[str]) -> str:
        return ''.join(
            f'<{tag}{" class=number" if column in numbers else ""}>{cell}</{tag}>'
            for column, cell in enumerate(row)
        )

    rows = ''.join(f'<tr>{cells("td", row)}</tr>\n' for row in body)
    top = f'<thead><tr>{cells("th", head)}</tr></thead>\n' if any(head) else ''
    return f'<div class="wide"><table>\n{top}<tbody>\n{rows}</tbody></table></div>'


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, "DejaVu Sans", Arial, sans-serif; color: #222;
       background: #fff; max-width: 1100px; margin: 2em auto; padding: 0 1em; }}
h1 {{ font-size: 1.7em; margin-bottom: 0; }}
h2 {{ font-size: 1.25em; margin: 2em 0 0.3em; border-bottom: 1px solid #ccc; }}
h3 {{ font-size: 1.05em; margin: 1.4em 0 0.3em; }}
.facts, .note, figcaption {{ color: #555; font-size: 0.92em; }}
.facts {{ margin-top: 0.2em; }}
.result {{ font-size: 1.15em; }}
.warning {{ border-left: 4px solid #D55E00; padding: 0.2em 0.8em; background: #fdf1e8; }}
figure {{ margin: 0.8em 0; break-inside: avoid; }}
figure img {{ width: 100%; height: auto; }}
.wide {{ overflow-x: auto; margin: 0.6em 0; }}
.wide td:last-child:not(.number) {{ min-width: 14em; }}
table {{ border-collapse: collapse; font-size: 0.92em; break-inside: avoid; }}
th, td {{ text-align: left; vertical-align: top; padding: 0.2em 0.8em 0.2em 0;
         border-bottom: 1px solid #e2e2e2; }}
tbody td:first-child {{ white-space: nowrap; }}
.number {{ text-align: right; font-variant-numeric: tabular-nums; }}
td.number {{ white-space: nowrap; }}
.walk {{ border: 1px solid #ccc; padding: 0.6em; }}
.walk td:last-child:not(.number) {{ min-width: 0; }}
.walk canvas {{ display: block; width: 100%; margin-bottom: 0.5em; background: #fff; }}
#walk-near {{ border: 1px solid #e2e2e2; }}
.walk .controls {{ display: flex; flex-wrap: wrap; gap: 0.6em; align-items: center; }}
.walk .controls input {{ flex: 1 1 14em; min-width: 8em; }}
.walk .controls button {{ font: inherit; min-width: 5em; }}
.walk .controls select {{ font: inherit; }}
.walk output {{ min-width: 11em; font-variant-numeric: tabular-nums; }}
.legend {{ display: flex; flex-wrap: wrap; gap: 0.2em 1.2em; list-style: none; padding: 0;
          margin: 0.6em 0; font-size: 0.92em; }}
.legend svg {{ width: 1.1em; height: 1.1em; vertical-align: -0.2em; }}
@media print {{
  .walk {{ display: none; }}
  body {{ font-size: 10pt; margin: 0; max-width: none; }}
  h2, h3 {{ break-after: avoid; }}
}}
</style>
</head>
<body>
{body}
</body>
</html>
"""


def page(title: str, parts: Sequence[str]) -> str:
    """Return an HTML page of its title and its parts, which are HTML."""
    return _PAGE.format(title=html.escape(title), body='\n'.join(parts))


def embedded(figure: Figure, alt: str, caption: str, kind: str = '') -> str:
    """Return a figure as HTML that needs no other file.

    ``alt`` is plain text, ``caption`` HTML, ``kind`` attributes of the ``figure`` element; without
    them a figure for one column of a paper is as much narrower than the page.
    """
    share = figure.get_figwidth() / WIDE
    kind = kind or (f' style="max-width: max(22em, {100.0 * share:.0f}%)"' if share < 1.0 else '')
    data = base64.b64encode(rendered(figure, 'svg')).decode()
    return (
        f'<figure{kind}><img alt="{html.escape(alt, quote=True)}" '
        f'src="data:image/svg+xml;base64,{data}">'
        f'<figcaption>{caption}</figcaption></figure>'
    )


def write_figures(
    drawn: Mapping[str, Drawn], folder: str | os.PathLike[str], force: bool = False
) -> list[pathlib.Path]:
    """Write figures for a paper, each as PDF and as PNG of 300 dpi, and return the files.

    The same figures give the same bytes. Nothing is written where one of the files is there.

    Parameters
    ----------
    drawn : mapping of str to Drawn
        File name without ending, and figure, drawn in :data:`PAPER_STYLE`.
    folder : path
        Made if need be.
    force : bool
        Replace files that are there.

    Raises
    ------
    InvalidInput
        When a file exists.
    PadError
        When one cannot be written.
    """
    files = {
        pathlib.Path(folder) / f'{name}.{kind}': (each.figure, kind)
        for name, each in drawn.items()
        for kind in ('pdf', 'png')
    }
    for path in files:
        refuse(path, force)
    with matplotlib.rc_context(PAPER_STYLE):
        for path, (figure, kind) in files.items():
            save(path, rendered(figure, kind, dpi=DPI))
    return list(files)


def refuse(path: str | os.PathLike[str], force: bool) -> None:
    """Raise InvalidInput where a file is there that must not be replaced."""
    path = pathlib.Path(path)
    if path.exists() and not path.is_file():
        raise InvalidInput(f'{path}: is no regular file, and is never replaced')
    if not force and path.exists():
        raise InvalidInput(f'{os.fspath(path)}: exists, and is only replaced when that is forced')


def picture_path(path: str | os.PathLike[str]) -> str:
    """Return the path of a picture as text; raise InvalidInput unless it ends as one."""
    text = os.fspath(path)
    if not text.endswith(('.png', '.svg', '.pdf')):
        raise InvalidInput(f'figure = {text!r} is not allowed: .png, .svg or .pdf is needed')
    return text


def save(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file as a whole, so that no half of one is ever left."""
    path = pathlib.Path(path)
    new = path.with_name(path.name + '.new')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_bytes(data)
        new.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            new.unlink()
        raise PadError(f'{path}: cannot be written: {error.strerror}') from error
