# SPDX-License-Identifier: Apache-2.0
"""Measure slip alarms on a slippery patch under ATLAS, and what a real Go1 shows on grease.

The files are those of https://github.com/MichaelMarav/ProbabilisticContactEstimation, folder
``offline/data`` (no licence file: they are read, never stored). ATLAS in RaiSim: 13 columns at
1 kHz like those of mrsp/lcd, with a label 1 for stable contact and 0 for all else; without load
that is a foot in the air, with load one that slips. Go1: force in units of the robot at 500 Hz,
and in rows that end earlier acceleration (g, with gravity) and angular rate (°/s) of a foot at
250 Hz; the file alone says which ground it was. Features and figures are those of the study
labelled_contacts; every setting is as shipped. Writes labelled_pce.json.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import Tuning
from ros_pad.estimation.foot import ContactMotion, FootEstimator
from studies import command
from studies.closed_loop.labelled_contacts import (
    CUSUM,
    NONE,
    RATE,
    RATIO,
    SHAKE,
    SLIP,
    STABLE,
    TWIST,
    Recording,
    alarm_figures,
    cusum,
    features,
    number_table,
    operating_threshold,
    ranking,
)
from studies.samples import auc, runs, share_interval

SOURCE = 'https://github.com/MichaelMarav/ProbabilisticContactEstimation (folder offline/data)'
ATLAS = ('ATLAS_01ground_003slip', 'ATLAS_01ground', 'ATLAS_01ground_3steps')
GO1 = {
    'GO1_slippery_surface': 'greased',
    'GO1_normal_surface': 'normal',
    'GO1_matress': 'mattress',
}
ATLAS_PERIOD, FORCE_PERIOD, IMU_PERIOD = 1e-3, 2e-3, 4e-3
"""Sampling periods by the repository's README, s."""

INERTIAL = 'CUSUM of IMU speed'
SHIPPED = (CUSUM, INERTIAL)
"""Alarms of ros_pad that run without a position, at their shipped threshold."""

OWN = (RATIO, TWIST, RATE, SHAKE, *SHIPPED)
"""Scores whose threshold is set on the stable contacts of all three files."""

FORGET = 0.2
"""Time constant with which a velocity integrated from touch-down returns to zero, s; chosen before
any figure was computed: shorter than a stance, longer than the slips sought."""

STILL_RATE = 120.0
"""Angular rate below which a foot of the Go1 stands, °/s, and the shortest such time, s: swings
reach 300 to 700 °/s, stances have 30 to 60."""
SHORTEST_STANCE = 0.15
RESAMPLES = 1000
UNKNOWN_SPEED = 1.0
"""Standard deviation of the velocity of a foot that is not measured, m/s."""


# --- ATLAS ---------------------------------------------------------------------------------------


def read_atlas(path: pathlib.Path) -> Recording:
    """Return the recording of ATLAS in a file."""
    table = number_table(path, 13, SOURCE)
    force, moment, acceleration, rate = np.split(table[:, :12], 4, axis=1)
    label = np.where(table[:, 12] == 1.0, STABLE, SLIP)
    found = Recording(path.stem, force, moment, acceleration, rate, label, ATLAS_PERIOD)
    label[~found.standing] = NONE
    return found


def inertial_speed(recording: Recording) -> np.ndarray:
    """Return the horizontal speed of the foot by its IMU alone, m/s; 0 in the air.

    The acceleration is integrated from touch-down, where the velocity is taken to be zero, and the
    integral forgets with :data:`FORGET`. How far the foot tilts is neglected.
    """
    period, speed = recording.period, np.zeros(len(recording.label))
    keep = math.exp(-period / FORGET)
    for start, stop in recording.stances:
        velocity = np.zeros(2)
        for index in range(start, stop):
            velocity = keep * velocity + period * recording.acceleration[index, :2]
            speed[index] = math.hypot(*velocity)
    return speed


def scores_of(recording: Recording) -> dict[str, np.ndarray]:
    """Return each score by sample."""
    return features(recording) | {INERTIAL: cusum(recording, inertial_speed(recording))}


def on_patch(recording: Recording) -> dict[str, Any]:
    """Return how labels, T/N and load of a recording are related."""
    slip, stick, ratio = recording.slipping, recording.sticking, recording.ratio
    return {
        'seconds': len(recording.label) * recording.period,
        'stances': sum(stop - start > 10 for start, stop in recording.stances),
        'slip_s': float(slip.sum()) * recording.period,
        'stable_s': float(stick.sum()) * recording.period,
        'slips': len(recording.events),
        'slip_ratio': np.quantile(ratio[slip], [0.05, 0.5, 0.95]).tolist(),
        'stable_ratio': np.quantile(ratio[stick], [0.05, 0.5, 0.95]).tolist(),
        'quiet_s': 60.0 * recording.quiet_minutes,
    }


def atlas(recordings: Sequence[Recording]) -> dict[str, Any]:
    """Return labels, ranking and alarms of each recording."""
    scores = {each.name: scores_of(each) for each in command.each(recordings, 'scores', 'file')}
    thresholds = {
        name: operating_threshold([scores[each.name][name] for each in recordings], recordings)
        for name in OWN
    }
    document: dict[str, Any] = {}
    for each in recordings:
        score = scores[each.name]
        alarms = {f'{name}, own threshold': (name, thresholds[name]) for name in OWN}
        alarms |= {f'{name}, as shipped': (name, Tuning.alarm_threshold) for name in SHIPPED}
        figures = {}
        for word, (name, threshold) in alarms.items():
            found = alarm_figures(score[name], threshold, each, fewest=1)
            missed = round(found['missed'] * found['events'])
            figures[word] = found | {'missed_interval': share_interval(missed, found['events'])}
        document[each.name] = {
            'labels': on_patch(each),
            'ranking': {name: ranking(score[name], each) for name in OWN},
            'alarm': figures,
        }
    return document


# --- Go1 -----------------------------------------------------------------------------------------


def go1_estimates(force: np.ndarray) -> dict[str, Any]:
    """Return what FootEstimator says of a foot with nothing but a normal force.

    Its tangential force is given as zero and its velocity as unknown (0 ± :data:`UNKNOWN_SPEED`):
    the sensors of the Go1 have neither. Force is in units of the robot, of which only the share of
    the expected load matters. The offset in the air is left in.
    """
    expected = float(np.median(force[force > 0.5 * np.quantile(force, 0.75)]))
    estimator = FootEstimator(Foot.load('large37'), expected, Tuning(source='joints'))
    unknown = ContactMotion((0.0, 0.0), UNKNOWN_SPEED)
    doubts: dict[str, int] = {}
    wet, friction, alarms, standing, last = [], [], 0, 0, False
    for index, each in enumerate(force):
        found = estimator.update(
            (index + 1) * FORCE_PERIOD, (0.0, 0.0, float(each)), (0.0, 0.0, 0.0), 0.0,
            motion=unknown,
        )  # fmt: skip
        if not found.standing:
            continue
        standing += 1
        alarms += found.slipping and not last
        last = found.slipping
        kind = found.doubt.partition(':')[0] or 'none'
        doubts[kind] = doubts.get(kind, 0) + 1
        wet.append(found.wet_probability)
        friction.append(found.friction_mean)
    return {
        'standing_s': standing * FORCE_PERIOD,
        'doubt': {kind: count / standing for kind, count in doubts.items()},
        'wet_probability': [min(wet), max(wet)],
        'friction_mean': [min(friction), max(friction)],
        'alarms': alarms,
    }


def go1_stances(imu: np.ndarray) -> list[dict[str, float]]:
    """Return for each stance of a walking foot what its IMU shows: largest and mean values."""
    rate = np.linalg.norm(imu[:, 3:], axis=1)
    jolt = np.abs(np.linalg.norm(imu[:, :3], axis=1) - 1.0)
    shortest = round(SHORTEST_STANCE / IMU_PERIOD)
    first = int(np.argmax(rate > STILL_RATE))  # it begins to walk
    found = []
    for start, stop in runs(rate < STILL_RATE, join=2):
        if stop - start >= shortest and start > first and stop < len(rate):
            found.append({
                'rate, mean (°/s)': float(rate[start:stop].mean()),
                'rate, largest (°/s)': float(rate[start:stop].max()),
                'acceleration off 1 g, mean (g)': float(jolt[start:stop].mean()),
                'acceleration off 1 g, largest (g)': float(jolt[start:stop].max()),
                'duration (s)': (stop - start) * IMU_PERIOD,
            })  # fmt: skip
    return found


def stance_interval(slippery: np.ndarray, other: np.ndarray) -> list[float]:
    """Return the 95 % interval of the AUC of stances, both drawn with replacement."""
    draw = np.random.default_rng(0)
    found = [
        auc(draw.choice(slippery, len(slippery)), draw.choice(other, len(other)))
        for _ in range(RESAMPLES)
    ]
    return np.quantile(found, [0.025, 0.975]).tolist()


def go1(folder: pathlib.Path) -> dict[str, Any]:
    """Return what the Go1's logs show on each ground, and whether stances tell grounds apart."""
    document: dict[str, Any] = {'ground': {}, 'auc': {}}
    stances = {}
    for name, ground in GO1.items():
        table = number_table(folder / f'{name}.csv', 7, SOURCE)
        force = table[np.isfinite(table[:, 0]), 0]
        imu = table[np.isfinite(table[:, 1:]).all(axis=1), 1:]
        stances[ground] = go1_stances(imu)
        document['ground'][ground] = go1_estimates(force) | {
            'seconds': len(force) * FORCE_PERIOD,
            'new_force_hz': float(np.mean(np.diff(force) != 0.0)) / FORCE_PERIOD,
            'new_imu_hz': float(np.mean(np.diff(imu, axis=0).any(axis=1))) / IMU_PERIOD,
            'stances': len(stances[ground]),
            'median': {
                key: float(np.median([each[key] for each in stances[ground]]))
                for key in stances[ground][0]
            },
        }
    for key in stances['greased'][0]:
        values = {
            ground: np.array([each[key] for each in stances[ground]]) for ground in GO1.values()
        }
        document['auc'][key] = {
            other: [
                auc(values['greased'], values[other]),
                *stance_interval(values['greased'], values[other]),
            ]
            for other in ('normal', 'mattress')
        }
    return document


# --- the whole -----------------------------------------------------------------------------------


def run(folder: pathlib.Path) -> dict[str, Any]:
    """Return the document of a folder with all six files."""
    recordings = [read_atlas(folder / f'{name}.csv') for name in ATLAS]
    return {
        'source': SOURCE, 'shipped_threshold': Tuning.alarm_threshold, 'forget_s': FORGET,
        'atlas': atlas(recordings), 'go1': go1(folder),
    }  # fmt: skip


def table(document: dict[str, Any]) -> str:
    """Return ranking and alarms on ATLAS, and what the stances of the Go1 show, as text."""
    lines = [command.listed([{'file': k, **r['labels']} for k, r in document['atlas'].items()])]
    for part in ('ranking', 'alarm'):
        rows = [
            {'file': name, part: score, **found}
            for name, row in document['atlas'].items()
            for score, found in row[part].items()
        ]
        lines.append(command.listed(rows))
    for part in ('ground', 'auc'):
        lines.append(command.listed([{part: k, **r} for k, r in document['go1'][part].items()]))
    return '\n\n'.join(lines)


def main(words: Sequence[str]) -> int:
    """Measure, print and write."""
    parser = command.parser('labelled_pce', __doc__)
    parser.add_argument(
        'folder', type=command.present, metavar='FOLDER', help=f'with the six files of {SOURCE}'
    )
    command.add_out(parser)
    options = parser.parse_args(words)
    document = run(options.folder)
    command.show(options, command.write(options.out, 'labelled_pce', document), table(document))
    return 0
