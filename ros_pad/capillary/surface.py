# SPDX-License-Identifier: Apache-2.0
"""Surfaces of least energy around a pad of any shape, alone in a wide bath or one of many.

The liquid is connected to a bath at floor level, z = 0, where it has the pressure of the air. The
energy is that of the free surface, the weight and the wetted wall: ``γ A + ρ g ∫ z dV - γ cos θ
A_wet``. Volume and weight are integrals of z and z²/2 over the projected boundary, so that no
tetrahedra are needed.

The surface is a mesh of triangles between a ring on the wall of the pad and a ring far from it.
Each vertex moves on a rail, so it has one unknown. Inside the surface the rail is the normal; far
away it is a vertical line; on the wall it is the section of the wall by the half plane of the
vertex' azimuth. So vertices cannot move along the surface, which would not change the energy, and
wetted areas are integrals along rails. After each minimisation vertices are averaged within the
surface and get new rails. Gradient and Hessian are exact; the minimum is found by the trust-region
Newton-CG method of SciPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ros_pad.capillary.bath import Wall, bath_meniscus
from ros_pad.capillary.layers import WETTING
from ros_pad.capillary.mesh import Indices, Mesh
from ros_pad.capillary.sections import centre
from ros_pad.configuration import instance, integer, number
from ros_pad.contact.meniscus import Liquid, hysteresis_force
from ros_pad.contact.pad import Array
from ros_pad.errors import InvalidInput, MeshError, NoSurface

KNOTS = 129  # number of points of a rail
REACH = 8.0  # capillary lengths from a pad to where a bath ends, with an error of exp(-2 REACH)

# Radii and heights of a wall, (azimuths, KNOTS, 2), from the floor up at equal steps.
Rails: TypeAlias = Callable[[Array], Array]


@dataclass(frozen=True)
class WetSurface:
    """Liquid of least energy around a pad, alone in a bath or one of many.

    Attributes
    ----------
    vertices : array, shape (n, 3)
        Positions on the surface, m.
    triangles : array of int, shape (m, 3)
        Corners, anticlockwise as seen from the air.
    line : array, shape (k, 3)
        Points of the contact line on the pad, in order of azimuth, m.
    axis : tuple of float
        x and y of the axis of the pad, m.
    volume : float
        Volume of the liquid above the floor, m³.
    force : array, shape (3,)
        Force of the liquid on the pad, N, z up.
    error : float
        Estimated relative error of the mean height: its change by the last halving of the
        triangles, twice that below 10 degrees of contact angle, where convergence is slower. NaN
        without refinements.
    liquid : Liquid
        The liquid.
    """

    vertices: Array
    triangles: Indices
    line: Array
    axis: tuple[float, float]
    volume: float
    force: Array
    error: float
    liquid: Liquid

    @property
    def mean_height(self) -> float:
        """Mean height of the contact line, m."""
        return float(self.line[:, 2].mean())

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
    pad: Mesh | Wall,
    liquid: Liquid,
    area: float | None = None,
    sectors: int = 24,
    refinements: int = 1,
) -> WetSurface:
    """Compute the liquid of least energy around a pad, with its error.

    Parameters
    ----------
    pad : Mesh or Wall
        A single pad; each horizontal section is star-shaped as seen from the centroid of the
        lowest one.
    liquid : Liquid
        Its contact angle on the pad is ``liquid.angle``.
    area : float, optional
        Area of one pad of a hexagonal pattern with the gap around it, m², above 0. Without it the
        pad stands alone in a wide bath at floor level.
    sectors : int
        Number of vertices around the pad before refinement, from 6; of a pattern a multiple of
        12.
    refinements : int
        Number of refinements, from 0; each halves the size of the triangles.

    Returns
    -------
    WetSurface
        The surface and its contact line, m, volume, m³, force, N, and estimated error.

    Raises
    ------
    NoSurface
        ``rim`` where the liquid is pushed below the floor or reaches the top of the wall;
        ``collapsed`` where the surface pinches off or turns over; ``no_convergence`` where the
        minimisation does not converge; or as :func:`bath_meniscus` does.
    MeshError
        When the wall of a mesh is not star-shaped, has ledges or fewer than 12 vertices.
    InvalidInput
        When a value is out of range or of the wrong type, or pads on this area touch.

    Notes
    -----
    The radii of a mesh are fitted over azimuth and height by moving least squares with quadratics,
    because contact angles need smooth slopes: edges are rounded over about two triangles.

    Examples
    --------
    The exact meniscus of this dome in a wide bath is 0.889 mm high (:func:`bath_meniscus`):

    >>> from ros_pad.capillary import Mesh, wet_surface
    >>> from ros_pad.contact import WATER
    >>> found = wet_surface(Mesh.dome(1.55e-3, 0.583e-3), WATER)
    >>> round(1e3 * found.mean_height, 2), found.error < 0.01
    (0.89, True)
    """
    instance('liquid', liquid, Liquid)
    integer('sectors', sectors, 6)
    integer('refinements', refinements)
    axis, rails = _on_wall(pad) if isinstance(pad, Wall) else _on_mesh(pad)
    curves = rails(_turns(sectors))
    if area is None:
        surface, outer = _in_bath(curves, liquid)
    else:
        surface, outer = _in_cell(curves, liquid, area)
    size = float(np.ptp(surface.points, axis=0).max())
    task = _Task(
        rails=lambda azimuths: rails(azimuths) / size,
        outer=lambda azimuths: outer(azimuths) / size,
        cosine=math.cos(liquid.angle),
        weight=liquid.weight * size**2 / liquid.surface_tension,
    )
    surface = replace(surface, points=surface.points / size)
    heights = []
    for level in range(refinements + 1):
        if level:
            surface = _refined(task, surface)
        surface = _relaxed(task, _averaged(_relaxed(task, surface)))
        heights.append(surface.points[surface.ring, 2].mean())
    error = abs(1.0 - heights[-2] / heights[-1]) if refinements else math.nan
    result = _Energy(task, surface)
    vertices = surface.points * size + (*axis, 0.0)
    return WetSurface(
        vertices=vertices,
        triangles=surface.triangles,
        line=vertices[surface.ring],
        axis=axis,
        volume=result.volume() * size**3,
        force=result.force(surface) * liquid.surface_tension * size,
        error=float(error) * (2.0 if liquid.angle < WETTING else 1.0),
        liquid=liquid,
    )


# --- Walls of pads -----------------------------------------------------------------------------


def _turns(count: int) -> Array:
    return np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)


def _on_wall(wall: Wall) -> tuple[tuple[float, float], Rails]:
    from scipy.interpolate import Akima1DInterpolator

    if not math.isfinite(wall.top):
        raise InvalidInput('wall.top = inf is not allowed: a wall of finite height is needed')
    places = np.linspace(wall.floor, wall.top, KNOTS)
    curve = np.array([wall.meridian(float(place))[:2] for place in places])
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(curve, axis=0).T)))
    rail = Akima1DInterpolator(along, curve)(np.linspace(0.0, along[-1], KNOTS))
    return (0.0, 0.0), lambda azimuths: np.broadcast_to(rail, (azimuths.size, KNOTS, 2))


def _on_mesh(mesh: Mesh) -> tuple[tuple[float, float], Rails]:
    instance('mesh', mesh, Mesh)
    axis = centre(mesh, 0.005 * mesh.height)
    points = mesh.points - (*axis, 0.0)
    size = float(np.ptp(points, axis=0).max())
    azimuth, z = np.arctan2(points[:, 1], points[:, 0]), points[:, 2]
    upright = np.ptp(z[mesh.faces], axis=1) > 1e-9 * size
    walls = mesh.faces[upright]
    turn = azimuth[walls] - azimuth[walls[:, :1]]
    turn -= 2.0 * math.pi * np.round(turn / (2.0 * math.pi))
    rise = z[walls] - z[walls[:, :1]]
    area = turn[:, 1] * rise[:, 2] - turn[:, 2] * rise[:, 1]  # over azimuth and height
    low, high = float(z[walls].min()), float(z[walls].max())
    once = abs(area.sum() - 4.0 * math.pi * (high - low)) < 1e-6 * size and (area > 0.0).all()
    level = z[mesh.faces[~upright]]
    use = np.unique(walls)
    if not once or np.minimum(level - low, high - level).max() > 1e-6 * size or use.size < 12:
        raise MeshError(
            f'{mesh.source}: the wall leans over itself, has ledges or fewer than 12 vertices, or'
            f' does not surround the vertical line through {axis[0]:g}, {axis[1]:g} m exactly once'
        )
    radii = np.hypot(*points[use, :2].T)
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

    return axis, rails


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


# --- Surfaces to begin with --------------------------------------------------------------------


@dataclass(frozen=True)
class _Surface:
    """A surface between a ring on the pad and one far from it, both in equal steps of azimuth.

    ``ring`` and ``far`` are the numbers of their vertices; ``places`` are those of the ring on its
    rails, from 0 to 1.
    """

    points: Array
    triangles: Indices
    ring: Indices
    far: Indices
    places: Array


def _spanned(grid: Array, place: float) -> _Surface:
    """Return the surface through rows of vertices, from pad to far, shape (rows, sectors, 3)."""
    rows, sectors = grid.shape[0] - 1, grid.shape[1]
    i, j = np.divmod(np.arange(rows * sectors), sectors)
    a, b = i * sectors + j, i * sectors + (j + 1) % sectors
    c, d = a + sectors, b + sectors
    flip = (i + j) % 2 == 0  # alternating diagonals prefer no direction
    one = np.where(flip, [a, c, d], [a, c, b]).T
    two = np.where(flip, [a, d, b], [b, c, d]).T
    ring = np.arange(sectors)
    triangles = np.concatenate([one, two])
    places = np.full(sectors, place)
    return _Surface(grid.reshape(-1, 3), triangles, ring, rows * sectors + ring, places)


def _ring(radii: Array, height: float | Array) -> Array:
    """Return points at equal steps of azimuth, shape (n, 3)."""
    azimuths = _turns(radii.size)
    x, y = radii * np.cos(azimuths), radii * np.sin(azimuths)
    return np.column_stack([x, y, np.broadcast_to(height, radii.shape)])


def _in_bath(curves: Array, liquid: Liquid) -> tuple[_Surface, Rails]:
    """Return the exact meniscus of the axisymmetric pad with the same mean radii."""
    mean, sectors = curves.mean(axis=0), len(curves)
    wall = replace(Wall.through(*mean.T), steps=12)  # coarse: only a start is needed
    bath = bath_meniscus(wall, liquid)
    if bath.status in ('dry', 'rim'):
        why = 'is pushed below the floor, where the wall ends'
        if bath.status == 'rim':
            why = f'reaches the top of the wall at height = {bath.height:g} m'
        raise NoSurface(f'the liquid {why}', 'rim')
    place = float(np.interp(bath.height, mean[:, 1], np.linspace(0.0, 1.0, KNOTS)))
    length = liquid.capillary_length
    far = float(curves[..., 0].max()) + REACH * length
    # Triangles are as long as wide, or shorter where the surface is curved, and grow outwards.
    step = 2.0 * math.pi / sectors
    first = step * min(bath.radius, length)
    rows = math.ceil(math.log1p(step * REACH * length / first) / math.log1p(step))
    radii, heights = curves[:, round(place * (KNOTS - 1))].T
    inner, outer = _ring(radii, heights), _ring(np.full(sectors, far), 0.0)
    share = np.append(0.0, np.cumsum((1.0 + step) ** np.arange(rows)))
    grid = inner + (share / share[-1])[:, None, None] * (outer - inner)
    # Bend the straight surface.
    distance = np.linalg.norm(grid - inner.mean(axis=0), axis=2)
    distance = (distance - distance[0]).mean(axis=1)
    along = np.append(0.0, np.cumsum(np.hypot(np.diff(bath.radii), np.diff(bath.heights))))
    beyond = np.interp(distance, along, bath.radii) - bath.radius
    level = np.interp(distance, along, bath.heights)
    bent = [_ring(radii + beyond[k], level[k]) for k in range(rows)]
    return _spanned(np.stack([*bent, outer]), place), lambda azimuths: np.full(azimuths.size, far)


def _in_cell(curves: Array, liquid: Liquid, area: float) -> tuple[_Surface, Rails]:
    """Return a cone from the pad to the middle between equal pads, a hexagon."""
    sectors, widest, ratio = len(curves), 2.0 * float(curves[..., 0].max()), math.sqrt(0.75)
    if sectors % 12:
        raise InvalidInput(
            f'sectors = {sectors!r} is not allowed: a multiple of 12 is needed, for vertices in'
            ' the corners of the cell'
        )
    number('area', area, 'm² (pads must not touch)', ratio * widest**2, above=True)
    pitch, turn = math.sqrt(area / ratio), math.pi / 3.0

    def outer(azimuths: Array) -> Array:
        off = np.mod(azimuths + 0.5 * turn, turn) - 0.5 * turn
        return 0.5 * pitch / np.cos(off)

    mean = curves.mean(axis=0)
    place = _film_place(mean, liquid)
    radius, level = mean[round(place * (KNOTS - 1))]
    middle = 0.55 * pitch
    rows = max(2, round((middle - radius) / (middle + radius) * sectors / math.pi))
    inner = _ring(*curves[:, round(place * (KNOTS - 1))].T)
    far = _ring(outer(_turns(sectors)), level)
    share = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
    return _spanned(inner + share * (far - inner), place), outer


def _film_place(mean: Array, liquid: Liquid) -> float:
    """Return an estimate of the contact line's place on the rail in a pattern, from 0 to 1.

    This is the mean height of the level film between close pads and the meniscus of a single pad:
    that of small slopes, with the height of steep ones for wide pads.
    """
    from scipy.special import k0e, k1e

    radii, heights = mean.T
    lean = np.arctan2(np.gradient(heights), np.gradient(radii))
    level = float(np.interp(math.pi - liquid.angle, np.maximum.accumulate(lean), heights))
    length = liquid.capillary_length
    slopes = np.maximum(math.pi - liquid.angle - lean, 0.0)
    distance = np.maximum(radii / length, 1e-9)
    met = 2.0 * length * np.sin(0.5 * slopes) * k0e(distance) / k1e(distance) <= heights
    level = 0.5 * (level + float(heights[np.argmax(met)] if met.any() else heights[-1]))
    return float(np.clip(np.interp(level, heights, np.linspace(0.0, 1.0, KNOTS)), 0.02, 0.98))


# --- Minimisation ------------------------------------------------------------------------------


class _Task(NamedTuple):
    """What a surface is between, with lengths over its extent and energies over the tension.

    ``rails`` gives the wall, ``outer`` the radii of the far ring, by azimuth; ``cosine`` is that
    of the contact angle.
    """

    rails: Rails
    outer: Rails
    cosine: float
    weight: float


@np.errstate(over='ignore', invalid='ignore')
def _relaxed(task: _Task, surface: _Surface) -> _Surface:
    """Return the surface of least energy on the present rails."""
    from scipy.optimize import minimize

    energy = _Energy(task, surface)
    diagonal = abs(energy.matrix(energy.start).diagonal())
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-6 * diagonal.max()))
    kept: dict[str, Any] = {}

    def value(y: Array) -> tuple[float, Array]:
        found, slope = energy.value(scale * y)
        return found, scale * slope

    def product(y: Array, direction: Array) -> Array:
        if not kept or not np.array_equal(kept['y'], y):
            kept.update(y=y.copy(), matrix=energy.matrix(scale * y))
        across: Array = scale * (kept['matrix'] @ (scale * direction))
        return across

    options = {'gtol': 1e-8, 'maxiter': 300, 'initial_trust_radius': 0.1}
    try:
        found = minimize(value, energy.start / scale, jac=True, hessp=product, method='trust-ncg',
                         options=options)  # fmt: skip
    except ValueError as error:  # triangles without area have no finite Hessian
        raise NoSurface(f'the surface collapses: {error}', 'collapsed') from error
    moved = energy.moved(surface, scale * found.x)
    residual = float(np.max(abs(found.jac))) ** 2
    if residual > 1e-12:
        raise NoSurface(
            f'the minimisation does not converge: residual = {residual:.2g} of the energy (at most'
            ' 1e-12 is needed)',
            'no_convergence',
        )
    return moved


def _averaged(surface: _Surface) -> _Surface:
    """Return the surface with inner vertices moved along it, towards their neighbours."""
    points, near, normals = surface.points, _near(surface), _normals(surface)
    shift = near @ points / near.sum(axis=1).reshape(-1, 1) - points
    shift -= normals * np.sum(shift * normals, axis=1, keepdims=True)
    shift[surface.ring] = shift[surface.far] = 0.0
    return replace(surface, points=points + 0.3 * shift)


def _refined(task: _Task, surface: _Surface) -> _Surface:
    """Return the surface with each triangle split into four."""
    first, edges = len(surface.points), _edges(surface.triangles)
    keys = edges @ (first, 1)

    def middle(a: Indices, b: Indices) -> Indices:
        found: Indices = first + np.searchsorted(keys, np.minimum(a, b) * first + np.maximum(a, b))
        return found

    points = np.vstack([surface.points, surface.points[edges].mean(axis=1)])
    a, b, c = surface.triangles.T
    ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
    split = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    triangles = np.concatenate([np.stack(corners, axis=1) for corners in split])
    ring, far = (
        np.column_stack([each, middle(each, np.roll(each, -1))]).ravel()
        for each in (surface.ring, surface.far)
    )
    places = surface.places
    places = np.column_stack([places, 0.5 * (places + np.roll(places, -1))]).ravel()
    points[far] = _ring(task.outer(_turns(far.size)), points[far, 2])
    return _Surface(points, triangles, ring, far, places)


class _Energy:
    """Energy of a surface as a function of the places of its vertices on rails, with derivatives.

    The unknowns ``q`` are distances along rails: on the wall from the floor, elsewhere from the
    start. ``start`` has the values of the given surface.
    """

    def __init__(self, task: _Task, surface: _Surface) -> None:
        self.weight, self.cosine = task.weight, task.cosine
        self.triangles, self.ring = surface.triangles, surface.ring
        self.wall = _WallRails(task.rails(_turns(self.ring.size)))
        self.base, self.direction = surface.points, _normals(surface)
        self.direction[surface.far] = (0.0, 0.0, 1.0)
        self.start = np.zeros(len(self.base))
        self.start[self.ring] = surface.places * self.wall.length

    def place(self, q: Array) -> tuple[Array, Array, Array]:
        """Return positions of the vertices, and first and second derivatives along the rails."""
        x = self.base + q[:, None] * self.direction
        d, dd = self.direction.copy(), np.zeros_like(x)
        x[self.ring], d[self.ring], dd[self.ring] = self.wall.place(q[self.ring])
        return x, d, dd

    def moved(self, surface: _Surface, q: Array) -> _Surface:
        """Return the surface at other places; refuse one that has pinched off or left the wall."""
        places = q[self.ring] / self.wall.length
        new = replace(surface, points=self.place(q)[0], places=places)
        before = _unit(_across(replace(surface, points=self.place(self.start)[0])))
        across, corners = _across(new), new.points[new.triangles]
        sides = np.roll(corners, -1, axis=1) - corners
        quality = 2.0 * math.sqrt(3.0) * np.linalg.norm(across, axis=1)
        quality /= np.sum(sides**2, axis=(1, 2))
        turned = np.sum(_unit(across) * before, axis=1) < -0.5
        if not quality.min() > 0.01 or turned.any():  # equilateral triangles have 1
            raise NoSurface('the surface collapses: it pinches off or turns over', 'collapsed')
        if not 0.0 <= places.min() <= places.max() <= 1.0:
            raise NoSurface('the contact line reaches the end of the wall', 'rim')
        return new

    def value(self, q: Array) -> tuple[float, Array]:
        """Return the energy and its gradient."""
        x, d, _ = self.place(q)
        area, moment, on_vertices = self._on_vertices(x)
        wet, _, raised = self.wall.integrals(q[self.ring])
        slope: Array = np.sum(on_vertices * d, axis=1)
        slope[self.ring] += self.weight * raised[1] - self.cosine * wet[1]
        onto_wall = float(np.sum(self.weight * raised[0] - self.cosine * wet[0]))
        return area + self.weight * moment + onto_wall, slope

    def volume(self) -> float:
        """Return the volume of the liquid under the given surface."""
        corners = self.place(self.start)[0][self.triangles]
        up = _triangles(corners)[0][:, 2]
        under = self.wall.integrals(self.start[self.ring])[1]
        return float(up @ corners[..., 2].sum(axis=1) / 6.0 + under[0].sum())

    def _on_vertices(self, x: Array) -> tuple[float, float, Array]:
        """Return area and moment under the free surface, and the energy's gradient in space."""
        normal, length, opposite, sums, square = _triangles(x[self.triangles])
        # d(n·N)/dx = opposite × n, for any fixed n.
        on = 0.5 * np.cross(opposite, (normal / length[:, None])[:, None, :])
        on += self.weight * square[:, None, None] * np.cross(opposite, (0.0, 0.0, 1.0))
        on[..., 2] += self.weight * normal[:, 2:] * sums / 24.0
        where, count = self.triangles.ravel(), len(x)
        columns = [np.bincount(where, on[..., k].ravel(), minlength=count) for k in range(3)]
        return 0.5 * float(length.sum()), float(square @ normal[:, 2]), np.stack(columns, axis=1)

    def matrix(self, q: Array) -> Any:
        """Return the Hessian of the energy, sparse."""
        from scipy.sparse import coo_matrix

        x, d, dd = self.place(q)
        along, bend = d[self.triangles], dd[self.triangles]
        normal, length, opposite, sums, square = _triangles(x[self.triangles])
        first = np.cross(along, opposite)  # dN/dq
        second = np.zeros((len(normal), 3, 3, 3))
        for k in range(3):
            after = (k + 1) % 3
            second[:, k, after] = second[:, after, k] = np.cross(along[:, k], along[:, after])
            second[:, k, k] = np.cross(bend[:, k], opposite[:, k])
        grows = np.einsum('tk,tak->ta', normal / length[:, None], first)
        h = 0.5 * np.einsum('tk,tabk->tab', normal / length[:, None], second)
        h += 0.5 * np.einsum('tak,tbk->tab', first, first) / length[:, None, None]
        h -= 0.5 * grows[:, :, None] * grows[:, None, :] / length[:, None, None]
        rise, same = along[..., 2], np.eye(3)
        lift = (1.0 + same) * rise[:, :, None] * rise[:, None, :]
        lift += same * (sums * bend[..., 2])[:, :, None]
        mixed = (sums * rise)[:, :, None] * first[:, None, :, 2]
        lifted = lift * normal[:, 2, None, None] + mixed + mixed.transpose(0, 2, 1)
        h += self.weight * (lifted / 24.0 + square[:, None, None] * second[..., 2])
        rows = np.broadcast_to(self.triangles[:, :, None], h.shape).ravel()
        columns = np.broadcast_to(self.triangles[:, None, :], h.shape).ravel()
        wet, _, raised = self.wall.integrals(q[self.ring])
        data = np.append(h.ravel(), self.weight * raised[2] - self.cosine * wet[2])
        at = np.append(rows, self.ring), np.append(columns, self.ring)
        return coo_matrix((data, at), shape=(q.size, q.size)).tocsr()

    def force(self, surface: _Surface) -> Array:
        """Return the force on the pad: minus dE/dx if pad and contact line move by x.

        Each vertex moves by a share of x, on which the force does not depend in equilibrium. The
        shares are harmonic on the graph of edges: they spread over the surface and average the
        errors of the mesh.
        """
        from scipy.sparse import diags
        from scipy.sparse.linalg import spsolve

        near = _near(surface)
        laplace = (diags(near.sum(axis=1)) - near).tocsc()
        share = np.zeros(len(self.base))
        free = np.setdiff1d(np.arange(share.size), np.append(surface.ring, surface.far))
        share[surface.ring] = 1.0
        share[free] = spsolve(laplace[free][:, free], -(laplace @ share)[free])
        cost = share @ self._on_vertices(self.place(self.start)[0])[2]
        cost[2] += self.weight * self.wall.integrals(self.start[self.ring])[1][0].sum()
        force: Array = -cost
        return force


class _WallRails:
    """The rails of the contact line: positions and wetting integrals as splines in arc length."""

    def __init__(self, curves: Array) -> None:
        from scipy.interpolate import CubicHermiteSpline, CubicSpline

        width = 2.0 * math.pi / len(curves)
        # Between vertices the line is straight. Areas of the wall use the same polygon as the
        # surface; otherwise films would spread without limit near complete wetting.
        chord, apothem = np.sinc(0.5 * width / math.pi), math.cos(0.5 * width)
        self.length = np.hypot(*np.moveaxis(np.diff(curves, axis=1), -1, 0)).sum(axis=1)
        azimuths = _turns(len(curves))
        self.outwards = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)

        # Splines over 0..1, the same knots for all rails.
        knots = np.linspace(0.0, 1.0, KNOTS)
        along = CubicSpline(knots, np.swapaxes(curves, 0, 1), axis=0)  # (knot, rail, 2)
        nodes, weights = np.polynomial.legendre.leggauss(4)
        inner = (knots[:-1, None] + 0.5 * (nodes + 1.0) * np.diff(knots)[:, None]).ravel()

        def around(values: Array) -> Array:
            return (np.roll(values, -1, axis=1) - np.roll(values, 1, axis=1)) / (2.0 * width)

        def rates(t: Array) -> Array:
            """Return derivatives over t of the integrals of :meth:`integrals`: (t, rail, 3)."""
            (r, z), (rt, zt) = (np.moveaxis(along(t, k), -1, 0) for k in (0, 1))
            skew = np.hypot(r * np.hypot(apothem * rt, zt), rt * around(z) - zt * around(r))
            covered = apothem * r * rt
            fields = np.stack([skew, z * covered, 0.5 * z**2 * covered], axis=-1)
            return fields * chord * width

        cells = rates(inner).reshape(KNOTS - 1, 4, -1, 3)
        sums = np.einsum('kgrf,g->krf', cells, weights) * (0.5 / (KNOTS - 1))
        totals = np.concatenate([np.zeros((1, *sums.shape[1:])), np.cumsum(sums, axis=0)])
        integrals = CubicHermiteSpline(knots, totals, rates(knots), axis=0)
        self.pieces = np.concatenate([along.c, integrals.c], axis=-1)  # (power, cell, rail, 5)

    def _fields(self, s: Array) -> Array:
        """Return value, first and second derivative over arc length, shape (3, rail, 5)."""
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
        return np.concatenate([fields[..., :1] * self.outwards, fields[..., 1:2]], axis=-1)

    def integrals(self, s: Array) -> Array:
        """Return wet area, volume and moment: (3, 3 derivatives, vertex)."""
        return np.moveaxis(self._fields(s)[..., 2:], -1, 0)


# --- Meshes ------------------------------------------------------------------------------------


def _edges(triangles: Indices) -> Indices:
    """Return both corners of each edge, shape (n, 2), in order."""
    return np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)), axis=0)


def _near(surface: _Surface) -> Any:
    """Return a sparse array with 1 for each pair of neighbours."""
    from scipy.sparse import coo_array

    edges, count = _edges(surface.triangles), len(surface.points)
    pairs = np.concatenate([edges, edges[:, ::-1]]).T
    return coo_array((np.ones(pairs.shape[1]), pairs), shape=(count, count)).tocsr()


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def _across(surface: _Surface) -> Array:
    """Return normals of triangles, as long as twice their areas."""
    a, b, c = np.moveaxis(surface.points[surface.triangles], 1, 0)
    return np.cross(b - a, c - a)


def _triangles(corners: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return normals N, their lengths, opposite edges, z + Σ z by corner, moments per N_z."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    opposite = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
    z = corners[..., 2]
    total = z.sum(axis=1)
    square = ((z**2).sum(axis=1) + total**2) / 48.0  # (Σ z² + Σ z z' over pairs) / 24
    return normal, length, opposite, z + total[:, None], square


def _normals(surface: _Surface) -> Array:
    """Return unit normals at vertices, weighted by area."""
    across, total = _across(surface), np.zeros_like(surface.points)
    for corner in surface.triangles.T:
        np.add.at(total, corner, across)
    return _unit(total)
