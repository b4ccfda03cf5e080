# SPDX-License-Identifier: Apache-2.0
"""Plan probes of the ground: measure the loss of each morphology, and choose how often to probe.

Under domes wet and dry ground cannot be distinguished, so a robot on domes must set down a flat
foot from time to time to detect dry ground. The :class:`Planner` estimates cost and gain of such a
probe from the steps of the walk; :func:`probe_interval` computes the best distance between probes.
A *trial* in names of this module is a dome test: one step of all feet as domes on dry ground.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.configuration import number
from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import expected_friction
from ros_pad.control.footprints import Footprints

STAKE_PER_FRICTION = 0.25
"""Assumed gain of a difference of 1 in friction, share of a stride, until gains are measured.

The true gain is between 0, if both morphologies have more capacity than the gait demands, and 0.5,
if a robot with one of them does not advance at all.
"""

SHORTEST = 1e-6
"""Length of a stride, m, up to which a foot has not moved."""

LEAST_GAIN = 0.01
"""Gain of flat feet on dry ground, share of a stride, below which feet stay domes: the gain is not
worth the air of the switches.
"""

PREMIUM = 0.0025
"""Share of the distance that probes may cost where no probe is expected to pay. They detect that
the ground has changed.
"""

TRIAL_STRIDES = 300.0
"""Number of strides after which the measured loss of domes on dry ground is discarded."""

MEMORY = 20
"""Number of losses of a tripod that are kept for each kind of step."""

HINDSIGHT = 2
"""Number of strides after which a step is evaluated: by then, flat footprints may have shown the
ground under a dome."""


@dataclass(frozen=True)
class Stakes:
    """Gains and losses by morphology in one step of the body, as shares of the stride.

    Attributes
    ----------
    gain : float
        Gain on dry ground if all feet are flat instead of domes; below zero if domes have more
        capacity there.
    cost : float
        Loss on wet ground if all feet are flat instead of domes.
    probe_cost : float
        Loss on wet ground if one foot is flat among domes.

    Raises
    ------
    InvalidInput
        When a value is not finite, or a cost is below zero.
    """

    gain: float
    cost: float
    probe_cost: float

    def __post_init__(self) -> None:
        number('gain', self.gain, '(share of a stride)', low=-math.inf)
        number('cost', self.cost, '(share of a stride)')
        number('probe_cost', self.probe_cost, '(share of a stride)')

    @classmethod
    def expected(cls, foot: Foot, load: float) -> Stakes:
        """Return the values that the contact model of a foot predicts at a load, N."""
        flat_dry, flat_wet, dome = expected_friction(foot, load)
        cost = STAKE_PER_FRICTION * max(0.0, dome - flat_wet)
        return cls(STAKE_PER_FRICTION * (flat_dry - dome), cost, cost / 3.0)


@dataclass(frozen=True)
class Plan:
    """Plan for the next step of a foot that lifts off.

    Attributes
    ----------
    probe : bool
        Whether the foot should be flat for one step, to measure the ground.
    flat_pays : bool
        Whether flat feet gain distance on dry ground.
    trial : bool
        Whether this foot, flat on dry ground, should be a dome for one step of a dome test, which
        measures the loss of domes there.
    """

    probe: bool = False
    flat_pays: bool = True
    trial: bool = False


def probe_interval(stakes: Stakes, wet_share: float, fading_length: float, stride: float) -> float:
    """Return the distance between probes that maximises the gain, m.

    Wet and dry patches are a two-state Markov chain. At a distance d after wet ground, a probe
    finds dry ground with the probability p = (1 - q) (1 - exp(-d/ℓ)). Then all feet are flat for
    the rest of the dry patch, ℓ/q on average. They gain g in each of the two steps of a stride s,
    and lose c in the step onto the next wet patch. If the ground is wet, the probe costs c₁. After
    each probe the process starts anew, so the gain per metre is

        J(d) = [p (2 g ℓ/q - c s) - (1 - p) c₁ s] / (d + p ℓ/q).

    Parameters
    ----------
    stakes : Stakes
        g (``gain``), c (``cost``) and c₁ (``probe_cost``).
    wet_share : float
        Wet share q, above 0 up to 1.
    fading_length : float
        ℓ, m, above 0.
    stride : float
        Stride s, m, above 0.

    Returns
    -------
    float
        The distance with the greatest J, m. It is at least one stride, because the result of a
        probe is that late. It is at most the distance at which probes, each counted with at least
        :data:`LEAST_GAIN`, cost the share :data:`PREMIUM` of the distance. This upper bound is
        also the result if J is nowhere above zero.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.
    """
    number('wet_share', wet_share, '(probability)', high=1.0, above=True)
    number('fading_length', fading_length, 'm', above=True)
    number('stride', stride, 'm', above=True)
    # If domes have more capacity, a probe costs distance on dry ground, too. Even if probes have
    # cost nothing so far, they must not become more frequent: hence LEAST_GAIN.
    longest = max(stakes.probe_cost, -stakes.gain, LEAST_GAIN) * stride / PREMIUM
    ways = np.geomspace(stride, longest, 100)
    dry = fading_length / wet_share
    found = (1.0 - wet_share) * -np.expm1(-ways / fading_length)
    prize = 2.0 * stakes.gain * dry - stakes.cost * stride
    gain = (found * prize - (1.0 - found) * stakes.probe_cost * stride) / (ways + found * dry)
    best = int(np.argmax(gain))
    return float(ways[best]) if gain[best] > 0.0 else longest


class Step(NamedTuple):
    """A step that one foot has made.

    Attributes
    ----------
    landed, lifted : (float, float)
        Positions where the foot stood first and last, x and y, m.
    flat : bool
        Whether the foot was flat.
    probing : bool
        Whether the step was a probe or a dome test.
    wet : float
        Probability of wet ground that the foot has estimated, 0 to 1.
    """

    landed: tuple[float, float]
    lifted: tuple[float, float]
    flat: bool
    probing: bool
    wet: float


class _Judged(NamedTuple):
    """A step, with its stride and its loss, m."""

    step: Step
    lost: float
    stride: float


class Planner:
    """Measure losses of each morphology from the steps of a walk; plan probes and dome tests.

    The loss of a step is the distance that a standing foot slips backwards, against its swing.
    Feet that stand together slip together, so losses are means over the steps of a tripod. Losses
    depend on the towed load and on the place, so morphologies are compared within a few strides.
    The cost of a probe is the loss of its tripod minus that of the tripod's last step. The loss of
    domes on dry ground is measured where feet stay domes, or by a dome test: all feet are domes
    for one step in the middle of a dry patch.

    Parameters
    ----------
    expected : Stakes
        Values before anything has been measured.
    legs : sequence of int
        Numbers of the legs.

    Attributes
    ----------
    interval : float
        Present distance between probes, m; infinite before it is first computed.
    """

    def __init__(self, expected: Stakes, legs: Sequence[int]) -> None:
        self._expected = expected
        self._legs = tuple(legs)
        self._tripod = max(1, len(self._legs) // 2)
        self._lifted: dict[int, tuple[float, float]] = {}
        self._steps: deque[_Judged] = deque()
        self._before = [('', 0.0)] * 2  # kinds and losses of the last step of each tripod
        self._flat_dry: deque[float] = deque(maxlen=MEMORY)
        self._trials: deque[float] = deque(maxlen=MEMORY)
        self._probes: deque[float] = deque(maxlen=MEMORY)
        self._trying: set[int] = set()
        self._strides = 0.0
        self._tried = 0.0
        self._unmeasured = 0.0
        self.interval = math.inf

    @property
    def stakes(self) -> Stakes:
        """Measured gains and losses; expected values where nothing has been measured."""
        gain, cost, probe_cost = (
            self._expected.gain, self._expected.cost, self._expected.probe_cost,
        )  # fmt: skip
        if self._trials and self._flat_dry:
            gain = statistics.median(self._trials) - statistics.median(self._flat_dry)
        if self._probes:
            # The expected value has the weight of one probe. A probe cannot reduce slip.
            probe_cost = max(0.0, statistics.median([probe_cost, *self._probes]))
        return Stakes(gain, cost, probe_cost)

    def plan(self, leg: int) -> Plan:
        """Return the plan for a leg; call it after :meth:`step` of that leg."""
        trial = leg in self._trying
        self._trying.discard(leg)
        pays = self.stakes.gain > LEAST_GAIN or self._outdated
        return Plan(self._unmeasured >= self.interval, pays, trial)

    def step(self, leg: int, step: Step, ground: Footprints) -> None:
        """Add a step of a leg; if the foot was flat, add a footprint to ``ground``."""
        self._strides += 1.0 / len(self._legs)
        before = self._lifted.get(leg)
        self._lifted[leg] = step.lifted
        swing = math.dist(step.landed, before) if before else 0.0
        lost = 0.0
        if before and swing > 0.0:
            ahead = [(to - start) / swing for to, start in zip(step.landed, before, strict=True)]
            slid = [to - start for to, start in zip(step.lifted, step.landed, strict=True)]
            lost = -sum(map(float.__mul__, ahead, slid))
            self._unmeasured += max(0.0, swing - lost) / len(self._legs)
        if step.flat:
            ground.add(*step.lifted, step.wet, self._unmeasured)
            self._unmeasured = 0.0
        if not before or swing + lost <= SHORTEST:
            return
        self._steps.append(_Judged(step, lost, swing + lost))
        if len(self._steps) == HINDSIGHT * len(self._legs) + self._tripod:
            self._judge([self._steps.popleft() for _ in range(self._tripod)], ground)
            stride = statistics.fmean(each.stride for each in self._steps)
            self.interval = probe_interval(
                self.stakes, ground.wet_share, ground.fading_length, stride
            )
            self._try_domes()

    @property
    def _outdated(self) -> bool:
        return self._strides - self._tried > TRIAL_STRIDES

    def _try_domes(self) -> None:
        """Start a dome test if one is due, after some strides with all feet flat on dry ground."""
        if self._strides - self._tried <= 3 * HINDSIGHT:
            return  # the last dome test has not been evaluated yet
        if self._trials and not self._outdated:
            return
        if len(self._flat_dry) < HINDSIGHT or statistics.median(self._flat_dry) < LEAST_GAIN:
            return  # flat feet lose nothing that domes could save
        if all(each.step.flat and each.step.wet < 0.5 for each in self._steps):
            self._trying = set(self._legs)
            self._tried = self._strides
            self._trials.clear()

    def _judge(self, judged: Sequence[_Judged], ground: Footprints) -> None:
        """Evaluate the steps that the legs of a tripod made together."""
        steps = [each.step for each in judged]
        lost = sum(each.lost for each in judged) / sum(each.stride for each in judged)
        wet = [
            each.wet if each.flat else ground.wet_expected(*each.lifted) for each in steps
        ]  # fmt: skip
        flats = [each for each in steps if each.flat]
        kind = ''
        if not flats and min(wet) > 0.5:
            kind = 'dome on wet'
        elif not flats and max(wet) < 0.5:
            later = [each.step for each in self._steps]
            if all(each.probing for each in steps) or all(
                not each.flat and ground.wet_expected(*each.lifted) < 0.5 for each in later
            ):
                self._trials.append(lost)
        elif len(flats) == len(steps) and max(wet) < 0.5:
            self._flat_dry.append(lost)
        elif len(flats) == 1 and flats[0].probing and min(wet) > 0.5:
            kind_before, lost_before = self._before[0]
            if kind_before == 'dome on wet':
                self._probes.append(lost - lost_before)
        self._before = [self._before[1], (kind, lost)]
