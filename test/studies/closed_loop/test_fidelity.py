# SPDX-License-Identifier: Apache-2.0
"""The bounds in config/fidelity.yaml hold on scenes from which they were not computed."""

import dataclasses

import pytest

from ros_pad.simulation import fidelity
from studies.closed_loop import fidelity as study


def test_table_has_the_ranges_of_the_study():
    assert fidelity.ErrorTable.load().ranges == study.RANGES


@pytest.mark.slow
@pytest.mark.parametrize('robot', ['ch3r', 'rail_leg'])
def test_bounds_hold_on_scenes_that_were_not_measured(robot):
    """The error of each level is within its bound on ten scenes.

    The accuracies of the scenes are such that each level is chosen for some of them.
    """
    pytest.importorskip('mujoco')
    taken = set()
    for seed in range(100000, 100010):
        scene, policy = getattr(study, robot)(seed)
        scene = dataclasses.replace(scene, cycles=4, accuracy=0.15)
        taken.add(fidelity.choose(scene, policy=policy).level)
        levels = ('L1', 'L2') if robot == 'ch3r' else ('L0',)
        top = study.distance(scene, policy, seed, levels[-1], top=True)
        for level in levels:
            choice = fidelity.choose(scene, level, policy)
            here = study.distance(scene, policy, seed, level)
            assert study.apart(scene, here, top) <= choice.bound, (seed, choice.note)
    assert taken == set(levels)
