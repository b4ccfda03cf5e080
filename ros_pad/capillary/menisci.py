# SPDX-License-Identifier: Apache-2.0
"""Liquid surfaces around pads of any shape: in a wide bath, in a pattern of pads, as a bridge."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ros_pad.capillary.bath import BathMeniscus, Wall, bath_meniscus
from ros_pad.capillary.faces import KNOTS, Face, Integers
from ros_pad.capillary.layers import WETTING
from ros_pad.capillary.mesh import Mesh
from ros_pad.capillary.rails import Line
from ros_pad.capillary.sections import centre
from ros_pad.capillary.surface import LiquidSurface, minimise
from ros_pad.configuration import instance, integer, number
from ros_pad.contact.meniscus import GRAVITY, Liquid, hysteresis_force
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, NoSurface


def spanned(
    first: Face,
    last: Face,
    places: tuple[float, float],
    angles: tuple[float | None, float | None],
    sectors: int = 24,
    rows: int = 8,
    growth: float = 1.0,
) -> tuple[Array, Integers, tuple[Line, Line]]:
    """Return a straight surface between two faces, from which :func:`minimise` can start.

    Parameters
    ----------
    first, last : Face
        Upper and lower face of a bridge; inner and outer face of a meniscus.
    places : pair of float
        Place of the contact line on the rails of each face, dimensionless, from 0 to 1.
    angles : pair of float
        Contact angle on each face, rad; None pins the line.
    sectors, rows : int
        Number of vertices around the surface, from 6, and of rows of triangles, from 1.
    growth : float
        Ratio of the lengths of consecutive rows, above 0.

    Returns
    -------
    tuple
        Vertices, m, triangles and lines, the first arguments of :func:`minimise`.

    Raises
    ------
    InvalidInput
        When a place, an angle or a number is out of range.
    """
    integer('sectors', sectors, 6)
    integer('rows', rows, 1)
    number('growth', growth, '(ratio)', above=True)
    instance('first', first, Face)
    instance('last', last, Face)
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
    flip = (i + j) % 2 == 0  # alternating diagonals prefer no direction
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
    """Compute the surface of a wide bath at floor level around a pad of any shape.

    Parameters
    ----------
    face : Face
        The wall of the pad.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    gravity : float
        Gravity, m/s², above 0.
    sectors : int
        Number of vertices around the pad before refinement, from 6.
    refinements : int
        Number of refinements; each halves the size of the triangles.
    reach : float
        Distance from the pad at which the surface ends, level, in capillary lengths, above 0. From
        2 on, the relative error of height, force and volume is at most ``2.1 exp(-2 reach)``.

    Returns
    -------
    LiquidSurface
        Positions, m, area, m², energy, J, volume, m³, pressure, Pa, and force on each face, N.

    Raises
    ------
    NoSurface
        ``rim`` where the liquid is pushed below the floor or reaches the end of the face; other
        statuses as in :func:`bath_meniscus` and :func:`minimise`.
    InvalidInput
        When a value is not finite or out of range.

    Notes
    -----
    The minimisation starts from the exact meniscus of the axisymmetric pad with the same mean
    radius at each height. The surface ends on a vertical cylinder, at a right angle: a surface
    held at floor level there would leave out ``exp(-reach)`` of the volume, which its edge bears.

    Examples
    --------
    The same dome as a surface of triangles: within 2 % of the exact one of :func:`bath_meniscus`.

    >>> from ros_pad.capillary import Face, Wall, bath_meniscus, bath_surface
    >>> from ros_pad.contact import WATER
    >>> wall = Wall.dome(1.55e-3, 0.583e-3)
    >>> surface = bath_surface(Face.of_wall(wall), WATER, sectors=12)
    >>> abs(surface.volume / bath_meniscus(wall=wall, liquid=WATER).volume - 1) < 0.02
    True
    """
    instance('face', face, Face)
    azimuths = np.linspace(0.0, 2.0 * math.pi, integer('sectors', sectors, 6), endpoint=False)
    rails = face.rails(azimuths)
    mean = rails.mean(axis=0)
    bath = _round_bath(mean, liquid, gravity)
    place = float(np.interp(bath.height, mean[:, 1], np.linspace(0.0, 1.0, KNOTS)))
    heavy = liquid.density * gravity
    length = math.sqrt(liquid.surface_tension / heavy)
    span = number('reach', reach, '(capillary lengths)', above=True) * length
    far = float(rails[..., 0].max()) + span
    # Triangles are as long as wide, or shorter where the surface is curved, and grow outwards.
    step = 2.0 * math.pi / sectors
    first = step * min(bath.radius, length)
    rows = math.ceil(math.log1p(step * span / first) / math.log1p(step))
    top = float(rails[..., 1].max())
    vertices, triangles, lines = spanned(
        face,
        Face.revolution([far, far], [-top, top], face.centre),
        (place, 0.5),
        (liquid.angle, 0.5 * math.pi),
        sectors,
        rows,
        1.0 + step,
    )
    _bend(vertices, bath, sectors, face.centre)
    return minimise(
        vertices,
        triangles,
        lines,
        liquid.surface_tension,
        heavy,
        pressure=0.0,
        refinements=refinements,
    )


def _bend(vertices: Array, bath: BathMeniscus, sectors: int, centre: tuple[float, float]) -> None:
    """Move the vertices of a straight surface onto the meniscus of a wide bath."""
    along = np.append(0.0, np.cumsum(np.hypot(np.diff(bath.radii), np.diff(bath.heights))))
    distance = np.linalg.norm(
        (vertices - vertices[:sectors].mean(axis=0)).reshape(-1, sectors, 3), axis=2
    )
    distance = (distance - distance[0]).mean(axis=1)
    radii = np.interp(distance, along, bath.radii) - bath.radius
    heights = np.interp(distance, along, bath.heights)
    line = np.hypot(*(vertices[:sectors, :2] - centre).T)
    outwards = (vertices[:sectors, :2] - centre) / line[:, None]
    grid = (line + radii[:, None])[..., None] * outwards + centre
    vertices[:, :2] = grid.reshape(-1, 2)
    vertices[:, 2] = np.repeat(heights, sectors)


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
    """Compute the surface of the liquid around one of many equal pads.

    Parameters
    ----------
    face : Face
        The wall of the pad, with its axis through 0, 0.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    pitch : float
        Distance between the axes of neighbouring pads, m.
    sides : int
        4 for a square pattern, 6 for a hexagonal one.
    pressure : float, optional
        Pressure of the liquid minus that of the air at the floor, Pa: 0 where the liquid is
        connected to a wide bath at floor level.
    volume : float, optional
        Volume of liquid per pad, m³, instead of the pressure. The whole floor is wet.
    gravity : float
        Gravity, m/s², from 0.
    sectors : int
        Number of vertices around the pad before refinement, a multiple of twice ``sides``.
    refinements : int
        Number of refinements; each halves the size of the triangles.

    Returns
    -------
    LiquidSurface
        Positions, m, area, m², energy, J, volume, m³, pressure, Pa, and force on each face, N.

    Raises
    ------
    NoSurface
        As :func:`minimise` does.
    InvalidInput
        When a value is out of range, pads of this pitch touch, or both or none of pressure and
        volume are given.
    """
    instance('face', face, Face)
    instance('liquid', liquid, Liquid)
    heavy = liquid.density * number('gravity', gravity, 'm/s²')
    integer('sectors', sectors, 6)
    if volume is not None:
        number('volume', volume, 'm³', above=True)
    cell = Face.cell(pitch, sides, 1.0)
    if sectors % (2 * sides):
        raise InvalidInput(
            f'sectors = {sectors!r} is not allowed: a multiple of {2 * sides} is needed, for'
            ' vertices in the corners of the cell'
        )
    rails = face.rails(np.linspace(0.0, 2.0 * math.pi, sectors, endpoint=False))
    widest = 2.0 * float(rails[..., 0].max())
    if widest >= pitch:
        raise InvalidInput(
            f'pitch = {pitch:g} m is not allowed: above {widest:g} m, the width of the pads, is'
            ' needed'
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


@dataclasses.dataclass(frozen=True)
class WetSurface:
    """Liquid of least energy around a meshed pad, alone in a bath or one of many.

    Attributes
    ----------
    surface : LiquidSurface
        The surface; its pressure is 0 at the floor, its forces are those on the pad (first) and on
        what ends the bath or cell.
    line : array, shape (n, 3)
        Points of the contact line on the pad, in order of azimuth, m.
    axis : tuple of float
        x and y of the axis of the pad, m.
    error : float
        Estimated relative error of the mean height: its change by the last halving of the
        triangles, twice that below 10 degrees of contact angle, where convergence is slower.
    liquid : Liquid
        The liquid.
    """

    surface: LiquidSurface
    line: Array
    axis: tuple[float, float]
    error: float
    liquid: Liquid

    def hysteresis_force(self, direction: float, advancing: float, receding: float) -> float:
        """Return the largest force of the pinned contact line against a motion.

        Parameters
        ----------
        direction : float
            Azimuth of the motion, rad from the x axis.
        advancing, receding : float
            Contact angles at which the line starts to move, rad, from 0 to pi; advancing >=
            receding.

        Returns
        -------
        float
            Force, N, as :meth:`ros_pad.capillary.Wet.hysteresis_force`.

        Raises
        ------
        InvalidInput
            When an angle is not finite or out of range.
        """
        azimuth = number('direction', direction, 'rad', low=-math.inf)
        width = np.ptp(self.line[:, 1] * math.cos(azimuth) - self.line[:, 0] * math.sin(azimuth))
        tension = self.liquid.surface_tension
        return float(hysteresis_force(0.5 * float(width), tension, advancing, receding))


def wet_surface(
    mesh: Mesh, liquid: Liquid, area: float | None = None, sectors: int = 24, refinements: int = 1
) -> WetSurface:
    """Compute the liquid of least energy around a meshed pad, with its error.

    Parameters
    ----------
    mesh : Mesh
        A single pad; each horizontal section is star-shaped as seen from the centroid of the
        lowest one.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    area : float, optional
        Area of one pad of a hexagonal pattern with the gap around it, m², above 0. Without it the
        pad stands alone in a wide bath at floor level.
    sectors : int
        Number of vertices around the pad before refinement, from 6; of a pattern a multiple of 12.
    refinements : int
        Number of refinements, from 1; each halves the size of the triangles.

    Returns
    -------
    WetSurface
        The surface, its contact line, m, and its estimated error.

    Raises
    ------
    NoSurface
        As :func:`bath_surface` and :func:`pattern_surface` do.
    MeshError
        When the wall is not star-shaped, see :meth:`Face.of_mesh`.
    InvalidInput
        When a value is out of range or of the wrong type, or pads on this area touch.

    Examples
    --------
    The exact meniscus of this dome in a wide bath is 0.889 mm high (:func:`bath_meniscus`):

    >>> from ros_pad.capillary import Mesh, wet_surface
    >>> from ros_pad.contact import WATER
    >>> found = wet_surface(Mesh.dome(1.55e-3, 0.583e-3), WATER)
    >>> round(1e3 * float(found.line[:, 2].mean()), 2), found.error < 0.01
    (0.89, True)
    """
    instance('mesh', mesh, Mesh)
    integer('refinements', refinements, 1)
    axis = centre(mesh, 0.005 * mesh.height)
    there = np.array([*axis, 0.0])
    face = Face.of_mesh((mesh.points - there, mesh.faces))
    heights = []
    for level in (refinements - 1, refinements):
        if area is None:
            found = bath_surface(face, liquid, sectors=sectors, refinements=level)
        else:
            pitch = math.sqrt(number('area', area, 'm²', above=True) / math.sqrt(0.75))
            found = pattern_surface(
                face, liquid, pitch, pressure=0.0, sectors=sectors, refinements=level
            )
        heights.append(float(found.vertices[found.lines[0].vertices, 2].mean()))
    line = found.lines[0]
    around = np.argsort(np.mod(line.azimuths, 2.0 * math.pi))
    found = dataclasses.replace(found, vertices=found.vertices + there)
    return WetSurface(
        surface=found,
        line=found.vertices[line.vertices[around]],
        axis=axis,
        error=abs(1.0 - heights[0] / heights[1]) * (2.0 if liquid.angle < WETTING else 1.0),
        liquid=liquid,
    )


def _round_bath(mean: Array, liquid: Liquid, gravity: float) -> BathMeniscus:
    """Return the meniscus around the axisymmetric pad with this meridian."""
    wall = dataclasses.replace(Wall.through(*mean.T), steps=12)  # coarse: only a start is needed
    found = bath_meniscus(wall=wall, liquid=liquid, gravity=gravity)
    if found.status in ('dry', 'rim'):
        raise NoSurface(
            'the liquid is pushed below the floor, where the face ends'
            if found.status == 'dry'
            else f'the liquid reaches the end of the face at height = {found.height:g} m: a'
            ' contact line between bottom and top of the face is needed',
            'rim',
        )
    return found


def _film_place(
    mean: Array, liquid: Liquid, cell: Face, volume: float | None, gravity: float
) -> float:
    """Return an estimate of the contact line's place on the rail in a pattern, from 0 to 1."""
    places = np.linspace(0.0, 1.0, KNOTS)
    radii, heights = mean.T
    if volume is not None:
        corners = cell.rails(np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False))[:, 0, 0]
        free = math.pi * (np.mean(corners**2) - radii**2)
        filled = np.cumsum(0.5 * (free[1:] + free[:-1]) * np.diff(heights))
        return float(np.clip(np.interp(volume, np.append(0.0, filled), places), 0.02, 0.98))
    # Take the mean height of the level film between close pads and the meniscus of a single pad.
    lean = np.arctan2(np.gradient(heights), np.gradient(radii))
    level = float(np.interp(math.pi - liquid.angle, np.maximum.accumulate(lean), heights))
    if gravity > 0.0:
        from scipy.special import k0e, k1e

        # Its meniscus is that of small slopes, with the height of steep ones for wide pads.
        length = math.sqrt(liquid.surface_tension / (liquid.density * gravity))
        slopes = np.maximum(math.pi - liquid.angle - lean, 0.0)
        distance = np.maximum(radii / length, 1e-9)
        met = 2.0 * length * np.sin(0.5 * slopes) * k0e(distance) / k1e(distance) <= heights
        level = 0.5 * (level + float(heights[np.argmax(met)] if met.any() else heights[-1]))
    return float(np.clip(np.interp(level, heights, places), 0.02, 0.98))
