# SPDX-License-Identifier: Apache-2.0
"""Random scenes of each robot, and how far it walks and slips in them on every fidelity level."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ros_pad.contact.resistance import FOOT_SETTINGS
from ros_pad.simulation.fidelity import value_of
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.mujoco_model import SolverSettings
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.scene import RAIL_LEG, LeggedBody, Scene
from ros_pad.simulation.terrain import patch_lengths
from ros_pad.trials.loop import ClosedLoop
from studies.closed_loop import loops

BASES = {'ch3r': 'hexapod_patches', 'go2': 'quadruped_patches', RAIL_LEG: 'leg_wet_dome_75'}
TOP_STEP = {'L2': 5e-4, 'L0': 2e-4}  # s

# Ranges of what is drawn, SI units. Mass: inertia is in proportion.
WALKS = {
    'ch3r': {
        'body.mass': (1.0, 3.2),
        'gait.cycle': (0.8, 2.0),
        'gait.stride': (0.06, 0.15),
        'gait.duty': (0.55, 0.7),
        'gait.lift': (0.015, 0.03),
        'tow.weight': (0.0, 12.0),
        'tow.distance': (0.2, 0.6),
    },
    'go2': {
        'body.mass': (12.0, 18.0),
        'gait.cycle': (0.45, 1.0),
        'gait.stride': (0.06, 0.2),
        'gait.duty': (0.58, 0.7),
        'gait.lift': (0.04, 0.07),
        'tow.weight': (0.0, 80.0),
        'tow.distance': (0.4, 0.8),
    },
}
GROUND = {
    'floor.slope': (-0.08, 0.08),
    'floor.roughness': (0.0, 2e-6),
    'floor.unevenness': (0.0, 5e-4),
    'tow.friction_dry': (0.2, 0.8),
    'tow.friction_wet': (0.1, 0.5),
    'tow.height': (0.01, 0.1),
}
RAIL = {
    'body.mass': (0.3, 3.0),
    'body.rolling_drag': (0.02, 0.5),
    'body.load': (1.0, 5.0),
    'gait.stroke': (0.02, 0.1),
    'gait.stance': (0.3, 1.0),
    'gait.swing': (0.3, 1.0),
    'dome_pressure': (40e3, 85e3),
}
PATCHES = {'floor.wet_fraction': (0.2, 0.85), 'floor.patch_length': (0.3, 2.0)}
CYCLES = {'ch3r': (4, 60), 'go2': (4, 60), RAIL_LEG: (8, 80)}
SHORT = {'ch3r': 10, 'go2': 10}  # cycles of 14 walks in 15 are no more, to save time
# What every drawn scene has as the scene that it was made from.
_SAME = (
    *('floor.film_thickness', 'floor.viscosity', 'regulator.hose_diameter'),
    *('regulator.hose_length', 'sensors.rate', 'sensors.force', 'sensors.position'),
    *(f'foot.{each.name}' for each in FOOT_SETTINGS),
)
_LEGGED = ('body.height', 'body.leg_stiffness', 'tow.stiffness', *_SAME)
FIXED = {
    'ch3r': _LEGGED,
    'go2': _LEGGED,
    RAIL_LEG: ('gait.lift', 'floor.slope', 'floor.roughness', 'floor.unevenness', *_SAME),
}


@functools.cache
def _base(robot: str) -> Scene:
    return Scene.load(BASES[robot])


def draw(robot: str, seed: int) -> tuple[Scene, str]:
    """Return a random scene of a robot, and the policy of its feet."""
    random = np.random.default_rng([seed, list(BASES).index(robot)])
    scene = _base(robot)
    low, high = CYCLES[robot]
    if robot in SHORT and random.random() < 14 / 15:
        high = SHORT[robot]
    scene = replace(scene, cycles=round(math.exp(random.uniform(*np.log((low, high))))))
    if robot == RAIL_LEG:
        scene = _with(scene, {name: random.uniform(*ends) for name, ends in RAIL.items()})
        floor = replace(scene.floor, kind=str(random.choice(['dry', 'wet'])))
        return replace(scene, floor=floor), str(random.choice(['flat', 'dome']))
    scene = replace(
        _with(scene, {name: random.uniform(*ends) for name, ends in WALKS[robot].items()}),
        heading_gain=float(random.choice([0.0, 1.0])),
        dome_pressure=None if random.random() < 0.7 else random.uniform(60e3, 85e3),
    )
    values = {name: random.uniform(*ends) for name, ends in GROUND.items()}
    for name in ('floor.slope', 'floor.roughness', 'floor.unevenness'):
        values[name] *= float(random.random() < 0.5)
    if random.random() < 0.4:
        values['tow.weight'] = 0.0
    share = random.uniform(*PATCHES['floor.wet_fraction'])
    shortest, longest = patch_lengths(share)
    ends = PATCHES['floor.patch_length']
    floor = replace(
        scene.floor,
        kind=str(random.choice(['dry', 'wet', 'patches'])),
        wet_fraction=share,
        patch_length=random.uniform(max(ends[0], shortest), min(ends[1], longest)),
    )
    scene = _with(replace(scene, floor=floor), values)
    return scene, str(random.choice(['flat', 'dome', 'adaptive']))


def _with(scene: Scene, values: dict[str, float]) -> Scene:
    """Return a scene with other values, by dotted name."""
    parts: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        part, _, key = name.rpartition('.')
        parts.setdefault(part, {})[key] = value
    own: dict[str, Any] = dict(parts.pop('', {}))
    if isinstance(scene.body, LeggedBody) and 'body' in parts:
        body = parts['body']
        body['inertia'] = scene.body.inertia * body['mass'] / scene.body.mass
    own |= {part: replace(getattr(scene, part), **keys) for part, keys in parts.items()}
    return replace(scene, **own)


def ranges(robot: str) -> dict[str, tuple[float, float]]:
    """Return lowest and highest value, by dotted name, of all that scenes of a robot have."""
    scene = _base(robot)
    found = dict(RAIL) if robot == RAIL_LEG else WALKS[robot] | GROUND | PATCHES
    found['cycles'] = CYCLES[robot]
    if isinstance(scene.body, LeggedBody):
        found |= {'heading_gain': (0.0, 1.0), 'dome_pressure': (60e3, 85e3)}
        share = scene.body.inertia / scene.body.mass
        low, high = found['body.mass']
        found['body.inertia'] = share * low, share * high
    return found | {name: (value_of(scene, name),) * 2 for name in FIXED[robot]}


Walk = tuple[float, float, float] | None
"""Distance and mean slip path of the feet, m, and processor time, s; None after a verdict."""


def walk(scene: Scene, policy: str, seed: int, level: str, top: bool = False) -> Walk:
    """Walk a scene on a level, or as exactly as that level can."""
    started = time.process_time()
    # With an accuracy of 1 no term is added: all levels walk the same scene.
    loop = ClosedLoop(replace(scene, accuracy=1.0), policy, seed, level)
    period = loop.period_ns * 1e-9
    if top and level == 'L2':
        settings = SolverSettings(timestep=TOP_STEP[level])
        loop.robot = FullRobot(scene, loop.floor, period, settings)
    elif top:
        loop.robot = _FineLeg(scene, loop.floor, period, round(period / TOP_STEP[level]))
    if policy == 'flat':  # nothing that is estimated moves the robot
        for _ in range(round(scene.duration * 1e9) // loop.period_ns):
            loop.robot.step(loop.pads)
            if loop.robot.verdict:
                break
        loop.close()
    else:
        loops.walk(loop)
    if loop.robot.verdict:
        return None
    slip = float(np.mean([foot.slip_path for foot in loop.robot.feet]))
    return loop.robot.body[0], slip, time.process_time() - started


class _FineLeg(RailLeg):
    """A rail leg that divides each time step into several shorter ones."""

    def __init__(self, scene: Scene, floor: Any, period: float, steps: int) -> None:
        super().__init__(scene, floor, period / steps)
        self._fineness = steps  # not _steps, which RailLeg uses

    def step(self, pressures: Sequence[float]) -> None:
        """Advance by all short steps."""
        for _ in range(self._fineness):
            super().step(pressures)


MORE_FRICTION = 1.05
"""Factor on all friction of a foot with which the effect of friction is measured."""


def slippery(scene: Scene, factor: float) -> Scene:
    """Return a scene whose feet have another friction."""
    names = ('friction', 'shear_strength', 'boundary_friction')
    values = {name: factor * getattr(scene.foot, name) for name in names}
    return replace(scene, foot=replace(scene.foot, **values))


def walks(robot: str, seed: int) -> dict[str, Walk]:
    """Walk a random scene on every level, on the top one, and with more friction."""
    scene, policy = draw(robot, seed)
    levels = ('L0',) if robot == RAIL_LEG else ('L1', 'L2')
    found = {level: walk(scene, policy, seed, level) for level in levels}
    found['top'] = walk(scene, policy, seed, levels[-1], top=True)
    found['friction'] = walk(slippery(scene, MORE_FRICTION), policy, seed, levels[-1])
    return found


def listed(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return rows of errors and times as lines of words, after one with the names of columns."""
    names = [*{name: None for row in rows for name in row['errors']}]
    timed = [*{name: None for row in rows for name in row['seconds']}]
    lines = [';'.join(['seed', *names, *(f'{name} seconds' for name in timed)])]
    for row in rows:
        values = [row['errors'].get(name) for name in names]
        values += [row['seconds'].get(name) for name in timed]
        words = ['' if value is None else f'{value:.4g}' for value in values]
        lines.append(';'.join([str(row['seed']), *words]))
    return lines


def unlisted(lines: Sequence[str]) -> list[dict[str, float]]:
    """Return the rows of such lines, each without the columns in which it has no value."""
    names = lines[0].split(';')
    rows = [zip(names, line.split(';'), strict=True) for line in lines[1:]]
    return [{name: float(word) for name, word in row if word} for row in rows]
