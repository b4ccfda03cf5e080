# SPDX-License-Identifier: Apache-2.0
"""Turned and mirrored axes of force and position are found in a few stances; right ones never."""

import math

import numpy as np
import pytest

from ros_pad.contact.resistance import Foot
from ros_pad.estimation import SENSOR_FAULTS, FootEstimator, Tuning, doubt
from ros_pad.estimation.axes import BLOCK, TURNS, Axes
from ros_pad.estimation.scales import GRID

FOOT = Foot.load('large37')
LOAD = 6.8  # N
PERIOD = 0.004  # s


def turn(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def swapped(a, b):
    axes = np.eye(3)
    axes[[a, b]] = axes[[b, a]]
    return axes


RIGHT = np.eye(3)
FORCES = [
    (turn(90), 'force axes turned by about 90° about z'),
    (turn(-90), 'force axes turned by about -90° about z'),
    (turn(180), 'about 180°'),
    (np.diag([-1.0, 1.0, 1.0]), 'left-handed, x of force or position'),
    (np.diag([1.0, -1.0, 1.0]), 'left-handed, y of force or position'),
    (swapped(0, 1), 'left-handed, x and y of the force are exchanged'),
    (np.diag([1.0, 1.0, -1.0]), 'the sign of the force is turned'),
    (swapped(0, 2), 'the normal force is along x'),
    (turn(180) @ swapped(0, 2), 'the normal force is along -x'),
    (swapped(1, 2), 'the normal force is along y'),
]
POSITIONS = [
    (turn(90), 'force axes turned by about -90° about z'),
    (turn(180), 'about 180°'),
    (np.diag([-1.0, 1.0, 1.0]), 'left-handed, x of force or position'),
    (np.diag([1.0, 1.0, -1.0]), 'z of the position is turned'),
]


class Walk:
    """A foot that stands for a second and then steps; on the ground it slips, or only shears."""

    def __init__(self, force=RIGHT, position=RIGHT, slip=0.05, ratio=0.2, bias=0.0, tuning=None):
        self.estimator = FootEstimator(FOOT, LOAD, tuning)
        self._axes, self._slip, self._ratio = (force, position), slip, ratio
        self._bias = np.array([bias, -bias, 0.0])
        self._random = np.random.default_rng(1)
        self._contact, self._time, self._last = np.zeros(3), 0.0, np.zeros(3)
        self.kinds = set()
        for _ in range(250):
            self._sample(np.array([0.0, 0.0, LOAD]))

    def _sample(self, force):
        self._time += PERIOD
        marker = self._contact - np.array([*force[:2], 0.0]) / FOOT.shear_stiffness
        force = self._axes[0] @ (force + self._bias) + 0.03 * self._random.normal(size=3)
        marker = self._axes[1] @ marker + 1.5e-4 * self._random.normal(size=3)
        velocity, self._last = (self._contact - self._last) / PERIOD, self._contact.copy()
        estimate = self.estimator.update(
            self._time, force.tolist(), marker.tolist(), 0.0,
            velocity=velocity[:2].tolist(), variance=1e-5,
        )  # fmt: skip
        self.kinds.add(estimate.doubt.partition(':')[0])
        return estimate

    def step(self, heading):
        """Swing, and stand for 0.4 s under a pull along a heading; return the last estimate."""
        for share in np.linspace(0.0, math.pi, 75):
            self._contact[2] = 0.03 * math.sin(share)
            self._sample(np.zeros(3))
        self._contact[2] = 0.0
        ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
        for sample in range(100):
            pull = self._ratio * min(1.0, sample / 25, (99 - sample) / 25)
            if pull == self._ratio:
                self._contact += PERIOD * self._slip * ahead
            estimate = self._sample(LOAD * (np.array([0.0, 0.0, 1.0]) - pull * ahead))
        return estimate


HEADINGS = (0.2, 0.9, -0.6, 1.9)  # rad


@pytest.mark.parametrize(
    ('forces', 'positions', 'words'),
    [(axes, RIGHT, words) for axes, words in FORCES]
    + [(RIGHT, axes, words) for axes, words in POSITIONS],
)
def test_turned_axes_are_in_doubt_after_three_stances_with_the_likely_turn(
    forces, positions, words
):
    walk = Walk(forces, positions)
    for heading in HEADINGS[:3]:
        walk.step(heading)
    estimate = walk.step(HEADINGS[3])
    assert words in estimate.doubt
    assert 'axes' in SENSOR_FAULTS
    assert not estimate.sound and not estimate.slipping and math.isnan(estimate.margin)


@pytest.mark.parametrize('axis', [0, 1])
def test_a_mirrored_force_is_in_doubt_where_joints_show_the_slip(axis):
    mirrored = np.diag(np.where(np.arange(3) == axis, -1.0, 1.0))
    walk = Walk(mirrored, tuning=Tuning(source='joints', pads_shear=False))
    for heading in HEADINGS * 3:
        estimate = walk.step(heading)
    assert f'left-handed, {"xy"[axis]} of force' in estimate.doubt


@pytest.mark.parametrize('bias', [0.0, 1.5])
@pytest.mark.parametrize(('slip', 'ratio'), [(0.0, 0.4), (0.05, 0.15), (0.3, 0.1), (0.02, 0.6)])
def test_right_axes_are_never_in_doubt(slip, ratio, bias):
    walk = Walk(slip=slip, ratio=ratio, bias=bias)
    for heading in (*HEADINGS, *(-each for each in HEADINGS)):
        walk.step(heading)
    assert 'axes' not in walk.kinds


def test_what_was_learnt_is_forgotten_when_axes_turn():
    """A foot slips at T/N = 0.35, less than half of what the contact model expects if dry."""
    walk = Walk(slip=0.2, ratio=0.35)
    prior = walk.estimator.ground.expected
    for step in range(20):
        walk._sample(np.zeros(3))
        walk._contact[0] += 0.14
        walk.step(0.2 + 0.7 * step)
    assert walk.estimator.ground.expected.flat[0] @ GRID < 0.9 * prior.flat[0] @ GRID
    walk._axes = RIGHT, np.diag([1.0, 1.0, -1.0])
    for step in range(3):
        estimate = walk.step(0.7 * step)
    new = FootEstimator(FOOT, LOAD).estimate
    assert estimate.doubt.startswith('axes')
    assert walk.estimator.ground.expected.flat == pytest.approx(prior.flat)
    assert walk.estimator.ground.expected.dome == pytest.approx(prior.dome)
    assert estimate.wet_probability == pytest.approx(new.wet_probability)
    assert estimate.friction_mean == pytest.approx(new.friction_mean, rel=1e-3)


def test_the_doubt_ends_when_the_axes_are_mended():
    walk = Walk(turn(90))
    for heading in HEADINGS:
        walk.step(heading)
    walk._axes = RIGHT, RIGHT
    for heading in HEADINGS * 2:
        estimate = walk.step(heading)
    assert not estimate.doubt.startswith('axes')
    for heading in HEADINGS:  # what is learnt from then on is finite
        estimate = walk.step(heading)
    assert 0.01 < estimate.friction_mean < 2.0 and 0.0 < estimate.wet_probability < 1.0
    scales = walk.estimator.ground.shared.scales
    assert all(math.isfinite(each.scale + each.sd) for each in scales.values())


@pytest.mark.parametrize('turned', range(1, 8))
def test_a_foot_that_sticks_shows_the_turn_by_its_shear(turned):
    """Its position goes back by force over shear stiffness, in whatever direction it is pulled."""
    axes, softness, time = Axes(LOAD, 1e-3), 1e-3, 0.0
    for _ in range(8):
        for step in range(20):
            time += BLOCK
            axes.update(BLOCK, 0.0, (0.0, 0.0, LOAD))
            true = 2.0 * np.array([math.cos(0.7 * step), math.sin(1.1 * step)])
            axes.compare(time, BLOCK, -softness * true, TURNS[turned] @ true, 1e-4)
        axes.update(BLOCK, 0.0, (0.0, 0.0, 0.0))
    assert axes.doubt[:2] == (doubt.TURNED, turned)
