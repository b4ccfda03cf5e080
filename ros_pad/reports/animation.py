# SPDX-License-Identifier: Apache-2.0
"""A player for a page: a walk seen from above, in a browser without network.

The data are whole numbers (mm, mrad, 0.1 kPa, per cent), each series as differences from one frame
to the next, so that a minute of six legs takes less than half a megabyte. The player is plain
JavaScript on a canvas; ``#t=12.5`` after the address of the page opens the walk at 12.5 s.
"""

from __future__ import annotations

import base64
import json
import math
from typing import Any

import numpy as np

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.reports.style import BLACK, BLUE, PALE, VERMILION, WET
from ros_pad.reports.view import View

RATE = 25.0  # frames a second
MOST_FRAMES = 9000  # a longer trial has fewer frames a second
AROUND = 0.8  # m, width of the floor that is shown around body and feet
_FINEST, _MOST_CELLS = 0.02, 1500  # m, smallest cell; most cells along an edge of the map
_UNKNOWN_FOOT = 0.02  # m, radius that is drawn for an unknown sole
YELLOW = '#E69F00'

AIR, FLAT, DOME, UNKNOWN = 'a', 'f', 'd', 'u'  # states of a foot; a capital letter if it slips


def data(view: View) -> dict[str, Any] | None:
    """Return the data of the player, for JSON; None if body and feet have no positions.

    Keys
    ----
    start, step : float
        Time of the first frame, and time between frames, s.
    frames : int
        Number of frames.
    body : dict or None
        ``x``, ``y`` (mm) and ``heading`` (mrad), as differences from frame to frame; None if the
        pose is unknown.
    feet : list of dict
        ``leg``; ``x``, ``y`` (mm), ``pressure``, ``setpoint`` (0.1 kPa) and ``wet`` (P(wet), per
        cent) as differences, None in frames without a value; ``state``, one letter for each frame.
    floor : dict or None
        Map of wet ground: ``left``, ``bottom``, ``cell`` (m), ``rows``, ``columns`` and ``bits``:
        one bit for each cell, 1 for wet, row by row from the lowest y, packed and as base64.
    steps : list of list
        Leg, start and end (s), x, y (mm) and morphology (1 is dome, 0 is flat) of each stance.
    outline : list of list of int
        Corners of the body, mm ahead and to the left of its centre.
    sole, ceiling : float
        Radius of a sole, m, and gauge pressure at which the ring for the pressure is full, kPa.
    """
    trial = view.trial
    body, places = trial.body, trial.position[:, :, :2]
    if not (np.isfinite(body[:, :2]).any() or np.isfinite(places).any()):
        return None
    start = float(trial.time[0])
    lasts = float(trial.time[-1]) - start
    step = max(1.0 / RATE, lasts / MOST_FRAMES)
    times = start + step * np.arange(int(lasts / step + 1e-9) + 1)
    fast = np.clip(np.searchsorted(trial.time, times + 1e-9) - 1, 0, None)
    slow = np.searchsorted(trial.slow_time, times + 1e-9) - 1
    known = np.isfinite(body).all(axis=1).any()
    return {
        'start': round(start, 6),
        'step': step,
        'frames': len(times),
        'body': {
            'x': _differences(1e3 * body[fast, 0]),
            'y': _differences(1e3 * body[fast, 1]),
            'heading': _differences(1e3 * _unwrapped(body[fast, 2])),
        }
        if known
        else None,
        'feet': _feet(view, fast, slow),
        'floor': _floor(view),
        'steps': [
            [
                stance.leg,
                round(stance.start, 2),
                round(stance.end, 2),
                round(1e3 * stance.touched[0]),
                round(1e3 * stance.touched[1]),
                int(stance.dome),
            ]
            for stance in view.stances
        ],
        'outline': _outline(view) if known else [],
        'sole': view.foot.sole_radius if view.foot else _UNKNOWN_FOOT,
        'ceiling': 1e-3 * (view.foot.ceiling if view.foot else _highest(view)),
    }


def _feet(view: View, fast: np.ndarray, slow: np.ndarray) -> list[dict[str, Any]]:
    """Return ``feet`` of :func:`data`; ``fast`` and ``slow`` are the rows of the frames."""
    trial = view.trial
    states, places = _states(view, fast, slow), trial.position
    return [
        {
            'leg': leg,
            'x': _differences(1e3 * places[fast, column, 0]),
            'y': _differences(1e3 * places[fast, column, 1]),
            'state': states[column],
            'pressure': _differences(1e-2 * _at(slow, trial.pressure[:, column])),
            'setpoint': _differences(1e-2 * _at(slow, trial.setpoint[:, column])),
            'wet': _differences(1e2 * _at(slow, trial.wet_probability[:, column])),
        }
        for column, leg in enumerate(trial.legs)
    ]


def missing(view: View) -> list[str]:
    """Return sentences on what the player cannot show of a trial."""
    trial = view.trial
    found = []
    if not np.isfinite(trial.body).all(axis=1).any():
        found.append('The pose of the body is not on record: the picture moves with the feet.')
    unplaced = [
        str(leg)
        for column, leg in enumerate(trial.legs)
        if not np.isfinite(trial.position[:, column, :2]).any()
    ]
    if unplaced:
        found.append(
            f'Leg {", ".join(unplaced)}: no position is on record; pressure and P(wet) are only'
            ' in the table.'
        )
    if trial.floor is None:
        found.append('The true wet ground is unknown.')
    if not np.isfinite(trial.force[:, :, 2]).any():
        found.append('No forces are on record: whether a foot stands is unknown.')
    if view.foot is None:
        found.append('The foot is not on record: soles are drawn with a radius of 20 mm.')
    return found


def element(view: View) -> str:
    """Return the player with its data as HTML, for a page with one player."""
    notes = ' '.join(missing(view))
    content = data(view)
    if content is None:
        return (
            '<p>Neither the pose of the body nor the position of a foot is on record: there is '
            'nothing to play.</p>'
        )
    note = f'<p class="note">{notes}</p>' if notes else ''
    text = json.dumps(content, separators=(',', ':'), allow_nan=False)
    return (
        _ELEMENT.replace('NOTE', note)
        + f'<script type="application/json" id="walk-data">{text}</script>\n'
        + f'<script>{_PLAYER}</script>'
    )


def _at(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values of some rows; NaN for row -1, before the first row."""
    return np.append(values, np.nan)[rows] if len(values) else np.full(len(rows), np.nan)


def _unwrapped(angles: np.ndarray) -> np.ndarray:
    """Return angles, rad, without jumps; `numpy.unwrap` turns all values after a NaN into NaN."""
    found = angles.copy()
    known = np.isfinite(angles)
    found[known] = np.unwrap(angles[known])
    return found


def _differences(values: np.ndarray) -> list[int | None]:
    """Return rounded values: the first known one, then differences from the last known one.

    A value that is not finite is None.
    """
    found: list[int | None] = []
    last = 0
    for value in values.tolist():
        if math.isfinite(value):
            found.append(round(value) - last)
            last = round(value)
        else:
            found.append(None)
    return found


def _states(view: View, fast: np.ndarray, slow: np.ndarray) -> list[str]:
    """Return for each leg a text with the state of its foot: one letter for each frame."""
    trial = view.trial
    standing = trial.standing(view.load_gate)[fast]
    known = np.isfinite(trial.force[fast, :, 2])
    found = []
    for column in range(len(trial.legs)):
        pressure = _at(slow, trial.pressure[:, column])
        chosen = _at(slow, trial.dome[:, column].astype(float)) == 1.0
        domed = np.where(np.isnan(pressure), chosen, pressure > DOME_PRESSURE)
        slips = _at(slow, trial.slipping[:, column].astype(float)) == 1.0
        letters = np.where(standing[:, column], np.where(domed, DOME, FLAT), AIR)
        letters = np.where(known[:, column], letters, UNKNOWN)
        letters = np.where(slips & standing[:, column], np.char.upper(letters), letters)
        found.append(''.join(letters.tolist()))
    return found


def _floor(view: View) -> dict[str, Any] | None:
    floor = view.trial.floor
    if floor is None:
        return None
    places = [view.trial.body[:, :2], view.trial.position[:, :, :2].reshape(-1, 2)]
    points = np.concatenate(places)
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0) - AROUND, points.max(axis=0) + AROUND
    cell = max(_FINEST, float((high - low).max()) / _MOST_CELLS)
    # Start a whole number of cells from the floor's origin, so that edges of wet ground coincide.
    low = np.floor((low - floor.origin) / cell) * cell + floor.origin
    columns, rows = (int(each) for each in np.ceil((high - low) / cell))
    x = low[0] + cell * (np.arange(columns) + 0.5)
    y = low[1] + cell * (np.arange(rows) + 0.5)
    wet = floor.wet_along(*np.meshgrid(x, y))
    return {
        'left': round(float(low[0]), 6),
        'bottom': round(float(low[1]), 6),
        'cell': cell,
        'rows': rows,
        'columns': columns,
        'bits': base64.b64encode(np.packbits(wet).tobytes()).decode(),
    }


def _outline(view: View) -> list[list[int]]:
    """Return corners of the body, half as far as its feet; a box for fewer than three feet."""
    trial = view.trial
    x, y, heading = (trial.body[:, k, None] for k in range(3))
    ahead, left = trial.position[:, :, 0] - x, trial.position[:, :, 1] - y
    inside = np.stack(
        [
            np.cos(heading) * ahead + np.sin(heading) * left,
            np.cos(heading) * left - np.sin(heading) * ahead,
        ]
    )
    known = np.isfinite(inside).all(axis=0)
    homes = [
        inside[:, known[:, column], column].mean(axis=1)
        for column in range(len(trial.legs))
        if known[:, column].any()
    ]
    if len(homes) < 3:
        return [[90, 45], [-90, 45], [-90, -45], [90, -45]]
    homes.sort(key=lambda home: math.atan2(home[1], home[0]))
    return [[round(500.0 * each) for each in home] for home in homes]


def _highest(view: View) -> float:
    known = view.trial.pressure[np.isfinite(view.trial.pressure)]
    return max(float(known.max()), 1.0) if len(known) else 1.0


_ELEMENT = f"""<section class="walk" id="walk" tabindex="0" aria-label="Player of the walk from
above: the space bar starts and stops it, arrows step by 0.2 s, with shift by 2 s">
<canvas id="walk-near" role="img" aria-label="Body and feet from above"></canvas>
<canvas id="walk-far" role="img" aria-label="The whole path, and where the body is"></canvas>
<div class="controls">
<button type="button" id="walk-play" aria-pressed="false">Play</button>
<input type="range" id="walk-time" aria-label="time, s" min="0" value="0" step="1">
<label>speed <select id="walk-speed"><option value="0.25">¼</option><option value="0.5">½</option>
<option value="1" selected>1</option><option value="2">2</option><option value="4">4</option>
<option value="8">8</option></select></label>
<output id="walk-status"></output>
</div>
<ul class="legend">
<li><svg viewBox="0 0 20 20"><rect width="20" height="20" fill="{WET}"/></svg> wet ground</li>
<li><svg viewBox="0 0 20 20"><circle cx="10" cy="10" r="7" fill="#fff" stroke="{PALE}"
stroke-width="2" stroke-dasharray="3 2"/></svg> foot in the air</li>
<li><svg viewBox="0 0 20 20"><rect x="3" y="3" width="14" height="14" fill="#fff"
stroke="{BLACK}" stroke-width="2.5"/></svg> stands flat</li>
<li><svg viewBox="0 0 20 20"><circle cx="10" cy="10" r="7.5" fill="{VERMILION}"/></svg>
stands as a dome</li>
<li><svg viewBox="0 0 20 20"><circle cx="10" cy="10" r="7" fill="none" stroke="{YELLOW}"
stroke-width="5"/></svg> slips (alarm)</li>
<li><svg viewBox="0 0 20 20"><path d="M10 2A8 8 0 1 1 2 10" fill="none" stroke="{BLUE}"
stroke-width="3"/></svg> pressure; the ring is full at the ceiling</li>
<li>small marks: where feet stood</li>
</ul>
<div class="wide"><table><thead><tr><th>leg</th><th>foot</th><th class="number">pressure / kPa</th>
<th class="number">set-point / kPa</th><th class="number">P(wet) / %</th><th>ground, true</th></tr>
</thead><tbody id="walk-legs"></tbody></table></div>
<noscript><p class="warning">The walk is played by JavaScript, which is switched off here.</p>
</noscript>
NOTE
</section>
"""

_PLAYER = (
    """
'use strict';
(() => {
const walk = JSON.parse(document.getElementById('walk-data').textContent);
const part = name => document.getElementById('walk-' + name);
const words = {a: 'in the air', f: 'stands flat', d: 'stands as a dome', u: 'unknown'};

// --- data ---------------------------------------------------------------------------------------
const whole = (differences, unit) => {
  let last = 0;
  return differences.map(each => each === null ? NaN : (last += each) * unit);
};
const feet = walk.feet.map(foot => ({
  leg: foot.leg, state: foot.state,
  x: whole(foot.x, 1e-3), y: whole(foot.y, 1e-3),
  pressure: whole(foot.pressure, 0.1), setpoint: whole(foot.setpoint, 0.1),
  wet: whole(foot.wet, 1),
}));
const body = walk.body && {
  x: whole(walk.body.x, 1e-3), y: whole(walk.body.y, 1e-3),
  heading: whole(walk.body.heading, 1e-3),
};
const last = walk.frames - 1;
const clamped = (value, low, high) => Math.min(high, Math.max(low, value));
// Interpolate linearly between two frames.
const between = (series, frame) => {
  const row = Math.min(Math.floor(frame), last), next = Math.min(row + 1, last);
  const value = series[row] + (frame - row) * (series[next] - series[row]);
  return Number.isNaN(value) ? series[row] : value;
};

// --- wet ground ---------------------------------------------------------------------------------
const ground = walk.floor && (() => {
  const {rows, columns} = walk.floor, bytes = atob(walk.floor.bits);
  const wet = (row, column) => {
    const place = row * columns + column;
    return (bytes.charCodeAt(place >> 3) >> (7 - place % 8)) & 1;
  };
  const image = document.createElement('canvas');
  image.width = columns; image.height = rows;
  const pixels = image.getContext('2d').createImageData(columns, rows);
  for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
    if (wet(row, column)) pixels.data.set(WETRGB, 4 * ((rows - 1 - row) * columns + column));
  }
  image.getContext('2d').putImageData(pixels, 0, 0);
  return {image, at: (x, y) => {
    const row = Math.floor((y - walk.floor.bottom) / walk.floor.cell);
    const column = Math.floor((x - walk.floor.left) / walk.floor.cell);
    if (!(row >= 0 && row < rows && column >= 0 && column < columns)) return '–';
    return wet(row, column) ? 'wet' : 'dry';
  }};
})();

// --- positions on a canvas ----------------------------------------------------------------------
const finite = values => values.filter(Number.isFinite);
const tracks = {x: [], y: []};
for (const each of body ? [body, ...feet] : feet) for (const name of ['x', 'y']) {
  for (const value of each[name]) if (Number.isFinite(value)) tracks[name].push(value);
}
const edges = values => values.reduce(
  ([low, high], each) => [Math.min(low, each), Math.max(high, each)], [Infinity, -Infinity]);
const [left, right] = edges(tracks.x), [low, high] = edges(tracks.y);
const sum = values => values.reduce((all, each) => all + each, 0);
const mean = values => values.length ? sum(values) / values.length : 0;
const centre = frame => {
  const x = body ? between(body.x, frame) : NaN, y = body ? between(body.y, frame) : NaN;
  if (Number.isFinite(x) && Number.isFinite(y)) return [x, y];
  return [mean(finite(feet.map(foot => between(foot.x, frame)))),
          mean(finite(feet.map(foot => between(foot.y, frame))))];
};
// The largest distance of feet from the body.
let reachX = 0.15, reachY = 0.1;
for (let frame = 0; frame <= last; frame += 5) {
  const [x, y] = centre(frame);
  for (const foot of feet) {
    reachX = Math.max(reachX, Math.abs(foot.x[frame] - x) || 0);
    reachY = Math.max(reachY, Math.abs(foot.y[frame] - y) || 0);
  }
}
reachX = Math.min(reachX, 1); reachY = Math.min(reachY, 1);
const sharp = (canvas, height) => {
  const wide = canvas.clientWidth, dots = window.devicePixelRatio || 1;
  canvas.style.height = height + 'px';
  canvas.width = Math.round(wide * dots); canvas.height = Math.round(height * dots);
  const pen = canvas.getContext('2d');
  pen.setTransform(dots, 0, 0, dots, 0, 0);
  pen.clearRect(0, 0, wide, height);
  return pen;
};
const drawGround = (pen, toX, toY, scale) => {
  if (!ground) return;
  const {left, bottom, cell, rows, columns} = walk.floor;
  pen.imageSmoothingEnabled = false;
  pen.drawImage(ground.image, toX(left), toY(bottom + rows * cell),
    columns * cell * scale, rows * cell * scale);
};
const line = (pen, toX, toY, until, every) => {
  pen.beginPath();
  let open = false;
  for (let frame = 0; frame <= until; frame += every) {
    const x = body.x[frame], y = body.y[frame];
    if (Number.isFinite(x) && Number.isFinite(y)) {
      pen[open ? 'lineTo' : 'moveTo'](toX(x), toY(y));
      open = true;
    } else open = false;
  }
  pen.stroke();
};

// --- pictures -----------------------------------------------------------------------------------
let shown = 0;  // present frame; may lie between two frames
const drawNear = () => {
  const canvas = part('near'), wide = canvas.clientWidth;
  const height = Math.round(wide * (wide < 600 ? 0.8 : 0.46));
  const pen = sharp(canvas, height), [x0, y0] = centre(shown);
  const scale = Math.min(wide / (2 * reachX + 0.3), height / (2 * reachY + 0.22));
  const toX = x => wide / 2 + (x - x0) * scale, toY = y => height / 2 - (y - y0) * scale;
  drawGround(pen, toX, toY, scale);
  const now = walk.start + shown * walk.step;
  // A grid of 10 cm squares makes motion visible.
  pen.strokeStyle = 'rgba(0,0,0,0.10)'; pen.lineWidth = 1; pen.beginPath();
  for (let x = Math.ceil((x0 - wide / 2 / scale) * 10); x < (x0 + wide / 2 / scale) * 10; x++) {
    pen.moveTo(toX(x / 10), 0); pen.lineTo(toX(x / 10), height);
  }
  const half = height / 2 / scale;
  for (let y = Math.ceil((y0 - half) * 10); y < (y0 + half) * 10; y++) {
    pen.moveTo(0, toY(y / 10)); pen.lineTo(wide, toY(y / 10));
  }
  pen.stroke();
  for (const [, begin, , x, y, dome] of walk.steps) if (begin <= now) {
    pen.fillStyle = dome ? 'VERMILION' : 'BLACK';
    pen.globalAlpha = 0.4; pen.beginPath();
    if (dome) pen.arc(toX(x / 1000), toY(y / 1000), 5, 0, 7);
    else pen.rect(toX(x / 1000) - 4, toY(y / 1000) - 4, 8, 8);
    pen.fill(); pen.globalAlpha = 1;
  }
  if (body) {
    pen.strokeStyle = 'BLACK'; pen.lineWidth = 1.5;
    line(pen, toX, toY, Math.floor(shown), 1);
    const heading = between(body.heading, shown);
    const turned = ([ahead, aside]) => [
      toX(x0 + (Math.cos(heading) * ahead - Math.sin(heading) * aside) / 1000),
      toY(y0 + (Math.sin(heading) * ahead + Math.cos(heading) * aside) / 1000)];
    const corners = walk.outline.map(turned);
    // A leg is drawn from the nearest corner of the body.
    pen.strokeStyle = 'PALE'; pen.lineWidth = 3;
    for (const foot of feet) {
      const x = toX(between(foot.x, shown)), y = toY(between(foot.y, shown));
      if (!Number.isFinite(x + y)) continue;
      const [cx, cy] = corners.reduce((best, each) =>
        Math.hypot(each[0] - x, each[1] - y) < Math.hypot(best[0] - x, best[1] - y) ? each : best);
      pen.beginPath(); pen.moveTo(cx, cy); pen.lineTo(x, y); pen.stroke();
    }
    if (Number.isFinite(heading)) {
      pen.beginPath();
      corners.forEach(([x, y], index) => pen[index ? 'lineTo' : 'moveTo'](x, y));
      pen.closePath();
      pen.fillStyle = 'rgba(255,255,255,0.75)'; pen.fill();
      pen.strokeStyle = 'BLACK'; pen.lineWidth = 2; pen.stroke();
      const tip = Math.max(...walk.outline.map(([ahead]) => ahead));
      const [tx, ty] = turned([0.75 * tip, 0]), [bx, by] = turned([-0.5 * tip, 0]);
      const [ax, ay] = turned([0.4 * tip, 0.22 * tip]);
      const [cx, cy] = turned([0.4 * tip, -0.22 * tip]);
      pen.beginPath(); pen.moveTo(bx, by); pen.lineTo(tx, ty);
      pen.moveTo(ax, ay); pen.lineTo(tx, ty); pen.lineTo(cx, cy); pen.stroke();
    }
  }
  const size = Math.max(walk.sole * scale, 8), row = Math.floor(shown);
  pen.textAlign = 'center'; pen.textBaseline = 'middle';
  for (const foot of feet) {
    const x = toX(between(foot.x, shown)), y = toY(between(foot.y, shown));
    if (!Number.isFinite(x + y)) continue;
    const state = foot.state[row], kind = state.toLowerCase();
    if (state !== kind) {
      pen.strokeStyle = 'YELLOW'; pen.lineWidth = 7;
      pen.beginPath(); pen.arc(x, y, size + 10, 0, 7); pen.stroke();
    }
    pen.beginPath();
    if (kind === 'f') pen.rect(x - 0.9 * size, y - 0.9 * size, 1.8 * size, 1.8 * size);
    else pen.arc(x, y, size, 0, 7);
    pen.fillStyle = kind === 'd' ? 'VERMILION' : '#fff'; pen.fill();
    pen.setLineDash(kind === 'a' || kind === 'u' ? [4, 3] : []);
    pen.strokeStyle = kind === 'a' || kind === 'u' ? 'PALE' : kind === 'd' ? '#8A3B00' : 'BLACK';
    pen.lineWidth = kind === 'f' ? 3 : 2; pen.stroke(); pen.setLineDash([]);
    const share = clamped(foot.pressure[row] / walk.ceiling, 0, 1);
    if (share > 0.01) {
      pen.strokeStyle = 'BLUE'; pen.lineWidth = 3.5; pen.beginPath();
      pen.arc(x, y, size + 4, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * share); pen.stroke();
    }
    pen.fillStyle = kind === 'd' ? '#fff' : 'BLACK';
    pen.font = `bold ${clamped(size, 11, 18)}px sans-serif`;
    pen.fillText(foot.leg, x, y + 1);
    if (foot.pressure[row] > 1) {
      const label = foot.pressure[row].toFixed(0) + ' kPa', below = y + size + 17;
      pen.font = '12px sans-serif';
      pen.strokeStyle = 'rgba(255,255,255,0.85)'; pen.lineWidth = 4;
      pen.strokeText(label, x, below);
      pen.fillStyle = 'BLACK'; pen.fillText(label, x, below);
    }
  }
  // A scale bar of 10 cm.
  pen.strokeStyle = 'BLACK'; pen.lineWidth = 2; pen.beginPath();
  pen.moveTo(12, height - 12); pen.lineTo(12 + 0.1 * scale, height - 12); pen.stroke();
  pen.fillStyle = 'BLACK'; pen.font = '12px sans-serif'; pen.textAlign = 'left';
  pen.fillText('10 cm', 12, height - 24);
};
const drawFar = () => {
  const canvas = part('far'), wide = canvas.clientWidth;
  const scale = Math.min((wide - 24) / (right - left + 0.2), 180 / (high - low + 0.2));
  const height = Math.round((high - low + 0.2) * scale);
  const pen = sharp(canvas, height);
  const margin = (wide - (right - left) * scale) / 2;
  const toX = x => margin + (x - left) * scale, toY = y => height - (y - low + 0.1) * scale;
  drawGround(pen, toX, toY, scale);
  if (body) {
    const every = Math.max(1, Math.floor(last / 2000));
    pen.strokeStyle = 'PALE'; pen.lineWidth = 2; line(pen, toX, toY, last, every);
    pen.strokeStyle = 'BLACK'; line(pen, toX, toY, Math.floor(shown), every);
  }
  const now = walk.start + shown * walk.step;
  // Without a body, the feet show the path.
  for (const [, begin, , x, y] of body ? [] : walk.steps) {
    pen.fillStyle = begin <= now ? 'BLACK' : 'PALE';
    pen.beginPath(); pen.arc(toX(x / 1000), toY(y / 1000), 2, 0, 7); pen.fill();
  }
  const [x, y] = centre(shown);
  pen.fillStyle = 'VERMILION'; pen.beginPath(); pen.arc(toX(x), toY(y), 5, 0, 7); pen.fill();
};
const lines = feet.map(foot => {
  const row = part('legs').insertRow();
  return [foot.leg, '', '', '', '', ''].map((text, column) => {
    const cell = row.insertCell();
    cell.textContent = text;
    if (column > 1 && column < 5) cell.className = 'number';
    return cell;
  });
});
const number = value => Number.isFinite(value) ? value.toFixed(0) : '–';
const report = () => {
  const row = Math.floor(shown), now = walk.start + shown * walk.step;
  let status = `${now.toFixed(2)} s`;
  if (body) {
    const first = finite(body.x)[0], ahead = between(body.x, shown) - first;
    if (Number.isFinite(ahead)) status += ` · ${ahead.toFixed(2)} m ahead`;
  }
  part('status').textContent = status;
  part('time').value = row;
  part('time').setAttribute('aria-valuetext', status);
  feet.forEach((foot, index) => {
    const state = foot.state[row], kind = state.toLowerCase(), cells = lines[index];
    cells[1].textContent = words[kind] + (state === kind ? '' : ', slips');
    cells[2].textContent = number(foot.pressure[row]);
    cells[3].textContent = number(foot.setpoint[row]);
    cells[4].textContent = number(foot.wet[row]);
    cells[5].textContent = ground && kind !== 'a' ? ground.at(foot.x[row], foot.y[row]) : '–';
  });
};
const show = frame => {
  shown = clamped(frame, 0, last);
  drawNear(); drawFar(); report();
};

// --- play ---------------------------------------------------------------------------------------
let before = null;  // time of the last picture, ms; null while the walk does not play
const playing = () => before !== null;
const remember = () => {
  // Put the time into the address, so that a link opens it. Some browsers refuse this for files.
  const now = (walk.start + shown * walk.step).toFixed(2);
  try { history.replaceState(null, '', '#t=' + now); } catch { /* leave the address */ }
};
const next = time => {
  if (!playing()) return;
  const speed = Number(part('speed').value);
  show(shown + speed * (time - before) / 1000 / walk.step);
  before = time;
  if (shown >= last) stop(); else requestAnimationFrame(next);
};
const start = () => {
  if (shown >= last) show(0);
  before = performance.now();
  part('play').textContent = 'Pause'; part('play').setAttribute('aria-pressed', 'true');
  requestAnimationFrame(next);
};
const stop = () => {
  before = null;
  part('play').textContent = 'Play'; part('play').setAttribute('aria-pressed', 'false');
  remember();
};
part('play').addEventListener('click', () => playing() ? stop() : start());
part('time').max = last;
part('time').addEventListener('input', event => { show(Number(event.target.value)); });
part('time').addEventListener('change', remember);
document.getElementById('walk').addEventListener('keydown', event => {
  const own = event.target.tagName;  // the browser itself handles keys of buttons and lists
  const steps = {ArrowLeft: -0.2, ArrowRight: 0.2}[event.key];
  if (event.key === ' ' && own !== 'BUTTON' && own !== 'SELECT') playing() ? stop() : start();
  else if (steps && own !== 'SELECT') {
    show(shown + steps * (event.shiftKey ? 10 : 1) / walk.step);
    remember();
  } else return;
  event.preventDefault();
});
const linked = () => {
  const found = /^#t=(-?[0-9.]+)$/.exec(location.hash);
  if (found) show((Number(found[1]) - walk.start) / walk.step);
  return found;
};
addEventListener('hashchange', linked);
if (!linked()) show(0);
let wide = part('near').clientWidth;
new ResizeObserver(() => {
  if (part('near').clientWidth === wide) return;  // only the height changed, by the drawing itself
  wide = part('near').clientWidth;
  requestAnimationFrame(() => show(shown));
}).observe(document.getElementById('walk'));
})();
""".replace('WETRGB', str([*(int(WET[k : k + 2], 16) for k in (1, 3, 5)), 255]))
    .replace('VERMILION', VERMILION)
    .replace('YELLOW', YELLOW)
    .replace('BLACK', BLACK)
    .replace('BLUE', BLUE)
    .replace('PALE', PALE)
)


__all__ = ['data', 'element', 'missing']
