# SPDX-License-Identifier: Apache-2.0
"""Drainage of the liquid film under a pad.

A disc of radius a, pressed with pressure p on a film of thickness h and viscosity η, follows the
Stefan-Reynolds equation dh/dt = -2 p h³ / (3 η a²). In 1/h² it is linear, d(1/h²)/dt =
4 p / (3 η a²). :class:`Film` stores 1/h², so its time steps are exact.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ros_pad.configuration import number, quantity
from ros_pad.contact.laws import drained
from ros_pad.contact.pad import broadcast, plain

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
    """Return the film thickness under a disc after a time under pressure, m.

    Parameters
    ----------
    initial : float or array
        Thickness at time zero, m, above 0.
    contact_pressure : float or array
        Mean pressure under the disc, Pa, from 0.
    patch_radius : float or array
        Radius of the disc, m, above 0.
    time : float or array
        Duration, s, from 0.
    viscosity : float
        Dynamic viscosity, Pa s, above 0.

    Returns
    -------
    float or array
        Thickness, m: h(t) = [1/h0² + 4 p t/(3 η a²)]^-1/2 (Stefan-Reynolds), broadcast over the
        inputs.

    Raises
    ------
    InvalidInput
        When a value is not finite or out of range, or shapes do not broadcast.

    Examples
    --------
    >>> from ros_pad.contact import film_thickness
    >>> round(1e6 * film_thickness(0.3e-3, 10e3, 10e-3, 0.3), 2)  # micrometres
    5.0
    """
    start = quantity('initial', initial, 'm', above=True)
    pressure = quantity('contact_pressure', contact_pressure, 'Pa')
    radius = quantity('patch_radius', patch_radius, 'm', above=True)
    duration = quantity('time', time, 's')
    eta = quantity('viscosity', viscosity, 'Pa s', above=True)
    names = 'initial, contact_pressure, patch_radius, time and viscosity'
    start, pressure, radius, duration, eta = broadcast(
        names, start, pressure, radius, duration, eta
    )
    drained = 4.0 * pressure * duration / (3.0 * eta * radius**2)
    return plain(start / np.sqrt(1.0 + drained * start**2))


class Film:
    """The liquid film under one foot during one stance: under its domes and under its flat sole.

    The film drains while the foot stands. When the foot slips, the film is assumed to move with
    it, without new liquid (docs/assumptions.md). The contact area of domes grows with their load,
    and the added area has not drained yet: 1/h² is averaged over the area. So a light load at
    touch-down does not drain the area that touches later.

    Parameters
    ----------
    foot : Foot
        The foot that stands on the film.
    viscosity : float
        Dynamic viscosity of the liquid, Pa s, above 0.

    Attributes
    ----------
    dome_drain, sole_drain : float
        Factors of the growth of 1/h² under domes and sole, 1/(Pa s) and 1/(Pa s m²).
    sole_area : float
        Area of the sole, m².

    Raises
    ------
    InvalidInput
        When the viscosity is not finite or not above 0.

    Examples
    --------
    >>> from ros_pad.contact import Film, Foot
    >>> film = Film(Foot.load('large19'))
    >>> film.touch_down(0.3e-3)
    >>> domes, sole = film.drain(dome_load=2.0, sole_load=0.0, pressure=75e3, duration=0.3)
    >>> f'{1e6 * domes:.3f} and {1e6 * sole:.0f} micrometres'
    '0.122 and 300 micrometres'
    """

    __slots__ = ('_fresh', '_state', 'dome_drain', 'sole_area', 'sole_drain')

    def __init__(self, foot: Foot, viscosity: float = WATER_VISCOSITY) -> None:
        number('viscosity', viscosity, 'Pa s', above=True)
        # Each of n domes has a disc of radius b, b² = A/(n π), with total area A = N/p, so
        # d(1/h²)/dt = 4 π n p / (3 η A).
        self.dome_drain = 4.0 * math.pi * foot.pads / (3.0 * viscosity)
        self.sole_drain = 4.0 / (3.0 * viscosity * foot.sole_radius**2)
        self.sole_area = foot.sole_area
        self._fresh = math.inf
        self._state = 0.0, math.inf, math.inf

    def touch_down(self, thickness: float) -> None:
        """Start a stance on a film.

        Parameters
        ----------
        thickness : float
            Thickness of the film, m, from 0, which is dry ground.

        Raises
        ------
        InvalidInput
            When the thickness is negative or not finite.
        """
        thickness = number('thickness', thickness, 'm')
        self._fresh = thickness**-2 if thickness > 0.0 else math.inf
        self._state = 0.0, self._fresh, self._fresh

    def drain(
        self, dome_load: float, sole_load: float, pressure: float, duration: float
    ) -> tuple[float, float]:
        """Drain under the loads of domes and flat sole; for speed the input is not checked.

        Parameters
        ----------
        dome_load, sole_load : float
            Normal force on the domes and on the flat sole, N, from 0.
        pressure : float
            Gauge pressure in the pads, Pa; above 0 if the domes carry load.
        duration : float
            Time, s, from 0.

        Returns
        -------
        tuple of float
            Thickness of the film under domes and flat sole, m.
        """
        self._state = drained(
            self, self._fresh, self._state, dome_load, sole_load, pressure, duration
        )
        return self._state[1] ** -0.5, self._state[2] ** -0.5
