# SPDX-License-Identifier: Apache-2.0
"""Where estimates of the velocity diverge: all feet slip, no foot stands, feet slide, low rates.

A simulated walk on dry ground is changed so that nothing but the case is new: joints are moved to
those of feet that slide under the same body, forces are cut to their noise, or samples are left
out. A law, without anything fitted, says for each case what the error has to be.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence

import numpy as np

from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array, cross, matrix
from ros_pad.sensing.body_filter import GRAVITY
from studies import command
from studies.sensing import rivals
from studies.sensing.methods import METHODS, Track, track_of
from studies.sensing.walks import REST, Course, Log, walk

LIMIT = 0.1  # m/s, error of velocity x y above which a method has diverged: a third of the speed
SPEED = 0.2  # m/s, of feet that slide
ONSET = 0.05  # s, until they have it
BEGINS = (5.0, 12.0, 19.0)  # s, of slips and of times without a foot
LONGEST = 3.0  # s, their length
AFTER = 5.0  # s, for which errors are kept
DURATION = 26.0  # s
SHORT = 14.0  # s, walks in which feet slide for long, and of other rates
SLIDES = 4.0  # s, when feet begin to slide for long
SETTLED = 8.0  # s, from when errors of long cases count
RATES = (500, 250, 100, 50, 25)  # Hz
COURSE = Course(rate=float(RATES[0]))
USUAL = 250  # Hz
EDGES = np.unique(
    np.r_[
        0, np.geomspace(2.0, USUAL * LONGEST, 90), np.geomspace(USUAL * LONGEST, USUAL * AFTER, 20)
    ].astype(int)
)  # samples between which errors are averaged
UNLOADED = 1.0  # N
RETURN = 0.05  # s, in which a foot in the air comes back over the ground that it slid


@dataclasses.dataclass
class Curve:
    """Errors of a method, or of a law, in a case.

    ``x`` is time since the beginning, s, number of feet, or rate, Hz; ``error`` the rms of the
    velocity x y, m/s; ``doubt`` the share of samples in doubt; ``silent`` the share of runs that
    are wrong by more than :data:`LIMIT` without a doubt.
    """

    case: str
    method: str
    x: list[float]
    error: list[float]
    doubt: list[float]
    silent: list[float]


@functools.lru_cache(maxsize=2)
def walked(seed: int, duration: float) -> Log:
    """Return a walk with the highest rate."""
    return walk(COURSE, seed, duration)


def sampled(log: Log, rate: int) -> tuple[Log, Course]:
    """Return every n-th sample of a walk, and the course that has this rate."""
    every = slice(None, None, RATES[0] // rate)
    rows = {each.name: getattr(log, each.name)[every] for each in dataclasses.fields(log)}
    return Log(**rows), dataclasses.replace(COURSE, rate=float(rate))


def slid(robot: Robot, log: Log, speeds: Array) -> Log:
    """Return a log of the same body over feet that slide while they stand.

    ``speeds``, (n, legs, 2), m/s, are those of their centres over the ground. In the air a foot
    comes back to where it would have been. The slip of contact points, which roll as well, is not
    known.
    """
    dt = float(log.time[1] - log.time[0])
    joints, rates = log.joint_positions.copy(), log.joint_velocities.copy()
    feet, away = log.feet.copy(), np.zeros((len(robot.legs), 3))
    for row in range(len(log.time)):
        stands = log.load[row] > UNLOADED
        moves = np.where(stands[:, None], 0.0, -away / RETURN)
        moves[stands, :2] = speeds[row, stands]
        away = away + dt * moves
        feet[row] += away
        if not away.any():
            continue
        turn = matrix(log.orientation[row])
        before = joints[row].reshape(robot.home.shape)
        change = away @ turn
        after = robot.joint_positions(robot.foot_positions(before) + change, near=before)
        speed = robot.kinematics(before).jacobians @ rates[row].reshape(*before.shape, 1)
        speed[..., 0] += moves @ turn - cross(robot.imu[:3, :3] @ log.gyro[row], change)
        joints[row] = after.ravel()
        rates[row] = np.linalg.solve(robot.kinematics(after).jacobians, speed).ravel()
    slip = np.full_like(log.slip, np.nan)
    return dataclasses.replace(
        log, joint_positions=joints, joint_velocities=rates, slip=slip, feet=feet
    )


def sliding(time: Array, begins: Sequence[float], length: float) -> Array:
    """Return a factor on the speed of sliding, (n,), with ramps at both ends of each slide."""
    since = time - np.array(begins)[:, None]
    return np.asarray(np.clip(np.minimum(since, length - since) / ONSET, 0.0, 1.0).sum(0))


def directions(seed: int, legs: int, alike: bool) -> Array:
    """Return unit vectors, (legs, 2), in which feet slide: one for all, or one for each."""
    angles = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 1 if alike else legs)
    return np.broadcast_to(np.stack([np.cos(angles), np.sin(angles)], axis=1), (legs, 2))


def unloaded(log: Log, course: Course, begins: Sequence[float], length: float) -> Log:
    """Return a log in which no foot carries load for some time: only noise is left of forces."""
    since = log.time - np.array(begins)[:, None]
    none = ((since >= 0.0) & (since < length)).any(0)
    forces = log.foot_forces.copy()
    noise = np.random.default_rng(0).standard_normal(forces[none].shape)
    forces[none] = course.noise.force * noise
    return dataclasses.replace(log, foot_forces=forces)


def drifting(track: Track, course: Course, row: int, since: Array) -> Array:
    """Return the variance of the velocity x y after times without a foot, (n,), m²/s².

    An unknown velocity and tilt, as stated in a row, white noise of the accelerometer, and its
    bias.
    """
    noise, bias = course.noise.accelerometer, course.noise.accelerometer_bias
    start, tilt = (track.deviation[row] ** 2).sum(), (track.tilt[row] ** 2).sum()
    growing = 2.0 * noise**2 / course.rate * since
    return np.asarray(start + growing + (2.0 * bias**2 / 3.0 + GRAVITY[2] ** 2 * tilt) * since**2)


def missed(robot: Robot, log: Log) -> float:
    """Return what a step of the trapezoid rule misses of the velocity x y, rms, m/s."""
    turns = np.array([matrix(turn) for turn in log.orientation])
    to_world = turns @ robot.imu[:3, :3]
    still = log.time < REST
    bias = log.accelerometer[still].mean(0) + to_world[still].mean(0).T @ GRAVITY
    force = np.einsum('nij,nj->ni', to_world, log.accelerometer - bias) + GRAVITY
    arm = robot.imu[:3, :3].T @ robot.imu[:3, 3]
    velocity = log.velocity + np.einsum('nij,nj->ni', to_world, cross(log.gyro, arm))
    dt = log.time[1] - log.time[0]
    left = np.diff(velocity, axis=0) - 0.5 * dt * (force[1:] + force[:-1])
    walking = log.time[1:] > SETTLED
    return float(np.sqrt((left[walking, :2] ** 2).sum(1).mean()))


# Squares of errors, m²/s², and shares of doubt, each (runs, points)
_Found = dict[str, tuple[Array, Array]]


def averaged(values: Array) -> Array:
    """Return means between :data:`EDGES` of the samples of each run, (runs, points)."""
    return np.asarray(np.add.reduceat(values, EDGES[:-1], axis=1) / np.diff(EDGES))


def over_time(case: str, seed: int) -> _Found:
    """Return errors and doubts over time since feet slip, or stand no more."""
    robot = Robot.load(COURSE.robot)
    log, course = sampled(walked(seed, DURATION), USUAL)
    if case == 'no foot stands':
        changed = unloaded(log, course, BEGINS, LONGEST)
    else:
        ways = directions(seed, len(robot.legs), case == 'all feet slip alike')
        fast = SPEED * sliding(log.time, BEGINS, LONGEST)
        changed = slid(robot, log, fast[:, None, None] * ways)
    starts = [round(begin * course.rate) for begin in BEGINS]
    rows = np.array(starts)[:, None] + np.arange(EDGES[-1])
    found: _Found = {}
    for method in METHODS:
        track = track_of(robot, changed, course, method)
        errors = ((track.velocity - log.velocity)[:, :2] ** 2).sum(1)
        found[method] = averaged(errors[rows]), averaged(track.doubt[rows].astype(float))
        if method == 'estimator':
            since = (rows[0] - rows[0, 0]) / course.rate
            laws = np.array([drifting(track, course, row - 1, since) for row in starts])
            laws[:, since >= LONGEST] = np.nan
            found['law'] = averaged(laws), averaged(np.zeros_like(laws))
    return found


def over_feet(seed: int) -> _Found:
    """Return errors and doubts over the number of feet that slide for long.

    The last point is that of all feet, sliding evenly since before the start: all readings are
    then as without sliding.
    """
    robot = Robot.load(COURSE.robot)
    legs = len(robot.legs)
    log, course = sampled(walked(seed, SHORT), USUAL)
    way = directions(seed, legs, alike=True)
    fast = SPEED * sliding(log.time, (SLIDES,), 2.0 * SHORT)[:, None, None]
    late = log.time > SETTLED
    stands = rivals.loads_of(robot, log)[late]
    columns: dict[str, list[tuple[float, float]]] = {name: [] for name in ('law', *METHODS)}
    for count in range(legs + 2):
        slides = np.arange(legs) < count % (legs + 1)
        changed = slid(robot, log, fast * way * slides[:, None])
        shift = SPEED * way[0] if count > legs else np.zeros(2)
        share = (stands & slides).sum(1) / np.maximum(stands.sum(1), 1)
        law = float(((SPEED * share) ** 2).mean() + shift @ shift)
        columns['law'].append((law, 0.0))
        for method in METHODS:
            track = track_of(robot, changed, course, method)
            errors = (track.velocity - log.velocity)[late, :2] - shift
            columns[method].append(((errors**2).sum(1).mean(), track.doubt[late].mean()))
    return _rows(columns)


def over_rates(seed: int) -> _Found:
    """Return errors and doubts over the rate of the samples."""
    robot = Robot.load(COURSE.robot)
    columns: dict[str, list[tuple[float, float]]] = {name: [] for name in ('law', *METHODS)}
    for rate in RATES:
        log, course = sampled(walked(seed, SHORT), rate)
        late = log.time > SETTLED
        columns['law'].append((missed(robot, log) ** 2, 0.0))
        for method in METHODS:
            track = track_of(robot, log, course, method)
            errors = (track.velocity - log.velocity)[late, :2]
            columns[method].append(((errors**2).sum(1).mean(), track.doubt[late].mean()))
    return _rows(columns)


def _rows(columns: dict[str, list[tuple[float, float]]]) -> _Found:
    arrays = {name: np.array(values).T for name, values in columns.items()}
    return {name: (values[:1], values[1:]) for name, values in arrays.items()}


TIMED = ('all feet slip alike', 'all feet slip apart', 'no foot stands')
CASES: dict[str, tuple[Callable[[int], _Found], Array]] = {
    **{
        case: (functools.partial(over_time, case), 0.5 * (EDGES[:-1] + EDGES[1:]) / USUAL)
        for case in TIMED
    },
    'feet slide for long': (over_feet, np.arange(6.0)),
    'low rates': (over_rates, np.array(RATES, dtype=float)),
}
"""What measures each case for a seed, and its points: time, s, number of feet, rate, Hz."""


def curves(case: str, found: Sequence[_Found]) -> list[Curve]:
    """Return the curves of a case from what was found with each seed."""
    made = []
    for name in ('law', *METHODS):
        squares, doubts = (np.concatenate([each[name][i] for each in found]) for i in (0, 1))
        errors = np.sqrt(squares.mean(0))
        silent = ((squares > LIMIT**2) & (doubts < 0.5)).mean(0)
        known = np.isfinite(errors)  # the law ends with the slip
        columns = (CASES[case][1], errors, doubts.mean(0), silent)
        made.append(Curve(case, name, *(column[known].tolist() for column in columns)))
    return made


def measure(seeds: Sequence[int]) -> list[Curve]:
    """Measure all cases with all seeds, and show progress."""
    tasks = [(case, seed) for seed in seeds for case in CASES]
    found: dict[str, list[_Found]] = {case: [] for case in CASES}
    for case, seed in command.each(tasks, 'stability', 'case'):
        found[case].append(CASES[case][0](seed))
    return [curve for case in CASES for curve in curves(case, found[case])]


def first(curve: Curve, values: Sequence[float], limit: float) -> float:
    """Return the first point of a curve at which a value is above a limit, or NaN."""
    return next((x for x, value in zip(curve.x, values, strict=True) if value > limit), math.nan)


UNITS = {'feet slide for long': 'feet', 'low rates': 'Hz'}


def summary(found: Sequence[Curve]) -> str:
    """Return where each method diverges, is in doubt and is wrong without a doubt, in Markdown."""
    lines = ['| case | ' + ' | '.join(('law', *METHODS)) + ' |', '|---' * (len(METHODS) + 2) + '|']
    for case in dict.fromkeys(curve.case for curve in found):
        curves = [curve for curve in found if curve.case == case]
        cells = [f'{case}, {UNITS.get(case, "s")}', *map(_limits, curves)]
        lines.append('| ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def _limits(curve: Curve) -> str:
    wrong, doubt, silent = (
        first(curve, values, limit)
        for values, limit in ((curve.error, LIMIT), (curve.doubt, 0.5), (curve.silent, 0.5))
    )
    shown = '–' if math.isnan(wrong) else f'{wrong:.3g}'
    if not math.isnan(doubt):
        shown += f'; doubt {doubt:.3g}'
        shown += '' if math.isnan(silent) else f'; silent {silent:.3g}'
    return shown
