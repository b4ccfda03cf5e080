# SPDX-License-Identifier: Apache-2.0
"""Belief about the ground below one foot: wet or dry, and its friction coefficient.

A Bayes filter on {dry, wet} x a grid of friction coefficients. A foot that sticks at T/N only
says that friction is larger (censored evidence); a foot that slips shows it. Whether it sticks is
itself uncertain, so each sample is a mixture of both, weighed by the slip speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import tangential_resistance

GRID = np.linspace(0.01, 1.59, 80)
_SQUARES = GRID * GRID
_ONES = np.ones_like(GRID)  # a product with it sums several times faster than sum(axis=1)
_THICK_FILM = 1.0e-3  # m: does not drain within a stance under a flat sole


@dataclass(frozen=True)
class FrictionPrior:
    """What friction is expected of a foot before it is felt, for each ground and shape.

    Attributes
    ----------
    flat_dry, flat_wet, dome : float
        Expected coefficients. A dome has one: wet and dry ground feel the same to it.
    spread : float
        Relative standard deviation of each.
    """

    flat_dry: float
    flat_wet: float
    dome: float
    spread: float = 0.2

    @classmethod
    def of(cls, foot: Foot, load: float, spread: float = 0.2) -> FrictionPrior:
        """Return the contact model's friction of a foot at a load, N."""
        pressure = 0.85 * foot.ceiling
        return cls(
            flat_dry=float(tangential_resistance(foot, load, 0.0)) / load,
            flat_wet=float(tangential_resistance(foot, load, 0.0, sole_film=_THICK_FILM)) / load,
            dome=float(tangential_resistance(foot, load, pressure)) / load,
            spread=spread,
        )

    def table(self, dome: bool) -> np.ndarray:
        """Probabilities on :data:`GRID` for dry and wet ground, shape (2, grid)."""
        means = (self.dome, self.dome) if dome else (self.flat_dry, self.flat_wet)
        rows = []
        for mean in means:
            spread = self.spread * mean + 0.03
            # Heavy tails: the foot may have met ground that nobody expected.
            row = np.exp(-0.5 * ((GRID - mean) / spread) ** 2) / spread + 0.01
            rows.append(row / row.sum())
        return np.array(rows)


class GroundFilter:
    """Belief over dry and wet ground and friction, for one foot.

    Parameters
    ----------
    prior : FrictionPrior
        Expected friction.
    wet_prior : float
        Probability of wet ground where nothing is known, in (0, 1).
    patch_length : float
        Way over which wet and dry ground typically change, m.
    forgetting_time : float
        Over which friction may change within a stance, s.
    temper : float
        Weight of a sample, in (0, 1]: successive samples are not independent.
    """

    def __init__(
        self,
        prior: FrictionPrior,
        wet_prior: float = 0.5,
        patch_length: float = 1.5,
        forgetting_time: float = 1.0,
        temper: float = 0.8,
    ) -> None:
        self._tables = {False: prior.table(dome=False), True: prior.table(dome=True)}
        self._wet_prior = wet_prior
        self._patch_length = patch_length
        self._forgetting_time = forgetting_time
        self._temper = temper
        self._friction = self._tables[False].copy()  # p(μ | ground)
        self._table = self._tables[False]
        self.wet_probability = wet_prior
        self._marginalise()

    def touch_down(self, distance: float, dome: bool) -> None:
        """Begin a stance, some metres from the last one, flat or domed."""
        change = 1.0 - math.exp(-distance / self._patch_length)
        self.wet_probability += change * (self._wet_prior - self.wet_probability)
        table = self._tables[dome]
        # Friction learnt on this kind of ground with this shape is worth as much as the ground
        # is still the same; with another shape it says nothing.
        keep = (1.0 - change) if table is self._table else 0.0
        self._friction = keep * self._friction + (1.0 - keep) * table
        self._table = table
        self._marginalise()

    def update(
        self, ratio: float, ratio_noise: float, speed: float, speed_noise: float, dt: float
    ) -> None:
        """Take one sample of T/N and of slip speed, m/s, with their standard deviations."""
        away = (GRID - ratio) / ratio_noise
        stick = math.exp(-0.5 * (speed / speed_noise) ** 2) / (2.5066 * speed_noise)
        slip = math.exp(-speed / 0.1) / 0.1 if speed > 0.0 else 0.0
        # Stick: any demand below μ, spread over the range of T/N. Slip: T/N is μ.
        likelihood = stick * special.ndtr(away) / GRID[-1]
        likelihood += slip / (2.5066 * ratio_noise) * np.exp(-0.5 * away * away)
        likelihood = (likelihood + 1e-6) ** self._temper
        joint = self._friction * likelihood
        evidence = joint @ _ONES
        dry, wet = (1.0 - self.wet_probability) * evidence[0], self.wet_probability * evidence[1]
        # Never certain: one sample in a thousand comes from ground that has just changed.
        self.wet_probability = 0.001 + 0.998 * float(wet / (dry + wet))
        forget = 1.0 - math.exp(-dt / self._forgetting_time)
        self._friction = (1.0 - forget) * joint / evidence[:, None] + forget * self._table
        self._marginalise()

    def _marginalise(self) -> None:
        wet = self.wet_probability
        self._marginal = (1.0 - wet) * self._friction[0] + wet * self._friction[1]

    @property
    def friction(self) -> tuple[float, float]:
        """Mean and standard deviation of the friction coefficient."""
        mean = float(self._marginal @ GRID)
        return mean, math.sqrt(max(float(self._marginal @ _SQUARES) - mean * mean, 0.0))

    def quantile(self, share: float) -> float:
        """Friction coefficient that is larger with probability 1 - share."""
        return float(GRID[np.searchsorted(np.cumsum(self._marginal), share)])
