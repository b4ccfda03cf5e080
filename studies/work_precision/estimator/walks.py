# SPDX-License-Identifier: Apache-2.0
"""Record walks once: readings of the sensors, and the truth."""

from __future__ import annotations

import functools
import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_pad.contact.resistance import Foot, expected_friction
from ros_pad.estimation.foot import Tuning
from ros_pad.simulation.scene import Scene
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.node_settings import tuning_for
from studies.closed_loop import loops

Floats = np.ndarray[Any, np.dtype[np.float64]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]

CYCLES = 15
SEEDS = (311, 312)  # the defaults of the estimator were chosen on other seeds
FEW_CYCLES = 10
ROBOTS, POLICIES = ('hexapod', 'quadruped'), ('flat', 'dome', 'adaptive')
SETTLED = 1.0  # s: before, the robot only stands
LOADED = 0.15  # of the expected load


@dataclass(frozen=True)
class Recording:
    """Readings of the sensors in a walk, and the truth; arrays have a row for each sample.

    Attributes
    ----------
    name : str
    period : float
        Sampling period of the sensors, s.
    foot : Foot
        True foot; the foot that an estimator is configured for is in :attr:`settings`.
    expected_load : float
        Expected load of a foot, N.
    settings : tuple
        Arguments of :class:`FootEstimator`: foot, expected load, tuning.
    stamps : array
        Time stamps of the samples, s.
    force, position : array, (samples, legs, 3)
        Readings, N and m.
    noise : array, (samples, legs, 3)
        Noise of the position, m, which the position already contains.
    pressure : array, (samples, legs)
        Pressure of the pads that was last reported, Pa gauge.
    arrived : array of bool, (samples, legs)
        Whether the estimator gets the sample.
    load, tangential, grip : array, (samples, legs)
        Truth: normal force, tangential force and capacity, N.
    place : array, (samples, legs, 2)
        Truth: place of the contact, m.
    wet : array of bool, (samples, legs)
        Whether the ground under each foot is wet.
    sticks_only : bool
        Whether the recording is used only to count false alarms.
    """

    name: str
    period: float
    foot: Foot
    expected_load: float
    settings: tuple[Foot, float, Tuning]
    stamps: Floats
    force: Floats
    position: Floats
    noise: Floats
    pressure: Floats
    arrived: Flags
    load: Floats
    tangential: Floats
    grip: Floats
    place: Floats
    wet: Flags
    sticks_only: bool = False

    @functools.cached_property
    def rows(self) -> list[list[list[float]]]:
        """Readings of each leg: force, position, pressure, as arguments of an estimator."""
        table = np.concatenate([self.force, self.position, self.pressure[..., None]], axis=2)
        return np.swapaxes(table, 0, 1).tolist()


def record(
    scene: Scene,
    policy: str,
    seed: int,
    level: str,
    prepare: Callable[[ClosedLoop], None] | None = None,
) -> Recording:
    """Walk once in closed loop, and return readings and truth, up to a verdict if there is one.

    ``prepare`` is called with the loop before the walk.
    """
    loop = ClosedLoop(scene, policy, seed, level)
    if prepare:
        prepare(loop)
    true = [
        [(*foot.position, *foot.force, foot.grip, foot.wet)
         for foot in loop.robot.feet]
        for _ in loop.walk()
        if not loop.robot.verdict
    ]  # fmt: skip
    truth, records = np.array(true, dtype=np.float64), loop.log.records
    stamps, taken = records.sample.stamps[: len(truth)], records.sample.rows[: len(truth)]
    return Recording(
        name=f'{scene.name}, {policy}, {seed}, {level}',
        period=loop.period_ns * 1e-9,
        foot=scene.foot,
        expected_load=scene.expected_load,
        settings=(scene.foot, scene.expected_load, tuning_for(scene)),
        stamps=np.multiply(1e-9, stamps, dtype=np.float64),
        force=taken['force'],
        position=taken['position'],
        noise=taken['position'] - truth[..., :3],
        pressure=loops.pressures(records, stamps),
        arrived=np.ones(taken.shape, dtype=bool),
        load=truth[..., 5],
        tangential=np.hypot(truth[..., 3], truth[..., 4]),
        grip=truth[..., 6],
        place=truth[..., :2] + truth[..., 3:5] / scene.foot.shear_stiffness,
        wet=truth[..., 7] > 0.5,
        sticks_only=level == 'L1' and scene.floor.kind == 'dry',
    )


def pull(scene: Scene, duration: float, seed: int) -> Recording:
    """Return a recording of six flat feet on dry ground that are pulled to and fro without slip.

    From foot to foot, the peak of the pull is 0.2 to 0.6 of the friction limit, and its period 1.2
    to 0.3 s. As in walks, the feet only stand in the first second.
    """
    period, load, foot = 1.0 / scene.sensors.rate, scene.expected_load, scene.foot
    generator = np.random.default_rng([seed, 5])
    stamps = period * np.arange(1, round(duration / period) + 1, dtype=np.float64)
    friction = expected_friction(foot, load).flat_dry
    amplitude, cycle = friction * np.linspace(0.2, 0.6, 6), np.linspace(1.2, 0.3, 6)
    pulled = np.maximum(0.0, stamps[:, None] - SETTLED)
    shape = (len(stamps), 6, 3)
    force, position = np.zeros(shape), np.zeros(shape)
    force[..., 0] = load * amplitude * np.sin(2.0 * math.pi * pulled / cycle)
    force[..., 2] = load
    position[..., 0] = -force[..., 0] / foot.shear_stiffness
    noise = scene.sensors.position * generator.normal(size=shape)
    tangential = abs(force[..., 0])
    ones = np.ones(shape[:2])
    return Recording(
        name='pulled to and fro',
        period=period,
        foot=foot,
        expected_load=load,
        settings=(foot, load, tuning_for(scene)),
        stamps=stamps,
        force=force + scene.sensors.force * generator.normal(size=shape),
        position=position + noise,
        noise=noise,
        pressure=0.0 * ones,
        arrived=ones > 0.0,
        load=load * ones,
        tangential=tangential,
        grip=friction * load * ones,
        place=np.zeros((*shape[:2], 2)),
        wet=ones < 0.0,
        sticks_only=True,
    )


def full() -> str:
    """Return the fidelity level of the walks: L2 if MuJoCo is installed, else L1."""
    return 'L2' if importlib.util.find_spec('mujoco') else 'L1'


World = Callable[[Scene], Scene]


def recordings(count: int | None = None) -> list[Recording]:
    """Return the walks for the comparison of methods, or those on the first floors.

    On patches, and, with simpler physics, on dry ground where nothing slips.
    """
    found = []
    for seed in SEEDS[:count]:
        for robot in ROBOTS:
            scene = replace(Scene.load(f'{robot}_patches'), cycles=CYCLES)
            found += [record(scene, policy, seed, full()) for policy in POLICIES]
        dry = replace(Scene.load('hexapod_smooth_dry_flat'), cycles=CYCLES)
        found += sticking(dry, seed)
    return found


def sticking(scene: Scene, seed: int) -> list[Recording]:
    """Return a walk on dry ground in which no foot slips, and feet that are pulled to and fro."""
    return [record(scene, 'flat', seed, 'L1'), pull(scene, 2.0 * scene.cycles, seed)]


def few_recordings(world: World | None = None, count: int | None = None) -> list[Recording]:
    """Return the walks for the tests of the estimator under many conditions, or the first ones.

    ``world`` changes their scenes.
    """
    return _ordinary_walks(count) if world is None else _few(world, count)


@functools.cache
def _ordinary_walks(count: int | None) -> list[Recording]:
    return _few(None, count)


def _few(world: World | None, count: int | None) -> list[Recording]:
    change = world or (lambda scene: scene)
    patches, dry = (
        change(replace(Scene.load(f'hexapod_{name}'), cycles=FEW_CYCLES))
        for name in ('patches', 'smooth_dry_flat')
    )
    plan = [('flat', SEEDS[0]), ('dome', SEEDS[1]), *(('adaptive', seed) for seed in SEEDS)]
    walks = [record(patches, policy, seed, full()) for policy, seed in plan[:count]]
    return walks + sticking(dry, SEEDS[0])
