# SPDX-License-Identifier: Apache-2.0
"""The controller node: each estimate record is answered by a command record."""

import math
import re

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import LOAD, MS, estimate, pressure

from ros_pad.bags import topics
from ros_pad.nodes.controller import ControllerNode

START_NS = 5_000 * MS


class Robot:
    """A controller node on a bench, and estimates for it, one every 20 ms."""

    def __init__(self, bench):
        self.bench = bench
        self.x = 0.0

    def start(self, **parameters):
        self.now_ns = START_NS
        self.node = self.bench.start(ControllerNode, **parameters)
        return self.node

    def estimate(self, **fields):
        """Send an estimate, 20 ms after the last one; return the rows of the command."""
        self.now_ns += 20 * MS
        fields = {'position': (self.x, 0.0)} | fields
        self.bench.give(topics.ESTIMATE, estimate(self.now_ns, **fields))
        block = self.bench.heard(topics.COMMAND)[-1]
        assert block.last_ns == self.now_ns
        return block.rows[-1]

    def step(self, wetness):
        """Make a stance and a swing; return the set-points in the swing."""
        self.x += 0.08
        ground = {'wetness': wetness, 'friction': 0.9 - 0.6 * wetness}
        self.estimate(**ground)
        return self.estimate(**ground, load=0.0)['setpoint']

    def errors(self, leg=1):
        return [
            (at, each.message)
            for at, each in self.bench.statuses(f'leg {leg} pad')
            if each.level == DiagnosticStatus.ERROR
        ]


@pytest.fixture
def robot(bench):
    return Robot(bench)


def test_every_estimate_is_answered_by_a_command(robot):
    robot.start()
    for number in range(1, 6):
        assert robot.estimate().tolist() == [(0.0, 0.0), (0.0, 0.0)]  # flat, gauge pressure
        assert len(robot.bench.heard(topics.COMMAND)) == number


def test_when_the_estimates_stop_so_do_the_commands(robot):
    robot.start(policy='dome')
    assert robot.estimate()['setpoint'].min() > 0.0
    count = len(robot.bench.heard(topics.COMMAND))
    robot.bench.now_ns = robot.now_ns
    robot.bench.tick(2.0)
    later = robot.bench.heard(topics.COMMAND)[count:]
    # Only the morphology is told: the feet are flat, because regulators vent them.
    assert all(np.isnan(each.rows['setpoint']).all() for each in later)
    assert later[-1].rows['dome'].tolist() == [[0.0, 0.0]]
    assert len(later) <= 2


def test_dome_on_wet_ground_and_flat_again_on_dry(robot):
    robot.start(policy='adaptive')
    shapes = [robot.step(wet)[0] > 0.0 for wet in 8 * [0.98] + 20 * [0.02]]
    assert shapes[7] and not shapes[-1]
    domes = [each.rows['dome'][0, 0] for each in robot.bench.heard(topics.COMMAND)]
    assert (domes[0], max(domes), domes[-1]) == (0.0, 1.0, 0.0)


def test_a_changed_policy_decides_from_then_on(robot):
    robot.start(policy='adaptive')
    assert robot.bench.set('policy.wet_above', 1.0).successful
    assert not any(robot.step(0.98)[0] > 0.0 for _ in range(8))


def test_a_fixed_pressure_is_taken_as_it_is(robot):
    robot.start(policy='dome', dome_pressure=40e3)
    assert robot.estimate().tolist() == [(1.0, 40e3), (1.0, 40e3)]


@pytest.mark.parametrize('ground', ['wet', 'dry'])
def test_the_oracle_sees_the_ground(robot, ground):
    robot.start(policy='oracle', scene=f'hexapod_smooth_{ground}_flat')
    assert (robot.step(0.5)[0] > 0.0) == (ground == 'wet')


LOST = {
    'position': {'position': [(math.nan, math.nan), (0.0, 0.0)]},
    'load': {'load': [math.inf, LOAD]},
    'wetness': {'wetness': [1.5, 0.5], 'doubt': [math.nan, 0.0]},
}


@pytest.mark.parametrize('case', LOST)
def test_a_row_that_lacks_something_concerns_its_leg_only(robot, case):
    """It gets no set-point, so that its pad is vented, and is reported within a second."""
    node = robot.start(policy='dome')
    for _ in range(5):
        assert robot.estimate()['setpoint'].min() > 0.0
    lost_ns, given = robot.now_ns, 0
    while not node.controller.fault(1):
        assert robot.now_ns < lost_ns + 800 * MS
        setpoint, other = robot.estimate(**LOST[case])['setpoint']
        given += not math.isnan(setpoint)
        assert other > 0.0
    while not robot.errors():
        assert robot.now_ns < lost_ns + 1_000 * MS
        dome, other = robot.estimate(**LOST[case])['dome']
    assert (dome, other) == (0.0, 1.0)
    # The last position of a marker is used for 0.2 s, the last finite load until the decision.
    assert given <= (10 if case == 'position' else 0)
    (at, text), *_ = robot.errors()
    assert at <= lost_ns * 1e-9 + 0.9
    assert re.search(r'estimate for 0\.\d s', text)
    assert not robot.errors(2)
    for _ in range(2):  # with new estimates the foot steps again
        robot.estimate()
    assert not node.controller.fault(1)
    assert (robot.step(0.5) > 0.0).all()


def test_a_pressure_that_does_not_follow_is_a_fault_of_its_leg(robot):
    robot.start(policy='dome', dome_pressure=60e3)
    for _ in range(100):
        robot.estimate()
        robot.bench.give(topics.PRESSURE, pressure(robot.now_ns, (0.0, 60e3)))
    assert robot.errors()[0][1].startswith('does not fill: 0.0 kPa')
    assert not robot.errors(2)
    assert robot.estimate()['dome'].tolist() == [0.0, 1.0]
