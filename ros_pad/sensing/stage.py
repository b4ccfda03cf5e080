# SPDX-License-Identifier: Apache-2.0
"""Sensing stage of a robot: pair what IMU, joints and feet measure, and estimate its motion.

The body estimator node, the loop without ROS and replay use the same class.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import choice
from ros_pad.errors import InvalidInput
from ros_pad.records import SAMPLE
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, matrix, skew
from ros_pad.sensing.estimator import UNKNOWN_BIAS, WEIGHT, BodyEstimate, BodyEstimator
from ros_pad.sensing.motion import checked
from ros_pad.sensing.settings import FORCES, SETTINGS

# Difference of time stamps up to which readings are of one moment, ns: joints 4 ms later than the
# IMU triple the error of the body's velocity.
SAME_NS = 1_000_000

# Age above which the force of a foot is not used any more, ns.
OLDEST_FORCE_NS = 20_000_000

# Longest time over which positions of joints are differentiated, s.
LONGEST_DIFFERENCE = 0.05

# Step back of a stamp from which on a clock has been set back, ns; less is a late message.
SET_BACK_NS = 100_000_000

_NEVER = -(10**18)  # ns, before any stamp
_LATEST_NS = 50_000_000  # readings of joints wait no longer than this for the IMU
_WAITING = 50  # readings of joints that wait for the IMU, and readings of the IMU that are kept


def robot_of(values: Mapping[str, Any]) -> Robot:
    """Return the robot that the parameters of a body estimator describe.

    Raises
    ------
    ConfigError, InvalidInput
        When there is no such robot, or its file is not valid.
    """
    feet = [each.strip() for each in values['feet'].split(',') if each.strip()]
    radius = values['foot_radius'] if values['foot_radius'] >= 0.0 else None
    return Robot.load(values['robot'], feet, values['imu_link'], radius)


def estimator_of(robot: Robot, values: Mapping[str, Any]) -> BodyEstimator:
    """Return the estimator of a robot with the values of all :data:`SETTINGS`, by name.

    Raises
    ------
    InvalidInput
        When a value is not allowed.
    """
    own = (each.name for each in SETTINGS if each.name != 'forces')  # which are of the stage
    return BodyEstimator(robot, **{name: values[name] for name in own})


def sample_of(estimate: BodyEstimate) -> np.ndarray:
    """Return what a body estimate shows of the feet, in odom axes, as rows of a sample."""
    rows = SAMPLE.rows(len(estimate.feet))
    rows['force'] = [foot.force for foot in estimate.feet]
    rows['position'] = [foot.position for foot in estimate.feet]
    rows['velocity'] = [foot.slip_velocity for foot in estimate.feet]
    sds = np.array([foot.slip_velocity_sd for foot in estimate.feet])
    rows['variance'] = np.inf if estimate.doubt else sds[:, None] ** 2
    return rows


def twist_of(estimate: BodyEstimate, rate: Array, gyro_noise: float) -> tuple[Array, Array]:
    """Return the twist of the base in its own axes, and its covariance, as in an Odometry.

    Parameters
    ----------
    estimate : BodyEstimate
        Estimate of the base.
    rate : array (3,)
        Angular velocity as the gyro shows it, in axes of the base, rad/s: with its bias.
    gyro_noise : float
        Standard deviation of the gyro, rad/s.

    Returns
    -------
    tuple of array
        Linear and angular velocity, (6,), m/s and rad/s; covariance, (6, 6).
    """
    to_base = matrix(estimate.orientation).T
    # An error φ of the rotation, in odom axes, turns the velocity by v x φ.
    change = np.hstack([skew(estimate.velocity), np.eye(3)])
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = to_base @ change @ estimate.covariance[3:, 3:] @ change.T @ to_base.T
    covariance[3:, 3:] = (gyro_noise**2 + UNKNOWN_BIAS**2) * np.eye(3)
    return np.concatenate([to_base @ estimate.velocity, rate]), covariance


class _Joints(NamedTuple):
    stamp_ns: int
    positions: Array
    velocities: Array
    efforts: Array | None


class _Outputs(NamedTuple):
    estimate: Callable[[int, BodyEstimate], None]
    doubt: Callable[[str], None]
    error: Callable[[InvalidInput], None]


@dataclass
class _Start:
    """Readings before the first sample."""

    calm: int = 0  # in a row
    first_ns: float = math.inf  # stamp of the first sample that could be used


@dataclass
class _Since:
    """What has come since the last sample."""

    silent_ns: int | None = None  # when that was noted first
    rejection: str = ''
    received: Counter[str] = field(default_factory=Counter)  # readings, by source
    fresh: Counter[str] = field(default_factory=Counter)  # of those, how many had a new stamp


class SensingStage:
    """Pair readings of IMU, joints and feet by their time stamps, and estimate the robot's motion.

    Readings of the joints set the pace: each is paired with the reading of the IMU within 1 ms, or
    with one interpolated between those before and after it, for which it waits. It also waits for
    the forces of that moment, until the next reading of the joints arrives; then the last forces
    are used, if they are not older than 20 ms. Forces whose stamps are more than 1 ms later wait
    for the joints. The first sample waits for a calm robot, up to
    0.2 s.

    Parameters
    ----------
    robot : Robot
        The robot.
    estimator : BodyEstimator
        Estimator of this robot.
    emit : callable
        Called with time stamp, ns, and :class:`BodyEstimate` after each sample.
    emit_doubt : callable
        Called with the doubt when its kind has changed, before the estimate of the same sample.
    reject : callable
        Called with the error when a reading is rejected; it is not used.
    forces : str
        ``feet``, ``efforts``, or ``auto``: feet where their forces come, else efforts.

    Attributes
    ----------
    estimator : BodyEstimator
        As given.
    samples : int
        Number of samples used so far.
    last_ns : int
        Time stamp of the last sample used, ns; 0 before the first one.
    doubt : str or None
        Doubt emitted last, with its present details; None before the first sample.
    differentiates : bool
        Whether joint velocities are missing, and come from the change of the positions: about
        encoder noise times 1.4 over the period of noise, and half a period late.
    force_source : str
        Where the forces of the last sample came from, ``feet`` or ``efforts``; empty if nowhere.

    Raises
    ------
    InvalidInput
        When ``forces`` is none of these.
    """

    def __init__(
        self,
        robot: Robot,
        estimator: BodyEstimator,
        emit: Callable[[int, BodyEstimate], None],
        emit_doubt: Callable[[str], None],
        reject: Callable[[InvalidInput], None],
        forces: str = 'auto',
    ) -> None:
        self.estimator = estimator
        self._robot = robot
        self._out = _Outputs(emit, emit_doubt, reject)
        self._source = choice('forces', forces, FORCES)
        self.samples = self.last_ns = 0
        self.doubt: str | None = None
        self.differentiates = False
        self.force_source = ''
        # Stamps, and gyro and accelerometer in one array.
        self._inertial: deque[tuple[int, Array]] = deque(maxlen=_WAITING)
        self._waiting: deque[_Joints] = deque(maxlen=_WAITING)
        self._last_positions: tuple[int, Array] | None = None
        self._forces: list[deque[tuple[int, Array]]] = [deque(maxlen=_WAITING) for _ in robot.legs]
        self._start = _Start()
        self._since = _Since()

    def imu(self, stamp_ns: int, gyro: npt.ArrayLike, accelerometer: npt.ArrayLike) -> None:
        """Process a reading of the IMU.

        Parameters
        ----------
        stamp_ns : int
            Time stamp, ns.
        gyro : array (3,)
            Angular velocity in the axes of the IMU, rad/s.
        accelerometer : array (3,)
            Specific force in the axes of the IMU, m/s², +9.81 upwards at rest.
        """
        given = self._checked(
            ('gyro', gyro, 3, 'rad/s'), ('accelerometer', accelerometer, 3, 'm/s2')
        )
        last_ns = self._inertial[-1][0] if self._inertial else _NEVER
        if given and self._fresh('IMU', stamp_ns, last_ns, self._inertial):
            self._inertial.append((stamp_ns, np.concatenate(given)))
            self._process()

    def joints(
        self,
        stamp_ns: int,
        positions: npt.ArrayLike,
        velocities: npt.ArrayLike | None = None,
        efforts: npt.ArrayLike | None = None,
    ) -> None:
        """Process a reading of all joints, in the order of ``robot.joint_names``.

        Parameters
        ----------
        stamp_ns : int
            Time stamp, ns.
        positions : array (joints,)
            Positions, rad.
        velocities : array (joints,) or None
            Velocities, rad/s; without them, positions are differentiated.
        efforts : array (joints,) or None
            Torques, N m.
        """
        size = len(self._robot.joint_names)
        given = self._checked(
            ('joint positions', positions, size, 'rad'),
            ('joint velocities', velocities, size, 'rad/s'),
            ('efforts', efforts, size, 'N m'),
        )
        if not given:
            return
        q, dq, torques = given
        last_ns, before = self._last_positions or (_NEVER, q)
        if not self._fresh('joints', stamp_ns, last_ns, self._waiting):
            return
        self._last_positions = stamp_ns, q
        self.differentiates = dq is None
        if dq is None:
            dt = (stamp_ns - last_ns) * 1e-9
            if not 0.0 < dt <= LONGEST_DIFFERENCE:
                return  # the next reading has one before it
            dq = (q - before) / dt
        while self._waiting and self._waiting[0].stamp_ns < stamp_ns - _LATEST_NS:
            self._waiting.popleft()
        self._waiting.append(_Joints(stamp_ns, q, dq, torques))
        self._process()

    def _checked(self, *readings: tuple[str, npt.ArrayLike | None, int, str]) -> list[Any]:
        """Return readings, each with name, values, size and unit, as arrays; None stays None.

        Reject those that no sensor can have, and return an empty list.
        """
        try:
            return [
                None if values is None else checked(name, values, (size,), unit, 1e6).copy()
                for name, values, size, unit in readings
            ]
        except InvalidInput as error:
            self.reject(error)
            return []

    def _fresh(self, source: str, stamp_ns: int, last_ns: int, kept: deque[Any]) -> bool:
        """Return whether a reading is neither late nor double; forget those of a later clock."""
        self._since.received[source] += 1
        if stamp_ns <= last_ns:
            if stamp_ns > last_ns - SET_BACK_NS:
                return False
            kept.clear()
        self._since.fresh[source] += 1
        return True

    def force(self, leg_index: int, stamp_ns: int, force: Sequence[float]) -> None:
        """Process the force of the ground on a foot.

        Parameters
        ----------
        leg_index : int
            Index of the leg in ``robot.legs``.
        stamp_ns : int
            Time stamp, ns.
        force : sequence of 3 floats
            Force in the axes of its sensor, N.
        """
        given = self._checked(('foot force', force, 3, 'N'))
        if not given:
            return
        kept = self._forces[leg_index]
        if kept and stamp_ns <= kept[-1][0] - SET_BACK_NS:
            kept.clear()
        kept.append((stamp_ns, given[0]))
        self._process()

    def reject(self, error: InvalidInput) -> None:
        """Report a rejected reading; its error becomes the doubt if no sample follows for long.

        Parameters
        ----------
        error : InvalidInput
            Why the reading is not used.
        """
        self._since.rejection = str(error)
        self._out.error(error)

    def tick(self, now_ns: int) -> None:
        """Check whether readings are missing; call it every `TICK_PERIOD_NS`.

        Parameters
        ----------
        now_ns : int
            Time on the clock of the readings, ns.
        """
        if self._since.silent_ns is None:
            self._since.silent_ns = now_ns
            return
        silence = (now_ns - self._since.silent_ns) * 1e-9
        if silence > 0.4:  # s
            self._update_doubt(self._missing(silence))

    def _missing(self, silence: float) -> str:
        missing = [f'no {each}' for each in ('IMU', 'joints') if each not in self._since.received]
        if missing and not self._since.rejection:
            return f'{" and ".join(missing)}: for {silence:.1f} s'
        if self._since.rejection:
            return f'reading refused: {self._since.rejection}'
        for source in ('IMU', 'joints'):
            if self._since.fresh[source] < 2 < self._since.received[source]:
                return f'stamps: those of the {source} do not advance'
        if not self._waiting and self.differentiates:
            return f'no joints: no two readings in {LONGEST_DIFFERENCE:g} s, without velocities'
        assert self._last_positions
        stamp_ns = self._last_positions[0]
        nearest = min((each[0] - stamp_ns for each in self._inertial), key=abs, default=0)
        return f'stamps: IMU and joints are {abs(nearest) * 1e-6:.3g} ms apart'

    def _process(self) -> None:
        """Use the readings of joints that have all they need."""
        while self._waiting:
            joints = self._waiting[0]
            found = self._inertial_at(joints.stamp_ns)
            if found is None:
                last_ns = self._inertial[-1][0] if self._inertial else _NEVER
                if last_ns < joints.stamp_ns and len(self._waiting) < _WAITING:
                    return  # the IMU may be late
                self._waiting.popleft()
                continue
            if not self._has_forces(joints.stamp_ns) and len(self._waiting) == 1:
                return
            self._waiting.popleft()
            if self.samples or self._starts(joints, found):
                self._update(joints, found)

    def _inertial_at(self, stamp_ns: int) -> Array | None:
        """Return the reading of the IMU at a time, or one interpolated between its neighbours."""
        after_ns, after = 10**18, np.zeros(6)
        for before_ns, values in reversed(self._inertial):
            if abs(before_ns - stamp_ns) <= SAME_NS:
                return values
            if before_ns < stamp_ns:
                length = after_ns - before_ns
                share = (stamp_ns - before_ns) / length
                return values + share * (after - values) if length <= 10_000_000 else None
            after_ns, after = before_ns, values
        return None

    def _has_forces(self, stamp_ns: int) -> bool:
        """Return whether the forces of a moment are there, or none are awaited."""
        last = [kept[-1][0] if kept else _NEVER for kept in self._forces]
        if self._source == 'efforts' or max(last) < stamp_ns - OLDEST_FORCE_NS:
            return True
        return min(last) >= stamp_ns - SAME_NS

    def _forces_at(self, stamp_ns: int) -> Array | None:
        """Return the last forces of all feet at a time, (legs, 3), N; None if one is too old."""
        found = []
        for kept in self._forces:
            past = (each for each in reversed(kept) if each[0] <= stamp_ns + SAME_NS)
            last_ns, force = next(past, (_NEVER, None))
            if force is None or last_ns < stamp_ns - OLDEST_FORCE_NS:
                return None
            found.append(force)
        return np.array(found)

    def _starts(self, joints: _Joints, inertial: Array) -> bool:
        """Return whether estimation may begin: the robot is calm, or has not been for long."""
        pull = abs(math.sqrt(inertial[3:] @ inertial[3:]) - WEIGHT)
        calm = pull < 0.5 and np.abs(inertial[:3]).max() < 0.1  # m/s2 and rad/s
        calm = calm and np.abs(joints.velocities).max() < 0.3
        self._start.calm = self._start.calm + 1 if calm else 0
        self._start.first_ns = min(self._start.first_ns, joints.stamp_ns)
        # One reading in a jolt would begin odom with a wrong tilt.
        return self._start.calm >= 5 or joints.stamp_ns - self._start.first_ns >= 200_000_000

    def _update(self, joints: _Joints, inertial: Array) -> None:
        """Process a sample."""
        stamp_ns = joints.stamp_ns
        efforts, self.force_source = None, ''
        forces = None if self._source == 'efforts' else self._forces_at(stamp_ns)
        if forces is not None:
            self.force_source = 'feet'
        elif self._source != 'feet' and joints.efforts is not None:
            efforts, self.force_source = joints.efforts, 'efforts'
        try:
            estimate = self.estimator.update(
                stamp_ns * 1e-9,
                inertial[:3],
                inertial[3:],
                joints.positions,
                joints.velocities,
                forces,
                efforts,
            )
        except InvalidInput as error:
            self.reject(error)
            return
        if not _finite(estimate):
            self.reject(InvalidInput(f'sample at {stamp_ns * 1e-9:.3f} s: no finite estimate'))
            return
        self.samples += 1
        self.last_ns = stamp_ns
        self._since = _Since()
        doubt = estimate.doubt
        if not self.force_source and self._source != 'efforts' and all(self._forces):
            late_ns = max((kept[-1][0] - stamp_ns for kept in self._forces), key=abs)
            doubt = f'force: stamps of the feet are {late_ns * 1e-6:.3g} ms after those of the'
            doubt += ' joints, -20 to 1 ms is allowed'
        self._update_doubt(doubt)
        self._out.estimate(stamp_ns, estimate)

    def _update_doubt(self, doubt: str) -> None:
        before, self.doubt = self.doubt, doubt
        # Details, after the colon, may change with every sample.
        if before is None or doubt.partition(':')[0] != before.partition(':')[0]:
            self._out.doubt(doubt)


def _finite(estimate: BodyEstimate) -> bool:
    """Return whether all numbers of an estimate are finite; if one is not, the sum is not."""
    total = estimate.covariance.sum() + estimate.position.sum() + estimate.orientation.sum()
    for foot in estimate.feet:
        total += foot.position.sum() + foot.force.sum() + foot.slip_velocity.sum()
        total += foot.slip_velocity_sd
    return math.isfinite(total + estimate.velocity.sum())
