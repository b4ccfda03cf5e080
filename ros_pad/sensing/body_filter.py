# SPDX-License-Identifier: Apache-2.0
"""Error-state Kalman filter of an IMU and of feet that stand.

State: rotation R from IMU to odom, velocity v, position p, biases of gyro and accelerometer, for
each foot the vector d in odom axes from the IMU to its foothold, where it was set down; and for
all feet, the radius of rolling and the relative error of the length of the legs. Errors:
rotation φ in odom axes, δv - φ x v, δp, the others' own, δd - φ x d. With these a standing foot
measures its own error and that of the length of the legs and no other, wherever the robot is
(right-invariant, Hartley 2020, with the body as the origin), so rotation about the vertical stays
unobservable, as it is.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpotrf, dtrtri, dtrtrs

from ros_pad.robots.rotation import Array, cross, rotation, skew

Flags = npt.NDArray[np.bool_]

GRAVITY = np.array((0.0, 0.0, -9.81))  # m/s²
# Squared Mahalanobis distance of a foot's innovation above which it slips: 99.9 % of χ² with 3
# degrees of freedom.
GATE = 16.27

FASTEST = 100.0  # m/s, speed of the body above which the filter has diverged

_APART = 1e2  # m²: variance of a measurement that must not count
_TURN, _SPEED, _PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
_GYRO, _FORCE = slice(9, 12), slice(12, 15)
RADIUS, SCALE, FEET = 15, 16, 17


class BodyFilter:
    """Rotation, velocity and position of an IMU, its biases, and the footholds.

    Parameters
    ----------
    legs : int
        Number of legs.
    gyro_noise, accelerometer_noise : float
        Standard deviation of a sample, rad/s and m/s².
    gate : float
        Squared Mahalanobis distance above which a foot is rejected.

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
    radius, scale : float
        With which feet roll, m; relative error of the length of the legs.
    covariance : array (17 + 3 legs, 17 + 3 legs)
        Of the errors above.
    creep : float
        Random motion of feet that stand, beyond that on firm ground, m after 1 s.
    """

    def __init__(
        self,
        legs: int,
        gyro_noise: float,
        accelerometer_noise: float,
        gate: float = GATE,
    ) -> None:
        size = FEET + 3 * legs
        self.turn = np.eye(3)
        self.velocity, self.position = np.zeros(3), np.zeros(3)
        self.gyro_bias, self.force_bias = np.zeros(3), np.zeros(3)
        self.footholds = np.zeros((legs, 3))
        self.radius = self.scale = self.creep = 0.0
        self.covariance = np.zeros((size, size))
        self._noise, self._gate = (gyro_noise, accelerometer_noise), gate
        # What errors, and errors of gyro and accelerometer, do in a step.
        self._step = np.eye(size), np.zeros((size, 6))
        self._last: tuple[Array, Array] | None = None

    def spread(
        self,
        turn: float,
        velocity: float,
        gyro_bias: float,
        force_bias: float,
        radius: float,
        scale: float,
    ) -> None:
        """Set standard deviations in SI units, without correlations; of ``turn``, only tilt."""
        self.covariance[:] = 0.0
        variances = _diagonal(self.covariance)
        variances[0:2] = turn**2
        variances[_SPEED] = velocity**2
        variances[_GYRO] = gyro_bias**2
        variances[_FORCE] = force_bias**2
        variances[RADIUS:FEET] = radius**2, scale**2
        self._last = None

    @property
    def deviations(self) -> tuple[float, float]:
        """Standard deviations of :attr:`radius`, m, and :attr:`scale`."""
        radius, scale = np.sqrt(np.maximum(_diagonal(self.covariance)[RADIUS:FEET], 0.0)).tolist()
        return radius, scale

    def reshape(self, radius: float, radius_sd: float, scale: float, scale_sd: float) -> None:
        """Discard what was learnt about rolling and legs; set values and deviations."""
        self.covariance[RADIUS:FEET] = 0.0
        self.covariance[:, RADIUS:FEET] = 0.0
        self.radius, self.scale = radius, scale
        _diagonal(self.covariance)[RADIUS:FEET] = radius_sd**2, scale_sd**2

    def lose(self, turn: float = 0.01, velocity: float = 1.0) -> None:
        """Let rotation and velocity be less known, by so much, rad and m/s, as after a gap."""
        _diagonal(self.covariance)[_SPEED] += velocity**2
        _diagonal(self.covariance)[_TURN] += turn**2
        _diagonal(self.covariance)[_PLACE] += velocity**2
        self._last = None

    def predict(self, dt: float, gyro: Array, force: Array, spin: Array) -> Array:
        """Advance by a step; return its mean velocity, (3,), m/s.

        Parameters
        ----------
        dt : float
            Length of the step, s.
        gyro, force : array (3,)
            Angular velocity, rad/s, and specific force, m/s², as measured at the end of the step.
        spin : array (legs, 3)
            Velocity with which feet of radius 1 m roll, 1/s, odom axes.
        """
        before = self._last or (gyro, force)
        self._last = gyro, force
        old, v = self.turn, self.velocity
        rate = 0.5 * (before[0] + gyro) - self.gyro_bias
        self.turn = turn = old @ rotation(rate * dt)
        start, end = old @ (before[1] - self.force_bias), turn @ (force - self.force_bias)
        acceleration = 0.5 * (start + end) + GRAVITY
        mean = v + 0.5 * dt * acceleration
        self.velocity = v + dt * acceleration
        self.position = self.position + dt * mean
        self.footholds += dt * (self.radius * spin - mean)
        jump = end - start
        self._spread_on(dt, turn, float(jump @ jump), spin)
        return mean

    def _spread_on(self, dt: float, turn: Array, jump: float, spin: Array) -> None:
        """Advance the covariance."""
        turned = -dt * turn
        step, inputs = self._step
        inputs[_TURN, :3] = turned
        inputs[_SPEED, :3] = skew(self.velocity) @ turned
        inputs[_SPEED, 3:] = turned
        inputs[FEET:, :3] = (skew(self.footholds) @ turned).reshape(-1, 3)
        step[:, 9:15] = inputs
        step[_GYRO, _GYRO] = step[_FORCE, _FORCE] = _UNIT
        step[_SPEED, _TURN] = dt * _FALL
        step[_PLACE, _TURN] = -dt * skew(self.velocity)
        step[_PLACE, _SPEED] = dt * _UNIT
        step[FEET:].reshape(-1, 3, step.shape[1])[..., _SPEED] = -dt * _UNIT
        step[FEET:, RADIUS] = dt * spin.ravel()
        # Impacts are shorter than a sample: an acceleration may be off by a fifth of its jump.
        gyro, force = self._noise[0], math.sqrt(self._noise[1] ** 2 + 0.2**2 * jump)
        noise = np.array(3 * [gyro] + 3 * [force]) * inputs
        self.covariance[:] = step @ self.covariance @ step.T + noise @ noise.T
        variances = _diagonal(self.covariance)
        variances[_GYRO] += 2e-5**2 * dt  # drift of the biases after 1 s, rad/s and m/s²
        variances[_FORCE] += 1e-3**2 * dt
        # Feet are no spheres, and sink in: their speed of rolling is 15 % off for 8 ms.
        unsure = 0.15 * self.radius
        # On firm ground a foot strays by 0.3 mm in the first second, and rises and sinks by 6 mm.
        stray = (3e-4**2 + self.creep**2 + 0.008 * unsure**2 * (spin * spin).sum(1)) * dt
        variances[FEET:].reshape(-1, 3)[:] += stray[:, None]
        variances[FEET + 2 :: 3] += 6e-3**2 * dt

    def set_down(
        self, feet: Flags, places: Array, hips: Array, noise: Array, level: bool = False
    ) -> None:
        """Make new footholds where these feet are.

        Parameters
        ----------
        feet : array of bool (legs,)
            Which feet.
        places : array (legs, 3)
            All feet as measured, from the IMU, in odom axes, m.
        hips : array (legs, 3)
            The hips, likewise.
        noise : array (legs, 3, 3)
            Covariance of these places, m².
        level : bool
            Keep the height of the foothold.
        """
        cells = 2 if level else 3
        for foot in np.flatnonzero(feet):
            at = FEET + 3 * foot
            self.footholds[foot, :cells] = places[foot, :cells]
            # A new foothold shares no error with the body: its own is that of leg and joints.
            line = places[foot, :cells] - hips[foot, :cells]
            row = line[:, None] * self.covariance[SCALE]
            row[:, at : at + cells] = 0.0
            self.covariance[at : at + cells] = row
            self.covariance[:, at : at + cells] = row.T
            self.covariance[at : at + cells, at : at + cells] = (
                noise[foot, :cells, :cells] + row[:, SCALE, None] * line
            )

    def stand(
        self,
        places: Array,
        hips: Array,
        noise: Array,
        standing: Flags,
        slipping: Flags,
        fixed: bool,
    ) -> Flags:
        """Correct everything with feet that stand.

        Parameters
        ----------
        places, hips, noise
            As for :meth:`set_down`.
        standing : array of bool (legs,)
            Feet that carry load.
        slipping : array of bool (legs,)
            Of these, the ones that only keep their height.
        fixed : bool
            Whether radius and length of legs are kept: nothing can be learnt about legs at rest,
            but noise would look like it.

        Returns
        -------
        array of bool (2, legs)
            Feet whose measurement is not consistent with standing still, and of these the ones
            whose height is not either.
        """
        miss = np.where(standing[:, None], places - self.footholds, 0.0)
        # Not from the measured places: their noise would look like legs of another length.
        lines = (self.footholds - hips).reshape(-1, 1)
        seen = self.covariance[FEET:] - lines * self.covariance[SCALE]
        spread = seen[:, FEET:] - seen[:, SCALE, None] * lines.T
        count = len(self.footholds)
        cells = spread.reshape(count, 3, count, 3)
        each = np.arange(count)
        cells[each, :, each] += noise
        diagonal = spread.ravel()[:: 3 * count + 1].reshape(count, 3)
        diagonal[~standing] += _APART
        diagonal[slipping, :2] += _APART
        judged = np.zeros((2, count), dtype=bool)
        miss = miss.ravel()
        root, _ = dpotrf(spread, lower=1)
        score, _ = dtrtrs(root, miss, lower=1)
        if score @ score > self._gate:
            root = self._judge(spread, diagonal, miss, slipping, judged)
        # Not dtrtrs for many columns: OpenBLAS wakes threads for it, for 100 µs or ms.
        inverse, _ = dtrtri(root, lower=1)
        rows = inverse @ seen
        error = (inverse @ miss) @ rows
        spread = self.covariance
        shapes = spread[RADIUS:FEET, RADIUS:FEET].copy()
        spread -= rows.T @ rows
        if fixed:  # considered, not estimated (Schmidt 1966)
            error[RADIUS:FEET] = 0.0
            spread[RADIUS:FEET, RADIUS:FEET] = shapes
        self.apply(error)
        spread += spread.T.copy()  # rounding must not make it unsymmetric
        spread *= 0.5
        return judged

    def _judge(
        self, spread: Array, diagonal: Array, miss: Array, slipping: Flags, judged: Flags
    ) -> Array:
        """Reject feet one by one, in order of consistency; return the root of the rest."""
        legs = len(self.footholds)
        each = np.arange(legs)
        own = spread.reshape(legs, 3, legs, 3)[each, :, each]
        rows = miss.reshape(legs, 3)
        alone = (rows * np.linalg.solve(own, rows[..., None])[..., 0]).sum(1)
        order = np.arange(3 * legs).reshape(legs, 3)[np.argsort(alone)]
        weak = slipping.copy()
        rejected, lifted = judged
        for _ in range(2 * legs):
            chosen = order.ravel()
            root, _ = dpotrf(spread[np.ix_(chosen, chosen)], lower=1)
            score, _ = dtrtrs(root, miss[chosen], lower=1)
            bad = np.flatnonzero((score.reshape(legs, 3) ** 2).sum(1) > self._gate)
            if not bad.size:
                break
            foot = int(order[bad[0], 0]) // 3
            if weak[foot]:
                diagonal[foot] += _APART
                lifted[foot] = True
            else:
                diagonal[foot, :2] += _APART
            weak[foot] = rejected[foot] = True
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
        """Correct the state by an estimated error, (17 + 3 legs,)."""
        turn = error[_TURN]
        self.velocity = self.velocity + error[_SPEED] + cross(turn, self.velocity)
        self.position = self.position + error[_PLACE]
        self.gyro_bias = self.gyro_bias + error[_GYRO]
        self.force_bias = self.force_bias + error[_FORCE]
        self.radius += float(error[RADIUS])
        self.scale += float(error[SCALE])
        self.footholds += error[FEET:].reshape(-1, 3) + cross(turn, self.footholds)
        self.turn = rotation(turn) @ self.turn


_UNIT = np.eye(3)
_FALL = skew(GRAVITY)


def _diagonal(square: Array) -> Array:
    """Return the diagonal of a square array, to be changed in place."""
    return square.ravel()[:: len(square) + 1]
