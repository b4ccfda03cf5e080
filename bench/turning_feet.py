# SPDX-License-Identifier: Apache-2.0
"""Would an IMU on the foot hear slip sooner? The angular rate of our own robot's shanks.

Run ``python bench/turning_feet.py [--walks 8] [--cycles 20] [--json]``; needs mujoco. It walks
hexapod_patches on full dynamics with the adaptive policy, prints a table, and writes it to
docs/charts/labelled_contacts_hexapod.json. Rates are true ones, in rad/s: no IMU does better.
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from scipy import stats
from tqdm import tqdm

from ros_pad.estimation import Tuning
from ros_pad.ladders.estimator import SETTLED
from ros_pad.ladders.estimator import Tally
from ros_pad.ladders.estimator import hear
from ros_pad.simulation import Scene
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.report import save

CHART = pathlib.Path(__file__).resolve().parent.parent / 'docs' / 'charts'
CHART /= 'labelled_contacts_hexapod.json'
SCENE = 'hexapod_patches'
GATE = Tuning().load_gate
FALSE_PER_MINUTE = 1.0
THEIRS = 0.08
"""Angular rate that parts slip from stick on ATLAS, rad/s, see docs/labelled_contacts.md."""

MOVES, RESTS = 0.01, 0.002
"""Speeds of the contact above which a sample is slip and below which it is stick, m/s."""


@dataclass(frozen=True)
class Walk:
    """The feet of a simulated walk; arrays have the shape (samples, legs).

    Attributes
    ----------
    period : float
        Between samples, s.
    expected_load : float
        N.
    stamps : ndarray, shape (samples,)
        s.
    load, speed, rate : ndarray
        Normal force, N, speed of the contact, m/s, and angular rate of the shank, rad/s, all true.
    alarm : ndarray of bool
        Of FootEstimator, from noisy readings.
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
        """Samples in stance, once the robot walks."""
        return (self.stamps > SETTLED)[:, None] & (self.load > GATE * self.expected_load)


def walked(cycles: int, seed: int) -> Walk:
    """Walk hexapod_patches on full dynamics, as shipped."""
    scene = replace(Scene.load(SCENE), cycles=cycles)
    loop = ClosedLoop(scene, 'adaptive', seed, 'L2')
    log = TrialLog(scene, 'adaptive', seed, 'L2')
    robot: Any = loop.robot
    feet = [robot.model.geom(f'foot_{leg}').id for leg in scene.legs]
    rows, twist = [], np.zeros(6)
    while len(rows) < round(scene.duration * 1e9) // loop.period_ns and not robot.verdict:
        loop.tick(log)
        row = []
        for foot, geom, estimator in zip(robot.feet, feet, loop.estimators, strict=True):
            kind = mujoco.mjtObj.mjOBJ_GEOM
            mujoco.mj_objectVelocity(robot.model, robot.data, kind, geom, twist, 0)
            rate = float(np.linalg.norm(twist[:3]))
            row.append((foot.force[2], foot.slip_speed, rate, estimator.estimate.slipping))
        rows.append(row)
    loop.close()
    load, speed, rate, alarm = np.moveaxis(np.array(rows, dtype=float), 2, 0)
    period = loop.period_ns * 1e-9
    stamps = period * np.arange(1, len(rows) + 1)
    return Walk(period, scene.expected_load, stamps, load, speed, rate, alarm > 0.5)


def own_robot(walks: Sequence[Walk], cycle: float) -> dict[str, Any]:
    """Return what the rate at which feet turn says of slip on our own robot.

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
        hear(tally, walk, on)  # type: ignore[arg-type]
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


def auc(slip: np.ndarray, stick: np.ndarray) -> float:
    """Return the probability that a slip has the larger rate, ties half; NaN without either."""
    if not (len(slip) and len(stick)):
        return math.nan
    return float(stats.mannwhitneyu(slip, stick).statistic) / (len(slip) * len(stick))


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


def main() -> int:
    """Walk, print and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--walks', type=int, default=8, help='one a seed (%(default)s)')
    parser.add_argument('--cycles', type=int, default=20, help='of each walk (%(default)s)')
    parser.add_argument('--json', action='store_true', help='print the numbers as JSON instead')
    options = parser.parse_args()
    seeds = tqdm(range(options.walks), 'walks', file=sys.stderr)
    walks = [walked(options.cycles, seed) for seed in seeds]
    document = own_robot(walks, Scene.load(SCENE).gait.cycle)
    text = json.dumps(document, indent=1)
    save(CHART, (text + '\n').encode())
    print(text if options.json else table(document))
    return 0


if __name__ == '__main__':
    sys.exit(main())
