# SPDX-License-Identifier: Apache-2.0
"""The result of a trial, simulated or recorded: its time series and its metrics."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ros_pad.simulation.terrain import Floor

BOUNCE = 0.03  # s; a stance does not end if a foot is without load for less than this

SLOW = np.dtype(
    [
        ('pressure', 'f8'),  # gauge, Pa
        ('setpoint', 'f8'),  # gauge, Pa
        ('wetness', 'f8'),  # probability that the ground is wet
        ('friction', 'f8'),  # estimated coefficient of friction
        ('margin', 'f8'),  # friction margin
        ('slip_speed', 'f8'),  # estimated, m/s
        ('slipping', '?'),  # slip alarm
        ('dome', '?'),  # whether the chosen morphology is dome
        ('doubt', 'i8'),  # place in estimation.DOUBTS, 0: none; -1: not on record
    ]
)
"""What is known of a foot at a control step; numbers that are unknown are NaN."""


@dataclass(frozen=True)
class Metrics:
    """Metrics of a trial. Lists of numbers have one entry for each leg.

    Attributes
    ----------
    distance_m : float
        Distance of the body along x, m.
    duration_s : float
        Simulated time, s, including the time before the first step.
    cycles : float
        Gait cycles walked, no unit.
    distance_per_cycle_m : float
        Mean distance of the body along x in a gait cycle, m.
    slip_path_m : list of float
        Length of all slip of each foot, m.
    lateral_drift_m : float
        Sideways position of the body at the end, m.
    yaw_drift_rad : float
        Heading of the body at the end, rad.
    dissipation_j : float
        Work lost in feet that slip or rotate, J.
    switches : list of int
        Number of switches of each foot.
    overload_s : list of float
        Time for which each foot was a dome above its force limit, s.
    wet_accuracy : float or None
        Share of flat stances at whose end P(wet) was on the correct side of 0.5; None without
        flat stances.
    verdict : str or None
        Why the walk ended early and is not valid; None for a valid walk.
    refusals : list of str
        Why feet that should be domes were flat at the end; empty if there are none.
    faults : list of dict
        Faults of legs that the controller found: ``leg``, ``start``, ``end`` (s; None for a fault
        that lasts to the end), ``kind`` and ``reason``, a text with numbers.
    underpressure : list of int
        Number of touch-downs of each foot as a dome with less pressure than its load needs.
    goal_m : float or None
        Distance to the goal, m; None for a scene without a goal.
    time_to_goal_s : float or None
        Time from the first step to the goal, s; None if the body did not reach it.
    """

    distance_m: float
    duration_s: float
    cycles: float
    distance_per_cycle_m: float
    slip_path_m: list[float]
    lateral_drift_m: float
    yaw_drift_rad: float
    dissipation_j: float
    switches: list[int]
    overload_s: list[float]
    wet_accuracy: float | None
    verdict: str | None
    refusals: list[str] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    underpressure: list[int] = field(default_factory=list)
    goal_m: float | None = None
    time_to_goal_s: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def standing(time: np.ndarray, load: np.ndarray, load_gate: float) -> np.ndarray:
    """Return whether feet stand at each time, s, (n, legs); see :meth:`Trial.standing`.

    A foot that bounces, without load for less than ``BOUNCE``, still stands.
    """
    loaded = load > load_gate
    since = np.maximum.accumulate(np.where(loaded, time[:, None], -np.inf), axis=0)
    until = np.minimum.accumulate(np.where(loaded, time[:, None], np.inf)[::-1], axis=0)[::-1]
    return until - since < BOUNCE


def fault_lines(faults: Iterable[dict[str, Any]]) -> list[str]:
    """Describe faults of legs, see ``Metrics.faults``: a line for each kind and leg."""
    alike: dict[tuple[int, str], list[dict[str, Any]]] = {}
    for fault in faults:
        alike.setdefault((fault['leg'], fault['kind']), []).append(fault)
    lines = []
    for (leg, kind), own in alike.items():
        start, end = own[0]['start'], own[-1]['end']
        times, what = '', own[0]['reason']
        if len(own) > 1:
            times, what = f'{len(own)} times ', kind
        until = 'the end' if end is None else f'{end:.1f} s'
        lines.append(f'Leg {leg}, {times}from {start:.1f} s to {until}: {what}')
    return lines


def heading(x: float, y: float, z: float, w: float) -> float:
    """Return the heading, rad, of a unit quaternion."""
    if x == 0.0 and y == 0.0:
        # For a rotation about the vertical alone, this is more exact than the formula below.
        return 2.0 * math.atan2(z, w)
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@dataclass
class Trial:
    """Time series and metrics of one trial.

    Fast series (``time``) have one row for each sensor sample, slow series (``slow_time``) one for
    each control step; columns are legs, in the order of ``legs``. Unknown values are NaN.

    Attributes
    ----------
    scene : str
        Name of the scene.
    policy : str
        Name of the policy.
    fidelity : str
        Fidelity level.
    seed : int
        Seed of floor and noise.
    legs : tuple of int
        Numbers of the legs.
    time : ndarray (n,)
        Time of each sensor sample, s.
    body : ndarray (n, 3)
        Position x and y, m, and heading, rad.
    force : ndarray (n, legs, 3)
        Measured force of the ground on each foot, N.
    position : ndarray (n, legs, 3)
        Measured position of each foot, m.
    slow_time : ndarray (m,)
        Time of each control step, s.
    slow : structured ndarray (m, legs)
        What is known at each control step, see :data:`SLOW`.
    odom : ndarray (n, 3)
        Estimated position x and y of the body, m, and heading, rad, in odom; shape (0, 3) with
        markers. Feet are in the world all the same.
    floor : Floor or None
        The true floor; None where it is unknown.
    metrics : Metrics or None
        None where the true floor is unknown, as for a robot's bag.
    settings : dict
        Foot, gait and other recorded settings.
    real_time_factor : float or None
        Ratio of simulated time to computing time; None where it is not on record.
    """

    scene: str
    policy: str
    fidelity: str
    seed: int
    legs: tuple[int, ...]
    time: np.ndarray
    body: np.ndarray
    force: np.ndarray
    position: np.ndarray
    slow_time: np.ndarray
    slow: np.ndarray
    odom: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    floor: Floor | None = None
    metrics: Metrics | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    real_time_factor: float | None = None

    def standing(self, load_gate: float) -> np.ndarray:
        """Return whether each foot stands at each sensor sample.

        Parameters
        ----------
        load_gate : float
            Normal force above which a foot stands, N.

        Returns
        -------
        array of bool (n, legs)
            True in stance.
        """
        return standing(self.time, self.force[:, :, 2], load_gate)

    def wet(self) -> np.ndarray:
        """Return whether the true ground below each foot is wet.

        Returns
        -------
        array of bool (m, legs)
            True on wet ground; False where the position of a foot is unknown.

        Raises
        ------
        ValueError
            When the true floor is unknown.
        """
        if self.floor is None:
            raise ValueError('floor = None: the true ground of this trial is not on record')
        if not len(self.time):
            return np.zeros((len(self.slow_time), len(self.legs)), dtype=bool)
        rows = np.clip(np.searchsorted(self.time, self.slow_time - 1e-9), 0, len(self.time) - 1)
        places = self.position[rows, :, :2]
        known = np.isfinite(places).all(axis=2)
        places = np.where(known[:, :, None], places, 0.0)
        return known & self.floor.wet_along(places[:, :, 0], places[:, :, 1])
