# SPDX-License-Identifier: Apache-2.0
"""Belief about the ground below one foot: wet or dry, and its friction coefficient.

A Bayes filter on {dry, wet} x a grid of friction coefficients. A foot that sticks at T/N only
says that friction is larger (censored evidence); a foot that slips shows it, or what its turning
leaves of it. Whether it sticks is itself uncertain, so each sample is a mixture of both, weighed
by the slip speed. Ground changes with the way that the foot steps or slides, not with time: a foot
that stands still knows what it knows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special

from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import expected_friction

GRID = np.linspace(0.01, 1.59, 80)
_SQUARES = GRID * GRID
_UPPER_EDGES = GRID + 0.5 * (GRID[1] - GRID[0])
_ONES = np.ones_like(GRID)  # a product with it sums several times faster than sum(axis=1)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)

DEMAND = 0.3
"""Mean T/N that gaits ask for, taken to be exponential."""

SLIP_SPEED = 0.04
"""Most frequent speed v of slips, m/s; their density is taken to go as x exp(-x), x = speed / v.
It starts at zero, so that the noise of a foot at rest does not add up to slow slip."""

# The half-normal distribution in eight shares, finer in its tail, each by its middle.
_SHARES = np.array([0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.08, 0.02])
_HALF_NORMAL = math.sqrt(2.0) * special.erfinv(np.cumsum(_SHARES) - 0.5 * _SHARES)
MODEL_SHARE = 0.05
"""Share of friction by which what a slip shows is off, on the average over a walk: windows hold
some stick, and feet turn more or less than is believed."""


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
        return cls(*expected_friction(foot, load), spread=spread)

    def table(self, dome: bool) -> np.ndarray:
        """Probabilities on :data:`GRID` for dry and wet ground, shape (2, grid)."""
        means = (self.dome, self.dome) if dome else (self.flat_dry, self.flat_wet)
        rows = []
        for mean in means:
            spread = self.spread * mean + 0.03
            # Heavy tails: the foot may have met ground that nobody expected. They also keep wet or
            # dry from ever being certain.
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
        Over which friction under domes may change within a stance, s.
    temper : float
        Weight of a sample, in (0, 1]: successive samples are not independent.
    rim_speed : float
        Root mean square of the speed with which feet scrub as they turn about the vertical, m/s,
        0 or more: 2/3 of the sole's radius times the turning rate. A foot that slips at v while
        its rim scrubs at s shows only v/hypot(v, s) of its friction (elliptic limit surface, Howe
        and Cutkosky 1996); nobody measures s.
    model_error : float
        Standard deviation of what T/N shows of friction, > 0, besides :data:`MODEL_SHARE` of it.
        It is the same in every sample: no number of them averages it out.

    Attributes
    ----------
    prior : FrictionPrior
        As given.
    wet_probability : float
        0 to 1.
    scales : tuple of float
        What friction is at the load of the last sample on dry and on wet ground, over what it is
        at the load that the prior is for: the belief is about that one.
    told : float
        What this stance has added to the logarithm of the odds of wet ground: about zero where it
        said nothing.
    """

    def __init__(
        self,
        prior: FrictionPrior,
        wet_prior: float = 0.5,
        patch_length: float = 1.5,
        forgetting_time: float = 1.0,
        temper: float = 0.5,
        rim_speed: float = 0.0,
        model_error: float = 0.03,
    ) -> None:
        self.prior = prior
        self._tables = {dome: prior.table(dome) for dome in (False, True)}
        self._grounds = np.array([[1.0 - wet_prior], [wet_prior]])
        self._patch_length = patch_length
        self._forgetting_time = forgetting_time
        self._temper = temper
        self._rim_speeds = rim_speed * _HALF_NORMAL[:, None]
        error = np.hypot(model_error, MODEL_SHARE * GRID)
        blur = np.exp(-0.5 * ((GRID[:, None] - GRID) / error) ** 2)
        self._blur = blur / blur.sum(axis=0)
        self._dome = False
        self.scales = (1.0, 1.0)
        self.told = 0.0
        self._settle(self._grounds * self._tables[False])

    def touch_down(self, distance: float, dome: bool) -> None:
        """Begin a stance, some metres from the last one, flat or domed."""
        if dome != self._dome:
            # Friction of one shape says nothing of the other's; what stays is wet or dry.
            self._dome = dome
            self._belief = self._grounds_known() * self._tables[dome]
        self.scales = (1.0, 1.0)
        self.told = 0.0
        self.go(distance)

    def go(self, distance: float) -> None:
        """Fade towards the prior over some metres on which nothing is felt."""
        self._move(distance)
        self._settle(self._belief)

    @property
    def belief(self) -> tuple[np.ndarray, bool]:
        """All that is believed; set it to take back what has been learnt since."""
        return self._belief, self._dome

    @belief.setter
    def belief(self, belief: tuple[np.ndarray, bool]) -> None:
        grid, self._dome = belief
        self._settle(grid)

    def update(
        self,
        ratio: float,
        ratio_noise: float,
        speed: float,
        speed_noise: float,
        dt: float,
        weight: float = 1.0,
        turning_known: bool = False,
        scales: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """Take one sample of T/N and of slip speed.

        Parameters
        ----------
        ratio, ratio_noise : float
            T/N and its standard deviation, > 0.
        speed, speed_noise : float
            Slip speed, m/s, positive where the foot gives way, and its standard deviation, > 0.
        dt : float
            Time that the sample stands for, s.
        weight : float
            How much of it is new, 0 to 1.
        turning_known : bool
            Whether T/N has in it what turning takes up, so that nothing of that is left to guess.
        scales : tuple of float
            See the attribute.
        """
        self.scales = scales
        friction = np.multiply.outer(scales, GRID)
        away = (friction - ratio) / ratio_noise
        stick = math.exp(-0.5 * (speed / speed_noise) ** 2) / (_ROOT_2_PI * speed_noise)
        swift = max(speed, 0.0) / SLIP_SPEED
        slip = swift * math.exp(-swift) / SLIP_SPEED
        # Stick: T/N is what the gait demands, and μ is above it. Slip: more is demanded than μ,
        # and T/N shows as much of μ as turning leaves.
        likelihood = (stick * math.exp(-ratio / DEMAND) / DEMAND) * special.ndtr(away)
        if slip > 0.0:
            if turning_known:
                likely = np.exp(-0.5 * away * away)
            else:
                shown = speed / np.hypot(speed, self._rim_speeds)
                away = (shown * friction[:, None] - ratio) / ratio_noise
                likely = _SHARES @ np.exp(-0.5 * away * away)
            unmet = np.exp(friction / -DEMAND)  # share of demands that friction does not meet
            likelihood += slip / (_ROOT_2_PI * ratio_noise) * unmet * likely
        before = self.wet_probability
        self._belief = self._belief * (likelihood + 1e-6) ** (weight * self._temper)
        self._belief /= self._belief.sum()
        dry, wet = (self._belief @ _ONES).tolist()
        self.told += math.log(wet / dry) - math.log(before / (1.0 - before))
        if speed > 0.0:
            self._move(speed * dt)
        if self._dome:
            # The film under domes drains as they stand: their friction rises on the same ground.
            keep = math.exp(-dt / self._forgetting_time)
            self._belief = keep * self._belief + (1.0 - keep) * (
                self._grounds_known() * self._tables[True]
            )
        self._settle(self._belief)

    def _move(self, distance: float) -> None:
        """Go some metres: perhaps onto other ground, of which nothing is known."""
        stay = math.exp(-distance / self._patch_length)
        table = self._tables[self._dome]
        if self._dome:
            # Grounds that feel alike must not be told apart by when each was last thought of.
            grounds = stay * self._grounds_known() + (1.0 - stay) * self._grounds
            friction = self._belief[0] + self._belief[1]
            self._belief = grounds * (stay * friction + (1.0 - stay) * table[0])
        else:
            self._belief = stay * self._belief + (1.0 - stay) * (self._grounds * table)

    def _grounds_known(self) -> np.ndarray:
        return self._belief.sum(axis=1, keepdims=True)

    def _settle(self, belief: np.ndarray) -> None:
        # Moving on squares the rounding of the sum: a foot that bounces a hundred times would be
        # left without a belief.
        self._belief = belief = belief / belief.sum()
        dry, wet = (belief @ _ONES).tolist()
        self.wet_probability = wet / (dry + wet)
        self._known = belief @ self._blur.T / (dry + wet)

    @property
    def friction(self) -> tuple[float, float]:
        """Mean and standard deviation of friction at the load of the last sample."""
        scales = np.array(self.scales)
        mean = float(scales @ (self._known @ GRID))
        square = float(scales * scales @ (self._known @ _SQUARES))
        return mean, math.sqrt(max(square - mean * mean, 0.0))

    def quantile(self, share: float) -> float:
        """Friction coefficient that is larger with probability 1 - share, share in [0, 1]."""
        dry, wet = self.scales
        edges = dry * _UPPER_EDGES
        on_dry, on_wet = np.cumsum(self._known, axis=1)
        below = on_dry + np.interp(edges, wet * _UPPER_EDGES, on_wet, left=0.0)
        return float(np.interp(share, below, edges))
