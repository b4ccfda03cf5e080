# SPDX-License-Identifier: Apache-2.0
"""When is it worth asking the ground: what shapes have cost, and how often to probe.

Under a dome wet and dry ground feel alike, so a robot on domes has to set down a flat foot now and
then to find out that the ground has become dry. The :class:`Planner` learns from the walk itself
what that costs and what it may bring; :func:`probe_interval` turns both into a way.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_pad.contact.pad import number
from ros_pad.contact.resistance import Foot
from ros_pad.contact.resistance import expected_friction
from ros_pad.control.footprints import Footprints

STAKE_PER_FRICTION = 0.25
"""Share of a stride that a difference of one in friction is taken to be worth, before it is known.

Between nothing, where the gait demands less than either shape holds, and half, where one shape
stands still.
"""

LEAST_GAIN = 0.01
"""Gain of flat feet on dry ground, share of a stride, below which it is worth no air."""

PREMIUM = 0.0025
"""Share of the way that is paid for probes where none seems to pay: the world may have changed."""

TRIAL_STRIDES = 300.0
"""Strides after which it is forgotten what domes lose on dry ground."""

MEMORY = 20
"""Steps of tripods of each kind that are remembered."""

HINDSIGHT = 2
"""Strides after which a step is judged: what was below a dome, later flat footprints show."""


@dataclass(frozen=True)
class Stakes:
    """What hangs on the shape of feet in one step of the body, as shares of the stride.

    Attributes
    ----------
    gain : float
        What is kept on dry ground if all feet are flat and not domes; below zero where domes hold
        better.
    cost : float
        What is lost on wet ground if all feet are flat and not domes.
    probe_cost : float
        What is lost on wet ground if one foot is flat among domes.

    Raises
    ------
    InvalidInput
        For what is not finite, or a cost below zero.
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
        """Return what the contact model of a foot lets expect at a load, N."""
        flat_dry, flat_wet, dome = expected_friction(foot, load)
        cost = STAKE_PER_FRICTION * max(0.0, dome - flat_wet)
        return cls(STAKE_PER_FRICTION * (flat_dry - dome), cost, cost / 3.0)


@dataclass(frozen=True)
class Plan:
    """What the walk so far advises for a foot that lifts off.

    Attributes
    ----------
    probe : bool
        Whether it is time to feel the ground with a flat foot.
    flat_pays : bool
        Whether flat feet are worth it on dry ground.
    trial : bool
        Whether this foot, flat on dry ground, should be a dome for one step, to show what domes
        lose there.
    """

    probe: bool = False
    flat_pays: bool = True
    trial: bool = False


def probe_interval(stakes: Stakes, wet_share: float, fading_length: float, stride: float) -> float:
    """Return the way between probes that brings most, m.

    Wet and dry patches follow each other as in a chain of two kinds. A way d after ground that was
    wet a probe finds it dry with p = (1 - q) (1 - exp(-d/ℓ)). Then all feet are flat for the rest
    of the dry patch, ℓ/q in the mean, and keep g in each of the two steps of a stride s, less the
    one step with which they come upon the next wet patch. Else the probe has cost c₁. From one
    such beginning to the next is a renewal, and the gain per metre is

        J(d) = [p (2 g ℓ/q - c s) - (1 - p) c₁ s] / (d + p ℓ/q).

    Parameters
    ----------
    stakes : Stakes
        g, c and c₁.
    wet_share : float
        q, above 0 and below 1.
    fading_length : float
        ℓ, m, above 0.
    stride : float
        s, m, above 0.

    Returns
    -------
    float
        The way with the greatest J, from one stride, for the answer takes that to come, up to the
        one whose probes take :data:`PREMIUM` of the way (each taken to cost :data:`LEAST_GAIN` at
        least), which is also the answer where J is nowhere above zero.

    Raises
    ------
    InvalidInput
        Naming the value that is outside its range.
    """
    number('wet_share', wet_share, '(probability)', high=1.0, above=True)
    number('fading_length', fading_length, 'm', above=True)
    number('stride', stride, 'm', above=True)
    # On dry ground a probe costs where domes hold better. And that probes have cost nothing so far
    # is no reason to make more of them.
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
        Where the foot stood first and last, m.
    flat : bool
        Whether it was flat.
    probing : bool
        Whether it was a probe, or a trial.
    wet : float
        What it felt: probability of wet ground.
    """

    landed: tuple[float, float]
    lifted: tuple[float, float]
    flat: bool
    probing: bool
    wet: float


class _Judged(NamedTuple):
    """A step, and how much of which stride it lost, m."""

    step: Step
    lost: float
    stride: float


class Planner:
    """Learns from the steps of a walk what shapes cost, and plans probes and trials.

    A foot that gives way while it stands moves backwards, against its swing: that is what a step
    loses. Feet that stand together slip together, as one body, so losses are means over steps of
    a tripod; and they depend on what is towed and where, so shapes are compared within a few
    strides. What a probe costs is the loss of its tripod less that of its last step; what domes
    lose on dry ground is tried on purpose, all feet for a step, in the middle of a dry patch, or
    seen where they stay domes.

    Parameters
    ----------
    expected : Stakes
        Before anything has been seen.
    legs : sequence of int
        Their numbers.
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
        self._unfelt = 0.0
        self.interval = math.inf

    @property
    def stakes(self) -> Stakes:
        """What hangs on a step, as far as is known."""
        gain, cost, probe_cost = (
            self._expected.gain, self._expected.cost, self._expected.probe_cost,
        )  # fmt: skip
        if self._trials and self._flat_dry:
            gain = statistics.median(self._trials) - statistics.median(self._flat_dry)
        if self._probes:
            # The expectation counts for one probe; no probe helps against slipping.
            probe_cost = max(0.0, statistics.median([probe_cost, *self._probes]))
        return Stakes(gain, cost, probe_cost)

    def plan(self, leg: int) -> Plan:
        """Return what is advised for a leg that has just been told of by :meth:`step`."""
        trial = leg in self._trying
        self._trying.discard(leg)
        pays = self.stakes.gain > LEAST_GAIN or self._outdated
        return Plan(self._unfelt >= self.interval, pays, trial)

    def step(self, leg: int, step: Step, ground: Footprints) -> None:
        """Take a step that a leg has made; what it felt, if flat, goes to the footprints."""
        self._strides += 1.0 / len(self._legs)
        before = self._lifted.get(leg)
        self._lifted[leg] = step.lifted
        swing = math.dist(step.landed, before) if before else 0.0
        lost = 0.0
        if before and swing > 0.0:
            ahead = [(to - start) / swing for to, start in zip(step.landed, before, strict=True)]
            slid = [to - start for to, start in zip(step.lifted, step.landed, strict=True)]
            lost = -sum(map(float.__mul__, ahead, slid))
            self._unfelt += max(0.0, swing - lost) / len(self._legs)
        if step.flat:
            ground.add(*step.lifted, step.wet, self._unfelt)
            self._unfelt = 0.0
        if not before or swing + lost <= 0.0:
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
        """Start a trial, if one is due and has been all flat and dry for some strides."""
        if self._strides - self._tried <= 3 * HINDSIGHT:
            return  # what the last one showed is not yet known
        if self._trials and not self._outdated:
            return
        if len(self._flat_dry) < HINDSIGHT or statistics.median(self._flat_dry) < LEAST_GAIN:
            return  # flat feet lose nothing that domes could keep
        if all(each.step.flat and each.step.wet < 0.5 for each in self._steps):
            self._trying = set(self._legs)
            self._tried = self._strides
            self._trials.clear()

    def _judge(self, judged: Sequence[_Judged], ground: Footprints) -> None:
        """Learn from the steps that a tripod made together."""
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
