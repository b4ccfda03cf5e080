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
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from ros_pad.configuration import instance, number
from ros_pad.contact.resistance import Foot, expected_friction
from ros_pad.estimation.scales import EDGES, GRID, Felt, FrictionScales
from ros_pad.estimation.tuning import Tuning

# Products by dot take half the time of those by @; one with ones, a fraction of that of a sum.
_ONES = np.ones_like(GRID)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)

DEMAND = 0.3
"""Mean T/N that gaits demand; its distribution is assumed exponential."""

SLIP_SPEED = 0.04
"""Most frequent slip speed v, m/s; the density is assumed proportional to x exp(-x), x = speed /
v. This density is zero at zero speed, so that the noise of a foot at rest does not count as slip.
"""

# The speed at which feet turn over its median, the square of a normal number, in eight parts, each
# represented by its middle: feet of one robot hardly turn, those of another do all the time.
_SHARES = np.array([0.15, 0.15, 0.15, 0.15, 0.15, 0.15, 0.08, 0.02])
_TURNING = (special.erfinv(np.cumsum(_SHARES) - 0.5 * _SHARES) / special.erfinv(0.5)) ** 2

SLOWEST = 0.2
"""Least weight of a slip as evidence of friction. Slips much slower than feet turn show friction
only by the speed at which they turn, which is not known and the same all through a stance."""

CREEP, CREEP_SPEED, LEAST_PULL = 0.01, 0.025, 0.04
"""Share of the windows of a sticking foot in which it rolls or bends, the mean of its speed then
over T/N, m/s, and what is added to T/N; the density is assumed exponential. Without creep, ground
that holds more than any gait demands would be taken for ground that slips at that demand."""

MODEL_ERROR = 0.01
"""Error of friction measured in slip, mean over a walk: a window may contain some stick."""


class Evidence(NamedTuple):
    """Means of the samples of a foot over a time.

    Attributes
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
        the rim speed.
    scales : tuple of float
        Friction at the load of the sample over that at the load of the prior, on dry and on wet
        ground.
    """

    ratio: float
    ratio_noise: float
    speed: float
    speed_noise: float
    dt: float
    weight: float = 1.0
    turning_known: bool = False
    scales: tuple[float, float] = (1.0, 1.0)

    def factors(self, rim_speed: float) -> tuple[float, float, float]:
        """Return how likely stick and slip are at this speed, and what of it shows friction.

        The first is the density of the speed, and of T/N as a demand, where the foot sticks or
        creeps; the second that of the speed where it slips, both in s/m. The last is the share of
        the evidence that shows friction, the rest shows only wet or dry.
        """
        speed, noise = self.speed, self.speed_noise
        stick = math.exp(-0.5 * (speed / noise) ** 2) / (_ROOT_2_PI * noise)
        demand = math.exp(-self.ratio / DEMAND) / DEMAND
        if not speed > 0.0:
            return stick * demand, 0.0, 1.0
        creep = CREEP_SPEED * (self.ratio + LEAST_PULL)
        rest = stick + CREEP * math.exp(-speed / creep) / creep
        slip = speed / SLIP_SPEED * math.exp(-speed / SLIP_SPEED) / SLIP_SPEED
        shown = 1.0
        if rim_speed > 0.0 and not self.turning_known:
            share = speed * speed / (speed * speed + rim_speed**2)
            shown -= slip / (slip + stick) * (1.0 - max(SLOWEST, share))
        return rest * demand, slip, shown


class GroundModel:
    """What is assumed of the ground below all feet.

    Parameters
    ----------
    shared : FrictionScales
        Expected friction, which the feet learn together.
    wet_prior : float
        Prior probability of wet ground, in (0, 1).
    patch_length : float
        Distance over which wet and dry ground are assumed to change, m, above 0.
    rim_speed : float
        Median of the speed with which feet scrub as they turn about the vertical, m/s, 0 or more:
        2/3 of the sole's radius times the turning rate. A foot that slips at v while
        its rim scrubs at s shows only v/hypot(v, s) of its friction (elliptic limit surface, Howe
        and Cutkosky 1996); s is not measured.
    """

    def __init__(
        self,
        shared: FrictionScales,
        wet_prior: float = Tuning.wet_prior,
        patch_length: float = Tuning.patch_length,
        rim_speed: float = 0.0,
    ) -> None:
        self.shared = shared
        self.grounds = np.array([[1.0 - wet_prior], [wet_prior]])
        self.patch_length, self.rim_speed = patch_length, rim_speed
        self._rim_speeds = rim_speed * _TURNING[:, None]
        away = (GRID[:, None] - GRID) / MODEL_ERROR
        blur = np.exp(-0.5 * away * away) * np.diff(EDGES)[:, None]
        blur = (blur / blur.sum(axis=0)).T
        # From a posterior to sums of the blurred one up to each edge, and to its moments.
        self.summary = np.column_stack((
            np.zeros_like(GRID), blur.cumsum(axis=1), blur.dot(GRID), blur.dot(GRID * GRID),
        ))  # fmt: skip

    @classmethod
    def of(cls, foot: Foot, expected_load: float, tuning: Tuning) -> GroundModel:
        """Return the model of feet with this load, N, and tuning, for all feet of a robot.

        Raises
        ------
        InvalidInput
            When the load is not a number above 0, or foot or tuning of another class.
        """
        instance('foot', foot, Foot)
        instance('tuning', tuning, Tuning)
        number('expected_load', expected_load, 'N', above=True)
        prior = expected_friction(foot, expected_load)
        return cls(
            FrictionScales(prior, tuning.scales, tuning.learn_friction),
            tuning.wet_prior,
            tuning.patch_length,
            foot.turning_radius * tuning.turning_rate,
        )

    def likelihood(self, sample: Evidence, rest: float, slip: float) -> np.ndarray:
        """Return the likelihood of a sample, shape (2, grid), from its first two factors."""
        friction = np.array(sample.scales)[:, None] * GRID
        # Stick or creep: T/N is the gait's demand, and μ is above it. Slip: the demand is above μ,
        # and T/N is μ less the part used by turning.
        found = friction - sample.ratio
        found *= 1.0 / sample.ratio_noise
        special.ndtr(found, out=found)
        found *= rest
        if slip > 0.0:
            shown = self._shown(sample, friction)
            # The exponential is the share of demands that friction does not meet.
            friction *= -1.0 / DEMAND
            np.exp(friction, out=friction)
            friction *= shown
            friction *= slip / (_ROOT_2_PI * sample.ratio_noise)
            found += friction
        return found

    def _shown(self, sample: Evidence, friction: np.ndarray) -> np.ndarray:
        """Return the likelihood of T/N in a slip, mean over rim speeds, up to a factor."""
        if sample.turning_known:
            away = friction - sample.ratio
        else:
            left = sample.speed / np.hypot(sample.speed, self._rim_speeds)
            away = left * friction.reshape(-1)
            away -= sample.ratio
        away *= math.sqrt(0.5) / sample.ratio_noise
        away *= away
        np.negative(away, out=away)
        np.exp(away, out=away)
        found: np.ndarray = away if sample.turning_known else _SHARES.dot(away)
        return found.reshape(friction.shape)


class GroundFilter:
    """Posterior of wet ground and friction for one foot.

    Parameters
    ----------
    model : GroundModel
        What is assumed.

    Attributes
    ----------
    model : GroundModel
        As given.
    shared : FrictionScales
        Expected friction, which the foot learns together with others.
    expected : Expected
        Friction of new ground by what the feet have learnt up to this stance.
    posterior : array (2, grid)
        Joint probabilities of ground (dry, wet) and friction.
    wet_probability : float
        Probability of wet ground, 0 to 1.
    scales : tuple of float
        Friction at the load of the last sample over that at the load of the prior, on dry and on
        wet ground. The posterior refers to the load of the prior.
    log_odds : float
        Change of the log odds of wet ground by this stance: about zero if it gave no evidence.
    """

    def __init__(self, model: GroundModel) -> None:
        self.model, self.shared = model, model.shared
        self._foot = self.shared.join()
        self._dome = False
        self.scales = (1.0, 1.0)
        self.log_odds = 0.0
        self._travelled = 0.0  # of the foot so far, m
        self._counted = {False: -math.inf, True: -math.inf}  # at the last evidence, by morphology
        self.expected = self.shared.expected(0.0)
        self.wet_probability = 0.5
        self._normalise(self.model.grounds * self.expected.flat)
        self._begin()

    def _begin(self) -> None:
        """Begin to collect evidence of a stance."""
        self._felt: np.ndarray | None = None
        self._wet_before = self.wet_probability

    def touch_down(self, distance: float, dome: bool, time: float = 0.0) -> None:
        """Begin a stance at a distance, m, from the last one, as a dome or flat, at a time, s."""
        if self._felt is not None:
            # Stances on the same patch are no new evidence of what all patches have in common.
            since = self._travelled - self._counted[self._dome]
            self._counted[self._dome] = self._travelled
            weight = -math.expm1(-since / self.model.patch_length)
            self.shared.add(
                Felt(time, self._foot, self._dome, self._wet_before, self._felt, weight)
            )
        self.expected = self.shared.expected(time)
        if dome != self._dome:
            # The friction of one morphology gives no evidence of the friction of the other: keep
            # only the probability of wet ground.
            self._dome = dome
            self.posterior = self._wet_or_dry() * self._priors
        self.scales = (1.0, 1.0)
        self.log_odds = 0.0
        self.fade(distance)
        self._begin()

    @property
    def _priors(self) -> np.ndarray:
        return self.expected.dome if self._dome else self.expected.flat

    def fade(self, distance: float) -> None:
        """Fade towards the prior over a distance, m, without measurements."""
        self._move(distance)
        self._normalise(self.posterior)

    def forget(self, time: float) -> None:
        """Return to the prior, and take back what the foot has shown to others, at a time, s."""
        self.shared.forget(self._foot)
        self.expected = self.shared.expected(time)
        self._counted = {False: -math.inf, True: -math.inf}
        self.reset()

    def reset(self) -> None:
        """Return to the prior."""
        self._normalise(self.model.grounds * self._priors)
        self._begin()

    def update(self, sample: Evidence) -> None:
        """Process one sample of T/N and of slip speed."""
        self.scales = sample.scales
        rest, slip, shown = sample.factors(self.model.rim_speed)
        evidence = self.model.likelihood(sample, rest, slip)
        evidence += 1e-6
        np.log(evidence, out=evidence)
        evidence *= sample.weight
        self._multiply(evidence, shown)
        if sample.speed > 0.0:
            self._move(sample.speed * sample.dt)
        self._normalise(self.posterior)

    def _multiply(self, evidence: np.ndarray, shown: float) -> None:
        """Multiply by a likelihood, given as logarithm; a share of it shows friction.

        The rest shows only whether the ground is wet, or nothing under a dome.
        """
        after = np.exp(evidence)
        after *= self.posterior
        grounds = (self.posterior if self._dome else after).dot(_ONES)
        if self._dome or shown < 1.0:
            evidence *= shown
            np.exp(evidence, out=after)
            after *= self.posterior
            rest = (grounds / after.dot(_ONES))[:, None]
            after *= rest
            if not self._dome:
                evidence += np.log(rest)
        self._felt = evidence if self._felt is None else self._felt + evidence
        (dry, wet), before = grounds.tolist(), self.wet_probability
        self.log_odds += math.log(wet / dry) - math.log(before / (1.0 - before))
        after *= 1.0 / (dry + wet)
        self.posterior = after

    def _move(self, distance: float) -> None:
        """Move by a distance, m: new ground, if it is reached, has the prior's probabilities."""
        self._travelled += distance
        stay, grounds = math.exp(-distance / self.model.patch_length), self.model.grounds
        if self._dome:
            # Under domes the ground is unobservable: when friction fades, the probability of wet
            # ground must not change.
            before = self._wet_or_dry()
            friction = self.posterior / before
            friction = stay * friction + (1.0 - stay) * self.expected.dome
            self.posterior = (stay * before + (1.0 - stay) * grounds) * friction
        else:
            new = ((1.0 - stay) * grounds) * self.expected.flat
            new += stay * self.posterior
            self.posterior = new

    def _wet_or_dry(self) -> np.ndarray:
        return self.posterior.dot(_ONES)[:, None]

    def _normalise(self, posterior: np.ndarray) -> None:
        # Without normalisation rounding errors would grow: after a hundred touch-downs the sum
        # would be zero.
        dry, wet = posterior.dot(_ONES).tolist()
        self.posterior = posterior / (dry + wet)
        self.wet_probability = wet / (dry + wet)
        # Sums of the probabilities of friction on dry and on wet ground, and two moments.
        self._summary = self.posterior.dot(self.model.summary)

    @property
    def friction(self) -> tuple[float, float]:
        """Mean and standard deviation of friction at the load of the last sample."""
        (on_dry, dry_square), (on_wet, wet_square) = self._summary[:, -2:].tolist()
        dry, wet = self.scales
        mean = dry * on_dry + wet * on_wet
        square = dry * dry * dry_square + wet * wet * wet_square
        return mean, math.sqrt(max(square - mean * mean, 0.0))

    def quantile(self, shares: npt.ArrayLike) -> np.ndarray:
        """Return the friction coefficients that are exceeded with probability 1 - share.

        The shares are from 0 to 1; the coefficients are those at the load of the last sample.
        """
        dry, wet = self.scales
        edges = dry * EDGES
        on_dry, on_wet = self._summary[:, :-2]
        if dry != wet:
            on_wet = np.interp(edges, wet * EDGES, on_wet)
        return np.asarray(np.interp(np.asarray(shares), on_dry + on_wet, edges))
