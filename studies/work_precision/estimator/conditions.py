# SPDX-License-Identifier: Apache-2.0
"""Test the shipped estimator under changed conditions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_pad.contact.resistance import Foot
from ros_pad.simulation.scene import Scene
from studies.work_precision.estimator.tally import Row, Tally, counted, row_of, row_of_walks
from studies.work_precision.estimator.walks import (
    POLICIES,
    ROBOTS,
    SEEDS,
    Recording,
    World,
    few_recordings,
    full,
    record,
    sticking,
)

Disturbance = Callable[[Recording, float, np.random.Generator], Recording]


def position_noise(walk: Recording, noise: float, _: np.random.Generator) -> Recording:
    """Return the recording with position noise of a standard deviation, m.

    The estimator is not configured with this noise.
    """
    scale = noise / walk.settings[2].position_noise
    return replace(walk, position=walk.position + (scale - 1.0) * walk.noise)


def configured_noise(walk: Recording, noise: float, generator: np.random.Generator) -> Recording:
    """Return the recording as by :func:`position_noise`, with the estimator configured for it."""
    foot, load, tuning = walk.settings
    settings = (foot, load, replace(tuning, position_noise=noise))
    return replace(position_noise(walk, noise, generator), settings=settings)


def position_steps(walk: Recording, step: float, _: np.random.Generator) -> Recording:
    """Return the recording with positions rounded to steps, m."""
    return replace(walk, position=np.round(walk.position / step) * step) if step else walk


def turned_forces(walk: Recording, degrees: float, _: np.random.Generator) -> Recording:
    """Return the recording with axes of the force turned about z."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return replace(walk, force=walk.force @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def rate(walk: Recording, hertz: float, _: np.random.Generator) -> Recording:
    """Return the recording with only every n-th sample delivered, at a rate in Hz."""
    step = round(1.0 / (hertz * walk.period))
    arrived = np.zeros_like(walk.arrived)
    arrived[::step] = True
    return replace(walk, arrived=arrived)


def configured_stiffness(walk: Recording, factor: float, _: np.random.Generator) -> Recording:
    """Return the recording with the estimator configured for pads of another shear stiffness.

    The configured stiffness is the true one times a factor.
    """
    foot, load, tuning = walk.settings
    foot = replace(foot, shear_stiffness=factor * foot.shear_stiffness)
    return replace(walk, settings=(foot, load, tuning))


def configured_as_shipped(walk: Recording, _: float, __: np.random.Generator) -> Recording:
    """Return the recording with the estimator configured for the shipped foot."""
    return replace(walk, settings=(Foot.load(walk.foot.source), *walk.settings[1:]))


def late_position(walk: Recording, delay: float, _: np.random.Generator) -> Recording:
    """Return the recording with each position measured a given time, s, before its force."""
    sample = np.maximum(0, np.arange(len(walk.stamps)) - round(delay / walk.period))
    return replace(walk, position=walk.position[sample])


def same(walk: Recording, _: float, __: np.random.Generator) -> Recording:
    """Return the recording unchanged."""
    return walk


def at_1000_hertz(scene: Scene) -> Scene:
    """Return the scene with sensors at 1000 Hz."""
    return replace(scene, sensors=replace(scene.sensors, rate=1000.0))


def with_wet_friction(friction: float) -> World:
    """Return a function that sets the boundary friction of the feet of a scene."""
    return lambda scene: replace(scene, foot=replace(scene.foot, boundary_friction=friction))


@dataclass(frozen=True)
class Change:
    """A changed condition, with its values.

    Attributes
    ----------
    name, unit : str
    values : tuple of float
    variant : str
        Whether the estimator is configured for the change; may be empty.
    ordinary : float
        Value without change.
    disturb : callable
        Changes a recording.
    world : callable or None
        Returns, for a value, a function that changes the scenes of new recordings.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    ordinary: float
    variant: str = ''
    disturb: Disturbance = same
    world: Callable[[float], World] | None = None


STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0)
NOISES = (5e-5, 1.5e-4, 3e-4, 6e-4)
WET_FRICTIONS = (0.12, 0.25, 0.4, 0.55)
CONFIGURED, NOT_CONFIGURED = 'configured', 'not configured'

CHANGES = (
    Change('position noise', 'm', NOISES, 1.5e-4, CONFIGURED, configured_noise),
    Change('position noise', 'm', NOISES, 1.5e-4, NOT_CONFIGURED, position_noise),
    Change('position steps', 'm', (0.0, 2e-4, 5e-4, 1e-3), 0.0, disturb=position_steps),
    Change('force turned', '°', (0.0, 20.0, 45.0, 90.0, 180.0), 0.0, disturb=turned_forces),
    Change(
        'sample rate', 'Hz', (50.0, 100.0, 250.0, 500.0, 1000.0), 250.0,
        disturb=rate, world=lambda _: at_1000_hertz,
    ),
    Change('shear stiffness', 'times', STIFFNESSES, 1.0, NOT_CONFIGURED, configured_stiffness),
    Change('wet friction', '', WET_FRICTIONS, 0.12, CONFIGURED, world=with_wet_friction),
    Change(
        'wet friction', '', WET_FRICTIONS, 0.12, NOT_CONFIGURED,
        disturb=configured_as_shipped, world=with_wet_friction,
    ),
    Change('position late', 's', (0.0, 8e-3, 2e-2, 4e-2), 0.0, disturb=late_position),
)  # fmt: skip


HELD_OUT = 'held out'
WALK_SEEDS = (341, 342, 343, 344, 345, 346)
"""Floors on which no setting was chosen."""

WALK_CYCLES = 40

STICKS = 'sticks'


class Noise(NamedTuple):
    """Noise of marker and force, and configured noise of both, each over the ordinary one."""

    name: str
    marker: float = 1.0
    force: float = 1.0
    set_marker: float = 1.0
    set_force: float = 1.0


NOISE_CASES = (
    Noise('right'),
    Noise('configured: a quarter', set_marker=0.25, set_force=0.25),
    Noise('configured: four times', set_marker=4.0, set_force=4.0),
    Noise('marker 0.3 mm', marker=2.0),
    Noise('marker 0.3 mm, configured', marker=2.0, set_marker=2.0),
    Noise('marker 0.6 mm', marker=4.0),
    Noise('marker 0.6 mm, configured', marker=4.0, set_marker=4.0),
    Noise('force 0.12 N', force=4.0),
    Noise('force 0.12 N, configured', force=4.0, set_force=4.0),
)
"""The ordinary noise is 0.15 mm and 0.03 N, and so is the configured one."""


def noisy(walk: Recording, noise: Noise, generator: np.random.Generator) -> Recording:
    """Return the recording with other noise, or other configured noise."""
    foot, load, tuning = walk.settings
    more = math.sqrt(noise.force**2 - 1.0) * tuning.force_noise
    changed = replace(
        tuning,
        position_noise=noise.set_marker * tuning.position_noise,
        force_noise=noise.set_force * tuning.force_noise,
    )
    return replace(
        walk,
        position=walk.position + (noise.marker - 1.0) * walk.noise,
        force=walk.force + more * generator.normal(size=walk.force.shape),
        settings=(foot, load, changed),
    )


def walk_cases(count: int | None) -> list[tuple[str, int, str]]:
    """Return robot, seed and policy of each walk; on ``count`` floors, or on all."""
    return [
        (robot, seed, policy)
        for robot in (*ROBOTS, STICKS)
        for seed in WALK_SEEDS[:count]
        for policy in (POLICIES if robot != STICKS else ('flat',))
    ]


def tallies(robot: str, seed: int, policy: str) -> list[Tally]:
    """Walk once, and return the counts with each of :data:`NOISE_CASES`."""
    name = 'hexapod_smooth_dry_flat' if robot == STICKS else f'{robot}_patches'
    scene = replace(Scene.load(name), cycles=WALK_CYCLES)
    walks = sticking(scene, seed) if robot == STICKS else [record(scene, policy, seed, full())]
    found = []
    for noise in NOISE_CASES:
        generator = np.random.default_rng([SEEDS[0], seed])
        tally = Tally()
        for walk in walks:
            tally.add(counted(noisy(walk, noise, generator)))
        found.append(tally)
    return found


def rows_by_walk(
    cases: Sequence[tuple[str, int, str]], found: Sequence[Sequence[Tally]]
) -> list[Row]:
    """Return a row for each robot and noise, with intervals over walks."""
    rows = []
    for robot in dict.fromkeys(case[0] for case in cases):
        mine = [each for case, each in zip(cases, found, strict=True) if case[0] == robot]
        for noise, of_walks in zip(NOISE_CASES, zip(*mine, strict=True), strict=True):
            names = {'part': 'walks', 'name': robot, 'variant': HELD_OUT, 'unit': '', 'value': 0.0}
            shipped = noise == NOISE_CASES[0]
            rows.append(row_of_walks(of_walks, shipped=shipped, note=noise.name, **names))
    return rows


def stress(change: Change, count: int | None) -> list[Row]:
    """Return a row for the shipped estimator under a change with each value.

    With a ``count`` of walks only the ends and the ordinary value are taken, None for all.
    In the rows ``not configured`` of the shear stiffness, the value is the configured stiffness
    over the true one.
    """
    rows = []
    ends = {change.values[0], change.ordinary, change.values[-1]}
    for value in sorted(ends) if count else change.values:
        plain = change.disturb is not rate and value == change.ordinary
        world = None if plain or change.world is None else change.world(value)
        walks = few_recordings(world, count)
        generator = np.random.default_rng(SEEDS)
        tally = Tally()
        for walk in walks:
            tally.add(counted(change.disturb(walk, value, generator)))
        rows.append(
            row_of(
                tally, part='robustness', name=change.name, variant=change.variant,
                value=value, unit=change.unit, shipped=value == change.ordinary,
                note=_shortened(walks),
            )
        )  # fmt: skip
    return rows


def _shortened(walks: Sequence[Recording]) -> str:
    durations = [len(walk.stamps) * walk.period for walk in walks]
    longest = max(durations) - 1e-6  # all walks have the same number of cycles
    ended = [walk.name for walk, each in zip(walks, durations, strict=True) if each < longest]
    return f'ended early: {"; ".join(ended)}' if ended else ''
