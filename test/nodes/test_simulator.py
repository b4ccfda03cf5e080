# SPDX-License-Identifier: Apache-2.0
"""The simulator node: pressure records in, samples of a simulated robot out."""

import math
import types
from functools import partial

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from helpers import MS, nanoseconds, record

from ros_pad import configuration
from ros_pad.bags import topics
from ros_pad.nodes import simulator
from ros_pad.nodes.simulator import HIGHEST, SimulatorNode
from ros_pad.records import PRESSURE

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
STEPPED = {'use_sim_time': False, 'publish_clock': True}
REAL = {'use_sim_time': False}
END_NS = 10**15


@pytest.fixture
def start(bench):
    """Return a function that starts a simulator which the test steps."""

    def start(**parameters):
        node = bench.start(partial(SimulatorNode, False), **(STEPPED | parameters))
        bench.legs = tuple(node.scene.legs)
        bench.sent.clear()
        return node

    return start


def samples(bench):
    """Return the stamps of all samples, ms, and their rows."""
    blocks = bench.heard(topics.SAMPLE)
    stamps = np.concatenate([each.stamps for each in blocks])
    return (stamps / MS).tolist(), np.concatenate([each.rows for each in blocks])


def test_a_step_is_a_block_of_all_samples_up_to_the_next_control_moment(start, bench):
    node = start(fidelity='L1')
    assert [node.step(36 * MS) for _ in range(3)] == [True, True, False]  # it ends before one
    assert [(each.stamps // MS).tolist() for each in bench.heard(topics.SAMPLE)] == [
        [4], [8, 12, 16, 20], [24, 28, 32, 36]
    ]  # fmt: skip
    poses = [nanoseconds(each.header.stamp) // MS for each in bench.heard(topics.BODY_POSE)]
    assert poses == [*range(4, 37, 4)]
    assert [nanoseconds(each.clock) // MS for each in bench.heard(topics.CLOCK)] == [4, 20, 36]
    rows = bench.heard(topics.SAMPLE)[0].rows[0]
    # The robot, 2.09 kg, stands on six legs; the noise is 0.03 N per leg.
    assert rows['force'][:, 2].sum() == pytest.approx(2.09 * 9.81, abs=0.5)
    pose = bench.heard(topics.BODY_POSE)[0]
    q = pose.pose.orientation
    assert pose.header.frame_id == 'world'
    assert (q.x, q.y, math.hypot(q.z, q.w)) == (0.0, 0.0, pytest.approx(1.0))
    # In the thesis legs 1 to 3 are on the left; legs 1 and 6 are in front.
    x, y, _ = rows['position'].T
    assert [leg for leg in range(1, 7) if y[leg - 1] > 0.0] == [1, 2, 3]
    assert [leg for leg in range(1, 7) if x[leg - 1] > 0.1] == [1, 6]


def test_the_answer_to_the_last_samples_is_told_once(start, bench):
    node, told = start(fidelity='L0', scene='leg_wet_dome_40'), []
    node.answered = lambda: told.append(node.time_ns)
    for _ in range(3):
        node.step(END_NS)
        now_ns = node.time_ns
        for stamp_ns in (now_ns - 20 * MS, now_ns + 20 * MS):  # of another moment
            bench.give(topics.PRESSURE, pressure_of(node, stamp_ns, 0.0))
        assert now_ns not in told
        bench.give(topics.PRESSURE, pressure_of(node, now_ns, 0.0))
        assert told[-1] == now_ns
    assert len(told) == 3


def pressure_of(node, stamp_ns, gauge, **more):
    return record(PRESSURE, stamp_ns, len(node.scene.legs), pressure=gauge, **more)


def test_full_dynamics_publish_the_joints(start, bench):
    node = start(fidelity='L2')
    seen = []
    for _ in range(100):
        node.step(END_NS)
        seen.append(node.robot.joint_positions)
    heard = bench.heard(topics.JOINT_STATES)
    assert [nanoseconds(each.header.stamp) for each in heard[:2]] == [4 * MS, 20 * MS]
    assert {tuple(each.name) for each in heard} == {tuple(node.robot.joint_names)}
    assert len(set(node.robot.joint_names)) == 18
    assert [tuple(each.position) for each in heard] == seen
    # The robot stands first and walks then; each joint moves within what a leg can do.
    travel = np.ptp(seen, axis=0)
    assert np.all(travel > 0.001) and np.all(travel < 1.5)


def test_sensors_of_joints_are_imu_joints_and_forces_in_the_axes_of_the_feet(start, bench):
    node = start(sensing='joints', scene='hexapod_patches')
    for _ in range(5):
        node.step(END_NS)
    assert '/feet/sample' not in bench.sent
    stamps = [each for block in bench.heard(topics.FORCE) for each in block.stamps.tolist()]
    for topic in (topics.IMU, topics.JOINT_STATES):
        assert [nanoseconds(each.header.stamp) for each in bench.heard(topic)] == stamps
    last = bench.heard(topics.FORCE)[-1].rows[-1]
    assert np.isfinite(last['force']).all() and np.isnan(last['position']).all()
    assert len(bench.heard(topics.JOINT_STATES)[-1].effort) == 18
    assert bench.heard(topics.IMU)[-1].orientation_covariance[0] == -1.0


def test_the_rate_is_measured_from_the_first_tick(bench, monkeypatch, capfd):
    """A start that takes long is no reason to warn; the time here is not that of the machine."""
    node = bench.start(SimulatorNode, **REAL, scene='leg_wet_dome_40', fidelity='L0')
    timer, reports = (each.callback for each in node.timers)
    now = 10**12
    monkeypatch.setattr(simulator, 'time', types.SimpleNamespace(monotonic_ns=lambda: now))
    reports()
    assert not bench.statuses('rate')
    timer()
    assert node.robot.time == 0.0
    # Twenty-five samples at a time are caught up with; of fifty, the others are left out.
    for step_ms, end in ((20, 1.0), (100, 2.0), (200, 2.5)):
        for _ in range(1000 // step_ms):
            now += step_ms * MS
            timer()
        assert node.robot.time == pytest.approx(end)
        reports()
    statuses = [status for _, status in bench.statuses('rate')]
    assert [figures(each) for each in statuses] == [
        [250.0, 250.0, 1.0], [250.0, 250.0, 1.0], [250.0, 125.0, 0.5]
    ]  # fmt: skip
    assert [each.level for each in statuses] == [OK, OK, WARN]
    assert statuses[0].message == '250 of 250 samples a second'
    assert capfd.readouterr().err.count('too slow: 125 of 250 samples a second') == 1
    bench.legs = (1,)
    assert len(samples(bench)[0]) == 625


def figures(status):
    return [float(each.value) for each in status.values]


def test_it_does_not_wait_for_its_own_clock(bench):
    bench.start(SimulatorNode, use_sim_time=True, publish_clock=True)
    bench.until(lambda: len(bench.sent['/clock']) > 5)
    stamps = np.array([nanoseconds(each.clock) for each in bench.heard(topics.CLOCK)])
    assert (np.diff(stamps) > 0).all() and not (stamps % (4 * MS)).any()


def test_it_reports_the_fidelity_level_and_the_end_of_the_walk(bench, tmp_path, capfd):
    """The log reports a robot that has fallen, which topics alone do not show."""
    text = (configuration.shared_folder() / 'scenes' / 'hexapod_patches.yaml').read_text()
    top_heavy = tmp_path / 'top_heavy.yaml'
    top_heavy.write_text(f'{text}\nbody: {{height: 0.9}}\n')
    node = bench.start(SimulatorNode, **REAL, scene=str(top_heavy), fidelity='L1')
    bench.until(lambda: node.robot.verdict)
    bench.until(lambda end=node.robot.time + 0.1: node.robot.time > end)
    log = capfd.readouterr().err
    assert 'top_heavy on L1: ' in log
    assert log.count('tip-over at') == 1


def test_domes_walk_further_on_wet_ground(start, bench):
    """The simulator receives the pressure from its topic only."""

    def way(**row):
        node = start(scene='hexapod_smooth_wet_flat')
        bench.give(topics.PRESSURE, record(PRESSURE, 1, 6, **row))
        while node.time_ns < 4e9:
            node.step(END_NS)
        bench.stop()
        return node.robot.body[0]

    flat, dome = way(pressure=0.0), way(pressure=75e3)
    assert dome > 1.2 * flat > 0.0
    # What a simulated device reports is not the pressure of its pad.
    assert way(pressure=0.0, pad=75e3) == dome


def test_a_pressure_that_is_none_changes_nothing(start, bench):
    node = start(scene='leg_wet_dome_40', fidelity='L0')
    taken = []
    for gauge in (50e3, math.nan, math.inf, -math.inf, 2.0 * HIGHEST, -3.0):
        bench.give(topics.PRESSURE, pressure_of(node, 1, gauge))
        taken.append(node.pressures[0])
    # Values that are not finite are ignored; slightly below ambient counts as zero.
    assert taken == [50e3] * 5 + [0.0]
