# SPDX-License-Identifier: Apache-2.0
"""Faults in what a robot's IMU, joints and feet report: units, axes, signs, rates, stamps.

Each check looks at a :class:`Recording` of some seconds in which the robot stands, and better
walks too, and returns what it found in plain sentences; readings without faults give nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from ros_pad.configuration import quantity
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, cross, skew
from ros_pad.sensing.estimator import DAMPING, LONGEST_STEP, WEIGHT

Flags = npt.NDArray[np.bool_]

SLOWEST, FASTEST = 200.0, 500.0  # Hz, rates that are wanted
GRAVITY_ERROR = 0.3  # m/s², at rest; twice as much where the robot never rests
CALM = 0.1  # rad/s, of body and joints at rest
QUIET = 0.25  # s, length of a window in which the robot rests
LARGEST = 7.0  # rad, of a joint: more than a turn
UNEVEN = 0.03  # m, largest height of a standing foot over the plane of all
STEEPEST = 0.35  # slope of the ground on which a robot may stand
DELAY = 2e-3  # s, between IMU and joints, from which on the body's velocity suffers
LONGEST_DELAY = 0.03  # s, that is looked for
WINDOW = 0.06  # s, over which feet are taken to stand still
FEWEST = 30  # windows in which pairs of feet stand while the robot moves
SUNK = 0.05  # m, below the floor
SURE = 6.0  # standard deviations


Progress: TypeAlias = Callable[[float], None]


def unseen(share: float) -> None:
    """Show nothing."""


class Finding(NamedTuple):
    """What a check found; ``status`` is ``problem`` or ``warning``."""

    what: str
    status: str
    found: str
    advice: str


def problem(what: str, found: str, advice: str) -> Finding:
    """Return a problem."""
    return Finding(what, 'problem', found, advice)


def warning(what: str, found: str, advice: str) -> Finding:
    """Return a warning."""
    return Finding(what, 'warning', found, advice)


@dataclass(frozen=True)
class Recording:
    """Readings of some seconds, each sensor with its own times.

    Attributes
    ----------
    robot : Robot
    imu_time, joint_time : array (n,), (m,)
        Stamps, s.
    gyro, accelerometer : array (n, 3)
        In the axes of the IMU, rad/s and m/s².
    positions : array (m, joints)
        In the order of ``robot.joint_names``, rad (m).
    velocities, efforts : array (m, joints) or None
        The same, rad/s (m/s) and N m (N).
    forces : array (m, legs, 3) or None
        Forces of the ground on the feet at the times of the joints, N.
    force_axes : str
        ``base`` or ``foot``.
    force_kind : str
        ``vector``, ``normal`` (one axis) or ``contact`` (flags).
    imu_arrival, joint_arrival : array (n,), (m,), optional
        Times of arrival, s.
    """

    robot: Robot
    imu_time: Array
    gyro: Array
    accelerometer: Array
    joint_time: Array
    positions: Array
    velocities: Array | None = None
    efforts: Array | None = None
    forces: Array | None = None
    force_axes: str = 'base'
    force_kind: str = 'vector'
    imu_arrival: Array = field(default_factory=lambda: np.zeros(0))
    joint_arrival: Array = field(default_factory=lambda: np.zeros(0))

    def at_joints(self, values: Array, delay: float = 0.0) -> Array:
        """Return readings of the IMU at the times of the joints, in the axes of the base."""
        times = self.joint_time - delay
        columns = [np.interp(times, self.imu_time, each) for each in values.T]
        return np.stack(columns, axis=1) @ self.robot.imu[:3, :3].T

    @cached_property
    def speeds(self) -> Array:
        """Joint velocities, from differences where there are none, (m, joints)."""
        if self.velocities is not None:
            return self.velocities
        return np.gradient(self.positions, self.joint_time, axis=0)

    @cached_property
    def rate(self) -> Array:
        """Angular velocity of the base at the times of the joints, (m, 3), rad/s."""
        return self.at_joints(self.gyro)

    @cached_property
    def pull(self) -> Array:
        """Specific force at the times of the joints, (m, 3), m/s², base axes."""
        return self.at_joints(self.accelerometer)

    @cached_property
    def kinematics(self) -> tuple[Array, Array, Array, Array]:
        """Places, rotations, Jacobians and angular Jacobians of the feet, each (m, legs, ...)."""
        positions = quantity('positions', self.positions, 'rad', -1e4, 1e4)
        found = self.robot.chains.solve(positions.reshape(-1, *self.robot.home.shape))
        return found.positions, found.rotations, found.jacobians, found.angular

    @cached_property
    def ground_forces(self) -> Array | None:
        """Forces of the ground on the feet in base axes, (m, legs, 3), N, or None.

        Where there are no foot forces, they come from the efforts.
        """
        if self.forces is None:
            return self.forces_of_efforts
        if self.force_axes == 'base':
            return self.forces
        return np.asarray((self.kinematics[1] @ self.forces[..., None])[..., 0])

    @cached_property
    def forces_of_efforts(self) -> Array | None:
        """The same from efforts and the weight of the legs, or None."""
        if self.efforts is None:
            return None
        lines, pull = self.kinematics[2], -WEIGHT * self.up
        holding = np.array([self.robot.gravity_torques(q, pull) for q in self.positions])
        square = lines @ lines.transpose(0, 1, 3, 2) + DAMPING * np.eye(3)
        rest = holding - self.efforts.reshape(holding.shape)
        return np.asarray(np.linalg.solve(square, lines @ rest[..., None])[..., 0])

    @cached_property
    def rests(self) -> Flags:
        """Whether the robot rests, at the times of the joints."""
        moving = np.abs(self.rate - np.median(self.rate, axis=0)).max(1) > CALM
        # Noise of single velocities is no motion: joints are looked at over a window.
        span = max(1, round(QUIET / self._step))
        later = np.minimum(np.arange(len(moving)) + span, len(moving) - 1)
        moving |= np.abs(self.positions[later] - self.positions).max(1) > CALM * QUIET
        blurred = np.convolve(moving, np.ones(2 * span + 1))[span : span + len(moving)]
        return np.asarray(blurred <= 0.2 * span)

    @cached_property
    def stands(self) -> Flags:
        """Which feet stand for sure, (m, legs): loaded, and neither landing nor lifting."""
        forces = self.ground_forces
        if forces is None:
            heights = self.kinematics[0] @ self.up
            loaded = heights < heights.min(1)[:, None] + 0.01
        else:
            # The size alone: axes, signs and units may be wrong.
            sizes = np.linalg.norm(forces, axis=2)
            loaded = sizes > 0.3 * np.quantile(sizes, 0.9, axis=0)
        before, after = (max(1, round(each / self._step)) for each in (0.04, 0.012))
        kept = loaded.copy()
        for shift in range(1, before + 1):
            kept[shift:] &= loaded[:-shift]
        for shift in range(1, after + 1):
            kept[:-shift] &= loaded[shift:]
        return kept

    @cached_property
    def up(self) -> Array:
        """Direction against gravity, (3,), base axes; z where the accelerometer is wrong."""
        if gravity(self):
            return np.array((0.0, 0.0, 1.0))
        mean = self.calm(self.pull).mean(0)
        return np.asarray(mean / np.linalg.norm(mean))

    def calm(self, values: Array) -> Array:
        """Return values at rest, or all of them if the robot never rests."""
        return values[self.rests] if self.rests.any() else values

    @property
    def _step(self) -> float:
        return float(np.median(np.diff(self.joint_time)))

    @property
    def span(self) -> int:
        """Samples of the joints in a window of 60 ms."""
        return max(2, round(WINDOW / self._step))

    @cached_property
    def pairs(self) -> _Pairs:
        """Pairs of standing feet, while the robot moves."""
        found = _pairs(self, self.stands, self.span)
        moves = ~self.rests[found.first]
        return _Pairs(found.first[moves], found.arm[moves], found.drift[moves])

    def reversed(self, joint: int) -> Recording:
        """Return the recording with one joint the other way round."""
        signs = np.ones(len(self.robot.joint_names))
        signs[joint] = -1.0
        other = replace(
            self,
            positions=self.positions * signs,
            velocities=None if self.velocities is None else self.velocities * signs,
            efforts=None if self.efforts is None else self.efforts * signs,
        )
        # Feet that stand are those of the sizes of the forces, which hardly change.
        vars(other).update(stands=self.stands, rests=self.rests, rate=self.rate, pull=self.pull)
        return other


def axis_of(vector: Array) -> str:
    """Return the name of the axis nearest to a vector, with its sign."""
    index = int(np.abs(vector).argmax())
    return ('-' if vector[index] < 0.0 else '') + 'xyz'[index]


def rates(recording: Recording) -> list[Finding]:
    """Check how many samples a second arrive, and gaps between them."""
    found = []
    for what, times in (('imu', recording.imu_time), ('joints', recording.joint_time)):
        steps = np.diff(times)
        rate = 1.0 / max(float(np.median(steps)), 1e-9)
        if rate < 0.97 * SLOWEST:
            advice = f'{SLOWEST:g} to {FASTEST:g} Hz are wanted: set it in the driver'
            found.append(warning(what, f'{rate:.0f} samples a second', advice))
        gaps = steps > max(LONGEST_STEP, 3.0 / rate)
        if gaps.any():
            advice = 'feet count as lifted in a gap: look for a busy computer or network'
            text = f'{gaps.sum()} gaps in the stamps, the longest of {steps.max():.3g} s'
            found.append(warning(what, text, advice))
    return found


def stamps(recording: Recording) -> list[Finding]:
    """Check that stamps rise, and that they are of the clock by which messages arrive."""
    found, offsets, ratios = [], [], []
    for what, times, arrival in (
        ('imu', recording.imu_time, recording.imu_arrival),
        ('joints', recording.joint_time, recording.joint_arrival),
    ):
        back = int((np.diff(times) <= 0.0).sum())
        if back:
            advice = 'each message needs its own time of measurement in header.stamp'
            found.append(problem(what, f'{back} stamps are not after the one before', advice))
        elif len(arrival) == len(times):
            ratios.append(float((arrival[-1] - arrival[0]) / (times[-1] - times[0])))
            offsets.append(float(np.median(times - arrival)))
    if found or not ratios:
        return found
    if max(ratios) - min(ratios) > 0.02:
        for what, ratio in zip(('imu', 'joints'), ratios, strict=False):
            if abs(ratio - 1.0) > 0.02:
                text = f'1 s of its stamps takes {ratio:.3g} s'
                advice = 'the stamps are not times: use stamp: arrival in the mapping'
                found.append(problem(what, text, advice))
    elif len(offsets) == 2 and abs(offsets[0] - offsets[1]) > 0.5:
        text = f'stamps are {offsets[0] - offsets[1]:.3g} s after those of the joints'
        found.append(problem('imu', text, 'both need one clock, to 1 ms'))
    elif abs(ratios[0] - 1.0) > 0.02:
        text = f'1 s of them takes {ratios[0]:.3g} s: right only in a simulation'
        found.append(warning('stamps', text, 'on a robot: use stamp: arrival in the mapping'))
    elif abs(offsets[0]) > 1.0:
        text = f'they differ from the time of arrival by {offsets[0]:.3g} s: another clock'
        found.append(warning('stamps', text, 'synchronise the clocks (chrony, ptp4l)'))
    return found


def gravity(recording: Recording) -> list[Finding]:
    """Check size and axis of the specific force at rest."""
    rests = recording.rests.any()
    mean = recording.calm(recording.pull).mean(0)
    size = float(np.linalg.norm(mean))
    when = 'at rest' if rests else 'on average'
    text = f'{size:.3g} m/s2 {when}, {WEIGHT:g} is gravity'
    if size < 0.4:
        advice = 'the driver has taken gravity off: use its raw data (imu/data_raw)'
        return [problem('accelerometer', f'shows no gravity: {text}', advice)]
    if abs(size * WEIGHT - WEIGHT) < GRAVITY_ERROR:
        return [problem('accelerometer', f'is in g: {text}', 'scale: 9.80665 in the mapping')]
    found = []
    if abs(size - WEIGHT) > (1.0 if rests else 2.0) * GRAVITY_ERROR:
        advice = f'scale: {WEIGHT / size:.4g} in the mapping, or calibrate it'
        found.append(problem('accelerometer', f'has a wrong scale: {text}', advice))
    if mean[2] < 0.85 * size:
        text = f'gravity is on {axis_of(mean)} of the base, and should be on z'
        advice = 'axes in the mapping, or the pose of the IMU in the robot file, are wrong'
        found.append(problem('accelerometer', text, advice))
    return found


def ranges(recording: Recording) -> list[Finding]:
    """Check that joint positions are angles of legs, in rad, or lengths, in m."""
    most = float(np.abs(recording.positions).max())
    if most < LARGEST:
        return []
    advice = 'in degrees? scale: 0.01745329252 of the joints in the mapping'
    return [problem('joints', f'positions up to {most:.3g} rad (or m)', advice)]


def velocities(recording: Recording) -> list[Finding]:
    """Check that joint velocities are the derivatives of joint positions."""
    if recording.velocities is None or np.median(np.diff(recording.joint_time)) > LONGEST_STEP:
        return []  # too few to be integrated
    found: dict[str, list[tuple[str, float]]] = {}
    times, q, dq = recording.joint_time, recording.positions, recording.velocities
    steps = np.diff(times)[:, None]
    moved = np.vstack([np.zeros(q.shape[1]), np.cumsum(0.5 * (dq[1:] + dq[:-1]) * steps, axis=0)])
    span = max(1, round(0.1 / float(np.median(steps))))
    if len(times) < span + FEWEST:
        return []
    changes, sums = (values[span:] - values[:-span] for values in (q, moved))
    for name, change, total in zip(recording.robot.joint_names, changes.T, sums.T, strict=True):
        if change.std() < 5e-3 and total.std() < 0.02:
            continue  # it did not move
        sizes = float(np.linalg.norm(change) * np.linalg.norm(total))
        fits = float(change @ total) / max(sizes, 1e-12)
        ratio = float(np.linalg.norm(total) / max(float(np.linalg.norm(change)), 1e-9))
        if abs(fits) < 0.7:
            text = 'velocity does not fit the change of position'
        elif fits < 0.0:
            text = 'velocity is reversed against position'
        elif not 0.8 < ratio < 1.25:
            text = 'velocity is {:.3g} times the change of position'
        else:
            continue
        found.setdefault(text, []).append((name, ratio))
    advice = 'mend the driver, or leave velocities out of the mapping: differences replace them'
    all_ = len(recording.robot.joint_names)
    return [
        problem(
            'joints' if len(some) == all_ else f'joint {", ".join(name for name, _ in some)}',
            text.format(np.median([ratio for _, ratio in some])),
            advice,
        )
        for text, some in found.items()
    ]


class _Pairs(NamedTuple):
    """Pairs of feet that stand over a window: what they show of the rotation of the body.

    Two feet that do not slip have ``drift + rate x arm = 0``, on average over the window.
    """

    first: npt.NDArray[np.intp]  # sample at which the window begins
    arm: Array  # (k, 3), m
    drift: Array  # (k, 3), m/s


def _pairs(recording: Recording, stands: Flags, span: int) -> _Pairs:
    places, _, _, angular = recording.kinematics
    speeds = recording.speeds.reshape(len(places), *recording.robot.home.shape)[..., None]
    up = recording.robot.foot_radius * np.array((0.0, 0.0, 1.0))
    rolling = _mean(cross((angular @ speeds)[..., 0], up), span)
    middle = _mean(places, span) - up
    time = (recording.joint_time[span:] - recording.joint_time[:-span])[:, None, None]
    moving = (places[span:] - places[:-span]) / time - rolling
    stay = _mean(stands.astype(float), span) > 1.0 - 0.5 / (span + 1)
    chosen = np.arange(0, len(stay), max(1, span // 3))
    first, arm, drift = [], [], []
    for one in range(len(recording.robot.legs)):
        for other in range(one):
            both = chosen[stay[chosen, one] & stay[chosen, other]]
            first.append(both)
            arm.append(middle[both, one] - middle[both, other])
            drift.append(moving[both, one] - moving[both, other])
    return _Pairs(np.concatenate(first), np.concatenate(arm), np.concatenate(drift))


def _mean(values: Array, span: int) -> Array:
    """Return means of values over each window from a sample to the one ``span`` later."""
    sums = np.cumsum(values, axis=0)
    return (sums[span:] - sums[:-span] + 0.5 * (values[:-span] - values[span:])) / span


def _rate(recording: Recording, late: float = 0.0) -> Array:
    """Return the angular velocity, ``late`` s ago, without the bias that it shows at rest."""
    rate, rests = recording.rate, recording.rests
    bias = rate[rests].mean(0) if rests.any() else 0.0
    return (recording.at_joints(recording.gyro, late) if late else rate) - bias


def better(before: Array, after: Array) -> float:
    """Return how sure it is that errors are smaller than before, in standard deviations."""
    gain = before - after
    # Windows overlap by two thirds.
    deviation = float(gain.std()) * math.sqrt(3.0 / len(gain))
    return float(gain.mean()) / max(deviation, 1e-12)


def turned(recording: Recording, progress: Progress = unseen) -> tuple[list[Finding], Recording]:
    """Check joints and gyro against each other: feet that stand do not move against each other.

    Joints are reversed if feet then stand still, with any axes and unit of the gyro; with these
    joints, least squares of what feet and gyro show of the rotation give its axes and unit.

    Returns
    -------
    findings : list of Finding
    recording : Recording
        With the joints as they should be.
    """
    found: list[Finding] = []
    names = recording.robot.joint_names
    while len(recording.pairs.first) >= FEWEST and len(found) < len(names):
        others = []
        for joint in range(len(names)):
            others.append(recording.reversed(joint))
            # How many are reversed is not known before: each takes half of the share that is left.
            progress(1.0 - 0.5 ** len(found) * (1.0 - 0.5 * (joint + 1) / len(names)))
        _, before = _fit(recording)
        errors = [_fit(each)[1] if len(each.pairs.first) else before for each in others]
        best = int(np.argmin([each.mean() for each in errors]))
        finding = _reversed(names[best])
        if finding in found or not _explains(before, errors[best]):
            break
        found.append(finding)
        recording = others[best]
    progress(1.0)
    return [*found, *_gyro(recording)], recording


def _reversed(name: str) -> Finding:
    advice = f'reversed: [{name}] in the mapping, or the axis in the robot file'
    return problem(f'joint {name}', 'is reversed: its foot moves as if it slipped', advice)


def _explains(before: Array, after: Array) -> bool:
    """Return whether errors are so much smaller that what was wrong is known."""
    if len(before) != len(after):
        return bool(after.mean() < 0.5 * before.mean())
    sure = better(before, after)
    return sure > SURE or (sure > 0.5 * SURE and after.mean() < 0.7 * before.mean())


def _fit(recording: Recording) -> tuple[Array, Array]:
    """Return the matrix from the gyro's rate to that of the legs, and the errors that are left."""
    pairs = recording.pairs
    rate = _mean(_rate(recording), recording.span)[pairs.first]
    lines = skew(pairs.arm)[..., None] * rate[:, None, None]
    lines = lines.reshape(-1, 9)
    matrix = _least_squares(lines, pairs.drift.ravel())
    return matrix.reshape(3, 3), sizes(pairs.drift - (lines @ matrix).reshape(-1, 3))


def rolling_errors(recording: Recording, turn: Array | None = None, late: float = 0.0) -> Array:
    """Return how fast pairs of standing feet move against each other in windows, m/s.

    The rate of the gyro is turned by a matrix, and taken from ``late`` s before.
    """
    pairs = recording.pairs
    rate = _mean(_rate(recording, late), recording.span)[pairs.first]
    rate = rate if turn is None else rate @ turn.T
    return sizes(pairs.drift + cross(rate, pairs.arm))


def _along(matrix: Array) -> Array:
    """Return the axes, with their signs, that a matrix of least squares shows; own if unclear."""
    size, rows = float(np.abs(matrix).max()), np.arange(len(matrix))
    known = np.where(np.abs(matrix) > 0.3 * size, matrix, 0.0) + 0.2 * size * np.eye(len(rows))
    orders = [np.array(order) for order in itertools.permutations(rows)]
    order = max(orders, key=lambda each: float(np.abs(known[rows, each]).sum()))
    turn = np.zeros_like(matrix)
    turn[rows, order] = np.where(known[rows, order] < 0.0, -1.0, 1.0)
    return turn


def _gyro(recording: Recording) -> list[Finding]:
    """Return findings about axes and unit of the gyro."""
    if len(recording.pairs.first) < FEWEST:
        return []
    matrix, _ = _fit(recording)
    turn = _along(matrix)
    scale = math.pi / 180.0 if np.abs(matrix).max() < 0.1 else 1.0
    if not _explains(rolling_errors(recording), rolling_errors(recording, scale * turn)):
        return []
    found = []
    if scale != 1.0:
        advice = f'scale: {scale:.10g} in the mapping'
        found.append(problem('gyro', 'is in degrees per second', advice))
    wrong = [
        f'{"xyz"[axis]} is on {axis_of(turn[axis])}' for axis in range(3) if turn[axis, axis] < 1
    ]
    if wrong:
        text = f'its axes do not fit the legs: rotation about {", about ".join(wrong)}'
        found.append(problem('gyro', text, _turn_back(recording, turn)))
    return found


def _turn_back(recording: Recording, turn: Array) -> str:
    """Return advice how to turn an IMU: rows have the sensor's axis of each axis of the base."""
    axes = f'[{", ".join(map(axis_of, turn))}]'
    if np.array_equal(recording.robot.imu[:3, :3], np.eye(3)):
        return f'axes: {axes} in the mapping, or turn the IMU in the robot file'
    return f'turn the IMU in the robot file: what it calls x, y, z of the base is {axes}'


def levels(recording: Recording) -> list[Finding]:
    """Check at rest that the feet are in one plane below the body."""
    if not recording.rests.any():
        return []
    off = _off_plane(recording, recording.positions[recording.rests].mean(0))
    if off.max() < UNEVEN:
        return []
    leg = recording.robot.legs[int(off.argmax())]
    text = (
        f'at rest foot {leg} is {off.max():.2g} m off the plane of the others, or the plane leans'
    )
    advice = (
        'on a flat floor: look for a reversed joint, a wrong zero, a wrong foot link or length'
    )
    return [problem('feet', text, advice)]


def _off_plane(recording: Recording, q: Array) -> Array:
    """Return how far each foot is off a plane through all feet, or above it if it leans, m."""
    places = recording.robot.foot_positions(q)
    up = recording.up
    centred = places - places.mean(0)
    slope = np.linalg.lstsq(centred[:, :2], centred[:, 2], rcond=None)[0]
    lean = up[:2] + slope * up[2]  # of the ground, which may be a slope, against gravity
    heights = np.abs(centred[:, 2] - centred[:, :2] @ slope)
    if np.linalg.norm(lean) > STEEPEST:
        heights = np.maximum(heights, np.abs(centred @ up))
    above = places[:, 2] > -0.2 * np.linalg.norm(places - recording.robot.hips, axis=1)
    return np.where(above, np.maximum(heights, UNEVEN), heights)


def delay(recording: Recording) -> list[Finding]:
    """Check that IMU and joints have the same time: when the gyro fits the legs best."""
    if len(recording.pairs.first) < FEWEST:
        return []
    tried = np.arange(-LONGEST_DELAY, LONGEST_DELAY + 5e-4, 1e-3)
    best = float(min(tried, key=lambda late: float(rolling_errors(recording, late=late).mean())))
    gain = better(rolling_errors(recording), rolling_errors(recording, late=best))
    if abs(best) <= DELAY or gain < 0.5 * SURE:
        return []
    text = (
        f'stamps are {1e3 * abs(best):.0f} ms {"later" if best > 0.0 else "earlier"} than the IMU'
    )
    advice = f'stamp both where they are measured, or delay: {best:.3f} in the mapping'
    return [warning('joints', f"{text}'s for the same motion", advice)]


def horizontal(recording: Recording) -> list[Finding]:
    """Check that foot forces accelerate the body as the accelerometer shows: axes about z."""
    found = recording.ground_forces
    if found is None or recording.force_kind != 'vector' or not np.any(found[..., :2]):
        return []
    turn = _turned(recording, found)
    if turn is None:
        return []
    other = recording.forces_of_efforts
    # Forces from joints that are right have the right axes.
    which = 'foot forces'
    if recording.forces is None or (other is not None and _turned(recording, other) is not None):
        which = 'accelerometer'
    elif other is None:
        which = 'accelerometer or foot forces'
    text = (
        'horizontal axes are turned against the motion: x of the accelerometer is'
        f' {axis_of(turn[0])} of the forces, y is {axis_of(turn[1])}'
    )
    advice = f'axes: [{axis_of(turn[0])}, {axis_of(turn[1])}, z] of the forces in the mapping'
    if which == 'accelerometer':
        advice = _turn_back(recording, turn.T)
    elif which != 'foot forces':
        advice = 'axes in the mapping, or the pose of the IMU in the robot file, are wrong'
    return [problem(which, text, advice)]


def _turned(recording: Recording, forces: Array) -> Array | None:
    """Return how the total force must be turned about z to fit the accelerometer, or None."""
    total, wanted = pushes(recording, forces)
    if len(total) < FEWEST:
        return None
    turn = np.eye(3)
    turn[:2, :2] = _along(_least_squares(total, wanted).T)
    plain, after = (sizes(total @ each.T - wanted) for each in (np.eye(2), turn[:2, :2]))
    return turn if after.mean() < 0.7 * plain.mean() and better(plain, after) > SURE else None


def pushes(recording: Recording, forces: Array) -> tuple[Array, Array]:
    """Return the total force along the ground, and mass times specific force, (k, 2), N."""
    span = 3 * recording.span
    moves = np.flatnonzero(~recording.rests[: len(recording.rests) - span])[:: max(1, span // 3)]
    total = _mean(forces.sum(1), span)[moves, :2]
    wanted = recording.robot.mass * _mean(recording.pull, span)[moves, :2]
    return (total - total.mean(0), wanted - wanted.mean(0)) if len(moves) else (total, wanted)


def _least_squares(lines: Array, values: Array) -> Array:
    return np.asarray(np.linalg.lstsq(lines, values, rcond=None)[0], dtype=np.float64)


def sizes(vectors: Array) -> Array:
    """Return the lengths of vectors, (k,)."""
    return np.asarray(np.linalg.norm(vectors, axis=1))
