# SPDX-License-Identifier: Apache-2.0
"""A page with a wetted mesh that can be turned: one HTML file that needs no network."""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.reports.files import save
from ros_pad.reports.style import BLACK, BLUE, WET
from ros_pad.reports.wetted import DRY, WETTED, Picture


def page(title: str, rows: Sequence[tuple[str, str]], drawn: Picture) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    title : str
        Title of the page, plain text: names of the mesh and of the liquid.
    rows : sequence of (str, str)
        Name and value with unit of each result, plain text.
    drawn : Picture
        The picture to draw.
    """
    table = '\n'.join(
        f'<tr><th>{html.escape(words)}</th><td>{html.escape(value)}</td></tr>'
        for words, value in rows
    )
    fields = {
        'title': html.escape(title),
        'table': table,
        'dry': _packed(drawn.dry),
        'wet': _packed(drawn.wet),
        'surface': _packed(drawn.surface),
        'line': _packed(drawn.line),
        'dry_colour': DRY,
        'wet_colour': WETTED,
        'surface_colour': WET,
        'line_colour': BLUE,
        'text_colour': BLACK,
    }
    text = _PAGE
    for name, value in fields.items():
        text = text.replace(f'@{name}@', value)
    return text


def write(
    path: str | os.PathLike[str], title: str, rows: Sequence[tuple[str, str]], drawn: Picture
) -> None:
    """Write the page; an existing file is replaced. Raises PadError if it cannot be written."""
    save(path, page(title, rows, drawn).encode(), new_folder=False)


def _packed(values: Any) -> str:
    return base64.b64encode(np.asarray(values, dtype='<f4').tobytes()).decode('ascii')


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@title@</title>
<style>
body { margin: 0; font: 15px/1.4 "DejaVu Sans", Verdana, sans-serif; color: @text_colour@; }
main { display: flex; flex-wrap: wrap; gap: 0 2em; padding: 1em 1.5em; }
h1 { font-size: 1.15em; flex-basis: 100%; margin: 0 0 .5em; }
canvas { flex: 3 1 480px; width: 60%; height: 78vh; min-height: 320px; cursor: grab;
  touch-action: none; border: 1px solid #ddd; }
aside { flex: 1 1 260px; }
th { text-align: left; font-weight: normal; padding: .15em 1.5em .15em 0; vertical-align: top; }
td { text-align: right; white-space: nowrap; }
i { display: inline-block; width: 1em; height: 1em; margin: 0 .5em -.12em 0; }
p { color: #555; font-size: .9em; }
</style>
</head>
<body>
<main>
<h1>@title@</h1>
<canvas id="view" tabindex="0" aria-label="The wetted pad: drag or arrow keys turn,
the wheel or plus and minus zoom"></canvas>
<aside>
<table>
@table@
</table>
<p><i style="background:@dry_colour@"></i>dry pad<br>
<i style="background:@wet_colour@"></i>wet pad<br>
<i style="background:@surface_colour@"></i>surface of the liquid<br>
<i style="background:@line_colour@"></i>where liquid, pad and air meet</p>
<p>Drag or arrow keys turn, wheel or + and - zoom, 0 restores the first view.</p>
</aside>
</main>
<script>
'use strict';
const read = text => new Float32Array(
  Uint8Array.from(atob(text), letter => letter.charCodeAt(0)).buffer);
const parts = [
  { points: read('@dry@'), corners: 3, colour: '@dry_colour@', alpha: 1 },
  { points: read('@wet@'), corners: 3, colour: '@wet_colour@', alpha: 1 },
  { points: read('@surface@'), corners: 4, colour: '@surface_colour@', alpha: 0.55 },
];
const line = read('@line@');
const canvas = document.getElementById('view');
const pen = canvas.getContext('2d');

// All faces in one list: corners, normal, colour.
const faces = [];
const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
for (const part of parts) {
  const rgb = [1, 3, 5].map(at => parseInt(part.colour.slice(at, at + 2), 16));
  for (let at = 0; at < part.points.length; at += 3 * part.corners) {
    const p = part.points.subarray(at, at + 3 * part.corners);
    const u = [p[3] - p[0], p[4] - p[1], p[5] - p[2]];
    const v = [p[6] - p[0], p[7] - p[1], p[8] - p[2]];
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const size = Math.hypot(n[0], n[1], n[2]) || 1;
    faces.push({ p, n: n.map(each => each / size), rgb, alpha: part.alpha, depth: 0 });
    for (let k = 0; k < p.length; k++) {
      low[k % 3] = Math.min(low[k % 3], p[k]);
      high[k % 3] = Math.max(high[k % 3], p[k]);
    }
  }
}
const middle = low.map((each, k) => 0.5 * (each + high[k]));
const span = Math.hypot(...low.map((each, k) => high[k] - each)) || 1;
const start = { turn: -1.08, tilt: 0.22, zoom: 1 };
let view = { ...start };

function draw() {
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const scale = 0.95 * view.zoom * Math.min(canvas.width, 1.5 * canvas.height) / span;
  const c = Math.cos(view.turn), s = Math.sin(view.turn);
  const ct = Math.cos(view.tilt), st = Math.sin(view.tilt);
  // Unit vectors towards the viewer, to the right, and up.
  const to = [c * ct, s * ct, st], right = [-s, c, 0], up = [-c * st, -s * st, ct];
  const along = (axis, p, k) => axis[0] * (p[k] - middle[0]) + axis[1] * (p[k + 1] - middle[1])
    + axis[2] * (p[k + 2] - middle[2]);
  const x = (p, k) => 0.5 * canvas.width + scale * along(right, p, k);
  const y = (p, k) => 0.5 * canvas.height - scale * along(up, p, k);
  const facing = n => n[0] * to[0] + n[1] * to[1] + n[2] * to[2];
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const shown = faces.filter(face => face.alpha < 1 || facing(face.n) > 0);
  for (const face of shown) {
    face.depth = 0;
    for (let k = 0; k < face.p.length; k += 3) face.depth += along(to, face.p, k);
    face.depth /= face.p.length / 3;
  }
  shown.sort((a, b) => a.depth - b.depth);
  pen.lineJoin = 'round';
  for (const face of shown) {
    const bright = 0.72 + 0.28 * Math.abs(0.8 * facing(face.n) + 0.2 * face.n[2]);
    const fill = `rgba(${face.rgb.map(each => Math.round(bright * each))},${face.alpha})`;
    pen.beginPath();
    for (let k = 0; k < face.p.length; k += 3) pen.lineTo(x(face.p, k), y(face.p, k));
    pen.closePath();
    pen.fillStyle = fill;
    pen.fill();
    // Without a stroke, seams would show between neighbouring faces.
    pen.strokeStyle = face.alpha < 1 ? 'rgba(0,114,178,0.15)' : fill;
    pen.lineWidth = 0.7 * ratio;
    pen.stroke();
  }
  pen.strokeStyle = '@line_colour@';
  for (let k = 0; k + 3 < line.length; k += 3) {
    // Draw the line faintly where it is behind the pad.
    const ahead = (line[k] - middle[0]) * to[0] + (line[k + 1] - middle[1]) * to[1] > 0;
    pen.globalAlpha = ahead || view.tilt > 1.2 ? 1 : 0.15;
    pen.lineWidth = 2.5 * ratio;
    pen.beginPath();
    pen.moveTo(x(line, k), y(line, k));
    pen.lineTo(x(line, k + 3), y(line, k + 3));
    pen.stroke();
  }
  pen.globalAlpha = 1;
}

let due = false;
function change(turn, tilt, zoom) {
  view.turn += turn;
  view.tilt = Math.max(-1.57, Math.min(1.57, view.tilt + tilt));
  view.zoom = Math.max(0.2, Math.min(20, view.zoom * zoom));
  if (!due) {
    due = true;
    requestAnimationFrame(() => { due = false; draw(); });
  }
}
let held = null;
canvas.addEventListener('pointerdown', event => {
  held = [event.clientX, event.clientY];
  canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener('pointermove', event => {
  if (!held) return;
  change(-0.008 * (event.clientX - held[0]), 0.008 * (event.clientY - held[1]), 1);
  held = [event.clientX, event.clientY];
});
for (const name of ['pointerup', 'pointercancel']) {
  canvas.addEventListener(name, () => { held = null; });
}
canvas.addEventListener('wheel', event => {
  event.preventDefault();
  change(0, 0, Math.exp(-0.001 * event.deltaY));
}, { passive: false });
canvas.addEventListener('keydown', event => {
  const moves = { ArrowLeft: [0.1, 0, 1], ArrowRight: [-0.1, 0, 1], ArrowUp: [0, -0.1, 1],
    ArrowDown: [0, 0.1, 1], '+': [0, 0, 1.1], '-': [0, 0, 1 / 1.1] };
  if (event.key === '0') view = { ...start };
  else if (!(event.key in moves)) return;
  event.preventDefault();
  change(...(moves[event.key] || [0, 0, 1]));
});
window.addEventListener('resize', draw);
draw();
</script>
</body>
</html>
"""
