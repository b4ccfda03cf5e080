# SPDX-License-Identifier: Apache-2.0
"""Axisymmetric finite elements of an inflated pad: a solid of any thickness, by scikit-fem.

Lengths are in radii of the pad and stresses in shear moduli. The rubber keeps its volume exactly:
displacements are biquadratic (9 nodes), the multiplier of J = 1 is linear and discontinuous.
Gradients at the points of integration are one sparse matrix G, so that a Newton step is
``G' H G`` with the 5 by 5 derivatives H of the energy. The pressure follows the inner face: its
work is the volume under that face, which is a quadratic function of the slopes there.

In axisymmetry F has a 2 by 2 block and the stretch e of circles. With S the sum of squares of the
block and D its determinant, ``I1 = S + e²``, ``I2 = S e² + D²`` and ``J = D e``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem
from scipy import sparse
from scipy.sparse.linalg import splu

from ros_pad.contact.pad import Array

EDGES = ('bonded', 'clamped')
"""``bonded``: the sheet goes on to three thicknesses beyond the rim, its inner face held there.
``clamped``: the cylinder at the rim is held."""

# Above this I1 - 3 the energy goes on as a parabola, as in the reference; corners alone get there.
_STEEP = 16.0
_MOST_STEPS = 14
_DONE = 1e-9
# Steps of a path that are tried, over the wanted one.
_SHARES = (1.0, 0.5, 0.25, 1.5, 2.0, 3.0, 0.1)
# Least pressure over that of the state before.
_FALL = 0.9
# Graded to the rim, where stress is singular: powers of the share of the distance.
_GRADING = 1.5


@dataclass(frozen=True)
class Rubber:
    """W over the shear modulus: a polynomial of I1 - 3, and one factor of I2 - 3."""

    c1: float = 0.5
    c2: float = 0.0
    c3: float = 0.0
    c01: float = 0.0

    def slopes(self, rise: Array) -> tuple[Array, Array]:
        """Return the first and second derivative over I1 at I1 - 3."""
        x = np.minimum(rise, _STEEP)
        bend = 2.0 * self.c2 + 6.0 * self.c3 * x
        return self.c1 + x * (2.0 * self.c2 + 3.0 * self.c3 * x) + bend * (rise - x), bend


@dataclass(frozen=True)
class State:
    """An equilibrium: unknowns, pressure over the shear modulus, heights and volume.

    ``outer`` and ``inner`` are the rises of the two faces at the apex, ``volume`` is that under
    the inner face.
    """

    unknowns: Array
    pressure: float
    outer: float
    inner: float
    volume: float


# Second derivatives over F's entries: of half of I1, of half of S, and of D.
_UNIT = np.eye(5)[:, :, None]
_BLOCK = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])[:, :, None]
_TWIST = np.zeros((5, 5, 1))
_TWIST[[0, 3, 1, 2], [3, 0, 2, 1], 0] = 1.0, 1.0, -1.0, -1.0


class NoConvergence(Exception):
    """Newton's method found no equilibrium."""


class Solid:
    """Mesh and operators of a pad.

    Parameters
    ----------
    rubber : Rubber
        Law.
    thickness : float
        Thickness over radius.
    edge : {'bonded', 'clamped'}
        What is held.
    cells : int
        Elements over the thickness; there are about 5 times as many over the radius.
    """

    def __init__(self, rubber: Rubber, thickness: float, edge: str, cells: int) -> None:
        self.rubber, self.thickness = rubber, thickness
        mesh = skfem.MeshQuad.init_tensor(*_grid(thickness, edge, cells))
        element = skfem.ElementVector(skfem.ElementQuad2())
        basis = skfem.Basis(mesh, element, intorder=5)
        self._size = size = basis.N
        count, points = mesh.nelements, basis.X.shape[1]
        radius = np.asarray(basis.global_coordinates())[0]
        self._weight = (basis.dx * radius).ravel()
        # Rows: the four derivatives of displacement and the radial one over the radius.
        rows = [_operator(basis, lambda f, i=i, j=j: f.grad[i, j]) for i in (0, 1) for j in (0, 1)]
        rows.append(_operator(basis, lambda f: np.asarray(f)[0] / radius))
        self._gradient = sparse.vstack(rows, format='csr')
        linear = np.stack([np.ones(points), *(2.0 * basis.X - 1.0)], axis=1)
        self._linear = sparse.kron(sparse.identity(count), linear, format='csr')
        self._face(mesh, element)
        self._hold(basis, edge)
        self._full = size + 3 * count

    def _face(self, mesh: Any, element: Any) -> None:
        """Prepare the inner face under pressure: r, z and their derivatives over R."""
        facets = mesh.facets_satisfying(lambda x: (x[1] < 1e-9) & (x[0] < 1.0), True)
        face = skfem.FacetBasis(mesh, element, facets=facets, intorder=6)
        at = np.asarray(face.global_coordinates())[0]
        self._face_rows = sparse.vstack(
            [
                _operator(face, lambda f: np.asarray(f)[0]),
                _operator(face, lambda f: f.grad[0, 0]),
                _operator(face, lambda f: f.grad[1, 0]),
            ],
            format='csr',
        )
        self._face_flat, self._face_weight = at.ravel(), face.dx.ravel()

    def _hold(self, basis: Any, edge: str) -> None:
        """Find the unknowns that are free, and those of the apex; the axis stays on itself."""
        (r, z), near = basis.doflocs, 1e-9
        upright = np.zeros(basis.N, dtype=bool)
        upright[basis.element_dofs[1::2]] = True
        held = (r > r.max() - near) | ((r < near) & ~upright)
        if edge == 'bonded':
            held |= (r > 1.0 - near) & (z < near)
        unknowns = np.arange(basis.N + 3 * basis.mesh.nelements)
        self._free = np.setdiff1d(unknowns, np.flatnonzero(held))
        apex = upright & (r < near)
        self._inner = int(np.flatnonzero(apex & (z < near))[0])
        self._outer = int(np.flatnonzero(apex & (z > z.max() - near))[0])

    def _energy(self, fields: Array) -> tuple[Array, Array, Array, Array]:
        """Return J - 1, dJ, dW and second derivatives of W + q (J - 1), by F's five entries."""
        a, b, c, d, e, q = fields
        det, zero, one = a * d - b * c, np.zeros_like(a), np.ones_like(a)
        total = a * a + b * b + c * c + d * d
        block, ring = np.stack([a, b, c, d, zero]), np.stack([zero, zero, zero, zero, one])
        of_det = np.stack([d, -c, -b, a, zero])
        j, d_j = det * e, e * of_det + det * ring
        dd_j = e * _TWIST + _pairs(of_det, ring)
        first = _kept(
            (total + e * e, 2.0 * (block + e * ring), 2.0 * _UNIT), (j, d_j, dd_j), 2.0 / 3.0
        )
        slope, bend = self.rubber.slopes(first[0] - 3.0)
        stress = slope * first[1]
        twice = slope * first[2] + bend * first[1][:, None] * first[1] + q * dd_j
        if self.rubber.c01:
            second = (
                total * e * e + det * det,
                2.0 * (e * e * block + total * e * ring + det * of_det),
                2.0 * e * e * _BLOCK
                + 4.0 * e * _pairs(block, ring)
                + 2.0 * total * (_UNIT - _BLOCK)
                + 2.0 * of_det[:, None] * of_det
                + 2.0 * det * _TWIST,
            )
            kept = _kept(second, (j, d_j, dd_j), 4.0 / 3.0)
            stress = stress + self.rubber.c01 * kept[1]
            twice = twice + self.rubber.c01 * kept[2]
        return j - 1.0, d_j, stress, twice

    def _assemble(self, unknowns: Array) -> tuple[Array, Any, Array, Any, float]:
        """Return internal force and its matrix, gradient of the volume, its matrix, the volume."""
        u, q = unknowns[: self._size], unknowns[self._size :]
        fields = np.empty((6, self._weight.size))
        fields[:5] = (self._gradient @ u).reshape(5, -1)
        fields[[0, 3, 4]] += 1.0
        fields[5] = self._linear @ q
        off, d_j, stress, second = self._energy(fields)
        weight = self._weight
        force = np.concatenate(
            [
                self._gradient.T @ ((stress + fields[5] * d_j) * weight).ravel(),
                self._linear.T @ (off * weight),
            ]
        )
        blocks = [[sparse.diags_array(second[i, j] * weight) for j in range(5)] for i in range(5)]
        tangent = self._gradient.T @ sparse.block_array(blocks, format='csr') @ self._gradient
        spread = sparse.vstack([sparse.diags_array(x * weight) for x in d_j])
        coupling = self._gradient.T @ (spread @ self._linear)
        matrix = sparse.block_array([[tangent, coupling], [coupling.T, None]], format='csr')
        return force, matrix, *self._volume(u)

    def _volume(self, u: Array) -> tuple[Array, Any, float]:
        """Return gradient, matrix and value of the volume under the inner face over 2 π."""
        r, along, rise = (self._face_rows @ u).reshape(3, -1)
        r, along = r + self._face_flat, along + 1.0
        weight = self._face_weight
        # With z = 0 at the rim the volume is -∫ r² z' / 2.
        d = np.stack([-r * rise, np.zeros_like(r), -0.5 * r * r]) * weight
        zero = np.zeros_like(r)
        second = [[-rise, zero, -r], [zero, zero, zero], [-r, zero, zero]]
        blocks = [[sparse.diags_array(x * weight) for x in row] for row in second]
        rows = self._face_rows
        full = np.zeros(self._full)
        full[: self._size] = rows.T @ d.ravel()
        matrix = rows.T @ sparse.block_array(blocks, format='csr') @ rows
        matrix.resize((self._full, self._full))
        return full, matrix, float(-0.5 * (r * r * rise * weight).sum())

    def solve(self, start: State, height: float | None, pressure: float = 0.0) -> State:
        """Return the equilibrium with a height of the outer face, or else with a pressure."""
        x, p = start.unknowns.copy(), start.pressure
        free = self._free
        row = np.zeros(self._full)
        if height is not None:
            row[self._outer] = 1.0
        row = row[free]
        for step in range(_MOST_STEPS):
            force, matrix, push, more, volume = self._assemble(x)
            residual = (force - p * push)[free]
            gap = x[self._outer] - height if height is not None else p - pressure
            size = max(abs(residual).max(), abs(gap))
            if step and size < _DONE:
                rise = float(x[self._outer]), float(x[self._inner])
                return State(x, float(p), *rise, 2.0 * np.pi * volume)
            if not size < 1e3:
                break
            inside = (matrix - p * more).tocsc()[free][:, free]
            border = sparse.csc_array(-push[free][:, None])
            last = [[0.0 if height is not None else 1.0]]
            bordered = sparse.block_array(
                [[inside, border], [sparse.csc_array(row[None, :]), sparse.csc_array(last)]],
                format='csc',
            )
            try:
                move = splu(bordered).solve(-np.append(residual, gap))
            except RuntimeError as error:
                raise NoConvergence(str(error)) from error
            share = self._share(x, move[:-1])
            x[free] += share * move[:-1]
            p += share * move[-1]
        raise NoConvergence(f'residual {size:.1e} at height {height}')

    def _share(self, unknowns: Array, move: Array) -> float:
        """Return how much of a step leaves all points with a volume above 0."""
        trial = np.zeros(self._full)
        trial[self._free] = move
        now, more = (self._gradient @ each[: self._size] for each in (unknowns, trial))
        now = now.reshape(5, -1) + np.array([[1.0], [0.0], [0.0], [1.0], [1.0]])
        share = 1.0
        while share > 1e-3:
            a, b, c, d, e = now + share * more.reshape(5, -1)
            if min((a * d - b * c).min(), e.min()) > 0.0:
                break
            share *= 0.5
        return share

    def flat(self) -> State:
        """Return the state without pressure."""
        return State(np.zeros(self._full), 0.0, 0.0, 0.0, 0.0)

    def path(self, step: float, last: float) -> Iterator[State]:
        """Yield states at rising heights of the outer face, until the last or none is found.

        At an edge that folds, the next state may be shorter or longer away than a step.
        """
        before = now = self.flat()
        while now.outer < last:
            for share in _SHARES:
                ahead = min(share * step, last - now.outer)
                start = _ahead(before, now, ahead)
                try:
                    found = self.solve(start, now.outer + ahead)
                except NoConvergence:
                    continue
                # Pressure rises at most as the cube of the height: else it is another branch.
                most = (found.outer / now.outer) ** 3 if now.outer else 1.0
                rise = found.pressure / now.pressure if now.pressure else 1.0
                if not _FALL < rise < 1.05 * most:
                    continue
                before, now = now, found
                yield now
                break
            else:
                return


def _pairs(x: Array, y: Array) -> Array:
    return x[:, None] * y + y[:, None] * x


def _kept(invariant: Any, volume: Any, power: float) -> tuple[Array, Array, Array]:
    """Return I over J to a power, and its derivatives, from those of I and J.

    At J = 1 it is I; elsewhere, between the points where J = 1 holds, it keeps J above 0.
    """
    (i, d_i, dd_i), (j, d_j, dd_j) = invariant, volume
    k = power / j
    d = d_i - k * i * d_j
    dd = dd_i - k * _pairs(d_i, d_j) + k * i * ((power + 1.0) / j * d_j[:, None] * d_j - dd_j)
    with np.errstate(invalid='ignore'):  # a step that turned a point inside out fails by NaN
        share = j**-power
    return share * i, share * d, share * dd


def _ahead(before: State, now: State, step: float) -> State:
    """Return the state on the line through two others as a start."""
    if now.outer == before.outer:
        return now
    share = step / (now.outer - before.outer)
    return replace(
        now,
        unknowns=now.unknowns + share * (now.unknowns - before.unknowns),
        pressure=now.pressure + share * (now.pressure - before.pressure),
    )


def _grid(thickness: float, edge: str, cells: int) -> tuple[Array, Array]:
    """Return the lines of the mesh over R and Z."""
    graded = thickness * np.linspace(0.0, 1.0, cells + 1) ** _GRADING
    across = round(4 * cells * max(1.0, 0.05 / thickness))  # the rim zone of thin sheets is narrow
    inside = np.linspace(0.0, 1.0 - thickness, across + 1)
    radius = np.append(inside[:-1], 1.0 - graded[::-1])
    if edge == 'clamped':
        return radius, thickness * np.linspace(0.0, 1.0, cells + 1)
    beyond = np.linspace(1.0 + thickness, 1.0 + 3.0 * thickness, cells + 1)
    return np.concatenate([radius, 1.0 + graded[1:], beyond[1:]]), graded


def _operator(basis: Any, part: Any) -> Any:
    """Return the matrix from unknowns to a part of the field at the points of integration."""
    count = basis.dx.size
    at = np.arange(count)
    shape = basis.dx.shape
    values, rows, columns = [], [], []
    for number, each in enumerate(basis.basis):
        values.append(np.broadcast_to(part(each[0]), shape).ravel())
        rows.append(at)
        columns.append(np.repeat(basis.element_dofs[number], shape[1]))
    place = np.concatenate(rows), np.concatenate(columns)
    return sparse.csr_array((np.concatenate(values), place), shape=(count, basis.N))
