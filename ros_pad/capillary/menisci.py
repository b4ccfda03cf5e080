# SPDX-License-Identifier: Apache-2.0
"""Liquid surfaces round pads of any shape: in a wide bath, in a pattern of pads, as a bridge."""

from __future__ import annotations

import math

import numpy as np

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
    place: float = 0.2,
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
        In capillary lengths: at this distance from the pad the surface is held level. The error
        is ``exp(-2 reach)``.
    place : float
        Where on the face the search begins, from 0 to 1.
    """
    heavy = liquid.density * number('gravity', gravity, 'm/s²', above=True)
    length = math.sqrt(liquid.surface_tension / heavy)
    azimuths = np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False)
    number('place', place, '(share of the rail)', high=1.0)
    inner = face.rails(azimuths)[:, round(place * (KNOTS - 1))]
    span = reach * length
    far = float(inner[:, 0].max()) + span
    # Triangles grow outwards in proportion to their distance from the axis.
    step = 2.0 * math.pi / sectors
    rows = math.ceil(math.log1p(span / float(inner[:, 0].mean())) / math.log1p(step))
    vertices, triangles, lines = spanned(
        face,
        Face.floor(far, face.centre),
        (place, 1.0),
        (liquid.angle, None),
        sectors,
        rows,
        1.0 + step,
    )
    away = np.hypot(*(vertices[:, :2] - face.centre).T) - np.tile(inner[:, 0], rows + 1)
    vertices[:, 2] = np.tile(inner[:, 1], rows + 1) * np.exp(-away / length)
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
    place: float = 0.3,
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
    place : float
        Where on the face the search begins, from 0 to 1.
    """
    heavy = liquid.density * number('gravity', gravity, 'm/s²')
    number('place', place, '(share of the rail)', high=1.0)
    if sides not in (4, 6):
        raise InvalidInput(f'sides = {sides!r} is not allowed: 4 or 6 is needed')
    if sectors % (2 * sides):
        raise InvalidInput(
            f'sectors = {sectors!r} is not allowed: a multiple of {2 * sides} has vertices in the'
            ' corners of the cell'
        )
    azimuths = np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False)
    rails = face.rails(azimuths)
    if 2.0 * rails[..., 0].max() >= number('pitch', pitch, 'm', above=True):
        raise InvalidInput(
            f'pitch = {pitch:g} m is not allowed: above {2.0 * rails[..., 0].max():g} m, where the'
            ' pads do not touch'
        )
    top = float(rails[..., 1].max())
    level = float(rails[:, round(place * (KNOTS - 1)), 1].mean())
    inner = float(rails[:, round(place * (KNOTS - 1)), 0].mean())
    rows = max(2, round((0.55 * pitch - inner) / (inner + 0.55 * pitch) * sectors / math.pi))
    vertices, triangles, lines = spanned(
        face,
        Face.cell(pitch, sides, top),
        (place, level / top),
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
