# SPDX-License-Identifier: Apache-2.0
"""Body and feet estimated from IMU, joints and foot forces, on simulated walks with known truth.

Beside the estimator: the same without rejection of slipping feet, an invariant filter with and
without rejection, and legged odometry (gyro, and the mean velocity of the feet that stand). Errors
are vectors of x and y. Slips are of settled stances, 24 ms after touch-down, faster than 10 mm/s;
the alarm is that of ros_pad.estimation with a noise of 15 mm/s. A false alarm has no speed above
5 mm/s in its last 60 ms. With --all, walks that are harder: long pushes, a cheap IMU; and where
methods diverge: all feet slip, no foot stands, feet slide for long, low rates. With --picture,
sensing.json and sensing.png: time an update against errors; and of --all, sensing_stability.json
and .png.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.estimation.alarm import SlipAlarm
from ros_pad.robots import Robot
from ros_pad.robots.rotation import Array
from studies import command
from studies.samples import Flags, runs
from studies.sensing import chart, stability
from studies.sensing.methods import METHODS, Track, track_of
from studies.sensing.walks import COURSES, RAMP, REST, Log, walk

CASES = ('dry', 'patches', 'ice', 'hexapod')
FIRST_SEED = 111  # constants of the estimator were chosen on seeds below 102

ALARM_NOISE = 0.015  # m/s
SLIPS, STICKS = 0.01, 0.005  # m/s
SETTLED, RECENT, WINDOW = 0.024, 0.06, 0.02  # s


Row = dict[str, Any]
"""Figures of one method on one walk, SI units."""


def alarms_of(track: Track, rate: float) -> Flags:
    """Return whether the slip alarm is on, (samples, legs), from the slip against the force."""
    tangential = track.force[..., :2]
    strength = np.maximum(np.linalg.norm(tangential, axis=2), 1e-9)
    speeds = -(track.slip * tangential).sum(2) / strength
    found = np.zeros(speeds.shape, dtype=bool)
    for leg in range(speeds.shape[1]):
        alarm = SlipAlarm(WINDOW)
        for start, stop in runs(track.standing[:, leg]):
            alarm.reset()
            for row in range(start + round(SETTLED * rate), stop):
                sample = float(speeds[row, leg]), ALARM_NOISE, 1.0 / rate
                found[row, leg] = alarm.update(*sample)
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
    robot, rate = robot_of(course.robot), course.rate
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
            {'course': name, 'seed': seed, 'method': method, 'path': path}
            | {
                'velocity_error': float(np.sqrt((error**2).sum(1).mean())),
                'vertical_error': float(np.sqrt((every[:, 2] ** 2).mean())),
                'drift': float(np.linalg.norm(moved[:2]) / path),
                'slip_error': float(np.sqrt((slip[sticks] ** 2).sum(1).mean())),
                'ratio': float(np.sqrt((scaled**2).mean())),
                'coverage': float((np.abs(scaled) < 2.0).mean()),
                'slip_coverage': float(inside[within].mean()),
                'flagged': float(track.slipping[sticks].mean()),
                'doubt': float(track.doubt[walking].mean()),
                'seconds': track.seconds,
            }
            | judge_alarms(track, log, walking, rate)
        )
    return rows


def summary(rows: Sequence[Row]) -> str:
    """Return error of velocity x y, mm/s, and drift, %, of every method; and of the estimator.

    Missed slips are those above 5 and above 10 mm, first where some feet stick, then where all
    slip.
    """
    lines = ['| walk | ' + ' | '.join(METHODS) + ' |', '|---' * (len(METHODS) + 1) + '|']
    for name in dict.fromkeys(row['course'] for row in rows):
        cells = [name]
        for method in METHODS:
            some = [row for row in rows if (row['course'], row['method']) == (name, method)]
            error, drift = np.mean([(row['velocity_error'], row['drift']) for row in some], axis=0)
            cells.append(f'{1e3 * error:.1f}; {1e2 * drift:.2f}')
        lines.append('| ' + ' | '.join(cells) + ' |')
    for name in dict.fromkeys(row['course'] for row in rows):
        own = [row for row in rows if (row['course'], row['method']) == (name, METHODS[0])]
        missed = {k: np.sum([row['missed'][k] for row in own], axis=0) for k in own[0]['missed']}
        mean = {k: np.mean([row[k] for row in own]) for k in ('coverage', 'false_alarms')}
        lines.append(
            f'{name}: in 2 sd {mean["coverage"]:.2f}, false alarms a minute'
            f' {mean["false_alarms"]:.1f}, missed '
            + ', '.join(f'{key}: {hits} of {count}' for key, (hits, count) in missed.items())
        )
    return '\n'.join(lines)


def main(words: Sequence[str]) -> int:
    """Measure, and print the table; return the exit status."""
    part = command.parser('sensing', __doc__)
    command.add_count(part, '--seeds', 3, 'walks of each kind')
    command.add_count(part, '--duration', 20, 'length of a walk, s', least=6)
    part.add_argument('--all', action='store_true', help='all walks and failures')
    part.add_argument('--picture', action='store_true', help='write sensing.json and sensing.png')
    command.add_out(part)
    options = part.parse_args(words)
    names = tuple(COURSES) if options.all else CASES
    seeds = range(FIRST_SEED, FIRST_SEED + options.seeds)
    cases = [(name, seed) for name in names for seed in seeds]
    rows = [
        row
        for name, seed in command.each(cases, 'sensing', 'walk')
        for row in measure(name, seed, float(options.duration))
    ]
    shown = summary(rows)
    if options.picture:
        picture = chart.picture(rows, METHODS)
        command.write(options.out, 'sensing', {'rows': rows}, {'sensing': picture})
    if options.all:
        found = stability.measure(seeds)
        shown += f'\n\n{stability.summary(found)}'
        name, document = 'sensing_stability', {'curves': [vars(each) for each in found]}
        if options.picture:
            command.write(options.out, name, document, {name: chart.stability(found)})
    command.show(options, rows, shown)
    return 0
