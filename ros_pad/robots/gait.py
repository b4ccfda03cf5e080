# SPDX-License-Identifier: Apache-2.0
"""Gaits by phase: when each leg of a robot with any number of legs stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import Setting, Table, choice, number, quantity
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.robots.rotation import Array

_LEGS: dict[str, Sequence[int]] = {
    'tripod': (6, 8),
    'trot': (4,),
    'wave': range(3, 9),
    'crawl': (4,),
    'ripple': range(3, 9),
}

GAITS = tuple(_LEGS)
"""Names of the gaits that :meth:`Gait.named` makes."""

_RANGES = {'cycle': ('s', 0.05, 60.0), 'duty': ('(share)', 0.05, 0.95), 'lift': ('m', 0.0, 1.0)}


@dataclass(frozen=True)
class Gait:
    """When each leg stands and swings.

    Attributes
    ----------
    cycle : float
        Duration of a gait cycle, s, 0.05 to 60.
    duty : float
        Share of the cycle in which a leg stands, 0.05 to 0.95.
    phases : tuple of float
        Share of the cycle at which each leg touches down, 0 to 1.
    lift : float
        Height of a foot in the middle of its swing, m, 0 to 1.
    pushes : bool
        Whether the body speeds up and brakes twice a cycle, once for each of two groups of legs
        that stand in turn; otherwise its speed is constant.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    cycle: float
    duty: float
    phases: tuple[float, ...]
    lift: float
    pushes: bool = False

    def __post_init__(self) -> None:
        for name, allowed in _RANGES.items():
            number(name, getattr(self, name), *allowed)
        quantity('phases', self.phases, '(share)', 0.0, 1.0)
        if self.pushes and (sorted(set(self.phases)) != [0.0, 0.5] or self.duty <= 0.5):
            raise InvalidInput(
                'pushes = True is not allowed: two groups of legs half a cycle apart, with a duty'
                ' above 0.5, are needed'
            )

    @classmethod
    def named(cls, name: str, hips: npt.ArrayLike, cycle: float, duty: float, lift: float) -> Gait:
        """Return a gait for legs at these places.

        ``tripod`` and ``trot``: neighbours round the body stand in turn. ``wave`` and ``crawl``:
        one leg swings at a time, from rear to front, first left, then right. ``ripple``: so on
        each side, half a cycle apart.

        Parameters
        ----------
        name : str
            One of :data:`GAITS`.
        hips : array (legs, 2 or more)
            Places of the hips on the base, x fore and y left, m.
        cycle, duty, lift : float
            Duration of the cycle, s, share of stance, and lift, m, in the ranges of
            :class:`Gait`.

        Returns
        -------
        Gait
            The gait, with a phase for each leg.

        Raises
        ------
        InvalidInput
            For another name, a number of legs that the gait is not for, or a duty with which more
            legs swing at once than the gait lets.

        Examples
        --------
        >>> from ros_pad.robots import Gait, Robot
        >>> robot = Robot.load('ch3r')
        >>> gait = Gait.named('tripod', robot.hips, cycle=1.0, duty=0.55, lift=0.03)
        >>> gait.phases, gait.stands(0.6).tolist()
        ((0.0, 0.5, 0.0, 0.5, 0.0, 0.5), [False, True, False, True, False, True])
        """
        choice('gait', name, GAITS)
        places = quantity('hips', hips, 'm', -math.inf)
        if places.ndim != 2 or places.shape[1] < 2:
            raise InvalidInput(
                f'hips of shape {places.shape} is not allowed: a row for each leg, with x and y,'
                ' is needed'
            )
        legs, allowed = len(places), _LEGS[name]
        if legs not in allowed:
            raise InvalidInput(
                f'gait = {name!r} is not allowed for {legs} legs: a {name} needs'
                f' {" or ".join(map(str, allowed))} legs'
            )
        if name in ('tripod', 'trot'):
            # Neighbours round the body, counter-clockwise from the front.
            angles = np.arctan2(places[:, 1], places[:, 0]) % math.tau
            phases = 0.5 * (np.argsort(np.argsort(angles)) % 2)
        else:
            phases = _waves(places, apart=name == 'ripple')
            if name != 'ripple':
                number('duty', duty, f'(share) for a {name} of {legs} legs', 1.0 - 1.0 / legs)
        return cls(cycle, duty, tuple(phases.tolist()), lift)

    @classmethod
    def read(cls, table: Table, hips: npt.ArrayLike, usual: Gait | None = None) -> Gait:
        """Read a gait for legs at these places.

        Parameters
        ----------
        table : Table
            The mapping ``gait`` of a YAML file.
        hips : array (legs, 2 or more)
            Places of the hips on the base, x fore and y left, m.
        usual : Gait, optional
            Gait with what the table does not have.

        Returns
        -------
        Gait
            The gait.

        Raises
        ------
        ConfigError
            When a value is missing or not allowed.
        """
        if usual is None:
            cycle, duty, lift = (table.number(key, *each) for key, each in _RANGES.items())
        else:
            duty, lift = (
                table.number(key, *_RANGES[key], default=getattr(usual, key))
                for key in ('duty', 'lift')
            )
            # Legs swing as long as they usually do.
            cycle = usual.cycle * ((1.0 - usual.duty) / (1.0 - duty))
            cycle = table.number('cycle', *_RANGES['cycle'], default=cycle)
        pushes = False
        try:
            if usual and 'kind' not in table:
                phases, pushes = usual.phases, usual.pushes
            elif (kind := table.choice('kind', (*GAITS, 'own'))) == 'own':
                size = len(np.asarray(hips))
                phases = tuple(table.vector('phases', '(share)', size, 0.0, 1.0).tolist())
            else:
                phases = cls.named(kind, hips, cycle, duty, lift).phases
            pushes = table.value(Setting('pushes', bool, ''), pushes)
            return cls(cycle, duty, phases, lift, pushes)
        except InvalidInput as error:
            raise ConfigError(f'{table.origin}: {error}') from error

    def phase(self, time: float) -> Array:
        """Return the time since each leg's last touch-down.

        Parameters
        ----------
        time : float
            Time since the gait began, s.

        Returns
        -------
        array (legs,)
            Share of the cycle, 0 to 1.
        """
        return np.asarray((time / self.cycle - np.array(self.phases)) % 1.0)

    def stands(self, time: float) -> npt.NDArray[np.bool_]:
        """Return whether each leg stands.

        Parameters
        ----------
        time : float
            Time since the gait began, s.

        Returns
        -------
        array of bool (legs,)
            True in stance.
        """
        return self.phase(time) < self.duty


def _waves(places: Array, apart: bool) -> Array:
    """Return phases of waves that run from rear to front, left before right or beside it."""
    left = places[:, 1] > 0.0
    phases = np.zeros(len(places))
    for side, start in ((left, 0.0), (~left, 0.5)):
        order = np.argsort(places[side, 0])
        ranks = np.argsort(order)
        if apart:
            phases[side] = (start + ranks / max(side.sum(), 1)) % 1.0
        else:
            first = 0 if start == 0.0 else left.sum()
            phases[side] = (first + ranks) / len(places)
    return phases
