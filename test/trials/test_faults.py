# SPDX-License-Identifier: Apache-2.0
"""Whole walks without ROS, with faults of pads and without."""

import dataclasses
import json
import math
import re
import types

import numpy as np
import pytest

from ros_pad.simulation.faults import Fault
from ros_pad.simulation.scene import Scene
from ros_pad.trials import run
from ros_pad.trials.loop import ClosedLoop
from ros_pad.trials.sweep.table import columns_of
from ros_pad.trials.trial import fault_lines

PATCHES = Scene.load('hexapod_patches')
WALKS = (
    'hexapod_patches', 'hexapod_smooth_dry_flat', 'hexapod_smooth_wet_dome',
    'hexapod_smooth_wet_flat', 'hexapod_rough_dry_flat', 'hexapod_rough_wet_dome',
    'hexapod_rough_wet_flat', 'leg_dry_flat', 'leg_wet_dome_40', 'leg_wet_dome_60',
    'leg_wet_dome_75', 'leg_wet_flat',
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize('number', range(len(WALKS)))
def test_sound_pads_are_never_accused(number):
    scene = dataclasses.replace(Scene.load(WALKS[number]), cycles=4)
    policy = ('adaptive', 'oracle', 'dome')[number % 3]
    trial = run(scene, policy, number, 'L1' if scene.robot != 'rail_leg' else 'L0')
    assert trial.metrics.faults == []
    assert sum(trial.metrics.underpressure) == 0


@pytest.mark.parametrize('conductance', [7.7e-11, 3.32e-11])
def test_slow_hoses_are_remarked_on_and_no_fault(conductance):
    """Pads fill to 90 % in 0.57 and 1.25 s; a swing takes 0.4 s."""
    regulator = {'hose_diameter': 2e-3, 'hose_length': 1.0, 'hose_conductance': conductance}
    scene = dataclasses.replace(PATCHES, cycles=15, regulator=regulator)
    trial = run(scene, 'adaptive', seed=1, fidelity='L1')
    assert trial.slow['dome'].any()
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
@pytest.mark.slow
def test_a_walk_goes_on_with_a_fault(case, sound):
    """On wet ground one flat foot slips, but the robot walks on with a small loss."""
    scene = dataclasses.replace(WET, faults=(Fault.parse(FAULTS[case]),))
    trial = run(scene, 'adaptive', seed=3, fidelity='L1')
    metrics = trial.metrics
    assert metrics.verdict is None
    accused = {fault['leg'] for fault in metrics.faults}
    assert accused == ({1, 2, 3, 4, 5, 6} if case == 'supply lost' else {2})
    if case != 'supply lost':
        assert metrics.distance_m > 0.8 * sound.metrics.distance_m
        others = [0, 2, 3, 4, 5]
        # Other legs switch as without the fault, except for probes in place of leg 2.
        change = np.subtract(metrics.switches, sound.metrics.switches)[others]
        assert abs(change).max() <= 4
        assert trial.slow['dome'][-1, others].sum() >= 4
    assert json.loads(json.dumps(metrics.as_dict()))['faults'] == metrics.faults
    assert columns_of(trial)['faults'] == '; '.join(fault_lines(metrics.faults))


def test_a_foot_whose_position_is_no_number_is_vented_like_on_nodes(monkeypatch):
    """Nodes send no set-point for such a foot, and after half a second the regulator vents."""
    loop = ClosedLoop(dataclasses.replace(PATCHES, cycles=3), 'dome', 0, 'L1')
    sample = loop.sensors.sample

    def blinded(robot):
        rows = sample(robot)
        if robot.time > 1.5:
            rows['position'][1] = math.nan
        return rows

    monkeypatch.setattr(loop.sensors, 'sample', blinded)
    for _ in range(round(1.96 / 0.004)):
        loop.tick()
    assert loop.pads[1] > 60e3
    for _ in range(round(0.4 / 0.004)):
        loop.tick()
    assert loop.pads[1] == 0.0
    assert loop.pads[0] > 60e3
    assert re.search('estimate for 0.5 s; marker lost', loop.controller.fault(2))
    assert loop.controller.morphology(2) == 'flat'
    assert loop.controller.fault(1) == ''


def test_pads_are_vented_when_commands_stop():
    loop = ClosedLoop(dataclasses.replace(PATCHES, cycles=3), 'dome', 0, 'L1')
    for _ in range(375):
        loop.tick()
    assert min(loop.pads) > 60e3
    loop.pipeline = types.SimpleNamespace(process=lambda samples: (), tick=lambda now_ns: None)
    for _ in range(250):
        loop.tick()
    now_ns = 625 * loop.period_ns
    assert max(loop.supervision.read(now_ns, now_ns).rows[0]['pad']) < 1e3
    loop.close()
