# SPDX-License-Identifier: Apache-2.0
"""Slip velocity of each foot over the last samples, from joint positions and joint velocities."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_pad.robots.rotation import Array


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
    samples : int
        Largest number of intervals of a window.
    encoder_noise, velocity_noise : float
        Standard deviations of joint positions, rad, and joint velocities, rad/s.

    Attributes
    ----------
    velocity : array (legs, 3)
        Mean slip velocity, m/s.
    lever_noise : array (legs,)
        Its white noise over the length of the lever from joints to foot, rad/s.
    """

    def __init__(
        self, legs: int, samples: int, encoder_noise: float, velocity_noise: float
    ) -> None:
        self.velocity = np.zeros((legs, 3))
        self.lever_noise = np.full(legs, velocity_noise)
        self._positions, self._velocities = encoder_noise**2, velocity_noise**2
        self._samples = samples
        self._legs = np.arange(legs)
        self._ages = np.zeros(legs, dtype=int)
        self._count = 0
        self._path = np.zeros((legs, 3))
        self._sums = np.zeros((2, legs, 3))  # place over the ground; sum of velocities
        self._ring = np.zeros((samples + 1, 2, legs, 3))
        self._times = np.zeros(samples + 1)

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
        now = self._count % (self._samples + 1)
        self._path += moved
        self._sums[0] = self._path + places
        self._sums[1] += slip
        self._ring[now], self._times[now] = self._sums, time
        self._ages = np.where(begins, 0, np.minimum(self._ages + 1, self._samples))
        ages = self._ages
        first = (self._count - ages) % (self._samples + 1)
        change, total = (self._sums - self._ring[first, :, self._legs].transpose(1, 0, 2))[
            ..., None
        ]
        length = time - self._times[first]
        weight = length * length / (2.0 * self._positions)
        other = ages / self._velocities
        both = weight + other
        fresh = ages == 0
        safe = np.where(fresh, 1.0, both)
        mean = (change[..., 0] * (length / (2.0 * self._positions))[:, None]) + (
            total[..., 0] / self._velocities
        )
        self.velocity = np.where(fresh[:, None], slip, mean / safe[:, None])
        self.lever_noise = np.sqrt(np.where(fresh, self._velocities, 1.0 / safe))
