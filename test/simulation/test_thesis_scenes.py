# SPDX-License-Identifier: Apache-2.0
"""Simulated walks agree with forces by hand, and with what the thesis reports of walks (5.3).

Walks on smooth floors, and of the leg on its rail (5.2), are in test/studies/thesis.
"""

import math

import numpy as np
import pytest

from ros_pad.trials import run


def test_slipping_leg_advances_as_its_forces_say():
    """By hand: a foot with 0.12 * 2.5 N of friction pushes 0.85 kg against a drag of 0.235 N.

    The body gains speed at (0.30 - 0.235)/0.85 until it is faster than the foot, whose speed is
    (pi S/2T) sin(pi t/T). Then foot and wheels brake, and after lift-off the wheels alone.
    """
    stroke, stance, mass = 0.05, 0.5, 0.85
    grip, drag = 0.30 / mass, 0.235 / mass  # m/s²
    times = np.linspace(0.25, stance, 250001)
    foot = math.pi * stroke / (2.0 * stance) * np.sin(math.pi * times / stance)
    meets = times[np.argmax(foot < (grip - drag) * times)]
    speed, rest = (grip - drag) * meets, stance - meets
    leaves = speed - (grip + drag) * rest
    distance = 0.5 * speed * meets + 0.5 * (speed + leaves) * rest + leaves**2 / (2.0 * drag)
    assert distance == pytest.approx(0.00938, rel=0.01)
    trial = run('leg_wet_flat')
    assert trial.metrics.distance_per_cycle_m == pytest.approx(distance, rel=0.01)


@pytest.mark.parametrize('seed', [0, 1])
def test_walks_on_rough_floors(seed):
    """Thesis 5.3, figures 41 and 42: flat feet on wet ground slip and deviate, domes do not."""
    pytest.importorskip('mujoco')
    walks = [
        run(f'hexapod_rough_{name}', seed=seed, fidelity='L2')
        for name in ('dry_flat', 'wet_flat', 'wet_dome')
    ]
    dry, flat, dome = (walk.metrics for walk in walks)
    assert dry.verdict is flat.verdict is dome.verdict is None
    slips = [each.slip_path_m[1] + each.slip_path_m[4] for each in (dry, flat, dome)]
    assert slips[1] > 3.0 * slips[0]
    assert slips[1] > 2.0 * slips[2]
    assert flat.distance_per_cycle_m < 0.7 * 0.12
    assert dome.distance_per_cycle_m == pytest.approx(dry.distance_per_cycle_m, rel=0.03)
    bends = [np.abs(walk.body[:, 1]).max() / walk.body[-1, 0] for walk in walks]
    assert bends[1] > 0.02 and bends[1] > 4.0 * bends[2]
    assert max(dome.overload_s) < 0.15 * dome.duration_s
