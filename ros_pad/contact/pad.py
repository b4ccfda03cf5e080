# SPDX-License-Identifier: Apache-2.0
"""A silicone pad: what it is made of, and the numbers one may ask it about."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.errors import InvalidInput

Array: TypeAlias = npt.NDArray[np.float64]
# A float for scalar input, an array for array input; NumPy has no type that says so.
Floats: TypeAlias = Any


def quantity(
    name: str,
    value: npt.ArrayLike,
    unit: str,
    low: float = 0.0,
    high: float = math.inf,
    above: bool = False,
) -> Array:
    """Return a physical quantity as float64 once it is known to be finite and in range.

    Parameters
    ----------
    name, unit : str
        How the message names the quantity.
    value : number or array of numbers
        A scalar comes back as a NumPy scalar, which is much faster than a 0-d array.
    low, high : float
        Allowed range, both ends included.
    above : bool
        The lower end is excluded.

    Raises
    ------
    InvalidInput
        Naming the first value that is not allowed, its unit and the range.
    """
    if type(value) is float and low < value <= high and value != math.inf:
        return np.float64(value)
    need = f'finite number(s) {"above" if above else "from"} {low:g}'
    need += f' to {high:g} {unit}' if high < math.inf else f' {unit}'
    try:
        numbers = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f'{name} = {value!r} is not allowed: {need}') from error
    if numbers.dtype.kind not in 'iuf':
        raise InvalidInput(f'{name} = {value!r} is not allowed: {need}')
    numbers = numbers.astype(np.float64)
    good = np.isfinite(numbers) & (numbers <= high) & (numbers > low if above else numbers >= low)
    if not good.all():
        first = numbers[~good].flat[0]
        raise InvalidInput(f'{name} = {first:.12g} {unit} is not allowed: {need}')
    return numbers[()]


def number(
    name: str,
    value: float,
    unit: str,
    low: float = 0.0,
    high: float = math.inf,
    above: bool = False,
) -> float:
    """Return one :func:`quantity`, refusing arrays."""
    checked = quantity(name, value, unit, low, high, above)
    if np.ndim(checked):
        raise InvalidInput(f'{name} = {value!r} is not allowed: one number is needed')
    return float(checked)


def choice(name: str, value: str, allowed: tuple[str, ...]) -> str:
    """Return a word once it is known to be one of those allowed."""
    if value not in allowed:
        raise InvalidInput(
            f'{name} = {value!r} is not allowed: one of {", ".join(allowed)} is needed'
        )
    return value


@dataclass(frozen=True)
class MeasuredLimit:
    """A line through the force limits that were measured on a pad.

    Parameters
    ----------
    force : float
        Normal force on one pad, N, that it carries at ``pressure``.
    pressure : float
        Gauge pressure, Pa, above 0.
    slope : float
        How the limit rises with pressure, N/Pa, above 0.

    Raises
    ------
    InvalidInput
        When a value is not finite or outside its range.
    """

    force: float
    pressure: float
    slope: float

    def __post_init__(self) -> None:
        number('force', self.force, 'N')
        number('pressure', self.pressure, 'Pa', above=True)
        number('slope', self.slope, 'N/Pa', above=True)


@dataclass(frozen=True)
class Pad:
    """One round pad, clamped at its rim: flat at zero gauge pressure, a dome when inflated.

    Parameters
    ----------
    radius : float
        Radius of the flat pad, m, above 0.
    stiffness : float
        Tension stiffness of the membrane, N/m, above 0. 40 N/m (Dragon Skin 10) belongs to the
        thesis' pressure law alone: another law of the same membrane has another constant.
    adhesion_energy : float
        Work of adhesion between pad and floor, J/m², 0 or more.
    measured_limit : MeasuredLimit, optional
        Force limits measured on this very pad. By default those of the thesis' large pad, in
        proportion to the area.

    Raises
    ------
    InvalidInput
        When a value is not finite or outside its range.
    """

    radius: float
    stiffness: float
    adhesion_energy: float = 0.006
    measured_limit: MeasuredLimit | None = None

    def __post_init__(self) -> None:
        number('radius', self.radius, 'm', above=True)
        number('stiffness', self.stiffness, 'N/m', above=True)
        number('adhesion_energy', self.adhesion_energy, 'J/m²')
        if not isinstance(self.measured_limit, MeasuredLimit | None):
            raise InvalidInput(
                f'measured_limit = {self.measured_limit!r} is not allowed: a MeasuredLimit or None'
                ' is needed'
            )

    def __str__(self) -> str:
        return f'a pad of radius {self.radius:g} m and stiffness {self.stiffness:g} N/m'


LARGE_PAD = Pad(radius=1.5e-3, stiffness=40.0)
SMALL_PAD = Pad(radius=0.5e-3, stiffness=40.0)
