# SPDX-License-Identifier: Apache-2.0
"""A walk to simulate, a method of simulating it, and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ros_pad.simulation.scene import Scene

HEXAPOD, RAIL = 'hexapod', 'rail leg'
CYCLES = {HEXAPOD: 6, RAIL: 10}


@dataclass(frozen=True)
class Walk:
    """A scene to walk in, with its pads at one pressure.

    Attributes
    ----------
    name : str
    scene : Scene
    pressure : float
        Gauge pressure of all pads, Pa.
    seed : int
        Seed of the floor.
    """

    name: str
    scene: Scene
    pressure: float
    seed: int = 0


@dataclass(frozen=True)
class Walked:
    """Result of a walk.

    Attributes
    ----------
    distance, slip : float
        Forward distance of the body, and slip path of a foot (mean over feet), m a cycle.
    lateral, yaw : float
        Drift to the left, m a cycle, and drift of the heading, rad a cycle.
    verdict : str or None
        Why the walk is not valid; None if it is.
    steps : int
        Number of steps made.
    seconds : float
        Computing time of the steps, s.
    """

    distance: float
    slip: float
    lateral: float
    yaw: float
    verdict: str | None
    steps: int
    seconds: float


@dataclass(frozen=True)
class Walker:
    """A method of simulating a walk.

    Attributes
    ----------
    family, name : str
        Names of family and method; walkers of one family differ only in their step.
    step : float or None
        Time step, s; None where the method chooses its own.
    walk : callable
        Takes a walk and returns its result.
    ours : bool
        Whether the method belongs to ros_pad.
    """

    family: str
    name: str
    step: float | None
    walk: Callable[[Walk], Walked]
    ours: bool = True


def named(family: str, step: float) -> str:
    return f'{family}, {1e3 * step:g} ms'


def walked(robot: Any, scene: Scene, steps: int, seconds: float) -> Walked:
    x, y, heading = robot.body
    slip = sum(foot.slip_path for foot in robot.feet) / len(robot.feet)
    count = scene.cycles
    return Walked(
        x / count, slip / count, y / count, heading / count, robot.verdict, steps, seconds
    )
