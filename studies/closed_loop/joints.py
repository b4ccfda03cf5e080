# SPDX-License-Identifier: Apache-2.0
"""Walk without markers, beside the same walks with them: distance, slip, wetness, deviations.

Walks ``hexapod_patches`` and ``quadruped_patches`` on full dynamics (L2, needs mujoco) with each
policy and each sensing, prints a table, and writes it to joints.json. Seeds are not those with
which anything was tuned.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.control import POLICIES
from ros_pad.estimation.stage import EstimationStage
from ros_pad.estimation.track import LOAD_GATE
from ros_pad.estimation.tuning import SOURCES
from ros_pad.sensing import BodyEstimate
from ros_pad.simulation import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.node_settings import tuning_for
from ros_pad.trials.series import held
from ros_pad.trials.trial import heading
from studies import command, slips
from studies.closed_loop import loops
from studies.samples import runs

SCENES = ('hexapod_patches', 'quadruped_patches')
FIRST_SEED = 431  # earlier ones were used while the code was written and mended
GATE = 0.3
"""Share of the expected load above which a foot stands."""

BEGINS = 2.0  # s: from then on the robot walks
MOVING = 5e-3  # m/s: a faster contact slips
STICKS = 0.9
"""Share of a stance in which at least one foot must stick for its verdict to count."""


@dataclass(frozen=True)
class Walk:
    """What happened in a walk, and what was estimated; arrays have the shape (samples, legs).

    Attributes
    ----------
    period, expected_load : float
        Sampling period, s; load of a foot in stance, N.
    stamps : ndarray, shape (samples,)
        Time of each sample, s.
    load, speed : ndarray
        True normal force, N, and slip speed, m/s.
    place : ndarray, shape (samples, legs, 2)
        True places of the contacts, m.
    alarm, wet, flat : ndarray of bool
        Slip alarm, true ground, and whether the pad is flat.
    probability : ndarray
        Estimated P(wet).
    body : ndarray, shape (n, 2)
        Errors of the velocity of the body, x and y, m/s, and their stated deviations: one row for
        each component.
    doubt : float
        Share of samples in which the body was in doubt.
    distance : float
        True distance, m.
    verdict : str or None
        Why the walk ended early.
    """

    period: float
    expected_load: float
    stamps: np.ndarray
    load: np.ndarray
    speed: np.ndarray
    place: np.ndarray
    alarm: np.ndarray
    wet: np.ndarray
    flat: np.ndarray
    probability: np.ndarray
    body: np.ndarray
    doubt: float
    distance: float
    verdict: str | None


class _Truth:
    """Compare each estimate of the body with its true motion."""

    def __init__(self, robot: Any) -> None:
        self._robot = robot
        self.body: list[tuple[float, float]] = []
        self.doubts: list[bool] = []

    def compare(self, estimate: BodyEstimate | None) -> None:
        """Add the errors of a sample; call it for each."""
        robot = self._robot
        if estimate is None or robot.time < BEGINS:
            return
        self.doubts.append(bool(estimate.doubt))
        if estimate.doubt:
            return
        # Heading cannot be observed: its drift is not an error of velocity.
        turn = heading(*estimate.orientation.tolist()) - robot.body[2]
        to_odom = np.array(((math.cos(turn), -math.sin(turn)), (math.sin(turn), math.cos(turn))))
        miss = estimate.velocity[:2] - to_odom @ robot.data.qvel[:2]
        deviations = np.sqrt(np.diag(estimate.covariance)[6:8])
        self.body += zip(miss.tolist(), deviations.tolist(), strict=True)


def walked(name: str, cycles: int, seed: int, policy: str, sensing: str) -> Walk:
    """Walk a shipped scene on full dynamics for a number of gait cycles."""
    scene = replace(Scene.load(name), cycles=cycles)
    loop = ClosedLoop(scene, policy, seed, 'L2', sensing=sensing)
    robot, log = loop.robot, loop.log
    truth = _Truth(robot)
    rows = []
    for _ in loop.walk():
        rows.append(
            [(*foot.force, foot.slip_speed, foot.wet, *foot.position[:2]) for foot in robot.feet]
        )
        if loop.body:
            truth.compare(loop.body.estimate)
    table = np.array(rows, dtype=float)
    load, speed, wet = np.moveaxis(table[..., 2:5], 2, 0)
    place = table[..., 5:] + table[..., :2] / scene.foot.shear_stiffness
    stamps = loop.period_ns * np.arange(1, len(rows) + 1)
    estimate = loops.estimated(
        EstimationStage(
            scene.foot, scene.expected_load, tuning_for(scene, sensing), scene.legs, loop.period_ns
        ),
        log.records,
    )
    return Walk(
        loop.period_ns * 1e-9,
        scene.expected_load,
        1e-9 * stamps,
        load,
        speed,
        place,
        held(estimate.stamps, estimate.rows['slipping'], stamps) == 1.0,
        wet > 0.5,
        loops.pressures(log.records, stamps) < DOME_PRESSURE,
        held(estimate.stamps, estimate.rows['wetness'], stamps),
        np.array(truth.body).reshape(-1, 2),
        float(np.mean(truth.doubts)) if truth.doubts else 0.0,
        robot.body[0],
        robot.verdict,
    )


def verdicts(walk: Walk) -> tuple[int, int]:
    """Return the number of right verdicts, wet or dry, at ends of flat stances, and of all.

    Stances count in which at least one foot sticks for nearly all of the time.
    """
    loaded = walk.load > GATE * walk.expected_load
    anchored: np.ndarray = np.any(loaded & (walk.speed < MOVING), axis=1)
    right = total = 0
    for leg in range(loaded.shape[1]):
        for start, stop in runs(loaded[:, leg]):
            end = stop - 1
            if not start or stop == len(loaded) or walk.stamps[end] <= BEGINS:
                continue
            short = (end - start) * walk.period < 0.1  # a bounce
            if not walk.flat[end, leg] or short or anchored[start:stop].mean() < STICKS:
                continue
            total += 1
            right += bool((walk.probability[end, leg] > 0.5) == walk.wet[end, leg])
    return right, total


def summary(walks: Sequence[Walk]) -> dict[str, Any]:
    """Return the figures of the walks of one policy and one sensing."""
    right = total = 0
    for walk in walks:
        found = verdicts(walk)
        right, total = right + found[0], total + found[1]
    alarms = [
        slips.judged(
            walk.alarm, walk.load > LOAD_GATE * walk.expected_load, walk.place, walk.period, BEGINS
        )
        for walk in walks
    ]
    figures: dict[str, Any] = {
        'distance_m': [walk.distance for walk in walks],
        'ended_early': [walk.verdict for walk in walks if walk.verdict],
        'stances': total,
        'verdict_right': right / total if total else None,
        **slips.row_of(alarms),
        'doubt': float(np.mean([walk.doubt for walk in walks])),
    }
    rows = np.concatenate([walk.body for walk in walks])
    if len(rows):
        figures['body_rmse_m_s'] = float(np.sqrt(np.mean(rows[:, 0] ** 2)))
        figures['body_coverage'] = float(np.mean(np.abs(rows[:, 0]) < 2.0 * rows[:, 1]))
    return figures


def table(document: dict[str, Any]) -> str:
    """Return the figures as text."""
    return command.listed([
        {'scene': scene, 'policy': policy, 'sensing': sensing, **row}
        for scene, policies in document['scenes'].items()
        for policy, of_policy in policies.items()
        for sensing, row in of_policy.items()
    ])  # fmt: skip


def main(words: Sequence[str]) -> int:
    """Walk, print and save."""
    parser = command.parser('joints', __doc__)
    parser.add_argument(
        '--scenes', nargs='+', choices=SCENES, default=[*SCENES], metavar='SCENE', help='scenes'
    )
    parser.add_argument(
        '--policies', nargs='+', choices=POLICIES, default=[*POLICIES], metavar='POLICY',
        help='policies',
    )  # fmt: skip
    command.add_count(parser, '--walks', 3, f'number of walks, with seeds from {FIRST_SEED}')
    command.add_count(parser, '--cycles', 60, 'gait cycles of a walk')
    command.add_processes(parser)
    command.add_out(parser)
    options = parser.parse_args(words)
    seeds = range(FIRST_SEED, FIRST_SEED + options.walks)
    kinds = list(product(options.scenes, options.policies, SOURCES))
    cases = [
        (scene, options.cycles, seed, policy, sensing)
        for scene, policy, sensing in kinds
        for seed in seeds
    ]
    walks = command.in_processes(walked, cases, options.processes, 'joints')
    scenes: dict[str, dict[str, dict[str, Any]]] = {}
    for place, (scene, policy, sensing) in enumerate(kinds):
        mine = walks[place * len(seeds) : (place + 1) * len(seeds)]
        scenes.setdefault(scene, {}).setdefault(policy, {})[sensing] = summary(mine)
    document = {'cycles': options.cycles, 'seeds': [*seeds], 'scenes': scenes}
    kept = command.write(options.out, 'joints', document)
    command.show(options, kept, table(document))
    return 0
