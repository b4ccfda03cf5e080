# SPDX-License-Identifier: Apache-2.0
"""Walks of the hexapod, and all methods of simulating them."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ros_pad.control.morphology import MorphologyController
from ros_pad.control.policies import DOME, FLAT, policy_named
from ros_pad.simulation.full_robot import FullRobot
from ros_pad.simulation.mujoco_model import LONGEST, RECOMMENDED, SolverSettings
from ros_pad.simulation.planar_robot import PlanarRobot
from ros_pad.simulation.scene import Scene
from studies.work_precision.walk.drake import DrakeRobot
from studies.work_precision.walk.unlanded import stock, unlanded
from studies.work_precision.walk.walkers import (
    CYCLES,
    HEXAPOD,
    Walk,
    Walked,
    Walker,
    named,
    walked,
)

SETTLE = 0.2  # s: the hexapod stands for this time first
SAMPLE = 4e-3  # s: time between set-points of the servos of L2
TOP_STEP = 2.5e-4  # s
MUJOCO_DEFAULTS = SolverSettings(integrator='Euler', cone='pyramidal', impratio=1.0)


def hexapod_walks() -> list[Walk]:
    """Return the walks: where feet stick, where they slip, and with a heavy load in tow."""
    heavy = Scene.load('hexapod_patches')
    heavy = replace(heavy, floor=replace(heavy.floor, kind='dry'))
    shipped = {
        'dry, flat': ('smooth_dry_flat', FLAT, 0),
        'rough dry, flat': ('rough_dry_flat', FLAT, 0),
        'wet, dome': ('smooth_wet_dome', DOME, 0),
        'rough wet, dome': ('rough_wet_dome', DOME, 0),
        'wet, flat': ('smooth_wet_flat', FLAT, 0),
        'wet, flat, other floor': ('smooth_wet_flat', FLAT, 1),
        'rough wet, flat': ('rough_wet_flat', FLAT, 0),
        'patches, 9 N in tow, dome': ('patches', DOME, 0),
        'patches, 9 N in tow, flat': ('patches', FLAT, 0),
    }
    walks = [
        _hexapod_walk(name, Scene.load(f'hexapod_{scene}'), shape, seed)
        for name, (scene, shape, seed) in shipped.items()
    ]
    stiff = Scene.load('hexapod_smooth_wet_dome')
    body: Any = stiff.body
    servo = replace(body.robot.servo, stiffness=10.0 * body.robot.servo.stiffness)
    stiff = replace(stiff, body=replace(body, robot=replace(body.robot, servo=servo)))
    others = {'dry, 9 N in tow, dome': heavy, 'wet, dome, stiff servos': stiff}
    return walks + [_hexapod_walk(name, scene, DOME, 0) for name, scene in others.items()]


def _hexapod_walk(name: str, scene: Scene, shape: str, seed: int) -> Walk:
    controller = MorphologyController(
        scene.foot,
        scene.legs,
        policy_named(shape),
        scene.expected_load,
        start=shape,
        fixed_pressure=scene.dome_pressure,
    )
    scene = replace(scene, settle=SETTLE, cycles=CYCLES[HEXAPOD])
    return Walk(name, scene, controller.setpoint(1), seed)


def hexapod_walkers() -> tuple[list[Walker], tuple[str, ...], str]:
    """Return the available walkers, and the names of the references and the baseline of times."""
    walkers = []
    forms = {'L1': False} | ({'L1, compiled': True} if importlib.util.find_spec('numba') else {})
    for family, compiled in forms.items():
        walkers += [_planar(family, step, compiled) for step in (1e-3, 4e-3, 1e-2)]
    if not importlib.util.find_spec('mujoco'):
        top = _planar('L1', TOP_STEP, False)
        return [*walkers, top], (top.name,), named('L1', SAMPLE)
    steps = (5e-4, 1e-3, 2e-3, 4e-3)
    walkers += [_full('L2', replace(RECOMMENDED, timestep=step)) for step in steps]
    walkers += [
        stock(_full('MuJoCo defaults', replace(MUJOCO_DEFAULTS, timestep=step), ours=False))
        for step in (5e-4, 2e-3)
    ]
    # With MuJoCo's own contact feet creep as little at impratio 100.
    plain = [_full('L2', SolverSettings(step, impratio=100.0)) for step in (1e-3, 2e-3, 4e-3)]
    walkers += [unlanded(walker) for walker in (_planar('L1', SAMPLE, False), *plain)]
    baseline = named('L2', LONGEST)
    if importlib.util.find_spec('pydrake'):
        tops: tuple[Walker, ...] = _drake(1e-4), _full('L2', replace(RECOMMENDED, timestep=1e-4))
        others = [_drake(step) for step in (2e-4, 4e-4)]
    else:
        # The finer one shows the uncertainty of the reference.
        tops = (_full('L2', replace(RECOMMENDED, timestep=TOP_STEP)),)
        others = [_full('L2', replace(RECOMMENDED, timestep=TOP_STEP / 2.0))]
    return [*walkers, *others, *tops], tuple(top.name for top in tops), baseline


DRAKE = 'Drake'


def _planar(family: str, step: float, compiled: bool) -> Walker:
    def walk(case: Walk) -> Walked:
        floor = case.scene.floor.build(case.seed)
        robot = PlanarRobot(case.scene, floor, step, compiled)
        pressures, count = [case.pressure] * len(robot.legs), round(case.scene.duration / step)
        start = time.process_time()
        for _ in range(count):
            robot.step(pressures)
        return walked(robot, case.scene, count, time.process_time() - start)

    return Walker(family, named(family, step), step, walk)


def _full(family: str, settings: SolverSettings, ours: bool = True) -> Walker:
    def make(case: Walk) -> FullRobot:
        return FullRobot(case.scene, case.scene.floor.build(case.seed), SAMPLE, settings)

    return _sampled(family, settings.timestep or LONGEST, make, ours)


def _drake(step: float) -> Walker:
    def make(case: Walk) -> DrakeRobot:
        floor = case.scene.floor.build(case.seed)
        return DrakeRobot(case.scene, floor, SAMPLE, step, case.pressure)

    return _sampled(DRAKE, step, make, False)


def _sampled(family: str, step: float, make: Callable[[Walk], Any], ours: bool) -> Walker:
    """Return a walker with servos, which get a set-point in each sample."""

    def walk(case: Walk) -> Walked:
        robot = make(case)
        pressures, count = [case.pressure] * len(robot.legs), round(case.scene.duration / SAMPLE)
        start = time.process_time()
        for _ in range(count):
            robot.step(pressures)
        taken = time.process_time() - start
        return walked(robot, case.scene, count * round(SAMPLE / step), taken)

    return Walker(family, named(family, step), step, walk, ours)
