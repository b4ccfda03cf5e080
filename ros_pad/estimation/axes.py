# SPDX-License-Identifier: Apache-2.0
"""Find turned or mirrored axes of a foot's force or position from readings that do not agree.

The ground pushes a foot up, and against its slip; a foot that sticks moves back by force over
shear stiffness; a foot swings above the heights at which it stands. What is measured in other axes
does none of these. Each stance, or second of a long one, is a witness, and no single one decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import add

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

Matrix = tuple[float, float, float, float]

TURNS: tuple[Matrix, ...] = (
    (1.0, 0.0, 0.0, 1.0), (0.0, -1.0, 1.0, 0.0), (0.0, 1.0, -1.0, 0.0), (-1.0, 0.0, 0.0, -1.0),
    (-1.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, -1.0), (0.0, 1.0, 1.0, 0.0), (0.0, -1.0, -1.0, 0.0),
)  # fmt: skip
"""For each turn of :data:`ros_pad.estimation.doubt.TURNS`, the matrix (by rows) from the true
horizontal force to the measured one."""

Vector = tuple[float, float, float]


class Stance:
    """Sums over a stance, or a second of one."""

    def __init__(self) -> None:
        self.force, self.heights, self.duration = (0.0, 0.0, 0.0), 0.0, 0.0
        self.likely = [0.0] * len(TURNS)  # log likelihoods of the motions
        self.last: tuple[float, ...] | None = None  # block

    def add(self, duration: float, height: float, force: Vector) -> None:
        """Add a height, m, and a force, N, that have lasted for a time, s."""
        (a, b, c), (x, y, z) = self.force, force
        self.force = a + x * duration, b + y * duration, c + z * duration
        self.heights += height * duration
        self.duration += duration


class Heights:
    """Whether a foot swings below the heights at which it stands."""

    def __init__(self) -> None:
        self.below = 0  # swings in a row
        self.restart()

    def restart(self) -> None:
        """Forget the height of the last stance."""
        self._last = math.nan  # mean of the last stance, m
        self.lowest, self.highest = math.inf, -math.inf  # since then, m

    def stand(self, height: float) -> None:
        """Process the mean height of a stance, m."""
        last = height if math.isnan(self._last) else self._last
        lowest, highest = min(height, last), max(height, last)
        if self.lowest < lowest - BELOW and self.highest < lowest + BELOW:
            self.below = min(STANCES, self.below + 1)
        elif self.highest > highest + BELOW:
            self.below = 0
        self._last, self.lowest, self.highest = height, math.inf, -math.inf


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
        self._steep, self._heights = 0, Heights()
        self._sure, self._raw = [0.0] * len(TURNS), [0.0] * len(TURNS)
        self.doubt = Doubt()
        self.restart()

    def restart(self) -> None:
        """Forget the present stance and the height of the last one."""
        self._heights.restart()
        self._loaded = False
        self._stance = Stance()

    def update(self, duration: float, height: float, force: Vector) -> bool:
        """Process a position's height, m, and a force without offset, N, about every `BLOCK`.

        ``duration``, s, is the time since the last one. Return whether the foot has been loaded
        since then.
        """
        x, y, z = force
        size = math.sqrt(x * x + y * y + z * z)
        if not self._loaded:
            self._heights.lowest = min(self._heights.lowest, height)
            self._heights.highest = max(self._heights.highest, height)
            if size > LOADED * self._expected_load:
                self._loaded = True
                self._stance = Stance()
            return False
        if size < UNLOADED * self._expected_load or self._stance.duration > LONGEST:
            self._end_stance()
            return False
        self._stance.add(duration, height, force)
        return True

    def compare(
        self, time: float, duration: float, x: float, y: float, fx: float, fy: float, sd: float
    ) -> None:
        """Compare means of position, m, and force, N, over a block with those of the last one.

        ``sd`` is the standard deviation of a change of the position between blocks, m; it is
        infinite if the direction of the force or the motion is not known.
        """
        stance = self._stance
        last, stance.last = stance.last, (time, x, y, fx, fy)
        if not last or time - last[0] > 1.5 * duration:
            return
        _, a, b, c, d = last
        sd = math.hypot(sd, MODEL_SPEED * duration)
        move, change = (x - a, y - b), (self._softness * (fx - c), self._softness * (fy - d))
        if max(math.hypot(*move), math.hypot(*change)) < 2.0 * sd:
            return
        force = 0.5 * (fx + c), 0.5 * (fy + d)
        pulled = math.hypot(*force) > PULL * self._expected_load
        found = likelihoods(move, change, force, sd, duration, pulled)
        stance.likely = [*map(add, stance.likely, found)]

    def _end_stance(self) -> None:
        """Add the evidence of a stance, or of a second of one."""
        self._loaded, stance = False, self._stance
        if stance.duration < SHORTEST:
            return
        mean = [each / stance.duration for each in stance.force]
        steep = mean[2] < STEEPEST * math.hypot(*mean)
        self._steep = min(STANCES, self._steep + 1) if steep else 0
        self._heights.stand(stance.heights / stance.duration)
        for turn, likely in enumerate(stance.likely):
            more = self._weight * (likely - stance.likely[0])
            self._raw[turn] = max(-3.0 * SURE, self._raw[turn] + more)
            sure = self._sure[turn] + min(MOST, max(LEAST, more))
            self._sure[turn] = min(3.0 * SURE, max(-SURE, sure))
        self._judge(mean)

    def _judge(self, mean: Sequence[float]) -> None:
        """Set the doubt after a stance with its mean force, N."""
        if self._steep >= STANCES:
            axis = max(range(3), key=lambda each: abs(mean[each]))
            code = doubt.UPSIDE_DOWN if axis == 2 else doubt.NORMAL
            self.doubt = Doubt(code, axis, mean[axis])
        elif self._heights.below >= STANCES:
            self.doubt = Doubt(doubt.BELOW)
        else:
            turn = self._raw.index(max(self._raw))
            sure = max(self._sure) >= (0.5 * SURE if self.doubt.code else SURE)
            self.doubt = Doubt(doubt.TURNED, turn) if turn and sure else Doubt()


def likelihoods(
    move: tuple[float, float],
    change: tuple[float, float],
    force: tuple[float, float],
    sd: float,
    duration: float,
    pulled: bool,
) -> list[float]:
    """Return the log likelihood of a motion for each of :data:`TURNS`.

    Parameters
    ----------
    move, change : tuple of float
        Change of the position, and of the measured force times softness, m.
    force : tuple of float
        Measured tangential force, N.
    sd : float
        Standard deviation of the change of the position of a foot that sticks, m.
    duration : float
        Time in which it changed, s.
    pulled : bool
        Whether the force has a direction.
    """
    (move_x, move_y), (bend_x, bend_y), (fx, fy) = move, change, force
    size = math.sqrt(fx * fx + fy * fy) or 1.0
    fx, fy = fx / size, fy / size
    variance, length = sd * sd, SLIP_SPEED * duration
    wide = (3.0 * length) ** 2
    sticks, slips = 0.5 / variance, 0.5 * math.sqrt(2.0 * math.pi) / length**2
    found = []
    for a, b, c, d in TURNS:
        x, y = move_x + a * bend_x + c * bend_y, move_y + b * bend_x + d * bend_y
        half = 0.5 * (x * x + y * y)
        total = (STRAY * math.exp(-half / wide) + 1e-9) / wide
        if half < 40.0 * variance:
            total += sticks * math.exp(-half / variance)
        if pulled:
            pull_x, pull_y = a * fx + c * fy, b * fx + d * fy
            along = -x * pull_x - y * pull_y
            if along > 0.0:
                across = x * pull_y - y * pull_x
                spread = variance + (CROSSWISE * along) ** 2
                less = along / length + 0.5 * across * across / spread
                total += slips * along * math.exp(-less) / math.sqrt(spread)
        found.append(math.log(total))
    return found
