# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json
import math
import operator

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='rclpy is needed: it serializes the messages')

from geometry_msgs.msg import PointStamped, PoseStamped, TwistWithCovarianceStamped, WrenchStamped
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure
from std_msgs.msg import Bool, Float64

from ros_pad.bags import BagWriter, topics
from ros_pad.bags.wire import Wire
from ros_pad.errors import BagError
from ros_pad.simulation import Scene
from ros_pad.trials import recorded
from ros_pad.trials.loop import ClosedLoop
from studies.closed_loop import loops

MS = 1_000_000


class Recording:
    """A bag to which ROS messages are added as objects."""

    def __init__(self, folder, **description):
        data = {'ros_pad': json.dumps(description)} if description else None
        self.folder = folder
        self.writer = BagWriter(folder, data)
        self.names = set()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.writer.close()

    def add(self, name, message, log_ns, stamp_ns=None):
        if name not in self.names:
            self.names.add(name)
            package = type(message).__module__.split('.')[0]
            self.writer.add_topic(name, f'{package}/msg/{type(message).__name__}')
        if stamp_ns is not None:
            header = message.header
            header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 10**9)
        self.writer.write(name, serialize_message(message), log_ns)


def wrench(x, y, z):
    message = WrenchStamped()
    message.wrench.force.x, message.wrench.force.y, message.wrench.force.z = x, y, z
    return message


def point(x, y, z):
    message = PointStamped()
    message.point.x, message.point.y, message.point.z = x, y, z
    return message


def pose(x, y, heading):
    message = PoseStamped()
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.z = math.sin(heading / 2.0)
    message.pose.orientation.w = math.cos(heading / 2.0)
    return message


def slip(x, y):
    message = TwistWithCovarianceStamped()
    message.twist.twist.linear.x, message.twist.twist.linear.y = x, y
    return message


def pressure(gauge):
    return FluidPressure(fluid_pressure=gauge + 101325.0)


def record(trial, records, folder):
    """Record a trial as nodes do."""
    description = {
        'scene': trial.scene,
        'floor': dataclasses.asdict(Scene.load(trial.scene).floor),
        'policy': trial.policy,
        'seed': trial.seed,
        'fidelity': trial.fidelity,
        'ambient_pressure': 101325.0,
        'lost': {},
        'repaired': False,
        'metrics': trial.metrics.as_dict(),
        'real_time_factor': 4.5,
        'settings': {'expected_load': 6.8, 'omitted': []},
    }
    kinds = (topics.SAMPLE, topics.ESTIMATE, topics.COMMAND, topics.PRESSURE)
    with Recording(folder, **description) as bag:
        for topic, block in zip(kinds, records, strict=True):
            bag.writer.add_topic(f'/{topic.name()}', topic.type_name)
            wire = Wire(topic.record, trial.legs)
            for stamp_ns, data in wire.split(wire.encode(block)):
                bag.writer.write(f'/{topic.name()}', data, stamp_ns)
        for seconds, body in zip(trial.time.tolist(), trial.body.tolist(), strict=True):
            now = round(seconds * 1e9)
            bag.add('/body/pose', pose(*body), now, now)
    return folder


def test_a_recorded_trial_is_the_trial_to_the_bit(tmp_path):
    scene = dataclasses.replace(Scene.load('hexapod_patches'), cycles=8)
    loop = ClosedLoop(scene, 'adaptive', 1, 'L1')
    loops.walk(loop)
    trial = loop.trial()
    assert trial.slow['dome'].any() and not trial.slow['dome'].all()
    assert trial.slow['slipping'].any()
    read = recorded.load(record(trial, loop.log.records, tmp_path / 'bag'))
    for name in ('time', 'force', 'position', 'slow_time', 'slow'):
        before, after = getattr(trial, name), getattr(read, name)
        assert before.dtype == after.dtype, name
        assert after.tobytes() == before.tobytes(), name
    np.testing.assert_array_equal(read.body[:, :2], trial.body[:, :2])
    np.testing.assert_allclose(read.body[:, 2], trial.body[:, 2], rtol=0.0, atol=1e-15)
    for name in ('scene', 'policy', 'seed', 'fidelity', 'legs', 'metrics'):
        assert getattr(read, name) == getattr(trial, name), name
    assert read.real_time_factor == 4.5
    assert read.settings['expected_load'] == 6.8
    np.testing.assert_array_equal(read.floor.wet_map, trial.floor.wet_map)
    np.testing.assert_array_equal(read.wet(), trial.wet())


def test_other_rates_gaps_and_missing_topics_of_a_robot(tmp_path):
    start = 1_750_000_000 * 10**9  # 2025-06-15 15:06:40 UTC
    messages = [
        (0, 'leg_2/wrench', wrench(0.5, 0.0, 4.0)),
        *((k * 10, 'leg_2/wrench', wrench(0.5, 0.0, float(k))) for k in range(1, 10)),
        # Positions of leg 2 start late and are slower; leg 5 has none.
        (25, 'leg_2/position', point(1.0, 2.0, 3.0)),
        (60, 'leg_2/position', point(4.0, 5.0, 6.0)),
        (31, 'leg_5/wrench', wrench(0.0, 0.0, 9.0)),
        # There is no estimator: pressures give the control times.
        (15, 'leg_5/pressure', pressure(20000.0)),
        (35, 'leg_5/pressure', pressure(30000.0)),
        (15, 'leg_5/pressure_setpoint', pressure(30000.0)),
        (15, 'leg_2/slip', slip(3e-3, 4e-3)),
    ]
    with Recording(tmp_path / 'bag') as bag:
        for ms, name, message in sorted(messages, key=operator.itemgetter(0)):
            bag.add(f'/spider/{name}', message, start + ms * MS, start + ms * MS)
        bag.add('/spider/joint_states', Float64(), start)
        bag.add('/other/leg_count', Float64(), start)
    trial = recorded.load(tmp_path / 'bag')
    nan = math.nan
    assert trial.legs == (2, 5)
    times = [0.0, 0.01, 0.02, 0.03, 0.031, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09]
    np.testing.assert_allclose(trial.time, times, atol=1e-12)
    np.testing.assert_array_equal(trial.force[:6, 0, 2], [4.0, 1.0, 2.0, 3.0, 3.0, 4.0])
    np.testing.assert_array_equal(trial.force[:5, 1, 2], [nan, nan, nan, nan, 9.0])
    np.testing.assert_array_equal(trial.position[:, 0, 0], [nan] * 3 + [1.0] * 4 + [4.0] * 4)
    assert np.isnan(trial.position[:, 1]).all() and np.isnan(trial.body).all()
    np.testing.assert_allclose(trial.slow_time, [0.015, 0.035], atol=1e-12)
    np.testing.assert_array_equal(trial.slow['pressure'], [[nan, 20000.0], [nan, 30000.0]])
    np.testing.assert_array_equal(trial.slow['setpoint'][:, 1], [30000.0, 30000.0])
    np.testing.assert_allclose(trial.slow['slip_speed'][:, 0], [5e-3, 5e-3], rtol=1e-12)
    assert not trial.slow['dome'].any() and not trial.slow['slipping'].any()
    assert np.isnan(trial.slow['wetness']).all()
    assert (trial.floor, trial.metrics, trial.scene, trial.policy) == (None, None, '', '')
    assert trial.settings['recorded'] == '2025-06-15 15:06:40 UTC'


def test_messages_out_of_order_and_without_stamp(tmp_path):
    with Recording(tmp_path / 'bag') as bag:
        for log, stamp, load in ((10, 30, 3.0), (11, 10, 1.0), (20, 0, 2.0)):
            bag.add('/leg_1/wrench', wrench(0.0, 0.0, load), log * MS, stamp * MS)
    trial = recorded.load(tmp_path / 'bag')
    np.testing.assert_allclose(trial.time, [0.010, 0.020, 0.030])
    np.testing.assert_array_equal(trial.force[:, 0, 2], [1.0, 2.0, 3.0])


def test_a_leg_that_is_logged_late_has_its_samples(tmp_path):
    pieces = [(4 * n + 30 * (leg == 2), leg, 4 * n) for n in range(1, 51) for leg in (1, 2)]
    with Recording(tmp_path / 'bag') as bag:
        for log, leg, stamp in sorted(pieces):
            bag.add(f'/leg_{leg}/wrench', wrench(0.0, 0.0, float(stamp)), log * MS, stamp * MS)
    trial = recorded.load(tmp_path / 'bag')
    loads = 4.0 * np.arange(1, 51)
    np.testing.assert_array_equal(trial.force[:, :, 2], np.column_stack([loads, loads]))


def test_ambient_pressure_comes_from_the_bag(tmp_path):
    with Recording(tmp_path / 'bag', ambient_pressure=95000.0) as bag:
        bag.add('/leg_1/pressure', FluidPressure(fluid_pressure=105000.0), 10 * MS, 10 * MS)
    np.testing.assert_array_equal(recorded.load(tmp_path / 'bag').slow['pressure'], [[10000.0]])


@pytest.mark.parametrize('heading', [-3.0, 1.0])
def test_heading_of_a_tilted_body(tmp_path, heading):
    # Quaternion of Rz(heading) Ry(pitch) Rx(roll), by hand.
    pitch, roll = 0.2, -0.1
    message = PoseStamped()
    cy, sy = math.cos(heading / 2), math.sin(heading / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    q = message.pose.orientation
    q.w, q.x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    q.y, q.z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    with Recording(tmp_path / 'bag') as bag:
        bag.add('/leg_1/wrench', wrench(0.0, 0.0, 1.0), 10 * MS, 10 * MS)
        bag.add('/body/pose', message, 10 * MS, 10 * MS)
    assert recorded.load(tmp_path / 'bag').body[0, 2] == pytest.approx(heading, abs=1e-12)


def test_two_robots_in_one_bag(tmp_path):
    with Recording(tmp_path / 'bag') as bag:
        bag.add('/a/leg_1/wetness', Float64(data=0.1), 10 * MS)
        bag.add('/b/leg_1/wetness', Float64(data=0.2), 10 * MS)
    with pytest.raises(BagError, match='legs in /a/, legs in /b/'):
        recorded.load(tmp_path / 'bag')
    with pytest.raises(BagError, match='in namespace /c/ is needed'):
        recorded.load(tmp_path / 'bag', namespace='c')
    for namespace in ('b', '/b', '/b/'):
        trial = recorded.load(tmp_path / 'bag', namespace=namespace)
        assert trial.slow['wetness'] == [[0.2]]


def test_bags_that_are_no_trial(tmp_path):
    with pytest.raises(BagError, match='no such bag'):
        recorded.load(tmp_path / 'nothing')
    with Recording(tmp_path / 'clock') as bag:
        bag.add('/clock', Clock(), 1)
        for name in ('wetness', 'leg_1/wetness', '/a\nb/leg_1/wetness'):
            bag.add(name, Float64(), 1)
        bag.add('/leg_1/wrenches', wrench(0.0, 0.0, 1.0), 1, 1)
        bag.add('/body/pose', pose(0.0, 0.0, 0.0), 1, 1)
    with pytest.raises(BagError, match='no topics of legs'):
        recorded.load(tmp_path / 'clock')
    with Recording(tmp_path / 'type') as bag:
        bag.add('/leg_1/wetness', Bool(data=True), 1)
    with pytest.raises(BagError, match='/leg_1/wetness is a std_msgs/msg/Bool: std_msgs/msg/F'):
        recorded.load(tmp_path / 'type')
    with Recording(tmp_path / 'label', metrics={'distance_m': 1.0}) as bag:
        bag.add('/leg_1/wetness', Float64(data=0.5), 1)
    with pytest.raises(BagError, match='does not describe a trial'):
        recorded.load(tmp_path / 'label')


def test_a_bag_that_was_not_closed_is_reported(tmp_path):
    bag = Recording(tmp_path / 'bag')
    for number in range(1, 20000):
        bag.add('/leg_1/wetness', Float64(data=number / 20000), number * MS)
    bag.writer.flush()
    with pytest.warns(UserWarning, match='was not closed'):
        trial = recorded.load(tmp_path / 'bag')
    assert 'was not closed' in trial.settings['problem']
    assert len(trial.slow_time) > 1000
    bag.writer.close()
