# SPDX-License-Identifier: Apache-2.0
"""Metrics of a trial."""

from __future__ import annotations

import numpy as np

from ros_pad.contact.pad import DOME_PRESSURE
from ros_pad.control import MorphologyController
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.scene import RailBody, Scene
from ros_pad.trials.trial import Metrics, Trial

LOAD_GATE = 0.3  # share of the expected load above which a foot stands


def summarise(
    scene: Scene, trial: Trial, robot: SimulatedRobot, controller: MorphologyController
) -> Metrics:
    """Return the metrics of a trial from its series and from the robot that walked it."""
    x, y, heading = robot.body
    cycles = max(0.0, robot.time - scene.settle) / scene.gait.cycle
    goal = scene.body.goal if isinstance(scene.body, RailBody) else None
    return Metrics(
        distance_m=x,
        duration_s=robot.time,
        cycles=cycles,
        distance_per_cycle_m=x / cycles if cycles else 0.0,
        slip_path_m=[foot.slip_path for foot in robot.feet],
        lateral_drift_m=y,
        yaw_drift_rad=heading,
        dissipation_j=robot.dissipation,
        switches=[controller.switches[leg] for leg in trial.legs],
        overload_s=[foot.overload_time for foot in robot.feet],
        wet_accuracy=wet_accuracy(trial, LOAD_GATE * scene.expected_load),
        verdict=robot.verdict,
        refusals=[f'leg {leg}: {why}' for leg, why in sorted(controller.refusals.items())],
        faults=[fault.as_dict() for fault in controller.faults],
        underpressure=[controller.underpressure[leg] for leg in trial.legs],
        goal_m=goal,
        time_to_goal_s=None if goal is None else time_to(trial, goal, scene.settle),
    )


def time_to(trial: Trial, distance: float, start: float) -> float | None:
    """Return the time, s, from ``start``, s, until x of the body reaches ``distance``, m.

    The position is interpolated linearly between samples. None if the body does not get there.
    """
    ahead = trial.body[:, 0]
    there = np.flatnonzero(ahead >= distance)
    if not len(there):
        return None
    row = int(there[0])
    if row == 0:
        return 0.0
    since = np.interp(distance, ahead[row - 1 : row + 1], trial.time[row - 1 : row + 1])
    return float(since) - start


def stance_ends(trial: Trial, load_gate: float) -> list[np.ndarray]:
    """Return for each leg the first row of the slow series after the end of each stance.

    A foot stands with more than ``load_gate`` newtons.
    """
    standing = trial.standing(load_gate)
    ends = []
    for column in range(len(trial.legs)):
        rows = np.flatnonzero(standing[:-1, column] & ~standing[1:, column])
        slow = np.searchsorted(trial.slow_time, trial.time[rows] + 1e-9)
        ends.append(slow[slow < len(trial.slow_time)])
    return ends


def wet_accuracy(trial: Trial, load_gate: float) -> float | None:
    """Return the share of flat stances at whose end P(wet) is on the correct side of 0.5.

    Domed stances do not count: the ground is unobservable there. None without flat stances, or
    where the true floor is unknown.
    """
    if trial.floor is None:
        return None
    wet = trial.wet()
    right = total = 0
    for column, rows in enumerate(stance_ends(trial, load_gate)):
        flat = rows[trial.slow['pressure'][np.maximum(rows - 1, 0), column] < DOME_PRESSURE]
        total += len(flat)
        before = np.maximum(flat - 1, 0)
        right += int(np.sum((trial.slow['wetness'][flat, column] > 0.5) == wet[before, column]))
    return right / total if total else None
