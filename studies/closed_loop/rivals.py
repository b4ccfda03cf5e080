# SPDX-License-Identifier: Apache-2.0
"""Policies from the literature, as rivals of the adaptive one in the study of policies.

Each function returns a new policy for one walk. All walk with the shipped controller, so their
feet decide as late, and know the same footprints.
"""

from __future__ import annotations

import math

import numpy as np

from ros_pad.control.policies import DOME, FLAT, Choice, LiftOff, Policy

WET_ABOVE, DRY_BELOW, DWELL = 0.65, 0.35, 2
"""Hysteresis of the rival that counts steps: that of the adaptive policy."""

SWITCH = 0.05
"""Gain of a step on dry ground with a flat foot that a switch must be worth, for the POMDP."""


def count(every: int) -> Policy:
    """Follow wet ground with hysteresis, and probe after a fixed number of steps as a dome."""

    def choose(step: LiftOff) -> Choice:
        settled = step.probing or step.steps >= DWELL
        if not settled:
            return Choice(step.morphology)
        if step.morphology == FLAT:
            return Choice(DOME if step.wet_ahead > WET_ABOVE else FLAT)
        if step.wet_ahead < DRY_BELOW:
            return Choice(FLAT)
        probe = step.steps >= every and not step.others_probing
        return Choice(FLAT if probe else DOME, probe)

    return choose


def pomdp(loss: float, length: float, share: float = 0.5, stride: float = 0.14) -> Policy:
    """Follow the exact value of one foot on a two-state ground, with a cost of switching.

    A flat step gains 1 on dry ground, loses ``loss`` on wet ground and shows which it is; a dome
    gains nothing and shows nothing. Without the cost this is the channel of Gilbert and Elliott
    with a subsidy, whose best policy is the index of Whittle (Liu and Zhao 2010, IEEE Trans. Inf.
    Theory 56).

    Parameters
    ----------
    loss : float
        Loss of a flat foot on wet ground, in gains on dry ground.
    length : float
        Distance over which wet and dry ground change, m.
    share : float
        Share of wet ground.
    stride : float
        Distance between two steps of a foot, m.
    """
    stay = math.exp(-stride / length)
    belief = np.linspace(0.0, 1.0, 101)  # of wet ground

    def after(wet: np.ndarray | float) -> np.ndarray:
        return share + (np.asarray(wet) - share) * stay

    value = np.zeros((2, belief.size))  # with a flat foot now, and with a dome
    for _ in range(1000):
        dry, wet, dome = (
            [np.interp(after(each), belief, row) for row in value]
            for each in (0.0, 1.0, belief)
        )  # fmt: skip
        flat = (1.0 - belief) * (1.0 + 0.99 * dry[0]) + belief * (0.99 * wet[0] - loss)
        stays = 0.99 * dome[1]
        best = np.array([np.maximum(flat, stays - SWITCH), np.maximum(flat - SWITCH, stays)])
        done = np.abs(best - value).max() < 1e-6
        value = best
        if done:
            break
    # Beliefs from which on the next step is a dome, after a flat step and after a dome.
    borders = {
        morphology: float(belief[np.argmax(better)]) if better.any() else math.inf
        for morphology, better in ((FLAT, stays - SWITCH > flat), (DOME, stays > flat - SWITCH))
    }

    def choose(step: LiftOff) -> Choice:
        return Choice(DOME if step.wet_ahead >= borders[step.morphology] else FLAT)

    return choose


class _Arms:
    """Discounted sums of the progress with each morphology, of all feet together."""

    def __init__(self, discount: float, stride: float) -> None:
        self._discount, self._stride = discount, stride
        self.pulls = {FLAT: 0.0, DOME: 0.0}
        self.gains = {FLAT: 0.0, DOME: 0.0}
        self._leader: int | None = None
        self._x: float | None = None
        self.arm = FLAT

    def round(self, step: LiftOff) -> bool:
        """Take the progress of the first leg since its last lift-off; False for other legs."""
        self._leader = step.leg if self._leader is None else self._leader
        if step.leg != self._leader:
            return False
        # The position ahead is as far from that of lift-off as that is from the one before.
        x = step.next_position[0] if self._x is None else (step.next_position[0] + self._x) / 2.0
        if self._x is not None:
            for arm in self.pulls:
                self.pulls[arm] *= self._discount
                self.gains[arm] *= self._discount
            self.pulls[self.arm] += 1.0
            self.gains[self.arm] += min(1.0, max(0.0, (x - self._x) / self._stride))
        self._x = x
        return True


def discounted_ucb(discount: float, exploration: float, stride: float = 0.14) -> Policy:
    """Choose the morphology of all feet by its upper confidence bound (Garivier, Moulines 2011).

    The reward is the advance of a stride, as a share of ``stride``, m; wetness is not used.
    """
    arms = _Arms(discount, stride)

    def choose(step: LiftOff) -> Choice:
        if arms.round(step):
            total = sum(arms.pulls.values())

            def bound(arm: str) -> float:
                pulls = arms.pulls[arm]
                if pulls < 1e-3:
                    return math.inf
                spread = exploration * math.sqrt(math.log(max(total, 1.0)) / pulls)
                return arms.gains[arm] / pulls + spread

            arms.arm = max(arms.pulls, key=bound)
        return Choice(arms.arm)

    return choose
