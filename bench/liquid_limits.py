# SPDX-License-Identifier: Apache-2.0
"""How far off the heights of liquid are that ``wet`` and ``wet_pattern`` give and refuse.

Run ``python bench/liquid_limits.py``; takes about four minutes and prints, for the limits of
``ros_pad.capillary.layers`` as they are and with each halved and doubled (angles in rad): how many
heights are given, between what errors they lie, and between what errors those would lie that are
refused. Single pads are held to the exact meniscus of a wide bath (``bath_meniscus``), on domes
and cones from 0.01 to 3 capillary lengths; patterns of domes to the surface of least energy
(``pattern_surface``).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from ros_pad.capillary import Face
from ros_pad.capillary import Mesh
from ros_pad.capillary import Wall
from ros_pad.capillary import bath_meniscus
from ros_pad.capillary import layers
from ros_pad.capillary import pattern_surface
from ros_pad.capillary import wet
from ros_pad.capillary import wet_pattern
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.meniscus import Liquid
from ros_pad.errors import MeshError
from ros_pad.errors import NoSurface

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
    """A pad, its liquid, the exact height, m, and of one of many pads its cell, m²."""

    mesh: Mesh
    liquid: Liquid
    exact: float
    cell: float = math.inf


def main() -> int:
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    single, many = list(pads()), list(patterns())
    for names, cases, balances, ask in (
        (SINGLE, single, layers.BALANCES, on_one),
        (('AGREEMENT', 'WIDEST_GAP'), many, ('energy', 'force'), between),
    ):
        print(f'{"one pad" if ask is on_one else "pattern"}, {len(cases)} cases')
        print('limit              value  balance   given    off by %  refused    off by %')
        for name, value in [('as it is', math.nan), *scaled(names)]:
            kept = getattr(layers, name, None)
            if kept is not None:
                setattr(layers, name, value)
            for balance in balances:
                given, refused = np.array([ask(case, balance) for case in cases]).T
                print(f'{name:16}{value:8.3g}  {balance:7}{told(given)}{told(refused)}')
            if kept is not None:
                setattr(layers, name, kept)
    return 0


def scaled(names: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """Yield limits with half and twice their value; angles no farther than upright."""
    for name in names:
        for factor in (0.5, 2.0):
            value = factor * getattr(layers, name)
            yield name, min(value, 0.5 * math.pi) if name == '_STEEP' else value


def told(errors: np.ndarray) -> str:
    """Return how many errors there are, and the lowest and highest."""
    found = errors[np.isfinite(errors)]
    if not found.size:
        return f'{0:8}           -'
    return f'{found.size:8}{100.0 * found.min():+6.0f}{100.0 * found.max():+6.0f}'


def on_one(case: Case, balance: str) -> tuple[float, float]:
    """Return the error of the height that is given, and of the one that is refused."""
    loose, strict = (
        wet(case.mesh, case.liquid, balance, 200, 3, strict=strict) for strict in (False, True)
    )
    off = loose.mean_height / case.exact - 1.0
    said = strict.status[0]
    return off if said == 'ok' else math.nan, off if said == 'far_off' else math.nan


def between(case: Case, balance: str) -> tuple[float, float]:
    """Return the same for one of many pads."""
    loose, strict = (
        wet_pattern(case.mesh, case.liquid, case.cell, balance=balance, strict=strict)
        for strict in (False, True)
    )
    off = loose.height / case.exact - 1.0
    refused = strict.status in ('far_off', 'far_apart')
    return off if strict.status == 'ok' else math.nan, off if refused else math.nan


def pads() -> Iterator[Case]:
    """Yield domes and cones on which the liquid rises."""
    for angle in tqdm(ANGLES, unit='angle'):
        liquid = Liquid(TENSION, TENSION, DENSITY, math.radians(angle))
        for radius in RADII:
            base = radius * LENGTH
            for share in SHARES:
                top = (math.sqrt(1.0 - share**2) + 0.95) * base
                found = bath_meniscus(base, share * base, liquid=liquid)
                if found.height > 0.0:
                    mesh = Mesh.dome(base, share * base, top, 64, 32)
                    yield Case(mesh, liquid, found.height)
            for slope in SLOPES:
                lean = 1.0 / math.tan(math.radians(slope))
                longest = 2.5 * LENGTH if lean > -1e-9 else min(2.5 * LENGTH, -0.98 * base / lean)
                wall = Wall.cone(base, math.radians(slope), longest)
                found = bath_meniscus(wall=wall, liquid=liquid)
                if found.height > 0.0:
                    height = min(longest, 3.2 * found.height + 1e-5)
                    mesh = Mesh.cone(base, base + height * lean, height, 24, 32)
                    yield Case(mesh, liquid, found.height)


def patterns() -> Iterator[Case]:
    """Yield domes of a hexagonal pattern."""
    face = Face.of_wall(Wall.dome(*FOOT))
    dome = Mesh.dome(*FOOT, rings=48, sectors=72)
    for liquid in tqdm(LIQUIDS, unit='liquid'):
        for pitch in PITCHES:
            try:
                drawn = pattern_surface(face, liquid, pitch, pressure=0.0, sectors=24)
            except (MeshError, NoSurface):
                continue
            exact = float(drawn.vertices[drawn.lines[0].vertices, 2].mean())
            yield Case(dome, liquid, exact, math.sqrt(0.75) * pitch**2)


if __name__ == '__main__':
    sys.exit(main())
