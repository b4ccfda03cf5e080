# SPDX-License-Identifier: Apache-2.0
"""Estimate of the ground below one foot: wet or dry, and its friction coefficient.

The estimate is a Bayes filter on {dry, wet} x a grid of friction coefficients. A foot that sticks
at T/N shows only that friction is larger (censored evidence). A foot that slips shows the friction
itself, less the part that turning uses. Whether a foot sticks is uncertain, so the likelihood of
each sample is a mixture of stick and slip, weighted by the slip speed. Ground changes with the
distance that the foot steps or slides, not with time: the estimate of a foot that stands still
does not fade. What is expected of new ground is learnt by all feet together, see
:mod:`ros_pad.estimation.scales`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from scipy import special

from ros_pad.estimation.scales import EDGES
from ros_pad.estimation.scales import GRID
from ros_pad.estimation.scales import Felt
from ros_pad.estimation.scales import FrictionPrior
from ros_pad.estimation.scales import FrictionScales
from ros_pad.estimation.tuning import Tuning

_SQUARES = GRID * GRID
# Products by dot take half the time of those by @; one with ones, a fraction of that of a sum.
_ONES = np.ones_like(GRID)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)

Posterior: TypeAlias = tuple[np.ndarray, bool]
"""Joint probabilities of ground (dry, wet) and friction, shape (2, grid), and whether the friction
is that of a dome.
"""

DEMAND = 0.3
"""Mean T/N that gaits demand; its distribution is assumed exponential."""

SLIP_SPEED = 0.04
"""Most frequent slip speed v, m/s; the density is assumed proportional to x exp(-x), x = speed /
v. This density is zero at zero speed, so that the noise of a foot at rest does not count as slip.
"""

# The half-normal distribution in eight parts, finer in its tail, each represented by its middle.
_SHARES = np.array([0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.08, 0.02])
_HALF_NORMAL = math.sqrt(2.0) * special.erfinv(np.cumsum(_SHARES) - 0.5 * _SHARES)

SLOWEST = 0.1
"""Least weight of a slip as evidence of friction. Slips much slower than feet turn show friction
only by the speed at which they turn, which is not known and the same all through a stance."""

DRAINING_TIME = 0.05
"""Time in which the film under a dome drains at the start of a stance, s: in walks, friction is
four fifths of that on dry ground after 0.05 to 0.1 s."""

CREEP, CREEP_SPEED, LEAST_PULL = 0.01, 0.025, 0.04
"""Share of the windows of a sticking foot in which it rolls or bends, the mean of its speed then
over T/N, m/s, and what is added to T/N; the density is assumed exponential. Without creep, ground
that holds more than any gait demands would be taken for ground that slips at that demand."""

MODEL_ERROR = 0.01
MODEL_SQUARE = 0.08
"""Error of friction measured in slip, mean over a walk: the first, and the second times the square
of friction. A window may contain some stick, and feet turn more or less than assumed; the more
they hold, the slower they slip, and the more turning hides."""


class GroundFilter:
    """Posterior of wet ground and friction for one foot.

    Parameters
    ----------
    shared : FrictionScales
        Expected friction, which the foot learns together with others.
    wet_prior : float
        Prior probability of wet ground, in (0, 1).
    patch_length : float
        Distance over which wet and dry ground are assumed to change, m, above 0.
    temper : float
        Weight of a sample, in (0, 1]: successive samples are not independent.
    rim_speed : float
        Root mean square of the speed with which feet scrub as they turn about the vertical, m/s,
        0 or more: 2/3 of the sole's radius times the turning rate. A foot that slips at v while
        its rim scrubs at s shows only v/hypot(v, s) of its friction (elliptic limit surface, Howe
        and Cutkosky 1996); s is not measured.
    model_error : float
        Standard deviation of T/N as a measure of friction, > 0, in addition to
        :data:`MODEL_SQUARE` times its square. It is the same in every sample: averaging does not
        reduce it.

    Attributes
    ----------
    shared : FrictionScales
        As given.
    prior : FrictionPrior
        Friction by the contact model.
    expected : FrictionPrior
        Friction of new ground, median, by what the feet have learnt up to this stance.
    wet_probability : float
        Probability of wet ground, 0 to 1.
    scales : tuple of float
        Friction at the load of the last sample over that at the load of the prior, on dry and on
        wet ground. The posterior refers to the load of the prior.
    log_odds : float
        Change of the log odds of wet ground by this stance: about zero if it gave no evidence.
    """

    def __init__(
        self,
        shared: FrictionScales,
        wet_prior: float = Tuning.wet_prior,
        patch_length: float = Tuning.patch_length,
        temper: float = 0.5,
        rim_speed: float = 0.0,
        model_error: float = MODEL_ERROR,
    ) -> None:
        self.prior = shared.prior
        self.shared, self._foot = shared, shared.join()
        self._grounds = np.array([[1.0 - wet_prior], [wet_prior]])
        self._patch_length = patch_length
        self._temper = temper
        self._rim_speed = rim_speed
        self._rim_speeds = rim_speed * _HALF_NORMAL[:, None]
        error = np.hypot(model_error, MODEL_SQUARE * _SQUARES)
        blur = np.exp(-0.5 * ((GRID[:, None] - GRID) / error) ** 2) * np.diff(EDGES)[:, None]
        self._blur = blur / blur.sum(axis=0)
        self._cumulated = np.zeros((2, len(EDGES)))
        self._dome = False
        self.scales = (1.0, 1.0)
        self.log_odds = 0.0
        self._travelled = 0.0  # of the foot so far, m
        self._counted = {False: -math.inf, True: -math.inf}  # at the last evidence, by morphology
        self._expect(0.0)
        self._posterior: np.ndarray = self._flat_prior
        self.wet_probability = wet_prior
        self._normalise(self._flat_prior)
        self._begin()

    def _expect(self, time: float) -> None:
        """Expect what the feet have learnt up to a time, s."""
        expected = self.shared.expected(time)
        self._flat_prior = self._grounds * expected[:2]
        self._priors = {False: expected[:2], True: expected[2:4]}
        medians = [float(np.interp(0.5, np.cumsum(row), EDGES[1:])) for row in expected[:3]]
        self.expected = FrictionPrior(*medians)
        self._undrained = expected[4]

    def _begin(self) -> None:
        """Begin to collect evidence of a stance."""
        self._felt = np.zeros_like(self._posterior)
        self._has_felt = False
        self._wet_before = self.wet_probability

    def touch_down(self, distance: float, dome: bool, time: float = 0.0) -> None:
        """Begin a stance at a distance, m, from the last one, as a dome or flat, at a time, s."""
        if self._has_felt:
            # Stances on the same patch are no new evidence of what all patches have in common.
            since = self._travelled - self._counted[self._dome]
            self._counted[self._dome] = self._travelled
            weight = -math.expm1(-since / self._patch_length)
            self.shared.add(
                Felt(time, self._foot, self._dome, self._wet_before, self._felt, weight)
            )
        self._expect(time)
        if dome != self._dome:
            # The friction of one morphology gives no evidence of the friction of the other: keep
            # only the probability of wet ground.
            self._dome = dome
            self._posterior = self._wet_or_dry() * self._priors[dome]
        self.scales = (1.0, 1.0)
        self.log_odds = 0.0
        self.fade(distance)
        if dome:
            self._posterior[1] = self._undrained * self.wet_probability
            self._normalise(self._posterior)
        self._begin()

    def fade(self, distance: float) -> None:
        """Fade towards the prior over a distance, m, without measurements."""
        self._move(distance)
        self._normalise(self._posterior)

    def forget(self, time: float) -> None:
        """Return to the prior, and take back what the foot has shown to others, at a time, s."""
        self.shared.forget(self._foot)
        self._expect(time)
        self._counted = {False: -math.inf, True: -math.inf}
        self._normalise(self._grounds * self._priors[self._dome])
        self._begin()

    @property
    def posterior(self) -> Posterior:
        """What is known of the ground; set it to an earlier one to undo the samples since then."""
        return self._posterior, self._dome

    @posterior.setter
    def posterior(self, posterior: Posterior) -> None:
        grid, self._dome = posterior
        self._normalise(grid)
        self._begin()

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
        """Process one sample of T/N and of slip speed.

        Parameters
        ----------
        ratio, ratio_noise : float
            T/N and its standard deviation, > 0.
        speed, speed_noise : float
            Slip speed, m/s, positive where the foot gives way, and its standard deviation, > 0.
        dt : float
            Duration that the sample represents, s.
        weight : float
            Share of the sample that is new evidence, 0 to 1.
        turning_known : bool
            Whether T/N includes the friction used by turning; if not, that part is estimated from
            `rim_speed`.
        scales : tuple of float
            New value of the attribute.
        """
        self.scales = scales
        friction = np.multiply.outer(scales, GRID)
        away = (friction - ratio) / ratio_noise
        stick = math.exp(-0.5 * (speed / speed_noise) ** 2) / (_ROOT_2_PI * speed_noise)
        swift = max(speed, 0.0) / SLIP_SPEED
        slip = swift * math.exp(-swift) / SLIP_SPEED
        # Stick or creep: T/N is the gait's demand, and μ is above it. Slip: the demand is above μ,
        # and T/N is μ less the part used by turning.
        rest = stick
        if speed > 0.0:
            creep = CREEP_SPEED * (ratio + LEAST_PULL)
            rest += CREEP * math.exp(-speed / creep) / creep
        likelihood = (rest * math.exp(-ratio / DEMAND) / DEMAND) * special.ndtr(away)
        if slip > 0.0:
            if not turning_known:
                left = speed / np.hypot(speed, self._rim_speeds)
                away = (left * friction[:, None] - ratio) / ratio_noise
            likely = np.exp(-0.5 * away * away)
            if not turning_known:
                likely = _SHARES @ likely
            unmet = np.exp(friction / -DEMAND)  # share of demands that friction does not meet
            likelihood += slip / (_ROOT_2_PI * ratio_noise) * unmet * likely
        before = self.wet_probability
        shown = 1.0
        if slip > 0.0 and not turning_known and self._rim_speed > 0.0:
            slid = slip / (slip + stick)
            share = speed * speed / (speed * speed + self._rim_speed**2)
            shown -= slid * (1.0 - max(SLOWEST, share))
        self._multiply(np.log(likelihood + 1e-6) * (weight * self._temper), shown)
        self._posterior /= self._posterior.sum()
        dry, wet = self._posterior.dot(_ONES).tolist()
        self.log_odds += math.log(wet / dry) - math.log(before / (1.0 - before))
        if speed > 0.0:
            self._move(speed * dt)
        if self._dome:
            # The film under domes drains during a stance, so friction rises on the same ground.
            keep = math.exp(-dt / DRAINING_TIME)
            wet = self._posterior[1].dot(_ONES)
            self._posterior[1] *= keep
            self._posterior[1] += (1.0 - keep) * wet * self._priors[True][1]
            self._felt[1] *= keep
        self._normalise(self._posterior)

    def _multiply(self, evidence: np.ndarray, shown: float) -> None:
        """Multiply by a likelihood, given as logarithm; a share of it shows friction.

        The rest shows only whether the ground is wet, or nothing under a dome.
        """
        if self._dome:
            grounds = self._posterior.dot(_ONES)
        elif shown < 1.0:
            grounds = (self._posterior * np.exp(evidence)).dot(_ONES)
        evidence *= shown
        after = self._posterior * np.exp(evidence)
        if self._dome or shown < 1.0:
            rest = (grounds / after.dot(_ONES))[:, None]
            after *= rest
            if not self._dome:
                evidence += np.log(rest)
        self._felt += evidence
        self._has_felt = True
        self._posterior = after

    def _move(self, distance: float) -> None:
        """Move by a distance, m: new ground, if it is reached, has the prior's probabilities."""
        self._travelled += distance
        stay = math.exp(-distance / self._patch_length)
        if self._dome:
            # Under domes the ground is unobservable: when friction fades, the probability of wet
            # ground must not change.
            before = self._wet_or_dry()
            grounds = stay * before + (1.0 - stay) * self._grounds
            friction = self._posterior / before
            self._posterior = grounds * (stay * friction + (1.0 - stay) * self._priors[True])
        else:
            self._posterior = stay * self._posterior + (1.0 - stay) * self._flat_prior

    def _wet_or_dry(self) -> np.ndarray:
        return self._posterior.sum(axis=1, keepdims=True)

    def _normalise(self, posterior: np.ndarray) -> None:
        # Without normalisation rounding errors would grow: after a hundred touch-downs the sum
        # would be zero.
        self._posterior = posterior = posterior / posterior.sum()
        dry, wet = posterior.dot(_ONES).tolist()
        self.wet_probability = wet / (dry + wet)
        self._blurred = posterior.dot(self._blur.T)
        self._blurred /= dry + wet

    @property
    def friction(self) -> tuple[float, float]:
        """Mean and standard deviation of friction at the load of the last sample."""
        scales = np.array(self.scales)
        mean = float(scales.dot(self._blurred.dot(GRID)))
        square = float((scales * scales).dot(self._blurred.dot(_SQUARES)))
        return mean, math.sqrt(max(square - mean * mean, 0.0))

    def quantile(self, share: float) -> float:
        """Return the friction coefficient that is exceeded with probability 1 - share.

        The share is from 0 to 1; the coefficient is that at the load of the last sample.
        """
        return float(self.quantiles([share])[0])

    def quantiles(self, shares: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the same for several shares."""
        dry, wet = self.scales
        edges = dry * EDGES
        on_dry, on_wet = self._cumulated
        np.add.accumulate(self._blurred, axis=1, out=self._cumulated[:, 1:])
        below = on_dry + np.interp(edges, wet * EDGES, on_wet)
        found: np.ndarray = np.interp(np.asarray(shares), below, edges)
        return found
