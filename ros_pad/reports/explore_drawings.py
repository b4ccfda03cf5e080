# SPDX-License-Identifier: Apache-2.0
"""The drawings of ``pad explore``, as SVG: light enough to be made anew for each change."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.ticker import MaxNLocator

from ros_pad.contact.pad import Array
from ros_pad.reports.explore import STATES, Explored
from ros_pad.reports.style import BLACK, BLUE, PALE, STANCE, VERMILION

WIDTH, HEIGHT = 480.0, 310.0
STYLE = f"""
.drawing text {{ font: 12px system-ui, "DejaVu Sans", Arial, sans-serif; fill: {BLACK}; }}
.drawing .end {{ text-anchor: end; }} .drawing .middle {{ text-anchor: middle; }}
.drawing path, .drawing circle, .drawing line {{ fill: none; stroke: {BLACK}; }}
.drawing .axis {{ stroke: {PALE}; stroke-width: 1; }}
.drawing .grid {{ stroke: {PALE}; stroke-width: 0.5; opacity: 0.5; }}
.drawing .sole {{ fill: {STANCE}; stroke: {PALE}; }}
.drawing .dry {{ stroke: {VERMILION}; stroke-width: 2; }}
.drawing .wet {{ stroke: {BLUE}; stroke-width: 2; }}
.drawing .ink {{ stroke-width: 2; }}
.drawing .flat, .drawing .free {{ stroke-dasharray: 6 4; }}
.drawing .fill {{ fill: {VERMILION}; stroke: none; }} .drawing .fill.wet {{ fill: {BLUE}; }}
"""


def _path(points: Iterable[tuple[float, float]], kind: str, closed: bool = False) -> str:
    places = ' '.join(f'{x:.1f},{y:.1f}' for x, y in points)
    return f'<path class="{kind}" d="M{places}{"Z" if closed else ""}"/>' if places else ''


def _text(x: float, y: float, words: str, kind: str = '', more: str = '') -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" {more}>{html.escape(words)}</text>'


NOTHING = _text(0.5 * WIDTH, 0.5 * HEIGHT, 'no answer: see what is marked', 'middle')


class Plot:
    """Axes from 0, and what is drawn in them."""

    left, right, top, bottom = 56.0, 14.0, 26.0, 42.0

    def __init__(self, x_end: float, y_end: float, x_label: str, y_label: str) -> None:
        self.x_end, self.y_end = x_end or 1.0, y_end or 1.0
        ticks = MaxNLocator(5, steps=[1, 2, 5, 10])
        floor, wall = HEIGHT - self.bottom, WIDTH - self.right
        self.parts = []
        for x in ticks.tick_values(0.0, self.x_end):
            if 0.0 <= x <= self.x_end:
                self.parts.append(_text(self.x(x), floor + 16.0, f'{x:.6g}', 'middle'))
        for y in ticks.tick_values(0.0, self.y_end):
            if 0.0 <= y <= self.y_end:
                self.parts += [
                    _path([(self.left, self.y(y)), (wall, self.y(y))], 'grid'),
                    _text(self.left - 6.0, self.y(y) + 4.0, f'{y:.6g}', 'end'),
                ]
        middle = 0.5 * (self.top + floor)
        self.parts += [
            _path([(self.left, self.top), (self.left, floor), (wall, floor)], 'axis'),
            _text(0.5 * (self.left + wall), HEIGHT - 6.0, x_label, 'middle'),
            _text(14.0, middle, y_label, 'middle', f'transform="rotate(-90 14 {middle:g})"'),
        ]

    def x(self, value: float) -> float:
        """Return the place of a value."""
        return self.left + value / self.x_end * (WIDTH - self.left - self.right)

    def y(self, value: float) -> float:
        """Return the place of a value, at the frame where it is outside."""
        share = min(max(value / self.y_end, 0.0), 1.0)
        return HEIGHT - self.bottom - share * (HEIGHT - self.top - self.bottom)

    def line(self, x: Sequence[float], y: Sequence[float], kind: str) -> None:
        """Draw a line."""
        points = zip(x, y, strict=True)
        self.parts.append(_path([(self.x(a), self.y(b)) for a, b in points], kind))

    def point(self, x: float, y: float, kind: str) -> None:
        """Draw a point."""
        self.parts.append(
            f'<circle class="fill point {kind}" cx="{self.x(x):.1f}" cy="{self.y(y):.1f}" r="4"/>'
        )


def drawings(found: Explored) -> str:
    """Return the drawings of the page, as HTML."""
    parts = (('One pad on the floor', *_profile(found)), ('Grip over load', *_grip(found)))
    return ''.join(
        f'<div><h2>{title}</h2><svg class="drawing" role="img" aria-label="{html.escape(alt)}"'
        f' viewBox="0 0 {WIDTH:g} {HEIGHT:g}" xmlns="http://www.w3.org/2000/svg">{body}</svg></div>'
        for title, alt, body in parts
    )


def _cap(height: float, sphere: float, rim: float, contact: float, gap: float) -> Array:
    """Return points of the right half of a cap from rim to contact, down from the pad base."""
    if math.isinf(sphere):
        return np.array([[rim, 0.0], [contact, 0.0]])
    middle = height - sphere
    ends = math.atan2(-middle, rim), math.atan2(gap - middle, contact)
    angle = np.linspace(*ends, 40)
    return np.stack([sphere * np.cos(angle), middle + sphere * np.sin(angle)], axis=1)


def _profile(found: Explored) -> tuple[str, str]:
    """Return description and drawing of the dome, free and pressed, cut through its axis."""
    radius, free, pressed = found.inputs['radius'], found.free, found.pressed
    if found.free is None and found.pressed is None:
        return 'There is no dome.', NOTHING
    tall = max(radius, *(each.height for each in (free, pressed) if each is not None), 0.0)
    scale = min((WIDTH - 40.0) / (3.2 * radius), (HEIGHT - 96.0) / tall)
    base, centre = 44.0, 0.5 * WIDTH
    body = [
        f'<rect class="sole" x="20" y="{base - 18:.1f}" width="{WIDTH - 40:.1f}" height="18"/>',
        _text(24.0, base - 5.0, 'sole'),
    ]

    def wall(half: Array, kind: str) -> str:
        there = [(centre + scale * x, base + scale * z) for x, z in half.tolist()]
        back = [(2.0 * centre - x, y) for x, y in reversed(there)]
        return _path([*there, *back], kind)

    if free is not None:
        cap = _cap(free.height, free.sphere_radius, radius, 0.0, free.height)
        body.append(wall(cap, 'free pad'))
    words = 'no pressed dome: see what is marked'
    if pressed is not None:
        b, gap = pressed.contact_radius, pressed.gap
        floor = base + scale * gap
        body += [
            wall(_cap(pressed.height, pressed.sphere_radius, radius, b, gap), 'ink'),
            _path([(20.0, floor), (WIDTH - 20.0, floor)], 'axis'),
            _path([(centre - scale * b, floor), (centre + scale * b, floor)], 'dry'),
            _text(WIDTH - 24.0, floor - 5.0, f'gap {1e3 * gap:.3g} mm', 'end'),
            _text(24.0, floor - 5.0, 'floor'),
        ]
        words = f'contact radius {1e3 * b:.3g} mm, solid: pressed, dashed: free'
    body.append(_text(centre, HEIGHT - 10.0, words, 'middle'))
    return f'Cut through one pad. {words}.', ''.join(body)


def _grip(found: Explored) -> tuple[str, str]:
    """Return description and drawing of the tangential capacity over the load in four states."""
    load = found.inputs['load']
    if not found.curves:
        return 'No grip can be computed.', NOTHING
    loads = found.loads[:-1].tolist()
    top = 1.05 * max(float(each[:-1].max()) for each in found.curves.values())
    plot = Plot(max(loads), top, 'load on the foot, N', 'tangential capacity, N')
    for state, value in found.curves.items():
        morphology, ground = state.split(', ')
        plot.line(loads, value[:-1].tolist(), f'{ground} {morphology}')
        plot.point(load, float(value[-1]), ground)
    plot.line([load, load], [0.0, top], 'axis')
    for place, state in enumerate(STATES):
        morphology, ground = state.split(', ')
        x = plot.left + 106.0 * place
        plot.parts += [
            _path([(x, 12.0), (x + 26.0, 12.0)], f'{ground} {morphology}'),
            _text(x + 31.0, 16.0, state),
        ]
    alt = '; '.join(f'{state} {value:.3g} N' for state, value in found.grip.items())
    return f'Tangential capacity at the load: {alt}.', ''.join(plot.parts)
