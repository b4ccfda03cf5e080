# SPDX-License-Identifier: Apache-2.0
"""Find turned or mirrored axes of a foot's force or position from readings that do not agree.

The ground pushes a foot up, and against its slip; a foot that sticks moves back by force over
shear stiffness; a foot swings above the heights at which it stands. What is measured in other axes
does none of these. Each stance, or second of a long one, is a witness, and no single one decides.
"""

from __future__ import annotations

import math

import numpy as np

from ros_pad.estimation import doubt
from ros_pad.estimation.doubt import Doubt
from ros_pad.estimation.friction import SLIP_SPEED

LOADED, UNLOADED = 0.5, 0.3
"""Size of the force from which on, and below which, a foot counts as loaded, share of the expected
load: whatever its direction."""

BLOCK = 0.04
"""Time over which positions and forces are averaged before they are compared, s."""

SHORTEST, LONGEST = 0.08, 1.0
"""Shortest stance that is looked at, and longest that is one witness, s: the rest is another."""

STEEPEST = 0.5
"""Share of its size that the normal force has at the least: else T/N is 1.7."""

BELOW = 0.01
"""Depth below its stances that a swing must have, m."""

CROSSWISE = 0.5
"""Standard deviation of the direction of slip against the force, rad: feet also turn."""

MODEL_SPEED = 4e-3
"""Speed by which the contact of a foot that sticks moves, m/s: feet roll and bend."""

PULL = 0.06
"""Least tangential force with a direction, share of the expected load."""

STRAY = 0.1
"""Share of motions that follow no rule."""

MOST, LEAST = 4.0, -6.0
"""Bounds of the evidence of one witness for a turn, nats."""

SURE = 6.0
"""Sum over witnesses from which on axes are in doubt until it is below half of it, nats: of two at
least."""

STANCES = 2
"""Witnesses of a wrong normal axis, or swings below stances, that make a doubt."""

TURNS = np.array((
    ((1.0, 0.0), (0.0, 1.0)), ((0.0, -1.0), (1.0, 0.0)), ((0.0, 1.0), (-1.0, 0.0)),
    ((-1.0, 0.0), (0.0, -1.0)), ((-1.0, 0.0), (0.0, 1.0)), ((1.0, 0.0), (0.0, -1.0)),
    ((0.0, 1.0), (1.0, 0.0)), ((0.0, -1.0), (-1.0, 0.0)),
))  # fmt: skip
"""For each turn of :data:`ros_pad.estimation.doubt.TURNS`, the matrix from the true horizontal
force to the measured one."""

Vector = tuple[float, float, float]


class Axes:
    """Doubt the axes of one foot's force and position.

    Parameters
    ----------
    expected_load : float
        Normal force in stance, N.
    softness : float
        Motion of the position against the contact, per tangential force, m/N.
    memory : float
        Time over which errors of the motion are the same, s.

    Attributes
    ----------
    doubt : Doubt
        Why the axes cannot be right, with the likely turn; none if they can.
    """

    def __init__(self, expected_load: float, softness: float, memory: float = BLOCK) -> None:
        self._expected_load, self._softness = expected_load, softness
        self._weight = 0.5 * BLOCK / memory  # blocks that follow each other agree
        self._steep = self._below = (
            0  # stances with a wrong normal axis, and swings below, in a row
        )
        self._sure, self._raw = np.zeros(len(TURNS)), np.zeros(len(TURNS))
        self.doubt = Doubt()
        self.restart()

    def restart(self) -> None:
        """Forget the present stance and the height of the last one."""
        self._stood = math.nan  # mean height of the last stance, m
        self._swing = math.inf, -math.inf  # lowest and highest position since then, m
        self._loaded = False
        self._begin()

    def _begin(self) -> None:
        """Begin a stance, or a second of one."""
        self._duration, self._sums = 0.0, np.zeros(4)  # of height and force over time
        self._likely = np.zeros(len(TURNS))  # log likelihoods of the motions
        self._last: tuple[float, np.ndarray, np.ndarray] | None = None  # block

    def update(self, duration: float, height: float, force: Vector) -> bool:
        """Process a position's height, m, and a force without offset, N, about every `BLOCK`.

        ``duration``, s, is the time since the last one. Return whether the foot has been loaded
        since then.
        """
        size = math.hypot(*force)
        if not self._loaded:
            self._swing = min(self._swing[0], height), max(self._swing[1], height)
            if size > LOADED * self._expected_load:
                self._loaded = True
                self._begin()
        elif size < UNLOADED * self._expected_load or self._duration > LONGEST:
            self._loaded = False
            if self._duration >= SHORTEST:
                self._end_stance()
        else:
            self._duration += duration
            self._sums += duration * np.array((height, *force))
            return True
        return False

    def compare(
        self, time: float, duration: float, place: np.ndarray, force: np.ndarray, sd: float
    ) -> None:
        """Compare means of position, m, and force, N, over a block with those of the last one.

        ``sd`` is the standard deviation of a change of the position between blocks, m; it is
        infinite if the direction of the force or the motion is not known.
        """
        last, self._last = self._last, (time, place, force)
        if not last or time - last[0] > 1.5 * duration:
            return
        sd = math.hypot(sd, MODEL_SPEED * duration)
        move, change = place - last[1], self._softness * (force - last[2])
        if max(math.hypot(*move), math.hypot(*change)) < 2.0 * sd:
            return
        force = 0.5 * (force + last[2])
        self._likely += self._likelihoods(move, change, force, sd, duration)

    def _likelihoods(
        self, move: np.ndarray, change: np.ndarray, force: np.ndarray, sd: float, duration: float
    ) -> np.ndarray:
        """Return the log likelihood of a motion in a time, s, for each of :data:`TURNS`.

        ``move`` and ``change`` are those of the position, and of the measured force times
        softness, m; ``force`` is the tangential one, N, and ``sd`` the standard deviation of the
        motion of a foot that sticks, m.
        """
        variance, length = sd * sd, SLIP_SPEED * duration
        wide = (3.0 * length) ** 2
        away = move + change @ TURNS  # of the contact, in true axes
        half = 0.5 * (away * away).sum(axis=1)
        total = (STRAY * np.exp(-half / wide) + 1e-9) / wide
        total += 0.5 / variance * np.exp(-half / variance)
        pull = math.hypot(*force)
        if pull > PULL * self._expected_load:  # else it has no direction
            x, y = (force @ TURNS / pull).T
            along = np.maximum(-away[:, 0] * x - away[:, 1] * y, 0.0)
            across = away[:, 0] * y - away[:, 1] * x
            spread = variance + (CROSSWISE * along) ** 2
            slips = along * np.exp(-along / length - 0.5 * across * across / spread)
            total += 0.5 * math.sqrt(2.0 * math.pi) / length**2 * slips / np.sqrt(spread)
        return np.asarray(np.log(total))

    def _end_stance(self) -> None:
        """Add the evidence of a stance, or of a second of one, and judge it."""
        height, *mean = (self._sums / self._duration).tolist()
        steep = mean[2] < STEEPEST * math.hypot(*mean)
        self._steep = min(STANCES, self._steep + 1) if steep else 0
        self._compare_heights(height)
        more = self._weight * (self._likely - self._likely[0])
        self._raw = np.maximum(self._raw + more, -3.0 * SURE)
        self._sure = np.clip(self._sure + np.clip(more, LEAST, MOST), -SURE, 3.0 * SURE)
        if self._steep >= STANCES:
            axis = max(range(3), key=lambda each: abs(mean[each]))
            code = doubt.UPSIDE_DOWN if axis == 2 else doubt.NORMAL
            self.doubt = Doubt(code, axis, mean[axis])
        elif self._below >= STANCES:
            self.doubt = Doubt(doubt.BELOW)
        else:
            turn = int(self._raw.argmax())
            sure = self._sure.max() >= (0.5 * SURE if self.doubt.code else SURE)
            self.doubt = Doubt(doubt.TURNED, turn) if turn and sure else Doubt()

    def _compare_heights(self, height: float) -> None:
        """Compare the heights of a swing, m, with those of the stances before and after it."""
        last = height if math.isnan(self._stood) else self._stood
        lowest, highest = min(height, last), max(height, last)
        if self._swing[0] < lowest - BELOW and self._swing[1] < lowest + BELOW:
            self._below = min(STANCES, self._below + 1)
        elif self._swing[1] > highest + BELOW:
            self._below = 0
        self._stood, self._swing = height, (math.inf, -math.inf)
