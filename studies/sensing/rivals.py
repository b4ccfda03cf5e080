# SPDX-License-Identifier: Apache-2.0
"""Rivals of the body estimator: a plain filter, an invariant one, and legged odometry."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, cross, rotation, skew
from ros_pad.sensing.body_filter import GRAVITY
from studies.samples import Flags
from studies.sensing.walks import Course, Log

Rows = list[tuple[Any, ...]]
GATE = 11.3  # 99 % of χ² with 3 degrees of freedom
GYRO_BIAS = 5e-4  # rad/s, deviation of the mean of a second at rest
LOAD = 0.1  # of the expected load, from which on a foot stands


def loads_of(robot: Robot, log: Log) -> Flags:
    """Return whether feet carry load, (samples, legs)."""
    return np.asarray(log.foot_forces[..., 2] > LOAD * robot.mass * 9.81 / (0.5 * len(robot.legs)))


class _Feet:
    """Kinematics of all feet of one sample in IMU axes; rolling over ground that is level."""

    def __init__(self, robot: Robot, to_imu: Array, q: Array, dq: Array) -> None:
        found = robot.chains.solve(q.reshape(robot.home.shape), to_imu)
        speeds = dq.reshape(*robot.home.shape, 1)
        self.places, self.jacobians = found.positions, found.jacobians
        self.moving = (found.jacobians @ speeds)[..., 0]
        self.turning = (found.angular @ speeds)[..., 0]

    def slips(self, turn: Array, rate: Array, radius: float) -> Array:
        """Return velocities of the contact points less that of the IMU, (legs, 3), m/s."""
        moving = self.moving + cross(rate, self.places)
        up = turn[2]
        return np.asarray((moving - radius * cross(self.turning + rate, up)) @ turn.T)


def odometry(robot: Robot, log: Log, course: Course) -> Rows:
    """Return legged odometry: heading and tilt from the gyro, speed from the feet that stand.

    Rows have position and velocity of the base, and slip velocities of the feet.
    """
    bias = log.gyro[: round(1.8 * course.rate)].mean(0)
    turn, position, held = np.eye(3), np.zeros(3), np.zeros(3)
    rows: Rows = []
    for gyro, q, dq, stands in zip(
        log.gyro, log.joint_positions, log.joint_velocities, loads_of(robot, log), strict=True
    ):
        rate = robot.imu[:3, :3] @ (gyro - bias)
        turn = turn @ rotation(rate / course.rate)
        slips = _Feet(robot, np.eye(4), q, dq).slips(turn, rate, robot.foot_radius)
        held = -slips[stands].mean(0) if stands.any() else held
        position = position + held / course.rate
        rows.append((position, held, held + slips))
    return rows


class InvariantFilter:
    """Right-invariant filter of contacts (Hartley 2020), biases appended.

    Rotation, velocity, position and footholds are one element X of a group, with the error
    X_estimated X_true⁻¹ = exp(ξ): rotation, velocity, position, footholds, then biases of gyro and
    accelerometer. Its motion does not depend on X but through the biases, nor do measurements.

    ``gate`` is the squared Mahalanobis distance of a foot's innovation above which it slips: then
    it is set down anew where it is.
    """

    shakes, stray = 0.1, 0.002  # chosen on seed 1

    def __init__(self, robot: Robot, course: Course, gate: float = math.inf) -> None:
        self._robot, self._dt = robot, 1.0 / course.rate
        self._noise = course.noise
        legs = len(robot.legs)
        self._to_imu: Array = np.asarray(np.linalg.inv(robot.imu), dtype=float)
        self.turn, self.velocity, self.position = np.eye(3), np.zeros(3), np.zeros(3)
        self.biases, self.feet = np.zeros((2, 3)), np.zeros((legs, 3))
        self._stands = np.zeros(legs, dtype=bool)
        self._gate = gate
        deviations = [0.01, 0.01, 0.0, *[0.02] * 3, *[0.0] * 3, *[0.0] * self.feet.size]
        deviations += [GYRO_BIAS] * 3 + [course.noise.accelerometer_bias] * 3
        self.covariance = np.diag(np.square(deviations))

    def begin(self, log: Log) -> None:
        """Take tilt and bias of the gyro from the readings at rest."""
        still = slice(0, round(1.0 / self._dt))
        up = log.accelerometer[still].mean(0)
        axis = cross(up / np.linalg.norm(up), np.array((0.0, 0.0, 1.0)))
        self.turn = rotation(axis)
        self.biases[0] = log.gyro[still].mean(0)

    def update(self, gyro: Array, force: Array, q: Array, dq: Array, stands: Flags) -> Array:
        """Process a sample; return the slip velocities of the feet, (legs, 3), m/s."""
        feet = _Feet(self._robot, self._to_imu, q, dq)
        rate = gyro - self.biases[0]
        self.predict(rate, force - self.biases[1], self._rolling(feet, rate))
        self._set_down(stands & ~self._stands, feet)
        self._stands = stands
        self._correct(feet, stands)
        return self.velocity + feet.slips(self.turn, rate, self._robot.foot_radius)

    def _rolling(self, feet: _Feet, rate: Array) -> Array:
        radius = self._robot.foot_radius
        return feet.slips(self.turn, rate, 0.0) - feet.slips(self.turn, rate, radius)

    def predict(self, rate: Array, force: Array, rolling: Array) -> Array:
        """Advance by a sample; return what it does to an error, (size, size)."""
        dt, turn = self._dt, self.turn
        inputs = np.zeros((len(self.covariance), 6))  # what gyro and accelerometer do to the error
        columns = np.concatenate([[self.velocity, self.position], self.feet])
        inputs[0:3, :3], inputs[3:6, 3:] = turn, turn
        inputs[3:-6, :3] = (skew(columns) @ turn).reshape(-1, 3)
        motion = np.zeros_like(self.covariance)
        motion[3:6, 0:3], motion[6:9, 3:6] = skew(GRAVITY), np.eye(3)
        motion[:, -6:] = -inputs
        motion *= dt
        step = np.eye(len(motion)) + motion + 0.5 * motion @ motion
        acceleration = turn @ force + GRAVITY
        self.position = self.position + dt * (self.velocity + 0.5 * dt * acceleration)
        self.velocity = self.velocity + dt * acceleration
        self.turn = turn @ rotation(rate * dt)
        self.feet = self.feet + dt * rolling
        shakes = math.hypot(self._noise.accelerometer, self.shakes)
        noise = dt * inputs * np.repeat((self._noise.gyro, shakes), 3)
        self.covariance = step @ self.covariance @ step.T + noise @ noise.T
        self.covariance.ravel()[:: len(step) + 1][9:-6] += self.stray**2 * dt
        return step

    def _spread(self, feet: _Feet) -> Array:
        arms = self.turn @ feet.jacobians
        return np.asarray(
            self._noise.encoder**2 * arms @ arms.transpose(0, 2, 1) + 3e-4**2 * np.eye(3)
        )

    def _set_down(self, chosen: Flags, feet: _Feet) -> None:
        spread = self._spread(feet)
        for leg in np.flatnonzero(chosen).tolist():
            at = slice(9 + 3 * leg, 12 + 3 * leg)
            self.feet[leg] = self.position + self.turn @ feet.places[leg]
            self.covariance[at] = self.covariance[6:9]
            self.covariance[:, at] = self.covariance[:, 6:9]
            self.covariance[at, at] = self.covariance[6:9, 6:9] + spread[leg]

    def _correct(self, feet: _Feet, stands: Flags) -> None:
        size, each = len(self.covariance), np.arange(len(stands))
        miss = feet.places @ self.turn.T + self.position - self.feet
        seen = self.covariance[9:-6].reshape(-1, 3, size) - self.covariance[6:9]
        spread = seen[:, :, 9:-6].reshape(-1, 3, len(each), 3) - seen[:, :, None, 6:9]
        spread[each, :, each] += self._spread(feet)
        alone = np.linalg.solve(spread[each, :, each], miss[..., None])[..., 0]
        slips = stands & ((miss * alone).sum(1) > self._gate)
        chosen = stands & ~slips
        rows = seen[chosen].reshape(-1, size)
        kept = spread[chosen][:, :, chosen].reshape(len(rows), len(rows))
        gain = np.linalg.solve(kept, rows).T
        self.covariance -= gain @ rows
        self.covariance = 0.5 * (self.covariance + self.covariance.T)
        self.apply(gain @ miss[chosen].ravel())
        self._set_down(slips, feet)

    def apply(self, error: Array) -> None:
        """Move the state by exp(error)."""
        turn = rotation(error[:3])
        angle = max(float(np.linalg.norm(error[:3])), 1e-6)
        axis = skew(error[:3] / angle)
        along = np.eye(3) + (1.0 - math.cos(angle)) / angle * axis
        along += (1.0 - math.sin(angle) / angle) * axis @ axis
        moves = error[3:-6].reshape(-1, 3) @ along.T
        self.turn = turn @ self.turn
        self.velocity = turn @ self.velocity + moves[0]
        self.position = turn @ self.position + moves[1]
        self.feet = self.feet @ turn.T + moves[2:]
        self.biases = self.biases + error[-6:].reshape(2, 3)

    def _deviation(self) -> Array:
        line = np.concatenate([-skew(self.velocity), np.eye(3)], axis=1)
        return np.asarray(np.sqrt(np.diag(line @ self.covariance[:6, :6] @ line.T)[:2]))

    def rows(self, log: Log) -> Rows:
        """Return position, velocity and its deviation, of the base, and the slips."""
        self.begin(log)
        arm = self._to_imu[:3, 3]
        rows: Rows = []
        for gyro, force, q, dq, stands in zip(
            *(log.gyro, log.accelerometer, log.joint_positions, log.joint_velocities),
            loads_of(self._robot, log),
            strict=True,
        ):
            slips = self.update(gyro, force, q, dq, stands)
            velocity = self.velocity + self.turn @ cross(gyro - self.biases[0], arm)
            rows.append((self.position + self.turn @ arm, velocity, slips, self._deviation()))
        return rows


class PlainFilter:
    """Error-state filter of a practitioner (Bloesch 2012), with places of feet in odom.

    State: rotation, velocity, position, biases of gyro and accelerometer, feet. Feet are taken in
    the order of their consistency. One whose squared innovation is above 99 % of χ², or that has
    landed, keeps its height alone until its contact was slow for 30 ms.
    """

    stray, kinematics, patience = 1e-3, 5e-4, 0.03  # m after 1 s, m, s

    def __init__(self, robot: Robot, course: Course) -> None:
        self._robot, self._dt, self._noise = robot, 1.0 / course.rate, course.noise
        self._to_imu: Array = np.asarray(np.linalg.inv(robot.imu), dtype=float)
        legs = len(robot.legs)
        self._turn = np.eye(3)
        self._state = np.zeros((4 + legs, 3))  # position, velocity, two biases, feet
        deviations = [0.01, 0.01, 0.0, *[0.02] * 3, *[0.0] * 3, *[GYRO_BIAS] * 3]
        deviations += [course.noise.accelerometer_bias] * 3 + [0.0] * 3 * legs
        self._covariance = np.diag(np.square(deviations))
        self._stands = self._loose = np.zeros(legs, dtype=bool)
        self._slow = np.zeros(legs)  # s

    def _lines(self, leg: int, arm: Array) -> Array:
        """Return what errors do to the place of a foot against where it stood, (3, size)."""
        lines = np.zeros((3, len(self._covariance)))
        lines[:, 0:3], lines[:, 6:9] = -skew(arm), np.eye(3)
        lines[:, 15 + 3 * leg : 18 + 3 * leg] = -np.eye(3)
        return lines

    def _set_down(self, leg: int, arm: Array, noise: Array, cells: int) -> None:
        """Make a new place for a foot, or only in the plane."""
        at = slice(15 + 3 * leg, 15 + 3 * leg + cells)
        lines = self._lines(leg, arm)[:cells]
        lines[:, 15:] = 0.0
        row = lines @ self._covariance
        self._state[4 + leg, :cells] = (self._state[0] + arm)[:cells]
        self._covariance[at], self._covariance[:, at] = row, row.T
        self._covariance[at, at] = lines @ self._covariance @ lines.T + noise[:cells, :cells]

    def _predict(self, rate: Array, force: Array, rolling: Array) -> None:
        dt, turn = self._dt, self._turn
        step = np.eye(len(self._covariance))
        step[3:6, 0:3], step[6:9, 3:6] = -dt * skew(turn @ force), dt * np.eye(3)
        step[0:3, 9:12] = step[3:6, 12:15] = -dt * turn
        self._turn = turn @ rotation(rate * dt)
        acceleration = 0.5 * (turn + self._turn) @ force + GRAVITY
        self._state[0] += dt * (self._state[1] + 0.5 * dt * acceleration)
        self._state[1] += dt * acceleration
        self._state[4:] += dt * rolling * self._stands[:, None]
        noise = np.repeat((self._noise.gyro, self._noise.accelerometer), 3) * dt
        self._covariance = step @ self._covariance @ step.T
        variances = self._covariance.ravel()[:: len(step) + 1]
        variances[:6] += noise**2
        variances[9:12] += 2e-5**2 * dt
        variances[12:15] += 1e-3**2 * dt
        variances[15:] += self.stray**2 * dt

    def _correct(self, leg: int, miss: Array, lines: Array, spread: Array) -> None:
        gain = np.linalg.solve(spread, lines @ self._covariance).T
        error = -gain @ miss
        spread = self._covariance - gain @ spread @ gain.T
        self._covariance = 0.5 * (spread + spread.T)
        self._turn = rotation(error[:3]) @ self._turn
        rows = error[3:].reshape(-1, 3)
        self._state += np.concatenate([rows[1:2], rows[:1], rows[2:]])

    def _stand(self, places: Array, noise: Array) -> None:
        """Correct with one foot after the other, the most consistent first."""
        left = np.flatnonzero(self._stands).tolist()
        while left:
            found = []
            for leg in left:
                arm, cells = self._turn @ places[leg], slice(2 if self._loose[leg] else 0, 3)
                miss = (self._state[0] + arm - self._state[4 + leg])[cells]
                lines = self._lines(leg, arm)[cells]
                spread = lines @ self._covariance @ lines.T + noise[leg][cells, cells]
                found.append((miss @ np.linalg.solve(spread, miss), leg, miss, lines, spread))
            distance, leg, *rest = min(found, key=lambda each: each[0])
            if distance <= GATE:
                self._correct(leg, *rest)
            elif not self._loose[leg]:
                self._loose[leg], self._slow[leg] = True, 0.0
                continue  # its height may still be right
            left.remove(leg)

    def rows(self, log: Log) -> Rows:
        """Return position, velocity and its deviation, of the base, and the slips."""
        axis = log.accelerometer[: round(1.0 / self._dt)].mean(0)
        self._turn = rotation(cross(axis / np.linalg.norm(axis), np.array((0.0, 0.0, 1.0))))
        self._state[2] = log.gyro[: round(1.0 / self._dt)].mean(0)
        arm, rows, radius = self._to_imu[:3, 3], [], self._robot.foot_radius
        for gyro, force, q, dq, stands in zip(
            *(log.gyro, log.accelerometer, log.joint_positions, log.joint_velocities),
            loads_of(self._robot, log),
            strict=True,
        ):
            feet, rate = _Feet(self._robot, self._to_imu, q, dq), gyro - self._state[2]
            rolling = feet.slips(self._turn, rate, 0.0) - feet.slips(self._turn, rate, radius)
            self._predict(rate, force - self._state[3], rolling)
            levers = self._turn @ feet.jacobians
            noise = self._noise.encoder**2 * levers @ levers.transpose(0, 2, 1)
            noise += self.kinematics**2 * np.eye(3)
            lands = stands & ~self._stands
            self._loose = (self._loose | lands) & stands
            self._slow[lands], self._stands = 0.0, stands
            for leg in np.flatnonzero(self._loose).tolist():
                place = self._turn @ feet.places[leg]
                self._set_down(leg, place, noise[leg], 3 if lands[leg] else 2)
            self._stand(feet.places, noise)
            slips = self._state[1] + feet.slips(self._turn, rate, radius)
            variances = self._covariance.diagonal()[3:5]
            white = 0.5 * self._noise.velocity**2 * (levers[:, :2] ** 2).sum((1, 2))
            slow = np.hypot(*slips.T[:2]) < 2.5 * np.sqrt(variances.mean() + white)
            self._slow = np.where(slow, self._slow + self._dt, 0.0)
            self._loose = self._loose & (self._slow < self.patience)
            velocity = self._state[1] + self._turn @ cross(rate, arm)
            place = self._state[0] + self._turn @ arm
            rows.append((place, velocity, slips, np.sqrt(variances)))
        return rows


FILTERS: dict[str, Callable[[Robot, Course], InvariantFilter | PlainFilter]] = {
    'plain': PlainFilter,
    'invariant, χ²': functools.partial(InvariantFilter, gate=GATE),
}
