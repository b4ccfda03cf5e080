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

import numpy as np

from ros_pad.capillary.faces import Integers, boundary_edges
from ros_pad.capillary.rails import Line, Rails, edges_of, normals_of
from ros_pad.configuration import integer, number
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, NoSurface


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
        points, edges = self.points, edges_of(self.triangles)
        total, count = np.zeros_like(points), np.zeros(len(points))
        for a, b in (edges.T, edges.T[::-1]):
            np.add.at(total, a, points[b])
            np.add.at(count, a, 1.0)
        shift = total / np.maximum(count, 1.0)[:, None] - points
        normals = normals_of(points, self.triangles)
        shift -= normals * np.sum(shift * normals, axis=1, keepdims=True)
        shift[np.concatenate([line.vertices for line in self.lines])] = 0.0
        return replace(self, points=points + 0.3 * shift)

    def refined(self) -> System:
        """Return the surface with each triangle split into four."""
        edges = edges_of(self.triangles)
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
