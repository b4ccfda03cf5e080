# SPDX-License-Identifier: Apache-2.0
"""Estimator of a legged robot's motion: body, feet and slip from IMU, joints and foot forces."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice, instance, number, quantity
from ros_pad.errors import InvalidInput
from ros_pad.robots import Kinematics, Robot
from ros_pad.robots.rotation import Array, cross, quaternion, rotation, skew
from ros_pad.sensing.body_filter import GATE, GRAVITY, BodyFilter, Flags
from ros_pad.sensing.plausibility import Delay, Joints, Legs, Repeats, Shift, Unloaded
from ros_pad.sensing.slip_window import SlipWindow

WEIGHT = -float(GRAVITY[2])  # m/s²

LONGEST_STEP = 0.03
"""Longest time between samples over which a foot keeps its foothold, s: then it may have
stepped."""

LONGEST_GAP = 0.2
"""Longest time between samples that the IMU is taken to bridge, s: then the velocity is
unknown."""

RECOVERY = 0.3
"""Time for which feet may slip or be in the air before there is a doubt, s, and time for which a
gap leaves one."""

LOST = 2.0
"""Time for which all feet may slip before the velocity is taken to be wrong, s, if they slip
alike."""

ALIKE = 0.03
"""Largest difference of slip velocities that are alike, m/s."""

STICKS = 0.03
"""Time for which a slipping foot has to be slow before it counts as sticking, s."""

SETTLES = 0.012
"""The same for a foot that has just landed, s: it skids first."""

SLOW = 2.5
"""Standard deviations of the slip speed up to which a foot is slow."""

FAST = 4.0
"""Standard deviations of the slip speed from which on a foot slips."""

REST_TIME = 0.2
"""Time over which the gyro is averaged when the body is at rest, s."""

BIAS_FLOOR = 3e-4
"""Deviation of such a mean from the bias of the gyro, rad/s: nothing is quite at rest."""

BLIND_TURN = 0.1
"""Deviation of the rotation after a time without readings of the IMU, rad."""

BLIND_RATE, BLIND_ACCELERATION = 0.5, 4.0
"""Deviations of angular velocity, rad/s, and acceleration, m/s², of a body between samples that
are far apart."""

CALM = 0.05
"""Slip speed up to which feet show a delay, m/s."""

CREEP = 0.03
"""Random motion of feet that stand, m after 1 s, over the share of slips beyond SLIPPERY."""

LOOK = 0.25
"""Time between two looks at the length of the legs, s."""

WRONG_LENGTH = 0.06
"""Relative error of the length of the legs above which that of the robot's file is wrong."""

LEARNT = 0.05
"""Share of its variance that walking must have taken away before."""

UNKNOWN_LENGTH = 0.05
"""Its deviation from then on."""

KNOWN_LENGTH = 0.012
"""Its deviation below which it is known again."""

UNSTEADY = 1.5
"""Factor on the variance of a mean of slip velocities, as they vary in their window: neighbours
are not independent."""

UNKNOWN_BIAS = 0.02  # rad/s, of a gyro before any rest
_NONE = np.zeros(0)
FOOT_NOISE = 1e-4  # m: kinematics that are not quite right
DAMPING = 1e-4  # m²: keeps forces finite where the leg is straight


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
        Velocity of the contact point, x and y, m/s: mean of the last samples, see ``window``.
    slip_velocity_sd : float
        Standard deviation of each of its components, m/s. It includes that of the body's
        velocity, which is common to all feet and lasts for about a stance.
    slipping : bool
        Whether the foot carries load but is not consistent with standing still, or has landed
        less than 12 ms ago.
    """

    position: Array
    velocity: Array
    force: Array
    in_contact: bool
    slip_velocity: Array
    slip_velocity_sd: float
    slipping: bool


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


class BodyEstimator:
    """Estimate motion of body and feet from IMU, joints and foot forces.

    Parameters
    ----------
    robot : Robot
        The robot whose sensors are read.
    gyro_noise : float
        Standard deviation of a sample of the gyro, rad/s, above 0 up to 1.
    accelerometer_noise : float
        Of the accelerometer, m/s², above 0 up to 10.
    encoder_noise : float
        Of a joint position, rad, above 0 up to 0.1.
    velocity_noise : float
        Of a joint velocity, rad/s, above 0 up to 10.
    force_noise : float
        Of a component of a foot's force, N, 0 to 1000.
    accelerometer_bias : float
        Standard deviation of the accelerometer's bias, m/s², 0 to 5.
    contact_share : float, optional
        Share of the expected load above which a foot stands, 0.01 to 0.9; by default 0.1, and 0.25
        where the force comes from joint torques. The expected load is the weight over half of the
        legs.
    window : float
        Length of the window of slip velocities, s, 0 to 1.
    rate : float
        Most samples a second that are expected, Hz, 10 to 10000: with more, the window is shorter.
    force_axes : str
        ``base`` if the foot forces come in the axes of the base, ``foot`` for those of the links
        of the feet.
    radius_error : float
        Standard deviation of the radius with which feet roll, as a share of the robot's
        ``foot_radius``, 0 to 1: soft feet sink in.
    length_error : float
        Standard deviation of the relative error of the length of all legs, 0 to 0.5.
    joint_delay : float
        Time by which joints and forces are later than the IMU, s, -0.05 to 0.05: what came first
        waits, so estimates are as late. :attr:`delay` shows it after some seconds of walking.
    rejection : bool
        Whether feet that slip are kept out; without it this is the plain filter of Bloesch (2012).

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
    >>> bool(np.linalg.norm(estimate.velocity) < 1e-3), [foot.slipping for foot in estimate.feet]
    (True, [False, False, False, False])
    """

    def __init__(
        self,
        robot: Robot,
        gyro_noise: float = 0.005,
        accelerometer_noise: float = 0.05,
        encoder_noise: float = 5e-4,
        velocity_noise: float = 0.03,
        force_noise: float = 0.3,
        accelerometer_bias: float = 0.05,
        contact_share: float | None = None,
        window: float = 0.02,
        rate: float = 1000.0,
        force_axes: str = 'base',
        radius_error: float = 0.05,
        length_error: float = 0.003,
        joint_delay: float = 0.0,
        rejection: bool = True,
    ) -> None:
        instance('robot', robot, Robot)
        if not robot.mass > 0.0:
            raise InvalidInput(f'robot {robot.name!r} is not allowed: its links have no mass')
        self._robot = robot
        self._gyro_noise = number('gyro_noise', gyro_noise, 'rad/s', 0.0, 1.0, above=True)
        self._accelerometer_noise = number(
            'accelerometer_noise', accelerometer_noise, 'm/s2', 0.0, 10.0, above=True
        )
        self._encoder_noise = number('encoder_noise', encoder_noise, 'rad', 0.0, 0.1, above=True)
        self._velocity_noise = number(
            'velocity_noise', velocity_noise, 'rad/s', 0.0, 10.0, above=True
        )
        self._force_noise = number('force_noise', force_noise, 'N', 0.0, 1000.0)
        self._bias = number('accelerometer_bias', accelerometer_bias, 'm/s2', 0.0, 5.0)
        if contact_share is not None:
            number('contact_share', contact_share, '(share)', 0.01, 0.9)
        self._contact_share = contact_share
        rate = number('rate', rate, 'Hz', 10.0, 10000.0)
        self._length = number('window', window, 's', 0.0, 1.0)
        self._samples = max(1, round(self._length * rate))
        self._in_foot_axes = choice('force_axes', force_axes, ('base', 'foot')) == 'foot'
        self._radius_error = number('radius_error', radius_error, '(share)', 0.0, 1.0)
        self._late = number('joint_delay', joint_delay, 's', -0.05, 0.05)
        self._length_error = number('length_error', length_error, '(share)', 0.0, 0.5)
        self._rejection = rejection
        self._to_base = np.zeros((9, 9))
        self._to_base[:3, 6:9] = self._to_base[3:6, :3] = self._to_base[6:9, 3:6] = np.eye(3)
        self._to_imu = np.asarray(np.linalg.inv(robot.imu), dtype=np.float64)
        hips = np.concatenate([robot.hips, np.ones((len(robot.legs), 1))], axis=1)
        self._hips = (hips @ self._to_imu.T)[:, :3]
        self._reset()

    def _reset(self) -> None:
        """Discard everything."""
        robot, legs = self._robot, len(self._robot.legs)
        self._filter = BodyFilter(
            legs,
            self._gyro_noise,
            self._accelerometer_noise,
            GATE if self._rejection else math.inf,
        )
        self._window = SlipWindow(
            legs, self._length, self._samples, self._encoder_noise, self._velocity_noise
        )
        self._shift = Shift(abs(self._late))
        self._time = math.nan
        self._step = 0.0  # the last one, s
        self._measured = True  # whether forces are measured, not computed from torques
        self._standing = np.zeros(legs, dtype=bool)
        self._slipping = np.zeros(legs, dtype=bool)
        self._slow_since = np.full(legs, math.inf)
        self._patience = np.full(legs, STICKS)
        self._spin = np.zeros((legs, 3))  # velocity of rolling for a radius of 1 m, 1/s
        self._held = math.inf  # when a foot last stuck
        self._sliding_since = math.inf  # since when feet stand and none of them sticks
        self._unsure_until, self._reason = -math.inf, ''
        self._repeats = Repeats(self._gyro_noise, self._velocity_noise)
        self._joints = Joints(robot.joint_names)
        self._agreement = Legs(robot)
        self._delay = Delay(self._gyro_noise)
        self._stretched = False  # whether legs of another length were found
        self._look = math.nan  # when their length is looked at again
        self._rest_since, self._rest_sum, self._rest_count = math.nan, np.zeros(3), 0
        self._pull = WEIGHT
        self._expected = robot.mass * WEIGHT / (0.5 * legs)
        self._unloaded = Unloaded(robot.legs, self._expected)
        self._climbing = np.zeros(legs)  # vertical speeds of the feet, m/s

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
        time, given = self._checked(
            time, gyro, accelerometer, joint_positions, joint_velocities, foot_forces, efforts
        )
        if self._late > 0.0:
            given[:2] = self._shift.update(time, given[:2])
        elif self._late < 0.0:
            given[2:] = self._shift.update(time, given[2:])
        gyro, accelerometer, q, dq = given[:4]
        kinematics = self._robot.chains.solve(q, self._to_imu)
        forces = self._forces(time, kinematics, accelerometer, foot_forces is not None, given[4])
        if time < self._time:
            self._reset()
            self._doubt_for(time, 'clock: time went back, odom begins anew')
        if math.isnan(self._time):
            self._begin(time, gyro, accelerometer, dq)
        contradiction = self._repeats.update(time, gyro, accelerometer, q, dq, forces)
        contradiction = self._joints.update(time, time - self._time, q, dq) or contradiction
        if contradiction:
            self._doubt_for(time, contradiction)
            if contradiction.startswith('imu'):
                self._filter.lose(BLIND_TURN)
        dt = self._advance(time, gyro, accelerometer)
        return self._process(time, dt, gyro, accelerometer, kinematics, dq, forces)

    @property
    def delay(self) -> tuple[float, float]:
        """Delay of the joints behind the IMU, and its standard deviation, s.

        It is apart from ``joint_delay``, and NaN before it is known.
        """
        return self._delay.value, self._delay.deviation

    @property
    def foot_radius(self) -> tuple[float, float]:
        """Radius with which feet roll, as estimated, and its standard deviation, m."""
        return self._filter.radius, self._filter.deviations[0]

    @property
    def length_error(self) -> tuple[float, float]:
        """Relative error of the length of the legs, as estimated, and its standard deviation."""
        return self._filter.scale, self._filter.deviations[1]

    def _checked(self, time: float, *readings: npt.ArrayLike | None) -> tuple[float, list[Array]]:
        """Return time and readings as arrays; raise `InvalidInput` for those not allowed."""
        time = number('time', time, 's', -1e12, 1e12)
        if time == self._time:
            raise InvalidInput(
                f'time = {time} s is not allowed: another time than that of the last sample is'
                ' needed'
            )
        foot_forces = readings[4]
        joints = self._robot.home.shape
        size = (joints[0] * joints[1],)
        names = (
            ('gyro', (3,), 'rad/s', 1e3),
            ('accelerometer', (3,), 'm/s2', 1e4),
            ('joint_positions', size, 'rad', 1e4),
            ('joint_velocities', size, 'rad/s', 1e4),
            ('foot_forces', (joints[0], 3), 'N', 1e6),
            ('efforts', size, 'N m', 1e6),
        )
        # The last two may be missing.
        given: list[tuple[tuple[str, tuple[int, ...], str, float], Any]] = [
            (names[place], reading)
            for place, reading in enumerate(readings)
            if reading is not None or place < 4
        ]
        # One look at all of them is enough if they are fine; NaN is not below the limit.
        if not (
            all(
                isinstance(values, np.ndarray) and values.dtype == float and values.shape == shape
                for (_, shape, _, _), values in given
            )
            and np.abs(np.concatenate([np.ravel(values) for _, values in given])).max() < 1e3
        ):
            for (name, shape, unit, most), values in given:
                found = quantity(name, values, unit, -most, most)
                if found.shape != shape:
                    raise InvalidInput(
                        f'{name} of shape {found.shape} is not allowed: {shape} is needed'
                    )
        arrays = [np.asarray(values, dtype=float) for _, values in given]
        for index in (2, 3) if foot_forces is not None else (2, 3, 4)[: len(arrays) - 2]:
            arrays[index] = arrays[index].reshape(joints)
        return time, [*arrays, _NONE]

    def _forces(
        self,
        time: float,
        kinematics: Kinematics,
        accelerometer: Array,
        measured: bool,
        given: Array,
    ) -> Array | None:
        """Return the forces on the feet, (legs, 3), N, in IMU axes, or None."""
        if not given.size:
            return None
        self._measured = measured
        if measured:
            given = self._unloaded.update(time, given, self._climbing)
            if self._in_foot_axes:
                return np.asarray((kinematics.rotations @ given[..., None])[..., 0])
            return np.asarray(given @ self._robot.imu[:3, :3])
        # The specific force has weight and inertia of the legs in one, as far as they move with
        # the body.
        lines = kinematics.jacobians
        holding = self._robot.chains.gravity_torques(kinematics, -accelerometer)
        square = lines @ lines.transpose(0, 2, 1) + DAMPING * np.eye(3)
        return np.asarray(np.linalg.solve(square, lines @ (holding - given)[..., None])[..., 0])

    def _begin(self, time: float, gyro: Array, accelerometer: Array, dq: Array) -> None:
        """Begin with the base at the origin, heading along x, tilted as the IMU shows."""
        strength = math.sqrt(accelerometer @ accelerometer)
        calm = (
            abs(strength - WEIGHT) < 0.5
            and np.abs(gyro).max() < 0.05 + 4.0 * self._gyro_noise
            and np.abs(dq).max() < 0.05 + 4.0 * self._velocity_noise
        )
        tilt = math.hypot(self._accelerometer_noise, self._bias) / WEIGHT
        body = self._filter
        body.spread(
            *((tilt + 2e-3, 0.02) if calm else (0.2, 0.5)),
            *(UNKNOWN_BIAS, max(self._bias, 1e-3)),
            *(self._radius_error * self._robot.foot_radius, self._length_error),
        )
        body.radius = self._robot.foot_radius
        # The least rotation that turns the reading of the IMU upright, then the base to x.
        up = self._robot.imu[:3, :3] @ accelerometer / max(strength, 1e-9)
        axis = cross(up, np.array((0.0, 0.0, 1.0)))
        sine = math.sqrt(axis @ axis)
        angle = math.atan2(sine, up[2])
        turn = rotation(axis / sine * angle if sine > 1e-9 else (angle, 0.0, 0.0))
        heading = math.atan2(turn[1, 0], turn[0, 0])
        turn = rotation((0.0, 0.0, -heading)) @ turn
        body.turn = turn @ self._robot.imu[:3, :3]
        body.position = -body.turn @ self._to_imu[:3, 3]
        self._time = self._held = self._sliding_since = time
        if not calm and time >= self._unsure_until:
            self._doubt_for(time, 'start: the robot may be moving')

    def _doubt_for(self, time: float, reason: str) -> None:
        self._unsure_until, self._reason = time + RECOVERY, reason

    def _advance(self, time: float, gyro: Array, accelerometer: Array) -> float:
        """Advance the filter to the time of the readings; return the step, s, 0 after a gap."""
        dt, before, self._time = time - self._time, self._step, time
        self._step = dt
        if dt > LONGEST_GAP:
            self._doubt_for(time, f'gap: no readings for {dt:.2g} s')
            self._filter.lose(BLIND_TURN)
        elif dt > LONGEST_STEP:
            self._filter.lose(BLIND_RATE * dt, BLIND_ACCELERATION * dt)
            if before > LONGEST_STEP:  # no foot keeps its foothold
                self._doubt_for(
                    time,
                    f'rate: readings are {dt:.2g} s apart, {LONGEST_STEP} s at most are needed',
                )
        if dt > LONGEST_STEP:
            self._sliding_since = time
            self._standing[:] = False  # their footholds are made anew
        self._spin[~self._standing] = 0.0
        # What happened in a gap is unknown: the body is taken to have stood.
        step = dt if dt <= LONGEST_GAP else 0.0
        mean = self._filter.predict(step, gyro, accelerometer, self._spin)
        self._moved = step * (mean - self._filter.radius * self._spin)
        # One reading after a gap says nothing about the time without readings.
        self._pull += (math.sqrt(accelerometer @ accelerometer) - self._pull) * step
        return step

    def _process(
        self,
        time: float,
        dt: float,
        gyro: Array,
        accelerometer: Array,
        kinematics: Kinematics,
        dq: Array,
        forces: Array | None,
    ) -> BodyEstimate:
        """Correct the filter with the feet, and return the estimate."""
        body, legs = self._filter, len(self._standing)
        lands = self._load(kinematics, forces, time)
        turn = body.turn
        places, hips = self._placed(kinematics, turn)
        lines = turn @ kinematics.jacobians
        squares = lines @ lines.transpose(0, 2, 1)
        noise = self._encoder_noise**2 * squares + FOOT_NOISE**2 * np.eye(3)
        body.set_down(lands, places, hips, noise)
        if self._standing.any():
            fixed = not self._agreement.agree or bool(
                np.abs(dq).max() < 0.02 + 5.0 * self._velocity_noise
            )
            trusted = self._standing & ~self._agreement.against
            body.stand(places, hips, noise, trusted, self._slipping, fixed)
        if not body.sound():
            return self._anew(time, gyro, accelerometer, kinematics, dq, forces)
        self._rest(time, gyro, dq)
        turn = body.turn
        places, hips = self._placed(kinematics, turn)
        rate = gyro - body.gyro_bias
        turning = (kinematics.angular @ dq[..., None])[..., 0] + rate
        swaying = (1.0 + body.scale) * (kinematics.jacobians @ dq[..., None])[..., 0]
        swaying += (places @ turn) @ skew(rate).T
        moving, turning = (np.concatenate([swaying, turning]) @ turn.T).reshape(2, legs, 3)
        velocities = body.velocity + moving
        self._climbing = velocities[:, 2]
        self._spin = np.stack([turning[:, 1], -turning[:, 0], np.zeros(legs)], axis=1)
        slips = velocities - body.radius * self._spin
        window = self._window
        window.update(time, self._moved, places, slips, lands)
        variance = body.covariance
        common = 0.5 * (variance[3, 3] + variance[4, 4])
        lever = 0.5 * (squares[:, 0, 0] + squares[:, 1, 1])
        white = window.lever_noise**2 * lever
        deviations = np.sqrt(white + common)
        latest = np.sqrt(window.latest_noise**2 * lever + common)
        self._judge(time, window.velocity, deviations, latest, (places, hips, noise))
        speeds = np.hypot(window.velocity[:, 0], window.velocity[:, 1])
        self._delay.update(time, turn @ rate, places, slips, self._standing & (speeds < CALM))
        moves = np.hypot(moving[:, 0], moving[:, 1])
        if self._compare(time, dt, speeds, moves):
            body.set_down(self._standing, places, hips, noise)
        deviations = np.sqrt(np.maximum(white, UNSTEADY * window.unsteady) + common)
        return self._estimate(time, rate, places, velocities, forces, deviations)

    def _placed(self, kinematics: Kinematics, turn: Array) -> tuple[Array, Array]:
        """Return feet and hips from the IMU, (legs, 3), m, in odom axes."""
        hips = self._hips @ turn.T
        places = kinematics.positions @ turn.T
        return places + self._filter.scale * (places - hips), hips

    def _anew(self, time: float, *readings: Any) -> BodyEstimate:
        """Begin anew after readings that no robot can have made."""
        self._reset()
        self._begin(time, readings[0], readings[1], readings[3])
        self._doubt_for(time, 'diverged: odom begins anew')
        self._advance(time, readings[0], readings[1])
        return self._process(time, 0.0, *readings)

    def _load(self, kinematics: Kinematics, forces: Array | None, time: float) -> Flags:
        """Update which feet stand; return those that landed with this sample."""
        before = self._standing
        if forces is None:
            self._standing = np.zeros_like(before)
            self._doubt_for(time, 'force: neither foot forces nor efforts')
            return self._standing
        loads = forces @ self._filter.turn[2]
        share = self._contact_share or (0.1 if self._measured else 0.25)
        gate = share * self._expected
        self._standing = loads > np.where(before, gate, gate + 3.0 * self._force_noise)
        lands = self._standing & ~before
        self._slipping &= self._standing
        if self._rejection:
            self._slipping |= lands
            self._patience[lands] = SETTLES
            self._slow_since[lands] = math.inf
        return lands

    def _judge(
        self,
        time: float,
        slips: Array,
        deviations: Array,
        latest: Array,
        feet: tuple[Array, Array, Array],
    ) -> None:
        """Update which feet slip: those that slip have a foothold only in height."""
        if not self._rejection:
            return
        speeds = np.hypot(slips[:, 0], slips[:, 1])
        fresh = self._standing & ~self._slipping
        fresh &= self._filter.rejected | (speeds > FAST * deviations)
        self._patience[fresh] = STICKS
        now = self._window.latest
        slow = self._standing & ~fresh & (np.hypot(now[:, 0], now[:, 1]) < SLOW * latest)
        self._slow_since = np.where(slow, np.minimum(self._slow_since, time), math.inf)
        self._slipping |= fresh
        self._slipping &= ~(time - self._slow_since >= self._patience)
        lifted = self._filter.lifted
        if self._slipping.any():
            self._filter.set_down(self._slipping & ~lifted, *feet, level=True)
        if lifted.any():
            self._filter.set_down(lifted, *feet)
        sticking = self._standing & ~self._slipping
        if sticking.any():
            self._held = time
        if sticking.any() or not self._standing.any():
            self._sliding_since = time
        elif time - self._sliding_since > LOST and self._standing.sum() > 1:
            self._regain(time, slips[self._standing])

    def _regain(self, time: float, slips: Array) -> None:
        """Take feet to stick that all slip alike for long: more likely the velocity is wrong."""
        if np.ptp(slips[:, :2], axis=0).max() < ALIKE:
            self._filter.lose()
            self._slipping[:] = False
            self._held = self._sliding_since = time
            self._doubt_for(time, 'slipping: all feet slipped alike, velocity is estimated anew')

    def _compare(self, time: float, dt: float, slips: Array, moves: Array) -> bool:
        """Compare the legs with each other, and their length with that of the robot's file.

        Return whether what was learnt about them was discarded.
        """
        radius = self._radius_error * self._robot.foot_radius
        changed = self._agreement.update(dt, self._standing, self._slipping, slips, moves)
        if changed or self._unloaded.found:
            # What such legs, or feet that were in the air, have shown is wrong.
            self._filter.reshape(self._robot.foot_radius, radius, 0.0, self._length_error)
            return True
        self._filter.creep = CREEP * self._agreement.slippery
        # Joints that are late look like legs of another length, too.
        if not time < self._look and not self._delay.doubt():
            self._look = time + LOOK
            scale, deviation = self._filter.scale, self._filter.deviations[1]
            learnt = self._length_error**2 - deviation**2
            if self._stretched:
                if deviation > KNOWN_LENGTH:
                    self._doubt_for(
                        time,
                        'kinematics: legs seem to be longer or shorter than in the file of the'
                        f' robot, by {100.0 * scale:.0f} +- {100.0 * deviation:.0f} %',
                    )
            # Feet that slip for most of their stances look like legs of another length.
            elif (
                self._agreement.sticks
                and learnt > LEARNT * self._length_error**2
                and abs(scale)
                > max(WRONG_LENGTH * learnt / self._length_error**2, 4.0 * math.sqrt(learnt))
            ):
                self._stretched = True
                self._filter.reshape(self._robot.foot_radius, radius, 0.0, UNKNOWN_LENGTH)
                return True
        return False

    def _rest(self, time: float, gyro: Array, dq: Array) -> None:
        """Average the gyro while nothing moves, and correct its bias."""
        still = bool(
            self._standing.all()
            and np.abs(dq).max() < 0.02 + 5.0 * self._velocity_noise
            and np.abs(gyro - self._filter.gyro_bias).max()
            < 0.02 + 5.0 * self._gyro_noise + 3.0 * math.sqrt(self._filter.covariance[9, 9])
        )
        if not still or self._rest_count == 0:
            self._rest_since, self._rest_sum, self._rest_count = time, np.zeros(3), 0
        if still:
            self._rest_sum, self._rest_count = self._rest_sum + gyro, self._rest_count + 1
            if time - self._rest_since >= REST_TIME:
                noise = math.hypot(self._gyro_noise / math.sqrt(self._rest_count), BIAS_FLOOR)
                self._filter.rest(self._rest_sum / self._rest_count, noise)
                self._rest_count = 0

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
        arm = turn @ self._to_imu[:3, 3]
        to_odom = turn @ self._to_imu[:3, :3]
        centres = places + body.position
        loads = np.zeros_like(places) if forces is None else forces @ turn.T
        slips = self._window.velocity[:, :2]
        feet = tuple(
            map(
                FootMotion,
                centres,
                velocities,
                loads,
                self._standing.tolist(),
                slips,
                deviations.tolist(),
                (self._standing & self._slipping).tolist(),
            )
        )
        velocity = body.velocity + turn @ cross(rate, self._to_imu[:3, 3])
        # From the filter's errors to those of the base: rotation moves it about the IMU.
        step = self._to_base
        step[:3, :3] = -skew(arm)
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
        if time < self._unsure_until:
            return self._reason
        if abs(self._pull - WEIGHT) > 1.0:
            return f'gravity: the accelerometer shows {self._pull:.2g} m/s2 on average'
        for readings in (self._agreement, self._delay, self._unloaded):
            if doubt := readings.doubt():
                return doubt
        if time - self._held > RECOVERY:
            if self._standing.any():
                return 'slipping: all feet that stand may slip'
            return 'no contact: no foot stands'
        return ''
