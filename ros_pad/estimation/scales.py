# SPDX-License-Identifier: Apache-2.0
"""Friction of a robot's feet on its floor, learnt over a walk: what all feet share.

The contact model expects a friction coefficient for each class: flat on dry ground, flat on wet
ground, dome. On the floor at hand each is wrong by a *scale* that all feet share, and differs from
place to place by a *spread*, so that ln μ = ln(expected) + ln(scale) + N(0, spread). Scale and
spread have a posterior on a grid for each class. At the end of each stance it is multiplied by the
probability of what the foot felt, and the friction expected of the next stances is the mean over
it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import special

from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import expected_friction

EDGES = np.geomspace(0.025, 2.5, 97)
GRID = np.sqrt(EDGES[:-1] * EDGES[1:])
"""Friction coefficients of the filter, each for a cell of 5 %, and the edges of the cells."""

CLASSES = ('flat_dry', 'flat_wet', 'dome')

SCALE_SPREAD = 0.4
"""Prior standard deviation of the logarithm of a scale: factors of 0.5 to 2 are no surprise."""

SPREADS = np.array([0.03, 0.06, 0.12, 0.24])
"""Standard deviations of ln μ from place to place that are considered, equally likely."""

SPREAD_P=(1,1,1,1)
LOG_SCALES = np.linspace(-1.2, 1.2, 49)

TAIL = 0.01
"""Probability of friction that has nothing to do with the class, uniform in ln μ: unexpected ground
stays possible, and wet or dry never become certain."""

UNDRAINED = 0.3

PERIOD = 0.5
"""Time between updates of what the feet share, s: it does not depend on which sample of two feet
arrives first."""

DELAY = 0.1
"""Age of the evidence that an update uses, s."""


@dataclass(frozen=True)
class FrictionPrior:
    """Expected friction of a foot before it is measured, for each ground and morphology.

    Attributes
    ----------
    flat_dry, flat_wet, dome : float
        Expected coefficients of friction. One is enough for a dome, whose friction is about the
        same on wet and dry ground.
    """

    flat_dry: float
    flat_wet: float
    dome: float

    @classmethod
    def of(cls, foot: Foot, load: float) -> FrictionPrior:
        """Return the friction that the contact model predicts for a foot at a load, N."""
        return cls(*expected_friction(foot, load))


class Felt(NamedTuple):
    """What a foot felt in a stance.

    Attributes
    ----------
    time : float
        Time of the end, s.
    foot : int
        Number of the foot.
    dome : bool
        Whether the foot was a dome.
    wet : float
        Probability of wet ground before the stance.
    likelihood : array (2, grid)
        Logarithm of the likelihood of friction on dry and on wet ground.
    weight : float
        Share of the stance that is new evidence, 0 to 1.
    """

    time: float
    foot: int
    dome: bool
    wet: float
    likelihood: np.ndarray
    weight: float


class FrictionScales:
    def __init__(self, prior: FrictionPrior, spread: float = SCALE_SPREAD, learns: bool = True):
        self.prior = prior
        self.learns = learns
        self._feet = 0
        means = (prior.flat_dry, prior.flat_wet, prior.dome)
        scale = np.exp(-0.5 * (LOG_SCALES / spread) ** 2)
        ps=np.array(SPREAD_P); weights = np.multiply.outer(scale / scale.sum(), ps/ps.sum())
        self._weights = np.tile(weights.ravel(), (3, 1))
        at = (np.log(EDGES) - np.log(means)[:, None, None, None] - LOG_SCALES[:, None, None]) / SPREADS[:, None]
        below = special.ndtr(at)
        mass = np.diff(below, axis=-1) + TAIL / len(GRID)
        mass /= mass.sum(axis=-1, keepdims=True)
        self._cells = mass.reshape(3, -1, len(GRID))
        low, high = sorted((prior.flat_wet, prior.dome))
        undrained = ((GRID >= low) & (GRID <= high)) + 1e-3
        self._undrained = undrained / undrained.sum()
        self._felt: list[Felt] = []
        self._epoch = -math.inf
        self._now = self._before = self._expected()

    def join(self) -> int:
        self._feet += 1
        return self._feet - 1

    def _expected(self) -> np.ndarray:
        dry, wet, dome = np.einsum('ck,ckg->cg', self._weights, self._cells)
        return np.array([dry, wet, dome, (1.0 - UNDRAINED) * dome + UNDRAINED * self._undrained])

    def expected(self, time: float) -> np.ndarray:
        epoch = math.floor(time / PERIOD)
        if epoch != self._epoch and not self._epoch - 2 < epoch < self._epoch:
            self._absorb(epoch * PERIOD - DELAY if epoch > self._epoch else math.inf)
            self._before = self._now
            self._now = self._expected()
            self._epoch = epoch
        return self._now if epoch == self._epoch else self._before

    def add(self, felt: Felt) -> None:
        if self.learns:
            self._felt.append(felt)

    def _absorb(self, until: float) -> None:
        self._felt.sort(key=lambda each: each[:2])
        while self._felt and self._felt[0].time < until:
            self._learn(self._felt.pop(0))

    def _learn(self, felt: Felt) -> None:
        likelihood = np.exp(felt.likelihood - felt.likelihood.max())
        if felt.dome:
            slow = felt.wet * UNDRAINED
            drained = self._cells[2].dot(likelihood[0])
            self._multiply(2, (1.0 - slow) * drained + slow * self._undrained.dot(likelihood[1]), felt.weight)
            return
        on_dry, on_wet = (self._cells[i].dot(likelihood[i]) for i in (0, 1))
        dry, wet = 1.0 - felt.wet, felt.wet
        mean_dry, mean_wet = self._weights[0].dot(on_dry), self._weights[1].dot(on_wet)
        self._multiply(0, dry * on_dry + wet * mean_wet, felt.weight)
        self._multiply(1, wet * on_wet + dry * mean_dry, felt.weight)

    def _multiply(self, index: int, likelihood: np.ndarray, weight: float) -> None:
        weights = self._weights[index] * (likelihood / likelihood.max()) ** weight
        self._weights[index] = weights / weights.sum()

    def scale(self, index):
        w=self._weights[index].reshape(len(LOG_SCALES),-1)
        p=w.sum(1); m=p@LOG_SCALES; s=math.sqrt(p@(LOG_SCALES-m)**2)
        return m,s,float(w.sum(0)@SPREADS)
