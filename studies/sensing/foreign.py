# SPDX-License-Identifier: Apache-2.0
"""Body and feet estimated from recordings of real robots made by others: an iCub and a Go1.

The files are not part of ros_pad; --icub and --go1 take the folders into which they were put:
walking.mat and model.urdf from folder src/resources/iCubGenova04 of
https://github.com/ami-iit/paper_ramadoss-2022-iros-humanoid-base-estimation (BSD-3-Clause; needs
h5py), and from https://github.com/mrsp/serow (GPL-3.0) evaluation/unit_tests/data/go1.csv,
urdf/go1.urdf, and test/data/go1_odom.csv of commit 9201120.

The estimator runs beside the rivals of the study sensing. Cameras saw the base, with a clock of
their own (without times on the Go1): its offset, and its rate where unknown, are those at which
the heading by the gyro is the one that the cameras saw. The truth about slip is not known: feet of
the iCub should stick. Velocities of the cameras are means over 0.2 s, and so are those compared.
Slip counts from when they see the base walk.
"""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import optimize

from ros_pad.errors import InvalidInput
from ros_pad.robots.rotation import Array, rotation
from studies import command
from studies.samples import Flags
from studies.sensing import recordings
from studies.sensing.methods import METHODS, Track, track_of
from studies.sensing.recordings import Recording
from studies.sensing.study import alarms_of, settled
from studies.sensing.walks import Course, Log

MEAN = 0.2
"""Time over which velocities of the body are averaged, s."""

WALKS = 0.05
"""Speed of the base, m/s: slip counts from when cameras first see it faster to when they last
do."""

OFFSETS = np.arange(-3.0, 3.0, 0.05)
"""Starts of the cameras' clock that are tried, s."""

RATES = np.arange(40.0, 80.0, 0.25)
"""Rates that are tried where that of the cameras is not known, Hz."""

SHARED = 0.85
"""Least share of the poses that must lie within the readings."""


Row = dict[str, Any]
"""Figures of one method on one recording, SI units; NaN where it has none."""


def log_of(recording: Recording) -> Log:
    """Return a recording as the methods take it, without truth."""
    count, legs = recording.foot_forces.shape[:2]
    unknown = np.full((count, 3), np.nan)
    return Log(
        time=np.arange(count) / recording.rate,
        gyro=recording.gyro,
        accelerometer=recording.accelerometer,
        joint_positions=recording.joint_positions,
        joint_velocities=recording.joint_velocities,
        foot_forces=recording.foot_forces,
        efforts=np.full_like(recording.joint_positions, np.nan),
        position=unknown,
        orientation=np.full((count, 4), np.nan),
        velocity=unknown,
        feet=np.full((count, legs, 3), np.nan),
        slip=np.full((count, legs, 2), np.nan),
        load=np.full((count, legs), np.nan),
    )


def heading_of(recording: Recording) -> Array:
    """Return the heading of the base by the gyro alone, less its mean at rest, (n,), rad."""
    turn = level(recording)
    found = np.zeros(len(recording.gyro))
    rates = recording.gyro @ recording.robot.imu[:3, :3].T
    for row, rate in enumerate(rates):
        turn = turn @ rotation(rate / recording.rate)
        found[row] = np.arctan2(turn[1, 0], turn[0, 0])
    return np.asarray(np.unwrap(found))


def level(recording: Recording) -> Array:
    """Return a rotation of the base that has the tilt of the first 0.2 s, (3, 3)."""
    up = recording.accelerometer[: max(1, round(0.2 * recording.rate))].mean(0)
    up = recording.robot.imu[:3, :3] @ up / np.linalg.norm(up)
    axis = np.cross(up, (0.0, 0.0, 1.0))
    sine = float(np.linalg.norm(axis))
    return rotation(axis * (np.arctan2(sine, up[2]) / max(sine, 1e-12)))


def clock(recording: Recording) -> tuple[float, float]:
    """Return start, s, and rate, Hz, of the cameras' clock, by the heading.

    Raises
    ------
    InvalidInput
        When no clock puts :data:`SHARED` of the poses into the readings.
    """
    time = np.arange(len(recording.gyro)) / recording.rate
    heading = heading_of(recording)
    seen = np.unwrap(np.arctan2(recording.seen_turn[:, 1, 0], recording.seen_turn[:, 0, 0]))
    index = np.arange(len(seen))

    def spread(start: float, rate: float) -> float:
        at = start + index / rate
        inside = (at >= 0.0) & (at <= time[-1])
        if inside.mean() < SHARED:
            return np.inf
        return float(np.std(np.interp(at[inside], time, heading) - seen[inside]))

    known = recording.seen_rate
    rates = [known] if known else RATES.tolist()
    best = min((spread(start, rate), start, rate) for start in OFFSETS for rate in rates)
    if not np.isfinite(best[0]):
        raise InvalidInput(f'{recording.name}: the poses of the cameras do not fit the readings')
    if known:
        near = optimize.minimize_scalar(
            lambda start: spread(start, known), bounds=(best[1] - 0.05, best[1] + 0.05),
            method='bounded',
        )  # fmt: skip
        return float(near.x), known
    fit = optimize.minimize(lambda x: spread(x[0], x[1]), best[1:], method='Nelder-Mead')
    return float(fit.x[0]), float(fit.x[1])


def turned(estimated: Array, seen: Array) -> Array:
    """Return positions turned about the vertical and moved to lie best on seen ones, (n, 3)."""
    middle = estimated.mean(0)
    a, b = estimated - middle, seen - seen.mean(0)
    dots = float((a[:, :2] * b[:, :2]).sum())
    crosses = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    turn = rotation(np.array((0.0, 0.0, np.arctan2(crosses, dots))))
    return np.asarray(a @ turn.T + seen.mean(0))


def measure(recording: Recording) -> list[Row]:
    """Return the figures of every method on one recording."""
    start, rate = clock(recording)
    at = start + np.arange(len(recording.seen_position)) / rate
    time = np.arange(len(recording.gyro)) / recording.rate
    inside = (at >= 0.0) & (at <= time[-1])
    at, seen = at[inside], recording.seen_position[inside]
    apart = max(1, round(MEAN * rate))
    velocity = (seen[apart:] - seen[:-apart]) * rate / apart
    path = float(np.linalg.norm(velocity[:, :2], axis=1).sum() / rate)
    course, log = Course(rate=recording.rate, noise=recording.noise), log_of(recording)
    fast = at[apart // 2 :][: len(velocity)][np.linalg.norm(velocity[:, :2], axis=1) > WALKS]
    if not fast.size:
        raise InvalidInput(f'{recording.name}: cameras saw no speed above {WALKS} m/s')
    walks = (time >= fast[0]) & (time <= fast[-1])
    rows = []
    for method in METHODS:
        track = track_of(recording.robot, log, course, method)
        places = turned(_at(at, time, track.position), seen)
        mean = (places[apart:] - places[:-apart]) * rate / apart
        error = (mean - velocity)[:, :2]
        deviation = _at(at, time, track.deviation)[apart // 2 :][: len(error)]
        rows.append(
            {
                'recording': recording.name,
                'method': method,
                'readings': len(time),
                'duration': float(time[-1]),
                'path': path,
                'clock': (start, rate),
                'position_error': rms((places - seen)[:, :2]),
                'velocity_error': rms(error),
                'coverage': _share(np.abs(error) / deviation),
                **slips(track, recording.rate, walks),
            }
        )
    return rows


def alarms(track: Track, rate: float) -> Flags:
    """Return where the alarm is on for slip in any of four directions.

    It needs the direction of the force along the ground, and the feet measure none.
    """
    found = np.zeros_like(track.standing)
    for direction in ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)):
        pulls = np.broadcast_to(direction, track.force.shape)
        found |= alarms_of(track._replace(force=pulls), rate)
    return found


def slips(track: Track, rate: float, walks: Flags) -> dict[str, Any]:
    """Return what a method has about the slip of feet that stand, and the doubts."""
    within = settled(track.standing, rate)
    within &= walks[:, None]
    speeds = np.linalg.norm(track.slip, axis=2)[within]
    scaled = np.abs(track.slip[within]) / track.slip_deviation[within][:, None]
    on = alarms(track, rate) & walks[:, None]
    return {
        'slip_median': float(np.median(speeds)),
        'slip_most': float(np.quantile(speeds, 0.95)),
        'slip_coverage': _share(scaled),
        'flagged': float(track.slipping[within].mean()),
        'alarms': int((on[1:] & ~on[:-1]).sum()),
        'minutes': float(within.sum() / rate / 60.0),
        'doubt': float(track.doubt.mean()),
    }


def rms(vectors: Array) -> float:
    """Return the root of the mean of the squared lengths."""
    return float(np.sqrt((vectors * vectors).sum(1).mean()))


def _share(scaled: Array) -> float:
    """Return the share within 2, NaN for NaN."""
    return float((scaled < 2.0).mean()) if np.isfinite(scaled).all() else float('nan')


def _at(at: Array, time: Array, columns: Array) -> Array:
    return np.stack([np.interp(at, time, column) for column in columns.T], axis=1)


def main(words: Sequence[str]) -> int:
    """Measure, and print the table; return the exit status."""
    part = command.parser('foreign', __doc__)
    for name in recordings.SOURCES:
        part.add_argument(
            f'--{name}', type=pathlib.Path, metavar='DIR', help='folder of the files of this robot'
        )
    options = part.parse_args(words)
    folders = [
        (getattr(recordings, name), folder)
        for name in recordings.SOURCES
        if (folder := getattr(options, name)) is not None
    ]
    if not folders:
        sources = '; '.join(f'--{name}: {text}' for name, text in recordings.SOURCES.items())
        raise InvalidInput(f'a folder is needed: {sources}')
    found = [read(folder) for read, folder in folders]
    rows = [row for each in command.each(found, 'foreign', 'robot') for row in measure(each)]
    command.show(options, rows, command.listed(rows))
    return 0
