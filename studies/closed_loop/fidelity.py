# SPDX-License-Identifier: Apache-2.0
"""Measure the errors of the fidelity levels, and write fidelity.yaml, which ros_pad reads.

Walks random scenes at every level in closed loop: L1 and L2 against L2 with steps of 0.5 ms, the
rail leg (L0) against L0 with steps of 0.1 ms. Scenes are sorted into classes by their reserve (the
grip margin, see ros_pad.simulation.fidelity). The bound of a class is 1.5 times the largest
relative error of the distance among all scenes with at least the reserve of this class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import yaml

from ros_pad.reports.files import save
from ros_pad.simulation import fidelity
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.mujoco_model import SolverSettings
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import LeggedBody
from ros_pad.simulation.scene import RailBody
from ros_pad.simulation.scene import RailGait
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.simulation.terrain import patch_lengths
from ros_pad.trials.loop import ClosedLoop
from studies import command
from studies.closed_loop import loops
from studies.machine import machine

CONFIG = command.ROOT / 'config'
RESERVES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
MARGIN = 1.5
# Ranges of the random scenes, in SI units; the bounds do not hold outside them.
RANGES = {
    'ch3r': {
        'body.mass': (1.0, 3.2),
        'body.inertia': (0.03 * 1.0 / 2.09, 0.03 * 3.2 / 2.09),  # in proportion to the mass
        'body.height': (0.12, 0.12),
        'body.leg_stiffness': (3000.0, 3000.0),
        'gait.cycle': (0.8, 2.0),
        'gait.stride': (0.06, 0.15),
        'gait.duty': (0.55, 0.7),
        'gait.lift': (0.015, 0.03),
        'floor.slope': (-0.08, 0.08),
        'floor.roughness': (0.0, 2e-6),
        'floor.unevenness': (0.0, 5e-4),
        'tow.weight': (0.0, 12.0),
    },
    'rail_leg': {
        'body.mass': (0.3, 3.0),
        'body.rolling_drag': (0.02, 0.5),
        'body.load': (1.0, 5.0),
        'gait.stroke': (0.02, 0.1),
        'gait.stance': (0.3, 1.0),
        'gait.swing': (0.3, 1.0),
    },
}
CYCLES = 8
TOP_STEP = {'ch3r': 5e-4, 'rail_leg': 1e-4}
# Errors are relative to the distance, or to this share of the distance without slip if that is
# larger: a robot that slips all the time hardly advances.
LEAST_DISTANCE = 0.5


def ch3r(seed: int) -> tuple[Scene, str]:
    """Return a random hexapod scene with a policy."""
    draw = np.random.default_rng([seed, 0])

    def uniform(name: str) -> float:
        return draw.uniform(*RANGES['ch3r'][name])

    scene = Scene.load('hexapod_patches')
    share = draw.uniform(0.2, 0.85)
    shortest, longest = patch_lengths(share)
    floor = replace(
        scene.floor,
        kind=str(draw.choice(['dry', 'wet', 'patches'])),
        wet_fraction=share,
        patch_length=draw.uniform(max(0.3, shortest), min(2.0, longest)),
        slope=float(draw.choice([0.0, uniform('floor.slope')])),
        roughness=float(draw.choice(RANGES['ch3r']['floor.roughness'])),
        unevenness=float(draw.choice(RANGES['ch3r']['floor.unevenness'])),
    )
    tow = replace(
        scene.tow,
        weight=float(draw.choice([0.0, uniform('tow.weight')])),
        friction_dry=draw.uniform(0.2, 0.8),
        friction_wet=draw.uniform(0.1, 0.5),
        distance=draw.uniform(0.2, 0.6),
        height=draw.uniform(0.01, 0.1),
    )
    assert isinstance(scene.gait, WalkingGait)
    gait = replace(
        scene.gait,
        cycle=uniform('gait.cycle'),
        stride=uniform('gait.stride'),
        duty=uniform('gait.duty'),
        lift=uniform('gait.lift'),
    )
    mass = uniform('body.mass')
    assert isinstance(scene.body, LeggedBody)
    inertia = scene.body.inertia * mass / scene.body.mass
    scene = replace(
        scene,
        body=replace(scene.body, mass=mass, inertia=inertia),
        floor=floor,
        tow=tow,
        gait=gait,
        heading_gain=float(draw.choice([0.0, 1.0])),
        cycles=CYCLES,
    )
    return scene, str(draw.choice(['flat', 'dome', 'adaptive']))


def rail_leg(seed: int) -> tuple[Scene, str]:
    """Return a random scene of the rail leg with a policy."""
    draw = np.random.default_rng([seed, 1])
    scene = Scene.load('leg_wet_dome_75')
    parts: dict[str, dict[str, float]] = {'body': {}, 'gait': {}}
    for name, ends in RANGES['rail_leg'].items():
        part, _, key = name.partition('.')
        parts[part][key] = draw.uniform(*ends)
    assert isinstance(scene.body, RailBody) and isinstance(scene.gait, RailGait)
    body, gait = replace(scene.body, **parts['body']), replace(scene.gait, **parts['gait'])
    floor = replace(scene.floor, kind=str(draw.choice(['dry', 'wet'])))
    scene = replace(scene, body=body, gait=gait, floor=floor, cycles=CYCLES)
    return scene, str(draw.choice(['flat', 'dome']))


def distance(scene: Scene, policy: str, seed: int, level: str, top: bool = False) -> float:
    """Return the distance that a robot walks, m; NaN if the walk ends with a verdict."""
    loop = ClosedLoop(scene, policy, seed, level)
    period = loop.period_ns * 1e-9
    if top and scene.robot == 'ch3r':
        settings = SolverSettings(timestep=TOP_STEP['ch3r'])
        loop.robot = FullRobot(scene, loop.floor, period, settings)
    elif top:
        loop.robot = _FineLeg(scene, loop.floor, period, round(period / TOP_STEP['rail_leg']))
    loops.walk(loop, scene)
    return math.nan if loop.robot.verdict else loop.robot.body[0]


class _FineLeg(RailLeg):
    """A rail leg that divides each time step into several shorter ones."""

    def __init__(self, scene: Scene, floor: Floor, period: float, steps: int) -> None:
        super().__init__(scene, floor, period / steps)
        self._fineness = steps  # not _steps, which RailLeg uses

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by all short steps."""
        for _ in range(self._fineness):
            super().step(pressures)


def apart(scene: Scene, here: float, top: float) -> float:
    """Return the relative error of a distance, 0 or more.

    Infinite if only one of the two walks ended early (NaN), 0 if both did.
    """
    if math.isnan(here) or math.isnan(top):
        return 0.0 if math.isnan(here) and math.isnan(top) else math.inf
    return abs(here - top) / max(abs(top), LEAST_DISTANCE * scene.stride * scene.cycles)


def errors(robot: str, seed: int) -> tuple[float, dict[str, float]]:
    """Return the reserve of a random scene, and each level's error on it."""
    scene, policy = ch3r(seed) if robot == 'ch3r' else rail_leg(seed)
    levels = ('L1', 'L2') if robot == 'ch3r' else ('L0',)
    top = distance(scene, policy, seed, levels[-1], top=True)
    found = {level: apart(scene, distance(scene, policy, seed, level), top) for level in levels}
    return fidelity.reserve(scene, policy), found


def measure(scenes: int, processes: int) -> list[tuple[float, dict[str, float]]]:
    """Return reserve and errors of each of a number of scenes of each robot."""
    cases = [(robot, seed) for robot in RANGES for seed in range(scenes)]
    return command.in_processes(errors, cases, processes, 'fidelity', 'scene')


def bounds(found: list[tuple[float, dict[str, float]]], level: str) -> list[float]:
    """Return the bound of a level in each class of reserve, rounded up to a multiple of 0.1 %."""
    rows = []
    for low in RESERVES:
        above = [error[level] for own, error in found if level in error and own >= low]
        # Without measurements there is no bound.
        worst = max(above, default=math.inf)
        rows.append(math.ceil(1e3 * MARGIN * worst) / 1e3 if worst < math.inf else math.inf)
    return rows


def table(found: list[tuple[float, dict[str, float]]], scenes: int) -> str:
    """Return the text of fidelity.yaml: machine, ranges of the scenes, bounds by level."""
    lines = [
        '# Made by python -m studies fidelity: bound of the relative error of the distance of',
        '# each level against L2 with steps of 0.5 ms (L0 against L0 with 0.1 ms), by reserve.',
        '# Errors are relative to the distance, or to half of the distance without slip if that',
        '# is longer. .inf: no scenes, or only one of the two walks of a scene ended early.',
        f'machine: {{{", ".join(f"{key}: {value!r}" for key, value in machine().items())}}}',
        f'scenes: {scenes}  # of each robot, {CYCLES} gait cycles each',
        f'margin: {MARGIN}  # bound over the largest error found in a class or above',
        f'reserves: [{", ".join(f"{low:g}" for low in RESERVES)}]  # lower ends of the classes',
        'ranges:  # of the scenes, SI units',
    ]
    for robot, ranges in RANGES.items():
        lines.append(f'  {robot}:')
        lines += [f'    {name}: [{low!r}, {high!r}]' for name, (low, high) in ranges.items()]
    lines.append('bounds:')
    for level in ('L0', 'L1', 'L2'):
        row = ', '.join(
            '.inf' if each == math.inf else f'{each:g}' for each in bounds(found, level)
        )
        lines.append(f'  {level}: [{row}]')
    counts = [
        sum(low <= own < high for own, error in found if 'L1' in error)
        for low, high in zip(RESERVES, [*RESERVES[1:], math.inf], strict=True)
    ]
    lines.append(f'walks: {counts}  # of the hexapod in each class')
    return '\n'.join(lines)


def main(words: Sequence[str]) -> int:
    """Measure, write the table, and print it."""
    parser = command.parser('fidelity', __doc__)
    command.add_count(parser, '--scenes', 480, 'scenes of each robot')
    command.add_processes(parser)
    command.add_out(parser, CONFIG)
    options = parser.parse_args(words)
    found = measure(options.scenes, options.processes)
    text = table(found, options.scenes)
    save(options.out / 'fidelity.yaml', (text + '\n').encode())
    command.show(options, yaml.safe_load(text), text)
    return 0
