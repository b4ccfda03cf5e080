# SPDX-License-Identifier: Apache-2.0
"""Gaits by phase: when each leg of a robot with any number of legs stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice
from ros_pad.configuration import number
from ros_pad.configuration import quantity
from ros_pad.errors import InvalidInput
from ros_pad.robots.rotation import Array

GAITS = ('tripod', 'trot', 'wave', 'crawl', 'ripple')
"""Names of the gaits that :meth:`Gait.named` makes."""


@dataclass(frozen=True)
class Gait:
    """When each leg stands and swings.

    Attributes
    ----------
    period : float
        Duration of a gait cycle, s, 0.05 to 60.
    duty : float
        Share of the cycle in which a leg stands, 0.05 to 0.95.
    phases : tuple of float
        Share of the cycle at which each leg touches down, 0 to 1.
    lift : float
        Height of a foot in the middle of its swing, m, 0 to 1.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """

    period: float
    duty: float
    phases: tuple[float, ...]
    lift: float

    def __post_init__(self) -> None:
        number('period', self.period, 's', 0.05, 60.0)
        number('duty', self.duty, '(share)', 0.05, 0.95)
        quantity('phases', self.phases, '(share)', 0.0, 1.0)
        number('lift', self.lift, 'm', 0.0, 1.0)

    @classmethod
    def named(
        cls, name: str, hips: npt.ArrayLike, period: float, duty: float, lift: float
    ) -> Gait:
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
        period, duty, lift : float
            As for :class:`Gait`.

        Raises
        ------
        InvalidInput
            For another name, a number of legs that the gait is not for, or a duty with which more
            legs swing at once than the gait lets.
        """
        choice('gait', name, GAITS)
        places = np.asarray(hips, dtype=float)
        legs = len(places)
        if name in ('tripod', 'trot'):
            _check_legs(name, legs, (6, 8) if name == 'tripod' else (4,))
            # Neighbours round the body, counter-clockwise from the front.
            angles = np.arctan2(places[:, 1], places[:, 0]) % math.tau
            phases = 0.5 * (np.argsort(np.argsort(angles)) % 2)
        else:
            _check_legs(name, legs, (4,) if name == 'crawl' else range(3, 9))
            phases = _waves(places, apart=name == 'ripple')
            if name != 'ripple':
                number('duty', duty, f'(share) for a {name} of {legs} legs', 1.0 - 1.0 / legs)
        return cls(period, duty, tuple(phases.tolist()), lift)

    def phase(self, time: float) -> Array:
        """Return the time since each leg's last touch-down, (legs,), as a share of the cycle."""
        return np.asarray((time / self.period - np.array(self.phases)) % 1.0)

    def stands(self, time: float) -> npt.NDArray[np.bool_]:
        """Return whether each leg stands at a time, s."""
        return self.phase(time) < self.duty


def _check_legs(name: str, legs: int, allowed: Sequence[int]) -> None:
    if legs not in allowed:
        raise InvalidInput(
            f'gait = {name!r} is not allowed for {legs} legs: a {name} needs'
            f' {" or ".join(map(str, allowed))} legs'
        )


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
