# SPDX-License-Identifier: Apache-2.0
"""Whole walks without ROS whose pads fail, and such whose pads do not."""

import dataclasses
import json

import numpy as np
import pytest

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import run
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.sweep import columns_of
from ros_pad.trials.trial import told

PATCHES = Scene.load('hexapod_patches')
WALKS = (
    'hexapod_patches', 'hexapod_smooth_dry_flat', 'hexapod_smooth_wet_dome',
    'hexapod_smooth_wet_flat', 'hexapod_rough_dry_flat', 'hexapod_rough_wet_dome',
    'hexapod_rough_wet_flat', 'leg_dry_flat', 'leg_wet_dome_40', 'leg_wet_dome_60',
    'leg_wet_dome_75', 'leg_wet_flat',
)  # fmt: skip


@pytest.mark.parametrize('number', range(len(WALKS)))
def test_sound_pads_are_never_accused(number):
    scene = dataclasses.replace(Scene.load(WALKS[number]), cycles=4)
    policy = ('adaptive', 'oracle', 'dome')[number % 3]
    trial = run(scene, policy, number, 'L1' if scene.robot == 'hexapod' else 'L0')
    assert trial.metrics.faults == []
    assert sum(trial.metrics.underpressure) == 0


@pytest.mark.parametrize('conductance', [7.7e-11, 3.32e-11])
def test_slow_hoses_are_not_accused_but_told_of(conductance):
    """Full to 90 % in 0.57 and 1.25 s, where a swing takes 0.4 s."""
    regulator = {'hose_diameter': 2e-3, 'hose_length': 1.0, 'hose_conductance': conductance}
    scene = dataclasses.replace(PATCHES, cycles=15, regulator=regulator)
    trial = run(scene, 'adaptive', seed=1, fidelity='L1')
    assert trial.dome.any()
    assert trial.metrics.faults == []
    assert sum(trial.metrics.underpressure) > 0


FAULTS = {
    'stuck flat': '{kind: stuck_valve, legs: [2]}',
    'stuck domed': '{kind: stuck_valve, legs: [2], start: 3.0}',
    'leak': '{kind: leak, legs: [2], start: 3.0, conductance: 1.0e-8}',
    'silent': '{kind: silence, legs: [2], start: 3.0}',
    'supply lost': '{kind: supply_loss, start: 3.0}',
}
WET = dataclasses.replace(PATCHES, cycles=9, floor=dataclasses.replace(PATCHES.floor, kind='wet'))


@pytest.fixture(scope='module')
def sound():
    return run(WET, 'adaptive', seed=3, fidelity='L1')


@pytest.mark.parametrize('case', FAULTS)
def test_a_walk_goes_on_with_a_fault(case, sound):
    """On wet ground, where flat feet slip: without the air of one foot little is lost."""
    scene = dataclasses.replace(WET, faults=(Fault.parse(FAULTS[case]),))
    trial = run(scene, 'adaptive', seed=3, fidelity='L1')
    metrics = trial.metrics
    assert metrics.verdict is None
    accused = {fault['leg'] for fault in metrics.faults}
    assert accused == ({1, 2, 3, 4, 5, 6} if case == 'supply lost' else {2})
    if case != 'supply lost':
        assert metrics.distance_m > 0.8 * sound.metrics.distance_m
        others = [0, 2, 3, 4, 5]
        # The others switch as before; one of them probes where leg 2 would have.
        change = np.subtract(metrics.switches, sound.metrics.switches)[others]
        assert abs(change).max() <= 4
        assert trial.dome[-1, others].sum() >= 4
    assert json.loads(trial.to_json())['metrics']['faults'] == metrics.faults
    assert columns_of(trial)['faults'] == '; '.join(told(metrics.faults))


def test_a_foot_whose_position_is_no_number_is_vented_like_on_nodes(monkeypatch):
    """The nodes send no set-point then; after half a second the regulator vents."""
    loop = ClosedLoop(dataclasses.replace(PATCHES, cycles=3), 'dome', 0, 'L1')

    class Log:
        def sample(self, *_):
            pass

        def control(self, *_):
            pass

    read = loop.sensors.read

    def blinded(robot):
        readings = read(robot)
        if robot.time > 1.5:
            force, _ = readings[1]
            readings[1] = (force, (float('nan'),) * 3)
        return readings

    monkeypatch.setattr(loop.sensors, 'read', blinded)
    last = loop.estimators[1].estimate

    def update(*arguments, update=loop.estimators[1].update):
        nonlocal last
        if np.isfinite(arguments[2]).all():
            last = update(*arguments)
        return last

    monkeypatch.setattr(loop.estimators[1], 'update', update)
    for _ in range(round(1.96 / 0.004)):
        loop.tick(Log())
    assert loop.pads[1] > 60e3
    for _ in range(round(0.4 / 0.004)):
        loop.tick(Log())
    assert loop.pads[1] == 0.0
    assert loop.pads[0] > 60e3
    assert loop.controller.fault(2) == 'no load, position or estimate for 0.5 s'
    assert loop.controller.morphology(2) == 'flat'
    assert loop.controller.fault(1) == ''
