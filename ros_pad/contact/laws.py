# SPDX-License-Identifier: Apache-2.0
"""Laws of the free dome, fitted to measured pressures and heights, and which the data support.

Each law gives the pressure of a dome of measured height as a sum of one or two constants times
known functions of the height:

``stiffness``
    The law of the thesis, ``p = k (6 sin t - 2 sin 2t)/r`` with ``tan t = height/r``.
``two constants``
    ``T = T0 + k (sigma - 1)`` and Laplace's ``p = 2 T/R`` of the cap.
``factor``
    A factor on all stresses of a material, with the thickness as given.
``thickness``
    The thickness of the sheet, with the material as given. The pressure of a membrane is in
    proportion to stress times thickness, so this is the same function of the height.

Pressures are fitted and not heights, for near its largest pressure a dome of rubber has a height
that small errors of pressure change without bound, and above it has none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_pad.contact.dome import inflate
from ros_pad.contact.hyperelastic import pressure_end
from ros_pad.contact.pad import Array, Pad
from ros_pad.errors import InvalidInput

SIGNIFICANCE = 0.05
"""Chance below which measurements speak against a law."""
# Simulated sets of measurements for one comparison: the chance above is known to 0.002.
_SETS = 10000
# Sum of squares of relative errors below which a fit counts as exact.
_EXACT = 1e-20


@dataclass(frozen=True)
class Law:
    """A law of the free dome, fitted to measured domes.

    Attributes
    ----------
    name : str
        One of the laws of the module's docstring.
    basis : array
        Pressures, Pa, by dome (rows) for a constant of 1 (columns).
    values, low, high : array
        Constants that minimise the relative errors of pressure, and their 95 % intervals by
        Student's t (of the logarithm where there is one constant); NaN where there are no more
        domes than constants.
    error : float
        Root mean square of the relative errors of pressure.
    """

    name: str
    basis: Array
    values: Array
    low: Array
    high: Array
    error: float


@dataclass(frozen=True)
class Comparison:
    """Whether measured domes distinguish two laws.

    Attributes
    ----------
    first, second : str
        Names of the laws.
    first_chance, second_chance : float
        If this law were right, the chance that it fits at least as badly as here in comparison
        with the other one. NaN where both laws are the same function of the height.
    domes : int
        Number of measured domes.
    """

    first: str
    second: str
    first_chance: float
    second_chance: float
    domes: int

    def __str__(self) -> str:
        if math.isnan(self.first_chance):
            return (
                f'{self.first} and {self.second} give the same domes: no measured dome'
                ' distinguishes them'
            )
        chances = {self.first: self.first_chance, self.second: self.second_chance}
        unlikely = [name for name, chance in chances.items() if chance < SIGNIFICANCE]
        number = f'({self.domes} domes, p = {self.first_chance:.2g} and {self.second_chance:.2g})'
        if not unlikely:
            return f'{self.first} or {self.second}: the domes do not distinguish them {number}'
        if len(unlikely) == 2:
            return f'{self.first} or {self.second}: the domes speak against both {number}'
        better = self.second if unlikely[0] == self.first else self.first
        return f'{better}: a better fit than {unlikely[0]}, beyond chance {number}'


def pressure_for_height(pad: Pad, height: Array) -> Array:
    """Return the pressures, Pa, at which free domes of a pad of a material have these heights.

    Parameters
    ----------
    pad : Pad
        A pad of a material.
    height : array
        Heights, m, above 0.

    Raises
    ------
    InvalidInput
        When a height is above the largest one.
    """
    end, status = pressure_end(pad)
    highest = highest_dome(pad)
    if (height > highest).any():
        why = (
            'there it balloons'
            if status == 'no_inflation'
            else f'there its range ends, a uniaxial stretch of {pad.material.uniaxial_end:.4g}'  # type: ignore[union-attr]
        )
        raise InvalidInput(
            f'height = {height.max():g} m of a free dome is not allowed on {pad}: at most'
            f' {highest:.6g} m, at {end:.6g} Pa, is allowed; {why}'
        )
    low, high = np.zeros_like(height), np.full_like(height, end)
    for _ in range(60):
        middle = 0.5 * (low + high)
        short = inflate(pad, middle).height < height
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.asarray(0.5 * (low + high))


def highest_dome(pad: Pad) -> float:
    """Return the height of the highest free dome of a pad of a material, m."""
    return float(inflate(pad, pressure_end(pad)[0]).height)


def with_constant(pad: Pad, name: str, value: float) -> Pad:
    """Return a pad with another ``stiffness``, ``factor`` or ``thickness``."""
    if name == 'stiffness':
        return replace(pad, stiffness=value)
    material, thickness = pad.material, pad.thickness
    assert material is not None and thickness is not None
    if name == 'factor':
        material = material.times(value)
    else:
        thickness = value
    return Pad.of(material, pad.radius, thickness, pad.measured_limit, pad.edge)


def stiffness_law(radius: float, pressure: Array, height: Array) -> Law:
    """Fit the law ``stiffness`` to free domes of this radius, m."""
    t = np.arctan(height / radius)
    return _fitted('stiffness', [(6.0 * np.sin(t) - 2.0 * np.sin(2.0 * t)) / radius], pressure)


def two_constants_law(radius: float, pressure: Array, height: Array) -> Law:
    """Fit the law ``two constants``, T0 and k, to free domes of this radius, m."""
    relative = height / radius
    curvature = 4.0 * relative / (radius * (1.0 + relative**2))
    stretch = np.sqrt(1.0 + relative**2)
    return _fitted('two constants', [curvature, curvature * (stretch - 1.0)], pressure)


def rubber_laws(pad: Pad, pressure: Array, height: Array) -> tuple[Law, Law]:
    """Fit the laws ``factor`` and ``thickness`` to free domes of a pad of a material."""
    material, thickness = pad.material, pad.thickness
    assert material is not None and thickness is not None
    modelled = pressure_for_height(pad, height)
    return (
        _fitted('factor', [modelled / material.factor], pressure),
        _fitted('thickness', [modelled / thickness], pressure),
    )


def compare(laws: Sequence[Law], pressure: Array) -> tuple[Comparison, ...]:
    """Compare each two of some laws on the domes to which they were fitted.

    Parameters
    ----------
    laws : sequence of Law
        Laws fitted to the same domes.
    pressure : array
        Measured pressures of these domes, Pa.

    Returns
    -------
    tuple of Comparison
        Empty if there are too few domes for an error of each law. A law that gives the same domes
        as an earlier one is compared with that one alone.

    Notes
    -----
    The ratio of the sums of squares of two laws is compared with its distribution over simulated
    measurements from each law as fitted, with Gaussian errors of the size that it leaves: Cox's
    test with a parametric bootstrap. For one law within the other it is the F-test. A law that
    contains the other cannot fail.
    """
    if len(pressure) <= max((law.basis.shape[1] for law in laws), default=0):
        return ()
    pairs = list(itertools.combinations(laws, 2))
    twins = [pair for pair in pairs if _contains(*pair) and _contains(*pair[::-1])]
    later = {second.name for _, second in twins}
    others = [pair for pair in pairs if later.isdisjoint(law.name for law in pair)]
    return tuple(_compared(*pair, pressure) for pair in others + twins)


def _compared(first: Law, second: Law, pressure: Array) -> Comparison:
    within = _contains(second, first), _contains(first, second)
    domes = len(pressure)
    if all(within):
        return Comparison(first.name, second.name, math.nan, math.nan, domes)
    one = 1.0 if within[1] else _chance(first, second, pressure)
    two = 1.0 if within[0] else _chance(second, first, pressure)
    return Comparison(first.name, second.name, one, two, domes)


def _contains(large: Law, small: Law) -> bool:
    """Return whether every dome of one law is one of the other law, too."""
    scaled = small.basis / np.linalg.norm(small.basis, axis=0)
    known = np.linalg.qr(large.basis)[0]
    return bool(np.linalg.norm(scaled - known @ (known.T @ scaled)) < 1e-9)


def _chance(right: Law, other: Law, pressure: Array) -> float:
    """Return the chance of a ratio of errors as large as measured if one law is right."""
    domes, constants = right.basis.shape
    true = right.basis @ right.values
    noise = right.error * math.sqrt(domes / (domes - constants))
    errors = np.random.default_rng(0).standard_normal((_SETS, domes))
    simulated = np.vstack([pressure, true * (1.0 + noise * errors)])
    ratio = _squares(right.basis, simulated) / _squares(other.basis, simulated)
    return float(np.mean(ratio[1:] >= ratio[0]))


def _squares(basis: Array, pressure: Array) -> Array:
    """Return sums of squares of the relative errors of best fits to rows of pressures."""
    shares = basis / basis[0] / pressure[:, :, None] * pressure.mean()
    products = np.einsum('nij,nik->njk', shares, shares)
    values = np.linalg.solve(products, shares.sum(axis=1)[:, :, None])
    missed = (shares @ values)[:, :, 0] - 1.0
    return np.maximum((missed**2).sum(axis=1), _EXACT)


def _fitted(name: str, basis: Sequence[Array], pressure: Array) -> Law:
    from scipy.stats import t as student

    columns = np.column_stack(basis)
    shares = columns / pressure[:, None]
    inverse = np.linalg.pinv(shares)
    values = inverse.sum(axis=1)
    squares = float(((shares @ values - 1.0) ** 2).sum())
    spare = len(pressure) - len(values)
    widths = np.full(len(values), np.nan)
    if spare > 0:
        covariance = squares / spare * (inverse @ inverse.T)
        widths = float(student.ppf(0.975, spare)) * np.sqrt(np.diag(covariance))
    if len(values) == 1:
        low, high = values * np.exp(-widths / values), values * np.exp(widths / values)
    else:
        low, high = values - widths, values + widths
    return Law(name, columns, values, low, high, math.sqrt(squares / len(pressure)))
