# SPDX-License-Identifier: Apache-2.0
"""Liquid surfaces of any shape: minimum energy of a triangulated surface between solid faces.

The energy is that of the free surface, the weight and the wetted faces: ``γ A + ρ g ∫ z dV - γ cos
θ A_wet`` for each face, minus ``p V`` where the pressure p at z = 0 is given. Volume and weight
are integrals of z and z²/2 over the projected boundary. Vertical walls and the floor at z = 0 do
not contribute, and no tetrahedra are needed.

Each vertex moves on a rail, so it has one unknown. Inside the surface the rail is the normal; on a
solid face it is the intersection of the face with the half plane of the vertex' azimuth. So
vertices cannot move along the surface, which would not change the energy, and wetted areas are
integrals along rails. After each minimisation the vertices are averaged within the surface and get
new rails.

Gradient and Hessian are exact. The minimum is found by the trust-region Newton-CG method of SciPy.
An augmented Lagrangian keeps the volume; its multiplier is the pressure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_pad.capillary.faces import KNOTS, Face, Integers, boundary_edges
from ros_pad.configuration import instance, integer, number
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, NoSurface

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


@dataclass(frozen=True)
class LiquidSurface:
    """A liquid surface in equilibrium.

    Attributes
    ----------
    vertices : array, shape (n, 3)
        Positions, m.
    triangles : array of int, shape (m, 3)
        Corners, anticlockwise as seen from the gas.
    lines : tuple of Line
        Lines along which the surface ends on solid faces.
    area : float
        Area between liquid and gas, m².
    energy : float
        Energy of surface, weight and wetting, J, with smooth lines: it converges faster than area
        and volume, whose lines have corners.
    volume : float
        Volume of the liquid, m³.
    pressure : float
        Pressure of the liquid minus that of the gas at z = 0, Pa.
    forces : array, shape (lines, 3)
        Force of the liquid on each face, N, z up.
    residual : float
        Largest energy decrease still possible by moving one vertex, relative to the energy of the
        surface.
    change : float
        Relative change of the area by the last averaging of vertices.
    history : tuple of float
        Area after each refinement, m²; the differences show the error.
    """

    vertices: Array
    triangles: Integers
    lines: tuple[Line, ...]
    area: float
    energy: float
    volume: float
    pressure: float
    forces: Array
    residual: float
    change: float
    history: tuple[float, ...]


def minimise(
    vertices: Array,
    triangles: Integers,
    lines: Sequence[Line],
    surface_tension: float,
    weight: float = 0.0,
    pressure: float | None = None,
    volume: float | None = None,
    refinements: int = 0,
) -> LiquidSurface:
    """Compute the surface of minimum energy near a given one.

    Parameters
    ----------
    vertices : array, shape (n, 3)
        Start positions, m, z up. Vertices on lines are moved to their lines.
    triangles : array of int, shape (m, 3)
        Corners, anticlockwise as seen from the gas.
    lines : sequence of Line
        Lines that contain all boundary edges of the surface.
    surface_tension : float
        Surface tension, N/m, above 0.
    weight : float
        Density times gravity, N/m³, from 0.
    pressure, volume : float, optional
        Pressure of the liquid minus that of the gas at z = 0, Pa, or volume of the liquid, m³,
        above 0. Exactly one of them is required.
    refinements : int
        How often each triangle is split into four and the surface minimised again, from 0.

    Returns
    -------
    LiquidSurface
        Positions, m, area, m², energy, J, volume, m³, pressure, Pa, and force on each face, N.

    Raises
    ------
    NoSurface
        ``collapsed`` where the surface pinches off or turns over, or a contact line reaches an end
        of its face; ``no_convergence`` where the minimisation does not converge.
    InvalidInput
        When a value or shape is not allowed, both or none of pressure and volume are given, or a
        boundary edge is on no line.
    """
    tension = number('surface_tension', surface_tension, 'N/m', above=True)
    heavy = number('weight', weight, 'N/m³')
    if (pressure is None) == (volume is None):
        raise InvalidInput(
            'exactly one of pressure and volume is needed, but'
            f' {"none" if volume is None else "both"} is given'
        )
    push = 0.0 if pressure is None else number('pressure', pressure, 'Pa', low=-math.inf)
    integer('refinements', refinements)
    points, corners = np.array(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    _check_surface(points, corners, lines)
    size = float(np.ptp(points[np.unique(corners)], axis=0).max())
    system = System(
        tension=tension,
        weight=heavy * size**2 / tension,
        size=size,
        volume=None if volume is None else number('volume', volume, 'm³', above=True),
        points=points / size,
        triangles=corners,
        lines=tuple(lines),
        multiplier=push * size / tension,
    )
    history = []
    for level in range(refinements + 1):
        if level:
            system = system.refined()
        system = system.relaxed()
        before = system.area()
        system = system.averaged().relaxed()
        history.append(system.area() * size**2)
    return system.result(system.area() / before - 1.0, history)


def _check_surface(points: Array, corners: Integers, lines: Sequence[Line]) -> None:
    """Raise `InvalidInput` for vertices or triangles of wrong shape, or edges on no line."""
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InvalidInput(
            f'vertices of shape {points.shape} are not allowed: finite numbers of shape (n, 3), m,'
            ' are needed'
        )
    if corners.ndim != 2 or corners.shape[1] != 3 or not np.all(corners < len(points)):
        raise InvalidInput(
            f'triangles of shape {corners.shape} are not allowed: indices of the {len(points)}'
            ' vertices, shape (m, 3), are needed'
        )
    if not lines:
        raise InvalidInput('lines = () is not allowed: at least one line is needed')
    loose = np.setdiff1d(
        boundary_edges(corners), np.concatenate([line.vertices for line in lines])
    )
    if loose.size:
        raise InvalidInput(
            f'vertex {loose[0]} is at an edge of the surface, but on no line: every edge of the'
            ' surface must be on a line'
        )


@dataclass(frozen=True)
class System:
    """A surface during minimisation.

    Attributes
    ----------
    tension, size : float
        Units: surface tension, N/m, and extent of the surface, m. The other lengths are divided by
        ``size`` and energies by ``tension size²``.
    weight : float
        Density gravity size² / tension.
    volume : float or None
        Given volume, m³.
    points, triangles, lines
        The surface.
    multiplier : float
        Pressure of the liquid minus that of the gas at z = 0, over tension / size.
    residual : float
        As for `LiquidSurface`.
    """

    tension: float
    weight: float
    size: float
    volume: float | None
    points: Array
    triangles: Integers
    lines: tuple[Line, ...]
    multiplier: float
    residual: float = math.nan

    def area(self) -> float:
        """Return the area of the surface."""
        corners = self.points[self.triangles]
        sides = corners[:, 1:] - corners[:, :1]
        return 0.5 * float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1).sum())

    @np.errstate(over='ignore', invalid='ignore')
    def relaxed(self) -> System:
        """Return the surface of minimum energy on the present rails."""
        from scipy.optimize import minimize

        rails = Rails(self)
        target = None if self.volume is None else self.volume / self.size**3
        goal = _Goal(rails, self.multiplier, target)
        for _ in range(40):
            try:
                found = minimize(
                    goal.value,
                    goal.y,
                    jac=True,
                    hessp=goal.product,
                    method='trust-ncg',
                    options={'gtol': 1e-8, 'maxiter': 300, 'initial_trust_radius': 0.1},
                )
            except ValueError as error:  # triangles without area have no finite Hessian
                raise NoSurface(
                    f'the surface collapses: a triangle has lost its area ({error})', 'collapsed'
                ) from error
            rails.check(goal.scale * found.x)
            goal.y = found.x
            if goal.improve() < 1e-9:
                break
        residual, miss = float(np.max(abs(found.jac))) ** 2, goal.miss
        if miss > 1e-6 or residual > 1e-12:
            raise NoSurface(
                f'the minimisation does not converge: residual = {residual:.2g} of the energy (at'
                f' most 1e-12 is needed), relative volume error = {miss:.2g} (at most 1e-6)',
                'no_convergence',
            )
        q = goal.scale * goal.y
        points, places = rails.positions(q)
        lines = tuple(
            replace(line, places=place) for line, place in zip(self.lines, places, strict=True)
        )
        return replace(
            self, points=points, lines=lines, multiplier=goal.multiplier, residual=residual
        )

    def averaged(self) -> System:
        """Return the surface with inner vertices moved along it, towards their neighbours."""
        points, edges = self.points, _edges(self.triangles)
        total, count = np.zeros_like(points), np.zeros(len(points))
        for a, b in (edges.T, edges.T[::-1]):
            np.add.at(total, a, points[b])
            np.add.at(count, a, 1.0)
        shift = total / np.maximum(count, 1.0)[:, None] - points
        normals = _normals(points, self.triangles)
        shift -= normals * np.sum(shift * normals, axis=1, keepdims=True)
        shift[np.concatenate([line.vertices for line in self.lines])] = 0.0
        return replace(self, points=points + 0.3 * shift)

    def refined(self) -> System:
        """Return the surface with each triangle split into four."""
        edges = _edges(self.triangles)
        first = len(self.points)
        index = {frozenset((int(a), int(b))): first + k for k, (a, b) in enumerate(edges)}
        points = np.vstack([self.points, self.points[edges].mean(axis=1)])
        middles = np.array(
            [
                [index[frozenset((int(t[k]), int(t[k - 2])))] for k in range(3)]
                for t in self.triangles
            ]
        )  # middle k is between corners k and k + 1
        (a, b, c), (ab, bc, ca) = self.triangles.T, middles.T
        triangles = np.concatenate(
            [
                np.stack(new, axis=1)
                for new in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
            ]
        )
        rim = {(int(x), int(y)) for x, y in boundary_edges(self.triangles)}
        lines = []
        for line in self.lines:
            at = {int(v): k for k, v in enumerate(line.vertices)}
            pairs = [(x, y) for x, y in rim if x in at and y in at]
            i, j = (np.array([at[pair[end]] for pair in pairs]) for end in (0, 1))
            gap = np.mod(line.azimuths[j] - line.azimuths[i] + math.pi, 2 * math.pi) - math.pi
            new = np.array([index[frozenset(pair)] for pair in pairs], dtype=np.int64)
            lines.append(
                replace(
                    line,
                    vertices=np.append(line.vertices, new),
                    azimuths=np.append(line.azimuths, line.azimuths[i] + 0.5 * gap),
                    places=np.append(line.places, 0.5 * (line.places[i] + line.places[j])),
                )
            )
        return replace(self, points=points, triangles=triangles, lines=tuple(lines))

    def result(self, change: float, history: list[float]) -> LiquidSurface:
        """Return the surface in SI units, with the forces on its faces."""
        rails = Rails(self)
        energy, volume, _, _ = rails.energy(rails.start)
        # Lines are polygons, and the energy is often a small difference: their error is estimated
        # with twice as many corners. It falls with the square of the number.
        finer = Rails(self.refined())
        more, filled, _, _ = finer.energy(finer.start)
        energy += 4.0 / 3.0 * (more - energy - self.multiplier * (filled - volume))
        unit = self.tension * self.size
        return LiquidSurface(
            self.points * self.size,
            self.triangles,
            self.lines,
            self.area() * self.size**2,
            energy * unit * self.size,
            volume * self.size**3,
            self.multiplier * self.tension / self.size,
            unit * rails.forces(self.multiplier),
            self.residual,
            change,
            tuple(history),
        )


class _Goal:
    """Function to be minimised: the energy, with an augmented Lagrangian for a given volume.

    The unknowns ``y`` are the places on the rails, scaled so that the Hessian's diagonal is 1.
    """

    def __init__(self, rails: Rails, multiplier: float, target: float | None) -> None:
        self.rails, self.multiplier, self.target = rails, multiplier, target
        self.stiffness = 0.0 if target is None else 30.0 * rails.area / target**2
        self.miss = 0.0
        diagonal = abs(rails.matrix(rails.start, multiplier).diagonal())
        self.scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-6 * diagonal.max()))
        # Random shifts make the search leave unstable equilibria, such as a long cylinder.
        push = np.random.default_rng(0).normal(size=rails.start.size)
        self.y = (rails.start + 1e-2 * rails.shortest * push) / self.scale
        self._at: Array | None = None

    def _over(self, volume: float) -> float:
        return 0.0 if self.target is None else volume - self.target

    def value(self, y: Array) -> tuple[float, Array]:
        """Return the function to be minimised and its gradient."""
        energy, volume, slope, volume_slope = self.rails.energy(self.scale * y)
        over = self._over(volume)
        value = energy - self.multiplier * volume + 0.5 * self.stiffness * over**2
        push = self.multiplier - self.stiffness * over
        return value, self.scale * (slope - push * volume_slope)

    def product(self, y: Array, direction: Array) -> Array:
        """Return the Hessian times a direction; the Hessian is kept while y stays the same."""
        if self._at is None or not np.array_equal(self._at, y):
            q = self.scale * y
            _, volume, _, self._volume_slope = self.rails.energy(q)
            push = self.multiplier - self.stiffness * self._over(volume)
            self._matrix, self._at = self.rails.matrix(q, push), y.copy()
        step = self.scale * direction
        across = self.stiffness * (self._volume_slope @ step)
        result: Array = self.scale * (self._matrix @ step + across * self._volume_slope)
        return result

    def improve(self) -> float:
        """Update the multiplier; return the relative error of the volume."""
        over = self._over(self.rails.energy(self.scale * self.y)[1])
        self.multiplier -= self.stiffness * over
        self._at = None
        self.miss = abs(over / self.target) if self.target else 0.0
        return self.miss


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
        self.direction = _normals(system.points, system.triangles)[self.free]
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
        ends = system.points[_edges(self.triangles)]
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

        count, edges = len(self.base), _edges(self.triangles)
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


def _edges(triangles: Integers) -> Integers:
    return np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0)


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def _triangle_normals(points: Array, triangles: Integers) -> Array:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return _unit(np.cross(b - a, c - a))


def _normals(points: Array, triangles: Integers) -> Array:
    """Return unit normals at vertices, weighted by area."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    across = np.cross(b - a, c - a)
    total = np.zeros_like(points)
    for corner in triangles.T:
        np.add.at(total, corner, across)
    return _unit(total)
