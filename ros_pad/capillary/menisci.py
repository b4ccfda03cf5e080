# SPDX-License-Identifier: Apache-2.0
"""Liquid surfaces round pads of any shape: in a wide bath, in a pattern of pads, as a bridge."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ros_pad.capillary.bath import BathMeniscus
from ros_pad.capillary.bath import Wall
from ros_pad.capillary.bath import bath_meniscus
from ros_pad.capillary.faces import KNOTS
from ros_pad.capillary.faces import Face
from ros_pad.capillary.faces import Integers
from ros_pad.capillary.surface import Line
from ros_pad.capillary.surface import LiquidSurface
from ros_pad.capillary.surface import minimise
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.contact.meniscus import Liquid
from ros_pad.contact.pad import Array
from ros_pad.contact.pad import number
from ros_pad.errors import InvalidInput
from ros_pad.errors import NoSurface


def spanned(
    first: Face,
    last: Face,
    places: tuple[float, float],
    angles: tuple[float | None, float | None],
    sectors: int = 24,
    rows: int = 8,
    growth: float = 1.0,
) -> tuple[Array, Integers, tuple[Line, Line]]:
    """Return a straight surface between two faces, for :func:`minimise` to begin with.

    Parameters
    ----------
    first, last : Face
        The upper and the lower face of a bridge; the inner and the outer one of a meniscus.
    places : pair of float
        Where on the rails of each the surface begins, from 0 to 1.
    angles : pair of float
        Contact angle on each, rad; None pins the line there.
    sectors, rows : int
        Vertices round the surface and rows of triangles across it: from 6, and from 1.
    growth : float
        How much longer each row is than the one before it, above 0.
    """
    for name, value, least in (('sectors', sectors, 6), ('rows', rows, 1)):
        if not isinstance(value, int) or value < least:
            raise InvalidInput(f'{name} = {value!r} is not allowed: an integer from {least}')
    azimuths = np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False)
    outwards = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    rings = []
    for face, place in zip((first, last), places, strict=True):
        at = number('place', place, '(share of the rail)', high=1.0)
        radius, height = face.rails(azimuths)[:, round(at * (KNOTS - 1))].T
        rings.append(np.column_stack([radius[:, None] * outwards + face.centre, height]))
    share = np.append(0.0, np.cumsum(growth ** np.arange(rows)))
    share /= share[-1]
    vertices = (rings[0] + share[:, None, None] * (rings[1] - rings[0])).reshape(-1, 3)
    i, j = np.divmod(np.arange(rows * sectors), sectors)
    a, b = i * sectors + j, i * sectors + (j + 1) % sectors
    c, d = a + sectors, b + sectors
    flip = (i + j) % 2 == 0  # alternate diagonals favour no direction
    one = np.where(flip, [a, c, d], [a, c, b]).T
    two = np.where(flip, [a, d, b], [b, c, d]).T
    ring = np.arange(sectors)
    lines = (
        Line.ring(first, ring, places[0], angles[0]),
        Line.ring(last, rows * sectors + ring, places[1], angles[1]),
    )
    return vertices, np.concatenate([one, two]), lines


def bath_surface(
    face: Face,
    liquid: Liquid,
    gravity: float = GRAVITY,
    sectors: int = 24,
    refinements: int = 1,
    reach: float = 8.0,
) -> LiquidSurface:
    """Return the surface of a wide bath at floor level round a pad of any shape.

    Parameters
    ----------
    face : Face
        The wall of the pad.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    gravity : float
        m/s², above 0.
    sectors : int
        Vertices round the pad before refinement, from 6.
    refinements : int
        Each halves the triangles.
    reach : float
        In capillary lengths, above 0: at this distance from the pad the surface is held level.
        The error is ``exp(-2 reach)``.

    Raises
    ------
    NoSurface
        ``rim`` where the liquid stays below the floor or reaches the top of the face, and as
        :func:`minimise` does.

    Notes
    -----
    The search begins with the exact meniscus of the pad with the same radius, on average, at each
    height.
    """
    azimuths = np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False)
    rails = face.rails(azimuths)
    mean = rails.mean(axis=0)
    bath = _round_bath(mean, liquid, gravity)
    place = float(np.interp(bath.height, mean[:, 1], np.linspace(0.0, 1.0, KNOTS)))
    heavy = liquid.density * gravity
    length = math.sqrt(liquid.surface_tension / heavy)
    span = number('reach', reach, '(capillary lengths)', above=True) * length
    far = float(rails[..., 0].max()) + span
    # Triangles are as long as wide, or as the surface's curvature needs, and grow outwards.
    step = 2.0 * math.pi / sectors
    first = step * min(bath.radius, length)
    rows = math.ceil(math.log1p(step * span / first) / math.log1p(step))
    vertices, triangles, lines = spanned(
        face,
        Face.floor(far, face.centre),
        (place, 1.0),
        (liquid.angle, None),
        sectors,
        rows,
        1.0 + step,
    )
    along = np.append(0.0, np.cumsum(np.hypot(np.diff(bath.radii), np.diff(bath.heights))))
    share = np.linalg.norm(
        (vertices - vertices[:sectors].mean(axis=0)).reshape(-1, sectors, 3), axis=2
    )
    share = (share - share[0]).mean(axis=1)
    radii = np.interp(share, along, bath.radii) - bath.radius
    heights = np.interp(share, along, bath.heights)
    line = np.hypot(*(vertices[:sectors, :2] - face.centre).T)
    outwards = (vertices[:sectors, :2] - face.centre) / line[:, None]
    grid = (line + radii[:, None])[..., None] * outwards + face.centre
    vertices[:, :2] = grid.reshape(-1, 2)
    vertices[:, 2] = np.repeat(heights, sectors)
    return minimise(
        vertices,
        triangles,
        lines,
        liquid.surface_tension,
        heavy,
        pressure=0.0,
        refinements=refinements,
    )


def pattern_surface(
    face: Face,
    liquid: Liquid,
    pitch: float,
    sides: int = 6,
    pressure: float | None = None,
    volume: float | None = None,
    gravity: float = GRAVITY,
    sectors: int = 24,
    refinements: int = 1,
) -> LiquidSurface:
    """Return the surface of the liquid round one of many equal pads.

    Parameters
    ----------
    face : Face
        The wall of the pad, its axis through 0, 0.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    pitch : float
        Distance of the pads' axes, m.
    sides : int
        4 for a square pattern, 6 for a hexagonal one.
    pressure : float
        Pa, of the liquid over that of the air, at the floor: 0 where the liquid is joined to a
        wide bath at floor level.
    volume : float
        m³ of liquid per pad, in place of the pressure. The floor is wet all over.
    gravity : float
        m/s², from 0.
    sectors : int
        Vertices round the pad before refinement, a multiple of twice the sides.
    refinements : int
        Each halves the triangles.

    Raises
    ------
    NoSurface
        As :func:`minimise` does.
    """
    heavy = liquid.density * number('gravity', gravity, 'm/s²')
    cell = Face.cell(pitch, sides, 1.0)
    if sectors % (2 * sides):
        raise InvalidInput(
            f'sectors = {sectors!r} is not allowed: a multiple of {2 * sides} has vertices in the'
            ' corners of the cell'
        )
    rails = face.rails(np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False))
    widest = 2.0 * float(rails[..., 0].max())
    if widest >= pitch:
        raise InvalidInput(
            f'pitch = {pitch:g} m is not allowed: above {widest:g} m, where the pads do not touch'
        )
    mean = rails.mean(axis=0)
    place = _film_place(mean, liquid, cell, volume, gravity)
    radius, level = mean[round(place * (KNOTS - 1))]
    top = float(rails[..., 1].max())
    middle = 0.55 * pitch
    rows = max(2, round((middle - radius) / (middle + radius) * sectors / math.pi))
    vertices, triangles, lines = spanned(
        face,
        Face.cell(pitch, sides, top),
        (place, float(level) / top),
        (liquid.angle, 0.5 * math.pi),
        sectors,
        rows,
    )
    return minimise(
        vertices,
        triangles,
        lines,
        liquid.surface_tension,
        heavy,
        pressure=pressure,
        volume=volume,
        refinements=refinements,
    )


def _round_bath(mean: Array, liquid: Liquid, gravity: float) -> BathMeniscus:
    """Return the meniscus round the pad with this meridian."""
    wall = dataclasses.replace(Wall.through(*mean.T), steps=12)  # a start need not be sure
    found = bath_meniscus(wall=wall, liquid=liquid, gravity=gravity)
    if found.status in ('dry', 'rim'):
        raise NoSurface(
            'the liquid stays below the floor'
            if found.status == 'dry'
            else 'the liquid reaches the top of the face',
            'rim',
        )
    return found


def _film_place(
    mean: Array, liquid: Liquid, cell: Face, volume: float | None, gravity: float
) -> float:
    """Return about where on the rail the liquid of a pattern stands, from 0 to 1."""
    places = np.linspace(0.0, 1.0, KNOTS)
    radii, heights = mean.T
    if volume is not None:
        corners = cell.rails(np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False))[:, 0, 0]
        free = math.pi * (np.mean(corners**2) - radii**2)
        filled = np.cumsum(0.5 * (free[1:] + free[:-1]) * np.diff(heights))
        return float(np.clip(np.interp(volume, np.append(0.0, filled), places), 0.02, 0.98))
    # Between the level film of pads close by and the meniscus of one alone.
    lean = np.arctan2(np.gradient(heights), np.gradient(radii))
    level = float(np.interp(math.pi - liquid.angle, np.maximum.accumulate(lean), heights))
    if gravity > 0.0:
        level = 0.5 * (level + _round_bath(mean, liquid, gravity).height)
    return float(np.clip(np.interp(level, heights, places), 0.02, 0.98))
