# SPDX-License-Identifier: Apache-2.0
"""Energy of a triangulated surface whose vertices move on rails, with exact derivatives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.faces import KNOTS, Face, Integers
from ros_pad.configuration import instance, number
from ros_pad.contact.pad import Array
from ros_pad.errors import NoSurface

if TYPE_CHECKING:
    from ros_pad.capillary.surface import System

# Quality (1: equilateral) below which a triangle means that a neck has pinched off.
THINNEST = 0.01


@dataclass(frozen=True)
class Line:
    """A closed line on a face, around the axis of the face, along which the surface ends.

    Parameters
    ----------
    face : Face
        The face.
    vertices : array of int, shape (n,)
        Vertices of the surface on the line; n from 3.
    azimuths : array, shape (n,)
        Azimuths of these vertices about the axis, rad, in any order.
    places : array, shape (n,)
        Places of these vertices on their rails, dimensionless, from 0 to 1.
    angle : float, optional
        Contact angle, rad, from 0 to pi. Without it the line is pinned.
    """

    face: Face
    vertices: Integers
    azimuths: Array
    places: Array
    angle: float | None = None

    @classmethod
    def ring(
        cls, face: Face, vertices: npt.ArrayLike, place: float, angle: float | None = None
    ) -> Line:
        """Return a line with the same place at all vertices, at equal steps of azimuth.

        Parameters
        ----------
        face : Face
            The face.
        vertices : array of int, shape (n,)
            Vertices of the surface on the line; n from 3.
        place : float
            Place on the rails, dimensionless, from 0 to 1.
        angle : float, optional
            Contact angle, rad, from 0 to pi. Without it the line is pinned.

        Returns
        -------
        Line
            The line.

        Raises
        ------
        InvalidInput
            When place or angle is out of range, or ``face`` is no Face.
        """
        instance('face', face, Face)
        if angle is not None:
            number('angle', angle, 'rad', high=math.pi)
        number('place', place, '(share of the rail)', high=1.0)
        who = np.asarray(vertices, dtype=np.int64)
        azimuths = np.linspace(0.0, 2.0 * math.pi, who.size, endpoint=False)
        return cls(face, who, azimuths, np.full(who.size, place), angle)


class Rails:
    """Energy and volume as functions of the places of vertices on their rails, with derivatives.

    The unknowns ``q`` are distances along rails: of inner vertices from the start, of vertices on
    lines from the beginning of the rail. ``start`` has the values of the given surface.
    """

    def __init__(self, system: System) -> None:
        self.triangles, self.weight = system.triangles, system.weight
        self.base = system.points.copy()
        count = len(system.points)
        used = np.zeros(count, dtype=bool)
        used[system.triangles] = True
        self.on_lines = [_LineRails(line, system.size) for line in system.lines]
        free = used.copy()
        for rail in self.on_lines:
            free[rail.line.vertices] = False
        self.free = np.flatnonzero(free)
        self.direction = normals_of(system.points, system.triangles)[self.free]
        self.unknown = np.full(count, -1)
        self.unknown[self.free] = np.arange(self.free.size)
        total, start = self.free.size, [np.zeros(self.free.size)]
        for rail in self.on_lines:
            if rail.line.angle is not None:
                rail.unknowns = np.arange(total, total + rail.line.vertices.size)
                self.unknown[rail.line.vertices] = rail.unknowns
                total += rail.line.vertices.size
                start.append(rail.start)
        self.start = np.concatenate(start)
        self.area = system.area()
        ends = system.points[edges_of(self.triangles)]
        self.shortest = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min())
        self.first_normals = _triangle_normals(self.place(self.start)[0], self.triangles)

    def place(self, q: Array) -> tuple[Array, Array, Array]:
        """Return positions of the vertices, and first and second derivatives along the rails."""
        x, d, dd = self.base.copy(), np.zeros_like(self.base), np.zeros_like(self.base)
        x[self.free] += q[: self.free.size, None] * self.direction
        d[self.free] = self.direction
        for rail in self.on_lines:
            who = rail.line.vertices
            x[who], slope, bend = rail.place(rail.of(q))
            if rail.unknowns.size:
                d[who], dd[who] = slope, bend
        return x, d, dd

    def positions(self, q: Array) -> tuple[Array, list[Array]]:
        """Return the positions, and the places on the rails of each line."""
        return self.place(q)[0], [rail.of(q) / rail.length for rail in self.on_lines]

    def energy(self, q: Array) -> tuple[float, float, Array, Array]:
        """Return energy and volume, and their gradients."""
        x, d, _ = self.place(q)
        area, moment, volume, on_vertices, volume_on_vertices = self._on_vertices(x)
        energy = area + self.weight * moment
        slope, volume_slope = np.zeros(q.size), np.zeros(q.size)
        moving = self.unknown >= 0
        who = self.unknown[moving]
        slope[who] = np.sum(on_vertices * d, axis=1)[moving]
        volume_slope[who] = np.sum(volume_on_vertices * d, axis=1)[moving]
        for rail in self.on_lines:
            wet, under, raised = rail.integrals(rail.of(q))[:3]
            energy += float(np.sum(self.weight * raised[0] - rail.cosine * wet[0]))
            volume += float(np.sum(under[0]))
            if rail.unknowns.size:
                slope[rail.unknowns] += self.weight * raised[1] - rail.cosine * wet[1]
                volume_slope[rail.unknowns] += under[1]
        return energy, volume, slope, volume_slope

    def _on_vertices(self, x: Array) -> tuple[float, float, float, Array, Array]:
        """Return area, moment and volume of the free surface, and gradients in space."""
        corners = x[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        unit = normal / length[:, None]
        z = corners[..., 2]
        total = z.sum(axis=1)
        mean = total / 6.0
        square = ((z**2).sum(axis=1) + total**2) / 48.0  # (Σ z² + Σ z z' over pairs) / 24
        up = normal[:, 2]
        opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
        # d(n·N)/dx = opposite × n, for any fixed n.
        turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        flat = opposite @ turn.T  # opposite × e_z
        on = 0.5 * np.cross(opposite, unit[:, None, :])
        on += self.weight * square[:, None, None] * flat
        on[..., 2] += self.weight * up[:, None] * (z + total[:, None]) / 24.0
        on_volume = mean[:, None, None] * flat
        on_volume[..., 2] += up[:, None] / 6.0
        return (
            0.5 * float(length.sum()),
            float(square @ up),
            float(mean @ up),
            self._gathered(on),
            self._gathered(on_volume),
        )

    def _gathered(self, on: Array) -> Array:
        """Return values at the corners of triangles, (t, 3, 3), summed at each vertex."""
        where, count = self.triangles.ravel(), len(self.base)
        columns = [np.bincount(where, on[..., k].ravel(), minlength=count) for k in range(3)]
        return np.stack(columns, axis=1)

    def matrix(self, q: Array, pressure: float) -> Any:
        """Return the Hessian of energy minus pressure times volume, sparse."""
        from scipy.sparse import coo_matrix

        x, d, dd = self.place(q)
        corners, along, bend = x[self.triangles], d[self.triangles], dd[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
        unit = normal / length[:, None]
        z = corners[..., 2]
        total, up = z.sum(axis=1), normal[:, 2]
        mean, square = total / 6.0, ((z**2).sum(axis=1) + total**2) / 48.0
        opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
        first = np.cross(along, opposite)  # dN/dq
        second = np.zeros((len(corners), 3, 3, 3))
        for k in range(3):
            after = (k + 1) % 3
            second[:, k, after] = second[:, after, k] = np.cross(along[:, k], along[:, after])
            second[:, k, k] = np.cross(bend[:, k], opposite[:, k])
        grows = np.einsum('tk,tak->ta', unit, first)
        h = 0.5 * np.einsum('tk,tabk->tab', unit, second)
        h += 0.5 * np.einsum('tak,tbk->tab', first, first) / length[:, None, None]
        h -= 0.5 * grows[:, :, None] * grows[:, None, :] / length[:, None, None]
        rise, same = along[..., 2], np.eye(3)
        m1 = (z + total[:, None]) * rise / 24.0
        m2 = (1.0 + same) * rise[:, :, None] * rise[:, None, :] / 24.0
        m2 += same * ((z + total[:, None]) * bend[..., 2] / 24.0)[:, :, None]
        f1, f2 = rise / 6.0, same * (bend[..., 2] / 6.0)[:, :, None]
        value = self.weight * square - pressure * mean
        slope = self.weight * m1 - pressure * f1
        h += (self.weight * m2 - pressure * f2) * up[:, None, None]
        mixed = slope[:, :, None] * first[:, None, :, 2]
        h += mixed + mixed.transpose(0, 2, 1) + value[:, None, None] * second[..., 2]

        who = self.unknown[self.triangles]
        rows = np.broadcast_to(who[:, :, None], h.shape)
        columns = np.broadcast_to(who[:, None, :], h.shape)
        moving = (rows >= 0) & (columns >= 0)
        entries = [(h[moving], rows[moving], columns[moving])]
        for rail in self.on_lines:
            if rail.unknowns.size:
                wet, under, raised = rail.integrals(rail.of(q))[:3]
                extra = self.weight * raised[2] - rail.cosine * wet[2] - pressure * under[2]
                entries.append((extra, rail.unknowns, rail.unknowns))
        data, i, j = (np.concatenate(part) for part in zip(*entries, strict=True))
        return coo_matrix((data, (i, j)), shape=(q.size, q.size)).tocsr()

    def forces(self, pressure: float) -> Array:
        """Return the force of the liquid on each face: minus dE/dx if face and line move by x."""
        _, _, _, on, on_volume = self._on_vertices(self.place(self.start)[0])
        cost_of_vertices = on - pressure * on_volume
        forces = []
        for rail, share in zip(self.on_lines, self._shares(), strict=True):
            cost = share @ cost_of_vertices
            _, under, _, covered = rail.integrals(rail.of(self.start))
            cost[2] += self.weight * under[0].sum() - pressure * covered[0].sum()
            forces.append(-cost)
        return np.array(forces)

    def _shares(self) -> list[Array]:
        """Return, for each line, the share of its displacement with which each vertex moves.

        In equilibrium the force does not depend on these shares. They are harmonic on the graph of
        edges: shares spread over the surface average the errors of the mesh, and the forces on all
        faces add up to the weight.
        """
        from scipy.sparse import coo_matrix, diags
        from scipy.sparse.linalg import factorized

        count, edges = len(self.base), edges_of(self.triangles)
        i, j = np.concatenate([edges, edges[:, ::-1]]).T
        near = coo_matrix((np.ones(i.size), (i, j)), shape=(count, count)).tocsr()
        laplace = (diags(np.asarray(near.sum(axis=1)).ravel()) - near).tocsc()
        shares = [np.zeros(count) for _ in self.on_lines]
        solve = factorized(laplace[self.free][:, self.free]) if self.free.size else None
        for share, rail in zip(shares, self.on_lines, strict=True):
            share[rail.line.vertices] = 1.0
            if solve:
                share[self.free] = solve(-(laplace @ share)[self.free])
        return shares

    def check(self, q: Array) -> None:
        """Raise `NoSurface` for a surface that has pinched off, turned over, or left a face."""
        x = self.place(q)[0]
        corners = x[self.triangles]
        sides = np.roll(corners, -1, axis=1) - corners
        normals = np.cross(sides[:, 0], sides[:, 1])
        quality = 2.0 * math.sqrt(3.0) * np.linalg.norm(normals, axis=1)
        quality /= np.sum(sides**2, axis=(1, 2))
        turned = np.sum(_unit(normals) * self.first_normals, axis=1) < -0.5
        if quality.min() < THINNEST or turned.any():
            raise NoSurface(
                'the surface collapses: a neck pinches off, or no minimum exists between these'
                ' lines',
                'collapsed',
            )
        for rail in self.on_lines:
            place = rail.of(q) / rail.length
            if place.min() < 0.0 or place.max() > 1.0:
                raise NoSurface(
                    'a contact line reaches an end of its face: a larger face, or another volume'
                    ' or pressure, is needed',
                    'collapsed',
                )


class _LineRails:
    """The rails of one line: positions and wetting integrals as splines in arc length."""

    def __init__(self, line: Line, size: float) -> None:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline

        self.line, self.unknowns = line, np.empty(0, dtype=np.int64)
        self.cosine = 0.0 if line.angle is None else math.cos(line.angle)
        order = np.argsort(np.mod(line.azimuths, 2.0 * math.pi))
        angles = np.mod(line.azimuths, 2.0 * math.pi)[order]
        gaps = np.diff(angles, append=angles[0] + 2.0 * math.pi)
        width = np.empty_like(gaps)
        width[order] = 0.5 * (gaps + np.roll(gaps, 1))
        side = -1.0 if line.face.under else 1.0
        # Between vertices the line is straight. Areas of the face use the same polygon as the
        # surface; otherwise films would spread without limit near complete wetting.
        chord, apothem = np.sinc(0.5 * width / math.pi), np.cos(0.5 * width)
        curves = line.face.rails(line.azimuths) / size
        steps = np.hypot(*np.moveaxis(np.diff(curves, axis=1), -1, 0))
        self.length = steps.sum(axis=1)
        self.start = line.places * self.length
        self.centre = np.asarray(line.face.centre) / size
        self.outwards = np.stack([np.cos(line.azimuths), np.sin(line.azimuths)], axis=1)

        # Splines over 0..1, the same knots for all rails.
        knots = np.linspace(0.0, 1.0, KNOTS)
        along = CubicSpline(knots, np.swapaxes(curves, 0, 1), axis=0)  # (knot, rail, 2)
        nodes, weights = np.polynomial.legendre.leggauss(4)
        inner = (knots[:-1, None] + 0.5 * (nodes + 1.0) * np.diff(knots)[:, None]).ravel()

        def rates(t: Array) -> Array:
            """Return derivatives over t of the integrals of :meth:`integrals`: (t, rail, 4)."""
            (r, z), (rt, zt) = (np.moveaxis(along(t, k), -1, 0) for k in (0, 1))
            ra, za = (_around(value, angles, order) for value in (r, z))
            skew = chord * np.hypot(r * np.hypot(apothem * rt, zt), rt * za - zt * ra)
            covered = side * chord * apothem * r * rt
            fields = np.stack([skew, z * covered, 0.5 * z**2 * covered, covered], axis=-1)
            return fields * width[:, None]

        cells = rates(inner).reshape(KNOTS - 1, 4, -1, 4)
        sums = np.einsum('kgrf,g->krf', cells, weights) * (0.5 / (KNOTS - 1))
        totals = np.concatenate([np.zeros((1, *sums.shape[1:])), np.cumsum(sums, axis=0)])
        integrals = CubicHermiteSpline(knots, totals, rates(knots), axis=0)
        self.pieces = np.concatenate([along.c, integrals.c], axis=-1)  # (power, cell, rail, 6)

    def of(self, q: Array) -> Array:
        """Return the arc lengths of this line's vertices along their rails."""
        return q[self.unknowns] if self.unknowns.size else self.start

    def _fields(self, s: Array) -> Array:
        """Return value, first and second derivative over arc length, shape (3, rail, 6)."""
        t = s / self.length * (KNOTS - 1)
        cell = np.clip(t.astype(np.int64), 0, KNOTS - 2)
        u = ((t - cell) / (KNOTS - 1))[:, None]
        c3, c2, c1, c0 = self.pieces[:, cell, np.arange(s.size)]
        scale = 1.0 / self.length[:, None]
        return np.stack(
            [
                ((c3 * u + c2) * u + c1) * u + c0,
                ((3.0 * c3 * u + 2.0 * c2) * u + c1) * scale,
                (6.0 * c3 * u + 2.0 * c2) * scale**2,
            ]
        )

    def place(self, s: Array) -> Array:
        """Return positions and their derivatives, shape (3, vertex, 3)."""
        fields = self._fields(s)
        flat = fields[..., :1] * self.outwards
        flat[0] += self.centre
        return np.concatenate([flat, fields[..., 1:2]], axis=-1)

    def integrals(self, s: Array) -> Array:
        """Return wet area, volume, moment and covered floor: (4, 3 derivatives, vertex)."""
        return np.moveaxis(self._fields(s)[..., 2:], -1, 0)


def _around(values: Array, angles: Array, order: Integers) -> Array:
    """Return derivatives over azimuth of values (t, rail), by differences around the axis."""
    sorted_ = values[:, order]
    ahead, behind = np.roll(sorted_, -1, axis=1), np.roll(sorted_, 1, axis=1)
    gap = np.diff(angles, append=angles[0] + 2.0 * math.pi)
    result = np.empty_like(values)
    result[:, order] = (ahead - behind) / (gap + np.roll(gap, 1))
    return result


# --- meshes ------------------------------------------------------------------------------------


def edges_of(triangles: Integers) -> Integers:
    """Return both corners of each edge, shape (n, 2)."""
    return np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def _triangle_normals(points: Array, triangles: Integers) -> Array:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return _unit(np.cross(b - a, c - a))


def normals_of(points: Array, triangles: Integers) -> Array:
    """Return unit normals at vertices, weighted by area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    across = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for corner in triangles.T:
        np.add.at(total, corner, across)
    return _unit(total)
