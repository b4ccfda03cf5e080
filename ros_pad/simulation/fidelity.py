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
import pathlib
from dataclasses import dataclass
from typing import Any

from ros_pad import configuration
from ros_pad.configuration import Table, choice
from ros_pad.contact import LARGE_PAD
from ros_pad.errors import ConfigError, InvalidInput
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.gait import WalkingGait
from ros_pad.simulation.margin import features, reserve
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.rail_leg import RailLeg
from ros_pad.simulation.robot import SimulatedRobot
from ros_pad.simulation.scene import RAIL_LEG, LeggedBody, RailGait, Scene
from ros_pad.simulation.terrain import Floor

FIDELITIES = ('auto', 'L0', 'L1', 'L2')

STICKING = 'no slip'
"""The answer without a simulation: feet never slip, so the body moves as the gait intends."""

FRICTION = 'friction'
"""Not a level: how much five per cent more friction changes a walk on the cheapest level."""

LEAST = 1e-4
"""Error that is added to every error, so that its logarithm is finite; no bound is below it."""

_REMEDY = ': write the file again with python -m studies fidelity'


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
    ranges : dict of dict
        For each robot and each value of a scene (dotted name), lowest and highest value drawn.
    spans : dict of dict
        For each robot and feature, its lowest and highest value in the scenes drawn.
    lines : dict of dict
        For each robot, and level and metric: constant and slopes, by feature, of the logarithm of
        the bound.
    """

    ranges: dict[str, dict[str, tuple[float, float]]]
    spans: dict[str, dict[str, tuple[float, float]]]
    lines: dict[str, dict[str, dict[str, float]]]

    @classmethod
    @functools.cache
    def load(cls) -> Promises:
        """Read ``config/fidelity.yaml``.

        Raises
        ------
        ConfigError
            When the file is missing or is not as ``python -m studies fidelity`` writes it.
        """
        found = cls({}, {}, {})
        try:
            table = Table.load(_file())
            with table.table('robots') as robots:
                for robot in robots.keys:
                    with robots.table(robot) as own:
                        found._read(robot, own)
        except ConfigError as error:
            raise ConfigError(f'{error}{_REMEDY}') from error
        return found

    def _read(self, robot: str, table: Table) -> None:
        for key, pairs in (('ranges', self.ranges), ('features', self.spans)):
            with table.table(key) as part:
                ends = {name: part.vector(name, '', 2).tolist() for name in part.keys}
            pairs[robot] = {name: (low, high) for name, (low, high) in ends.items()}
        self.lines[robot] = {}
        with table.table('bounds') as bounds:
            for level in bounds.keys:
                with bounds.table(level) as line:
                    names = ('constant', *self.spans[robot])
                    self.lines[robot][level] = {name: line.number(name, '') for name in names}

    def _features(self, scene: Scene, policy: str | None) -> dict[str, float]:
        """Return the features of a scene; raise `ConfigError` if the file has others."""
        found = features(scene, policy)
        if found.keys() != self.spans[scene.robot].keys():
            raise ConfigError(
                f'{_file()}: robots: {scene.robot}: features are'
                f' {", ".join(self.spans[scene.robot])}, needed are {", ".join(found)}{_REMEDY}'
            )
        return found

    def bound(self, level: str, scene: Scene, policy: str | None = None) -> float:
        """Return the bound on the error of a level, at least LEAST; infinite if none was drawn."""
        line = self.lines.get(scene.robot, {}).get(f'{level} {scene.metric}')
        if line is None:
            return math.inf
        known = self._features(scene, policy)
        power = line['constant'] + sum(line[name] * value for name, value in known.items())
        return max(LEAST, math.exp(min(power, 700.0)) - LEAST)

    def beyond(self, scene: Scene, policy: str | None = None) -> str:
        """Return as text what of a scene is outside the ranges drawn; empty if nothing is."""
        if scene.robot not in self.ranges:
            return f'robot = {scene.robot}, drawn were {", ".join(self.ranges)}'
        unused: tuple[str, ...] = () if scene.tow.weight else ('tow.',)
        if scene.floor.kind != 'patches':
            unused += ('floor.wet_fraction', 'floor.patch_length')
        try:
            rows = [
                (name, value_of(scene, name), ends)
                for name, ends in self.ranges[scene.robot].items()
                if not name.startswith(unused)
            ]
        except AttributeError as error:
            raise ConfigError(
                f'{_file()}: robots: {scene.robot}: ranges: of a scene, {error}{_REMEDY}'
            ) from error
        known = self._features(scene, policy)
        rows += [(name, known[name], ends) for name, ends in self.spans[scene.robot].items()]
        found = [
            f'{name} = {value:.4g}, drawn from {low:.4g} to {high:.4g}'
            for name, value, (low, high) in rows
            if value is not None and not low - 1e-9 * abs(low) <= value <= high + 1e-9 * abs(high)
        ]
        if (scene.foot.pad, scene.foot.limit) != (LARGE_PAD, 'measured'):
            found.append('pads, drawn were large ones with the force limit as measured')
        if 'hose_conductance' in scene.regulator:
            found.append('a measured conductance of the hose, of which none were drawn')
        if scene.faults:
            found.append('faults, of which none were drawn')
        if scene.floor.kind == 'drawn':
            found.append('a floor as in a drawing, of which none were drawn')
        if isinstance(scene.gait, WalkingGait) and not _walks_as_usual(scene):
            found.append(f'phases or pushes of the gait, drawn were those of {scene.robot}')
        return ', '.join(found)


def _file() -> pathlib.Path:
    return configuration.shared_folder() / 'fidelity.yaml'


def value_of(scene: Scene, name: str) -> Any:
    """Return a value of a scene by its dotted name, which may end in an option of its air line."""
    found: Any = scene
    for key in name.split('.'):
        found = found.get(key) if isinstance(found, dict) else getattr(found, key)
    return found


def _walks_as_usual(scene: Scene) -> bool:
    """Return whether the gait has the phases and pushes that walked in the study."""
    assert isinstance(scene.body, LeggedBody) and isinstance(scene.gait, WalkingGait)
    usual, gait = scene.body.robot.gait, scene.gait
    if usual is None or not gait.pushes:
        return False
    apart = (
        a - b - (gait.middles[0] - usual.phases[0])
        for a, b in zip(gait.middles, usual.phases, strict=True)
    )
    return all(abs(math.remainder(each, 1.0)) < 1e-6 for each in apart)


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
    known = _levels(scene, fidelity)
    promises = Promises.load()
    beyond = promises.beyond(scene, policy)
    bounds = {
        level: math.inf if beyond else promises.bound(level, scene, policy)
        for level in (STICKING, *known)
    }
    missing = 'L2' in known and importlib.util.find_spec('mujoco') is None
    level = fidelity
    if fidelity == 'auto':
        available = known[:1] if missing else known
        enough = [each for each in available if bounds[each] <= scene.accuracy]
        level = (enough or available[-1:])[0]
    bound = bounds[level]
    if beyond:
        within = f'of unknown error ({beyond})'
    else:
        within = f'{_within(bound)} of the top level, promised for 95 of 100 scenes'
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
    promises = Promises.load()
    if scene.wanted != 'metric' or promises.beyond(scene, policy):
        return None
    bound = promises.bound(STICKING, scene, policy)
    if bound > scene.accuracy:
        return None
    note = (
        f'{_grip(scene, policy)}: the {scene.metric} of feet that never slip is {_within(bound)}'
        ' of the top level, promised for 95 of 100 scenes; nothing was simulated'
    )
    return ChosenLevel(STICKING, bound, note)


def sticking_distance(scene: Scene) -> float:
    """Return how far the body of a scene goes if its feet never slip, m."""
    gait = scene.gait
    if isinstance(gait, RailGait):
        return scene.cycles * gait.stroke
    return gait.body_advance(scene.cycles * gait.cycle)


def _grip(scene: Scene, policy: str | None) -> str:
    return f'grip capacity {reserve(scene, policy):.2g} times the demand'


def _within(bound: float) -> str:
    """Return a bound in words, rounded up to two digits."""
    percent = 100.0 * bound
    if percent > 99.0:
        return f'off by up to {max(percent, 100.0):.0f} %'
    unit = 10.0 ** (math.floor(math.log10(max(percent, 1e-3))) - 1)
    return f'within {math.ceil(percent / unit - 1e-9) * unit:.2g} %'


def level(
    scene: Scene, fidelity: str = 'auto', policy: str | None = None, joints: bool = False
) -> str:
    """Return the name of the level that :func:`choose` returns, with the same errors.

    With ``joints`` it must be one with joints: ``auto`` takes L2, others are refused.
    """
    if joints:
        known = _levels(scene, fidelity)
        if fidelity not in ('auto', 'L2') or 'L2' not in known:
            given = f'scene {scene.name!r}' if 'L2' not in known else f'fidelity = {fidelity!r}'
            raise InvalidInput(
                f"sensing = 'joints' is not allowed with {given}: it needs fidelity L2, which"
                ' has joints'
            )
        return 'L2'
    if fidelity == 'auto':
        return choose(scene, fidelity, policy).level
    _levels(scene, fidelity)
    return fidelity


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
    if name == 'L0':
        return RailLeg(scene, floor, period)
    if name == 'L1':
        return PlanarRobot(scene, floor, period)
    return FullRobot(scene, floor, period)
