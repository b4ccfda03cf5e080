# SPDX-License-Identifier: Apache-2.0
"""Find turned or mirrored axes of a foot's force or position from readings that do not agree.

The ground pushes a foot up, and against its slip; a foot that sticks moves back by force over
shear stiffness; a foot swings above the heights at which it stands. What is measured in other axes
does none of these. Each stance is a witness, and no single one decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

LOADED, UNLOADED = 0.5, 0.3
"""Size of the force from which on, and below which, a foot counts as loaded, share of the expected
load: whatever its direction."""

BLOCK = 0.02
"""Time over which positions and forces are averaged before they are compared, s."""

SHORTEST, LONGEST = 0.08, 1.0
"""Shortest stance that is looked at, and longest that is one witness, s."""

STEEPEST = 0.5
"""Share of its size that the normal force has at the least: else T/N is 1.7."""

BELOW = 0.01
"""Depth below its stances that a swing must have, m."""

CROSSWISE = 0.5
"""Standard deviation of the direction of slip against the force, rad: feet also turn."""

SLIP = 0.04
"""Most frequent slip speed, m/s."""

MODEL_SPEED = 4e-3
"""Speed by which the contact of a foot that sticks moves, m/s: feet roll and bend."""

PULL = 0.06
"""Least tangential force with a direction, share of the expected load."""

STRAY = 0.1
"""Share of motions that follow no rule."""

MOST, LEAST = 4.0, -6.0
"""Bounds of what one stance says for a turn, nats."""

SURE = 6.0
"""Sum over stances from which on axes are in doubt until it is below 0, nats: of two at least."""

STANCES = 2
"""Stances with a wrong normal axis, or with a swing below them, that make a doubt."""

Matrix = tuple[float, float, float, float]

TURNS: tuple[tuple[str, Matrix], ...] = (
    ('the ordinary ones', (1.0, 0.0, 0.0, 1.0)),
    ('force axes turned by about 90° about z', (0.0, -1.0, 1.0, 0.0)),
    ('force axes turned by about -90° about z', (0.0, 1.0, -1.0, 0.0)),
    ('force axes, or those of the position, turned by about 180° about z', (-1.0, 0.0, 0.0, -1.0)),
    ('left-handed, x of force or position has the wrong sign', (-1.0, 0.0, 0.0, 1.0)),
    ('left-handed, y of force or position has the wrong sign', (1.0, 0.0, 0.0, -1.0)),
    ('left-handed, x and y of the force are exchanged', (0.0, 1.0, 1.0, 0.0)),
    ('left-handed, x and y of the force are exchanged with wrong signs', (0.0, -1.0, -1.0, 0.0)),
)
"""For each turn, the matrix (by rows) from the true horizontal force to the measured one."""

Values = tuple[float, float, float, float]
"""Position x and y, m, and force x and y, N."""

_NOTHING: Values = (0.0, 0.0, 0.0, 0.0)


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
    doubt : str
        Why the axes cannot be right, with the likely turn; empty if they can.
    """

    __slots__ = (
        '_below', '_block', '_count', '_duration', '_force', '_height', '_heights', '_highest',
        '_last', '_loaded', '_lowest', '_pull', '_raw', '_said', '_softness', '_steep', '_sums',
        '_sure', '_touch', '_unload', '_weight', 'doubt',
    )  # fmt: skip

    def __init__(self, expected_load: float, softness: float, memory: float = BLOCK) -> None:
        self._touch, self._unload = LOADED * expected_load, UNLOADED * expected_load
        self._pull, self._softness = PULL * expected_load, softness
        self._weight = 0.5 * BLOCK / memory  # blocks that follow each other agree
        self._steep = self._below = 0
        self._sure, self._raw = [0.0] * len(TURNS), [0.0] * len(TURNS)
        self._sums, self._count, self._block = _NOTHING, 0, 0.0
        self.doubt = ''
        self.restart()

    def restart(self) -> None:
        """Forget the present stance and the height of the last one."""
        self._height = math.nan  # mean of the last stance, m
        self._lowest, self._highest = math.inf, -math.inf  # since then, m
        self._loaded = False
        self._begin_stance()

    def _begin_stance(self) -> None:
        self._force, self._heights, self._duration = (0.0, 0.0, 0.0), 0.0, 0.0
        self._said = [0.0] * len(TURNS)  # log likelihoods of the motions in this stance
        self._last: tuple[Values, float] | None = None
        self._begin_block()

    def update(
        self, dt: float, force: Sequence[float], x: float, y: float, z: float, sd: float
    ) -> None:
        """Process a force, N, without offset, and a position, m, dt seconds after the last ones.

        ``sd`` is the standard deviation of a change of the position over a block, m; it is
        infinite if the direction of the force or the motion is not known.
        """
        fx, fy, fz = force
        size = math.sqrt(fx * fx + fy * fy + fz * fz)
        if not self._loaded:
            self._lowest, self._highest = min(self._lowest, z), max(self._highest, z)
            if size <= self._touch:
                return
            self._loaded = True
            self._begin_stance()
        elif size < self._unload or self._duration > LONGEST:
            self._end_stance(lifts=size < self._unload)
            return
        a, b, c = self._force
        self._force = a + fx * dt, b + fy * dt, c + fz * dt
        self._heights += z * dt
        self._duration += dt
        d, e, f, g = self._sums
        self._sums = d + x, e + y, f + fx, g + fy
        self._count += 1
        self._block += dt
        if self._block > BLOCK - 1e-9:
            self._end_block(sd)

    def _begin_block(self) -> None:
        self._sums = _NOTHING
        self._count, self._block = 0, 0.0

    def _end_block(self, sd: float) -> None:
        """Compare positions and forces with those of the block before."""
        count, (x, y, fx, fy) = self._count, self._sums
        x, y, fx, fy = x / count, y / count, fx / count, fy / count
        last, self._last = self._last, ((x, y, fx, fy), self._block)
        self._begin_block()
        if not last or sd == math.inf:
            return
        (a, b, c, d), block = last
        duration = 0.5 * (block + self._last[1])
        sd = math.hypot(sd, MODEL_SPEED * duration)
        move, change = (x - a, y - b), (self._softness * (fx - c), self._softness * (fy - d))
        if max(math.hypot(*move), math.hypot(*change)) < 2.0 * sd:
            return
        force = 0.5 * (fx + c), 0.5 * (fy + d)
        pulled = math.hypot(*force) > self._pull
        for turn, (_, matrix) in enumerate(TURNS):
            self._said[turn] += likelihood(matrix, move, change, force, sd, duration, pulled)

    def _end_stance(self, lifts: bool) -> None:
        """Hear a witness; when the foot ``lifts``, a swing begins."""
        self._loaded = False
        if self._duration < SHORTEST:
            return
        mean = [each / self._duration for each in self._force]
        steep = mean[2] < STEEPEST * math.hypot(*mean)
        self._steep = min(STANCES, self._steep + 1) if steep else 0
        height = self._heights / self._duration
        lowest, highest = min(height, self._height), max(height, self._height)
        if self._lowest < lowest - BELOW and self._highest < lowest + BELOW:
            self._below = min(STANCES, self._below + 1)
        elif self._highest > highest + BELOW:
            self._below = 0
        if lifts:
            self._height, self._lowest, self._highest = height, math.inf, -math.inf
        for turn, said in enumerate(self._said):
            more = self._weight * (said - self._said[0])
            self._raw[turn] = max(-3.0 * SURE, self._raw[turn] + more)
            sure = self._sure[turn] + min(MOST, max(LEAST, more))
            self._sure[turn] = min(3.0 * SURE, max(-SURE, sure))
        self.doubt = self._reason(mean)

    def _reason(self, mean: Sequence[float]) -> str:
        """Return the doubt after a stance with a mean force, N."""
        if self._steep >= STANCES:
            axis = max(range(3), key=lambda each: abs(mean[each]))
            if axis == 2:
                return 'axes: the sign of the force is turned, it pulls the foot down'
            sign = '-' if mean[axis] < 0.0 else ''
            return f'axes: the normal force is along {sign}{"xyz"[axis]} of the sensor, not z'
        if self._below >= STANCES:
            return 'axes: z of the position is turned, the foot swings below its stances'
        turn = max(range(len(TURNS)), key=self._raw.__getitem__)
        if not turn or max(self._sure) < (1e-9 if self.doubt else SURE):
            return ''
        return f'axes: {TURNS[turn][0]}'


def likelihood(
    matrix: Matrix,
    move: tuple[float, float],
    change: tuple[float, float],
    force: tuple[float, float],
    sd: float,
    duration: float,
    pulled: bool,
) -> float:
    """Return the log likelihood of a motion if the force was measured in turned axes.

    Parameters
    ----------
    matrix : tuple of float
        From the true force to the measured one.
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
    a, b, c, d = matrix
    x = move[0] + a * change[0] + c * change[1]
    y = move[1] + b * change[0] + d * change[1]
    square, variance = x * x + y * y, sd * sd
    stick, slip = math.exp(-0.5 * square / variance) / variance, 0.0
    size = math.hypot(*force)
    fx, fy = (a * force[0] + c * force[1]) / size, (b * force[0] + d * force[1]) / size
    along = -x * fx - y * fy
    if pulled and along > 0.0:
        spread = math.hypot(sd, CROSSWISE * along)
        length, across = SLIP * duration, x * fy - y * fx
        slip = along / length**2 * math.exp(-along / length - 0.5 * (across / spread) ** 2)
        slip *= math.sqrt(2.0 * math.pi) / spread
    wide = (3.0 * SLIP * duration) ** 2
    stray = STRAY * math.exp(-0.5 * square / wide) / wide
    return math.log(0.5 * (stick + slip) + stray + 1e-9 / wide)
