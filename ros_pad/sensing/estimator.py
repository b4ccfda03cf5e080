# SPDX-License-Identifier: Apache-2.0
"""Estimator of a legged robot's motion: body, feet and slip from IMU, joints and foot forces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import instance, number
from ros_pad.errors import InvalidInput
from ros_pad.robots import Chains, Kinematics, Robot
from ros_pad.robots.rotation import Array, cross, quaternion, rotation, skew
from ros_pad.sensing import motion
from ros_pad.sensing.body_filter import GRAVITY, BodyFilter, Flags
from ros_pad.sensing.motion import BodyEstimate, FootMotion, Sample, checked
from ros_pad.sensing.plausibility import Delay, Joints, Legs, Repeats, Unloaded
from ros_pad.sensing.settings import SETTINGS

WEIGHT = -float(GRAVITY[2])  # m/s²

# Longest time between samples over which a foot keeps its foothold, s: then it may have stepped.
LONGEST_STEP = 0.03

# Longest time between samples that the IMU is taken to bridge, s: then the velocity is unknown.
LONGEST_GAP = 0.2

# Time for which feet may slip or be in the air before there is a doubt, s, and time for which a
# gap leaves one.
RECOVERY = 0.3

# Time for which all feet may slip before the velocity is taken to be wrong, s, if their slip
# velocities differ by less than this, m/s.
LOST, ALIKE = 2.0, 0.03

# Time for which a foot that has slipped must be slow before it counts as standing, s.
PATIENCE = 0.015

# Slip velocity of a foot that does not stand, in standard deviations.
TOO_FAST = 4.0

# What a body shakes between samples, which the accelerometer shows in part, m/s².
SHAKES = 0.1

# Variance of the place of a foot by the kinematics, m²: 0.5 mm in each component.
KINEMATICS = 5e-4**2 * np.eye(3)

# Deviation of the rotation after a time without readings of the IMU, rad.
BLIND_TURN = 0.1

UNKNOWN_BIAS = 0.02  # rad/s, of a gyro before any rest

_ROLLS = np.array(((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))  # w @ _ROLLS = w x z
_LEVEL = np.array((True, True, False))


def forces_of(chains: Chains, kinematics: Kinematics, efforts: Array, gravity: Array) -> Array:
    """Return the forces of the ground on the feet, (..., legs, 3), N, from joint torques, N m.

    ``gravity``, (3,), m/s², is in the axes of the kinematics.
    """
    lines = kinematics.jacobians
    holding = chains.gravity_torques(kinematics, gravity)
    # 1e-4 m² keeps forces finite where the leg is straight.
    square = lines @ lines.swapaxes(-1, -2) + 1e-4 * np.eye(3)
    return np.asarray(np.linalg.solve(square, lines @ (holding - efforts)[..., None])[..., 0])


class BodyEstimator:
    """Estimate motion of body and feet from IMU, joints and foot forces.

    Parameters
    ----------
    robot : Robot
        The robot whose sensors are read.
    **settings
        Noise of the sensors, and how forces are used: by the names, and with the defaults, of
        :class:`ros_pad.sensing.motion.Given`.

    Raises
    ------
    InvalidInput
        When a value is outside its range; the message names it.

    Examples
    --------
    A robot that stands for a second on all feet:

    >>> import numpy as np
    >>> from ros_pad.robots import Robot
    >>> from ros_pad.sensing import BodyEstimator
    >>> robot = Robot.load('go2')
    >>> estimator, joints = BodyEstimator(robot), robot.home.ravel()
    >>> forces = np.zeros((4, 3))
    >>> forces[:, 2] = 9.81 * robot.mass / 4
    >>> for time in np.arange(200) * 5e-3:
    ...     estimate = estimator.update(
    ...         time, [0, 0, 0], [0, 0, 9.81], joints, 0 * joints, foot_forces=forces
    ...     )
    >>> bool(np.linalg.norm(estimate.velocity) < 1e-3), [foot.excluded for foot in estimate.feet]
    (True, [False, False, False, False])
    """

    def __init__(self, robot: Robot, **settings: Any) -> None:
        instance('robot', robot, Robot)
        if not robot.mass > 0.0:
            raise InvalidInput(f'robot {robot.name!r} is not allowed: its links have no mass')
        self._robot = robot
        self._given = motion.Given(**settings)
        for setting in SETTINGS:
            if setting.name != 'forces':
                setting.accept(getattr(self._given, setting.name))
        errors = np.zeros((9, 9))
        errors[:3, 6:9] = errors[3:6, :3] = errors[6:9, 3:6] = np.eye(3)
        to_imu = np.asarray(np.linalg.inv(robot.imu), dtype=np.float64)
        load = robot.mass * WEIGHT / (0.5 * len(robot.legs))
        self._body = motion.Body(errors, to_imu, load)
        self._reset()

    def _reset(self) -> None:
        """Discard everything."""
        robot, given, legs = self._robot, self._given, len(self._robot.legs)
        force_noise = math.hypot(given.accelerometer_noise, SHAKES)
        self._filter = BodyFilter(legs, given.gyro_noise, force_noise)
        self._time = math.nan
        self._step = 0.0  # the last one, s
        self._feet = motion.Feet(legs)
        self._doubts = motion.Doubts(RECOVERY)
        self._checks = motion.Checks(
            Repeats(given.gyro_noise, given.velocity_noise),
            Joints(robot.joint_names),
            Legs(robot),
            Delay(given.gyro_noise),
            Unloaded(robot.legs, self._body.load),
        )
        self._rests = motion.Rest()
        self._pull = WEIGHT  # mean size of the specific force, m/s²

    def update(
        self,
        time: float,
        gyro: npt.ArrayLike,
        accelerometer: npt.ArrayLike,
        joint_positions: npt.ArrayLike,
        joint_velocities: npt.ArrayLike,
        foot_forces: npt.ArrayLike | None = None,
        efforts: npt.ArrayLike | None = None,
    ) -> BodyEstimate:
        """Process the readings of one moment.

        Parameters
        ----------
        time : float
            Time of the readings, s. Where it goes back, estimation begins anew.
        gyro, accelerometer : array (3,)
            Angular velocity, rad/s, and specific force, m/s² (+9.81 upwards at rest), IMU axes.
        joint_positions, joint_velocities : array (joints,)
            In the order of ``robot.joint_names``, rad and rad/s.
        foot_forces : array (legs, 3), optional
            Forces of the ground on the feet, N, in the axes of ``force_axes``.
        efforts : array (joints,), optional
            Joint torques, N m, from which forces are taken where there are no foot forces.

        Returns
        -------
        BodyEstimate
            Position, m, velocity, m/s, orientation and feet after this sample.

        Raises
        ------
        InvalidInput
            When a reading is not finite, has another shape, or has the time of the last one; the
            estimator is then as it was before.
        """
        time = number('time', time, 's', -1e12, 1e12)
        if time == self._time:
            raise InvalidInput(
                f'time = {time} s is not allowed: another time than that of the last sample is'
                ' needed'
            )
        shape, size, loads, torques = self._robot.home.shape, (self._robot.home.size,), None, None
        turn = checked('gyro', gyro, (3,), 'rad/s', 1e3)
        pull = checked('accelerometer', accelerometer, (3,), 'm/s2', 1e4)
        q = checked('joint_positions', joint_positions, size, 'rad', 1e4).reshape(shape)
        dq = checked('joint_velocities', joint_velocities, size, 'rad/s', 1e4).reshape(shape)
        if foot_forces is not None:
            loads = checked('foot_forces', foot_forces, (shape[0], 3), 'N', 1e6)
        if efforts is not None:
            torques = checked('efforts', efforts, size, 'N m', 1e6).reshape(shape)
        if time < self._time:
            self._reset()
            self._doubts.add(time, 'clock: time went back, odom begins anew')
        kinematics = self._robot.chains.solve(q, self._body.to_imu)
        forces = self._forces(time, kinematics, pull, loads, torques)
        sample = Sample(time, turn, pull, kinematics, dq, forces)
        if math.isnan(self._time):
            self._begin(sample)
        contradiction = self._checks.repeats.update(time, turn, pull, q, dq, forces)
        contradiction = self._checks.joints.update(time, time - self._time, q, dq) or contradiction
        if contradiction:
            self._doubts.add(time, contradiction)
            if contradiction.startswith('imu'):
                self._filter.lose(BLIND_TURN)
        rolling = self._rolling(sample)
        return self._process(sample, self._advance(sample, rolling), rolling)

    @property
    def delay(self) -> tuple[float, float]:
        """Delay of the joints behind the IMU, and its standard deviation, s; NaN until known."""
        return self._checks.delay.value, self._checks.delay.deviation

    def _forces(
        self,
        time: float,
        kinematics: Kinematics,
        accelerometer: Array,
        loads: Array | None,
        torques: Array | None,
    ) -> Array | None:
        """Return the forces on the feet, (legs, 3), N, in IMU axes, or None."""
        if loads is not None:
            self._feet.measured = True
            loads = self._checks.unloaded.update(time, loads, self._feet.climbing)
            if self._given.force_axes == 'foot':
                return np.asarray((kinematics.rotations @ loads[..., None])[..., 0])
            return np.asarray(loads @ self._robot.imu[:3, :3])
        if torques is None:
            return None
        self._feet.measured = False
        # The specific force has weight and inertia of the legs in one, as far as they move with
        # the body.
        return forces_of(self._robot.chains, kinematics, torques, -accelerometer)

    def _begin(self, sample: Sample) -> None:
        """Begin with the base at the origin, heading along x, tilted as the IMU shows."""
        time, gyro, accelerometer = sample[:3]
        strength, given = math.sqrt(accelerometer @ accelerometer), self._given
        calm = (
            abs(strength - WEIGHT) < 0.5
            and np.abs(gyro).max() < 0.05 + 4.0 * given.gyro_noise
            and np.abs(sample.rates).max() < 0.05 + 4.0 * given.velocity_noise
        )
        tilt = math.hypot(given.accelerometer_noise, given.accelerometer_bias) / WEIGHT
        body = self._filter
        body.spread(
            *((tilt + 2e-3, 0.02) if calm else (0.2, 0.5)),
            *(UNKNOWN_BIAS, max(given.accelerometer_bias, 1e-3)),
        )
        # The least rotation that turns the reading of the IMU upright, then the base to x.
        up = self._robot.imu[:3, :3] @ accelerometer / max(strength, 1e-9)
        axis = cross(up, np.array((0.0, 0.0, 1.0)))
        sine = math.sqrt(axis @ axis)
        angle = math.atan2(sine, up[2])
        turn = rotation(axis / sine * angle if sine > 1e-9 else (angle, 0.0, 0.0))
        heading = math.atan2(turn[1, 0], turn[0, 0])
        turn = rotation((0.0, 0.0, -heading)) @ turn
        body.turn = turn @ self._robot.imu[:3, :3]
        body.position = -body.turn @ self._body.to_imu[:3, 3]
        self._time = self._feet.held = self._feet.sliding_since = time
        if not calm and time >= self._doubts.until:
            self._doubts.add(time, 'start: the robot may be moving')

    def _advance(self, sample: Sample, rolling: Array) -> float:
        """Advance the filter to the time of the readings; return the step, s, 0 after a gap."""
        time, gyro, accelerometer = sample[:3]
        dt, before, self._time = time - self._time, self._step, time
        self._step = dt
        if dt > LONGEST_GAP:
            self._doubts.add(time, f'gap: no readings for {dt:.2g} s')
            self._filter.lose(BLIND_TURN)
        elif dt > LONGEST_STEP:
            self._filter.lose(0.5 * dt, 4.0 * dt)  # of a body that turns and speeds up, SI units
            if before > LONGEST_STEP:  # no foot keeps its foothold
                text = f'readings are {dt:.2g} s apart, {LONGEST_STEP} s at most are needed'
                self._doubts.add(time, f'rate: {text}')
        if dt > LONGEST_STEP:
            self._feet.sliding_since = time
            self._feet.standing[:] = False  # their footholds are made anew
        # What happened in a gap is unknown: the body is taken to have stood.
        step = dt if dt <= LONGEST_GAP else 0.0
        rolls = rolling * self._feet.standing[:, None]
        self._filter.predict(step, gyro, accelerometer, rolls)
        # One reading after a gap says nothing about the time without readings.
        self._pull += (math.sqrt(accelerometer @ accelerometer) - self._pull) * step
        return step

    def _rolling(self, sample: Sample) -> Array:
        """Return the velocities with which the feet roll on level ground, (legs, 3), m/s."""
        turning = (sample.kinematics.angular @ sample.rates[..., None])[..., 0]
        turning = (turning + sample.gyro - self._filter.gyro_bias) @ self._filter.turn.T
        return self._robot.foot_radius * (turning @ _ROLLS)

    def _process(self, sample: Sample, dt: float, rolling: Array) -> BodyEstimate:
        """Correct the filter with the feet, and return the estimate."""
        time, gyro, _, kinematics, dq, forces = sample
        body, feet = self._filter, self._feet
        lands = self._load(sample)
        moves = ~feet.standing | lands | self._checks.legs.against
        free = moves[:, None] | feet.excluded[:, None] & _LEVEL
        lines = body.turn @ kinematics.jacobians
        squares = lines @ lines.transpose(0, 2, 1)
        noise = self._given.encoder_noise**2 * squares + KINEMATICS
        moved = body.stand(kinematics.positions @ body.turn.T, noise, free)
        if not body.sound():
            # Begin anew after readings that no robot can have made.
            self._reset()
            self._begin(sample)
            self._doubts.add(time, 'diverged: odom begins anew')
            self._advance(sample, rolling)
            return self._process(sample, 0.0, rolling)
        self._rest(sample)
        turn = body.turn
        rate = gyro - body.gyro_bias
        moving = (kinematics.jacobians @ dq[..., None])[..., 0]
        moving = (moving - kinematics.positions @ skew(rate)) @ turn.T
        velocities = body.velocity + moving
        feet.climbing = velocities[:, 2]
        slips = velocities - rolling
        feet.smooth(dt, slips[:, :2], lands)
        variance = body.covariance
        common = 0.5 * (variance[3, 3] + variance[4, 4])
        lever = 0.5 * (squares[:, 0, 0] + squares[:, 1, 1])
        deviations = np.sqrt(feet.white * self._given.velocity_noise**2 * lever + common)
        speeds = np.hypot(feet.slip[:, 0], feet.slip[:, 1])
        self._judge(time, moved[:, 0], speeds / deviations)
        places = kinematics.positions @ turn.T
        sticking = feet.standing & (speeds < 0.05)  # m/s
        self._checks.delay.update(time, turn @ rate, places, slips, sticking)
        self._checks.legs.update(
            dt, feet.standing, feet.excluded, speeds, np.hypot(moving[:, 0], moving[:, 1])
        )
        return self._estimate(time, rate, places, velocities, forces, deviations)

    def _load(self, sample: Sample) -> Flags:
        """Update which feet stand; return those that landed with this sample."""
        before = self._feet.standing
        if sample.forces is None:
            self._feet.standing, self._feet.excluded = np.zeros((2, len(before)), dtype=bool)
            self._doubts.add(sample.time, 'force: neither foot forces nor efforts')
            return self._feet.standing
        loads = sample.forces @ self._filter.turn[2]
        share = self._given.contact_share or (0.1 if self._feet.measured else 0.25)
        gate = share * self._body.load
        self._feet.standing = loads > np.where(before, gate, gate + 3.0 * self._given.force_noise)
        lands = self._feet.standing & ~before
        self._feet.excluded = (self._feet.excluded & self._feet.standing) | lands
        self._feet.slow_since[lands] = math.inf
        return lands

    def _judge(self, time: float, moved: Flags, speeds: Array) -> None:
        """Update which feet are excluded; ``speeds`` of slip are in standard deviations."""
        feet, fast = self._feet, speeds > TOO_FAST
        fresh = feet.standing & ~feet.excluded & (moved | fast)
        slow = feet.standing & ~(fresh | fast)
        feet.slow_since = np.where(slow, np.minimum(feet.slow_since, time), math.inf)
        feet.excluded |= fresh
        sticks = time - feet.slow_since >= PATIENCE
        # After a doubt one foot of several may be slow by chance, two are not.
        if time - feet.held < RECOVERY or sticks.sum() >= min(2, feet.standing.sum()):
            feet.excluded &= ~sticks
        sticking = feet.standing & ~feet.excluded
        if sticking.any():
            feet.held = time
        if sticking.any() or not feet.standing.any():
            feet.sliding_since = time
        elif (
            time - feet.sliding_since > LOST
            and feet.standing.sum() > 1
            and np.ptp(feet.slip[feet.standing], axis=0).max() < ALIKE
        ):
            # All feet that slip alike for so long stick, and the velocity is wrong.
            self._filter.lose()
            feet.excluded[:] = False
            feet.held = feet.sliding_since = time
            text = 'slipping: all feet slipped alike, velocity is estimated anew'
            self._doubts.add(time, text)

    def _rest(self, sample: Sample) -> None:
        """Average the gyro while nothing moves, and correct its bias."""
        time, gyro = sample[:2]
        given, rests, body = self._given, self._rests, self._filter
        turning = 0.02 + 5.0 * given.gyro_noise + 3.0 * math.sqrt(body.covariance[9, 9])
        still = bool(
            self._feet.standing.all()
            and np.abs(sample.rates).max() < 0.02 + 5.0 * given.velocity_noise
            and np.abs(gyro - body.gyro_bias).max() < turning
        )
        if not still or rests.count == 0:
            rests.since, rests.total, rests.count = time, np.zeros(3), 0
        if still:
            rests.total, rests.count = rests.total + gyro, rests.count + 1
            if time - rests.since >= 0.2:
                mean = rests.total / rests.count
                # Nothing is quite at rest: 3e-4 rad/s.
                body.rest(mean, math.hypot(given.gyro_noise / math.sqrt(rests.count), 3e-4))
                rests.count = 0

    def _estimate(
        self,
        time: float,
        rate: Array,
        places: Array,
        velocities: Array,
        forces: Array | None,
        deviations: Array,
    ) -> BodyEstimate:
        body = self._filter
        turn = body.turn
        arm = turn @ self._body.to_imu[:3, 3]
        to_odom = turn @ self._body.to_imu[:3, :3]
        centres = places + body.position
        loads = np.zeros_like(places) if forces is None else forces @ turn.T
        state = self._feet
        flags = state.standing.tolist(), state.slip.copy(), deviations.tolist()
        feet = tuple(map(FootMotion, centres, velocities, loads, *flags, state.excluded.tolist()))
        axes = skew(arm)
        velocity = body.velocity - axes @ (turn @ rate)
        # From the filter's errors to those of the base: rotation moves it about the IMU.
        step = self._body.errors
        step[:3, :3] = -axes
        step[6:9, :3] = -skew(velocity)
        covariance = step @ body.covariance[:9, :9] @ step.T
        return BodyEstimate(
            time,
            body.position + arm,
            quaternion(to_odom),
            velocity,
            covariance,
            feet,
            self._doubt(time),
        )

    def _doubt(self, time: float) -> str:
        if time < self._doubts.until:
            return self._doubts.reason
        if abs(self._pull - WEIGHT) > 1.0:
            return f'gravity: the accelerometer shows {self._pull:.2g} m/s2 on average'
        for readings in (self._checks.legs, self._checks.delay, self._checks.unloaded):
            if doubt := readings.doubt():
                return doubt
        if time - self._feet.held > RECOVERY:
            if self._feet.standing.any():
                return 'slipping: all feet that stand may slip'
            return 'no contact: no foot stands'
        return ''
