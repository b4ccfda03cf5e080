# SPDX-License-Identifier: Apache-2.0
"""Rivals of the body estimator: a plain filter with 27 states, and legged odometry."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.robots.rotation import cross
from ros_pad.robots.rotation import rotation
from ros_pad.robots.rotation import skew
from ros_pad.sensing.body_filter import GRAVITY
from studies.samples import Flags
from studies.sensing.walks import Course
from studies.sensing.walks import Log

Rows = list[tuple[Any, ...]]
GATE = 11.3  # 99 % of χ² with 3 degrees of freedom
CALM, SLOW = 0.03, 2.5  # s, and standard deviations of the speed, until a foot sticks again
SLIDING = 0.4  # m/s, noise of a foothold that slips
STRAY = 0.01  # m after 1 s, random motion of a foothold
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


def odometry(robot: Robot, log: Log, course: Course, radius: float) -> Rows:
    """Return legged odometry: heading and tilt from the gyro, speed from the feet that stand.

    Rows have position and velocity of the base, and slip velocities of the feet. ``radius``, m, is
    that with which the feet roll.
    """
    bias = log.gyro[: round(1.8 * course.rate)].mean(0)
    turn, position, held = np.eye(3), np.zeros(3), np.zeros(3)
    rows: Rows = []
    for gyro, q, dq, stands in zip(
        log.gyro, log.joint_positions, log.joint_velocities, loads_of(robot, log), strict=True
    ):
        rate = robot.imu[:3, :3] @ (gyro - bias)
        turn = turn @ rotation(rate / course.rate)
        slips = _Feet(robot, np.eye(4), q, dq).slips(turn, rate, radius)
        held = -slips[stands].mean(0) if stands.any() else held
        position = position + held / course.rate
        rows.append((position, held, held + slips))
    return rows


class PlainFilter:
    """Error-state filter of 15 + 3 legs states, feet taken one by one.

    Rotation, velocity, position, biases and footholds, with errors in odom axes (Bloesch 2012);
    a foot whose innovation is above 99 % of its χ² is taken to slip: then only its height counts,
    until its speed was low for 30 ms.
    """

    def __init__(self, robot: Robot, course: Course) -> None:
        self._robot, self._dt = robot, 1.0 / course.rate
        self._noise = course.noise
        legs = len(robot.legs)
        self._to_imu: Array = np.asarray(np.linalg.inv(robot.imu), dtype=float)
        self.turn, self.velocity, self.position = np.eye(3), np.zeros(3), np.zeros(3)
        self.biases, self.feet = np.zeros((2, 3)), np.zeros((legs, 3))
        deviations = [0.01, 0.01, 0.0, *[0.02] * 3, *[0.0] * 3, *[0.02] * 3]
        deviations += [course.noise.accelerometer_bias] * 3 + [0.0] * 3 * legs
        self._covariance = np.diag(np.square(deviations))
        self._stands = np.zeros(legs, dtype=bool)
        self._slow = np.full(legs, math.inf)  # time for which each foot was slow, s

    def begin(self, log: Log) -> None:
        """Take tilt and bias of the gyro from the readings at rest."""
        still = slice(0, round(1.0 / self._dt))
        up = log.accelerometer[still].mean(0)
        axis = cross(up / np.linalg.norm(up), np.array((0.0, 0.0, 1.0)))
        self.turn = rotation(axis)
        self.biases[0] = log.gyro[still].mean(0)
        self._covariance[9:12, 9:12] = 5e-4**2 * np.eye(3)

    def update(self, gyro: Array, force: Array, q: Array, dq: Array, stands: Flags) -> Array:
        """Process a sample; return the slip velocities of the feet, (legs, 3), m/s."""
        feet = _Feet(self._robot, self._to_imu, q, dq)
        rate = gyro - self.biases[0]
        rolling = feet.slips(self.turn, rate, 0.0) - feet.slips(
            self.turn, rate, self._robot.foot_radius
        )
        self._predict(rate, force - self.biases[1], rolling)
        for leg in np.flatnonzero(stands & ~self._stands).tolist():
            self._set_down(leg, feet)
        self._stands = stands
        scores = {leg: self._score(leg, feet)[2] for leg in np.flatnonzero(stands).tolist()}
        for leg in sorted(scores, key=scores.__getitem__):
            self._correct(leg, feet)
        slips = self.velocity + feet.slips(self.turn, rate, self._robot.foot_radius)
        speed = np.sqrt(0.5 * (self._covariance[3, 3] + self._covariance[4, 4]) + 0.01**2)
        slow = np.linalg.norm(slips[:, :2], axis=1) < SLOW * speed
        self._slow = np.where(slow, self._slow + self._dt, 0.0 * self._slow.clip(0.0, 1.0))
        return slips

    def _predict(self, rate: Array, force: Array, rolling: Array) -> None:
        dt, turn = self._dt, self.turn
        acceleration = turn @ force
        size = len(self._covariance)
        step, noise = np.eye(size), np.zeros(size)
        step[0:3, 9:12] = -dt * turn
        step[3:6, 0:3] = -dt * skew(acceleration)
        step[3:6, 12:15] = -dt * turn
        step[6:9, 3:6] = dt * np.eye(3)
        self.position = self.position + dt * (self.velocity + 0.5 * dt * (acceleration + GRAVITY))
        self.velocity = self.velocity + dt * (acceleration + GRAVITY)
        self.turn = turn @ rotation(rate * dt)
        self.feet += dt * rolling
        noise[0:3] = (dt * self._noise.gyro) ** 2
        noise[3:6] = (dt * math.hypot(self._noise.accelerometer, 0.3)) ** 2
        slides = self._slow < CALM
        strays = np.tile(STRAY**2 * dt, (len(slides), 3))
        strays[slides, :2] = SLIDING**2 * dt * 0.05
        noise[15:] = strays.ravel()
        self._covariance = step @ self._covariance @ step.T + np.diag(noise)

    def _set_down(self, leg: int, feet: _Feet) -> None:
        arm = self.turn @ feet.places[leg]
        self.feet[leg] = self.position + arm
        at = slice(15 + 3 * leg, 18 + 3 * leg)
        line = np.zeros((3, len(self._covariance)))
        line[:, 0:3], line[:, 6:9] = -skew(arm), np.eye(3)
        self._covariance[at] = line @ self._covariance
        self._covariance[:, at] = self._covariance[at].T
        self._covariance[at, at] = line @ self._covariance @ line.T + self._spread(leg, feet)
        self._slow[leg] = math.inf

    def _spread(self, leg: int, feet: _Feet) -> Array:
        arm = self.turn @ feet.jacobians[leg]
        return np.asarray(self._noise.encoder**2 * arm @ arm.T + 3e-4**2 * np.eye(3))

    def _score(self, leg: int, feet: _Feet) -> tuple[Array, Array, float, Array]:
        arm = self.turn @ feet.places[leg]
        line = np.zeros((3, len(self._covariance)))
        line[:, 0:3], line[:, 6:9] = skew(arm), -np.eye(3)
        line[:, 15 + 3 * leg : 18 + 3 * leg] = np.eye(3)
        miss = arm - (self.feet[leg] - self.position)
        spread = line @ self._covariance @ line.T + self._spread(leg, feet)
        return line, miss, float(miss @ np.linalg.solve(spread, miss)), spread

    def _correct(self, leg: int, feet: _Feet) -> None:
        line, miss, score, spread = self._score(leg, feet)
        if score > GATE:
            self._slow[leg] = 0.0
            at = 15 + 3 * leg
            self._covariance[at, at] += 0.02**2
            self._covariance[at + 1, at + 1] += 0.02**2
            line, miss, _, spread = self._score(leg, feet)
        gain = np.linalg.solve(spread, line @ self._covariance).T
        error = gain @ miss
        self._covariance -= gain @ line @ self._covariance
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self.turn = rotation(error[0:3]) @ self.turn
        self.velocity = self.velocity + error[3:6]
        self.position = self.position + error[6:9]
        self.biases += error[9:15].reshape(2, 3)
        self.feet += error[15:].reshape(-1, 3)

    def row(self, gyro: Array, slips: Array) -> tuple[Any, ...]:
        """Return position, velocity and its deviation, of the base, and the slips."""
        arm = self._to_imu[:3, 3]
        rate = gyro - self.biases[0]
        return (
            self.position + self.turn @ arm,
            self.velocity + self.turn @ cross(rate, arm),
            slips,
            np.sqrt(np.diag(self._covariance)[3:5]),
        )


def plain(robot: Robot, log: Log, course: Course) -> Rows:
    """Return rows of :class:`PlainFilter`, like those of :func:`odometry`."""
    found = PlainFilter(robot, course)
    found.begin(log)
    rows: Rows = []
    for gyro, force, q, dq, stands in zip(
        *(log.gyro, log.accelerometer, log.joint_positions, log.joint_velocities),
        loads_of(robot, log),
        strict=True,
    ):
        rows.append(found.row(gyro, found.update(gyro, force, q, dq, stands)))
    return rows
