# SPDX-License-Identifier: Apache-2.0
"""What a body estimator is given, keeps and returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import quantity
from ros_pad.errors import InvalidInput
from ros_pad.robots import Kinematics
from ros_pad.robots.rotation import Array
from ros_pad.sensing.plausibility import Delay, Joints, Legs, Repeats, Unloaded

SMOOTHING = 0.01
"""Time constant of the slip velocity, s: as sluggish as a mean over twice that."""

LANDING = 0.02
"""Time from touch-down on in which the slip velocity is not smoothed, s: feet skid on landing."""

Flags = npt.NDArray[np.bool_]


class FootMotion(NamedTuple):
    """One foot after a sample; all vectors in odom axes.

    Attributes
    ----------
    position : array (3,)
        Position of the centre of the foot, m.
    velocity : array (3,)
        Its velocity, m/s.
    force : array (3,)
        Force of the ground on the foot, N.
    in_contact : bool
        Whether the foot carries load.
    slip_velocity : array (2,)
        Velocity of the contact point, x and y, m/s, smoothed over 10 ms, from 20 ms after
        touch-down on.
    slip_velocity_sd : float
        Standard deviation of each of its components, m/s. It includes that of the body's
        velocity, which is common to all feet and lasts for about a stance.
    excluded : bool
        Whether the foot carries load but is left out of the estimate of the body, but for its
        height: it is not consistent with standing still, or has just landed.
    """

    position: Array
    velocity: Array
    force: Array
    in_contact: bool
    slip_velocity: Array
    slip_velocity_sd: float
    excluded: bool


class BodyEstimate(NamedTuple):
    """Estimate after a sample, in odom: z up, world-fixed, at the body when estimation began.

    Attributes
    ----------
    time : float
        Time of the sample, s.
    position : array (3,)
        Position of the base, m.
    velocity : array (3,)
        Velocity of the base, m/s.
    orientation : array (4,)
        Quaternion x y z w from the base to odom.
    covariance : array (9, 9)
        Of position, m, rotation in odom axes, rad, and velocity, m/s.
    feet : tuple of FootMotion
        The feet, in the order of ``robot.legs``.
    doubt : str
        Why this must not be relied on: a kind, a colon, and details; empty if it may be.
    """

    time: float
    position: Array
    orientation: Array
    velocity: Array
    covariance: Array
    feet: tuple[FootMotion, ...]
    doubt: str


class Given(NamedTuple):
    """Settings of a body estimator.

    Attributes
    ----------
    gyro_noise : float
        Standard deviation of a sample of the gyro, rad/s, 1e-6 to 1.
    accelerometer_noise : float
        Of the accelerometer, m/s², 1e-6 to 10.
    encoder_noise : float
        Of a joint position, rad, 1e-6 to 0.1.
    velocity_noise : float
        Of a joint velocity, rad/s, 1e-6 to 10.
    force_noise : float
        Of a component of a foot's force, N, 0 to 100.
    accelerometer_bias : float
        Standard deviation of the accelerometer's bias, m/s², 0 to 5.
    contact_share : float
        Share of the expected load above which a foot stands, 0 to 0.9; 0 means 0.1, and 0.25
        where the force comes from joint torques. The expected load is the weight over half of the
        legs.
    force_axes : str
        ``base`` if the foot forces come in the axes of the base, ``foot`` for those of the links
        of the feet.
    """

    gyro_noise: float = 0.005
    accelerometer_noise: float = 0.05
    encoder_noise: float = 5e-4
    velocity_noise: float = 0.03
    force_noise: float = 0.3
    accelerometer_bias: float = 0.05
    contact_share: float = 0.0
    force_axes: str = 'base'


class Sample(NamedTuple):
    """Readings of one moment, in the axes of the IMU."""

    time: float
    gyro: Array
    accelerometer: Array
    kinematics: Kinematics
    rates: Array  # of the joints, (legs, joints a leg)
    forces: Array | None  # of the ground on the feet, (legs, 3)


class Body(NamedTuple):
    """Where things are in the body."""

    errors: Array  # (9, 9): from errors of the filter to those of the base
    to_imu: Array  # (4, 4)
    load: float  # N, that a foot is expected to carry


class Checks(NamedTuple):
    """What finds readings that contradict each other."""

    repeats: Repeats
    joints: Joints
    legs: Legs
    delay: Delay
    unloaded: Unloaded


class Feet:
    """What is known of the contacts of all feet."""

    def __init__(self, legs: int) -> None:
        self.measured = True  # whether forces are measured, not computed from torques
        self.standing = np.zeros(legs, dtype=bool)
        self.excluded = np.zeros(legs, dtype=bool)  # from the filter, but for their height
        self.slow_since = np.full(legs, math.inf)
        self.slip = np.zeros((legs, 2))  # smoothed velocity of the contact points, m/s
        self.white = np.ones(legs)  # share of the variance of a sample that is left in it
        self._age = np.zeros(legs)  # of the stance, s
        self.climbing = np.zeros(legs)  # vertical speeds, m/s
        self.held = math.inf  # when a foot last stuck
        self.sliding_since = math.inf  # since when feet stand and none of them sticks

    def smooth(self, dt: float, slips: Array, lands: Flags) -> None:
        """Smooth the velocities of the contact points, (legs, 2), m/s, from touch-down on."""
        self._age = np.where(lands, -LANDING, self._age + dt)
        share = dt / np.clip(self._age + dt, dt, SMOOTHING + dt) if dt else np.ones_like(self._age)
        self.slip += share[:, None] * (slips - self.slip)
        self.white = (1.0 - share) ** 2 * self.white + share**2


@dataclass
class Doubts:
    """A doubt that lasts for some time."""

    lasts: float  # s
    until: float = -math.inf
    reason: str = ''

    def add(self, time: float, reason: str) -> None:
        """Begin a doubt."""
        self.until, self.reason = time + self.lasts, reason


@dataclass
class Rest:
    """Mean of the gyro at rest."""

    since: float = math.nan
    total: Array = field(default_factory=lambda: np.zeros(3))
    count: int = 0


def checked(
    name: str, values: npt.ArrayLike, shape: tuple[int, ...], unit: str, most: float
) -> Array:
    """Return a reading as an array; raise `InvalidInput` for another shape, or above ``most``."""
    fine = isinstance(values, np.ndarray) and values.dtype == float and values.shape == shape
    if fine and np.abs(values).max() < most:  # not if it is NaN; `quantity` takes longer
        return np.asarray(values)
    found = quantity(name, values, unit, -most, most)
    if found.shape != shape:
        raise InvalidInput(f'{name} of shape {found.shape} is not allowed: {shape} is needed')
    return found
