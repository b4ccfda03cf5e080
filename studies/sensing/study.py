# SPDX-License-Identifier: Apache-2.0
"""Body and feet estimated from IMU, joints and foot forces, on simulated walks with known truth.

Beside the estimator: the same without rejection of slipping feet, a plain filter with 27 states,
and legged odometry (gyro, and the mean velocity of the feet that stand) with feet that roll and
with feet that do not. Errors are vectors of x and y. Slips are of settled stances, 24 ms after
touch-down, faster than 10 mm/s; the alarm is that of ros_pad.estimation with a noise of 15 mm/s.
A false alarm has no speed above 5 mm/s in its last 60 ms. With --all, walks that are harder: long
pushes, slopes, other gaits and rates, soft feet, a cheap IMU. With --out, sensing.json and
sensing.png: time an update against errors, and the error while no foot stands beside its law.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterable
from collections.abc import Sequence
from typing import Any
from typing import NamedTuple

import numpy as np

from ros_pad.estimation.alarm import SlipAlarms
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from ros_pad.sensing import BodyEstimator
from studies import command
from studies.samples import Flags
from studies.samples import runs
from studies.sensing import chart
from studies.sensing import rivals
from studies.sensing.walks import COURSES
from studies.sensing.walks import RAMP
from studies.sensing.walks import REST
from studies.sensing.walks import Course
from studies.sensing.walks import Log
from studies.sensing.walks import walk

CASES = ('dry', 'patches', 'ice', 'hexapod')
METHODS = (
    *('estimator', 'no rejection', 'plain filter', 'invariant', 'invariant, χ²'),
    *('odometry', 'odometry, r = 0'),
)
FIRST_SEED = 111  # constants of the estimator were chosen on seeds below 102

ALARM_NOISE = 0.015  # m/s
SLIPS, STICKS = 0.01, 0.005  # m/s
SETTLED, RECENT, WINDOW = 0.024, 0.06, 0.02  # s


class Track(NamedTuple):
    """What a method gives for a log, row by row; deviations are NaN where it has none."""

    position: Array
    velocity: Array
    deviation: Array  # of velocity x and y
    slip: Array
    slip_deviation: Array
    standing: Flags
    force: Array
    slipping: Flags
    doubt: Flags
    seconds: float  # an update


@dataclasses.dataclass
class Row:
    """Figures of one method on one walk, SI units."""

    course: str
    seed: int
    method: str
    path: float
    velocity_error: float
    vertical_error: float
    drift: float
    slip_error: float
    ratio: float
    coverage: float
    slip_coverage: float
    flagged: float
    doubt: float
    seconds: float
    missed: dict[str, tuple[int, int]]
    false_alarms: float
    latency: float
    slipped: float


def estimator_for(robot: Robot, course: Course, **arguments: Any) -> BodyEstimator:
    """Return an estimator that knows the noise of a course."""
    noise = course.noise
    return BodyEstimator(
        robot,
        gyro_noise=noise.gyro,
        accelerometer_noise=noise.accelerometer,
        encoder_noise=noise.encoder,
        velocity_noise=noise.velocity,
        force_noise=noise.force,
        accelerometer_bias=noise.accelerometer_bias,
        **arguments,
    )


def readings(log: Log) -> Iterable[tuple[Any, ...]]:
    """Return the readings of a log, sample by sample, as the estimator takes them."""
    columns = (log.gyro, log.accelerometer, log.joint_positions, log.joint_velocities)
    return zip(log.time.tolist(), *columns, log.foot_forces, strict=True)


def estimated(robot: Robot, log: Log, course: Course, **arguments: Any) -> Track:
    """Run the estimator over a log; arguments are those of its constructor."""
    estimator = estimator_for(robot, course, **arguments)
    begin = time.process_time()
    found = [estimator.update(*row) for row in readings(log)]
    seconds = (time.process_time() - begin) / len(found)
    feet = [each.feet for each in found]
    return Track(
        position=np.array([each.position for each in found]),
        velocity=np.array([each.velocity for each in found]),
        deviation=np.sqrt([np.diag(each.covariance)[6:8] for each in found]),
        slip=np.array([[foot.slip_velocity for foot in row] for row in feet]),
        slip_deviation=np.array([[foot.slip_velocity_sd for foot in row] for row in feet]),
        standing=np.array([[foot.in_contact for foot in row] for row in feet]),
        force=np.array([[foot.force for foot in row] for row in feet]),
        slipping=np.array([[foot.slipping for foot in row] for row in feet]),
        doubt=np.array([bool(each.doubt) for each in found]),
        seconds=seconds,
    )


def track_of(robot: Robot, log: Log, course: Course, method: str) -> Track:
    """Run a method over a log."""
    if method == 'estimator':
        return estimated(robot, log, course)
    if method == 'no rejection':
        # Slips would look like feet and legs of another size.
        fixed = {'radius_error': 0.0, 'length_error': 0.0}
        return estimated(robot, log, course, rejection=False, **fixed)
    begin = time.process_time()
    if method in rivals.FILTERS:
        rows = rivals.FILTERS[method](robot, course).rows(log)
    else:
        radius = robot.foot_radius if method == 'odometry' else 0.0
        rows = rivals.odometry(robot, log, course, radius)
    seconds = (time.process_time() - begin) / len(rows)
    stands = rivals.loads_of(robot, log)
    none = np.full(stands.shape, math.nan)
    spread = np.array([row[3] for row in rows]) if len(rows[0]) > 3 else none[:, :2]
    return Track(
        position=np.array([row[0] for row in rows]),
        velocity=np.array([row[1] for row in rows]),
        deviation=spread,
        slip=np.array([row[2][:, :2] for row in rows]),
        slip_deviation=none,
        standing=stands,
        force=log.foot_forces,  # of a body that is nearly level
        slipping=np.zeros_like(stands),
        doubt=np.zeros(len(rows), dtype=bool),
        seconds=seconds,
    )


def alarms_of(track: Track, rate: float) -> Flags:
    """Return whether the slip alarm is on, (samples, legs), from the slip against the force."""
    tangential = track.force[..., :2]
    strength = np.maximum(np.linalg.norm(tangential, axis=2), 1e-9)
    speeds = -(track.slip * tangential).sum(2) / strength
    found = np.zeros(speeds.shape, dtype=bool)
    for leg in range(speeds.shape[1]):
        alarms = SlipAlarms(ALARM_NOISE, WINDOW)
        for start, stop in runs(track.standing[:, leg]):
            alarms.reset()
            for row in range(start + round(SETTLED * rate), stop):
                found[row, leg] = alarms.update(float(speeds[row, leg]), 1.0 / rate)
    return found


def settled(standing: Flags, rate: float) -> Flags:
    """Return the samples of feet that stand, but for the first and last 24 ms of a stance."""
    found = standing.copy()
    for shift in range(1, round(SETTLED * rate) + 1):
        found[shift:] &= standing[:-shift]
        found[:-shift] &= standing[shift:]
    return found


def judge_alarms(track: Track, log: Log, walking: Flags, rate: float) -> dict[str, Any]:
    """Return missed slips by size and number of feet, false alarms, latency."""
    recently = round(RECENT * rate)
    speed = np.linalg.norm(log.slip, axis=2)
    within = settled(track.standing, rate) & walking[:, None]
    slips = within & (speed > SLIPS)
    on = alarms_of(track, rate)
    all_slip = (slips | ~within).all(1) & within.any(1)
    missed = {f'{kind} > {size} mm': [0, 0] for kind in ('some', 'all') for size in (5, 10)}
    late: list[tuple[float, float]] = []
    false = 0
    for leg in range(speed.shape[1]):
        for start, stop in runs(slips[:, leg], join=2):
            path = speed[start:stop, leg].sum() / rate
            found = np.flatnonzero(on[start : stop + recently, leg])
            kind = 'all' if all_slip[start:stop].any() else 'some'
            for size in (5, 10):
                if path > 1e-3 * size:
                    missed[f'{kind} > {size} mm'][0] += not found.size
                    missed[f'{kind} > {size} mm'][1] += 1
            fresh = within[start - recently : start, leg].all()
            if fresh and found.size and path > 5e-3 and not on[start - 1, leg]:
                late.append((found[0] / rate, speed[start : start + found[0], leg].sum() / rate))
        for start, _ in runs(on[:, leg] & walking):
            recent = speed[max(0, start - recently) : start + 1, leg]
            stood = track.standing[max(0, start - recently) : start + 1, leg]
            false += not (recent[stood] > STICKS).any()
    minutes = (within & (speed < STICKS)).sum() / rate / 60.0
    latency, slipped = np.median(late, axis=0) if late else (math.nan, math.nan)
    return {
        'missed': {key: (count[0], count[1]) for key, count in missed.items()},
        'false_alarms': false / minutes,
        'latency': float(latency),
        'slipped': float(slipped),
    }


def mean_slip(log: Log, rate: float) -> Array:
    """Return the true slip velocities over the last 20 ms, by the trapezoid rule."""
    window = round(WINDOW * rate)
    total = np.concatenate([np.zeros((1, *log.slip.shape[1:])), np.cumsum(log.slip, axis=0)])
    found = np.zeros_like(log.slip)
    inner = total[window + 1 :] - total[: -window - 1]
    found[window:] = (inner - 0.5 * (log.slip[window:] + log.slip[:-window])) / window
    return found


def measure(name: str, seed: int, duration: float) -> list[Row]:
    """Return the figures of every method on one walk."""
    course = COURSES[name]
    robot, rate = Robot.load(course.robot), course.rate
    log = walk(course, seed, duration)
    walking = log.time > REST + RAMP
    path = float(np.linalg.norm(np.diff(log.position[:, :2], axis=0), axis=1).sum())
    true_slip = mean_slip(log, rate)
    rows = []
    for method in METHODS:
        track = track_of(robot, log, course, method)
        every = (track.velocity - log.velocity)[walking]
        error = every[:, :2]
        scaled = error / track.deviation[walking]
        moved = (log.position - log.position[0])[-1] - (track.position - track.position[0])[-1]
        within = settled(track.standing, rate) & walking[:, None]
        sticks = within & (np.linalg.norm(log.slip, axis=2) < STICKS)
        slip = track.slip - true_slip
        inside = np.abs(slip) < 2.0 * track.slip_deviation[..., None]
        rows.append(
            Row(
                *(name, seed, method, path),
                velocity_error=float(np.sqrt((error**2).sum(1).mean())),
                vertical_error=float(np.sqrt((every[:, 2] ** 2).mean())),
                drift=float(np.linalg.norm(moved[:2]) / path),
                slip_error=float(np.sqrt((slip[sticks] ** 2).sum(1).mean())),
                ratio=float(np.sqrt((scaled**2).mean())),
                coverage=float((np.abs(scaled) < 2.0).mean()),
                slip_coverage=float(inside[within].mean()),
                flagged=float(track.slipping[sticks].mean()),
                doubt=float(track.doubt[walking].mean()),
                seconds=track.seconds,
                **judge_alarms(track, log, walking, rate),
            )
        )
    return rows


def table(rows: Sequence[Row]) -> str:
    """Return the figures, means over the seeds, as a table."""
    lines = [
        'Means over seeds. v: body velocity x y, RMSE, and z; drift: of the path; slip: velocity'
        ' over 20 ms of sticking feet;\nratio: error of v over its deviation, rms; in 2 sd: share'
        ' of errors of v / of slip; missed of slips > 5 / > 10 mm,\nfirst where some feet stick,'
        ' then where all slip; false: alarms a stick-minute; late: median of fresh slips;\nflag:'
        ' share of sticking samples with slipping; doubt: share of time.',
        'walk             method          v, z mm/s    drift %  slip mm/s  ratio  in 2 sd   '
        ' missed some     missed all      false   late ms, mm flag %  doubt %  µs',
    ]
    for name, method in {(row.course, row.method): None for row in rows}:
        some = [row for row in rows if (row.course, row.method) == (name, method)]

        def mean(key: str, chosen: Sequence[Row] = some) -> float:
            values = [getattr(row, key) for row in chosen]
            return float(np.mean([each for each in values if each == each] or [math.nan]))

        missed = {
            key: '{}/{}'.format(*np.sum([row.missed[key] for row in some], axis=0))
            for key in some[0].missed
        }
        lines.append(
            f'{name:16} {method:15} {1e3 * mean("velocity_error"):5.1f}'
            f' {1e3 * mean("vertical_error"):5.1f}'
            f' {1e2 * mean("drift"):8.2f} {1e3 * mean("slip_error"):10.1f}'
            f' {mean("ratio"):6.2f}  {mean("coverage"):.2f}/{mean("slip_coverage"):.2f}'
            f'  {missed["some > 5 mm"]:>7} {missed["some > 10 mm"]:>7}'
            f' {missed["all > 5 mm"]:>7} {missed["all > 10 mm"]:>7}'
            f' {mean("false_alarms"):8.1f} {1e3 * mean("latency"):6.0f}'
            f' {1e3 * mean("slipped"):5.1f} {1e2 * mean("flagged"):5.1f}'
            f' {1e2 * mean("doubt"):7.1f} {1e6 * mean("seconds"):6.0f}'
        )
    return '\n'.join(lines)


def blind(seed: int, length: float = 2.0) -> dict[str, list[float]]:
    """Return errors of velocity x y, m/s, while no foot is seen to stand, beside their law.

    The law: an unknown velocity, white noise of the accelerometer, and constant errors of its bias
    and of the tilt, which grow as the root of time and as time.
    """
    course = COURSES['dry']
    robot, rate = Robot.load(course.robot), course.rate
    log = walk(course, seed, 20.0)
    steps = round(length * rate)
    errors, laws = [], []
    for start in (1500, 2000, 2500, 3000, 3500, 4000):
        estimator = estimator_for(robot, course)
        found = []
        for index, (now, gyro, force, q, dq, loads) in enumerate(readings(log)):
            if index >= start + steps:
                break
            seen = loads if index < start else 0.0 * loads
            found.append(estimator.update(now, gyro, force, q, dq, seen))
        rest = found[start - 1].covariance
        since = np.arange(steps) / rate
        tilt, speed = rest[3, 3] + rest[4, 4], rest[6, 6] + rest[7, 7]
        noise, bias = course.noise.accelerometer, course.noise.accelerometer_bias
        laws.append(
            speed
            + 2.0 * noise**2 / rate * since
            + (2.0 * bias**2 / 3.0 + 9.81**2 * tilt) * since**2
        )
        last = np.array([each.velocity[:2] for each in found[start:]])
        errors.append(((last - log.velocity[start : start + steps, :2]) ** 2).sum(1))
    held = [
        ((log.velocity[start - 1, :2] - log.velocity[start : start + steps, :2]) ** 2).sum(1)
        for start in (1500, 2000, 2500, 3000, 3500, 4000)
    ]
    return {
        'time': since.tolist(),
        'error': np.sqrt(np.mean(errors, axis=0)).tolist(),
        'law': np.sqrt(np.mean(laws, axis=0)).tolist(),
        'held': np.sqrt(np.mean(held, axis=0)).tolist(),
    }


def main(words: Sequence[str]) -> int:
    """Measure, and print the table; return the exit status."""
    part = command.parser('sensing', __doc__)
    command.add_count(part, '--seeds', 2, 'walks of each kind')
    command.add_count(part, '--duration', 30, 'length of a walk, s', least=6)
    part.add_argument('--all', action='store_true', help='all kinds of walks')
    part.add_argument('--picture', action='store_true', help='write sensing.json and sensing.png')
    command.add_out(part)
    options = part.parse_args(words)
    names = tuple(COURSES) if options.all else CASES
    cases = [(name, FIRST_SEED + seed) for name in names for seed in range(options.seeds)]
    rows = [
        row
        for name, seed in command.each(cases, 'sensing', 'walk')
        for row in measure(name, seed, float(options.duration))
    ]
    kept = [dataclasses.asdict(row) for row in rows]
    if options.picture:
        lost = blind(FIRST_SEED)
        picture = chart.picture(kept, METHODS, lost)
        command.write(options.out, 'sensing', {'rows': kept, 'blind': lost}, {'sensing': picture})
    command.show(options, kept, table(rows))
    return 0
