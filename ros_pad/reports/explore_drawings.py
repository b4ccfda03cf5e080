# SPDX-License-Identifier: Apache-2.0
"""The drawings of ``pad explore``: a pad on the floor, and grip over load."""

from __future__ import annotations

import html
import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ros_pad.contact.pad import Array
from ros_pad.reports.explore import Explored
from ros_pad.reports.style import BLACK, BLUE, PALE, STANCE, STYLE, VERMILION, rendered


def drawings(found: Explored) -> str:
    """Return the drawings of the page, as HTML."""
    parts = []
    with matplotlib.rc_context(STYLE):
        for title, draw in (('One pad on the floor', _profile), ('Grip over load', _grip)):
            figure = Figure(figsize=(5.0, 3.2))
            words = draw(found, figure.add_axes((0.12, 0.15, 0.85, 0.75)))
            svg = rendered(figure, 'svg').decode()
            parts.append(
                f'<div role="img" aria-label="{html.escape(words)}"><h2>{title}</h2>'
                f'{svg[svg.index("<svg") :]}</div>'
            )
    return ''.join(parts)


def _cap(height: float, sphere: float, rim: float, contact: float, gap: float) -> Array:
    """Return points of a cap from rim to rim, flat where it is in contact, down from the base."""
    if math.isinf(sphere):
        half = np.array([[rim, 0.0], [contact, 0.0]])
    else:
        middle = height - sphere
        ends = math.atan2(-middle, rim), math.atan2(gap - middle, contact)
        angle = np.linspace(*ends, 40)
        half = np.stack([sphere * np.cos(angle), middle + sphere * np.sin(angle)], axis=1)
    return np.concatenate([half, half[::-1] * (-1.0, 1.0)])


def _profile(found: Explored, axes: Axes) -> str:
    """Draw the dome, free and pressed, cut through its axis; return a description."""
    radius, free, pressed = found.inputs['radius'], found.free, found.pressed
    axes.set_axis_off()
    if free is None and pressed is None:
        return _nothing(axes)
    tall = max(radius, *(each.height for each in (free, pressed) if each is not None))
    wide = 2.0 * radius
    axes.set_position((0.02, 0.1, 0.96, 0.86))
    axes.fill_between([-wide, wide], -0.1 * tall, 0.0, color=STANCE)
    axes.text(-0.98 * wide, -0.02 * tall, 'sole')
    words = 'no pressed dome: see what is marked'
    if free is not None:
        cap = _cap(free.height, free.sphere_radius, radius, 0.0, free.height)
        axes.plot(*cap.T, color=PALE, ls='--', lw=1.0)
    if pressed is not None:
        b, gap = pressed.contact_radius, pressed.gap
        cap = _cap(pressed.height, pressed.sphere_radius, radius, b, gap)
        axes.plot(*cap.T, color=BLACK, lw=2.0)
        axes.plot([-wide, wide], [gap, gap], color=PALE, lw=1.0)
        axes.plot([-b, b], [gap, gap], color=VERMILION, lw=2.0)
        axes.text(-0.98 * wide, gap - 0.02 * tall, 'floor')
        axes.text(0.98 * wide, gap - 0.02 * tall, f'gap {1e3 * gap:.3g} mm', ha='right')
        words = f'contact radius {1e3 * b:.3g} mm, solid: pressed, dashed: free'
    axes.set(xlim=(-wide, wide), ylim=(1.05 * tall, -0.15 * tall))
    axes.set_aspect('equal')
    axes.figure.text(0.5, 0.03, words, ha='center')
    return f'Cut through one pad. {words}.'


def _grip(found: Explored, axes: Axes) -> str:
    """Draw the tangential capacity over the load in four states; return a description."""
    if not found.curves:
        return _nothing(axes)
    for state, curve in found.curves.items():
        colour, line = BLUE if 'wet' in state else VERMILION, '--' if 'flat' in state else '-'
        axes.plot(found.loads[:-1], curve[:-1], color=colour, ls=line, lw=2.0, label=state)
        axes.plot(found.loads[-1], curve[-1], 'o', color=colour)
    axes.axvline(found.loads[-1], color=PALE, lw=1.0)
    axes.grid(axis='y', color=PALE, alpha=0.3, lw=0.6)
    axes.set(xlim=(0.0, found.loads[:-1].max()), ylim=(0.0, None))
    axes.set(xlabel='load on the foot, N', ylabel='tangential capacity, N')
    axes.legend(loc='lower left', bbox_to_anchor=(-0.14, 0.98), ncols=4, columnspacing=1.0)
    alt = '; '.join(f'{state} {value:.3g} N' for state, value in found.grip.items())
    return f'Tangential capacity at the load: {alt}.'


def _nothing(axes: Axes) -> str:
    axes.set_axis_off()
    words = 'no answer: see what is marked'
    axes.text(0.5, 0.5, words, ha='center', transform=axes.transAxes)
    return words
