# SPDX-License-Identifier: Apache-2.0
"""What all feet of a robot share about friction, learnt over a walk.

The contact model expects a coefficient of friction for each class: flat on dry ground, flat on wet
ground, dome. On the floor at hand each is wrong by a *scale*, which all feet share, and differs
from place to place by a *spread*: ln μ = ln(expected) + ln(scale) + N(0, spread). Scale and spread
of a class have a posterior on a grid. After each stance it is multiplied by the probability of
what the foot felt, whatever its friction was, and the friction that the feet expect of their next
stances is the mean over the posterior (a hierarchical prior).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from ros_pad.contact.resistance import ExpectedFriction

EDGES = np.geomspace(0.025, 2.5, 97)
GRID = np.sqrt(EDGES[:-1] * EDGES[1:])
"""Coefficients of friction, each for a cell between two of :data:`EDGES`, 5 % wide."""

CLASSES = ('flat_dry', 'flat_wet', 'dome')
"""Classes of friction; domes on wet ground share the scale of those on dry ground."""

LOG_SCALES = np.linspace(-1.2, 1.2, 49)
SPREADS = np.array([0.08, 0.16])
"""Grid of ln(scale), and of spreads, which are equally likely before a walk. What feet feel hardly
shows a spread: smaller ones would seem likely on floors that do not have them."""

SCALE_SD = 0.4
"""Standard deviation of ln(scale) before a walk: factors of 0.5 to 2 are no surprise."""

SCALE_RANGE = 0.3012, 3.3201
"""Range of a scale that may be expected: that of the grid."""

SCALE_SD_RANGE = 0.01, 1.0
"""Range of its standard deviation; the grid shows no smaller ones."""

NEXT_FLOOR = 0.1
"""Standard deviation of ln(scale) from one floor to the next, for what is kept for later walks."""

TAIL = 0.01
"""Probability of friction of another origin, equal for all cells: unexpected ground stays
possible, and wet or dry never become certain."""

UNDRAINED = 0.05
"""Probability that the film under a dome has not drained as the contact model has it, for example
in a fast slip. Its friction is then anywhere between that of a flat sole and that of a dome.
Otherwise it is the dry friction times any factor between the one just after landing and one."""

BEYOND = 0.1
"""Distance of ln(expected friction) from the grid from which on it is moved to the grid's end:
farther away the tail would be most of what is left. A foot may have no friction at all."""

PERIOD = 0.5
"""Time between updates, s. All stances that begin in a period expect the same friction, so that
results do not depend on which of two feet is read first."""

DELAY = 0.1
"""Least time between the end of a stance and its use for other feet, s, likewise."""


class Scale(NamedTuple):
    """Friction of a class over that of the contact model.

    Attributes
    ----------
    scale : float
        The factor, at the mean of its logarithm.
    sd : float
        Standard deviation of ln(scale).
    """

    scale: float = 1.0
    sd: float = SCALE_SD

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the scale with a probability of 0.95."""
        return self.scale * math.exp(-1.96 * self.sd), self.scale * math.exp(1.96 * self.sd)


class Felt(NamedTuple):
    """What a foot felt in a stance.

    Attributes
    ----------
    time : float
        Time at which the next stance began, s.
    foot : int
        Number of the foot, see :meth:`FrictionScales.join`.
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


class Expected:
    """Friction that feet expect of new ground, from its probabilities, shape (4, grid).

    Attributes
    ----------
    flat, dome : array (2, grid)
        Probabilities on dry and on wet ground.
    """

    def __init__(self, rows: np.ndarray) -> None:
        self.rows, self.flat, self.dome = rows, rows[:2], rows[2:]

    @cached_property
    def flat_wet(self) -> float:
        """Median for flat feet on wet ground."""
        return float(np.interp(0.5, np.cumsum(self.flat[1]), EDGES[1:]))


class FrictionScales:
    """Posterior of scale and spread of each class of friction, shared by the feet of a robot.

    Parameters
    ----------
    prior : ExpectedFriction
        Friction by the contact model.
    scales : mapping
        What is known of scales before the walk: a :class:`Scale` by class; a class that is left
        out has the default.
    learns : bool
        Whether anything is learnt.

    Attributes
    ----------
    prior : ExpectedFriction
        As given.
    """

    def __init__(
        self,
        prior: ExpectedFriction,
        scales: Mapping[str, Scale] | None = None,
        learns: bool = True,
    ) -> None:
        self.prior = prior
        self._learns = learns
        self._fed: list[np.ndarray] = []
        rows, tables = [], []
        for name in CLASSES:
            scale, sd = (scales or {}).get(name, Scale())
            row = np.exp(-0.5 * ((LOG_SCALES - math.log(scale)) / sd) ** 2)
            row = np.repeat(row, len(SPREADS))
            rows.append(row / row.sum())
            away = np.log(EDGES / max(getattr(prior, name), 1e-9)) - LOG_SCALES[:, None, None]
            first, last = away[..., :1], away[..., -1:]
            away = away - np.where(first > BEYOND, first, np.where(last < -BEYOND, last, 0.0))
            table = np.diff(special.ndtr(away / SPREADS[:, None]), axis=-1) + TAIL / len(GRID)
            tables.append((table / table.sum(axis=-1, keepdims=True)).reshape(-1, len(GRID)))
        self._before_walk, self._tables = np.array(rows), tables
        self._weights = self._before_walk
        ends = sorted((prior.flat_wet, prior.dome))
        between = np.digitize(GRID, ends) % 2
        if not between.any():
            between[np.abs(GRID - ends[0]).argmin()] = 1
        undrained = np.clip(between, 1e-3, 1.0)
        self._undrained = undrained / undrained.sum()
        landed = max(prior.landed, GRID[0]) / max(prior.dome, GRID[0])
        cells = max(0, round(-math.log(landed) / math.log(GRID[1] / GRID[0]))) + 1
        self._films = np.tri(len(GRID)).T - np.tri(len(GRID), k=-cells).T
        self._films /= self._films.sum(axis=0)
        self._felt: list[Felt] = []
        self._period = -math.inf
        self._now = self._expected()

    def join(self) -> int:
        """Return the number of one more foot."""
        self._fed.append(np.zeros_like(self._before_walk))
        return len(self._fed) - 1

    def forget(self, foot: int) -> None:
        """Take back all that a foot has felt, from its number: its sensors were wrong.

        Stances that begin later expect nothing that rests on it, also those of the same period:
        in it, results depend on which foot is read first.
        """
        self._felt = [felt for felt in self._felt if felt.foot != foot]
        self._fed[foot][:] = 0.0
        self._weigh()
        self._now = self._expected()

    @property
    def scales(self) -> dict[str, Scale]:
        """The present posterior of the scale of each class."""
        found = {}
        for name, weights in zip(CLASSES, self._weights, strict=True):
            shares = weights.reshape(len(LOG_SCALES), -1).sum(axis=1)
            mean = float(shares.dot(LOG_SCALES))
            sd = math.sqrt(float(shares.dot((LOG_SCALES - mean) ** 2)))
            found[name] = Scale(math.exp(mean), sd)
        return found

    def expected(self, time: float) -> Expected:
        """Return what feet expect of a stance that begins at a time, s."""
        period = math.floor(time / PERIOD)
        if period > self._period:
            self._update(-math.inf, period * PERIOD - DELAY)
        elif period < self._period:  # the clock has been set back: what is later is old
            self._update(time, math.inf)
        self._period = period
        return self._now

    def add(self, felt: Felt) -> None:
        """Add what a foot felt in a stance."""
        if self._learns:
            self._felt.append(felt)

    def _expected(self) -> Expected:
        dry, wet, dome = (
            weights.dot(table) for weights, table in zip(self._weights, self._tables, strict=True)
        )
        on_wet = (1.0 - UNDRAINED) * self._films.dot(dome) + UNDRAINED * self._undrained
        return Expected(np.array([dry, wet, dome, on_wet]))

    def _update(self, begin: float, end: float) -> None:
        """Use the stances between two times, s, sorted: feet may be read in any order."""
        felt, self._felt = self._felt, []
        for each in sorted(felt, key=lambda felt: felt[:2]):
            if begin < each.time < end:
                self._learn(each)
            else:
                self._felt.append(each)
        self._now = self._expected()

    def _learn(self, felt: Felt) -> None:
        # What a dome feels does not show the ground: both keep their odds.
        most = felt.likelihood.max(axis=1 if felt.dome else None, keepdims=True)
        on_dry, on_wet = np.exp(felt.likelihood - most)
        dry, wet = 1.0 - felt.wet, felt.wet
        if felt.dome:
            dries = self._tables[2].dot(on_dry)
            wets = (1.0 - UNDRAINED) * self._tables[2].dot(on_wet.dot(self._films))
            wets += UNDRAINED * self._undrained.dot(on_wet)
            if_dry, if_wet = self._weights[2].dot(dries), self._weights[2].dot(wets)
            self._multiply(felt, 2, dry * dries / if_dry + wet * wets / if_wet)
            return
        # The ground is uncertain: what the scale of one class explains, the other need not.
        dries, wets = self._tables[0].dot(on_dry), self._tables[1].dot(on_wet)
        if_dry, if_wet = self._weights[0].dot(dries), self._weights[1].dot(wets)
        self._multiply(felt, 0, dry * dries + wet * if_wet)
        self._multiply(felt, 1, wet * wets + dry * if_dry)

    def _multiply(self, felt: Felt, index: int, likelihood: np.ndarray) -> None:
        self._fed[felt.foot][index] += felt.weight * np.log(likelihood / likelihood.max())
        self._weigh()

    def _weigh(self) -> None:
        felt = np.sum(self._fed, axis=0)
        weights = self._before_walk * np.exp(felt - felt.max(axis=1, keepdims=True))
        self._weights = weights / weights.sum(axis=1, keepdims=True)
