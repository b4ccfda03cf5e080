# SPDX-License-Identifier: Apache-2.0
"""Measure errors of what ``wet`` and ``wet_pattern`` return and refuse.

Prints the number of returned heights, and of volumes between pads, with the range of their errors,
and the same of refused ones: with the limits of ros_pad.capillary.layers as shipped, and with each
of these limits halved and doubled (angles in rad, up to 90 degrees). Single pads, domes and cones
from 0.01 to 3 capillary lengths, are compared with the exact meniscus of a wide bath
(``bath_meniscus``), patterns of domes with the surface of minimum energy (``wet_surface``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ros_pad.capillary import Mesh, Wall, bath_meniscus, layers, wet, wet_pattern, wet_surface
from ros_pad.contact.meniscus import GRAVITY, Liquid
from ros_pad.errors import MeshError, NoSurface
from studies import command

TENSION, DENSITY = 0.073, 1000.0
LENGTH = math.sqrt(TENSION / (DENSITY * GRAVITY))
ANGLES = (0.0, 5.0, 11.0, 20.0, 45.0, 75.0, 95.0)  # of contact, degrees
RADII = (0.01, 0.03, 0.1, 0.26, 0.7, 3.0)  # capillary lengths
SHARES = (0.05, 0.8)  # of a dome's contact radius to its own
SLOPES = (25.0, 50.0, 60.0, 65.0, 69.0, 80.0, 90.0, 100.0, 120.0, 140.0)  # of cones, degrees
FOOT = (1.55e-3, 0.583e-3, 2.9e-3)  # m: sphere, contact and height of the domes in patterns
PITCHES = (3.2e-3, 3.8e-3, 4.4e-3, 5e-3, 6e-3, 7e-3, 9e-3)  # m
LIQUIDS = (Liquid(0.073, 0.027), Liquid(0.03, 0.018), Liquid(0.01, 0.006))
SINGLE = ('AGREEMENT', 'SLENDER', 'WETTING', '_STEEP', '_STRAIGHT')


class Case(NamedTuple):
    """A pad, its liquid, the exact height, m; in a pattern area (m²) and volume (m³) per pad."""

    mesh: Mesh
    liquid: Liquid
    exact: float
    cell: float = math.inf
    volume: float = math.nan


Ask = Callable[[Case, str], tuple[float, float]]


def main(words: Sequence[str]) -> int:
    """Measure and print."""
    parser = command.parser('liquid_limits', __doc__)
    command.add_count(parser, '--every', 1, 'take every N-th case only')
    options = parser.parse_args(words)
    single, many = list(pads())[:: options.every], list(patterns())[:: options.every]
    rows = measure('one pad', SINGLE, single, layers.BALANCES, on_one)
    rows += measure('pattern', ('AGREEMENT', 'WIDEST_GAP'), many, ('energy', 'force'), between)
    rows += measure('volume', ('WIDEST_GAP',), many, ('energy', 'force'), volumes)
    title = f'{len(single)} cases of one pad, {len(many)} of patterns: errors, least, most'
    shown = [row | {word: _range(row[word]) for word in ('given', 'refused')} for row in rows]
    command.show(options, rows, command.listed(shown, title))
    return 0


def measure(
    what: str, names: tuple[str, ...], cases: Sequence[Case], balances: Sequence[str], ask: Ask
) -> list[dict[str, Any]]:
    """Return the relative errors of returned and refused heights, with each limit changed."""
    rows = []
    for name, value in [('as it is', math.nan), *scaled(names)]:
        kept = getattr(layers, name, None)
        if kept is not None:
            setattr(layers, name, value)
        for balance in balances:
            errors = np.array([ask(case, balance) for case in cases]).T
            given, refused = (each[np.isfinite(each)].tolist() for each in errors)
            rows.append({
                'what': what, 'limit': name, 'value': value, 'balance': balance,
                'given': given, 'refused': refused,
            })  # fmt: skip
        if kept is not None:
            setattr(layers, name, kept)
    return rows


def scaled(names: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """Yield each limit with half and with twice its value; the angle at most 90 degrees."""
    for name in names:
        for factor in (0.5, 2.0):
            value = factor * getattr(layers, name)
            yield name, min(value, 0.5 * math.pi) if name == '_STEEP' else value


def _range(errors: Sequence[float]) -> tuple[float, ...]:
    return (len(errors), min(errors), max(errors)) if errors else (0,)


def on_one(case: Case, balance: str) -> tuple[float, float]:
    """Return the relative errors of a returned and of a refused height; one of them is NaN."""
    loose, strict = (
        wet(case.mesh, case.liquid, balance, 200, 3, strict=strict) for strict in (False, True)
    )
    off = loose.mean_height / case.exact - 1.0
    status = strict.status[0]
    return off if status == 'ok' else math.nan, off if status == 'far_off' else math.nan


def between(case: Case, balance: str) -> tuple[float, float]:
    """Return the same as :func:`on_one` for a pattern of pads."""
    return _filled(case, balance, 'height', case.exact)


def volumes(case: Case, balance: str) -> tuple[float, float]:
    """Return the same as :func:`between` for the volume of the liquid."""
    return _filled(case, balance, 'volume', case.volume)


def _filled(case: Case, balance: str, what: str, exact: float) -> tuple[float, float]:
    loose, strict = (
        wet_pattern(case.mesh, case.liquid, case.cell, balance=balance, strict=strict)
        for strict in (False, True)
    )
    off = getattr(loose, what) / exact - 1.0
    refused = strict.status in ('far_off', 'far_apart')
    return off if strict.status == 'ok' else math.nan, off if refused else math.nan


def pads() -> Iterator[Case]:
    """Yield domes and cones on which the liquid rises."""
    for angle in command.each(ANGLES, 'one pad', 'angle'):
        liquid = Liquid(TENSION, TENSION, DENSITY, math.radians(angle))
        for radius in RADII:
            base = radius * LENGTH
            for share in SHARES:
                top = (math.sqrt(1.0 - share**2) + 0.95) * base
                found = bath_meniscus(Wall.dome(base, share * base), liquid)
                if found.height > 0.0:
                    mesh = Mesh.dome(base, share * base, top, 64, 32)
                    yield Case(mesh, liquid, found.height)
            for slope in SLOPES:
                lean = 1.0 / math.tan(math.radians(slope))
                longest = 2.5 * LENGTH if lean > -1e-9 else min(2.5 * LENGTH, -0.98 * base / lean)
                wall = Wall.cone(base, math.radians(slope), longest)
                found = bath_meniscus(wall, liquid)
                if found.height > 0.0:
                    height = min(longest, 3.2 * found.height + 1e-5)
                    mesh = Mesh.cone(base, base + height * lean, height, 24, 32)
                    yield Case(mesh, liquid, found.height)


def patterns() -> Iterator[Case]:
    """Yield domes of a hexagonal pattern for which the reference has a result."""
    wall = Wall.dome(*FOOT)
    dome = Mesh.dome(*FOOT, rings=48, sectors=72)
    for liquid in command.each(LIQUIDS, 'patterns', 'liquid'):
        for pitch in PITCHES:
            try:
                drawn = wet_surface(wall, liquid, math.sqrt(0.75) * pitch**2)
            except (MeshError, NoSurface):
                continue
            yield Case(dome, liquid, drawn.mean_height, math.sqrt(0.75) * pitch**2, drawn.volume)
