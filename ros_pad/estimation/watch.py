# SPDX-License-Identifier: Apache-2.0
"""Watch over the sensors of a foot: measure noise, and look for turned axes, now and then."""

from __future__ import annotations

import math

import numpy as np

from ros_pad.estimation.axes import BLOCK, LONGEST, Axes, Vector
from ros_pad.estimation.ground import LONGEST_GAP
from ros_pad.estimation.noise import SensorNoise

EAGER, PAUSE = 10, 8
"""Stances in which noise is measured and axes are checked at first, and of how many one is later.
Stances are counted anew each second."""


class Watch:
    """Watch over the sensors of one foot, in blocks of samples.

    Parameters
    ----------
    noise : SensorNoise
        Noise of the sensors.
    axes : Axes
        Doubt of their axes.

    Attributes
    ----------
    noise, axes
        As given.
    end : float
        Time at which the present block ends, s.
    readings : list of tuple
        Time, s, position x and y, m, and force, N, since the last block, and two before them.
    looks : bool
        Whether noise is measured, and motions are compared, in this stance.
    """

    def __init__(self, noise: SensorNoise, axes: Axes) -> None:
        self.noise, self.axes = noise, axes
        self._looked, self.looks, self._look_end = 0, False, math.inf
        self.restart()

    def restart(self) -> None:
        """Forget the last readings, and the height of the last stance."""
        self.axes.restart()
        self.end = -math.inf
        self.readings: list[tuple[float, ...]] = []
        self._earlier = 0  # readings before the block

    def look(self, time: float) -> None:
        """Decide whether to look at the readings of a stance, or of a second of a long one.

        Noise and axes hardly ever change during a walk.
        """
        self._looked += 1
        self.looks = self._looked <= EAGER or self._looked % PAUSE == 0
        self._look_end = time + LONGEST
        self.readings, self._earlier = [], 0
        self.noise.begin()

    def end_block(
        self,
        time: float,
        height: float,
        force: Vector,
        offset: tuple[float, float] | None,
        stands: bool,
        speed_sd: float | None,
    ) -> bool:
        """Look at the readings of a block that ends now; return whether noise was measured.

        Parameters
        ----------
        time : float
            Time, s.
        height : float
            Height of the position, m.
        force : tuple of float
            Force without offset, N.
        offset : tuple of float or None
            Offset of the horizontal force, N; None if it is not known.
        stands : bool
            Whether the foot stood until now.
        speed_sd : float or None
            With joints, standard deviation of the velocity, m/s; infinite if it must not be used.
        """
        block, earlier = self.readings, self._earlier
        duration = time - self.end + BLOCK
        self.readings, self._earlier = block[-2:], min(2, len(block))
        self.end = time + BLOCK - 1e-9
        if duration > BLOCK + LONGEST_GAP or speed_sd == math.inf:
            self.axes.restart()
            return False
        loaded = self.axes.update(duration, height, force)
        measured, count = False, len(block) - earlier
        if self.looks and count:
            columns = [*zip(*block, strict=True)]
            means = [sum(each[earlier:]) / count for each in columns[1:]]
            measured = stands and self.noise.add(columns, means, count)
            if loaded and offset:
                sd = self.noise.position.noise * math.sqrt(2.0 / count)
                if speed_sd is not None:
                    sd = speed_sd * BLOCK
                place, pull = np.array(means[:2]), np.array(means[2:4]) - offset
                self.axes.compare(columns[0][-1], duration, place, pull, sd)
        if stands and time > self._look_end:
            self.look(time)
        return measured
