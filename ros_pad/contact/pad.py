# SPDX-License-Identifier: Apache-2.0
"""A silicone pad: size and material, and helpers for scalar and array results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import number
from ros_pad.errors import InvalidInput

Array: TypeAlias = npt.NDArray[np.float64]
# A float for scalar input, an array for array input; NumPy has no type for this.
Floats: TypeAlias = Any


def plain(value: Floats) -> Floats:
    """Return a scalar as float, an array unchanged."""
    return float(value) if np.ndim(value) == 0 else value


def broadcast(names: str, *values: Floats) -> tuple[Floats, ...]:
    """Return values in their common shape; raise `InvalidInput` with the names if there is none.

    Scalars come back as NumPy scalars.
    """
    try:
        return tuple(each[()] for each in np.broadcast_arrays(*values))
    except ValueError as error:
        shapes = ', '.join(str(np.shape(each)) for each in values)
        raise InvalidInput(f'{names} of shapes {shapes} do not broadcast') from error


@dataclass(frozen=True)
class MeasuredLimit:
    """A straight line through measured force limits of a pad.

    Parameters
    ----------
    force : float
        Largest normal force on one pad at ``pressure``, N, from 0.
    pressure : float
        Gauge pressure, Pa, above 0.
    slope : float
        Slope of the limit over pressure, N/Pa, above 0.

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
        Tension stiffness of the membrane, N/m, above 0. 40 N/m (Dragon Skin 10) is valid for the
        pressure law of the thesis only: another law needs another constant for the same membrane.
    adhesion_energy : float
        Work of adhesion between pad and floor, J/m², from 0.
    measured_limit : MeasuredLimit, optional
        Force limits measured on this pad. By default those of the thesis' large pad, in
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
        return f'a pad with radius = {self.radius:g} m and stiffness = {self.stiffness:g} N/m'


DOME_PRESSURE = 1000.0
"""Gauge pressure above which a pad counts as a dome, Pa; below it, it is flat."""

LARGE_PAD = Pad(radius=1.5e-3, stiffness=40.0)
SMALL_PAD = Pad(radius=0.5e-3, stiffness=40.0)
