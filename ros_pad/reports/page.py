# SPDX-License-Identifier: Apache-2.0
"""Write HTML pages that need no other file: tables, figures, and the page itself."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

from matplotlib.figure import Figure

from ros_pad.reports.style import WIDE, Drawn, rendered


def table(head: Sequence[str], body: Iterable[Sequence[str]], numbers: range) -> str:
    """Return an HTML table; the caller must have escaped the cells.

    ``numbers`` are the columns that are aligned right; a ``head`` of empty texts is left out.
    """

    def cells(tag: str, row: Sequence[str]) -> str:
        return ''.join(
            f'<{tag}{" class=number" if column in numbers else ""}>{cell}</{tag}>'
            for column, cell in enumerate(row)
        )

    rows = ''.join(f'<tr>{cells("td", row)}</tr>\n' for row in body)
    top = f'<thead><tr>{cells("th", head)}</tr></thead>\n' if any(head) else ''
    return f'<div class="wide"><table>\n{top}<tbody>\n{rows}</tbody></table></div>'


def heading(title: str, facts: Iterable[str]) -> str:
    """Return the top of a page: its title, and facts in one line below it."""
    line = html.escape(' · '.join(fact for fact in facts if fact))
    return f'<h1>{html.escape(title)}</h1><p class="facts">{line}</p>'


def warning(text: str) -> str:
    """Return plain text as an HTML paragraph that is highlighted as a warning."""
    return f'<p class="warning">{html.escape(text)}</p>'


def section(drawn: Drawn) -> str:
    """Return a figure with title and caption as HTML; the style of the figure must be in force."""
    figure = embedded(drawn.figure, drawn.alt, html.escape(drawn.caption))
    return f'<h2>{html.escape(drawn.title)}</h2>\n{figure}'


def plain_table(rows: Iterable[Sequence[str]]) -> str:
    """Return an HTML table of two columns of plain text, without a head."""
    return table(['', ''], [[html.escape(cell) for cell in row] for row in rows], range(0))


def embedded(figure: Figure, alt: str, caption: str, kind: str = '') -> str:
    """Return a figure as HTML that needs no other file.

    ``alt`` is plain text, ``caption`` is HTML, and ``kind`` has attributes of the ``figure``
    element. Without attributes, a narrow figure takes the same share of the width as on paper.
    """
    share = figure.get_figwidth() / WIDE
    kind = kind or (f' style="max-width: max(22em, {100.0 * share:.0f}%)"' if share < 1.0 else '')
    data = base64.b64encode(rendered(figure, 'svg')).decode()
    return (
        f'<figure{kind}><img alt="{html.escape(alt, quote=True)}" '
        f'src="data:image/svg+xml;base64,{data}">'
        f'<figcaption>{caption}</figcaption></figure>'
    )


def page(title: str, parts: Sequence[str]) -> str:
    """Return an HTML page with a title, which is plain text, and parts, which are HTML."""
    return _PAGE.format(title=html.escape(title), body='\n'.join(parts))


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
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
@media print {{
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
