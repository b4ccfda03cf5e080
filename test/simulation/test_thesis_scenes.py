# SPDX-License-Identifier: Apache-2.0
"""Simulated walks agree with what the thesis reports of its walks (5.2 and 5.3)."""

import math

import numpy as np
import pytest

from ros_pad.trials import run

LEG_SCENES = (
    'leg_dry_flat',
    'leg_wet_flat',
    'leg_wet_dome_40',
    'leg_wet_dome_60',
    'leg_wet_dome_75',
)
SEEDS = (0, 1, 2)


def time_to_goal(name: str, seed: int = 0) -> float:
    """Return the time, s, that the body needs to the end of the rail."""
    metrics = run(name, seed=seed).metrics
    assert metrics.time_to_goal_s is not None, f'{name} did not reach {metrics.goal_m} m'
    return metrics.time_to_goal_s


@pytest.fixture(scope='module')
def goal_times():
    # With a fixed morphology on a uniform floor the seed changes sensor noise only.
    return {name: time_to_goal(name) for name in LEG_SCENES}


@pytest.mark.slow
def test_flat_on_wet_ground_takes_about_five_times_as_long(goal_times):
    """Thesis 5.2: "approximately five times longer than in case 5"."""
    assert 4.0 < goal_times['leg_wet_flat'] / goal_times['leg_wet_dome_75'] < 6.0


@pytest.mark.slow
def test_higher_pressure_walks_faster(goal_times):
    """Thesis 5.2: "higher pressure notably improved walking performance"."""
    times = [goal_times[f'leg_wet_dome_{pressure}'] for pressure in (40, 60, 75)]
    assert times[0] > 1.5 * times[1]
    assert times[1] > 1.1 * times[2]
    assert times[0] <= goal_times['leg_wet_flat']


@pytest.mark.slow
def test_dome_on_wet_ground_is_quite_similar_to_flat_on_dry_ground(goal_times):
    """Thesis 5.2: cases 1 and 5 "were quite similar"."""
    assert 1.0 <= goal_times['leg_wet_dome_75'] / goal_times['leg_dry_flat'] < 1.15


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


NAMES = ('dry_flat', 'wet_flat', 'wet_dome')


@pytest.fixture(scope='module')
def walks():
    """Return walks on three rough floors, with joints and servos (L2), by scene."""
    pytest.importorskip('mujoco')
    return {
        name: [run(f'hexapod_rough_{name}', seed=seed, fidelity='L2') for seed in SEEDS]
        for name in NAMES
    }


def middle_slip(walks, name):
    """Return the mean slip path of legs 2 and 5 in a cycle, m, over all floors."""
    return np.mean([
        (trial.metrics.slip_path_m[1] + trial.metrics.slip_path_m[4]) / 2.0 / trial.metrics.cycles
        for trial in walks[name]
    ])  # fmt: skip


def bend(trial):
    """Return the largest sideways distance over the distance ahead."""
    return np.abs(trial.body[:, 1]).max() / trial.body[-1, 0]


def test_middle_legs_slip_on_wet_ground_and_domes_help(walks):
    """Thesis 5.3, figures 41 and 42: legs 2 and 5 slip with flat pads, much less with domes."""
    assert [trial.metrics.verdict for name in NAMES for trial in walks[name]] == [None] * 9
    assert middle_slip(walks, 'wet_flat') > 3.0 * middle_slip(walks, 'dry_flat')
    assert middle_slip(walks, 'wet_flat') > 2.0 * middle_slip(walks, 'wet_dome')


def test_wet_flat_hexapod_struggles_and_deviates(walks):
    """Thesis 5.3: "struggles to maintain a straight trajectory, leading to deviations"."""
    for trial in walks['wet_flat']:
        assert trial.metrics.distance_per_cycle_m < 0.7 * 0.12
        assert bend(trial) > 0.03


def test_wet_dome_hexapod_is_like_the_dry_one(walks):
    """Thesis 5.3: its "trajectory on wet surfaces closely resembles its performance on dry"."""
    for wet, dry in zip(walks['wet_dome'], walks['dry_flat'], strict=True):
        ahead = dry.metrics.distance_per_cycle_m
        assert wet.metrics.distance_per_cycle_m == pytest.approx(ahead, rel=0.03)
        assert bend(wet) < 0.02
        assert max(wet.metrics.overload_s) < 0.15 * wet.metrics.duration_s
