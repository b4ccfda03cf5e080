# SPDX-License-Identifier: Apache-2.0
"""Drainage of the liquid film under a pad, and how much dry contact it leaves.

A disc of radius a, pressed with pressure p on a film of thickness h and viscosity η, obeys the
Stefan-Reynolds equation dh/dt = -2 p h³ / (3 η a²). In 1/h² it is linear, d(1/h²)/dt =
4 p / (3 η a²), so that is the state that :class:`Film` keeps: its steps are exact.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ros_pad.contact.pad import number
from ros_pad.contact.pad import quantity
from ros_pad.errors import InvalidInput

if TYPE_CHECKING:
    from ros_pad.contact.resistance import Foot

WATER_VISCOSITY = 1.0e-3  # Pa s, at 20 degC


def film_thickness(
    initial: ArrayLike,
    contact_pressure: ArrayLike,
    patch_radius: ArrayLike,
    time: ArrayLike,
    viscosity: float = WATER_VISCOSITY,
) -> np.ndarray | float:
    """Film thickness in metres left under a disc after a time of squeezing.

    Parameters
    ----------
    initial : array_like
        Thickness at time zero, m, > 0.
    contact_pressure : array_like
        Mean pressure under the disc, Pa, >= 0.
    patch_radius : array_like
        Radius of the disc, m, > 0.
    time : array_like
        Duration of the squeeze, s, >= 0.
    viscosity : float
        Dynamic viscosity, Pa s, > 0.

    Returns
    -------
    float or ndarray
        h(t) = [1/h0² + 4 p t/(3 η a²)]^-1/2, broadcast over the inputs.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of its range.
    """
    start = quantity('initial', initial, 'm', above=True)
    pressure = quantity('contact_pressure', contact_pressure, 'Pa')
    radius = quantity('patch_radius', patch_radius, 'm', above=True)
    duration = quantity('time', time, 's')
    eta = quantity('viscosity', viscosity, 'Pa s', above=True)
    try:
        drained = 4.0 * pressure * duration / (3.0 * eta * radius**2)
        result = start / np.sqrt(1.0 + drained * start**2)
    except ValueError as error:
        raise InvalidInput('initial, pressure, radius and time do not broadcast') from error
    return float(result) if np.ndim(result) == 0 else result


class Film:
    """The liquid under one foot through one stance: under its domes and under its flat sole.

    The film is squeezed out as the foot stands; it is taken to travel with the foot when the foot
    slips (no new liquid is dragged in), see docs/assumptions.md. Domes touch on more ground as
    their load grows, and what is new under them has not drained yet: 1/h² is then averaged over
    the area. So a foot that is put down softly gains nothing from the moment when it is light.

    Parameters
    ----------
    foot : Foot
        The foot that presses.
    viscosity : float
        Dynamic viscosity of the liquid, Pa s.
    """

    __slots__ = (
        '_area', '_dome_area', '_dome_rate', '_dome_state', '_fresh', '_sole_rate', '_sole_state',
    )  # fmt: skip

    def __init__(self, foot: Foot, viscosity: float = WATER_VISCOSITY) -> None:
        number('viscosity', viscosity, 'Pa s', above=True)
        # Domes: p acts on b² = A/(n π) each, A = N/p, hence d(1/h²)/dt = 4 π n p / (3 η A).
        self._dome_rate = 4.0 * math.pi * foot.pads / (3.0 * viscosity)
        self._sole_rate = 4.0 / (3.0 * viscosity * foot.sole_radius**2)
        self._area = foot.sole_area
        self._dome_area = 0.0
        self._dome_state = self._sole_state = self._fresh = math.inf

    def touch_down(self, thickness: float) -> None:
        """Start a stance on a film of this thickness, m; zero means dry ground."""
        self._fresh = thickness**-2 if thickness > 0.0 else math.inf
        self._dome_state = self._sole_state = self._fresh
        self._dome_area = 0.0

    def drain(self, dome_load: float, sole_load: float, pressure: float, duration: float) -> None:
        """Squeeze for a duration, s, with the loads, N, that domes and flat sole carry."""
        if dome_load > 0.0:
            area = dome_load / pressure
            if area > self._dome_area and self._fresh < math.inf:
                old = self._dome_area / area
                self._dome_state = self._fresh + old * (self._dome_state - self._fresh)
            self._dome_area = area
            self._dome_state += self._dome_rate * pressure / area * duration
        else:
            self._dome_area = 0.0
        if sole_load > 0.0:
            self._sole_state += self._sole_rate * sole_load / self._area * duration

    @property
    def under_domes(self) -> float:
        """Film thickness under the domes, m."""
        return self._dome_state**-0.5

    @property
    def under_sole(self) -> float:
        """Film thickness under the flat part of the sole, m."""
        return self._sole_state**-0.5
