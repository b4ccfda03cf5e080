# SPDX-License-Identifier: Apache-2.0
"""The merge node: what drivers of others publish by leg becomes records."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TwistWithCovarianceStamped
from helpers import MS, fluid, header, position, wrench

from ros_pad.bags import topics
from ros_pad.errors import ConfigError
from ros_pad.nodes.merge import MergeNode

WRENCH, POSITION, VELOCITY, FOOT_WRENCH, PRESSURE, SETPOINT = topics.FROM_DRIVERS


class Robot:
    """A merge node on a bench; no node but the one named publishes records."""

    def __init__(self, bench, monkeypatch):
        self.bench = bench
        self.others = ()
        monkeypatch.setattr(MergeNode, 'count_publishers', self._count)

    def _count(self, name):
        own = f'/{name}' in self.bench.sent
        return own + (name in self.others)

    def start(self, **parameters):
        return self.bench.start(MergeNode, **parameters)

    def legs(self, stamp_ns, *legs, moment=0.5, frame=''):
        """Send wrench and position of some legs."""
        for leg in legs:
            self.bench.give(WRENCH, wrench(stamp_ns, (0.0, 0.0, leg), moment, frame), leg)
            self.bench.give(POSITION, position(stamp_ns, (leg, 2.0, 3.0)), leg)

    @property
    def samples(self):
        return self.bench.heard(topics.SAMPLE)


@pytest.fixture
def robot(bench, monkeypatch):
    return Robot(bench, monkeypatch)


def test_wrench_and_position_of_all_legs_become_a_sample(robot):
    robot.start()
    for number in range(1, 4):
        robot.legs(4 * MS * number, *((1, 2), (2, 1))[number % 2])
    assert [each.last_ns for each in robot.samples] == [4 * MS, 8 * MS, 12 * MS]
    for block in robot.samples:
        (rows,) = block.rows
        assert rows['force'].tolist() == [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]
        assert rows['position'].tolist() == [[1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]
        assert rows['moment'].tolist() == [0.5, 0.5]
        assert np.isnan(rows['velocity']).all()


def test_a_leg_that_is_missing_is_nan_after_10_ms(robot):
    robot.start()
    robot.bench.clock(100 * MS)
    robot.legs(100 * MS, 2)
    for now_ms, count in ((105, 0), (109, 0), (110, 1)):
        robot.bench.clock(now_ms * MS)
        assert len(robot.samples) == count
    (rows,) = robot.samples[0].rows
    assert np.isnan(rows['force'][0]).all() and np.isnan(rows['position'][0]).all()
    assert rows['force'][1].tolist() == [0.0, 0.0, 2.0]
    robot.legs(100 * MS, 1)  # too late
    robot.legs(104 * MS, 1, 2)
    assert [each.last_ns // MS for each in robot.samples] == [100, 104]


def test_velocities_are_waited_for_where_they_are_needed(robot):
    robot.start(source='joints', topics='wrench, position, contact_velocity')
    robot.legs(4 * MS, 1, 2)
    assert not robot.samples
    for leg, variance in ((1, 1e-4), (2, -1.0)):
        message = TwistWithCovarianceStamped(header=header(4 * MS))
        message.twist.twist.linear.x = 0.1 * leg
        message.twist.covariance[0] = message.twist.covariance[7] = variance
        robot.bench.give(VELOCITY, message, leg)
    rows = robot.bench.last(topics.SAMPLE)
    assert rows['velocity'].tolist() == [[0.1, 0.0], [0.2, 0.0]]
    assert rows['variance'].tolist() == [[1e-4, 1e-4], [math.inf, math.inf]]


def test_foot_wrenches_become_records_of_forces_alone(robot):
    robot.start()
    for leg in (1, 2):
        robot.bench.give(
            FOOT_WRENCH, wrench(8 * MS, (0.1, 0.2, leg), frame=f'leg_{leg}_foot'), leg
        )
    (block,) = robot.bench.heard(topics.FORCE)
    assert block.rows[0]['force'].tolist() == [[0.1, 0.2, 1.0], [0.1, 0.2, 2.0]]
    assert np.isnan(block.rows[0]['moment']).all()
    assert not robot.samples


@pytest.mark.parametrize(
    ('given', 'taken', 'field'),
    [(PRESSURE, topics.PRESSURE, 'pressure'), (SETPOINT, topics.COMMAND, 'setpoint')],
)
def test_each_pressure_of_a_leg_is_a_record_with_this_leg_alone(robot, given, taken, field):
    """Gauge pressure follows from the ambient pressure, without its rounding."""
    robot.start(topics='pressure, pressure_setpoint', ambient_pressure=83210.7)
    for leg, gauge in ((1, 60e3), (2, 70e3), (1, 61e3)):
        message = fluid(4 * MS * leg, gauge)
        message.fluid_pressure += 83210.7 - 101325.0
        robot.bench.give(given, message, leg)
    rows = np.array([each.rows[0][field] for each in robot.bench.heard(taken)])
    assert np.array_equal(
        rows, [[60e3, math.nan], [math.nan, 70e3], [61e3, math.nan]], equal_nan=True
    )


def test_a_frame_of_another_leg_is_refused(robot):
    """Two cables or topics may be swapped."""
    node = robot.start()
    robot.legs(4 * MS, 1, frame='leg_2_sole')
    robot.legs(4 * MS, 2, frame='robot/leg_2_sole')
    robot.bench.clock(1_000 * MS)
    assert node.refused == {'/leg_1/wrench': 1}
    assert np.isnan(robot.bench.last(topics.SAMPLE)['force'][0]).all()
    (_, status), *_ = robot.bench.statuses('merge: refused messages')
    assert "frame_id = 'leg_2_sole' is that of another leg" in status.message


def test_a_record_that_another_node_publishes_is_not_published_but_reported(robot, capfd):
    node = robot.start()
    robot.legs(4 * MS, 1, 2)
    robot.others = ('feet/sample',)
    for number in range(2, 5):
        robot.legs(4 * MS * number, 1, 2)
        robot.bench.give(PRESSURE, fluid(4 * MS * number, 60e3), 1)
    assert len(robot.samples) == 1
    assert len(robot.bench.heard(topics.PRESSURE)) == 3  # of no other node
    assert node.contested == {'feet/sample': 3}
    robot.bench.clock(1_000 * MS)
    (_, status), *_ = robot.bench.statuses('merge: records')
    assert status.level == DiagnosticStatus.ERROR
    assert [(each.key, each.value) for each in status.values] == [('feet/sample', '3')]
    assert capfd.readouterr().err.count('feet/sample: somebody else publishes it') == 1
    robot.others = ()
    robot.legs(1_004 * MS, 1, 2)
    assert len(robot.samples) == 2


def test_a_topic_that_drivers_do_not_have_is_refused(bench):
    with pytest.raises(ConfigError, match="'wetness' is not allowed: one of wrench, posit"):
        bench.start(MergeNode, topics='wrench, wetness')
