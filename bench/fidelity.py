# SPDX-License-Identifier: Apache-2.0
"""Measure how far the rungs of the ladder are apart, and write config/fidelity.yaml.

Run ``python bench/fidelity.py [--scenes 480] [--out config/fidelity.yaml]``; it takes some
minutes on all cores. Random scenes are walked on every rung in closed loop: L1 and L2 against L2
with steps of 0.5 ms, the rail leg against steps of 0.1 ms. Scenes are sorted into classes by
their reserve (see ros_pad.simulation.fidelity); the bound of a class is the largest error in it or
in any class above, times a margin.
"""

from __future__ import annotations

import argparse
import math
import os
import pathlib
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from tqdm import tqdm

from ros_pad.ladders.ladder import machine
from ros_pad.simulation import fidelity
from ros_pad.simulation.full_hexapod import FullHexapod
from ros_pad.simulation.full_hexapod import Settings
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import Scene
from ros_pad.simulation.terrain import patch_lengths
from ros_pad.trials.log import TrialLog
from ros_pad.trials.loop import ClosedLoop

TABLE = pathlib.Path(__file__).resolve().parent.parent / 'config' / 'fidelity.yaml'
RESERVES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
MARGIN = 1.5
# What random scenes are drawn from, in SI units; no promise is made beyond.
RANGES = {
    'hexapod': {
        'body.mass': (1.0, 3.2),
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
TOP_STEP = {'hexapod': 5e-4, 'rail_leg': 1e-4}
# A robot that slips all the way has little distance to be off by: errors are of half of the full
# way at least.
LEAST_WAY = 0.5


def hexapod(seed: int) -> tuple[Scene, str]:
    """Return a random hexapod scene with a policy."""
    draw = np.random.default_rng([seed, 0])

    def uniform(name: str) -> float:
        return draw.uniform(*RANGES['hexapod'][name])

    scene = Scene.load('hexapod_patches')
    share = draw.uniform(0.2, 0.85)
    shortest, longest = patch_lengths(share)
    floor = replace(
        scene.floor,
        kind=str(draw.choice(['dry', 'wet', 'patches'])),
        wet_fraction=share,
        patch_length=draw.uniform(max(0.3, shortest), min(2.0, longest)),
        slope=float(draw.choice([0.0, uniform('floor.slope')])),
        roughness=float(draw.choice(RANGES['hexapod']['floor.roughness'])),
        unevenness=float(draw.choice(RANGES['hexapod']['floor.unevenness'])),
    )
    tow = replace(
        scene.tow,
        weight=float(draw.choice([0.0, uniform('tow.weight')])),
        friction_dry=draw.uniform(0.2, 0.8),
        friction_wet=draw.uniform(0.1, 0.5),
        distance=draw.uniform(0.2, 0.6),
        height=draw.uniform(0.01, 0.1),
    )
    gait = replace(
        scene.gait,
        cycle=uniform('gait.cycle'),
        stride=uniform('gait.stride'),
        duty=uniform('gait.duty'),
        lift=uniform('gait.lift'),
    )
    mass = uniform('body.mass')
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
    drawn = {name: draw.uniform(*ends) for name, ends in RANGES['rail_leg'].items()}
    parts: dict[str, dict[str, float]] = {'body': {}, 'gait': {}}
    for name, value in drawn.items():
        part, _, key = name.partition('.')
        parts[part][key] = value
    body, gait = replace(scene.body, **parts['body']), replace(scene.gait, **parts['gait'])
    floor = replace(scene.floor, kind=str(draw.choice(['dry', 'wet'])))
    scene = replace(scene, body=body, gait=gait, floor=floor, cycles=CYCLES)
    return scene, str(draw.choice(['flat', 'dome']))


def way(scene: Scene, policy: str, seed: int, rung: str, top: bool = False) -> float:
    """Return how far a robot walks, m; NaN when the walk ends with a verdict."""
    loop = ClosedLoop(scene, policy, seed, rung)
    period = loop.period_ns * 1e-9
    inner = 1
    if top and scene.robot == 'hexapod':
        settings = Settings(timestep=TOP_STEP['hexapod'])
        loop.robot = FullHexapod(scene, loop.floor, period, settings)
    elif top:
        inner = round(period / TOP_STEP['rail_leg'])
        loop.robot = _Finely(RailLeg(scene, loop.floor, period / inner), inner)
    log = TrialLog(scene, policy, seed, rung)
    for _ in range(round(scene.duration * 1e9) // loop.period_ns):
        loop.tick(log)
        if loop.robot.verdict:
            return math.nan
    return loop.robot.body[0]


class _Finely:
    """A robot that takes several steps where one is asked for."""

    def __init__(self, robot: RailLeg, steps: int) -> None:
        self._robot = robot
        self._steps = steps

    def __getattr__(self, name: str) -> object:
        return getattr(self._robot, name)

    def step(self, pressures: list[float]) -> None:
        for _ in range(self._steps):
            self._robot.step(pressures)


def apart(scene: Scene, here: float, top: float) -> float:
    """Return the relative error of a way; infinite if one of the walks ended and the other not."""
    if math.isnan(here) or math.isnan(top):
        return 0.0 if math.isnan(here) and math.isnan(top) else math.inf
    return abs(here - top) / max(abs(top), LEAST_WAY * scene.stride * scene.cycles)


def errors(robot: str, first: int, number: int) -> tuple[float, dict[str, float]]:
    """Return the reserve of a random scene, and each rung's error on it."""
    seed = first + number
    scene, policy = hexapod(seed) if robot == 'hexapod' else rail_leg(seed)
    rungs = ('L1', 'L2') if robot == 'hexapod' else ('L0',)
    top = way(scene, policy, seed, rungs[-1], top=True)
    found = {rung: apart(scene, way(scene, policy, seed, rung), top) for rung in rungs}
    return fidelity.reserve(scene, policy), found


def measure(scenes: int, first: int = 0) -> list[tuple[float, dict[str, float]]]:
    """Return reserves and errors of so many scenes of each robot."""
    found = []
    with ProcessPoolExecutor() as pool:
        for robot in ('hexapod', 'rail_leg'):
            work = pool.map(partial(errors, robot, first), range(scenes))
            found += tqdm(work, robot, scenes, file=sys.stderr)
    return found


def bounds(found: list[tuple[float, dict[str, float]]], rung: str) -> list[float]:
    """Return the bound of a rung in each class of reserve, rounded up to a tenth of a per cent."""
    rows = []
    for low in RESERVES:
        above = [error[rung] for own, error in found if rung in error and own >= low]
        # What nobody measured is not promised.
        worst = max(above, default=math.inf)
        rows.append(math.ceil(1e3 * MARGIN * worst) / 1e3 if worst < math.inf else math.inf)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--scenes', type=int, default=480, help='of each robot (%(default)s)')
    parser.add_argument('--out', type=pathlib.Path, default=TABLE, help='the table')
    options = parser.parse_args()
    found = measure(options.scenes)
    here = machine() | {'cores': os.cpu_count()}
    lines = [
        '# Made by bench/fidelity.py: largest error of the distance on each rung, relative, to L2',
        '# with steps of 0.5 ms (L0: of 0.1 ms), by the reserve of the scene; relative to half of',
        '# the full way where a robot gets less far. .inf: walks ended, or went on, that should',
        '# not have.',
        f'machine: {{{", ".join(f"{key}: {value!r}" for key, value in here.items())}}}',
        f'scenes: {options.scenes}  # of each robot, {CYCLES} gait cycles each',
        f'margin: {MARGIN}  # on the largest error found in a class or above',
        f'reserves: [{", ".join(f"{low:g}" for low in RESERVES)}]  # from here on',
        'ranges:  # of the scenes, SI units',
    ]
    for robot, ranges in RANGES.items():
        lines.append(f'  {robot}:')
        lines += [f'    {name}: [{low!r}, {high!r}]' for name, (low, high) in ranges.items()]
    lines.append('bounds:')
    for rung in ('L0', 'L1', 'L2'):
        row = ', '.join(
            '.inf' if each == math.inf else f'{each:g}' for each in bounds(found, rung)
        )
        lines.append(f'  {rung}: [{row}]')
    counts = [
        sum(low <= own < high for own, error in found if 'L1' in error)
        for low, high in zip(RESERVES, [*RESERVES[1:], math.inf], strict=True)
    ]
    lines.append(f'walks: {counts}  # of the hexapod in each class')
    options.out.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    print(options.out.read_text(encoding='utf-8'))
    return 0


if __name__ == '__main__':
    sys.exit(main())
