# SPDX-License-Identifier: Apache-2.0
"""Watch over the sensors of a foot: measure noise, and look for turned axes, now and then."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import compress, pairwise
from operator import mul, sub
from typing import TYPE_CHECKING

import numpy as np

from ros_pad.estimation.axes import BLOCK, LONGEST, Axes, Vector
from ros_pad.estimation.ground import LONGEST_GAP
from ros_pad.estimation.noise import Meter, changes

if TYPE_CHECKING:
    from ros_pad.estimation.track import Offset, Sample

EAGER, PAUSE = 10, 8
"""Stances in which noise is measured and axes are checked at first, and of how many one is later.
Stances are counted anew each second."""

LAG = 2
"""Blocks between those that are compared: noise that is correlated over one of them counts."""

EAGER_BLOCKS, BLOCK_PAUSE = 12, 3
"""Blocks that are all measured at first, and of how many one is measured later."""

READINGS = 8
"""Last readings of a window in which second differences are taken."""

STEADY = 0.03
"""Change of the force over blocks up to which a foot is at rest, share of the expected load."""

STILL = 1e-3
"""Motion over blocks, m, up to which a foot is at rest: one that slips at 5 mm/s moves so far."""

_UNEVEN = 0.5
"""Relative change of the sampling period above which no second difference is taken."""


class Watch:
    """Watch over the sensors of one foot, in blocks of samples.

    Parameters
    ----------
    position_noise, force_noise : float
        Configured standard deviations of a component, m and N; 0: not measured.
    expected_load : float
        Normal force in stance, N.
    axes : Axes
        Doubt of the axes.
    joints : bool
        Whether motion is the sum of measured velocities.

    Attributes
    ----------
    position, force : Meter
        Noise of a coordinate, m, and of a component of the force, N.
    axes : Axes
        As given.
    looks : bool
        Whether noise is measured, and motions are compared, in this stance.
    """

    def __init__(
        self,
        position_noise: float,
        force_noise: float,
        expected_load: float,
        axes: Axes,
        joints: bool,
    ) -> None:
        self.position, self.force = Meter(position_noise), Meter(force_noise)
        self._steady = STEADY * expected_load
        self.axes = axes
        self._slid = (0.0, 0.0) if joints else None  # so far, m
        self._blocks: deque[tuple[Sequence[float], int]] = deque(maxlen=2 * LAG + 1)
        self._measured = 0  # blocks
        self._looked, self.looks, self._look_end = 0, False, math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the last readings, and the height of the last stance."""
        self.axes.restart()
        self._end = -math.inf
        # Time, s, position, m, and force, N, since the last block, and two before them.
        self._readings: list[tuple[float, ...]] = []
        self._earlier = 0  # readings before the block

    def look(self, time: float) -> None:
        """Decide whether to look at the readings of a stance, or of a second of a long one.

        Noise and axes hardly ever change during a walk.
        """
        self._looked += 1
        self.looks = self._looked <= EAGER or self._looked % PAUSE == 0
        self._look_end = time + LONGEST
        self._readings, self._earlier = [], 0
        self._blocks.clear()

    def update(
        self, time: float, dt: float, sample: Sample, force: Vector, offset: Offset, stands: bool
    ) -> bool:
        """Look at a sample, and at the block that may end with it; return if noise was measured.

        Parameters
        ----------
        time, dt : float
            Time of the sample, and since the one before, s.
        sample : Sample
            The sample.
        force : tuple of float
            Its force without offset, N.
        offset : Offset
            Offset of the force.
        stands : bool
            Whether the foot stood until now.
        """
        if self._slid:
            moved = min(dt, BLOCK)
            self._slid = self._slid[0] + sample.vx * moved, self._slid[1] + sample.vy * moved
        if self.looks:
            place = self._slid or (sample.x, sample.y)
            self._readings.append((time, *place, sample.fx, sample.fy, sample.fz))
        if time < self._end:
            return False
        block, earlier = self._readings, self._earlier
        duration = time - self._end + BLOCK
        self._readings, self._earlier = block[-2:], min(2, len(block))
        self._end = time + BLOCK - 1e-9
        if duration > BLOCK + LONGEST_GAP or sample.variance == math.inf:
            self.axes.restart()
            return False
        loaded = self.axes.update(duration, sample.z, force)
        measured, count = False, len(block) - earlier
        if self.looks and count:
            columns = [*zip(*block, strict=True)]
            means = [sum(each[earlier:]) / count for each in columns[1:]]
            measured = stands and self._measure(columns, means, count)
            if loaded and offset.known:
                sd = self.position.noise * math.sqrt(2.0 / count)
                if self._slid:
                    sd = math.sqrt(sample.variance) * BLOCK
                pull = np.array(means[2:4]) - (offset.x, offset.y)
                self.axes.compare(columns[0][-1], duration, np.array(means[:2]), pull, sd)
        if stands and time > self._look_end:
            self.look(time)
        return measured

    def _measure(
        self, readings: Sequence[Sequence[float]], means: Sequence[float], count: int
    ) -> bool:
        """Process a block of a standing foot; return whether noise was measured in it.

        ``readings`` has a column each of times, s, positions x and y, m, and forces x, y and z, N,
        which may begin before the block; ``means`` are those of so many readings of the block
        itself, without the times.
        """
        self._blocks.append((means, count))
        self._measured += 1
        _, x, y, *forces = readings
        self.position.add_changes(x, y)
        self.force.add_changes(*forces)
        if self._measured > EAGER_BLOCKS and self._measured % BLOCK_PAUSE:
            return False
        times, x, y, *forces = (each[-READINGS:] for each in readings)
        steps = changes(times)
        even = [abs(b - a) <= _UNEVEN * b for a, b in pairwise(steps)]
        bends = sum(even)
        if bends < 2:
            return False
        if self.position.configured:
            self.position.add_window(_bent(x, even) + _bent(y, even), 2 * bends)
        if self.force.configured:
            self.force.add_window(sum(_bent(each, even) for each in forces), 3 * bends)
        if len(self._blocks) > 2 * LAG:
            self._compare_blocks()
        return True

    def _compare_blocks(self) -> None:
        """Compare means over blocks, if the foot was at rest in them."""
        last, count = self._blocks[-1]
        noise = 4.0 / math.sqrt(count)
        steady = self._steady + noise * self.force.noise
        still = STILL + noise * self.position.noise
        for means, _ in self._blocks:
            a, b, c, d, e = map(sub, last, means)
            if max(abs(a), abs(b)) > still or max(abs(c), abs(d), abs(e)) > steady:
                return
        (first, some), (middle, more) = self._blocks[0], self._blocks[LAG]
        x, y, fx, fy, _ = (a - b - b + c for a, b, c in zip(first, middle, last, strict=True))
        samples = 6.0 / (1.0 / some + 4.0 / more + 1.0 / count)
        self.position.add_blocks(x, y, samples)
        self.force.add_blocks(fx, fy, samples)


def _bent(values: Sequence[float], even: Sequence[bool]) -> float:
    """Return the sum of the squared second differences of values at even times."""
    bends = changes(changes(values))
    return sum(compress(map(mul, bends, bends), even))
