# SPDX-License-Identifier: Apache-2.0
"""Drainage of the liquid film under a pad.

A rigid disc of radius a, pressed with pressure p on a film of thickness h and viscosity η, follows
the Stefan-Reynolds equation dh/dt = -2 p h³ / (3 η a²). In 1/h² it is linear, d(1/h²)/dt =
4 p / (3 η a²), so time steps are exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ros_pad.configuration import number, quantity
from ros_pad.contact import laws
from ros_pad.contact.pad import broadcast, plain

if TYPE_CHECKING:
    from ros_pad.contact.resistance import Foot

WATER_VISCOSITY = 1.0e-3  # Pa s, at 20 degC

LANDING = 7e-3
"""Time in which half of the load of a foot comes, s. Domes are then as dry, 0.82, as those of the
hexapod on L2, 0.82 to 0.84 in the mean; those of the quadruped are 0.67 dry."""


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


def landed(since: float, time: float) -> float:
    """Return the share of the load of a foot that has come after its touch-down.

    Half of it lands, the rest comes evenly until ``time``; both in s.
    """
    if since < LANDING:
        return 0.5 * max(since, 0.0) / LANDING
    return min(1.0, 0.5 + 0.5 * (since - LANDING) / max(time - LANDING, LANDING))


class Film:
    """The liquid film under one foot during one stance: under its domes and under its flat sole.

    The film drains while the foot stands. The flat sole is a rigid disc, whose film moves with it
    when it slips (docs/assumptions.md). Under a dome, a contact that grows lays the thicker a film
    the faster it grows, the rim of a contact that rests levels it from the edge inwards, and slip
    drags in a film of its own: how much of a dome is dry follows from how its load has come
    (:mod:`ros_pad.contact.laws`).

    Parameters
    ----------
    foot : Foot
        The foot that stands on the film.
    viscosity : float
        Dynamic viscosity of the liquid, Pa s, above 0.

    Attributes
    ----------
    spheres : list of float
        Radius of the free dome, m, in the steps of pressure of :attr:`Foot.limits`.
    cell : float
        Area of a cell of a dome's contact, m².
    sole_drain : float
        Factor of the growth of 1/h² under the sole, 1/(Pa s m²).

    Raises
    ------
    InvalidInput
        When the viscosity is not finite or not above 0.

    Examples
    --------
    >>> from ros_pad.contact import Film, Foot
    >>> film = Film(Foot.load('large19'))
    >>> film.touch_down(0.3e-3)
    >>> for step in range(1, 301):  # the load comes in 10 ms
    ...     load = 2.0 * min(1.0, step / 10)
    ...     domes, sole = film.drain(load, sole_load=0.0, pressure=75e3, duration=1e-3)
    >>> f'{1e6 * domes:.2f} and {1e6 * sole:.0f} micrometres'
    '0.25 and 300 micrometres'
    """

    def __init__(self, foot: Foot, viscosity: float = WATER_VISCOSITY) -> None:
        self.viscosity = number('viscosity', viscosity, 'Pa s', above=True)
        self.pads, self.sole_area = foot.pads, foot.sole_area
        self.critical_film, self.film_exponent = foot.critical_film, foot.film_exponent
        self.limit_cell, self.spheres = foot.limit_cell, foot.spheres
        # Of the largest contact of a dome: below its force limit.
        areas = np.array(foot.limits[1:]) / (np.arange(1, len(foot.limits)) * foot.limit_cell)
        self.cell = float(areas.max()) / (foot.pads * laws.CELLS)
        self.sole_drain = 4.0 / (3.0 * viscosity * foot.sole_radius**2)
        self._state = [0.0] * (laws.FILM + laws.CELLS)

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
        laws.touch_down(self._state, number('thickness', thickness, 'm'))

    def drain(
        self,
        dome_load: float,
        sole_load: float,
        pressure: float,
        duration: float,
        slip: float = 0.0,
    ) -> tuple[float, float]:
        """Drain under the loads of domes and flat sole; for speed the input is not checked.

        Parameters
        ----------
        dome_load, sole_load : float
            Normal force on the domes and on the flat sole at the end, N, from 0; they change
            evenly from those before.
        pressure : float
            Gauge pressure in the pads, Pa; above 0 if the domes carry load.
        duration : float
            Time, s, from 0.
        slip : float
            Speed at which the foot slips, m/s, from 0.

        Returns
        -------
        tuple of float
            Thickness of the film under domes and flat sole, m: of an even film that leaves as much
            dry contact.
        """
        return laws.drained(self, self._state, dome_load, sole_load, pressure, duration, slip)

    def stand(
        self, dome_load: float, sole_load: float, pressure: float, time: float
    ) -> tuple[float, float]:
        """Stand for a time, s, as feet do: half of the load lands, the rest comes evenly.

        Parameters and result are those of :meth:`drain`; the loads are those at the end.
        """
        landing = min(LANDING, 0.5 * time)
        self.drain(0.5 * dome_load, 0.5 * sole_load, pressure, landing)
        # Under the sole a constant load drains as much as one that grows evenly from a half.
        return self.drain(dome_load, 0.75 * sole_load, pressure, time - landing)
