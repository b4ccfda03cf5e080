# SPDX-License-Identifier: Apache-2.0
"""Error-state Kalman filter of an IMU and of feet that stand.

State: rotation R from IMU to odom, velocity v, position p, biases of gyro and accelerometer, and
for each foot the vector d in odom axes from the IMU to its foothold, where it was set down.
Errors: rotation φ in odom axes, δv - φ x v, δp, the biases' own, δd - φ x d. With these a standing
foot measures its own error and no other, wherever the robot is (right-invariant, Hartley 2020,
with the body as the origin), so rotation about the vertical stays unobservable, as it is.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpotrf, dtrtri, dtrtrs

from ros_pad.robots.rotation import Array, rotation, skew

Flags = npt.NDArray[np.bool_]

GRAVITY = np.array((0.0, 0.0, -9.81))  # m/s²
# Squared Mahalanobis distance of a foot's innovation above which it slips: 99.9 % of χ² with 3
# degrees of freedom.
GATE = 16.27

FASTEST = 100.0  # m/s, speed of the body above which the filter has diverged

_ANYWHERE = 1.0  # m²: variance of a foothold that is not known
_TURN, _SPEED, _PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
_GYRO, _FORCE = slice(9, 12), slice(12, 15)
FEET = 15

# Jump of the accelerometer above which it is an impact or a wrong reading, m/s², and share of
# the rest that is noise.
IMPACT, DOUBTED = 5.0, 0.3

# Random motion of feet that stand, m after 1 s, and what more soft feet rise and sink.
STRAY, SINK = 2e-3, 6e-3


class BodyFilter:
    """Rotation, velocity and position of an IMU, its biases, and the footholds.

    Parameters
    ----------
    legs : int
        Number of legs.
    gyro_noise, accelerometer_noise : float
        Standard deviation of a sample, rad/s and m/s².

    Attributes
    ----------
    turn : array (3, 3)
        Rotation from the IMU to odom.
    velocity, position : array (3,)
        In odom, m/s and m.
    gyro_bias, force_bias : array (3,)
        Biases of gyro and accelerometer, rad/s and m/s².
    footholds : array (legs, 3)
        From the IMU to the footholds, in odom axes, m.
    covariance : array (15 + 3 legs, 15 + 3 legs)
        Of the errors above.
    """

    def __init__(
        self,
        legs: int,
        gyro_noise: float,
        accelerometer_noise: float,
    ) -> None:
        size = FEET + 3 * legs
        self.turn = np.eye(3)
        self.velocity, self.position = np.zeros(3), np.zeros(3)
        self.gyro_bias, self.force_bias = np.zeros(3), np.zeros(3)
        self.footholds = np.zeros((legs, 3))
        self.covariance = np.zeros((size, size))
        self._noise = np.array(3 * [gyro_noise] + 3 * [accelerometer_noise])
        self._force = np.full(3, math.nan)  # the last reading
        # What errors, and errors of gyro and accelerometer, do in a step of a length, s.
        self._step, self._inputs, self._dt = np.eye(size), np.zeros((size, 6)), 0.0

    def spread(self, turn: float, velocity: float, gyro_bias: float, force_bias: float) -> None:
        """Set standard deviations in SI units, without correlations; of ``turn``, only tilt."""
        self.covariance[:] = 0.0
        variances = _diagonal(self.covariance)
        variances[0:2] = turn**2
        variances[_SPEED] = velocity**2
        variances[_GYRO] = gyro_bias**2
        variances[_FORCE] = force_bias**2

    def lose(self, turn: float = 0.01, velocity: float = 1.0) -> None:
        """Let rotation and velocity be less known, by so much, rad and m/s, as after a gap."""
        _diagonal(self.covariance)[_SPEED] += velocity**2
        _diagonal(self.covariance)[_PLACE] += velocity**2
        # The body turns, and neither its velocity nor its footholds with it.
        turned = np.zeros((len(self.covariance), 3))
        turned[_TURN], turned[_SPEED] = turn * _UNIT, turn * skew(self.velocity)
        turned[FEET:] = turn * skew(self.footholds).reshape(-1, 3)
        self.covariance += turned @ turned.T

    def predict(self, dt: float, gyro: Array, force: Array, rolling: Array) -> None:
        """Advance by a step.

        Parameters
        ----------
        dt : float
            Length of the step, s.
        gyro, force : array (3,)
            Angular velocity, rad/s, and specific force, m/s², as measured, means over the step.
        rolling : array (legs, 3)
            Velocity with which the feet that stand roll, m/s, odom axes.
        """
        old, v = self.turn, self.velocity
        self.turn = turn = old @ rotation((gyro - self.gyro_bias) * dt)
        acceleration = 0.5 * (old + turn) @ (force - self.force_bias) + GRAVITY
        mean = v + 0.5 * dt * acceleration
        self.velocity = v + dt * acceleration
        self.position = self.position + dt * mean
        self.footholds += dt * (rolling - mean)
        jump, self._force = force - self._force, force
        self._spread_on(dt, turn, DOUBTED * max(0.0, math.sqrt(jump @ jump) - IMPACT))

    def _spread_on(self, dt: float, turn: Array, impact: float) -> None:
        """Advance the covariance, with more noise of the accelerometer, m/s²."""
        step, inputs = self._step, self._inputs
        if dt != self._dt:
            self._dt = dt
            step[_SPEED, _TURN] = dt * _FALL
            step[_PLACE, _SPEED] = dt * _UNIT
            step[FEET:].reshape(-1, 3, step.shape[1])[..., _SPEED] = -dt * _UNIT
        inputs[_TURN, :3] = inputs[_SPEED, 3:] = turned = -dt * turn
        lines = skew(np.concatenate([self.velocity[None], self.footholds]))
        inputs[_SPEED, :3] = lines[0] @ turned
        inputs[FEET:, :3] = (lines[1:] @ turned).reshape(-1, 3)
        step[_PLACE, _TURN] = -dt * lines[0]
        step[:9, 9:15], step[FEET:, 9:15] = inputs[:9], inputs[FEET:]
        noise = self._noise * inputs
        noise[:, 3:] += impact * inputs[:, 3:]
        self.covariance[:] = step @ self.covariance @ step.T + noise @ noise.T
        variances = _diagonal(self.covariance)
        variances[_GYRO] += 2e-5**2 * dt  # drift of the biases after 1 s, rad/s and m/s²
        variances[_FORCE] += 1e-3**2 * dt
        variances[FEET:] += STRAY**2 * dt
        variances[FEET + 2 :: 3] += SINK**2 * dt

    def stand(self, places: Array, noise: Array, free: Flags) -> Flags:
        """Correct everything with where the feet are.

        Parameters
        ----------
        places : array (legs, 3)
            All feet as measured, from the IMU, in odom axes, m.
        noise : array (legs, 3, 3)
            Covariance of these places, m².
        free : array of bool (legs, 3)
            Coordinates in which a foot moves as it likes: its foothold is made anew there, and
            shows nothing about the body.

        Returns
        -------
        array of bool (legs, 3)
            Coordinates that were found to be free, because the foot is not where it stood.
        """
        seen = self.covariance[FEET:]
        _diagonal(self.covariance)[FEET:][free.ravel()] += _ANYWHERE
        spread = seen[:, FEET:].copy()
        legs = np.arange(len(places))
        spread.reshape(len(legs), 3, len(legs), 3)[legs, :, legs] += noise
        miss = (places - self.footholds).ravel()
        moved = np.zeros(free.shape, dtype=bool)
        root, _ = dpotrf(spread, lower=1)
        score, _ = dtrtrs(root, miss, lower=1)
        if score @ score > GATE:
            root = self._reject(spread, miss, free, moved)
            _diagonal(self.covariance)[FEET:][moved.ravel()] += _ANYWHERE
        # Not dtrtrs for many columns: OpenBLAS wakes threads for it, for 100 µs or ms.
        inverse, _ = dtrtri(root, lower=1)
        rows = inverse @ seen
        self.apply((inverse @ miss) @ rows)
        spread = self.covariance
        spread -= rows.T @ rows
        spread += spread.T.copy()  # rounding must not make it unsymmetric
        spread *= 0.5
        return moved

    def _reject(self, spread: Array, miss: Array, free: Flags, moved: Flags) -> Array:
        """Free feet one by one, the least consistent last; return the root of the spread.

        Of a foot the ground plane is freed first, then its height, too.
        """
        legs = np.arange(len(free))
        rows = miss.reshape(-1, 3)
        own = spread.reshape(len(legs), 3, len(legs), 3)[legs, :, legs]
        alone = (rows * np.linalg.solve(own, rows[..., None])[..., 0]).sum(1)
        order = np.arange(miss.size).reshape(-1, 3)[np.argsort(alone)]
        diagonal = _diagonal(spread)
        for _ in range(2 * len(legs)):
            chosen = order.ravel()
            root, _ = dpotrf(spread[np.ix_(chosen, chosen)], lower=1)
            score, _ = dtrtrs(root, miss[chosen], lower=1)
            bad = np.flatnonzero((score.reshape(-1, 3) ** 2).sum(1) > GATE)
            if not bad.size:
                break
            cells = order[bad[0]]
            cells = cells[2:] if (free | moved)[cells[0] // 3, 0] else cells[:2]
            diagonal[cells] += _ANYWHERE
            moved.ravel()[cells] = True
        root, _ = dpotrf(spread, lower=1)
        return root

    def rest(self, gyro: Array, noise: float) -> None:
        """Correct with a mean gyro reading, (3,), of a body at rest, and its deviation, rad/s."""
        rows = self.covariance[_GYRO]
        gain = np.linalg.solve(rows[:, _GYRO] + noise**2 * _UNIT, rows).T
        self.apply(gain @ (gyro - self.gyro_bias))
        self.covariance -= gain @ rows

    def sound(self) -> bool:
        """Return whether velocity and covariance are such as a robot can have."""
        speed = float(self.velocity @ self.velocity)
        variances = _diagonal(self.covariance)
        fine = speed < FASTEST**2 and variances.min() > -1e-9 and variances.max() < math.inf
        return bool(fine)  # false for NaN, too

    def apply(self, error: Array) -> None:
        """Correct the state by an estimated error, (15 + 3 legs,)."""
        turn = error[_TURN]
        axes = skew(turn)
        self.velocity = self.velocity + error[_SPEED] + axes @ self.velocity
        self.position = self.position + error[_PLACE]
        self.gyro_bias = self.gyro_bias + error[_GYRO]
        self.force_bias = self.force_bias + error[_FORCE]
        self.footholds += error[FEET:].reshape(-1, 3) - self.footholds @ axes
        self.turn = rotation(turn) @ self.turn


_UNIT = np.eye(3)
_FALL = skew(GRAVITY)


def _diagonal(square: Array) -> Array:
    """Return the diagonal of a square array, to be changed in place."""
    return square.ravel()[:: len(square) + 1]
