# SPDX-License-Identifier: Apache-2.0
"""A silicone pad: size and material, and helpers for scalar and array results."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import instance, number
from ros_pad.contact.material import Material
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
        With a material it is shear modulus times thickness, and only a unit.
    adhesion_energy : float
        Work of adhesion between pad and floor, J/m², from 0.
    measured_limit : MeasuredLimit, optional
        Force limits measured on this pad.
    material : Material, optional
        Law of the rubber: the pad is then an exact membrane without adhesion. Such pads are made
        by :meth:`Pad.of`.
    thickness : float, optional
        Thickness of the flat pad, m, up to the radius; needed with a material. Without one it is
        used in the force limit alone, see :mod:`ros_pad.contact.limits`.

    Raises
    ------
    InvalidInput
        When a value is not finite or outside its range.
    """

    radius: float
    stiffness: float
    adhesion_energy: float = 0.006
    measured_limit: MeasuredLimit | None = None
    material: Material | None = None
    thickness: float | None = None

    def __post_init__(self) -> None:
        number('radius', self.radius, 'm', above=True)
        number('stiffness', self.stiffness, 'N/m', above=True)
        number('adhesion_energy', self.adhesion_energy, 'J/m²')
        instance('measured_limit', self.measured_limit, MeasuredLimit, type(None))
        instance('material', self.material, Material, type(None))
        if self.thickness is not None:
            # A disc as thick as it is wide is no membrane.
            number('thickness', self.thickness, 'm', 0.0, self.radius, above=True)
        if self.material is not None:
            number('thickness', self.thickness or math.nan, 'm with a material', above=True)
            unit = self.material.shear_modulus * (self.thickness or 0.0)
            low, high = unit * (1.0 - 1e-9), unit * (1.0 + 1e-9)
            number('stiffness', self.stiffness, 'N/m with this material (see Pad.of)', low, high)

    @classmethod
    def of(
        cls,
        material: Material,
        radius: float,
        thickness: float,
        measured_limit: MeasuredLimit | None = None,
    ) -> Pad:
        """Return a pad of a material.

        Parameters
        ----------
        material : Material
            Law of the rubber.
        radius : float
            Radius of the flat pad, m, above 0.
        thickness : float
            Thickness of the flat pad, m, above 0 up to the radius.
        measured_limit : MeasuredLimit, optional
            Force limits measured on this pad.

        Returns
        -------
        Pad
            Its stiffness is shear modulus times thickness, N/m.

        Raises
        ------
        InvalidInput
            When a value is not finite or outside its range, or ``material`` is no `Material`.

        Examples
        --------
        >>> from ros_pad.contact import Material, Pad, inflate
        >>> pad = Pad.of(Material.load('dragon_skin_10'), radius=2e-3, thickness=0.4e-3)
        >>> round(pad.stiffness, 2), round(1e3 * inflate(pad, 20e3).height, 3)  # N/m, mm
        (21.01, 1.611)
        """
        instance('material', material, Material)
        stiffness = material.shear_modulus * number('thickness', thickness, 'm', above=True)
        return cls(radius, stiffness, 0.0, measured_limit, material, thickness)

    def __str__(self) -> str:
        if self.material is not None:
            made = f'thickness = {self.thickness:g} m of {self.material}'
            return f'a pad with radius = {self.radius:g} m and {made}'
        return f'a pad with radius = {self.radius:g} m and stiffness = {self.stiffness:g} N/m'


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
    return Pad.of(material, pad.radius, thickness, pad.measured_limit)


def need_stiffness(what: str, pad: Pad) -> None:
    """Raise `InvalidInput` for a pad of a material where the law of the thesis is computed."""
    instance('pad', pad, Pad)
    if pad.material is not None:
        raise InvalidInput(f'{what} needs a pad with a measured stiffness, and not {pad}')


DOME_PRESSURE = 1000.0
"""Gauge pressure above which a pad counts as a dome, Pa; below it, it is flat."""

LARGE_PAD = Pad(radius=1.5e-3, stiffness=40.0, thickness=0.4e-3)
"""The large pad of the thesis, of Dragon Skin 10."""

SMALL_PAD = Pad(radius=0.5e-3, stiffness=7.0, thickness=0.2e-3)
"""The small pad of the thesis, of Ecoflex: its stiffness is no measurement, but that of the large
pad by modulus times thickness, 40 * (8 psi/22 psi) * (0.2 mm/0.4 mm) = 7 N/m, with the makers'
moduli at 100 % (Ecoflex 00-10, Dragon Skin 10)."""
