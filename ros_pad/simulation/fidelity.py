# SPDX-License-Identifier: Apache-2.0
"""Choose the fidelity level for a scene, with a bound on its error that is kept 95 times in 100.

``python -m studies fidelity`` walks random scenes on all levels and writes
``config/fidelity.yaml``: for each level the line by which a high quantile of the error depends on
the features of a scene, shifted until it covers 95 % of scenes that it was not fitted to (cross-
conformal prediction). Scenes outside the ranges of those drawn have no bound.
"""

from __future__ import annotations

import functools
import importlib.util
import math
from dataclasses import dataclass
from typing import Any

from ros_pad.configuration import choice, shared_folder
from ros_pad.contact import LARGE_PAD
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.margin import features, reserve
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.scene import RAIL_LEG, Scene
from ros_pad.simulation.terrain import Floor
from ros_pad.yaml_text import read_yaml

FIDELITIES = ('auto', 'L0', 'L1', 'L2')

STICKING = 'no slip'
"""The answer without a simulation: feet never slip, so the body moves as the gait intends."""

FRICTION = 'friction'
"""Not a level: how much five per cent more friction changes a walk on the best level."""

LEAST = 1e-4
"""Error that is added to every error, so that its logarithm is finite; no bound is below it."""


@dataclass(frozen=True)
class ChosenLevel:
    """A fidelity level for a scene, and the bound on its error.

    Attributes
    ----------
    level : str
        ``L0``, ``L1`` or ``L2``.
    bound : float
        Bound that the error keeps in 95 of 100 scenes as drawn by ``python -m studies fidelity``.
        The error is that of the scene's metric. That of the distance is relative to the distance
        on the top level, or to half of the distance without slip if that is more; that of the slip
        relative to the slip on the top level, or to 2 % of the distance without slip. Infinite for
        scenes outside the ranges of those drawn. Contact lines that a trial adds are left out.
    note : str
        Bound and grip margin in words, and whether the scene requires a smaller error.
    """

    level: str
    bound: float
    note: str


@dataclass(frozen=True)
class Promises:
    """Bounds on the errors of the levels, made by ``python -m studies fidelity``.

    Attributes
    ----------
    robots : dict
        For each robot ``ranges``: lowest and highest of each value of a scene (dotted name) that
        was drawn; ``features``: of each feature; and ``bounds``: for each level and metric,
        constant and slopes, by feature, of the logarithm of the bound.
    """

    robots: dict[str, dict[str, dict[str, Any]]]

    @classmethod
    @functools.cache
    def load(cls) -> Promises:
        """Read ``config/fidelity.yaml``; raise `ConfigError` if it is missing or not YAML."""
        path = shared_folder() / 'fidelity.yaml'
        try:
            return cls(read_yaml(path.read_text(encoding='utf-8'))['robots'])
        except Exception as error:  # YAML has many
            raise ConfigError(
                f'{path}: {error}: write the file again with python -m studies fidelity'
            ) from error

    def bound(self, level: str, scene: Scene, policy: str | None = None) -> float:
        """Return the bound on the error of a level, at least LEAST; infinite if there is none."""
        line = self.robots.get(scene.robot, {}).get('bounds', {}).get(f'{level} {scene.metric}')
        if line is None or self.beyond(scene, policy):
            return math.inf
        known = features(scene, policy)
        power = line['constant'] + sum(line[name] * value for name, value in known.items())
        return max(LEAST, math.exp(min(power, 700.0)) - LEAST)

    def beyond(self, scene: Scene, policy: str | None = None) -> str:
        """Return as text what of a scene is outside the ranges drawn; empty if nothing is."""
        if scene.robot not in self.robots:
            return f'robot = {scene.robot}, drawn were {", ".join(self.robots)}'
        drawn = self.robots[scene.robot]
        unused: tuple[str, ...] = () if scene.tow.weight else ('tow.',)
        if scene.floor.kind != 'patches':
            unused += ('floor.wet_fraction', 'floor.patch_length')
        known: dict[str, Any] = features(scene, policy)
        known |= {n: value_of(scene, n) for n in drawn['ranges'] if not n.startswith(unused)}
        found = [
            f'{name} = {known[name]:.4g}, drawn from {low:.4g} to {high:.4g}'
            for name, (low, high) in (drawn['ranges'] | drawn['features']).items()
            if known.get(name) is not None
            and not low - 1e-9 * abs(low) <= known[name] <= high + 1e-9 * abs(high)
        ]
        usual = (scene.foot.pad, scene.foot.limit) == (LARGE_PAD, 'measured')
        others = {
            'pads, drawn were large ones with the force limit as measured': not usual,
            'a measured conductance of the hose': 'hose_conductance' in scene.regulator,
            'faults': scene.faults,
            'a floor as in a drawing': scene.floor.kind == 'drawn',
            f'phases or pushes of the gait, drawn were those of {scene.robot}': not _usual(scene),
        }
        return ', '.join(found + [word for word, holds in others.items() if holds])


def value_of(scene: Scene, name: str) -> Any:
    """Return a value of a scene by its dotted name, which may end in an option of its air line."""
    found: Any = scene
    for key in name.split('.'):
        found = found.get(key) if isinstance(found, dict) else getattr(found, key)
    return found


def _usual(scene: Scene) -> bool:
    """Return whether the gait has the phases and pushes that walked in the study."""
    if scene.robot == RAIL_LEG:
        return True
    body, gait = scene.legged
    usual = body.robot.gait
    if gait.pushes != usual.pushes:
        return False
    shifts = [a - b for a, b in zip(gait.middles, usual.phases, strict=True)]
    return all(abs(math.remainder(each - shifts[0], 1.0)) < 1e-6 for each in shifts)


def choose(scene: Scene, fidelity: str = 'auto', policy: str | None = None) -> ChosenLevel:
    """Return the level for a scene, and the bound on its error.

    ``auto`` takes the cheapest level whose bound is within ``scene.accuracy``, else the best
    available one; for a legged robot without MuJoCo that is L1.

    Parameters
    ----------
    scene : Scene
        Scene to be walked.
    fidelity : str
        ``auto`` or a level.
    policy : str or None
        Policy of the feet; None takes the scene's own.

    Raises
    ------
    InvalidInput
        When the level does not exist, or does not model the scene's robot.
    """
    known, promises = _levels(scene, fidelity), Promises.load()
    bounds = {level: promises.bound(level, scene, policy) for level in (STICKING, *known)}
    missing = 'L2' in known and importlib.util.find_spec('mujoco') is None
    level = fidelity
    if fidelity == 'auto':
        available = known[:1] if missing else known
        enough = [each for each in available if bounds[each] <= scene.accuracy]
        level = (enough or available[-1:])[0]
    bound = bounds[level]
    beyond = promises.beyond(scene, policy)
    within = f'of unknown error ({beyond})' if beyond else _promised(bound)
    note = f'{_grip(scene, policy)}: the {scene.metric} on {level} is {within}'
    if bound > scene.accuracy:
        note += f', but the scene requires {100.0 * scene.accuracy:.3g} %'
        if missing and level == 'L1':
            note += '; pip install "ros_pad[mujoco]" adds L2'
    if bounds[STICKING] <= scene.accuracy:
        note += f'; no slip at all, without a simulation, is {_within(bounds[STICKING])}'
    return ChosenLevel(level, bound, note)


def answer(scene: Scene, policy: str | None = None) -> ChosenLevel | None:
    """Return the promise of the distance without slip; None if a scene requires more.

    It requires more if it wants the walk itself, not only the metric, or more accuracy.
    """
    bound = Promises.load().bound(STICKING, scene, policy)
    if scene.wanted != 'metric' or bound > scene.accuracy:
        return None
    note = (
        f'{_grip(scene, policy)}: the {scene.metric} of feet that never slip is'
        f' {_promised(bound)}; nothing was simulated'
    )
    return ChosenLevel(STICKING, bound, note)


def sticking_distance(scene: Scene) -> float:
    """Return how far the body of a scene goes if its feet never slip, m."""
    return scene.gait.body_advance(scene.cycles * scene.gait.cycle)


def _grip(scene: Scene, policy: str | None) -> str:
    return f'grip capacity {reserve(scene, policy):.2g} times the demand'


def _promised(bound: float) -> str:
    return f'{_within(bound)} of the top level, promised for 95 of 100 scenes'


def _within(bound: float) -> str:
    """Return a bound in words, rounded up to two digits."""
    percent = 100.0 * bound
    if percent > 99.0:
        return f'off by up to {max(percent, 100.0):.0f} %'
    digits = 0 if percent > 9.95 else 1
    return f'within {math.ceil(percent * 10**digits - 1e-9) / 10**digits:g} %'


def level(
    scene: Scene, fidelity: str = 'auto', policy: str | None = None, joints: bool = False
) -> str:
    """Return the name of the level that :func:`choose` returns, with the same errors.

    With ``joints`` it must be one with joints: ``auto`` takes L2, others are refused.
    """
    known = _levels(scene, fidelity)
    if not joints:
        return choose(scene, fidelity, policy).level if fidelity == 'auto' else fidelity
    if fidelity not in ('auto', 'L2') or 'L2' not in known:
        raise InvalidInput(
            f"sensing = 'joints' is not allowed with fidelity = {fidelity!r} of scene"
            f' {scene.name!r}: it needs fidelity L2, which has joints'
        )
    return 'L2'


def _levels(scene: Scene, fidelity: str) -> tuple[str, ...]:
    """Return the levels that model a scene's robot.

    Raise `InvalidInput` if ``fidelity`` is neither ``auto`` nor one of them.
    """
    choice('fidelity', fidelity, FIDELITIES)
    known = ('L0',) if scene.robot == RAIL_LEG else ('L1', 'L2')  # the cheapest first
    if fidelity not in ('auto', *known):
        raise InvalidInput(
            f'fidelity = {fidelity!r} is not allowed: scene {scene.name!r} has {scene.robot},'
            f' which only {" and ".join(known)} model{"s" if len(known) == 1 else ""}'
        )
    return known


def build(scene: Scene, floor: Floor, period: float, fidelity: str = 'auto') -> SimulatedRobot:
    """Return the robot of a scene on a floor, with a step of ``period`` seconds.

    Raises
    ------
    InvalidInput
        As by :func:`choose`, and when the period is not finite and above 0.
    ConfigError
        For L2 when MuJoCo is missing, or the scene cannot be built as :class:`FullRobot`.
    """
    name = level(scene, fidelity)
    made = {'L0': RailLeg, 'L1': PlanarRobot, 'L2': FullRobot}[name]
    return made(scene, floor, period)
