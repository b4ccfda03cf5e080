# SPDX-License-Identifier: Apache-2.0
"""Compare the slip alarm with an IMU on the shank: which detects slip sooner.

Walks ``hexapod_patches`` on full dynamics (L2, needs mujoco) with the adaptive policy, prints a
table, and writes it to labelled_contacts_hexapod.json. The IMU is ideal: its readings are the true
angular rates of the shank, rad/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from ros_pad.estimation import Tuning
from ros_pad.estimation.stage import EstimationStage
from ros_pad.simulation import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.node_settings import tuning_for
from studies import command
from studies.closed_loop import loops
from studies.samples import auc
from studies.work_precision.estimator.tally import Tally, count_alarms
from studies.work_precision.estimator.walks import SETTLED

SCENE = 'hexapod_patches'
GATE = Tuning().load_gate
FALSE_PER_MINUTE = 1.0
THEIRS = 0.08
"""Angular rate that separates slip from stick in the recordings of the robot ATLAS, rad/s; see
docs/labelled_contacts.md."""

MOVES, RESTS = 0.01, 0.002
"""Slip speeds above which a sample counts as slip, and below which it counts as stick, m/s."""


@dataclass(frozen=True)
class Walk:
    """The feet of a simulated walk; arrays have the shape (samples, legs).

    Attributes
    ----------
    period : float
        Sampling period, s.
    expected_load : float
        Expected load of a foot, N.
    stamps : ndarray, shape (samples,)
        Time of each sample, s.
    load, speed, rate : ndarray
        True normal force, N, slip speed, m/s, and angular rate of the shank, rad/s.
    alarm : ndarray of bool
        Slip alarm, from noisy readings.
    sticks_only : bool
        As for the recordings of ``work_precision.estimator``; always False here.
    """

    period: float
    expected_load: float
    stamps: np.ndarray
    load: np.ndarray
    speed: np.ndarray
    rate: np.ndarray
    alarm: np.ndarray
    sticks_only: bool = False

    @property
    def begun(self) -> np.ndarray:
        """Whether each foot is in stance, and the robot has started to walk."""
        return (self.stamps > SETTLED)[:, None] & (self.load > GATE * self.expected_load)


def walked(cycles: int, seed: int) -> Walk:
    """Walk the shipped hexapod_patches on full dynamics for a number of gait cycles."""
    scene = replace(Scene.load(SCENE), cycles=cycles)
    loop = ClosedLoop(scene, 'adaptive', seed, 'L2')
    robot: Any = loop.robot
    log = TrialLog(scene, 'adaptive', seed, 'L2')
    feet = [robot.model.geom(f'foot_{leg}').id for leg in scene.legs]
    rows: list[list[tuple[float, float, float]]] = []
    velocity, kind = np.zeros(6), mujoco.mjtObj.mjOBJ_GEOM
    for _ in loops.samples(loop, scene, log):
        row = []
        for foot, geom in zip(robot.feet, feet, strict=True):
            mujoco.mj_objectVelocity(robot.model, robot.data, kind, geom, velocity, 0)
            row.append((foot.force[2], foot.slip_speed, float(np.linalg.norm(velocity[:3]))))
        rows.append(row)
    load, speed, rate = np.moveaxis(np.array(rows), 2, 0)
    expected = scene.expected_load
    stage = EstimationStage(scene.foot, expected, tuning_for(scene), scene.legs, loop.period_ns)
    estimate = loops.estimated(stage, log.records)
    alarm = estimate.rows['slipping'] == 1.0
    stamps = 1e-9 * estimate.stamps
    return Walk(loop.period_ns * 1e-9, expected, stamps, load, speed, rate, alarm)


def own_robot(walks: Sequence[Walk], cycle: float) -> dict[str, Any]:
    """Return how well the angular rate of shanks separates slip from stick on the hexapod.

    Samples count as slip above :data:`MOVES` and as stick below :data:`RESTS`; slips of more than
    3 mm and false alarms are counted as in ``pad chart estimator``.
    """
    pooled: dict[int, list[np.ndarray]] = {}
    for walk in walks:
        for leg in range(walk.load.shape[1]):
            rows = walk.begun[:, leg]
            tenth = (walk.stamps[rows] / cycle * 10.0).astype(int) % 10
            columns = np.column_stack([walk.speed[rows, leg], walk.rate[rows, leg]])
            for phase in range(10):
                # Legs 2, 4, 6 step half a cycle later than 1, 3, 5.
                key = (phase + 5 * (leg % 2)) % 10
                pooled.setdefault(key, []).append(columns[tenth == phase])
    phases = [np.concatenate(pooled[key]) for key in sorted(pooled)]
    parted = [(rows[rows[:, 0] > MOVES, 1], rows[rows[:, 0] < RESTS, 1]) for rows in phases]
    slip, stick = (np.concatenate(part) for part in zip(*parted, strict=True))
    weights = [len(one) * len(other) for one, other in parted]
    same_phase = [auc(one, other) for one, other in parted]
    alarms = {
        'alarm as shipped': [walk.alarm for walk in walks],
        f'rate above {THEIRS:g} rad/s': [walk.rate > THEIRS for walk in walks],
    }
    found = {name: _tally(walks, on) for name, on in alarms.items()}
    for threshold in np.geomspace(0.1, 20.0, 60):
        row = _tally(walks, [walk.rate > threshold for walk in walks])
        if row['false_per_minute'] <= FALSE_PER_MINUTE:
            name = f'rate above {threshold:.2g} rad/s'
            both = [walk.alarm | (walk.rate > threshold) for walk in walks]
            found |= {name: row, f'shipped, or {name}': _tally(walks, both)}
            break
    return {
        'auc': auc(slip, stick),
        'auc_at_same_phase': float(np.nansum(np.multiply(weights, same_phase)) / sum(weights)),
        'stick_rate_median_rad_s': float(np.median(stick)),
        'stick_above_theirs': float(np.mean(stick > THEIRS)),
        'alarms': found,
    }


def _tally(walks: Sequence[Walk], alarms: Sequence[np.ndarray]) -> dict[str, Any]:
    tally = Tally()
    on_slip, on_stick = [], []
    for walk, on in zip(walks, alarms, strict=True):
        count_alarms(tally, walk, on)  # type: ignore[arg-type]
        begun = walk.begun
        on_slip.append(on[begun & (walk.speed > MOVES)])
        on_stick.append(on[begun & (walk.speed < RESTS)])
    delay = float(np.median(tally.delays)) if tally.delays else math.inf
    return {
        'on_in_slip': float(np.mean(np.concatenate(on_slip))),
        'on_in_stick': float(np.mean(np.concatenate(on_stick))),
        'slips': tally.slips,
        'missed': tally.missed / tally.slips,
        'delay_s': delay if math.isfinite(delay) else None,
        'false_per_minute': 60.0 * tally.false_alarms / tally.stick_time,
    }


def table(document: dict[str, Any]) -> str:
    """Return the numbers as text."""
    lines = [f'{key:28}{value:.3g}' for key, value in document.items() if key != 'alarms']
    for name, row in document['alarms'].items():
        delay = '-' if row['delay_s'] is None else f'{1e3 * row["delay_s"]:.0f}'
        lines.append(
            f'{name:38}{100.0 * row["missed"]:.1f} % of {row["slips"]} missed, {delay} ms,'
            f' {row["false_per_minute"]:.1f} false a minute, on in'
            f' {100.0 * row["on_in_slip"]:.0f} % of slip,'
            f' {100.0 * row["on_in_stick"]:.0f} % of stick'
        )
    return '\n'.join(lines)


def main(words: Sequence[str]) -> int:
    """Walk, print and save."""
    parser = command.parser('turning_feet', __doc__)
    command.add_count(parser, '--walks', 8, 'number of walks, with seeds from 0')
    command.add_count(parser, '--cycles', 20, 'gait cycles of a walk')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    cases = [(options.cycles, seed) for seed in range(options.walks)]
    walks = command.in_processes(walked, cases, options.processes, 'turning_feet')
    document = own_robot(walks, Scene.load(SCENE).gait.cycle)
    kept = command.write(options.out, 'labelled_contacts_hexapod', document)
    command.show(options, kept, table(document))
    return 0
