# SPDX-License-Identifier: Apache-2.0
import math
import re
from itertools import pairwise

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64

from ros_pad.control.stage import DecisionStage
from ros_pad.nodes import topics
from ros_pad.nodes.controller import ControllerNode
from ros_pad.nodes.stamps import nanoseconds
from ros_pad.nodes.stamps import set_stamp

AMBIENT = 101325.0
LOAD = 6.83
LEGS = (1, 2)
INPUTS = (topics.CONTACT_LOAD, topics.CONTACT_POSITION, topics.WETNESS)
TIME_NS = 5_000_000_000


class Robot:
    """Publishes loads, positions, estimates and clock; records set-points and morphologies."""

    def __init__(self, context, executor, until):
        self.node = Node('robot', context=context)
        executor.add_node(self.node)
        self._context, self._executor, self.until = context, executor, until
        self.inputs = {t.name(leg): t.publisher(self.node, leg) for leg in LEGS for t in INPUTS}
        self._clock = topics.CLOCK.publisher(self.node)
        self.setpoints = {leg: [] for leg in LEGS}
        self.shapes = {leg: [] for leg in LEGS}
        for leg in LEGS:
            topics.PRESSURE_SETPOINT.subscription(self.node, self.setpoints[leg].append, leg)
            topics.MORPHOLOGY.subscription(
                self.node, lambda m, leg=leg: self.shapes[leg].append(m.data), leg
            )
        self.diagnostics = []
        topics.DIAGNOSTICS.subscription(self.node, self.diagnostics.append)
        self.controller = None
        self.taken = {'load': 0, 'position': 0}  # number of values that the stages have received
        self.position = 0.0
        self.time_ns = TIME_NS

    def start(self, **parameters):
        parameters = {'legs': list(LEGS), 'use_sim_time': True, **parameters}
        self.controller = ControllerNode(
            context=self._context,
            parameter_overrides=[Parameter(name, value=v) for name, v in parameters.items()],
        )
        self._executor.add_node(self.controller)
        self.until(
            lambda: (
                all(p.get_subscription_count() for p in (*self.inputs.values(), self._clock))
                and all(
                    self.node.count_publishers(topic.name(leg))
                    for topic in (topics.PRESSURE_SETPOINT, topics.MORPHOLOGY)
                    for leg in LEGS
                )
            )
        )
        self.tick(0)
        return self.controller

    def tick(self, milliseconds=20):
        """Advance simulated time, ms, and wait until the controller has received it."""
        self.time_ns += milliseconds * 1_000_000
        message = topics.CLOCK.message()
        set_stamp(message.clock, self.time_ns)
        self._clock.publish(message)
        self.until(lambda: self.controller.get_clock().now().nanoseconds == self.time_ns)

    def sense(self, load, position=None, leg=1, seen=True):
        """Publish load and, if ``seen``, position of a leg, and wait for the controller."""
        before = dict(self.taken)
        point = PointStamped()
        point.point.x = self.position if position is None else position
        if seen:
            self.inputs[topics.CONTACT_POSITION.name(leg)].publish(point)
        self.inputs[topics.CONTACT_LOAD.name(leg)].publish(Float64(data=load))
        self.until(lambda: self.taken['load'] > before['load'], what='the load')
        if seen:
            self.until(lambda: self.taken['position'] > before['position'], what='the position')

    def estimate(self, wet, leg=1):
        """Publish an estimate of wetness; return the set-point that follows."""
        count = len(self.setpoints[leg])
        self.inputs[topics.WETNESS.name(leg)].publish(Float64(data=wet))
        self.until(lambda: len(self.setpoints[leg]) > count, what='a set-point')
        return self.setpoints[leg][-1]

    def unanswered(self, wet, leg=1):
        """Publish an estimate and check that no set-point follows.

        A later estimate of another leg is answered, so the first one was processed.
        """
        count = len(self.setpoints[leg])
        self.inputs[topics.WETNESS.name(leg)].publish(Float64(data=wet))
        other = 3 - leg
        self.sense(LOAD, leg=other)
        self.estimate(0.5, leg=other)
        assert len(self.setpoints[leg]) == count

    def step(self, wet, leg=1):
        """Make a stance and a swing; return the set-point in the swing, Pa gauge."""
        self.position += 0.08
        self.sense(LOAD, leg=leg)
        self.estimate(wet, leg)
        self.sense(0.0, leg=leg)
        return self.estimate(wet, leg).fluid_pressure - AMBIENT


@pytest.fixture
def robot(context, executor, until, monkeypatch):
    robot = Robot(context, executor, until)

    def count(name):
        method = getattr(DecisionStage, name)

        def counted(stage, *values):
            method(stage, *values)
            robot.taken[name] += 1

        monkeypatch.setattr(DecisionStage, name, counted)

    for name in robot.taken:
        count(name)
    return robot


def test_every_estimate_is_answered_by_a_setpoint(robot):
    robot.start()
    robot.sense(LOAD)
    for number in range(1, 6):
        setpoint = robot.estimate(0.5)
        assert len(robot.setpoints[1]) == number
        assert setpoint.header.frame_id == 'leg_1_pad'
        assert nanoseconds(setpoint.header.stamp) == TIME_NS
        assert setpoint.fluid_pressure == AMBIENT  # flat; the pressure is absolute
    assert robot.setpoints[2] == []
    robot.sense(LOAD, leg=2)
    assert robot.estimate(0.5, leg=2).header.frame_id == 'leg_2_pad'


def test_when_the_estimates_stop_so_do_the_setpoints(robot):
    robot.start()
    robot.sense(LOAD)
    robot.estimate(0.5)
    for _ in range(50):
        robot.sense(LOAD)
    assert len(robot.setpoints[1]) == 1


def test_without_sensors_there_is_no_setpoint(robot):
    robot.start()
    robot.unanswered(0.9)
    assert robot.setpoints[1] == [] and robot.setpoints[2]


def test_dome_on_wet_ground_and_flat_again_on_dry(robot):
    robot.start(policy='adaptive')
    shapes = []
    for wet in 8 * [0.98] + 20 * [0.02]:
        gauge = robot.step(wet)
        shapes.append('dome' if gauge > 0.0 else 'flat')
    assert 'dome' in shapes[:8]
    assert shapes[7] == 'dome'
    assert shapes[-1] == 'flat'
    assert robot.shapes[1][0] == 'flat'
    assert 'dome' in robot.shapes[1]
    # The topic is latched, so a morphology is published once for each change.
    assert all(old != new for old, new in pairwise(robot.shapes[1]))


def test_a_heavier_robot_gets_more_pressure(robot):
    gauges = []
    for load in (3.0, LOAD):
        controller = robot.start(policy='dome', expected_load=load)
        robot.sense(LOAD)
        gauges.append(robot.estimate(0.5).fluid_pressure - AMBIENT)
        controller.destroy_node()
    assert 0.0 < gauges[0] < gauges[1] <= 90e3


def test_a_fixed_pressure_is_taken_as_it_is(robot):
    robot.start(policy='dome', dome_pressure=40e3, ambient_pressure=90000.0)
    robot.sense(LOAD)
    assert robot.estimate(0.5).fluid_pressure == 130e3


@pytest.mark.parametrize('policy', ['flat', 'dome'])
def test_the_simple_policies_never_change(robot, policy):
    robot.start(policy=policy)
    for wet in (0.02, 0.98, 0.98, 0.98, 0.02):
        assert (robot.step(wet) > 0.0) is (policy == 'dome')
    assert robot.shapes[1] == [policy]


@pytest.mark.parametrize('ground', ['wet', 'dry'])
def test_the_oracle_sees_the_ground(robot, ground):
    robot.start(policy='oracle', scene=f'hexapod_smooth_{ground}_flat')
    assert (robot.step(0.5) > 0.0) is (ground == 'wet')


def test_the_shape_reaches_who_comes_late(robot, context, executor):
    robot.start(policy='dome')
    robot.sense(LOAD)
    robot.estimate(0.5)
    late = Node('late', context=context)
    executor.add_node(late)
    heard = []
    topics.MORPHOLOGY.subscription(late, lambda message: heard.append(message.data), 1)
    robot.until(lambda: heard, what='the latched shape')
    assert heard == ['dome']


LOST = {
    'all': {},
    'estimate': {'load': LOAD},
    'position': {'load': LOAD, 'wet': 0.98, 'seen': False},
    'load': {'load': math.nan, 'wet': 0.98},
    'wetness': {'load': LOAD, 'wet': math.nan},
}


@pytest.mark.parametrize('case', LOST)
def test_a_leg_without_estimates_is_flat_and_reported_within_a_second(robot, case):
    """Set-points of the leg stop, so that its regulator vents; the other leg goes on."""
    given = LOST[case]
    robot.start(policy='dome')

    def step():
        robot.tick()
        robot.sense(LOAD, leg=2)
        robot.estimate(0.5, leg=2)

    for _ in range(5):
        step()
        robot.sense(LOAD)
        assert robot.estimate(0.5).fluid_pressure > AMBIENT
    lost_ns, count = robot.time_ns, len(robot.setpoints[1])
    while robot.controller.controller.fault(1) == '':
        assert robot.time_ns < lost_ns + 800_000_000
        step()
        if 'load' in given:
            robot.sense(given['load'], seen=given.get('seen', True))
        if 'wet' in given:
            robot.inputs[topics.WETNESS.name(1)].publish(Float64(data=given['wet']))

    def errors():
        return [
            (nanoseconds(array.header.stamp), status.message)
            for array in robot.diagnostics
            for status in array.status
            if status.name == 'controller: leg 1 pad' and status.level == DiagnosticStatus.ERROR
        ]

    while not errors():
        assert robot.time_ns < lost_ns + 1_000_000_000
        step()
    assert errors()[0][0] <= lost_ns + 900_000_000
    assert re.search(r'estimate for 0\.\d s', errors()[0][1])
    assert robot.shapes[1][-1] == 'flat'
    assert robot.shapes[2] == ['dome']
    # The last position of a marker is used for 0.2 s.
    assert len(robot.setpoints[1]) - count <= (10 if case == 'position' else 0)
    assert robot.setpoints[2][-1].fluid_pressure > AMBIENT
    # With new samples the foot steps again.
    for _ in range(2):
        robot.tick()
        robot.sense(LOAD)
        robot.estimate(0.5)
    assert robot.controller.controller.fault(1) == ''
    assert robot.step(0.5) > 0.0


BAD = {
    'load': ((math.nan, 0.0), 0.98),
    'infinite load': ((-math.inf, 0.0), 0.98),
    'position': ((LOAD, math.nan), 0.98),
    'wetness': ((LOAD, 0.0), math.nan),
}


@pytest.mark.parametrize('case', BAD)
def test_values_that_are_not_finite_move_no_foot(robot, case):
    """Such a value must not count as lift-off: a foot must not switch while it stands."""
    (load, position), wet = BAD[case]
    robot.start()
    for _ in range(3):
        robot.step(0.5)
    robot.sense(LOAD)
    before = robot.estimate(0.98).fluid_pressure
    switches = dict(robot.controller.controller.switches)
    robot.sense(load, position)
    robot.unanswered(wet)  # if this lasts, the regulator vents
    robot.sense(LOAD)
    assert robot.estimate(0.98).fluid_pressure == before
    assert robot.controller.controller.switches == switches
    assert robot.shapes[1] == ['flat']


def test_one_infinite_load_among_good_ones_is_passed_over(robot):
    """As from a loose cable: the node goes on with the largest of the finite loads."""
    robot.start()
    robot.sense(LOAD)
    robot.sense(math.inf)
    robot.sense(math.nan)
    robot.sense(0.5 * LOAD)
    assert robot.estimate(0.5).fluid_pressure == AMBIENT


def test_a_foot_that_bounces_has_not_stepped(robot):
    """The foot has no load when an estimate arrives, but had load since the previous one."""
    robot.start(policy='adaptive')
    for _ in range(10):
        robot.sense(LOAD)
        robot.sense(0.0)
        assert robot.estimate(0.98).fluid_pressure == AMBIENT
    shapes = [robot.step(0.98) for _ in range(4)]
    assert shapes[-1] > 30e3
