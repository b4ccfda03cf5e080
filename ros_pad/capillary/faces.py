# SPDX-License-Identifier: Apache-2.0
"""Solid faces that liquid wets: pads, floors, plates, and symmetry planes between equal pads."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.bath import Wall
from ros_pad.configuration import instance, number, quantity
from ros_pad.contact.pad import Array, broadcast
from ros_pad.errors import InvalidInput, MeshError

Integers: TypeAlias = npt.NDArray[np.int64]

KNOTS = 129  # number of points of a rail


@dataclass(frozen=True)
class Face:
    """A solid face around a vertical axis, star-shaped in every horizontal section.

    Parameters
    ----------
    rails : callable
        Function of azimuths (rad, shape (n,)): returns radii and heights of the face, m, shape
        (n, KNOTS, 2), from the start of wetting to the end of the face, at nearly equal steps of
        arc length.
    centre : array, shape (2,)
        x and y of the axis, m.
    under : bool
        True if the liquid stands on this face, as on a floor; False if the face is beside or
        above the liquid.

    Raises
    ------
    InvalidInput
        When the centre is not two finite numbers.
    """

    rails: Callable[[Array], Array]
    centre: tuple[float, float] = (0.0, 0.0)
    under: bool = False

    def __post_init__(self) -> None:
        if np.shape(quantity('centre', self.centre, 'm', -math.inf)) != (2,):
            raise InvalidInput(f'centre = {self.centre} is not allowed: x and y are needed')

    @classmethod
    def revolution(
        cls, radii: npt.ArrayLike, heights: npt.ArrayLike, centre: tuple[float, float] = (0.0, 0.0)
    ) -> Face:
        """Return a face of revolution through points of its meridian.

        Parameters
        ----------
        radii, heights : array, shape (n,)
            Points in the order in which they are wetted, m; n from 2.
        centre : (float, float)
            x and y of the axis, m.

        Returns
        -------
        Face
            The face.

        Raises
        ------
        InvalidInput
            When a value is not finite, a radius is negative, or there are not two points or more.
        """
        r, z = broadcast(
            'radii and heights',
            quantity('radii', radii, 'm'),
            quantity('heights', heights, 'm', -math.inf),
        )
        if np.ndim(r) != 1 or r.size < 2:
            raise InvalidInput(
                f'radii of shape {np.shape(r)} are not allowed: at least two points are needed'
            )
        rail = _even(np.stack([r, z], axis=-1))
        return cls(lambda azimuths: np.broadcast_to(rail, (azimuths.size, KNOTS, 2)), centre)

    @classmethod
    def of_wall(cls, wall: Wall, centre: tuple[float, float] = (0.0, 0.0)) -> Face:
        """Return the face of an axisymmetric pad, from the floor to its top.

        Parameters
        ----------
        wall : Wall
            The wall of the pad, of finite height.
        centre : (float, float)
            x and y of the axis, m.

        Returns
        -------
        Face
            The face.

        Raises
        ------
        InvalidInput
            When ``wall`` is no Wall, or is infinite.
        """
        instance('wall', wall, Wall)
        places = np.linspace(wall.floor, wall.top, KNOTS)
        radii, heights = np.transpose([wall.meridian(float(place))[:2] for place in places])
        return cls.revolution(radii, heights, centre)

    @classmethod
    def floor(cls, radius: float, centre: tuple[float, float] = (0.0, 0.0)) -> Face:
        """Return a disc of the floor, wetted from its centre.

        Parameters
        ----------
        radius : float
            Radius of the disc, m, above 0.
        centre : (float, float)
            x and y of the axis, m.

        Returns
        -------
        Face
            The face.

        Raises
        ------
        InvalidInput
            When a value is not finite or out of range.
        """
        return replace(cls.plate(radius, 0.0, centre), under=True)

    @classmethod
    def plate(cls, radius: float, height: float, centre: tuple[float, float] = (0.0, 0.0)) -> Face:
        """Return the underside of a horizontal disc, wetted from its centre.

        Parameters
        ----------
        radius : float
            Radius of the disc, m, above 0.
        height : float
            Height above the floor, m.
        centre : (float, float)
            x and y of the axis, m.

        Returns
        -------
        Face
            The face.

        Raises
        ------
        InvalidInput
            When a value is not finite or out of range.
        """
        size = number('radius', radius, 'm', above=True)
        return cls.revolution([0.0, size], [height, height], centre)

    @classmethod
    def cell(cls, pitch: float, sides: int, height: float) -> Face:
        """Return the symmetry planes between equal pads; liquid meets them at a right angle.

        Parameters
        ----------
        pitch : float
            Distance between the axes of neighbouring pads, m, above 0.
        sides : int
            4 for a square pattern, 6 for a hexagonal one.
        height : float
            Height of the planes, m, above 0.

        Returns
        -------
        Face
            The planes.

        Raises
        ------
        InvalidInput
            When a value is not finite or not allowed.
        """
        size = number('pitch', pitch, 'm', above=True)
        top = number('height', height, 'm', above=True)
        if sides not in (4, 6):
            raise InvalidInput(f'sides = {sides!r} is not allowed: 4 or 6 is needed')
        sector = 2.0 * math.pi / sides

        def rails(azimuths: Array) -> Array:
            off = np.mod(azimuths + 0.5 * sector, sector) - 0.5 * sector
            up = np.broadcast_to(np.linspace(0.0, top, KNOTS), (azimuths.size, KNOTS))
            return np.stack([0.5 * size / np.cos(off)[:, None] + 0.0 * up, up], axis=-1)

        return cls(rails)

    @classmethod
    def of_mesh(cls, mesh: Any, centre: tuple[float, float] = (0.0, 0.0)) -> Face:
        """Return the wall of a meshed pad.

        Parameters
        ----------
        mesh : Mesh, or pair of arrays
            Points (n, 3), m, and triangles (m, 3). The mesh is only the wall, or the closed pad:
            horizontal parts (bottom and top) are ignored.
        centre : array, shape (2,)
            x and y of a vertical line inside the pad, m.

        Returns
        -------
        Face
            The wall, fitted to the mesh.

        Raises
        ------
        MeshError
            When the wall does not surround the line exactly once, leans over itself, is open
            between its lower and upper end, or has fewer than 12 vertices.

        Notes
        -----
        Radii are fitted to the vertices, over azimuth and height, by moving least squares with
        quadratics, because contact angles need smooth slopes. Edges of the pad are rounded over
        about two triangles.
        """
        vertices, triangles = (mesh.points, mesh.faces) if hasattr(mesh, 'points') else mesh
        points = np.asarray(vertices, float) - np.append(centre, 0.0)
        walls = np.asarray(triangles, dtype=np.int64)
        size = float(np.ptp(points, axis=0).max())
        walls = walls[np.ptp(points[walls][..., 2], axis=1) > 1e-9 * size]
        azimuth, z = np.arctan2(points[:, 1], points[:, 0]), points[:, 2]
        turn = azimuth[walls] - azimuth[walls[:, :1]]
        turn -= 2.0 * math.pi * np.round(turn / (2.0 * math.pi))
        rise = z[walls] - z[walls[:, :1]]
        area = turn[:, 1] * rise[:, 2] - turn[:, 2] * rise[:, 1]  # over azimuth and height
        around = abs(abs(area.sum()) - 4.0 * math.pi * np.ptp(z[walls])) < 1e-6 * size
        if not (around and ((area > 0.0).all() or (area < 0.0).all())):
            raise MeshError(
                'the wall of the mesh is open, leans over itself, or does not surround the'
                f' vertical line through centre = {centre[0]:g}, {centre[1]:g} m exactly once'
            )
        low, high = float(z[walls].min()), float(z[walls].max())
        rim = z[boundary_edges(walls)]
        if np.minimum(rim - low, high - rim).max() > 1e-6 * size:
            raise MeshError(
                f'the wall of the mesh is open between its lowest and highest point, z = {low:g}'
                f' and {high:g} m: only its lower and upper end may be open'
            )
        use = np.unique(walls)
        if use.size < 12:
            raise MeshError(
                f'the wall of the mesh has {use.size} vertices: at least 12 are needed'
            )
        radii = np.hypot(points[use, 0], points[use, 1])
        # Scale heights so that rows and columns of vertices are equally far apart.
        scale = float(np.mean(abs(rise)) / np.mean(abs(turn)))
        chart = np.column_stack([azimuth[use], z[use] / scale])
        turns = np.concatenate([chart + np.array([2.0 * math.pi * k, 0.0]) for k in (-1, 0, 1)])

        def rails(azimuths: Array) -> Array:
            at = np.mod(azimuths + math.pi, 2.0 * math.pi) - math.pi
            heights = np.broadcast_to(np.linspace(low, high, KNOTS), (at.size, KNOTS))
            places = np.stack(np.broadcast_arrays(at[:, None], heights / scale), axis=-1)
            found = _fitted(turns, np.tile(radii, 3), places.reshape(-1, 2))
            return np.stack([found.reshape(heights.shape), heights], axis=-1)

        return cls(rails, centre)


def _fitted(places: Array, values: Array, at: Array) -> Array:
    """Return values at other places (``at``), by quadratics fitted to the nearest 32 values."""
    from scipy.spatial import cKDTree

    distance, near = cKDTree(places).query(at, k=32)
    reach = distance[:, -1:]
    x, y = np.moveaxis((places[near] - at[:, None]) / reach[..., None], -1, 0)
    weight = (1.0 - np.minimum(distance / reach, 1.0) ** 2) ** 2 + 1e-12
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weighted = (basis * weight[..., None]).swapaxes(1, 2)
    # Regularisation: where all neighbours lie in two rows, choose the flattest quadratic.
    squares = weighted @ basis + 1e-6 * np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    fit: Array = np.linalg.solve(squares, weighted @ values[near][..., None])[:, 0, 0]
    return fit


def _even(points: Array) -> Array:
    """Return a curve through points at KNOTS places, at equal steps of arc length."""
    from scipy.interpolate import Akima1DInterpolator

    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    at = np.linspace(0.0, along[-1], KNOTS)
    if len(points) == 2:
        return points[0] + (at / along[-1])[:, None] * (points[1] - points[0])
    curve: Array = Akima1DInterpolator(along, points)(at)
    return curve


def boundary_edges(triangles: Integers) -> Integers:
    """Return the edges that belong to only one triangle, shape (n, 2)."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return unique[count == 1]
