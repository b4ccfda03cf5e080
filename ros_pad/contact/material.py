# SPDX-License-Identifier: Apache-2.0
"""A rubber by its strain energy: law, parameters, and the stretch up to which they hold.

The energy W is per volume of the undeformed body, which keeps its volume: λ1 λ2 λ3 = 1. With
``I1 = λ1² + λ2² + λ3²``, ``I2 = 1/λ1² + 1/λ2² + 1/λ3²`` and ``J = I1 - 3`` the laws are

| law | W | parameters |
|---|---|---|
| ``yeoh`` | C1 J + C2 J² + C3 J³ | C1, C2, C3, Pa |
| ``neo_hookean`` | μ/2 J | μ, Pa |
| ``mooney_rivlin`` | C10 (I1 - 3) + C01 (I2 - 3) | C10, C01, Pa |
| ``ogden`` | Σ μi/αi (λ1^αi + λ2^αi + λ3^αi - 3) | μ1, Pa, α1, μ2, α2 and so on |
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_pad import configuration
from ros_pad.configuration import Setting, Table, choice, number, quantity, shown, text
from ros_pad.errors import ConfigError, InvalidInput

LAWS = {
    'yeoh': ('C1', 'C2', 'C3'),
    'neo_hookean': ('mu',),
    'mooney_rivlin': ('C10', 'C01'),
    'ogden': ('mu1', 'alpha1'),
}
"""Laws and the names of their parameters; ``ogden`` may have several such pairs."""

FACTORS = (0.1, 10.0)
"""Allowed factors on the stress of a material."""

LARGEST_STRETCH = 20.0
"""Largest uniaxial stretch for which a material may be declared to hold."""
UNKNOWN_STRETCH = 5.0
"""Uniaxial stretch up to which shapes are computed where the range of a material is unknown."""

_Array = npt.NDArray[np.float64]


_CASTING = (
    Setting('density', float, 'Density.', 'kg/m³', 500.0, 3000.0),
    Setting('pot_life', float, 'Time from mixing until it must be poured.', 's', 10.0, 1e5),
    Setting('cure_time', float, 'Time until it may be taken from a mould.', 's', 60.0, 1e6),
    Setting('mix', str, 'Ratio of its parts.'),
    Setting('source', str, 'Where these are from.'),
)
"""Settings of ``casting`` in a material file: how a silicone is cast, by its maker."""


@dataclass(frozen=True)
class Material:
    """A rubber.

    Parameters
    ----------
    law : {'yeoh', 'neo_hookean', 'mooney_rivlin', 'ogden'}
        Form of the strain energy; see the module's docstring.
    parameters : sequence of float
        Its parameters in the order of that table, Pa; the exponents of ``ogden`` have no unit.
    largest_stretch : float, optional
        Uniaxial stretch up to which the parameters hold, above 1 up to 20. In other states of
        strain they hold up to the same I1, which is how far a tensile test says something about
        them. By default unknown; shapes are then computed up to 5.
    source : str
        Where the parameters are from.
    factor : float
        Factor on all stresses of the law, from 0.1 to 10, as ``pad calibrate`` fits it.
    factor_range : (float, float)
        Lowest and highest factor that the doubts about the parameters allow; the factor is
        between them. By default the factor itself, twice: no doubt.
    name, doubts : str
        Name or path of the file, and why ``factor_range`` is as wide as it is.
    casting : dict, optional
        How it is cast, by its maker: density, pot life and so on, SI, as in its file.

    Raises
    ------
    InvalidInput
        When the law is unknown, a parameter is missing or not finite, the shear modulus is not
        that of a rubber, the law has no stable states in its range, as with a negative C01, or
        the factor is not in its range.

    Examples
    --------
    >>> Material('yeoh', (26258.19, 1854.391, -35.0519), 4.5).shear_modulus
    52516.38
    """

    law: str
    parameters: tuple[float, ...]
    largest_stretch: float | None = None
    source: str = field(default='', compare=False)
    factor: float = 1.0
    factor_range: tuple[float, float] | None = field(default=None, compare=False)
    name: str = field(default='', compare=False)
    doubts: str = field(default='', compare=False)
    casting: dict[str, Any] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        choice('law', self.law, tuple(LAWS))
        given = np.atleast_1d(quantity('parameters', self.parameters, 'Pa', -np.inf))
        names = LAWS[self.law]
        fits = given.size == len(names)
        fits |= self.law == 'ogden' and given.size % 2 == 0 < given.size
        if given.ndim != 1 or not fits:
            more = ', mu2, alpha2 and so on' if self.law == 'ogden' else ''
            raise InvalidInput(
                f'parameters = {shown(self.parameters)} is not allowed: the law'
                f' {self.law} needs {", ".join(names)}{more}'
            )
        object.__setattr__(self, 'parameters', tuple(given.tolist()))
        for name in ('source', 'name', 'doubts'):
            text(name, getattr(self, name))
        self._check_factor()
        if self.largest_stretch is not None:
            most = number('largest_stretch', self.largest_stretch, '', 1.0, LARGEST_STRETCH, True)
            object.__setattr__(self, 'largest_stretch', most)
        name = f'parameters = {self.parameters!r} with a shear modulus'
        number(name, self.shear_modulus, 'Pa, as rubber has,', 1e3, 1e8)
        self._check_stability()

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Material:
        """Read ``config/materials/<name>.yaml`` or another material file.

        Parameters
        ----------
        name_or_path : str or path
            Name of a shipped material, or path of a file that ends in .yaml or .yml.

        Returns
        -------
        Material
            The material, with its name.

        Raises
        ------
        ConfigError
            When the file is missing, or a key or value is not allowed.
        """
        table = Table.load(configuration.locate('materials', name_or_path))
        law = table.choice('law', tuple(LAWS))
        names = LAWS[law]
        with table.table('parameters') as part:
            if law == 'ogden':
                pairs = range(1, max(len(part.keys) // 2, 1) + 1)
                names = tuple(f'{name}{k}' for k in pairs for name in ('mu', 'alpha'))
            parameters = tuple(part.number(name, 'Pa') for name in names)
        most = None
        if 'largest_stretch' in table:
            most = table.number('largest_stretch', '', 1.0, LARGEST_STRETCH)
        source, doubts = table.text('source'), table.text('doubts', default='')
        for remark in ('description', 'licence'):
            table.text(remark, default='')
        factor, casting = factor_in(table), None
        if 'casting' in table:
            with table.table('casting') as part:
                casting = part.values(_CASTING)
        table.finish()
        try:
            return cls(
                law,
                parameters,
                most,
                source,
                **factor,
                name=os.fspath(name_or_path),
                doubts=doubts,
                casting=casting,
            )
        except InvalidInput as error:
            raise ConfigError(f'{table.origin}: {error}') from error

    def __str__(self) -> str:
        times = f'{self.factor:g} times ' if self.factor != 1.0 else ''
        return f'{times}{self.law} {" ".join(f"{each:g}" for each in self.parameters)}'

    def times(self, factor: float, factor_range: tuple[float, float] | None = None) -> Material:
        """Return the material with another factor on its stresses.

        Parameters
        ----------
        factor : float
            The factor in place of the present one.
        factor_range : (float, float), optional
            Its range; by default that of this material, widened to the factor.

        Returns
        -------
        Material
            The same law with the new factor.

        Raises
        ------
        InvalidInput
            When the factor is outside 0.1 to 10, or not in its range.
        """
        if factor_range is None:
            low, high = self.factor_range or (factor, factor)
            factor_range = min(low, factor), max(high, factor)
        return replace(self, factor=factor, factor_range=factor_range)

    @cached_property
    def shear_modulus(self) -> float:
        """Shear modulus at small strain, Pa."""
        return self.factor * self._modulus

    @cached_property
    def _modulus(self) -> float:
        """Shear modulus of the law without its factor, Pa."""
        kind, p = self._form
        if kind == 'yeoh':
            return 2.0 * p[0]
        return 0.5 * sum(m * a for m, a in zip(p[::2], p[1::2], strict=True))

    @property
    def _form(self) -> tuple[str, tuple[float, ...]]:
        """The law as ``yeoh`` or ``ogden``, of which the others are special cases, in Pa."""
        p = self.parameters
        if self.law == 'neo_hookean':
            return 'yeoh', (0.5 * p[0], 0.0, 0.0)
        if self.law == 'mooney_rivlin':
            return 'ogden', (2.0 * p[0], 2.0, -2.0 * p[1], -2.0)
        return self.law, p

    @cached_property
    def range_end(self) -> float:
        """Equibiaxial stretch up to which the material holds, less 1; dimensionless."""
        return min(equibiaxial(self.largest_stretch or UNKNOWN_STRETCH), self.stable_end)

    @cached_property
    def stable_end(self) -> float:
        """Equibiaxial stretch up to which shapes can be computed, less 1; dimensionless."""
        most = equibiaxial(max(self.largest_stretch or 0.0, UNKNOWN_STRETCH))
        return 0.98 * self._stable_end(1.05 * most)

    @cached_property
    def unit_law(self) -> tuple[str, tuple[float, ...]]:
        """The law as ``yeoh`` or ``ogden``, and parameters over the shear modulus (no unit)."""
        kind, p = self._form
        exponents = kind == 'ogden'  # every second parameter
        return kind, tuple(
            each if exponents and k % 2 else each / self._modulus for k, each in enumerate(p)
        )

    def _check_factor(self) -> None:
        value = number('factor', self.factor, '', *FACTORS)
        ends = (value, value) if self.factor_range is None else self.factor_range
        pair = quantity('factor_range', ends, '', above=True)
        if pair.shape != (2,) or not pair[0] <= value <= pair[1]:
            raise InvalidInput(
                f'factor_range = {shown(ends)} is not allowed: a lowest and a highest one are'
                f' needed, with the factor {value:g} between them'
            )
        object.__setattr__(self, 'factor', value)
        object.__setattr__(self, 'factor_range', tuple(pair.tolist()))

    def _check_stability(self) -> None:
        known = self.largest_stretch
        # A law of unknown range must have stable equibiaxial states up to a stretch of 2.
        needed = 1.0 if known is None else equibiaxial(known)
        end = self._stable_end(needed)
        if end < needed:
            raise InvalidInput(
                f'parameters = {self.parameters!r} is not allowed: the law {self.law} loses'
                f' ellipticity at an equibiaxial stretch of {1.0 + end:.4g}, where more stretch'
                f' needs less tension; at least {1.0 + needed:.4g}, or a smaller range, is needed'
            )

    def _stable_end(self, most: float) -> float:
        """Return the equibiaxial strain up to which the law is elliptic, at most ``most``.

        Tension is positive and rises with stretch, and the longer way has more of it; this is also
        checked in pure shear up to the same I1, which is the state at the rim of a dome.
        """
        strain = np.linspace(0.0, most, 801)[1:]
        stretch = 1.0 + strain
        rise = 2.0 * stretch**2 + stretch**-4 - 1.0  # λ² + 1/λ² of pure shear
        shear = np.sqrt(0.5 * (rise + np.sqrt(rise**2 - 4.0)))
        stable = np.ones(strain.size, dtype=bool)
        for along, across in ((stretch, stretch), (shear, np.ones_like(shear))):
            pull, push, more, _ = tensions(self.unit_law, np.log(along), np.log(across))
            stable &= (pull > 0.0) & (more > 0.0) & (along * pull >= across * push)
        lost = np.flatnonzero(~stable)
        return float(strain[lost[0]]) if lost.size else most


def factor_in(table: Table) -> dict[str, Any]:
    """Return ``factor`` and ``factor_range`` of a table with the key ``factor``, or nothing."""
    if 'factor' not in table:
        return {}
    with table.table('factor') as part:
        found: dict[str, Any] = {'factor': part.number('value', '', *FACTORS, default=1.0)}
        if 'low' in part or 'high' in part:
            found['factor_range'] = tuple(part.number(end, '', 0.0) for end in ('low', 'high'))
    return found


def equibiaxial(stretch: float) -> float:
    """Return the equibiaxial stretch, less 1, with the I1 of a uniaxial stretch."""
    invariant = stretch**2 + 2.0 / stretch
    square = np.roots([2.0, -invariant, 0.0, 1.0]).real.max()
    return float(np.sqrt(square) - 1.0)


def tensions(
    law: tuple[str, tuple[float, ...]], first: _Array, second: _Array
) -> tuple[_Array, _Array, _Array, _Array]:
    """Return ``dW/dλ1``, ``dW/dλ2``, ``d²W/dλ1²`` and ``d²W/dλ1 dλ2`` of a sheet.

    Parameters
    ----------
    law : tuple
        From :attr:`Material.unit_law`.
    first, second : array
        Logarithms of the stretches λ1 and λ2 in the plane: nothing cancels near 1.
    """
    kind, p = law
    a, b = np.exp(first), np.exp(second)
    if kind == 'yeoh':
        c1, c2, c3 = p
        along, across, thin = (np.expm1(2.0 * x) for x in (first, second, -first - second))
        invariant = along + across + thin
        slope = c1 + invariant * (2.0 * c2 + invariant * 3.0 * c3)
        bend = 2.0 * c2 + 6.0 * c3 * invariant
        one, two = 2.0 * (along - thin) / a, 2.0 * (across - thin) / b
        square = 1.0 + thin
        return (
            slope * one,
            slope * two,
            slope * (2.0 + 6.0 * square / (a * a)) + bend * one * one,
            slope * 4.0 * square / (a * b) + bend * one * two,
        )
    sums = [np.zeros_like(a) for _ in range(4)]
    for m, alpha in zip(p[::2], p[1::2], strict=True):
        along, across, thin = (np.expm1(alpha * x) for x in (first, second, -first - second))
        sums[0] += m * (along - thin) / a
        sums[1] += m * (across - thin) / b
        sums[2] += m * ((alpha - 1.0) * (1.0 + along) + (alpha + 1.0) * (1.0 + thin)) / (a * a)
        sums[3] += m * alpha * (1.0 + thin) / (a * b)
    return sums[0], sums[1], sums[2], sums[3]
