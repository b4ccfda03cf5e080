# SPDX-License-Identifier: Apache-2.0
"""Errors of the laws of a pad against what the thesis measured on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import SubFigure
from scipy.optimize import brentq

from ros_pad.configuration import shared_folder
from ros_pad.contact import LARGE_PAD, Material, Pad, force_limit, inflate, press
from ros_pad.contact.calibrate import from_pressures, stiffness_of
from ros_pad.contact.fits import Constant
from ros_pad.contact.hyperelastic import highest_dome, pressure_for_height
from ros_pad.contact.measurements import Measurements
from ros_pad.contact.pad import Array, with_constant
from studies.drawing import BLACK, BLUE, DARK, GREEN, LIGHT, PALE
from studies.work_precision.comparison import Method, Problem, both

THICKNESS = 0.4e-3  # m, of the thesis' pad
ROUNDING = 0.05e-3  # m: half of the last digit of most lengths
QUANTITIES = ('height', 'gap', 'contact radius', 'force limit')

REFERENCE_SOLID = (
    *(1.286e-3, 1.579e-3, 1.967e-3, math.nan),
    *(1.431e-3, 0.858e-3, 0.495e-3),
    *(0.62e-3, 0.94e-3, 1.13e-3),
    *(math.nan, math.nan, math.nan),
)
"""Points by solid finite elements of an independent study (another fit of the same tensile data,
times 1.05; sheet bonded outside the rim; contact by penalty, its radius to 0.05 mm). It finds no
equilibrium at 85 kPa, and has no force limits."""


@dataclass(frozen=True)
class Points:
    """What was measured: heights of free domes, then gaps, contact radii, force limits.

    Attributes
    ----------
    kind : tuple of int
        Of each point, its place in QUANTITIES.
    pressure, force, value : array
        Pa, N (NaN for force limits), m or N.
    """

    kind: tuple[int, ...]
    pressure: Array
    force: Array
    value: Array


@dataclass(frozen=True)
class Model:
    """A law of the pad with its fitted constant, and both ends of its 95 % interval.

    Attributes
    ----------
    name : str
    pads : tuple of Pad
        As chosen, and at both ends; empty where the points are given.
    model : str
        That of :func:`ros_pad.contact.press`.
    colour, marker : str
        Of its marks.
    """

    name: str
    pads: tuple[Pad, ...]
    model: str
    colour: str
    marker: str


def thesis() -> Measurements:
    """Return what the thesis measured on its large pad."""
    return Measurements.read(shared_folder() / 'measurements' / 'thesis.csv')


def points() -> Points:
    """Return the measured points of the thesis' pad."""
    found = thesis()
    free, pressed, limits = found.free, found.pressed, found.force_limits
    gap = pressed.height - pressed.depth
    parts = (
        (free.pressure, np.zeros_like(free.pressure), free.height),
        (pressed.pressure, pressed.force, gap),
        (pressed.pressure, pressed.force, pressed.contact_radius),
        (limits.pressure, np.full_like(limits.pressure, np.nan), limits.force_limit),
    )
    kind = tuple(place for place, part in enumerate(parts) for _ in part[0])
    return Points(kind, *(np.concatenate(column) for column in zip(*parts, strict=True)))


def models() -> tuple[Model, ...]:
    """Return the laws, each with its constant fitted to the free domes (cap: as in the thesis)."""
    free = thesis().free
    stiffness = from_pressures('stiffness', 'N/m', 1.0 / stiffness_of(LARGE_PAD, *free))
    caps = (LARGE_PAD, *_ends(LARGE_PAD, stiffness))
    material = Material.load('dragon_skin_10')
    sheet = Pad.of(material, LARGE_PAD.radius, THICKNESS)
    return (
        Model('spherical cap, k = 40 N/m', caps, 'thesis', DARK, 'o'),
        Model('exact membrane of that law', caps, 'membrane', LIGHT, 's'),
        Model('hyperelastic membrane', _fitted(sheet), 'membrane', GREEN, 'D'),
        Model('solid of another study', (), '', BLUE, 'X'),
    )


def _fitted(pad: Pad) -> tuple[Pad, ...]:
    """Return a pad with its factor fitted to the heights that it can have, and both ends."""
    free = thesis().free
    known = free.height < highest_dome(pad)
    ratio = pressure_for_height(pad, free.height[known]) / free.pressure[known]
    factor = from_pressures('factor', '(factor)', ratio)
    return (with_constant(pad, factor.name, factor.value), *_ends(pad, factor))


def _ends(pad: Pad, law: Constant) -> tuple[Pad, Pad]:
    return (with_constant(pad, law.name, law.low), with_constant(pad, law.name, law.high))


def predicted(model: Model, measured: Points) -> Array:
    """Return what a law gives for the points, (3, points): as chosen, and at both ends.

    NaN where it gives nothing.
    """
    if not model.pads:
        return np.tile(REFERENCE_SOLID, (3, 1))
    return np.array([_row(pad, model.model, measured) for pad in model.pads])


def _row(pad: Pad, model: str, measured: Points) -> Array:
    kind, p, force = np.array(measured.kind), measured.pressure, measured.force
    found = np.full(len(kind), np.nan)
    free, gap, radius, limit = (kind == place for place in range(4))
    found[free] = inflate(pad, p[free]).height
    states = press(pad, p[gap], force[gap], adhesion='none', model=model)
    found[gap], found[radius] = states.gap, states.contact_radius
    found[limit] = _limits(pad, p[limit], model)
    return found


def _limits(pad: Pad, pressure: Array, model: str) -> Array:
    """Return the forces, N, at which the gap is as high as the sheet is thick."""
    if pad.material is not None or model == 'thesis':
        return np.asarray(force_limit(pad, pressure))

    def force(p: float) -> float:
        def excess(force: float) -> float:
            return float(press(pad, p, force, adhesion='none', model=model).gap) - THICKNESS

        return float(brentq(excess, 1e-3, 0.9 * p * math.pi * pad.radius**2))

    return np.array([force(p) for p in pressure.tolist()])


def problem() -> tuple[Problem, tuple[Method, ...]]:
    """Return heights and gaps of the measured pads, and the laws as methods."""
    measured = points()
    some = np.array(measured.kind) < 2
    question = Problem(
        'height and gap, against measured pads',
        {'pressure_pa': measured.pressure[some], 'force_n': measured.force[some]},
        measured.value[some],
        np.ones(int(some.sum()), dtype=bool),
        wrong=math.inf,
    )
    return question, tuple(
        method for model in models()[:3] for method in both(model.name, gap_of(model))
    )


def gap_of(model: Model) -> Callable[..., Any]:
    """Return the gap of a law as a function of pressure and force."""
    pad = model.pads[0]
    return lambda p, force: press(pad, p, force, adhesion='none', model=model.model).gap


def draw(figure: SubFigure) -> None:
    """Draw the error of every law at every measured point, with its interval."""
    measured, chosen = points(), models()
    panel = figure.subplots()
    places = np.arange(len(measured.kind)) + 0.6 * np.array(measured.kind)
    rounded = 100.0 * ROUNDING / np.where(np.array(measured.kind) < 3, measured.value, np.nan)
    panel.bar(places, 2.0 * rounded, 0.8, -rounded, color=PALE, alpha=0.35, label='rounding')
    for row, model in enumerate(chosen):
        errors = 100.0 * (predicted(model, measured) / measured.value - 1.0)
        at = places + 0.19 * (row - 0.5 * (len(chosen) - 1))
        low, high = np.fmin.reduce(errors), np.fmax.reduce(errors)
        panel.vlines(at, low, high, color=model.colour, lw=2.0, alpha=0.5)
        gone = np.isnan(errors).any(axis=0) & ~np.isnan(errors[0])
        panel.plot(at[gone], high[gone] + 9.0, '^', color=model.colour, ms=6)
        panel.plot(at, errors[0], model.marker, color=model.colour, ms=6, label=model.name)
    panel.axhline(0.0, color=BLACK, lw=0.8)
    labels = [
        f'{pressure / 1e3:.0f} kPa' + ('' if not force > 0.0 else f'\n{force:g} N')
        for pressure, force in zip(measured.pressure, measured.force, strict=True)
    ]
    panel.set_xticks(places, labels, fontsize=8.5)
    for place, name in enumerate(QUANTITIES):
        here = places[np.array(measured.kind) == place]
        panel.text(here.mean(), 1.01, name, transform=panel.get_xaxis_transform(), ha='center')
    panel.set_ylabel('error of the law, %')
    panel.grid(axis='y', color=PALE, alpha=0.3, lw=0.5)
    panel.spines[['top', 'right']].set_visible(False)
    figure.legend(loc='outside upper center', ncols=3, frameon=False, fontsize=9.0)
    figure.supxlabel(
        'Error against each measured point of the thesis. Green: laws that ros_pad solves; blue:'
        ' others.\nBars: 95 % interval of the constant that is fitted to the heights (cap: disc at'
        ' the 40 N/m of the thesis);\ntriangle: no state at one end. Force limits: where the gap'
        ' is as high as the sheet is thick.\nThe values seem read off and rounded: lengths to'
        ' 0.05 mm (grey), forces by an unknown amount.\nFigures 17 and 18 of the thesis have error'
        ' bars, for which its text gives no numbers.',
        fontsize=9.0,
    )
