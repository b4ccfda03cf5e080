# SPDX-License-Identifier: Apache-2.0
"""Slip velocity of each foot over the last samples, from joint positions and joint velocities."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ros_pad.robots.rotation import Array

# Largest length of the window, and of its last part, s: whether a foot has come to rest is known
# sooner than its speed.
LENGTHS = 0.02, 0.4 * 0.02

# Samples that are kept: with more than 1000 a second the window is shorter.
_KEPT = 21


class SlipWindow:
    """Mean velocity of the contact points over a short window that begins at touch-down.

    Two measurements with independent noise are weighted by it: the change of the foot's place over
    the window (encoder noise twice, over its length), and the mean of velocities (noise of the
    joint velocities over the root of their number). The path of the body is the integral of its
    velocity: corrections of its position would look like slip.

    Parameters
    ----------
    legs : int
        Number of legs.
    encoder_noise, velocity_noise : float
        Standard deviations of joint positions, rad, and joint velocities, rad/s.

    Attributes
    ----------
    velocity, latest : array (legs, 3)
        Mean slip velocity in the window, and in the last part of it, m/s.
    lever_noise, latest_noise : array (legs,)
        Their white noise over the length of the lever from joints to foot, rad/s.
    unsteady : array (legs,)
        Variance of the mean of the horizontal velocities, as they vary in the window, m²/s².
    """

    def __init__(self, legs: int, encoder_noise: float, velocity_noise: float) -> None:
        self.velocity = self.latest = np.zeros((legs, 3))
        self.lever_noise = self.latest_noise = np.full(legs, velocity_noise)
        self.unsteady = np.zeros(legs)
        self._positions, self._velocities = 2.0 * encoder_noise**2, velocity_noise**2
        self._begins = np.zeros(legs, dtype=np.int64)  # count at which the window began
        self._count = 0
        self._firsts = [0, 0]  # counts of the first samples within the lengths
        self._path = np.zeros((legs, 3))
        self._sums = np.zeros((legs, 3, 3))  # place over the ground; velocities; their squares
        self._ring = np.zeros((_KEPT, legs, 3, 3))
        self._times = np.full(_KEPT, -math.inf)

    def update(
        self,
        time: float,
        moved: Array,
        places: Array,
        slip: Array,
        begins: npt.NDArray[np.bool_],
    ) -> None:
        """Add a sample.

        Parameters
        ----------
        time : float
            Time of the sample, s.
        moved : array (legs, 3)
            What body and rolling have moved the feet since the last sample, m.
        places : array (legs, 3)
            Feet from the body, in odom axes, m.
        slip : array (legs, 3)
            Velocities of the contact points from the joint velocities, m/s.
        begins : array of bool (legs,)
            Feet whose window begins with this sample.
        """
        self._count += 1
        now = self._count % _KEPT
        self._path += moved
        self._sums[:, 0] = self._path + places
        self._sums[:, 1] += slip
        self._sums[:, 2] += slip * slip
        self._ring[now], self._times[now] = self._sums, time
        self._begins[begins] = self._count
        for index, length in enumerate(LENGTHS):
            first = max(self._firsts[index], self._count - _KEPT + 1)
            while time - self._times[first % _KEPT] > 1.001 * length:  # but for rounding
                first += 1
            self._firsts[index] = first
        self._average(time, slip)

    def _average(self, time: float, slip: Array) -> None:
        """Take the means over both windows, the longer one first."""
        firsts = np.maximum(self._begins, np.array(self._firsts)[:, None])  # (2, legs)
        rows = firsts % _KEPT
        change, total, squares = (
            self._sums - self._ring[rows, np.arange(len(self._begins))]
        ).transpose(2, 0, 1, 3)
        length = (time - self._times[rows])[..., None]
        count = (self._count - firsts)[..., None]
        weight = length / self._positions
        both = weight * length + count / self._velocities
        fresh = count == 0
        both[fresh] = 1.0 / self._velocities
        means = (change * weight + total / self._velocities) / both
        self.velocity, self.latest = np.where(fresh, slip, means)
        self.lever_noise, self.latest_noise = np.sqrt(1.0 / both[..., 0])
        several = np.maximum(count[0], 1)
        spread = (squares[0] - total[0] * total[0] / several) / (several * several)
        self.unsteady = 0.5 * (spread[:, 0] + spread[:, 1])
