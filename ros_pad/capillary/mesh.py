# SPDX-License-Identifier: Apache-2.0
"""Closed triangle meshes of pads that stand on the floor: read, generate, check, write."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import pathlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ros_pad.capillary.crossings import Indices, overlap
from ros_pad.configuration import integer, number
from ros_pad.contact.layout import hexagonal
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, MeshError

SUFFIXES = ('.stl', '.obj', '.ply', '.msh')


@dataclass(frozen=True, eq=False)
class Mesh:
    """One or more closed bodies that stand on the floor z = 0, z up, normals outward.

    Parameters
    ----------
    points : array, shape (n, 3)
        Corners, m.
    faces : array of int, shape (m, 3)
        Corners of each triangle, anticlockwise as seen from outside.
    source : str
        File or generator, for error messages.

    Raises
    ------
    MeshError
        When the mesh is empty, has numbers that are not finite, holes, edges of more than two
        triangles, or triangles that face opposite to their neighbours; when it is inside out, its
        lowest point is not at z = 0, its size is not plausible for a pad in metres, bodies
        overlap, or a body cuts itself.

    Examples
    --------
    >>> from ros_pad.capillary import Mesh
    >>> mesh = Mesh.dome(sphere_radius=1.55e-3, contact_radius=0.583e-3)
    >>> mesh.points.shape, mesh.faces.shape, f'{1e9 * mesh.volume:.2f} mm³'
    ((3530, 3), (7056, 3), '7.73 mm³')
    """

    points: Array
    faces: Indices
    source: str = 'mesh'

    def __post_init__(self) -> None:
        points, faces = np.asarray(self.points), np.asarray(self.faces)
        _check_arrays(points, faces, self.source)
        points, faces = points.astype(np.float64), faces.astype(np.int64)
        extent = float(np.ptp(points[faces.ravel()], axis=0).max())
        if not 1e-5 <= extent <= 0.5:
            raise MeshError(
                f'{self.source}: the extent is {extent:.6g} m: 1e-05 to 0.5 m is needed; a file in'
                ' millimetres needs scale=1e-3'
            )
        used, first = np.unique(faces, return_inverse=True)
        points, faces = points[used], first.reshape(faces.shape)
        bodies = _bodies(points, faces, self.source)
        _check_volumes(points, faces, bodies, self.source)
        low, high = float(points[:, 2].min()), float(points[:, 2].max())
        if abs(low) > 1e-5 * (high - low):  # files can be in single precision
            raise MeshError(
                f'{self.source}: the lowest point is at z = {low:.6g} m, but z = 0 is needed:'
                f' use lift = {-low:.9g} m'
            )
        points[:, 2] -= low
        found = overlap(points[faces])
        if found is not None:
            x, y, z = found
            raise MeshError(
                f'{self.source}: bodies overlap, or a body cuts itself, at'
                f' ({x:.4g}, {y:.4g}, {z:.4g}) m'
            )
        points.setflags(write=False)
        faces.setflags(write=False)
        object.__setattr__(self, 'points', points)
        object.__setattr__(self, 'faces', faces)

    @property
    def height(self) -> float:
        """Height of the highest point above the floor, m."""
        return float(self.points[:, 2].max())

    @functools.cached_property
    def volume(self) -> float:
        """Volume of all bodies, m³."""
        return float(_tetrahedra(self.points, self.faces).sum())

    # --- Files --------------------------------------------------------------------------------

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        scale: float = 1.0,
        lift: float = 0.0,
        flip: bool = False,
    ) -> Mesh:
        """Read an STL, OBJ, PLY or MSH (Gmsh) file.

        Triangles and quadrangles are read.

        Parameters
        ----------
        path : path
            The file; its suffix gives the format.
        scale : float
            Length of one unit of the file, m, above 0: 1e-3 for a file in millimetres.
        lift : float
            Added to every height after scaling, m.
        flip : bool
            Reverse every triangle, for a mesh that is inside out.

        Returns
        -------
        Mesh
            The mesh, in metres.

        Raises
        ------
        MeshError
            When the suffix is unknown, the file is missing or cannot be read, meshio is not
            installed, or for any reason of :class:`Mesh`.
        InvalidInput
            When ``scale`` or ``lift`` is not finite or out of range.
        """
        number('scale', scale, 'm per unit', above=True)
        number('lift', lift, 'm', low=-math.inf)
        path = _known(path)
        if not path.is_file():
            raise MeshError(f'{path}: no such file')
        # For some broken files meshio prints a message and exits the interpreter.
        with (
            open(os.devnull, 'w') as nowhere,
            contextlib.redirect_stdout(nowhere),
            contextlib.redirect_stderr(nowhere),
            np.errstate(all='ignore'),
        ):
            try:
                found = _meshio().read(path)
            except (Exception, SystemExit) as error:
                reason = str(error) or type(error).__name__
                raise MeshError(
                    f'{path}: cannot be read as {path.suffix[1:].upper()} file: {reason}'
                ) from error
        faces = _triangles(found.cells)
        points = np.asarray(found.points, dtype=np.float64)
        _check_arrays(points, faces, os.fspath(path))
        points, faces = _welded(points, faces)
        points = points * scale + (0.0, 0.0, lift)
        return cls(points, faces[:, ::-1] if flip else faces, os.fspath(path))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write an STL, OBJ, PLY or MSH file in metres. Existing files are not overwritten.

        Parameters
        ----------
        path : path
            The file, which must not exist; its suffix gives the format.

        Raises
        ------
        MeshError
            When the suffix is unknown, or meshio is not installed.
        InvalidInput
            When the file exists.
        """
        path, meshio = _known(path), _meshio()
        if path.exists():
            raise InvalidInput(f'{path}: the file exists already and is not overwritten')
        options: dict[str, Any] = {
            '.stl': {'binary': True},
            '.msh': {'file_format': 'gmsh', 'binary': False},
        }
        faces = self.faces.astype(np.int32)  # PLY has no 64-bit integers
        meshio.Mesh(self.points, [('triangle', faces)]).write(
            path, **options.get(path.suffix.lower(), {})
        )

    # --- Generators ---------------------------------------------------------------------------

    @classmethod
    def dome(
        cls,
        sphere_radius: float,
        contact_radius: float,
        height: float | None = None,
        rings: int = 48,
        sectors: int = 72,
    ) -> Mesh:
        """Make a dome pressed on the floor: a sphere cut by the floor and by a plane above.

        Parameters
        ----------
        sphere_radius : float
            Radius of the sphere, m, above 0.
        contact_radius : float
            Radius of the contact with the floor, m, from 0 (one point) to below
            ``sphere_radius``.
        height : float, optional
            Height of the upper plane, m, above 0; by default at the widest section.
        rings, sectors : int
            Number of bands of triangles from floor to top, from 1, and of sectors around the axis,
            from 3.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        InvalidInput
            When a value is not finite, not in range or not a whole number.
        """
        radius = number('sphere_radius', sphere_radius, 'm', above=True)
        below = math.nextafter(radius, 0.0)
        contact = number('contact_radius', contact_radius, 'm', high=below)
        centre = math.sqrt((radius - contact) * (radius + contact))
        if height is None:
            height = centre
        top = math.nextafter(centre + radius, 0.0)
        number('height', height, 'm', high=top, above=True)
        turns = np.linspace(
            math.asin(contact / radius),
            math.acos((centre - height) / radius),
            integer('rings', rings, 1) + 1,
        )
        r, z = radius * np.sin(turns), centre - radius * np.cos(turns)
        r[0], z[0], z[-1] = contact, 0.0, height
        return revolved(r, z, sectors, f'dome of {radius:g} m')

    @classmethod
    def cone(
        cls,
        contact_radius: float,
        top_radius: float,
        height: float,
        rings: int = 24,
        sectors: int = 72,
    ) -> Mesh:
        """Make a truncated cone.

        Parameters
        ----------
        contact_radius, top_radius : float
            Radius at the floor and at the top, m, from 0, not both 0.
        height : float
            Height, m, above 0.
        rings, sectors : int
            As for :meth:`dome`.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        InvalidInput
            When a value is not finite, not in range or not a whole number.
        """
        contact = number('contact_radius', contact_radius, 'm')
        top = number('top_radius', top_radius, 'm', above=contact == 0.0)
        z = np.linspace(
            0.0, number('height', height, 'm', above=True), integer('rings', rings, 1) + 1
        )
        return revolved(contact + (top - contact) * z / height, z, sectors, 'cone')

    @classmethod
    def cylinder(cls, radius: float, height: float, rings: int = 1, sectors: int = 72) -> Mesh:
        """Make a vertical cylinder.

        Parameters
        ----------
        radius, height : float
            Radius and height, m, above 0.
        rings, sectors : int
            As for :meth:`dome`.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        InvalidInput
            When a value is not finite, not in range or not a whole number.
        """
        return cls.cone(number('radius', radius, 'm', above=True), radius, height, rings, sectors)

    @classmethod
    def dome_pattern(
        cls,
        pads: int,
        pitch: float,
        sphere_radius: float,
        contact_radius: float,
        height: float | None = None,
        rings: int = 24,
        sectors: int = 48,
    ) -> Mesh:
        """Make many equal domes in a hexagonal pattern, the first in the centre.

        Parameters
        ----------
        pads : int
            Number of domes, from 1, at the places of the lattice nearest to the centre.
        pitch : float
            Distance between neighbours, m, above 0.
        sphere_radius, contact_radius, height : float
            Size of each dome, m, as for :meth:`dome`.
        rings, sectors : int
            As for :meth:`dome`.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        MeshError
            When neighbours overlap.
        InvalidInput
            As for :meth:`dome`.
        """
        one = cls.dome(sphere_radius, contact_radius, height, rings, sectors)
        number('pitch', pitch, 'm', above=True)
        integer('pads', pads, 1)
        places = np.column_stack([pitch * hexagonal(pads), np.zeros(pads)])
        points = (places[:, None] + one.points[None]).reshape(-1, 3)
        shifts = len(one.points) * np.arange(pads)
        faces = (one.faces[None] + shifts[:, None, None]).reshape(-1, 3)
        return cls(points, faces, f'{pads} domes of {sphere_radius:g} m')


def revolved(r: Array, z: Array, sectors: int, source: str) -> Mesh:
    """Return a body of revolution.

    Parameters
    ----------
    r, z : array, shape (n,)
        Radii and heights of the profile, m, from the floor upwards.
    sectors : int
        Number of sectors around the axis, from 3.
    source : str
        Name for error messages.
    """
    turns = 2.0 * math.pi * np.arange(integer('sectors', sectors, 3)) / sectors
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    # The centres of floor and top also replace rings of radius 0.
    wide = r > 0.0
    levels = [np.column_stack([r[k] * ring, np.full(sectors, z[k])]) for k in np.flatnonzero(wide)]
    points = np.concatenate([*levels, [(0.0, 0.0, z[0]), (0.0, 0.0, z[-1])]])
    here = np.arange(sectors)
    there = np.roll(here, -1)
    bands = [
        sectors * k
        + np.concatenate(
            [
                np.column_stack([here, there, there + sectors]),
                np.column_stack([here, there + sectors, here + sectors]),
            ]
        )
        for k in range(len(levels) - 1)
    ]
    low, high, last = len(points) - 2, len(points) - 1, sectors * (len(levels) - 1)
    bands.append(np.column_stack([np.full(sectors, low), there, here]))
    bands.append(np.column_stack([np.full(sectors, high), here + last, there + last]))
    return Mesh(points, np.concatenate(bands), source)


# --- Reading ----------------------------------------------------------------------------------


def _known(path: str | os.PathLike[str]) -> pathlib.Path:
    known = pathlib.Path(path)
    if known.suffix.lower() not in SUFFIXES:
        raise MeshError(f'{known}: unknown suffix; one of {", ".join(SUFFIXES)} is needed')
    return known


def _meshio() -> Any:
    try:
        import meshio
    except ImportError as error:
        raise MeshError(
            "mesh files need meshio, which is not installed: pip install 'ros_pad[mesh]'"
        ) from error
    return meshio


def _triangles(cells: Sequence[Any]) -> Indices:
    """Return the triangles of a file, with quadrangles split."""
    found = [np.empty((0, 3), dtype=np.int64)]
    for block in cells:
        corners = np.asarray(block.data, dtype=np.int64)
        if block.type.startswith('triangle'):
            found.append(corners[:, :3])
        elif block.type.startswith('quad'):
            found += [corners[:, :3], corners[:, [0, 2, 3]]]
    return np.concatenate(found)


def _welded(points: Array, faces: Indices) -> tuple[Array, Indices]:
    """Merge points that coincide, as in STL files; drop triangles with two equal corners."""
    points, which = np.unique(points, axis=0, return_inverse=True)
    which = which.ravel()
    apart = 1e-7 * float(np.ptp(points, axis=0).max())
    pairs = cKDTree(points).query_pairs(apart, output_type='ndarray')
    if len(pairs):
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(points),) * 2)
        count, group = connected_components(graph, directed=False)
        first = np.full(count, len(points))
        np.minimum.at(first, group, np.arange(len(points)))
        points, which = points[first], group[which]
    faces = which[faces]
    a, b, c = faces.T
    return points, faces[(a != b) & (b != c) & (c != a)]


# --- Checks -----------------------------------------------------------------------------------


def _check_arrays(points: npt.NDArray[Any], faces: npt.NDArray[Any], source: str) -> None:
    for name, values, kinds in (('points', points, 'iuf'), ('faces', faces, 'iu')):
        shaped = values.ndim == 2 and values.shape[1] == 3 and values.size
        if not shaped or values.dtype.kind not in kinds:
            what = 'integers' if kinds == 'iu' else 'numbers'
            raise MeshError(
                f'{source}: {name} of shape {values.shape}: (n, 3) {what}, n from 1, are needed'
            )
    if faces.min() < 0 or faces.max() >= len(points):
        raise MeshError(
            f'{source}: faces with corners {faces.min()} to {faces.max()} are not allowed:'
            f' numbers of points from 0 to {len(points) - 1} are needed'
        )
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if bad.size:
        raise MeshError(f'{source}: point {bad[0]} is not finite: {points[bad[0]]}')


def _bodies(points: Array, faces: Indices, source: str) -> Indices:
    """Return the body number of each triangle; bodies that share only a point count as two.

    Raises `MeshError` where the surface is not closed or not consistently oriented.
    """
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    if (starts == ends).any():
        raise MeshError(
            f'{source}: triangle {int(np.argmax(starts == ends)) // 3} has two equal corners'
        )
    n = len(points)
    edges = np.minimum(starts, ends) * n + np.maximum(starts, ends)
    keys, which, times = np.unique(edges, return_inverse=True, return_counts=True)
    rising = np.bincount(which, weights=starts < ends)
    for wrong, what in (
        (times > 2, 'edges of more than two triangles (non-manifold)'),
        (times < 2, 'open edges (holes)'),
        (rising != 1, 'edges between triangles of opposite orientation (flipped normals)'),
    ):
        if wrong.any():
            place = 0.5 * (points[keys[wrong][0] // n] + points[keys[wrong][0] % n])
            raise MeshError(
                f'{source}: {int(wrong.sum())} {what}, the first at'
                f' ({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g}) m'
            )
    beside = np.argsort(which, kind='stable').reshape(-1, 2) // 3
    graph = coo_array((np.ones(len(beside)), beside.T), shape=(len(faces),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _check_volumes(points: Array, faces: Indices, bodies: Indices, source: str) -> None:
    """Raise `MeshError` where bodies are inside out."""
    volumes = np.bincount(bodies, _tetrahedra(points, faces))
    wrong = int(np.sum(volumes <= 0.0))
    if wrong:
        which = 'the mesh is' if wrong == volumes.size else f'{wrong} of {volumes.size} bodies are'
        raise MeshError(
            f'{source}: {which} inside out (flipped normals) or flat: use flip=True to reverse the'
            ' whole mesh; cavities inside a pad are not allowed'
        )


def _tetrahedra(points: Array, faces: Indices) -> Array:
    """Return the signed volume of the tetrahedron of each triangle with the mean of the points."""
    a, b, c = (points - points.mean(axis=0))[faces.T]
    volumes: Array = np.einsum('ij,ij->i', a, np.cross(b, c)) / 6.0
    return volumes
