# SPDX-License-Identifier: Apache-2.0
"""The thesis' figures 29 and 30: how high liquid climbs a dome, and how its surface is curved.

The thesis draws them with its layers on a mesh (chapter 4); here it is the ring of chapter 3 round
a pressed dome, in closed form.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ros_pad.contact.dome import Pressed
from ros_pad.contact.dome import press
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.meniscus import meniscus
from ros_pad.contact.pad import LARGE_PAD
from ros_pad.contact.pad import Array
from ros_pad.figures.explained import Explained
from ros_pad.trials.bench import Claim
from ros_pad.trials.page import BLACK
from ros_pad.trials.page import BLUE
from ros_pad.trials.page import COLUMN
from ros_pad.trials.page import GREEN
from ros_pad.trials.page import PALE
from ros_pad.trials.page import PAPER_STYLE
from ros_pad.trials.page import VERMILION
from ros_pad.trials.page import Drawn
from ros_pad.trials.page import legend

TENSIONS = (0.0016, 0.002, 0.004)  # N/m of the liquid, thesis
PRESSURE, FORCE = 75e3, 0.19  # Pa gauge and N on the pad: one of the thesis' pressed domes
_COLOURS = (VERMILION, BLUE, GREEN)
# Of the solid's tension to the liquid's, for contact angles from 90 to 0 degrees (3.81).
_RATIOS = (0.5 + 0.5 * np.cos(np.radians(np.linspace(90.0, 0.0, 91)))) ** 2
_RAYS = (90.0, 60.0, 30.0, 0.0)  # degrees of contact that are marked
_READINGS = {'corrected': '-', 'thesis': (0, (4, 2))}


class Ring(NamedTuple):
    """Ring of liquid over the solid's tension: all m, but the tension in N/m."""

    solid: Array
    height: Array
    curvature: Array


def ring(pressed: Pressed, tension: float, reading: str, ratios: Array = _RATIOS) -> Ring:
    """Return height and radius of curvature of the ring for each tension of the solid.

    The surface is taken as a circle that leaves the wall at the contact angle and runs out on a
    floor that is wet: R = h/(1 + cos(θ + α)), with α the angle between wall and floor.
    """
    wall = math.asin(float(pressed.contact_radius) / float(pressed.sphere_radius))
    heights, curvatures = [], []
    for ratio in ratios.tolist():
        liquid = Liquid(tension, ratio * tension)
        height = float(meniscus(pressed, liquid, reading).height)
        heights.append(height)
        curvatures.append(height / (1.0 + math.cos(liquid.angle + wall)))
    return Ring(ratios * tension, np.array(heights), np.array(curvatures))


def draw() -> list[Explained]:
    """Draw figures 29 and 30."""
    pressed = press(LARGE_PAD, PRESSURE, FORCE)
    rings = {
        (tension, reading): ring(pressed, tension, reading)
        for tension in TENSIONS
        for reading in _READINGS
    }
    with matplotlib.rc_context(PAPER_STYLE):
        return [_figure_29(rings), _figure_30(pressed, rings)]


_MEASURED = 'Nothing: the thesis computes these curves and measures none of them.'
_MODELLED = (
    'The ring of liquid round one pressed dome in closed form (3.65 to 3.82), corrected: weight '
    'balance solved exactly, weight hung from the tension of the liquid. Dashed: 3.80 as printed. '
    'Not the layers on a mesh of chapter 4, from which the thesis has its curves: shapes other '
    'than a dome, several pads and uneven slices are not in this model.'
)
_ASSUMED = (
    'The dome: 75 kPa under 0.19 N, radius 1.5 mm, one of the pressed domes that the thesis '
    'measured; the size of its mesh stands in a picture alone. The contact angle follows from the '
    'tensions (3.81). The floor is wet, so that the surface runs out on it at no angle.'
)


def _figure_29(rings: dict[tuple[float, str], Ring]) -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()
    for (tension, reading), each in rings.items():
        colour = _COLOURS[TENSIONS.index(tension)]
        ax.plot(1e3 * each.solid, 1e3 * each.height, color=colour, ls=_READINGS[reading])
        if reading == 'corrected':
            top = int(np.argmax(each.height))
            ax.plot(1e3 * each.solid[top], 1e3 * each.height[top], 'o', color=colour)
    ax.set_xlim(0.0, None)
    ax.set_ylim(0.0, None)
    ax.set_xlabel('tension of the solid / (mN/m)')
    ax.set_ylabel('wetted height / mm')
    legend(figure, _handles([Line2D([], [], color=BLACK, marker='o', ls='', label='highest')]), 3)
    corrected = [rings[tension, 'corrected'] for tension in TENSIONS]
    best = [_RATIOS[int(np.argmax(each.height))] for each in corrected]
    printed = [_RATIOS[int(np.argmax(rings[t, 'thesis'].height))] for t in TENSIONS]
    middle = [1e3 * float(each.height[len(_RATIOS) // 2]) for each in corrected]
    return Explained(
        29,
        Drawn(
            figure,
            'Figure 29: wetted height over the tension of the solid',
            'Height of the ring over the tension of the solid for three liquids; each curve rises '
            f'to its highest point at {best[0]:.2f} of the tension of the liquid and then falls',
            'From a quarter of the tension of the liquid (contact angle 90°) to all of it (0°).',
        ),
        _MEASURED,
        _MODELLED,
        _ASSUMED,
        (
            Claim(
                29,
                'The height rises with the tension of the solid over the whole range.',
                f'That of the ring in closed form rises up to {_span(best)} of the tension of the '
                f'liquid, then falls; as printed (3.80) up to {_span(printed)}. The thesis says '
                'it of its layers on a mesh, which are another model: this does not refute it.',
                tuple(float(each) for each in best),
                None,
            ),
            Claim(
                29,
                'At the same contact angle, a liquid of higher tension climbs higher.',
                'At a contact angle of 45° the heights are '
                + ', '.join(f'{each:.2f}' for each in middle)
                + ' mm.',
                tuple(middle),
                all(low < high for low, high in itertools.pairwise(middle)),
            ),
            Claim(
                29,
                'The height converges to a maximum, faster for a higher tension.',
                'The curves end where the liquid wets completely: no equation has an angle beyond '
                'that, so there is nothing that they could converge to.',
                (),
                None,
            ),
        ),
    )


def _figure_30(pressed: Pressed, rings: dict[tuple[float, str], Ring]) -> Explained:
    figure = Figure(figsize=(COLUMN, 2.9), layout='constrained')
    ax = figure.subplots()
    for (tension, reading), each in rings.items():
        colour = _COLOURS[TENSIONS.index(tension)]
        ax.plot(1e3 * each.height, 1e3 * each.curvature, color=colour, ls=_READINGS[reading])
    highest = max(float(each.height.max()) for each in rings.values())
    slopes = []
    for degrees in _RAYS:
        # cos θ = 2 √ratio − 1 (3.81)
        ratio = np.array([(0.5 + 0.5 * math.cos(math.radians(degrees))) ** 2])
        one = ring(pressed, TENSIONS[-1], 'corrected', ratio)
        slope = float(one.curvature[0] / one.height[0])
        slopes.append(slope)
        x = np.array([0.0, 1.04e3 * highest])
        ax.plot(x, slope * x, color=PALE, lw=0.8, ls=(0, (1, 1.5)), zorder=0)
        ax.annotate(
            f'{degrees:.0f}°', (x[1], slope * x[1]), (2, 0), textcoords='offset points',
            va='center', fontsize=7.0, annotation_clip=False,
        )  # fmt: skip
    ax.set_xlim(0.0, 1.04e3 * highest)
    ax.set_ylim(0.0, None)
    ax.set_xlabel('wetted height / mm')
    ax.set_ylabel('radius of curvature / mm')
    ray = Line2D([], [], color=PALE, lw=0.8, ls=(0, (1, 1.5)), label='same angle')
    legend(figure, _handles([ray]), 3)
    return Explained(
        30,
        Drawn(
            figure,
            'Figure 30: radius of curvature over the wetted height',
            'Radius of curvature over height of the ring for three liquids: no straight line '
            'through the origin, but for points of the same contact angle',
            'Each curve runs from a contact angle of 90° (above) to 0°. Rays: the same angle for '
            'all liquids.',
        ),
        _MEASURED,
        _MODELLED,
        _ASSUMED,
        (
            Claim(
                30,
                'The radius of the surface is proportional to the height of the liquid.',
                'Only where the contact angle stays the same. From 90° to 0° the radius goes from '
                f'{slopes[0]:.2f} to {slopes[-1]:.2f} times the height.',
                (slopes[0], slopes[-1]),
                bool(np.ptp(slopes) <= 0.1 * np.mean(slopes)),
            ),
        ),
    )


def _handles(more: list[Line2D]) -> list[Line2D]:
    liquids = [
        Line2D([], [], color=colour, label=f'{1e3 * tension:g} mN/m')
        for tension, colour in zip(TENSIONS, _COLOURS, strict=True)
    ]
    readings = [
        Line2D([], [], color=BLACK, ls=style, label='3.80' if name == 'thesis' else name)
        for name, style in _READINGS.items()
    ]
    return [*liquids, *readings, *more]


def _span(values: list[float]) -> str:
    low, high = min(values), max(values)
    return f'{low:.2f}' if f'{low:.2f}' == f'{high:.2f}' else f'{low:.2f} to {high:.2f}'
