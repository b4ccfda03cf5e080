# SPDX-License-Identifier: Apache-2.0
"""Faults in what a robot's IMU, joints and feet report: units, axes, signs, rates, stamps.

:func:`check` looks at a :class:`Recording` of some seconds in which the robot stands, and better
walks too. What the body estimator itself doubts while it runs (repeated readings, joints and
velocities that do not fit, legs against the others) is taken from the estimator.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import minimum_filter1d
from scipy.optimize import linear_sum_assignment

from ros_pad.configuration import quantity
from ros_pad.robots import Kinematics, Robot
from ros_pad.robots.rotation import Array, cross, skew
from ros_pad.sensing.estimator import LONGEST_STEP, WEIGHT, BodyEstimator, forces_of

Flags = npt.NDArray[np.bool_]

CALM = 0.1  # rad/s, of body and joints at rest
FEWEST = 30  # windows in which pairs of feet stand while the robot moves
SURE = 6.0  # standard deviations


class Check(NamedTuple):
    """What a check found: ``status`` is ``ok``, ``warning`` or ``problem``.

    ``found`` has the measured value and the allowed range.
    """

    what: str
    status: str
    found: str


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

    def at_joints(self, values: Array, late: float = 0.0) -> Array:
        """Return readings of the IMU ``late`` s before those of the joints, in base axes."""
        columns = [np.interp(self.joint_time - late, self.imu_time, each) for each in values.T]
        return np.stack(columns, axis=1) @ self.robot.imu[:3, :3].T

    def rate(self, late: float = 0.0) -> Array:
        """Return the angular velocity, (m, 3), rad/s, without the bias that it shows at rest."""
        rate = self.at_joints(self.gyro, late)
        return rate - self.at_joints(self.gyro)[self.rests].mean(0) if self.rests.any() else rate

    @cached_property
    def pull(self) -> Array:
        """Specific force at the times of the joints, (m, 3), m/s², base axes."""
        return self.at_joints(self.accelerometer)

    @cached_property
    def speeds(self) -> Array:
        """Joint velocities, from differences where there are none, (m, joints)."""
        if self.velocities is not None:
            return self.velocities
        return np.gradient(self.positions, self.joint_time, axis=0)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Kinematics of the feet, arrays (m, legs, ...)."""
        positions = quantity('positions', self.positions, 'rad', -1e4, 1e4)
        return self.robot.chains.solve(positions.reshape(-1, *self.robot.home.shape))

    @cached_property
    def ground_forces(self) -> Array | None:
        """Forces of the ground on the feet in base axes, (m, legs, 3), N, or None.

        Where there are no foot forces, they come from the efforts.
        """
        if self.forces is None:
            if self.efforts is None:
                return None
            efforts = self.efforts.reshape(-1, *self.robot.home.shape)
            return forces_of(self.robot.chains, self.kinematics, efforts, -WEIGHT * self.up)
        if self.force_axes == 'base':
            return self.forces
        return np.asarray((self.kinematics.rotations @ self.forces[..., None])[..., 0])

    @cached_property
    def rests(self) -> Flags:
        """Whether the robot rests, at the times of the joints."""
        rate = self.at_joints(self.gyro)
        moving = np.abs(rate - np.median(rate, axis=0)).max(1) > CALM
        # Noise of single velocities is no motion: joints are looked at over 0.25 s.
        span = max(1, round(0.25 / self._step))
        later = np.minimum(np.arange(len(moving)) + span, len(moving) - 1)
        moving |= np.abs(self.positions[later] - self.positions).max(1) > 0.25 * CALM
        blurred = np.convolve(moving, np.ones(2 * span + 1))[span : span + len(moving)]
        return np.asarray(blurred <= 0.2 * span)

    @cached_property
    def stands(self) -> Flags:
        """Which feet stand for sure, (m, legs): loaded, and neither landing nor lifting."""
        if self.ground_forces is None:
            heights = self.kinematics.positions @ self.up
            loaded = heights < heights.min(1)[:, None] + 0.01
        else:
            # The size alone: axes, signs and units may be wrong.
            sizes = np.linalg.norm(self.ground_forces, axis=2)
            loaded = sizes > 0.3 * np.quantile(sizes, 0.9, axis=0)
        before, after = (max(1, round(each / self._step)) for each in (0.04, 0.012))
        size = before + after + 1
        origin = before - size // 2
        return np.asarray(minimum_filter1d(loaded, size, 0, mode='nearest', origin=origin))

    @cached_property
    def up(self) -> Array:
        """Direction against gravity, (3,), base axes; z where the accelerometer is wrong."""
        if _gravity(self):
            return np.array((0.0, 0.0, 1.0))
        mean = self.calm(self.pull).mean(0)
        return np.asarray(mean / np.linalg.norm(mean))

    def calm(self, values: Array) -> Array:
        """Return values at rest, or all of them if the robot never rests."""
        return values[self.rests] if self.rests.any() else values

    @property
    def _step(self) -> float:
        return float(np.median(np.diff(self.joint_time)))

    def mean(self, values: Array, windows: int = 1) -> Array:
        """Return means of values (m, ...) over windows of 0.06 s that begin with each sample."""
        span = windows * max(2, round(0.06 / self._step))
        sums = np.cumsum(values, axis=0)
        return (sums[span:] - sums[:-span] + 0.5 * (values[:-span] - values[span:])) / span

    @cached_property
    def pairs(self) -> tuple[npt.NDArray[np.intp], Array, Array]:
        """Windows in which two feet stand while the robot moves: first sample, arm, m, and drift.

        Two feet that do not slip have ``drift + rate x arm = 0``, m/s, on average over the window.
        """
        places, angular = self.kinematics.positions, self.kinematics.angular
        speeds = self.speeds.reshape(len(places), *self.robot.home.shape)[..., None]
        up = self.robot.foot_radius * np.array((0.0, 0.0, 1.0))
        middle = self.mean(places) - up
        span = len(places) - len(middle)
        time = (self.joint_time[span:] - self.joint_time[:-span])[:, None, None]
        moving = (places[span:] - places[:-span]) / time
        moving = moving - self.mean(cross((angular @ speeds)[..., 0], up))
        stay = self.mean(self.stands.astype(float)) > 1.0 - 0.5 / (span + 1)
        chosen = np.arange(0, len(stay), max(1, span // 3))
        chosen = chosen[~self.rests[chosen]]
        rows = []
        for one, other in np.stack(np.tril_indices(len(self.robot.legs), -1), axis=1):
            both = chosen[stay[chosen, one] & stay[chosen, other]]
            between = [each[both, one] - each[both, other] for each in (middle, moving)]
            rows.append((both, *between))
        first, arm, drift = map(np.concatenate, zip(*rows, strict=True))
        return first, arm, drift

    def reversed(self, joint: int) -> Recording:
        """Return the recording with one joint the other way round."""
        signs = np.where(np.arange(len(self.robot.joint_names)) == joint, -1.0, 1.0)
        columns = ('positions', 'velocities', 'efforts')
        given = {name: getattr(self, name) for name in columns}
        turned = {name: each * signs for name, each in given.items() if each is not None}
        other = replace(self, **turned)
        # Feet that stand are those of the sizes of the forces, which hardly change.
        vars(other).update(stands=self.stands, rests=self.rests, pull=self.pull)
        return other


def check(recording: Recording) -> list[Check]:
    """Run all checks.

    Parameters
    ----------
    recording : Recording
        Some seconds; better with the robot at rest first, and then walking.

    Returns
    -------
    list of Check
        What is wrong, and what could not be judged; empty if nothing is.
    """
    found = _stamps(recording)
    if (most := float(np.abs(recording.positions).max())) >= 7.0:
        text = f'positions up to {most:.3g} rad (or m), over 7: degrees?'
        found.append(Check('joints', 'problem', text))
    if any(each.status == 'problem' for each in found):
        return found  # without times and angles, nothing else can be judged
    found += [*_rates(recording), *_gravity(recording)]
    wrong, fine, others = _reversed(recording)
    found += [*wrong, *_gyro(fine), *_levels(fine)]
    if not any(each.status == 'problem' for each in found):
        found += _delay(fine)
    loads = _forces(fine)
    found += [*loads, *([] if loads or _gravity(recording) else _horizontal(fine))]
    if not any(each.status == 'problem' for each in found):
        found += _contradictions(recording)
    if not any(each.status == 'problem' for each in found):
        found += _unjudged(recording, others)
    return found


def _stamps(recording: Recording) -> list[Check]:
    """Check that stamps rise, and that they are of the clock by which messages arrive."""
    found, ratios, offsets = [], [], []
    for what, times, arrival in (
        ('imu', recording.imu_time, recording.imu_arrival),
        ('joints', recording.joint_time, recording.joint_arrival),
    ):
        back = int((np.diff(times) <= 0.0).sum())
        if back:
            found.append(Check(what, 'problem', f'{back} stamps are not after the one before'))
        elif len(arrival) == len(times):
            ratios.append((what, float((arrival[-1] - arrival[0]) / (times[-1] - times[0]))))
            offsets.append(float(np.median(times - arrival)))
    if found:
        return found
    apart = len(ratios) == 2 and abs(ratios[0][1] - ratios[1][1]) > 0.02
    for what, ratio in ratios:
        if abs(ratio - 1.0) > 0.02:  # where all are alike, they may be of a simulation
            text = f'1 s of its stamps takes {ratio:.3g} s, not 0.98 to 1.02 s'
            found.append(Check(what, 'problem' if apart else 'warning', text))
    if found or not offsets:
        return found
    if abs(offsets[0] - offsets[-1]) > 0.5:
        text = f'stamps are {offsets[0] - offsets[-1]:.3g} s after those of the joints'
        return [Check('imu', 'problem', f'{text}: both need one clock, to 1 ms')]
    if abs(offsets[0]) > 1.0:
        text = f'they differ from the time of arrival by {offsets[0]:.3g} s, over 1 s'
        return [Check('stamps', 'warning', f'{text}: another clock')]
    return []


def _rates(recording: Recording) -> list[Check]:
    """Check how many samples a second arrive, and gaps between them."""
    found = []
    for what, times in (('imu', recording.imu_time), ('joints', recording.joint_time)):
        steps = np.diff(times)
        rate = 1.0 / max(float(np.median(steps)), 1e-9)
        if rate < 194.0:  # 200, but for jitter
            text = f'{rate:.0f} samples a second, 200 to 500 are wanted'
            found.append(Check(what, 'warning', text))
        gaps = steps > max(LONGEST_STEP, 3.0 / rate)
        if gaps.any():
            text = f'{gaps.sum()} gaps in the stamps, the longest of {steps.max():.3g} s'
            found.append(Check(what, 'warning', f'{text}: feet count as lifted in a gap'))
    return found


def _gravity(recording: Recording) -> list[Check]:
    """Check size and axis of the specific force at rest."""
    rests = recording.rests.any()
    mean = recording.calm(recording.pull).mean(0)
    size, most = float(np.linalg.norm(mean)), 0.3 if rests else 0.6
    found = []
    if abs(size - WEIGHT) > most:
        text = f'shows {size:.3g} m/s2 {"at rest" if rests else "on average"}, not'
        found.append(f'{text} {WEIGHT:g} +- {most}: no gravity, g as unit, or a wrong scale')
    if mean[2] < 0.85 * size and size > 0.4:
        found.append(f'gravity is on {_axes([mean])} of the base, not on [z]')
    return [Check('accelerometer', 'problem', text) for text in found]


def _sure(before: Array, after: Array) -> float:
    """Return how sure it is that errors are smaller than before, in standard deviations."""
    gain = before - after
    # Windows overlap by two thirds.
    return float(gain.mean()) / max(float(gain.std()) * math.sqrt(3.0 / len(gain)), 1e-12)


def _explains(before: Array, after: Array) -> bool:
    """Return whether errors are so much smaller that what was wrong is known."""
    sure = _sure(before, after)
    return sure > SURE or (sure > 0.5 * SURE and after.mean() < 0.7 * before.mean())


def _reversed(recording: Recording) -> tuple[list[Check], Recording, list[Recording]]:
    """Check joints against each other: feet that stand do not move against each other.

    A joint is reversed if feet then stand still, with any axes and unit of the gyro.

    Returns
    -------
    found : list of Check
    recording : Recording
        With the joints as they should be.
    others : list of Recording
        The same with each of its joints the other way round; empty if the robot moved too little.
    """
    found: list[Check] = []
    others: list[Recording] = []
    names = recording.robot.joint_names
    while len(recording.pairs[0]) >= FEWEST and len(found) < len(names):
        others = [recording.reversed(joint) for joint in range(len(names))]
        before, errors = _fit(recording)[1], [_fit(each)[1] for each in others]
        best = int(np.argmin([each.mean() for each in errors]))
        text = 'is reversed in the message or in the robot file: its foot moves as if it slipped'
        one = Check(f'joint {names[best]}', 'problem', text)
        if one in found or not _explains(before, errors[best]):
            break
        found.append(one)
        recording = others[best]
    return found, recording, others


def _fit(recording: Recording) -> tuple[Array, Array]:
    """Return the matrix from the gyro's rate to that of the legs, and the errors that are left."""
    first, arm, drift = recording.pairs
    rate = recording.mean(recording.rate())[first]
    lines = (skew(arm)[..., None] * rate[:, None, None]).reshape(-1, 9)
    matrix = np.linalg.lstsq(lines, drift.ravel(), rcond=None)[0]
    left = drift - (lines @ matrix).reshape(-1, 3)
    return np.asarray(matrix.reshape(3, 3), dtype=float), _sizes(left)


def _errors(recording: Recording, turn: Array | None = None, late: float = 0.0) -> Array:
    """Return how fast pairs of standing feet move against each other in windows, m/s.

    The rate of the gyro is turned by a matrix, and taken from ``late`` s before.
    """
    first, arm, drift = recording.pairs
    rate = recording.mean(recording.rate(late))[first]
    return _sizes(drift + cross(rate if turn is None else rate @ turn.T, arm))


def _turn(matrix: Array) -> Array:
    """Return the turn by axes and signs nearest to a matrix of least squares; own if unclear."""
    size = float(np.abs(matrix).max())
    known = np.where(np.abs(matrix) > 0.3 * size, matrix, 0.0) + 0.2 * size * np.eye(len(matrix))
    turn = np.zeros_like(matrix)
    best = linear_sum_assignment(np.abs(known), maximize=True)
    turn[best] = np.where(known[best] < 0.0, -1.0, 1.0)
    return turn


def _axes(rows: Sequence[Array] | Array) -> str:
    """Return the name of the axis nearest to each row, with its sign."""
    places = [int(np.abs(row).argmax()) for row in rows]
    signs = ['-' if row[place] < 0.0 else '' for row, place in zip(rows, places, strict=True)]
    return f'[{", ".join(sign + "xyz"[place] for sign, place in zip(signs, places, strict=True))}]'


def _gyro(recording: Recording) -> list[Check]:
    """Check axes and unit of the gyro against the legs, by least squares."""
    if len(recording.pairs[0]) < FEWEST:
        return []
    matrix = _fit(recording)[0]
    turn = _turn(matrix)
    degrees = np.abs(matrix).max() < 0.1
    scale = math.radians(1.0) if degrees else 1.0
    if not _explains(_errors(recording), _errors(recording, scale * turn)):
        return []
    found = ['shows degrees per second, not rad/s'] if degrees else []
    if not np.array_equal(turn, np.eye(3)):
        found.append(f'rotation about x, y, z of the base is on {_axes(turn)}, not on [x, y, z]')
    return [Check('gyro', 'problem', text) for text in found]


def _levels(recording: Recording) -> list[Check]:
    """Check at rest that the feet are in one plane below the body."""
    if not recording.rests.any():
        return []
    robot, up = recording.robot, recording.up
    places = robot.foot_positions(recording.positions[recording.rests].mean(0))
    centred = places - places.mean(0)
    slope = np.linalg.lstsq(centred[:, :2], centred[:, 2], rcond=None)[0]
    off = np.abs(centred[:, 2] - centred[:, :2] @ slope)
    if np.linalg.norm(up[:2] + slope * up[2]) > 0.35:  # more than a slope on which robots stand
        off = np.maximum(off, np.abs(centred @ up))
    above = places[:, 2] > -0.2 * np.linalg.norm(places - robot.hips, axis=1)
    off[above] = np.maximum(off[above], 0.03)
    if off.max() < 0.03:
        return []
    text = f'at rest foot {robot.legs[int(off.argmax())]} is {off.max():.2g} m off the plane of'
    return [Check('feet', 'problem', f'{text} the others, 0.03 m on a flat floor at most')]


def _delay(recording: Recording) -> list[Check]:
    """Check that IMU and joints have the same time: when the gyro fits the legs best."""
    if len(recording.pairs[0]) < FEWEST:
        return []
    tried = np.arange(-0.03, 0.0305, 1e-3)
    errors = [_errors(recording, late=late) for late in tried]
    best = int(np.argmin([each.mean() for each in errors]))
    if abs(tried[best]) <= 2e-3 or _sure(_errors(recording), errors[best]) < 0.5 * SURE:
        return []
    word = 'later' if tried[best] > 0.0 else 'earlier'
    text = f"stamps are {1e3 * abs(tried[best]):.0f} ms {word} than the IMU's for the same motion"
    return [Check('joints', 'warning', f'{text}, 2 ms at most are wanted')]


def _forces(recording: Recording) -> list[Check]:
    """Check sign, axis and unit of the forces on the feet at rest."""
    forces, robot = recording.ground_forces, recording.robot
    if forces is None:
        return [Check('force', 'problem', 'neither foot forces nor efforts arrive')]
    what = 'efforts' if recording.forces is None else 'foot forces'
    measured = recording.efforts if recording.forces is None else recording.forces
    if not np.any(measured):
        return [Check(what, 'problem', 'are all zero')]
    most = np.linalg.norm(forces, axis=2).max(0)
    found = [
        f'foot {leg} never carries load'
        for leg, size in zip(robot.legs, most, strict=True)
        if size < 0.02 * most.max()
    ]
    if not found and recording.force_kind != 'contact':
        mean, up = recording.calm(forces).mean(0), recording.up
        total = mean.sum(0)
        size, weight = float(np.linalg.norm(total)), robot.mass * WEIGHT
        if total @ up < 0.7 * size:
            found.append(f'are along {_axes([total])} of the base at rest, not along [z]')
        else:
            found += [
                f'that of foot {leg} is along {_axes([force])} of the base at rest, not along [z]'
                for leg, force in zip(robot.legs, mean, strict=True)
                if np.linalg.norm(force) > 0.05 * size and force @ up < 0.5 * np.linalg.norm(force)
            ]
        if not found and weight and not 0.75 < size / weight < 1.33:
            text = f'add up to {size:.3g} N at rest, and the robot weighs {weight:.3g} N'
            found.append(f'{text}: {weight / size:.3g} times is needed')
    return [Check(what, 'problem', text) for text in found]


def _horizontal(recording: Recording) -> list[Check]:
    """Check that foot forces accelerate the body as the accelerometer shows: axes about z."""
    forces = recording.ground_forces
    if forces is None or recording.force_kind != 'vector' or not np.any(forces[..., :2]):
        return []
    total = recording.mean(forces.sum(1)[:, :2], 3)  # N
    wanted = recording.robot.mass * recording.mean(recording.pull[:, :2], 3)
    moves = np.flatnonzero(~recording.rests[: len(total)])
    moves = moves[:: max(1, (len(forces) - len(total)) // 9)]
    if len(moves) < FEWEST:
        return []
    total, wanted = (each[moves] - each[moves].mean(0) for each in (total, wanted))
    turn = _turn(np.asarray(np.linalg.lstsq(total, wanted, rcond=None)[0], dtype=float))
    before, after = np.abs(total - wanted), np.abs(total @ turn - wanted)
    # Legs that swing move the base against the centre of mass: along such an axis nothing is seen.
    most = 0.75 * np.minimum(before.mean(0), np.abs(wanted).mean(0))
    if not (after.mean(0) < most).any() or _sure(before.sum(1), after.sum(1)) <= SURE:
        return []
    text = f'x, y of the forces are {_axes(turn)} of the accelerometer, not [x, y]'
    return [Check('accelerometer or foot forces', 'problem', text)]


def _contradictions(recording: Recording) -> list[Check]:
    """Run the body estimator, which makes checks of its own, and return what it doubted."""
    robot = recording.robot
    if not robot.mass > 0.0:
        return []
    estimator = BodyEstimator(robot, force_axes=recording.force_axes)
    turn, found = robot.imu[:3, :3], {}
    columns = [recording.at_joints(recording.gyro) @ turn, recording.pull @ turn]
    columns += [recording.positions, recording.speeds]
    none = [None] * len(recording.joint_time)
    rest = (none if each is None else each for each in (recording.forces, recording.efforts))
    for time, *row in zip(recording.joint_time.tolist(), *columns, *rest, strict=True):
        kind, _, text = estimator.update(time, *row).doubt.partition(': ')
        found[kind] = text
    # The first kind: what it makes of readings may be the reason of the others.
    kinds = [kind for kind in ('imu', 'joints', 'force', 'kinematics') if kind in found]
    return [Check(kind, 'problem', found[kind]) for kind in kinds[:1]]


def _unjudged(recording: Recording, others: Sequence[Recording]) -> list[Check]:
    """Return what moved too little to be judged: axes of the gyro, joints, the delay."""
    if not others:
        found = ['gyro, joints and their delay: the robot did not move on its feet']
    else:
        axes = zip('xyz', np.eye(3), strict=True)
        flips = {f'gyro about {axis}': np.diag(1.0 - 2.0 * row) for axis, row in axes}
        errors = {what: _errors(recording, flip) for what, flip in flips.items()}
        for name, other in zip(recording.robot.joint_names, others, strict=True):
            errors[f'joint {name}'] = _errors(other)
        ends = [_errors(recording, late=late) for late in (-0.01, 0.01)]
        errors['delay between IMU and joints'] = min(ends, key=np.mean)
        before = _errors(recording)
        found = [name for name, after in errors.items() if not _explains(after, before)]
    return [Check('not judged', 'warning', ', '.join(found))] if found else []


def _sizes(vectors: Array) -> Array:
    """Return the lengths of vectors, (k,)."""
    return np.asarray(np.linalg.norm(vectors, axis=1))
