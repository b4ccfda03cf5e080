# SPDX-License-Identifier: Apache-2.0
"""Walk quadrupeds from their URDF files alone: distance, slip and falls on several floors.

Each robot walks its usual gait at its usual speed, from a scene that names its URDF file and feet
alone. Prints a table, and writes it to gaits.json. FILE is YAML: for each robot, by name, the
path of its URDF file, relative to FILE, and then the links of its feet.
"""

from __future__ import annotations

import math
import pathlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import yaml

from ros_pad.contact import Foot
from ros_pad.contact.meniscus import GRAVITY
from ros_pad.simulation import Scene
from ros_pad.simulation.full_robot import FullRobot
from studies import command

PERIOD = 4e-3  # s
FOOT, LIGHT_FOOT = 'large331', 'large37'  # feet for 15 kg and for 2 kg
LIGHT = 5.0  # kg, mass of a robot up to which it has the second one
PATCHES = {'kind': 'patches', 'wet_fraction': 0.4, 'patch_length': 1.0}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    'dry': ({}, {}, 0.0),
    'pushes of 10 %': ({}, {}, 0.1),
    'pushes of 15 %': ({}, {}, 0.15),
    'slope of 10°': ({'slope': math.radians(10.0)}, {}, 0.0),
    'uneven by 10 mm': ({'unevenness': 0.01}, {}, 0.0),
    'uneven by 20 mm': ({'unevenness': 0.02}, {}, 0.0),
    'wet patches': (PATCHES, {}, 0.0),
    'crawl, dry': ({}, {'kind': 'crawl', 'duty': 0.8}, 0.0),
}
"""Floor, gait, and force of pushes over the weight, of each case."""


def scene_of(urdf: str, feet: Sequence[str], case: str, cycles: int) -> Scene:
    """Return a scene that names a URDF file."""
    floor, gait, _ = CASES[case]
    table: dict[str, Any] = {
        'robot': urdf,
        'foot': FOOT,
        'policy': 'flat',
        'cycles': cycles,
        'accuracy': 0.2,
        'floor': {'kind': 'dry'} | floor,
        'sensors': {'rate': 1.0 / PERIOD, 'force_noise': 0.3, 'position_noise': 1.5e-4},
        'regulator': {'hose_diameter': 6e-3, 'hose_length': 1.0},
    }
    if feet:
        table['feet'] = list(feet)
    if gait:
        table['gait'] = gait
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / 'scene.yaml'
        file.write_text(yaml.safe_dump(table))
        scene = Scene.load(file)
    return scene if scene.body.mass > LIGHT else replace(scene, foot=Foot.load(LIGHT_FOOT))


def robots_of(file: pathlib.Path | None) -> dict[str, list[str]]:
    """Return URDF and feet of the shipped go2, and of the robots in a file."""
    robots = {'shipped go2': ['go2']}
    if file:
        for name, (urdf, *feet) in yaml.safe_load(file.read_text()).items():
            robots[name] = [str(file.parent / urdf), *feet]
    return robots


def walk(scene: Scene, robot: FullRobot, push: float, seed: int) -> Iterator[None]:
    """Walk until the end or a verdict; yield after each step.

    From 1 s of walking on, a force of ``push`` times the weight acts on the trunk for 0.2 s every
    3 s, each time in another direction.
    """
    random, push = np.random.default_rng(seed), push * scene.body.mass * GRAVITY
    trunk = robot.data.xfrc_applied[robot.model.body('trunk').id]
    for _ in range(round(scene.duration / robot.period)):
        since = (robot.time - scene.settle - 1.0) % 3.0
        if push and robot.time > scene.settle + 0.9 and since < 0.99 * robot.period:
            angle = random.uniform(0.0, math.tau)
            trunk[:2] = push * math.cos(angle), push * math.sin(angle)
        elif since >= 0.2:
            trunk[:] = 0.0
        robot.step([0.0] * len(robot.legs))
        yield
        if robot.verdict:
            break


def walked(
    name: str, urdf: str, feet: Sequence[str], case: str, cycles: int, seed: int
) -> dict[str, Any]:
    """Walk, and return what happened."""
    scene = scene_of(urdf, feet, case, cycles)
    robot = FullRobot(scene, scene.floor.build(seed), PERIOD)
    stood, start, last = 0.0, None, np.zeros(2)
    begun = time.perf_counter()
    for _ in walk(scene, robot, CASES[case][2], seed):
        here = np.array(robot.body[:2])
        if robot.time >= scene.settle and start is None:
            start, last = here, here
        if start is not None:
            standing = int((robot.contacts[:, 2] > 1.0).sum())
            stood += standing * float(np.linalg.norm(here - last))
            last = here
    gait = scene.legged[1]
    want = gait.body_advance(cycles * gait.cycle)
    start = last if start is None else start
    return {
        'robot': name,
        'case': case,
        'seed': seed,
        'distance': float(last[0] - start[0]) / want,
        'slip': sum(foot.slip_path for foot in robot.feet) / max(stood, 1e-9),
        'verdict': robot.verdict,
        'seconds': time.perf_counter() - begun,
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a line for each robot and case, over all seeds."""
    lines = [f'{"case":16} {"robot":12} {"distance":>8} {"slip":>7} {"walks":>6} {"falls":>6}']
    for case, name in dict.fromkeys((row['case'], row['robot']) for row in rows):
        mine = [row for row in rows if (row['case'], row['robot']) == (case, name)]
        fell = sum(row['verdict'] is not None for row in mine)
        distance = min(row['distance'] for row in mine)
        slip = max(row['slip'] for row in mine)
        lines.append(
            f'{case:16} {name:12} {distance:8.3f} {100.0 * slip:6.2f}% {len(mine):6} {fell:6}'
        )
    return '\n'.join([*lines, 'distance: least, of the commanded; slip: most, of the stance path'])


def main(words: Sequence[str] | None = None) -> int:
    """Run the study; return the exit status."""
    part = command.parser('gaits', __doc__)
    part.add_argument(
        '--robots', type=pathlib.Path, metavar='FILE', help='robots, beside the shipped go2'
    )
    part.add_argument('--cases', nargs='+', choices=CASES, default=list(CASES), metavar='CASE')
    command.add_count(part, '--cycles', 40, 'gait cycles of a walk')
    command.add_count(part, '--seeds', 3, 'walks of each case')
    command.add_count(part, '--first', 601, 'first seed', least=0)
    command.add_processes(part)
    command.add_out(part)
    args = part.parse_args(words)
    robots = robots_of(args.robots)
    cases = [
        (name, row[0], row[1:], case, args.cycles, args.first + seed)
        for case in args.cases
        for name, row in robots.items()
        for seed in range(args.seeds)
    ]
    rows = command.in_processes(walked, cases, args.processes, 'walking')
    command.show(args, command.write(args.out, 'gaits', {'rows': rows}), table(rows))
    return 0
