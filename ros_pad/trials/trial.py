# SPDX-License-Identifier: Apache-2.0
"""What a trial leaves: its time series and its metrics, whoever ran it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from typing import Any

import numpy as np

from ros_pad.simulation.terrain import Floor

BOUNCE = 0.03  # s without load that end no stance

DOME_PRESSURE = 1000.0  # Pa gauge above which a pad is no longer flat

OFTEN = 3  # faults of one kind on one leg that are each told of


@dataclass(frozen=True)
class Metrics:
    """Figures of a trial. Lists of numbers have one entry for each leg.

    Attributes
    ----------
    distance_m : float
        Advance of the body along x.
    duration_s : float
        Simulated time.
    cycles : float
        Gait cycles walked.
    distance_per_cycle_m : float
    slip_path_m : list of float
        Way that each foot slid under load.
    lateral_drift_m, yaw_drift_rad : float
        Of the body at the end.
    dissipation_j : float
        Work lost in feet that slip or turn.
    switches : list of int
        Changes of shape.
    overload_s : list of float
        Time that inflated domes were past their force limit.
    wet_accuracy : float
        Share of flat stances of loaded feet at whose end P(wet) was on the right side of one half.
    verdict : str or None
        Why the walk is not valid.
    refusals : list of str
        Why feet that should have been domes stayed flat at the end; empty when all went well.
    faults : list of dict
        What the controller found wrong with legs: ``leg``, ``start`` and ``end``, s (None while it
        lasts), and ``reason``.
    underpressure : list of int
        How often each foot came down as a dome with less pressure than its load needs.
    goal_m : float or None
        Way to the goal, on a rail that has one.
    time_to_goal_s : float or None
        From the first step until the body is there; None if it did not get there.
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


def told(faults: Iterable[dict[str, Any]]) -> list[str]:
    """Return in words what a controller found wrong with legs, see ``Metrics.faults``.

    What came and went more than :data:`OFTEN` times on a leg is told once.
    """
    alike: dict[tuple[int, str], list[dict[str, Any]]] = {}
    for fault in faults:
        alike.setdefault((fault['leg'], fault['reason'].partition(':')[0]), []).append(fault)
    lines = []
    for (leg, kind), found in alike.items():
        if len(found) > OFTEN:
            lines.append(
                f'Leg {leg}, {len(found)} times from {found[0]["start"]:.1f} s to'
                f' {_end(found[-1])}: {kind}'
            )
        else:
            lines += [
                f'Leg {leg}, from {each["start"]:.1f} s to {_end(each)}: {each["reason"]}'
                for each in found
            ]
    return lines


def _end(fault: dict[str, Any]) -> str:
    return 'the end' if fault['end'] is None else f'{fault["end"]:.1f} s'


@dataclass
class Trial:
    """Time series and metrics of one trial.

    Fast series (``time``) have one row for each sensor sample, slow series (``slow_time``) one for
    each control step; columns are legs, in the order of ``legs``. NaN where nothing is known.

    Attributes
    ----------
    scene, policy, fidelity : str
    seed : int
    legs : tuple of int
    time : ndarray (n,)
        s.
    body : ndarray (n, 3)
        x, y, m, and heading, rad.
    force, position : ndarray (n, legs, 3)
        As measured, N and m.
    slow_time : ndarray (m,)
        s.
    pressure, setpoint : ndarray (m, legs)
        Gauge, Pa.
    wet_probability, friction, margin, slip_speed : ndarray (m, legs)
        As estimated.
    slipping, dome : ndarray of bool (m, legs)
        Alarm, and shape chosen.
    doubt : ndarray of int (m, legs)
        Why a foot could not know the ground, as a place in :data:`ros_pad.estimation.DOUBTS`; 0
        where it knew, -1 where nothing is known. No rows where nobody said.
    floor : Floor or None
        The true floor, where there is one.
    metrics : Metrics or None
        None where the truth is not known, as for a robot's bag.
    settings : dict
        Foot, gait and whatever else was recorded of the set-up.
    real_time_factor : float or None
        Simulated over wall time.
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
    pressure: np.ndarray
    setpoint: np.ndarray
    wet_probability: np.ndarray
    friction: np.ndarray
    margin: np.ndarray
    slip_speed: np.ndarray
    slipping: np.ndarray
    dome: np.ndarray
    floor: Floor | None = None
    metrics: Metrics | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    real_time_factor: float | None = None
    doubt: np.ndarray = field(default_factory=lambda: np.zeros((0, 0), dtype=int))

    def standing(self, load_gate: float) -> np.ndarray:
        """Whether each foot stands, with more than ``load_gate`` newtons: bool (n, legs).

        A foot that is without load for less than ``BOUNCE``, as when the other tripod lands, has
        not stepped: it stands all the while.
        """
        loaded = self.force[:, :, 2] > load_gate
        time = self.time[:, None]
        since = np.maximum.accumulate(np.where(loaded, time, -np.inf), axis=0)
        until = np.minimum.accumulate(np.where(loaded, time, np.inf)[::-1], axis=0)[::-1]
        return until - since < BOUNCE

    def wet(self) -> np.ndarray:
        """Whether the true ground below each foot is wet at each control step: (m, legs) bool.

        False where the position of a foot is not known.
        """
        if self.floor is None:
            raise ValueError('the floor of this trial is not known')
        if not len(self.time):
            return np.zeros((len(self.slow_time), len(self.legs)), dtype=bool)
        rows = np.clip(np.searchsorted(self.time, self.slow_time - 1e-9), 0, len(self.time) - 1)
        places = self.position[rows, :, :2]
        known = np.isfinite(places).all(axis=2)
        places = np.where(known[:, :, None], places, 0.0)
        return known & self.floor.wet_along(places[:, :, 0], places[:, :, 1])

    def to_json(self) -> str:
        """Return metrics and set-up as JSON text."""
        return json.dumps(
            {
                'scene': self.scene,
                'policy': self.policy,
                'seed': self.seed,
                'fidelity': self.fidelity,
                'legs': list(self.legs),
                'metrics': self.metrics.as_dict() if self.metrics else None,
                'settings': self.settings,
            }
        )
